//! normalized
