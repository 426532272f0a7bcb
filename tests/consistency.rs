//! Tests of consistency.
