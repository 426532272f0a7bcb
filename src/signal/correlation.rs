//! Autocovariance, autocorrelation and Ljung-Box ingredients (FFT for long series).
