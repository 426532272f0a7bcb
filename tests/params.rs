//! Tests of params.
