//! The filter of the plant airplane: airframe, servos, gusts and gyros of a flight.

use std::path::Path;

use anyhow::{Context, anyhow, bail};

use super::super::closed_loop;
use super::Request;
use super::objective::ObjectiveArg;
use crate::aircraft::closed_loop::kalman::airframe_designs;
use crate::aircraft::closed_loop::sensors::BIAS_WALK;
use crate::aircraft::flight::setting::same_rate;
use crate::aircraft::flight::{Setting, three_axes};
use crate::filter::AIRPLANE;
use crate::params::Params;
use crate::tune::Tuned;
use crate::units::{Quantity, digits};

/// `params`: of the gyro, in place of that of the flight. Gives the parameters of the axes of the design, too.
pub(super) fn tuned(request: &Request, params: &Params) -> anyhow::Result<(Params, Tuned)> {
    let given = [
        ("truth", request.truth.is_some()),
        ("objective", request.choosing.objective != ObjectiveArg::Nominal),
        ("hold", !request.choosing.hold.is_empty()),
        ("insight", request.insight),
        ("aid", request.plant.aid.iter().any(|text| !text.contains('='))),
    ];
    if let Some((option, _)) = given.iter().find(|(_, given)| *given) {
        bail!("`{option}` is no matter of `plant` airplane; the flight says what is measured and how it moves");
    }
    let path = request.plant.flight.as_deref();
    let path = path.context("`plant` airplane: say which airplane flies how, `flight` FLIGHT.json")?;
    let document = closed_loop::flight(path)?;
    let named = |message: String| anyhow!("{}: {message}", path.display());
    let folder = path.parent().unwrap_or(Path::new("."));
    let mut setting = Setting::new(&document, folder).map_err(|e| named(e.to_string()))?;
    let mut gyro = three_axes(params.clone(), Quantity::AngularRate.dimension(), "a gyro").map_err(|e| anyhow!(e))?;
    if !same_rate(gyro.sample_rate_hz, setting.rate) {
        bail!(
            "sample_rate: the gyro has {} Hz, the autopilot of {} {} Hz; a filter has one rate: give both the same",
            digits(gyro.sample_rate_hz),
            path.display(),
            digits(setting.rate)
        );
    }
    setting.gyro = Some(gyro.clone());
    let designs = airframe_designs(&setting, &gyro, BIAS_WALK).map_err(|e| named(e.to_string()))?;
    gyro.axes = designs.iter().map(|(axis, _)| axis.noise.clone()).collect();
    let mut tuned = Tuned::new(&gyro, AIRPLANE, None, designs);
    if let Some(record) = tuned.design.tuning.as_object_mut() {
        let about = serde_json::json!({
            "airplane": setting.airplane.name, "airspeed_m_s": setting.trim.airspeed(),
            "altitude_m": setting.request.altitude, "wind_at_20ft_m_s": setting.wind_at_20ft,
        });
        record.insert("flight".into(), about);
    }
    Ok((gyro, tuned))
}
