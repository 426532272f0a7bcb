//! Getting results out (floor 6): tables as csv, csv.gz and npy, test reports, written atomically.

pub mod atomic;
pub mod junit;
pub mod table;
