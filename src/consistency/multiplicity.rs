//! multiplicity
