//! NumPy .npy arrays.
