//! white
