//! Noise parameters to a filter design: augmentation, steady state, predicted sigma(t), error budget (floor 4).
