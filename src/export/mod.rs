//! Getting results out (floor 6): tables as csv, csv.gz and npy, written atomically.

pub mod atomic;
pub mod table;
