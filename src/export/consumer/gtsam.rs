//! GTSAM, a Python snippet. Source: borglab/gtsam, navigation/PreintegrationParams.h and CombinedImuFactor.cpp:
//! continuous power densities, divided and multiplied by dt there.

use super::page::Page;
use super::walk::Field;
use super::{Export, device, exponent, missing};
use crate::units::Quantity;

pub(super) fn write(export: &Export, page: &mut Page) -> Result<(), String> {
    page.about(&["GTSAM PreintegrationCombinedParams: squares of continuous densities"]);
    page.body.push_str(
        "import numpy as np\nimport gtsam\n\nparams = gtsam.PreintegrationCombinedParams.MakeSharedU(9.80665)\n",
    );
    let sensors = [
        (Quantity::AngularRate, "Gyroscope", "BiasOmega", "rad^2/s^2/Hz", "rad^2/s^4/Hz"),
        (Quantity::SpecificForce, "Accelerometer", "BiasAcc", "m^2/s^4/Hz", "m^2/s^6/Hz"),
    ];
    for (quantity, white_name, walk_name, white_unit, walk_unit) in sensors {
        let Some(white) = export.white(quantity)? else {
            page.warnings.push(missing(&format!("the {} is missing", device(quantity)), "its parameters"));
            continue;
        };
        let line = |name: &str, value: f64, unit: &str| {
            format!("params.set{name}Covariance({} * np.eye(3))  # {unit}\n", exponent(value * value))
        };
        page.body.push_str(&line(white_name, white, white_unit));
        let name = format!("{walk_name}Covariance");
        // the class starts from the identity, 1 rad^2/s^4/Hz, which is no default to stay with
        let field = Field { quantity, name: &name, scale: 1.0, range: None, default: false };
        if let Some(walk) = export.walk(page, &field)? {
            page.body.push_str(&line(walk_name, walk, walk_unit));
        }
    }
    page.body.push_str("params.setIntegrationCovariance(1e-8 * np.eye(3))\n");
    Ok(())
}
