//! Tests of noise.
