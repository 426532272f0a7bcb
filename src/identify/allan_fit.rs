//! Weighted fit of the whole Allan curve.
