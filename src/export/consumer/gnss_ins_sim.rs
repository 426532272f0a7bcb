//! gnss-ins-sim, a Python dictionary. Source: Aceinna/gnss-ins-sim, sim/imu_model.py: gyro in deg/h and deg/√h, a
//! Gauss-Markov drift that starts at zero; an infinite correlation time makes white noise there, so it is never
//! written.

use super::numbers::{GaussMarkov, SLOWEST};
use super::page::Page;
use super::{Export, exponent};
use crate::units::Quantity;

pub(super) fn write(export: &Export, page: &mut Page) -> Result<(), String> {
    let degree = std::f64::consts::PI / 180.0;
    page.about(&[
        "gnss-ins-sim: angle random walk deg/sqrt(h), bias stability = sigma of the Gauss-Markov drift in deg/h, its \
         correlation time in s;",
        "the simulated drift starts at zero: leave the first two correlation times out",
    ]);
    page.body.push_str("import numpy as np\n\nimu_err = {\n");
    let sensors = [
        (Quantity::AngularRate, "gyro", "arw", 60.0 / degree, 3600.0 / degree, "deg/h"),
        (Quantity::SpecificForce, "accel", "vrw", 60.0, 1.0, "m/s^2"),
    ];
    for (quantity, name, white_name, white_scale, drift_scale, unit) in sensors {
        let Some(sensor) = export.sensor(quantity) else { continue };
        if sensor.axes.iter().any(|n| n.rate_random_walk > 0.0) {
            return Err(format!(
                "the {name} has a rate random walk, which gnss-ins-sim does not have (its infinite correlation time is \
                 white noise); identify with \
                 `model` white+gm"
            ));
        }
        let found = export.processes(page, sensor, false, false)?;
        let row = |values: [f64; 3]| format!("np.array([{}])", values.map(exponent).join(", "));
        let white = sensor.three(|n| n.white.value * white_scale * export.inflation)?;
        // a drift of size zero still needs a time
        let none = GaussMarkov { std_dev: 0.0, correlation_time: SLOWEST };
        let of = |name: &str| {
            found.iter().zip(&sensor.axes).find(|(_, n)| n.name == name).and_then(|(p, _)| p.0).unwrap_or(none)
        };
        let sigma = sensor.three(|n| of(&n.name).std_dev * drift_scale)?;
        let time = sensor.three(|n| of(&n.name).correlation_time)?;
        page.body.push_str(&format!("    '{name}_b': np.zeros(3),  # {unit}, the constant bias\n"));
        page.body.push_str(&format!("    '{name}_{white_name}': {},\n", row(white)));
        page.body.push_str(&format!("    '{name}_b_stability': {},  # {unit}\n", row(sigma)));
        page.body.push_str(&format!("    '{name}_b_corr': {},  # s\n", row(time)));
    }
    page.body.push_str("}\n");
    Ok(())
}
