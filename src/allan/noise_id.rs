//! noise_id
