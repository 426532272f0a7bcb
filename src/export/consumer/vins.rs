//! VINS-Mono and VINS-Fusion yaml. Source: HKUST-Aerial-Robotics/VINS-Fusion, vins_estimator/src/factor/integration_base.h: per step the angle has the
//! variance ½ dt² gyr_n² and the bias dt² gyr_w². Physical are N² dt and K² dt, so gyr_n = N √(2/dt) and gyr_w = K/√dt.

use super::{Export, Written, exponent, lacking};
use crate::units::Quantity;

pub(super) fn write(export: &Export) -> Result<Written, String> {
    let rate = export.rate();
    let line = format!("at {rate} Hz: with another rate these numbers are wrong");
    let mut text = String::from("%YAML:1.0\n");
    text.push_str(&export.walk_head(
        "#",
        &[
            "VINS-Mono / VINS-Fusion: discrete numbers. The code gives an angle step the variance dt^2 gyr_n^2 / 2 and a bias step dt^2 gyr_w^2,",
            "so gyr_n = N sqrt(2/dt) (the customary N/sqrt(dt) is sqrt(2) less) and gyr_w = K/sqrt(dt)",
            &line,
        ],
    ));
    let mut warnings = Vec::new();
    let sensors = [(Quantity::SpecificForce, "acc"), (Quantity::AngularRate, "gyr")];
    for (quantity, name) in sensors {
        match export.white_and_walk(quantity)? {
            Some((white, walk)) => {
                text.push_str(&format!("{name}_n: {}\n", exponent(white * (2.0 * rate).sqrt())));
                text.push_str(&format!("{name}_w: {}\n", exponent(walk * rate.sqrt())));
            }
            None => {
                warnings.push(lacking(quantity));
                text.push_str(&format!("# {name}_n:  # missing\n# {name}_w:  # missing\n"));
            }
        }
    }
    text.push_str("g_norm: 9.80665\n");
    Ok(Written { text, warnings })
}
