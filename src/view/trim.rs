//! A steady flight, the linear models about it and their qualities.

use nalgebra::{DMatrix, DVector};

use crate::aircraft::airframe::linear::LinearModel;
use crate::aircraft::control::document::{CriterionDocument, LinearDocument, Linearized, ModeDocument, ReachDocument};
use crate::report::figure::{self, Curve, Lines};
use crate::report::{Level, Report, Section};
use crate::units::digits;

const REACH: [&str; 6] = ["mode", "by", "PBH", "measures", "PBH, velocities over V", "measures, velocities over V"];

pub fn trim<'a>(linearized: &'a Linearized, document: &'a LinearDocument) -> Report<'a> {
    let t = &document.trim;
    let modes = document.modes.iter().filter(|m| m.model != "full").map(mode_row);
    let cap = document.cap.map_or(String::new(), |cap| format!(", CAP {} 1/(g s^2)", digits(cap)));
    let gramians = document.gramians.iter().map(|g| {
        let values = g.eigenvalues.iter().map(|e| format!("{e:.4}")).collect::<Vec<_>>().join(", ");
        [g.model.to_string(), g.by.join(", "), values, format!("{:.1}", g.condition)]
    });
    let models = &linearized.models;
    let (thrust, thrust_step) = if t.throttle.is_some() { (0.1, "throttle 0.1") } else { (1.0, "thrust 1 N") };
    let degree = 1.0_f64.to_radians();
    Report {
        title: format!("Steady flight of {}", document.airplane),
        subtitle: format!("{} m/s at {} m", t.airspeed, t.altitude),
        provenance: vec![("version".into(), document.version.into())],
        sections: vec![
            Section::of_page("Steady flight")
                .at(Level::Full)
                .paragraphs(headline(document))
                .at(Level::Page)
                .table("", &["", "value"], state(document))
                .at(Level::Full)
                .findings("warning", document.warnings.clone()),
            Section::of_page("Modes")
                .table("", &["mode", "eigenvalue (1/s)", "frequency (rad/s)", "damping", "time (s)"], modes)
                .paragraph(format!("n/alpha {} 1/rad{cap}", digits(document.load_per_angle)))
                .figure(
                    "Eigenvalues of the longitudinal and the lateral model. Thin lines: least damping of Level 1 of \
                     the short period (0.35) and of the Dutch roll (0.19) of MIL-F-8785C, categories A and C, A.",
                    || poles(document),
                ),
            Section::of_page("Handling-quality levels")
                .table("Levels in the flight phases A, B, C", &criterion_header(document), criterion_rows(document))
                .paragraph(format!("Caution: {}.", document.caution)),
            Section::new("Step responses")
                .at(Level::Page)
                .paragraph("Of the linear models, without servos.")
                .figure("", move || step(&models.longitudinal, 0, degree, "elevator 1 deg"))
                .figure("", move || step(&models.longitudinal, 1, thrust, thrust_step))
                .figure("", move || step(&models.lateral, 0, degree, "aileron 1 deg"))
                .figure("", move || step(&models.lateral, 1, degree, "rudder 1 deg")),
            Section::new("Controllability and observability")
                .at(Level::Page)
                .paragraph(
                    "Smallest singular value of [A − λI, B] and modal measures; they depend on the units: SI, and with \
                     velocities over the airspeed.",
                )
                .table("By inputs", &REACH, document.controllability.iter().map(reach))
                .table("By rates", &REACH, document.observability.iter().map(reach))
                .table(
                    "Gramian over 5 s, velocities over the airspeed",
                    &["model", "by", "eigenvalues", "condition"],
                    gramians,
                ),
        ],
        answer: answer(document),
        ..Report::default()
    }
}

/// Where it flies, its modes, and what to be careful of.
fn answer<'a>(document: &LinearDocument) -> Section<'a> {
    let modes = document.modes.iter().filter(|m| m.model != "full").map(mode_row);
    Section::new("")
        .paragraphs(headline(document))
        .table("", &["mode", "eigenvalue (1/s)", "frequency (rad/s)", "damping", "time (s)"], modes)
        .findings("warning", document.warnings.clone())
}

/// Where and how it flies, and what holds it there.
fn headline(document: &LinearDocument) -> Vec<String> {
    let t = &document.trim;
    let deg = |x: f64| format!("{:.3}", x.to_degrees());
    let climb = if t.climb == 0.0 { String::new() } else { format!(", climb {} deg", digits(t.climb.to_degrees())) };
    let turn = digits(t.turn_rate.to_degrees());
    let turn = if t.turn_rate == 0.0 { String::new() } else { format!(", turning {turn} deg/s") };
    let throttle = t.throttle.map_or(String::new(), |x| format!("throttle {x:.4}, "));
    let motor = if t.current == 0.0 { String::new() } else { format!(", current {} A", digits(t.current)) };
    let [speed, altitude, thrust] = [t.airspeed, t.altitude, t.thrust].map(digits);
    let [alpha, phi, theta, elevator, aileron, rudder] =
        [t.alpha, t.phi, t.theta, t.elevator, t.aileron, t.rudder].map(deg);
    vec![
        format!(
            "{} at {speed} m/s, {altitude} m{climb}{turn}: alpha {alpha} deg, bank {phi} deg, pitch {theta} deg",
            document.airplane
        ),
        format!(
            "elevator {elevator} deg, aileron {aileron} deg, rudder {rudder} deg, {throttle}thrust {thrust} N{motor}; \
             residual {:.0e}",
            t.residual
        ),
    ]
}

fn state(document: &LinearDocument) -> Vec<[String; 2]> {
    let t = &document.trim;
    let deg = |x: f64| format!("{:.4}", x.to_degrees());
    let number = |x: f64| format!("{x:.5}");
    let state = [
        ("angle of attack (deg)", deg(t.alpha)),
        ("sideslip (deg)", deg(t.beta)),
        ("bank (deg)", deg(t.phi)),
        ("pitch (deg)", deg(t.theta)),
        ("elevator (deg)", deg(t.elevator)),
        ("aileron (deg)", deg(t.aileron)),
        ("rudder (deg)", deg(t.rudder)),
        ("throttle", t.throttle.map_or("-".into(), number)),
        ("thrust (N)", number(t.thrust)),
        ("current (A)", number(t.current)),
        ("residual", format!("{:.1e}", t.residual)),
    ];
    let used = t.used.iter().map(|u| [format!("{} used (%)", u.control), format!("{:.1}", 100.0 * u.share)]);
    state.map(|(name, value)| [name.to_string(), value]).into_iter().chain(used).collect()
}

fn reach(r: &ReachDocument) -> [String; 6] {
    let cosines = |c: &[f64]| c.iter().map(|c| format!("{c:.4}")).collect::<Vec<_>>().join(", ");
    let [pbh, scaled] = [r.pbh, r.pbh_scaled].map(|x| format!("{x:.4}"));
    [r.mode.replace('_', " "), r.by.join(", "), pbh, cosines(&r.cosines), scaled, cosines(&r.cosines_scaled)]
}

/// 1, 2, 3, "beyond 3" or "-".
fn level(level: Option<u8>) -> String {
    match level {
        Some(4) => "beyond 3".into(),
        Some(level) => level.to_string(),
        None => "-".into(),
    }
}

fn mode_row(mode: &ModeDocument) -> [String; 5] {
    let [re, im] = mode.eigenvalue;
    let value = if im == 0.0 { format!("{re:.4}") } else { format!("{re:.4} ± {im:.4}i") };
    let (half, double) = (mode.time_to_half, mode.time_to_double);
    let time = half.map(|t| format!("half {}", digits(t))).or(double.map(|t| format!("double {}", digits(t))));
    let (frequency, damping) = (digits(mode.frequency), format!("{:.3}", mode.damping));
    [mode.name.replace('_', " "), value, frequency, damping, time.unwrap_or_else(|| "-".into())]
}

/// One row per criterion, its levels in categories A, B and C.
fn criterion_rows(document: &LinearDocument) -> Vec<Vec<String>> {
    let mut names: Vec<&str> = Vec::new();
    for criterion in &document.criteria {
        if !names.contains(&criterion.name) {
            names.push(criterion.name);
        }
    }
    let row = |name: &&str| {
        let all: Vec<&CriterionDocument> = document.criteria.iter().filter(|c| c.name == *name).collect();
        let value = |of: fn(&CriterionDocument) -> Option<f64>| {
            let mut values: Vec<String> = all.iter().filter_map(|c| of(c)).map(digits).collect();
            values.dedup();
            if values.is_empty() { "-".into() } else { values.join(", ") }
        };
        let levels =
            |of: fn(&CriterionDocument) -> Option<u8>| all.iter().map(|c| level(of(c))).collect::<Vec<_>>().join(" ");
        let unit = all.first().map_or("", |c| if c.unit == "1" { "" } else { c.unit });
        let named =
            if unit.is_empty() { name.replace('_', " ") } else { format!("{} ({unit})", name.replace('_', " ")) };
        let mut row = vec![named, value(|c| c.value), levels(|c| c.level)];
        if document.froude_scale.is_some() {
            row.extend([value(|c| c.scaled_value), levels(|c| c.scaled_level)]);
        }
        row
    };
    names.iter().map(row).collect()
}

fn criterion_header(document: &LinearDocument) -> Vec<String> {
    let mut header = vec!["criterion".to_string(), "as flown".into(), "level A B C".into()];
    if let Some(scale) = document.froude_scale {
        header.extend([format!("scaled by {}", digits(scale)), "level A B C".into()]);
    }
    header
}

fn poles(document: &LinearDocument) -> String {
    let of = |model: &str| Curve {
        label: model.into(),
        points: document
            .modes
            .iter()
            .filter(|m| m.model == model)
            .flat_map(|m| [(m.eigenvalue[0], m.eigenvalue[1]), (m.eigenvalue[0], -m.eigenvalue[1])])
            .collect(),
    };
    let farthest = document.modes.iter().map(|m| m.frequency).fold(0.0, f64::max);
    // rays of constant damping, both halves in one line
    let ray = |zeta: f64| {
        let (x, y) = (-zeta, (1.0 - zeta * zeta).sqrt());
        let along =
            |sign: f64| move |i: i32| (farthest * x * f64::from(i) / 400.0, sign * farthest * y * f64::from(i) / 400.0);
        let points = (0..=400).rev().map(along(1.0)).chain((0..=400).map(along(-1.0)));
        Curve { label: "least damping of Level 1".into(), points: points.collect() }
    };
    figure::lines(&Lines {
        title: "Poles".into(),
        description: "Eigenvalues in the complex plane, with rays of the least damping of Level 1.".into(),
        x: ("real part".into(), "1/s".into()),
        y: ("imaginary part".into(), "1/s".into()),
        curves: vec![],
        dots: vec![of("longitudinal"), of("lateral")],
        bounds: vec![ray(0.35), ray(0.19)],
    })
}

/// Rates and angles in deg after a step of an input, ten seconds, by the matrix exponential.
fn step(model: &LinearModel, input: usize, by: f64, label: &str) -> String {
    let (n, h, steps) = (model.a.nrows(), 0.02, 500);
    let mut joined = DMatrix::zeros(n + 1, n + 1);
    joined.view_mut((0, 0), (n, n)).copy_from(&model.a);
    joined.view_mut((0, n), (n, 1)).copy_from(&(model.b.column(input) * by));
    let forward = (joined * h).exp();
    let mut x = DVector::<f64>::zeros(n + 1);
    x[n] = 1.0;
    let mut curves: Vec<Curve> = model
        .states
        .iter()
        .map(|(name, unit)| {
            let unit = match *unit {
                "rad" => "deg",
                "rad/s" => "deg/s",
                other => other,
            };
            Curve { label: format!("{name} ({unit})"), points: Vec::new() }
        })
        .collect();
    for k in 0..=steps {
        for (i, curve) in curves.iter_mut().enumerate() {
            let scale = if model.states[i].1.starts_with("rad") { 1.0_f64.to_degrees() } else { 1.0 };
            curve.points.push((f64::from(k) * h, scale * x[i]));
        }
        x = &forward * x;
    }
    figure::lines(&Lines {
        title: format!("Response to {label}"),
        description: format!("States of the {} model after a step of {label}.", model.name),
        x: ("time".into(), "s".into()),
        y: ("deviation".into(), "m/s, deg, deg/s".into()),
        curves,
        ..Lines::default()
    })
}
