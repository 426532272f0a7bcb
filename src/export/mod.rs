//! Getting results out (floor 6): tables as csv, csv.gz and npy, test reports, parameter files for other programs, written atomically.

pub mod atomic;
pub mod consumer;
pub mod junit;
pub mod table;
