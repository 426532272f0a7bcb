//! discretize
