//! Kalibr, `imu.yaml`. Source: ethz-asl/kalibr, kalibr_common/ConfigReader.py: continuous densities; the white ones are divided by √dt
//! there, the walks are used as they are; all four must be positive.

use super::{Export, Written, exponent, walk_unit};
use crate::units::Quantity;

pub(super) fn write(export: &Export) -> Result<Written, String> {
    let mut text = export.walk_head(
        "#",
        &["Kalibr imu.yaml: continuous densities; Kalibr itself makes N*sqrt(update_rate) of the white ones and takes the walks as they are"],
    );
    let mut warnings = Vec::new();
    four(export, "", &mut text, &mut warnings)?;
    text.push_str("rostopic: /imu0\n");
    text.push_str(&format!("update_rate: {:.3}  # Hz\n", export.rate()));
    Ok(Written { text, warnings })
}

/// The four numbers that Kalibr and OpenVINS share.
pub(super) fn four(export: &Export, indent: &str, text: &mut String, warnings: &mut Vec<String>) -> Result<(), String> {
    for (quantity, name, flag) in [
        (Quantity::AngularRate, "gyroscope", "the parameters of a gyro"),
        (Quantity::SpecificForce, "accelerometer", "--accelerometer PARAMS"),
    ] {
        let unit = quantity.si_unit();
        match export.white_and_walk(quantity)? {
            Some((white, walk)) => {
                if walk == 0.0 {
                    warnings.push(format!(
                        "{name}_random_walk is 0: no drift was identified, and the reader refuses a zero"
                    ));
                }
                text.push_str(&format!("{indent}{name}_noise_density: {}  # {unit}/sqrt(Hz)\n", exponent(white)));
                text.push_str(&format!("{indent}{name}_random_walk: {}  # {}\n", exponent(walk), walk_unit(quantity)));
            }
            None => {
                warnings.push(format!("the {name} is missing, and the reader needs it: give {flag}"));
                text.push_str(&format!(
                    "# {indent}{name}_noise_density:  # missing\n# {indent}{name}_random_walk:  # missing\n"
                ));
            }
        }
    }
    Ok(())
}
