//! MATLAB, a script of gyroparams and accelparams for imuSensor. Source: reference pages of gyroparams, accelparams, imuSensor (R2023b and later).
//!
//! NoiseType is written as single-sided: with the default, double-sided, the same numbers give N/√2. A Gauss-Markov drift is the filter 1/(1 − a z⁻¹) on
//! white noise of deviation σ √(1 − a²) (BiasInstability); MATLAB's own coefficients are another process.

use super::{Export, Written, exponent};
use crate::units::Quantity;

pub(super) fn write(export: &Export) -> Result<Written, String> {
    let dt = 1.0 / export.rate();
    let rate = format!("the bias-instability filter below is for {} Hz", export.rate());
    let mut text = export.head(
        "%",
        &[
            "MATLAB imuSensor: NoiseType single-sided, so that NoiseDensity is N; with the default, double-sided, it would be N/sqrt(2)",
            &rate,
            "not run in MATLAB by the author of this file: compare once with allanvar",
        ],
    );
    let mut warnings = Vec::new();
    text.push_str(&format!("imu = imuSensor('SampleRate', {});\n", export.rate()));
    for (quantity, property, function) in
        [(Quantity::AngularRate, "Gyroscope", "gyroparams"), (Quantity::SpecificForce, "Accelerometer", "accelparams")]
    {
        let Some(sensor) = export.sensor(quantity) else { continue };
        let row = |values: [f64; 3]| format!("[{}]", values.map(|v| exponent(v * export.inflation)).join(", "));
        let white = sensor.three(|n| n.white.value)?;
        let walk = sensor.three(|n| n.rate_random_walk)?;
        let time = export.one(quantity, |n| n.single_process().map_or(0.0, |p| p.correlation_time))?;
        text.push_str(&format!(
            "imu.{property} = {function}('NoiseType', 'single-sided', ...\n    'NoiseDensity', {}, ...\n    'RandomWalk', {}",
            row(white),
            row(walk)
        ));
        // one filter for all axes: its coefficients are those of the longest correlation time or of the chosen axis
        if let Some(time) = time.map(|t| t / export.inflation).filter(|t| *t > 0.0) {
            let gain = (-(-2.0 * dt / time).exp_m1()).sqrt();
            let sigma = sensor.three(|n| n.single_process().map_or(0.0, |p| p.std_dev))?;
            text.push_str(&format!(
                ", ...\n    'BiasInstability', {}, ...\n    'BiasInstabilityCoefficients', struct('Numerator', 1, 'Denominator', [1, {:.13}])",
                row(sigma.map(|s| s * gain)),
                -(-dt / time).exp()
            ));
        }
        text.push_str(");\n");
        if sensor.axes.iter().any(|n| n.rate_random_walk > 0.0 && !n.processes.is_empty()) {
            warnings.push(format!(
                "{property}: beside a random walk the Gauss-Markov drift is left out; BiasInstability has one filter"
            ));
        }
    }
    Ok(Written { text, warnings })
}
