//! ORB-SLAM3 yaml. Source: UZ-SLAMLab/ORB_SLAM3, src/ImuTypes.cc, Settings.cc: white times √IMU.Frequency, walk over it, so that field must be the true
//! rate; numbers must be real (with a decimal point).

use super::{Export, Written, exponent, lacking, walk_unit};
use crate::units::Quantity;

pub(super) fn write(export: &Export) -> Result<Written, String> {
    let mut text = String::from("%YAML:1.0\n");
    text.push_str(&export.walk_head(
        "#",
        &[
            "ORB-SLAM3: continuous densities; the code uses sqrt(IMU.Frequency), which must be the true rate",
            "IMU.T_b_c1 is not known here",
        ],
    ));
    let mut warnings = Vec::new();
    let sensors = [(Quantity::AngularRate, "Gyro"), (Quantity::SpecificForce, "Acc")];
    for (quantity, name) in sensors {
        let unit = quantity.si_unit();
        match export.white_and_walk(quantity)? {
            Some((white, walk)) => {
                text.push_str(&format!("IMU.Noise{name}: {}  # {unit}/sqrt(Hz)\n", exponent(white)));
                text.push_str(&format!("IMU.{name}Walk: {}  # {}\n", exponent(walk), walk_unit(quantity)));
            }
            None => {
                warnings.push(lacking(quantity));
                text.push_str(&format!("# IMU.Noise{name}:  # missing\n# IMU.{name}Walk:  # missing\n"));
            }
        }
    }
    text.push_str(&format!("IMU.Frequency: {:.3}\n", export.rate()));
    Ok(Written { text, warnings })
}
