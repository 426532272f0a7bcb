//! whiteness
