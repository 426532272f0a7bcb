//! NaveGo, a MATLAB/Octave script. Source: rodralez/navego: `arw` in unit/√Hz, `gb_dyn` σ and `gb_corr` Tc of the
//! Gauss-Markov drift, exact step.

use super::page::Page;
use super::{Export, exponent};
use crate::units::Quantity;

pub(super) fn write(export: &Export, page: &mut Page) -> Result<(), String> {
    page.mark = "%";
    page.about(&[
        "NaveGo: SI; gb_dyn and ab_dyn are the sigma of the Gauss-Markov drift, gb_corr and ab_corr its time",
    ]);
    let sensors = [
        (Quantity::AngularRate, "arw", "gb_dyn", "gb_corr", "rrw"),
        (Quantity::SpecificForce, "vrw", "ab_dyn", "ab_corr", "vrrw"),
    ];
    for (quantity, white, dyn_name, corr_name, walk_name) in sensors {
        let Some(sensor) = export.sensor(quantity) else { continue };
        let found = export.processes(page, sensor, true, false)?;
        let of = |name: &str| found.iter().zip(&sensor.axes).find(|(_, n)| n.name == name).map(|(drift, _)| *drift);
        let process = |name: &str| of(name).and_then(|(process, _)| process);
        let row = |values: [f64; 3]| format!("[{}]", values.map(exponent).join(" "));
        let n = sensor.three(|n| n.white.value * export.inflation)?;
        let walk = sensor.three(|n| of(&n.name).map_or(0.0, |(_, walk)| walk))?;
        let sigma = sensor.three(|n| process(&n.name).map_or(0.0, |p| p.std_dev))?;
        let time = sensor.three(|n| process(&n.name).map_or(f64::INFINITY, |p| p.correlation_time))?;
        let times = time.map(|t| if t.is_finite() { exponent(t) } else { "Inf".into() });
        page.body.push_str(&format!("imu.{white} = {};\n", row(n)));
        page.body.push_str(&format!("imu.{walk_name} = {};\n", row(walk)));
        page.body.push_str(&format!("imu.{dyn_name} = {};\nimu.{corr_name} = [{}];\n", row(sigma), times.join(" ")));
    }
    page.body.push_str(&format!("imu.freq = {};\n", export.rate()));
    Ok(())
}
