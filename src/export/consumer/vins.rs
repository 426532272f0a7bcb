//! VINS-Mono and VINS-Fusion yaml. Source: HKUST-Aerial-Robotics/VINS-Fusion,
//! vins_estimator/src/factor/integration_base.h: per step the angle has the variance ½ dt² gyr_n² and the bias dt²
//! gyr_w². Physical are N² dt and K² dt, so gyr_n = N √(2/dt) and gyr_w = K/√dt.

use super::page::Page;
use super::walk::Field;
use super::{Export, exponent, lacking};
use crate::units::Quantity;

pub(super) fn write(export: &Export, page: &mut Page) -> Result<(), String> {
    let rate = export.rate();
    let line = format!(
        "so gyr_n = N sqrt(2/dt) (the customary N/sqrt(dt) is sqrt(2) less) and gyr_w = K/sqrt(dt), at {rate} Hz: with \
         another rate they are wrong"
    );
    page.first = "%YAML:1.0\n";
    page.about(&[
        "VINS-Mono / VINS-Fusion: discrete numbers. The code gives an angle step the variance dt^2 gyr_n^2 / 2 and a \
         bias step dt^2 gyr_w^2,",
        &line,
    ]);
    for (quantity, name) in [(Quantity::SpecificForce, "acc"), (Quantity::AngularRate, "gyr")] {
        let Some(white) = export.white(quantity)? else {
            page.warnings.push(lacking(quantity));
            page.remark(&format!("{name}_n:  # missing"));
            page.remark(&format!("{name}_w:  # missing"));
            continue;
        };
        page.body.push_str(&format!("{name}_n: {}\n", exponent(white * (2.0 * rate).sqrt())));
        let key = format!("{name}_w");
        let field = Field { quantity, name: &key, scale: rate.sqrt(), range: None, default: false };
        if let Some(walk) = export.walk(page, &field)? {
            page.body.push_str(&format!("{key}: {}\n", exponent(walk)));
        }
    }
    page.body.push_str("g_norm: 9.80665\n");
    Ok(())
}
