//! Gazebo IMU plugins (RotorS and PX4 dialect), an SDF fragment. Source: their documentation: white densities,
//! driving densities K of Gauss-Markov drifts with their correlation times, turn-on bias.

use super::numbers::GaussMarkov;
use super::page::Page;
use super::{Export, device, exponent, missing};
use crate::units::Quantity;

pub(super) fn write(export: &Export, page: &mut Page) -> Result<(), String> {
    page.mark = "   ";
    page.about(&["Gazebo IMU plugin: N, the driving density K = sigma sqrt(2/Tc) of the Gauss-Markov drift, Tc"]);
    for (quantity, name) in [(Quantity::AngularRate, "gyroscope"), (Quantity::SpecificForce, "accelerometer")] {
        let Some((sensor, white)) = export.sensor(quantity).zip(export.white(quantity)?) else {
            page.warnings.push(missing(&format!("the {name} is missing"), "its parameters"));
            continue;
        };
        let element = |key: &str, value: f64| format!("<{name}{key}>{}</{name}{key}>\n", exponent(value));
        page.body.push_str(&element("NoiseDensity", white));
        let found = export.processes(page, sensor, false, true)?;
        let of = |axis: &str| found.iter().zip(&sensor.axes).find(|(_, n)| n.name == axis).and_then(|(p, _)| p.0);
        let driving = |p: GaussMarkov| p.std_dev * (2.0 / p.correlation_time).sqrt();
        let walk = sensor.one(&export.choice, |n| of(&n.name).map(driving))?;
        match walk.zip(sensor.one(&export.choice, |n| of(&n.name).map(|p| p.correlation_time))?) {
            Some((walk, time)) => {
                page.body.push_str(&element("RandomWalk", walk));
                page.body.push_str(&element("BiasCorrelationTime", time));
            }
            None if export.allow_zero_walk => page.body.push_str(&element("RandomWalk", 0.0)),
            None => {
                let words = format!(
                    "{name}RandomWalk: no drift of the {} is known; left out, so that the default stays",
                    device(quantity)
                );
                page.remark(&words);
                page.warnings.push(words);
            }
        }
        if let Some(turn_on) = export.turn_on(quantity)? {
            page.body.push_str(&element("TurnOnBiasSigma", turn_on));
        }
    }
    Ok(())
}
