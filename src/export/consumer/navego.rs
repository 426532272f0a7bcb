//! NaveGo, a MATLAB/Octave script. Source: rodralez/navego: `arw` in unit/√Hz, `gb_dyn` σ and `gb_corr` Tc of the Gauss-Markov drift, exact step.

use super::{Export, Written, exponent};
use crate::units::Quantity;

pub(super) fn write(export: &Export) -> Result<Written, String> {
    let mut text = export.head(
        "%",
        &["NaveGo: SI; gb_dyn and ab_dyn are the sigma of the Gauss-Markov drift, gb_corr and ab_corr its time"],
    );
    let mut warnings = Vec::new();
    let sensors = [
        (Quantity::AngularRate, "arw", "gb_dyn", "gb_corr", "rrw"),
        (Quantity::SpecificForce, "vrw", "ab_dyn", "ab_corr", "vrrw"),
    ];
    for (quantity, white, dyn_name, corr_name, walk_name) in sensors {
        let Some(sensor) = export.sensor(quantity) else { continue };
        let row = |values: [f64; 3]| format!("[{}]", values.map(exponent).join(" "));
        let factor = export.inflation;
        text.push_str(&format!("imu.{white} = {};\n", row(sensor.three(|n| n.white.value * factor)?)));
        text.push_str(&format!("imu.{walk_name} = {};\n", row(sensor.three(|n| n.rate_random_walk * factor)?)));
        let of_processes = |n: &super::Numbers| super::Numbers { rate_random_walk: 0.0, ..n.clone() }.single_process();
        let sigma = sensor.three(|n| of_processes(n).map_or(0.0, |p| p.std_dev) * factor)?;
        let time = sensor.three(|n| of_processes(n).map_or(f64::INFINITY, |p| p.correlation_time))?;
        let times = time.map(|t| if t.is_finite() { exponent(t) } else { "Inf".into() });
        text.push_str(&format!("imu.{dyn_name} = {};\nimu.{corr_name} = [{}];\n", row(sigma), times.join(" ")));
        if sensor.axes.iter().any(|n| n.processes.len() > 1) {
            warnings.push("several drifts became one of the same variance and the same growth over short times".into());
        }
    }
    text.push_str(&format!("imu.freq = {};\n", export.rate()));
    Ok(Written { text, warnings })
}
