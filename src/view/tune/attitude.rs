//! An attitude filter.

use crate::report::{Report, Section};
use crate::tune::TunedAttitude;
use crate::units::digits;

/// `name`: file of the parameters.
pub fn attitude<'a>(name: &str, tuned: &TunedAttitude) -> Report<'a> {
    let (design, model) = (&tuned.design, &tuned.design.model);
    let heading = model.heading.as_ref();
    let aided = heading.map_or("gravity".to_string(), |heading| format!("gravity and {}", heading.name));
    let states = model.states(design.axes.each_ref().map(String::as_str)).len();
    let figure = |what: &str, value: f64, unit: &str| [what.to_string(), digits(value), unit.to_string()];
    let mut rows = Vec::new();
    for (axis, gyro) in design.axes.iter().zip(&model.gyro) {
        let density = (gyro.r[(0, 0)] * model.dt).sqrt();
        rows.push(figure(&format!("{axis}: white noise"), density.to_degrees(), "deg/s/sqrt(Hz)"));
        let spread = (&gyro.h * &gyro.p0 * gyro.h.transpose())[(0, 0)].sqrt();
        rows.push(figure(&format!("{axis}: drift before the first sample"), spread.to_degrees(), "deg/s"));
    }
    rows.push(figure("scale factors and misalignments", 100.0 * model.scale_std_dev, "%"));
    rows.push(figure("accelerometer: one sample", model.accelerometer.variance.sqrt(), "m/s^2"));
    rows.push(figure("accelerometer: bias", model.accelerometer.bias_std_dev, "m/s^2"));
    if let Some(heading) = heading {
        let name = &heading.name;
        rows.push(figure(&format!("{name}: one measurement"), heading.std_dev.to_degrees(), "deg"));
        rows.push(figure(&format!("{name}: least disturbance"), heading.disturbance.to_degrees(), "deg"));
        rows.push(figure(&format!("{name}: correlation time"), heading.correlation_time, "s"));
        rows.push(figure(&format!("{name}: delay"), heading.delay_std_dev, "s"));
    }
    let at_rest = tuned.at_rest.iter().map(|rest| {
        let yaw = heading.map_or("free".to_string(), |_| digits(rest.heading.to_degrees()));
        let drift = rest.drift.iter().map(|sigma| digits(sigma.to_degrees()));
        let first = [digits(rest.time_s), digits(rest.inclination.to_degrees()), yaw];
        first.into_iter().chain(drift).collect::<Vec<_>>()
    });
    let drifts = design.axes.iter().map(|axis| format!("{axis} drift (deg/s)"));
    let first = ["time (s)", "inclination (deg)", "heading (deg)"].map(String::from);
    let header: Vec<String> = first.into_iter().chain(drifts).collect();
    let rate = digits(design.sample_rate_hz);
    let headline = Section::new("").paragraph(format!(
        "{name}: plant attitude, {rate} Hz, aided by {aided}: {states} error states beside the quaternion"
    ));
    let numbers = Section::new("")
        .table("", &["standard deviation of", "value", "unit"], rows)
        .table("Predicted sigma of a level body at rest", &header, at_rest)
        .findings("note", tuned.warnings.iter().map(|warning| format!("attitude: {warning}")).collect());
    Report { title: format!("Attitude filter from {name}"), sections: vec![headline, numbers], ..Report::default() }
}
