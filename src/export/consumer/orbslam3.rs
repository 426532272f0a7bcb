//! ORB-SLAM3 yaml. Source: UZ-SLAMLab/ORB_SLAM3, src/ImuTypes.cc, Settings.cc: white times √IMU.Frequency, walk over
//! it, so that field must be the true rate; numbers must be real (with a decimal point).

use super::page::Page;
use super::walk::Field;
use super::{Export, exponent, lacking, walk_unit};
use crate::units::Quantity;

pub(super) fn write(export: &Export, page: &mut Page) -> Result<(), String> {
    page.first = "%YAML:1.0\n";
    page.about(&[
        "ORB-SLAM3: continuous densities; the code uses sqrt(IMU.Frequency), which must be the true rate",
        "IMU.T_b_c1 is not known here",
    ]);
    for (quantity, name) in [(Quantity::AngularRate, "Gyro"), (Quantity::SpecificForce, "Acc")] {
        let unit = quantity.si_unit();
        let Some(white) = export.white(quantity)? else {
            page.warnings.push(lacking(quantity));
            page.remark(&format!("IMU.Noise{name}:  # missing"));
            page.remark(&format!("IMU.{name}Walk:  # missing"));
            continue;
        };
        page.body.push_str(&format!("IMU.Noise{name}: {}  # {unit}/sqrt(Hz)\n", exponent(white)));
        let key = format!("IMU.{name}Walk");
        let field = Field { quantity, name: &key, scale: 1.0, range: None, default: false };
        if let Some(walk) = export.walk(page, &field)? {
            page.body.push_str(&format!("{key}: {}  # {}\n", exponent(walk), walk_unit(quantity)));
        }
    }
    page.body.push_str(&format!("IMU.Frequency: {:.3}\n", export.rate()));
    Ok(())
}
