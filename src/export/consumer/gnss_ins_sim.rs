//! gnss-ins-sim, a Python dictionary. Source: Aceinna/gnss-ins-sim, sim/imu_model.py: gyro in deg/h and deg/√h, a Gauss-Markov drift that starts at
//! zero; an infinite correlation time makes white noise there, so it is never written.

use super::{Export, Written, exponent};
use crate::units::Quantity;

pub(super) fn write(export: &Export) -> Result<Written, String> {
    let degree = std::f64::consts::PI / 180.0;
    let mut text = export.head(
        "#",
        &[
            "gnss-ins-sim: angle random walk deg/sqrt(h), bias stability = sigma of the Gauss-Markov drift in deg/h, its correlation time in s;",
            "the simulated drift starts at zero: leave the first two correlation times out",
        ],
    );
    let mut warnings = Vec::new();
    text.push_str("imu_err = {\n");
    let factor = export.inflation;
    let sensors = [
        (Quantity::AngularRate, "gyro", "arw", 60.0 / degree, 3600.0 / degree, "deg/h"),
        (Quantity::SpecificForce, "accel", "vrw", 60.0, 1.0, "m/s^2"),
    ];
    for (quantity, name, white_name, white_scale, drift_scale, unit) in sensors {
        let Some(sensor) = export.sensor(quantity) else { continue };
        if sensor.axes.iter().any(|n| n.rate_random_walk > 0.0) {
            return Err(format!(
                "the {name} has a rate random walk, which gnss-ins-sim does not have (its infinite correlation time is white noise); identify with \
                 --model white+gm"
            ));
        }
        if sensor.axes.iter().any(|n| n.processes.len() > 1) {
            warnings.push(format!(
                "{name}: several drifts became one of the same variance and the same growth over short times"
            ));
        }
        let row = |values: [f64; 3]| format!("np.array([{}])", values.map(exponent).join(", "));
        let white = sensor.three(|n| n.white.value * white_scale * factor)?;
        let sigma = sensor.three(|n| n.single_process().map_or(0.0, |p| p.std_dev) * drift_scale * factor)?;
        // a drift of size zero still needs a time
        let time = sensor.three(|n| n.single_process().map_or(100.0, |p| p.correlation_time))?;
        text.push_str(&format!("    '{name}_b': np.zeros(3),  # {unit}, the constant bias\n"));
        text.push_str(&format!("    '{name}_{white_name}': {},\n", row(white)));
        text.push_str(&format!("    '{name}_b_stability': {},  # {unit}\n", row(sigma)));
        text.push_str(&format!("    '{name}_b_corr': {},  # s\n", row(time)));
    }
    text.push_str("}\n");
    let text = text.replacen("imu_err = {", "import numpy as np\n\nimu_err = {", 1);
    Ok(Written { text, warnings })
}
