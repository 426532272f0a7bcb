//! Tests of measured.
