//! PX4 EKF2, a QGroundControl `.params` file. Source: PX4/PX4-Autopilot, src/modules/ekf2: (dt p)² per step of the
//! filter for the angle and for the bias, so p = N/√dt and p = K/√dt with the filter's own step, EKF2_PREDICT_US.

use super::page::Page;
use super::walk::Field;
use super::{ACCELEROMETER, Export, clamped, missing, plain};
use crate::units::Quantity;

pub(super) fn write(export: &Export, page: &mut Page) -> Result<(), String> {
    let dt = export.step();
    let root = dt.sqrt();
    let step = format!(
        "PX4 EKF2: N/sqrt(dt) and K/sqrt(dt), dt = {} s (EKF2_PREDICT_US); with another step these numbers are wrong",
        plain(dt)
    );
    page.about(&[&step]);
    page.body.push_str("# Vehicle-Id Component-Id Name Value Type\n");
    let line = |name: &str, value: f64| format!("1\t1\t{name}\t{}\t9\n", plain(value));
    let sensors = [
        (Quantity::AngularRate, "EKF2_GYR_NOISE", [0.0001, 0.1], "EKF2_GYR_B_NOISE", "EKF2_GBIAS_INIT", 0.2),
        (Quantity::SpecificForce, "EKF2_ACC_NOISE", [0.01, 1.0], "EKF2_ACC_B_NOISE", "EKF2_ABIAS_INIT", 0.5),
    ];
    for (quantity, white_name, [low, high], name, start, widest) in sensors {
        let Some(white) = export.white(quantity)? else { continue };
        page.body.push_str(&line(white_name, clamped(white_name, white / root, low, high, &mut page.warnings)));
        let field = Field { quantity, name, scale: 1.0 / root, range: Some([0.0, 0.01]), default: true };
        if let Some(walk) = export.walk(page, &field)? {
            page.body.push_str(&line(name, walk));
        }
        if let Some(turn_on) = export.turn_on(quantity)? {
            page.body.push_str(&line(start, clamped(start, turn_on, 0.0, widest, &mut page.warnings)));
        }
    }
    if export.accelerometer.is_none() {
        page.warnings.push(missing("no accelerometer: only the gyro's parameters are written", ACCELEROMETER));
    }
    Ok(())
}
