//! GTSAM, a Python snippet. Source: borglab/gtsam, navigation/PreintegrationParams.h and CombinedImuFactor.cpp: continuous power densities, divided and
//! multiplied by dt there.

use super::{Export, Written, exponent, missing};
use crate::units::Quantity;

pub(super) fn write(export: &Export) -> Result<Written, String> {
    let mut text = export.walk_head("#", &["GTSAM PreintegrationCombinedParams: squares of continuous densities"]);
    text.push_str(
        "import numpy as np\nimport gtsam\n\nparams = gtsam.PreintegrationCombinedParams.MakeSharedU(9.80665)\n",
    );
    let mut warnings = Vec::new();
    let sensors = [
        (Quantity::AngularRate, "Gyroscope", "BiasOmega", "rad^2/s^2/Hz", "rad^2/s^4/Hz"),
        (Quantity::SpecificForce, "Accelerometer", "BiasAcc", "m^2/s^4/Hz", "m^2/s^6/Hz"),
    ];
    for (quantity, white_name, walk_name, white_unit, walk_unit) in sensors {
        match export.white_and_walk(quantity)? {
            Some((white, walk)) => {
                text.push_str(&format!(
                    "params.set{white_name}Covariance({} * np.eye(3))  # {white_unit}\n",
                    exponent(white * white)
                ));
                text.push_str(&format!(
                    "params.set{walk_name}Covariance({} * np.eye(3))  # {walk_unit}\n",
                    exponent(walk * walk)
                ));
            }
            None => warnings.push(missing(&format!("the {} is missing", white_name.to_lowercase()), "its parameters")),
        }
    }
    text.push_str("params.setIntegrationCovariance(1e-8 * np.eye(3))\n");
    Ok(Written { text, warnings })
}
