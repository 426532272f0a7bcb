//! The page of a steady flight.

use nalgebra::{DMatrix, DVector};

use super::{MODE_HEADER, criterion_header, criterion_rows, mode_row};
use crate::aircraft::airframe::linear::LinearModel;
use crate::aircraft::control::document::{LinearDocument, Linearized};
use crate::report::figure::{self, Curve, Lines};
use crate::report::{Report, Section};

pub(super) fn page<'a>(linearized: &'a Linearized, document: &'a LinearDocument) -> Report<'a> {
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
    let mut rows: Vec<Vec<String>> =
        state.iter().map(|(name, value)| vec![(*name).to_string(), value.clone()]).collect();
    rows.extend(t.used.iter().map(|u| vec![format!("{} used (%)", u.control), format!("{:.1}", 100.0 * u.share)]));
    let trim = Section::new("Steady flight").table("", &["", "value"], rows);
    let trim = trim.findings("warning", document.warnings.clone());
    let modes: Vec<Vec<String>> = document.modes.iter().filter(|m| m.model != "full").map(mode_row).collect();
    let header = criterion_header(document);
    let reach = |list: &[crate::aircraft::control::document::ReachDocument]| -> Vec<Vec<String>> {
        let row = |r: &crate::aircraft::control::document::ReachDocument| {
            let cosines = |c: &[f64]| c.iter().map(|c| format!("{c:.4}")).collect::<Vec<_>>().join(", ");
            let mode = r.mode.replace('_', " ");
            vec![
                mode,
                r.by.join(", "),
                format!("{:.4}", r.pbh),
                cosines(&r.cosines),
                format!("{:.4}", r.pbh_scaled),
                cosines(&r.cosines_scaled),
            ]
        };
        list.iter().map(row).collect()
    };
    let of = ["mode", "by", "PBH", "measures", "PBH, velocities over V", "measures, velocities over V"];
    let gramians = document.gramians.iter().map(|g| {
        let values = g.eigenvalues.iter().map(|e| format!("{e:.4}")).collect::<Vec<_>>().join(", ");
        vec![g.model.into(), g.by.join(", "), values, format!("{:.1}", g.condition)]
    });
    let models = &linearized.models;
    let steps = [
        step(&models.longitudinal, 0, 1.0_f64.to_radians(), "elevator 1 deg"),
        step(
            &models.longitudinal,
            1,
            if t.throttle.is_some() { 0.1 } else { 1.0 },
            if t.throttle.is_some() { "throttle 0.1" } else { "thrust 1 N" },
        ),
        step(&models.lateral, 0, 1.0_f64.to_radians(), "aileron 1 deg"),
        step(&models.lateral, 1, 1.0_f64.to_radians(), "rudder 1 deg"),
    ];
    let responses = Section::new("Step responses").paragraph("Of the linear models, without servos.");
    Report {
        title: format!("Steady flight of {}", document.airplane),
        subtitle: format!("{} m/s at {} m", t.airspeed, t.altitude),
        provenance: vec![("version".into(), document.version.into())],
        sections: vec![
            trim,
            Section::new("Modes").table("", &MODE_HEADER, modes).figure(
                "Eigenvalues of the longitudinal and the lateral model. Thin lines: least damping of Level 1 of the short \
                 period (0.35) and of the Dutch roll (0.19) of MIL-F-8785C, categories A and C, A.",
                || poles(document),
            ),
            Section::new("Handling-quality levels")
                .paragraph(format!("{}.", document.caution))
                .table("Levels in the flight phases A, B, C", &header, criterion_rows(document)),
            steps.into_iter().fold(responses, |section, svg| section.figure("", move || svg.clone())),
            Section::new("Controllability and observability")
                .paragraph("Smallest singular value of [A − λI, B] and modal measures; they depend on the units: SI, and with velocities over the airspeed.")
                .table("By inputs", &of, reach(&document.controllability))
                .table("By rates", &of, reach(&document.observability))
                .table("Gramian over 5 s, velocities over the airspeed", &["model", "by", "eigenvalues", "condition"], gramians),
        ],
        ..Report::default()
    }
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
