//! Tests of allan.
