//! Gazebo IMU plugins (RotorS and PX4 dialect), an SDF fragment. Source: their documentation: white densities, driving densities K of Gauss-Markov
//! drifts with their correlation times, turn-on bias.

use super::{Export, Written, exponent, missing};
use crate::units::Quantity;

pub(super) fn write(export: &Export) -> Result<Written, String> {
    let comment = export
        .head("   ", &["Gazebo IMU plugin: N, the driving density K = sigma sqrt(2/Tc) of the Gauss-Markov drift, Tc"]);
    // two hyphens would end the comment
    let mut text = format!("<!--\n{}-->\n", comment.replace("--", "- -"));
    let mut warnings = Vec::new();
    for (quantity, name, prefix) in
        [(Quantity::AngularRate, "gyroscope", "gyroscope"), (Quantity::SpecificForce, "accelerometer", "accelerometer")]
    {
        let Some((white, walk)) = export.white_and_walk(quantity)? else {
            warnings.push(missing(&format!("the {name} is missing"), "its parameters"));
            continue;
        };
        let time = export.one(quantity, |n| n.single_process().map_or(0.0, |p| p.correlation_time))?;
        let turn_on = export.one(quantity, |n| n.turn_on.unwrap_or(0.0))?;
        let element = |key: &str, value: f64| format!("<{prefix}{key}>{}</{prefix}{key}>\n", exponent(value));
        text.push_str(&element("NoiseDensity", white));
        text.push_str(&element("RandomWalk", walk));
        match time.map(|t| t / export.inflation).filter(|t| *t > 0.0) {
            Some(time) => text.push_str(&element("BiasCorrelationTime", time)),
            None => {
                warnings.push(format!("the {name} has no Gauss-Markov drift: the plugin's own correlation time stays"))
            }
        }
        if let Some(turn_on) = turn_on.map(|t| t / export.inflation).filter(|t| *t > 0.0) {
            text.push_str(&element("TurnOnBiasSigma", turn_on));
        }
    }
    Ok(Written { text, warnings })
}
