//! Getting results out (floor 6): tables as csv, csv.gz and npy, test reports, parameter files for other programs, a
//! filter as source code, written atomically.

pub mod atomic;
pub mod code;
pub mod consumer;
pub mod junit;
pub mod table;
