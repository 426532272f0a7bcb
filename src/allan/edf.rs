//! edf
