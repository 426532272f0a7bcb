//! PX4 EKF2, a QGroundControl `.params` file. Source: PX4/PX4-Autopilot, src/modules/ekf2: (dt p)² per step of the filter for the angle and for the bias,
//! so p = N/√dt and p = K/√dt with the filter's own step, EKF2_PREDICT_US.

use super::{Export, Written, clamped, missing, plain};
use crate::units::Quantity;

/// EKF2_PREDICT_US as shipped, s.
const STEP: f64 = 0.01;

pub(super) fn write(export: &Export) -> Result<Written, String> {
    let dt = export.rate_hz.map_or(STEP, |rate| 1.0 / rate);
    let mut warnings = Vec::new();
    let step =
        format!("per step of EKF2: dt = {} s (EKF2_PREDICT_US); with another step these numbers are wrong", plain(dt));
    let mut text = export.walk_head("#", &["PX4 EKF2: N/sqrt(dt) and K/sqrt(dt)", &step]);
    text.push_str("# Vehicle-Id Component-Id Name Value Type\n");
    let mut put = |name: &str, value: f64, low: f64, high: f64| {
        let value = clamped(name, value, low, high, &mut warnings);
        text.push_str(&format!("1\t1\t{name}\t{}\t9\n", plain(value)));
    };
    let root = dt.sqrt();
    if let Some((white, walk)) = export.white_and_walk(Quantity::AngularRate)? {
        put("EKF2_GYR_NOISE", white / root, 0.0001, 0.1);
        put("EKF2_GYR_B_NOISE", walk / root, 0.0, 0.01);
        if let Some(turn_on) = export.one(Quantity::AngularRate, |n| n.turn_on.unwrap_or(0.0))?.filter(|v| *v > 0.0) {
            put("EKF2_GBIAS_INIT", turn_on / export.inflation, 0.0, 0.2);
        }
    }
    if let Some((white, walk)) = export.white_and_walk(Quantity::SpecificForce)? {
        put("EKF2_ACC_NOISE", white / root, 0.01, 1.0);
        put("EKF2_ACC_B_NOISE", walk / root, 0.0, 0.01);
        if let Some(turn_on) = export.one(Quantity::SpecificForce, |n| n.turn_on.unwrap_or(0.0))?.filter(|v| *v > 0.0) {
            put("EKF2_ABIAS_INIT", turn_on / export.inflation, 0.0, 0.5);
        }
    } else {
        warnings.push(missing("no accelerometer: only the gyro's parameters are written", "--accelerometer PARAMS"));
    }
    Ok(Written { text, warnings })
}
