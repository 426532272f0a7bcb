//! ArduPilot EKF3, a Mission Planner `.param` file. Source: AP_NavEKF3: (dt p)² per step for the angle, (dt² p)² for the bias of the delta angle, so
//! p = N/√dt and p = K/√dt with EKF_TARGET_DT = 0.012 s.

use super::{Export, Written, clamped, missing, plain};
use crate::units::Quantity;

/// EKF_TARGET_DT, s.
const STEP: f64 = 0.012;

pub(super) fn write(export: &Export) -> Result<Written, String> {
    let dt = export.rate_hz.map_or(STEP, |rate| 1.0 / rate);
    let mut warnings = Vec::new();
    let step = format!("per step of EKF3: dt = {} s (EKF_TARGET_DT)", plain(dt));
    let mut text = export.walk_head("#", &["ArduPilot EKF3: N/sqrt(dt) and K/sqrt(dt)", &step]);
    let sensors = [
        (Quantity::AngularRate, "EK3_GYRO_P_NSE", [0.0001, 0.1], "EK3_GBIAS_P_NSE", [0.00001, 0.001]),
        (Quantity::SpecificForce, "EK3_ACC_P_NSE", [0.01, 1.0], "EK3_ABIAS_P_NSE", [0.00001, 0.02]),
    ];
    for (quantity, white_name, white_range, walk_name, walk_range) in sensors {
        match export.white_and_walk(quantity)? {
            Some((white, walk)) => {
                for (name, value, [low, high]) in [(white_name, white, white_range), (walk_name, walk, walk_range)] {
                    let value = clamped(name, value / dt.sqrt(), low, high, &mut warnings);
                    text.push_str(&format!("{name},{}\n", plain(value)));
                }
            }
            None => warnings.push(missing(
                &format!(
                    "no {}: its parameters are not written",
                    if quantity == Quantity::AngularRate { "gyro" } else { "accelerometer" }
                ),
                "its parameters",
            )),
        }
    }
    Ok(Written { text, warnings })
}
