//! MATLAB, a script of gyroparams and accelparams for imuSensor. Source: reference pages of gyroparams, accelparams,
//! imuSensor (R2023b and later).
//!
//! NoiseType is written as single-sided: with the default, double-sided, the same numbers give N/√2. A Gauss-Markov
//! drift is the filter 1/(1 − a z⁻¹) on white noise of deviation σ √(1 − a²) (BiasInstability); MATLAB's own
//! coefficients are another process.

use super::page::Page;
use super::{Export, exponent};
use crate::units::Quantity;

pub(super) fn write(export: &Export, page: &mut Page) -> Result<(), String> {
    let dt = 1.0 / export.rate();
    let rate = format!(
        "the bias-instability filter is for {} Hz; not run in MATLAB by the author of this file: compare once with \
         allanvar",
        export.rate()
    );
    page.mark = "%";
    page.about(&[
        "MATLAB imuSensor: NoiseType single-sided, so that NoiseDensity is N; with the default, double-sided, it would \
         be N/sqrt(2)",
        &rate,
    ]);
    page.body.push_str(&format!("imu = imuSensor('SampleRate', {});\n", export.rate()));
    for (quantity, property, function) in
        [(Quantity::AngularRate, "Gyroscope", "gyroparams"), (Quantity::SpecificForce, "Accelerometer", "accelparams")]
    {
        let Some(sensor) = export.sensor(quantity) else { continue };
        let found = export.processes(page, sensor, true, false)?;
        let of = |name: &str| found.iter().zip(&sensor.axes).find(|(_, n)| n.name == name).map(|(drift, _)| *drift);
        let process = |name: &str| of(name).and_then(|(process, _)| process);
        let row = |values: [f64; 3]| format!("[{}]", values.map(exponent).join(", "));
        let white = sensor.three(|n| n.white.value * export.inflation)?;
        let walk = sensor.three(|n| of(&n.name).map_or(0.0, |(_, walk)| walk))?;
        page.body.push_str(&format!(
            "imu.{property} = {function}('NoiseType', 'single-sided', ...\n    'NoiseDensity', {}, ...\n    \
             'RandomWalk', {}",
            row(white),
            row(walk)
        ));
        // one filter for all axes: its coefficients are those of the longest correlation time or of the chosen axis
        if let Some(time) = sensor.one(&export.choice, |n| process(&n.name).map(|p| p.correlation_time))? {
            let gain = (-(-2.0 * dt / time).exp_m1()).sqrt();
            let sigma = sensor.three(|n| process(&n.name).map_or(0.0, |p| p.std_dev))?;
            page.body.push_str(&format!(
                ", ...\n    'BiasInstability', {}, ...\n    'BiasInstabilityCoefficients', struct('Numerator', 1, \
                 'Denominator', [1, {:.13}])",
                row(sigma.map(|s| s * gain)),
                -(-dt / time).exp()
            ));
        }
        page.body.push_str(");\n");
    }
    Ok(())
}
