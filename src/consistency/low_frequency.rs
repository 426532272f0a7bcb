//! low_frequency
