//! ArduPilot EKF3, a Mission Planner `.param` file. Source: AP_NavEKF3: (dt p)² per step for the angle, (dt² p)² for
//! the bias of the delta angle, so p = N/√dt and p = K/√dt with EKF_TARGET_DT = 0.012 s.

use super::page::Page;
use super::walk::Field;
use super::{Export, clamped, device, missing, plain};
use crate::units::Quantity;

pub(super) fn write(export: &Export, page: &mut Page) -> Result<(), String> {
    let dt = export.step();
    let root = dt.sqrt();
    let step = format!("ArduPilot EKF3: N/sqrt(dt) and K/sqrt(dt), dt = {} s (EKF_TARGET_DT)", plain(dt));
    page.about(&[&step]);
    let sensors = [
        (Quantity::AngularRate, "EK3_GYRO_P_NSE", [0.0001, 0.1], "EK3_GBIAS_P_NSE", [0.00001, 0.001]),
        (Quantity::SpecificForce, "EK3_ACC_P_NSE", [0.01, 1.0], "EK3_ABIAS_P_NSE", [0.00001, 0.02]),
    ];
    for (quantity, white_name, [low, high], name, range) in sensors {
        let Some(white) = export.white(quantity)? else {
            let words = format!("no {}: its parameters are not written", device(quantity));
            page.warnings.push(missing(&words, "its parameters"));
            continue;
        };
        let white = clamped(white_name, white / root, low, high, &mut page.warnings);
        page.body.push_str(&format!("{white_name},{}\n", plain(white)));
        let field = Field { quantity, name, scale: 1.0 / root, range: Some(range), default: true };
        if let Some(walk) = export.walk(page, &field)? {
            page.body.push_str(&format!("{name},{}\n", plain(walk)));
        }
    }
    Ok(())
}
