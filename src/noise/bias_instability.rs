//! bias_instability
