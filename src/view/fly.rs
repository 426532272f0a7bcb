//! A flight.

use crate::aircraft::flight::{ColumnReport, FlightReport};
use crate::report::figure::{self, Curve, Envelope, TimeLines, Track};
use crate::report::{Report, Section};
use crate::units::digits;

/// Columns of angles and rates, and the unit in which they are shown.
const ANGLES: [(&str, &str); 8] = [
    ("phi (rad)", "deg"),
    ("theta (rad)", "deg"),
    ("p (rad/s)", "deg/s"),
    ("q (rad/s)", "deg/s"),
    ("r (rad/s)", "deg/s"),
    ("elevator (rad)", "deg"),
    ("aileron (rad)", "deg"),
    ("rudder (rad)", "deg"),
];

/// `header` and `lines`: columns of the log and their course, where figures are wanted; `stops` in rad.
pub fn fly<'a>(flown: &FlightReport, header: &[String], lines: Option<&Envelope>, stops: &[f64]) -> Report<'a> {
    let mut section = Section::new("");
    if let Some(first) = flown.runs.first() {
        let rows = ANGLES.iter().filter_map(|(name, unit)| {
            let at = first.columns.iter().position(|column| column.name == *name)?;
            let of_runs = || flown.runs.iter().map(move |run| &run.columns[at]);
            let mean = |of: fn(&ColumnReport) -> f64| of_runs().map(of).sum::<f64>() / flown.runs.len() as f64;
            let least = of_runs().map(|c| c.least).fold(f64::INFINITY, f64::min);
            let greatest = of_runs().map(|c| c.greatest).fold(f64::NEG_INFINITY, f64::max);
            let rms = mean(|c| c.std_dev * c.std_dev).sqrt();
            let cells = [mean(|c| c.mean), rms, least, greatest].map(|x| digits(x.to_degrees()));
            let name = name.split(' ').next().unwrap_or(name);
            Some([format!("{name} ({unit})")].into_iter().chain(cells))
        });
        let logs: Vec<&str> = flown.runs.iter().filter_map(|run| run.log.as_deref()).collect();
        let files = match logs.as_slice() {
            [] => String::new(),
            [one] => format!("{one}: "),
            [one, .., last] => format!("{one} … {last}: "),
        };
        let runs = if flown.runs.len() == 1 { String::new() } else { format!("{} runs of ", flown.runs.len()) };
        section = section.table("", &["", "mean", "std dev", "least", "greatest"], rows).paragraph(format!(
            "{files}{runs}{} s of {}, {} rows every {} s, steps of {} s, seed {}.",
            flown.duration_s, flown.airplane, first.rows, flown.every_s, flown.step_s, flown.seed
        ));
    }
    let drawn = lines.map_or_else(Vec::new, |lines| figures(header, lines, stops));
    section = drawn.into_iter().fold(section, |section, svg| section.figure("", move || svg.clone()));
    Report { title: format!("Flight of {}", flown.airplane), sections: vec![section], ..Report::default() }
}

fn figures(header: &[String], lines: &Envelope, stops: &[f64]) -> Vec<String> {
    let line = |name: &str| -> Option<Vec<(f64, f64)>> {
        let number = header.iter().position(|column| column.split(' ').next() == Some(name))?;
        Some(lines.line(number))
    };
    let group = |title: &str, quantity: &str, unit: &str, names: &[&str], scale: f64, limits: &[f64]| {
        let curve = |name: &&str| {
            let points = line(name)?.into_iter().map(|(t, y)| (t, scale * y)).collect();
            Some(Curve { label: name.trim_start_matches("gust_").replace('_', " "), points })
        };
        let curves: Vec<Curve> = names.iter().filter_map(curve).collect();
        let data = TimeLines {
            title: title.into(),
            quantity: quantity.into(),
            unit: unit.into(),
            lines: curves,
            limits: limits.iter().map(|limit| scale * limit).collect(),
        };
        (!data.lines.is_empty()).then(|| figure::time_lines(&data))
    };
    let degrees = 1.0_f64.to_degrees();
    let height = || -> Option<String> {
        let points =
            line("down").map(|line| line.into_iter().map(|(t, y)| (t, -y)).collect()).or_else(|| line("height"))?;
        let data = TimeLines {
            title: "Height".into(),
            quantity: "height".into(),
            unit: "m".into(),
            lines: vec![Curve { label: "height".into(), points }],
            limits: vec![],
        };
        Some(figure::time_lines(&data))
    };
    let figures = [
        group("Roll and pitch", "angle", "deg", &["phi", "theta"], degrees, &[]),
        group("Rates", "rate", "deg/s", &["p", "q", "r"], degrees, &[]),
        group("Surfaces", "angle", "deg", &["elevator", "aileron", "rudder"], degrees, stops),
        group("Gusts", "velocity of the air", "m/s", &["gust_u", "gust_v", "gust_w"], 1.0, &[]),
        way(&line),
        height(),
    ];
    figures.into_iter().flatten().collect()
}

/// Time and value.
type Points = Vec<(f64, f64)>;

/// Over the ground, from both coordinates at equal times.
fn way(line: &dyn Fn(&str) -> Option<Points>) -> Option<String> {
    let flat = line("north").zip(line("east"));
    let (north, east, per) = match flat {
        Some((north, east)) => (north, east, [1.0, 1.0]),
        None => {
            let (north, east) = line("latitude").zip(line("longitude"))?;
            // metres per degree of the mean sphere: a picture needs no more
            let degree = 6_371_000.0_f64 * 1.0_f64.to_radians();
            let across = degree * north.first()?.1.to_radians().cos();
            (north, east, [degree, across])
        }
    };
    let (n0, e0) = if per[0] == 1.0 { (0.0, 0.0) } else { (north.first()?.1, east.first()?.1) };
    let last = north.last()?.0.max(east.last()?.0);
    let at = |line: &[(f64, f64)], time: f64| -> f64 {
        let after = line.partition_point(|p| p.0 < time).min(line.len() - 1);
        let before = after.saturating_sub(1);
        let ((t0, y0), (t1, y1)) = (line[before], line[after]);
        if t1 > t0 { y0 + (y1 - y0) * ((time - t0) / (t1 - t0)).clamp(0.0, 1.0) } else { y1 }
    };
    let place = |time: f64| (per[1] * (at(&east, time) - e0), per[0] * (at(&north, time) - n0));
    let step =
        [1.0, 2.0, 5.0, 10.0, 20.0, 60.0, 120.0, 300.0, 600.0].into_iter().find(|s| last / s <= 12.0).unwrap_or(3600.0);
    Some(figure::track(&Track {
        title: "Way over the ground".into(),
        points: (0..=600).map(|i| place(last * f64::from(i) / 600.0)).collect(),
        marks: (0..=(last / step) as u32).map(|i| place(step * f64::from(i))).collect(),
        label: format!("every {step} s"),
    }))
}
