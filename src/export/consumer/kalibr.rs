//! Kalibr, `imu.yaml`. Source: ethz-asl/kalibr, kalibr_common/ConfigReader.py: continuous densities; the white ones
//! are divided by √dt there, the walks are used as they are; all four must be positive.

use super::page::Page;
use super::walk::Field;
use super::{ACCELEROMETER, Export, exponent, walk_unit};
use crate::units::Quantity;

pub(super) fn write(export: &Export, page: &mut Page) -> Result<(), String> {
    page.about(&[
        "Kalibr imu.yaml: continuous densities; Kalibr itself makes N*sqrt(update_rate) of the white ones and takes \
         the walks as they are",
    ]);
    four(export, "", page)?;
    page.body.push_str("rostopic: /imu0\n");
    page.body.push_str(&format!("update_rate: {:.3}  # Hz\n", export.rate()));
    Ok(())
}

/// The four numbers that Kalibr and OpenVINS share.
pub(super) fn four(export: &Export, indent: &str, page: &mut Page) -> Result<(), String> {
    for (quantity, name, flag) in [
        (Quantity::AngularRate, "gyroscope", "the parameters of a gyro"),
        (Quantity::SpecificForce, "accelerometer", ACCELEROMETER),
    ] {
        let unit = quantity.si_unit();
        let Some(white) = export.white(quantity)? else {
            page.warnings.push(format!("the {name} is missing, and the reader needs it: give {flag}"));
            page.remark(&format!("{indent}{name}_noise_density:  # missing"));
            page.remark(&format!("{indent}{name}_random_walk:  # missing"));
            continue;
        };
        page.body.push_str(&format!("{indent}{name}_noise_density: {}  # {unit}/sqrt(Hz)\n", exponent(white)));
        let key = format!("{name}_random_walk");
        let field = Field { quantity, name: &key, scale: 1.0, range: None, default: false };
        if let Some(walk) = export.walk(page, &field)? {
            if walk == 0.0 {
                page.warnings.push(format!("{key} is 0, which the reader refuses"));
            }
            page.body.push_str(&format!("{indent}{key}: {}  # {}\n", exponent(walk), walk_unit(quantity)));
        }
    }
    Ok(())
}
