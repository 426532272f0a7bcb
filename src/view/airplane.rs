//! What an airplane document says.

use crate::aircraft::airframe::check::{AirplaneCheck, SpeedPoint};
use crate::report::figure::{self, Curve, Lines};
use crate::report::{Report, Section};
use crate::units::digits;

pub fn airplane(check: &AirplaneCheck) -> Report<'_> {
    let at = format!("at {} m", digits(check.altitude));
    let flight = match &check.level_flight {
        None => format!("{}: no level flight {at}", check.name),
        Some(range) => {
            let limit = |limit: Option<&str>| limit.map_or("not ended".to_string(), |what| format!("ended by {what}"));
            format!(
                "{}: level flight {at} from {:.2} m/s ({}) to {:.2} m/s ({})",
                check.name,
                range.slowest,
                limit(range.slowest_limit),
                range.fastest,
                limit(range.fastest_limit)
            )
        }
    };
    let section = Section::new("").paragraph(flight).table("", &["", ""], facts(check));
    let section = section.findings("warning", check.warnings.clone());
    let angles: Curves = &[("angle of attack", |p| p.alpha.to_degrees()), ("elevator", |p| p.elevator.to_degrees())];
    let drag: Curves = &[("drag", |p| p.drag), ("thrust at full throttle", |p| p.thrust_available)];
    let section = section
        .figure("", || figure(check, "Angle of attack and elevator", ("angle", "deg"), angles))
        .figure("", || figure(check, "Drag and thrust", ("force", "N"), drag))
        .figure("", || figure(check, "Power of level flight", ("power", "W"), &[("drag times airspeed", |p| p.power)]));
    Report { title: check.name.clone(), sections: vec![section], ..Report::default() }
}

fn facts(check: &AirplaneCheck) -> Vec<[String; 2]> {
    let [pitch, roll, yaw] = check.control_power.map(digits);
    let [a, b, c] = check.principal_moments.map(digits);
    let mut rows = vec![
        ("mass, wing loading", format!("{} kg, {} kg/m^2", digits(check.mass), digits(check.wing_loading))),
        ("aspect ratio", digits(check.aspect_ratio)),
        ("principal moments of inertia", format!("{a}, {b}, {c} kg m^2")),
        ("static margin", format!("{:.3} chords", check.static_margin)),
        ("control power, elevator aileron rudder", format!("{pitch}, {roll}, {yaw} 1/rad")),
    ];
    if let Some(stall) = check.stall {
        let lift =
            format!("CL {:.2} at {:.1} deg, {:.2} m/s", stall.greatest_lift, stall.angle.to_degrees(), stall.airspeed);
        rows.push(("stall", lift));
    }
    let best = |key: fn(&SpeedPoint) -> f64| check.curve.iter().min_by(|a, b| key(a).total_cmp(&key(b)));
    if let Some((range, endurance)) = best(|p| p.drag).zip(best(|p| p.power)) {
        rows.push(("least drag", format!("{} N at {:.1} m/s", digits(range.drag), range.airspeed)));
        rows.push(("least power", format!("{} W at {:.1} m/s", digits(endurance.power), endurance.airspeed)));
    }
    rows.into_iter().map(|(name, value)| [name.into(), value]).collect()
}

/// Names and values at a speed.
type Curves<'a> = &'a [(&'a str, fn(&SpeedPoint) -> f64)];

fn figure(check: &AirplaneCheck, title: &str, (quantity, unit): (&str, &str), curves: Curves<'_>) -> String {
    let curve = |(label, of): &(&str, fn(&SpeedPoint) -> f64)| Curve {
        label: (*label).into(),
        points: check.curve.iter().map(|p| (p.airspeed, of(p))).collect(),
    };
    figure::lines(&Lines {
        title: title.into(),
        description: format!("{title} of {} over the speeds of level flight.", check.name),
        x: ("airspeed".into(), "m/s".into()),
        y: (quantity.into(), unit.into()),
        curves: curves.iter().map(curve).collect(),
        ..Lines::default()
    })
}
