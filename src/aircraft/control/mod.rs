//! Linear-quadratic regulator, Gramians, controllability (floor 3).
