//! Periodogram and Welch spectrum, two-sided PSD in unit²/Hz.
