//! Figures of a control loop.

use nalgebra::Complex;
use serde_json::{Value, json};

use crate::aircraft::closed_loop::Judged;
use crate::aircraft::closed_loop::analysis::{FeedResult, HalfResult};
use crate::aircraft::closed_loop::curves::{Corner, Drawn, gain, gust_answer};
use crate::aircraft::closed_loop::feed::Kind;
use crate::aircraft::closed_loop::flights::Course;
use crate::report::figure::{self, Curve, Lines, Nyquist, OverLog, TimeLines};
use crate::report::{Level, Section};

/// A disk that is drawn where no criterion asks for one: gains of 0.43 to 2.33, 43.6 deg, a common demand.
const DISK: f64 = 0.8;
const HALVES: [&str; 2] = ["Pitch", "Roll and yaw"];
/// rad/s beyond which a pole is filter or servo and would squeeze those of the airplane.
const FARTHEST: f64 = 60.0;
/// s of a flight in which surfaces are drawn: over more of it four feeds are a smear.
const SURFACE_SHOWN: f64 = 5.0;

pub(super) fn sections<'a>(judged: &'a Judged, drawn: &'a Drawn) -> Vec<Section<'a>> {
    let corners = drawn.corners.as_slice();
    let mut out = vec![
        Section::new("Motions")
            .at(Level::Full)
            .figure("Poles of the closed loop in continuous time, those of filters included.", || poles(judged, 0))
            .figure("", || poles(judged, 1))
            .figure("After a 1 - cos gust, exactly: that of the flight, or one of 3 m/s over 25 m.", || gust(judged, 0))
            .figure("", || gust(judged, 1)),
        Section::new("Margins")
            .at(Level::Full)
            .figure("Loop gain about -1. A loop that stays out of the disk keeps its margin.", || nyquist(judged, 0, 0))
            .figure("", || nyquist(judged, 1, 0))
            .figure("", || nyquist(judged, 1, 1))
            .figure("By how much a disturbance of a surface is amplified at each frequency.", || {
                sensitivity(judged, 0, 0)
            })
            .figure("", || sensitivity(judged, 1, 0))
            .figure("", || sensitivity(judged, 1, 1)),
    ];
    out.extend(flight(judged, drawn));
    if !corners.is_empty() {
        let mut section = Section::new("Against a low-pass").at(Level::Full);
        for (half, surface) in [(0, 0), (1, 0), (1, 1)] {
            section = section.figure(
                if half == 0 {
                    "Disk margin behind a second-order low-pass of any corner; filters as points."
                } else {
                    ""
                },
                move || margin_over_corner(judged, corners, half, surface),
            );
        }
        for (half, surface) in [(0, 0), (1, 0), (1, 1)] {
            section = section.figure(
                if half == 0 {
                    "Rate of the surface by source behind that low-pass; the airframe filter as points."
                } else {
                    ""
                },
                move || rate_over_corner(judged, corners, half, surface),
            );
        }
        out.push(section);
    }
    out
}

/// What the figures of gusts and loop gains show, as numbers: a page with sliders draws them itself.
pub fn curves(judged: &Judged) -> Value {
    let name = |half: usize| judged.raw.halves[half].circuit.half;
    let gust = (0..HALVES.len()).map(|half| {
        let feeds = each(judged, half).map(|(result, half)| {
            let (time, angle): (Vec<f64>, Vec<f64>) =
                gust_answer(&judged.truth, half).into_iter().map(|(t, x)| (t, x.to_degrees())).unzip();
            json!({ "name": result.name, "time_s": time, "deg": angle })
        });
        json!({ "half": HALVES[half], "angle": name(half).angle_name(), "feeds": feeds.collect::<Vec<_>>() })
    });
    let surfaces =
        (0..HALVES.len()).flat_map(|half| (0..name(half).surfaces().len()).map(move |number| (half, number)));
    let gain = surfaces.map(|(half, number)| {
        let feeds = each(judged, half).map(|(result, half)| {
            let gain = gain(half, number);
            let of = |part: fn(&(f64, Complex<f64>)) -> f64| gain.iter().map(part).collect::<Vec<f64>>();
            json!({
                "name": result.name, "frequency": of(|(w, _)| *w), "re": of(|(_, l)| l.re), "im": of(|(_, l)| l.im),
                "sensitivity": of(|(_, l)| 1.0 / (l + 1.0).norm()),
            })
        });
        json!({
            "half": HALVES[half], "surface": surface(&judged.raw.halves[half], number),
            "feeds": feeds.collect::<Vec<_>>(),
        })
    });
    json!({ "gust": gust.collect::<Vec<_>>(), "gain": gain.collect::<Vec<_>>() })
}

fn surface(half: &HalfResult, number: usize) -> &'static str {
    half.circuit.half.surfaces()[number]
}

fn each(judged: &Judged, half: usize) -> impl Iterator<Item = (&FeedResult, &HalfResult)> {
    judged.results.iter().map(move |result| (result, &result.halves[half]))
}

fn poles(judged: &Judged, half: usize) -> String {
    let dots = each(judged, half).map(|(result, half)| {
        let near = half.modes.iter().filter(|mode| mode.frequency() < FARTHEST).map(|mode| mode.eigenvalue);
        let points = near.flat_map(|(re, im)| if im > 0.0 { vec![(re, im), (re, -im)] } else { vec![(re, im)] });
        Curve { label: result.name.clone(), points: points.collect() }
    });
    figure::lines(&Lines {
        title: format!("{}: poles", HALVES[half]),
        description: "Poles of the closed loop in the complex plane for every feed.".into(),
        x: ("real part".into(), "1/s".into()),
        y: ("imaginary part".into(), "1/s".into()),
        dots: dots.collect(),
        ..Lines::default()
    })
}

fn gust(judged: &Judged, half: usize) -> String {
    let lines = each(judged, half).map(|(result, half)| Curve {
        label: result.name.clone(),
        points: gust_answer(&judged.truth, half).into_iter().map(|(t, x)| (t, x.to_degrees())).collect(),
    });
    figure::time_lines(&TimeLines {
        title: format!("{}: answer to a gust", HALVES[half]),
        quantity: judged.raw.halves[half].circuit.half.angle_name().into(),
        unit: "deg".into(),
        lines: lines.collect(),
        limits: vec![],
    })
}

/// All feeds in one flight.
fn flight<'a>(judged: &'a Judged, drawn: &'a Drawn) -> Option<Section<'a>> {
    let section = Section::new("A flight in gusts").at(Level::Full);
    match &drawn.flight {
        Err(why) => Some(section.paragraph(format!("None is drawn: {why}."))),
        Ok(courses) if courses.is_empty() => None,
        Ok(courses) => Some(
            section
                .figure(
                    "In six degrees of freedom, the same gusts and noise for every feed; what the gyros' constant bias \
                     does is the offset of the tables.",
                    || angle(judged, courses, 0),
                )
                .figure("", || angle(judged, courses, 1))
                .figure("The last seconds of that flight.", || deflection(judged, courses, 0))
                .figure("", || deflection(judged, courses, 1)),
        ),
    }
}

fn angle(judged: &Judged, courses: &[Course], half: usize) -> String {
    let curve = |course: &Course| Curve {
        label: course.feed.clone(),
        points: course.samples.iter().map(|(t, angles, _)| (*t, angles[half].to_degrees())).collect(),
    };
    figure::time_lines(&TimeLines {
        title: format!("{}: a flight in gusts", HALVES[half]),
        quantity: format!("{}, less that of the trim", judged.raw.halves[half].circuit.half.angle_name()),
        unit: "deg".into(),
        lines: courses.iter().map(curve).collect(),
        limits: vec![],
    })
}

fn deflection(judged: &Judged, courses: &[Course], half: usize) -> String {
    let last = |course: &Course| course.samples.last().map_or(0.0, |(t, _, _)| *t);
    let from = courses.iter().map(last).fold(0.0, f64::max) - SURFACE_SHOWN;
    let curve = |course: &Course| {
        let late = course.samples.iter().filter(|(t, _, _)| *t >= from);
        let points = late.map(|(t, _, surfaces)| (*t, surfaces[half].to_degrees())).collect();
        Curve { label: course.feed.clone(), points }
    };
    let name = surface(&judged.raw.halves[half], 0);
    figure::time_lines(&TimeLines {
        title: format!("{}: {name} in that flight", HALVES[half]),
        quantity: name.into(),
        unit: "deg".into(),
        lines: courses.iter().map(curve).collect(),
        limits: vec![],
    })
}

fn nyquist(judged: &Judged, half: usize, number: usize) -> String {
    let curves = each(judged, half).map(|(result, half)| {
        let gain = gain(half, number);
        let points = gain.iter().map(|(_, l)| (l.re, l.im)).chain(gain.iter().rev().map(|(_, l)| (l.re, -l.im)));
        Curve { label: result.name.clone(), points: points.collect() }
    });
    let asked = judged.criteria.0.iter().find(|limit| limit.criterion.name == "disk_margin");
    let disk = asked.and_then(|limit| limit.at_least).unwrap_or(DISK);
    figure::nyquist(&Nyquist {
        title: format!("Loop gain of the {}", surface(&judged.raw.halves[half], number)),
        curves: curves.collect(),
        disk,
        label: format!("disk of margin {disk}"),
    })
}

fn sensitivity(judged: &Judged, half: usize, number: usize) -> String {
    let curves = each(judged, half).map(|(result, half)| {
        let points = gain(half, number).into_iter().map(|(w, l)| (w, 1.0 / (l + 1.0).norm()));
        Curve { label: result.name.clone(), points: points.collect() }
    });
    figure::over_log(&OverLog {
        title: format!("Sensitivity of the {}", surface(&judged.raw.halves[half], number)),
        description: "|S| over frequency for every feed.".into(),
        x: ("frequency".into(), "rad/s".into()),
        y: ("|S|".into(), String::new()),
        curves: curves.collect(),
        level: Some((1.0, "no change".into())),
        ..OverLog::default()
    })
}

/// One value over the corners, where the loop is stable.
fn over(corners: &[Corner], label: &str, half: usize, of: impl Fn(&HalfResult) -> Option<f64>) -> Curve {
    let points = corners.iter().filter_map(|c| Some((c.corner, of(&c.result.halves[half])?)));
    Curve { label: label.into(), points: points.collect() }
}

/// A value of a feed, drawn in the middle of the corners.
fn at_middle(corners: &[Corner], y: Option<f64>) -> Vec<(f64, f64)> {
    let ends = corners.first().zip(corners.last());
    ends.zip(y).map(|((first, last), y)| vec![((first.corner * last.corner).sqrt(), y)]).unwrap_or_default()
}

fn margin_over_corner(judged: &Judged, corners: &[Corner], half: usize, number: usize) -> String {
    let disk = |half: &HalfResult| Some(half.steady.as_ref()?.margins.single[number].disk.margin);
    let kalman = each(judged, half).filter(|(result, _)| matches!(result.kind, Kind::Drift | Kind::Airframe));
    let dots = kalman.enumerate().map(|(k, (result, half))| {
        (k + 1, Curve { label: result.name.clone(), points: at_middle(corners, disk(half)) })
    });
    figure::over_log(&OverLog {
        title: format!("Disk margin of the {}", surface(&judged.raw.halves[half], number)),
        description: "Disk margin over the corner of a low-pass, filters as points.".into(),
        x: ("corner of the low-pass".into(), "Hz".into()),
        y: ("disk margin".into(), String::new()),
        curves: vec![over(corners, "LP2", half, disk)],
        dots: dots.collect(),
        level: disk(&judged.raw.halves[half]).map(|raw| (raw, "raw".into())),
    })
}

fn rate_over_corner(judged: &Judged, corners: &[Corner], half: usize, number: usize) -> String {
    let name = format!("{}_rate", surface(&judged.raw.halves[half], number));
    let rms = |half: &HalfResult, source: Option<usize>| {
        let rms = half.steady.as_ref()?.rms.iter().find(|rms| rms.name == name)?;
        Some(source.map_or(rms.all, |source| rms.by[source]).to_degrees())
    };
    let parts = [("all", None), ("gusts", Some(0)), ("gyro's noise", Some(1))];
    let curves = parts.map(|(label, source)| over(corners, label, half, |half| rms(half, source)));
    let kalman = each(judged, half).find(|(result, _)| result.kind == Kind::Airframe);
    let dots = kalman.map_or_else(Vec::new, |(result, half)| {
        let point = |(k, (label, source)): (usize, (&str, Option<usize>))| {
            (k, Curve { label: format!("{}: {label}", result.name), points: at_middle(corners, rms(half, source)) })
        };
        parts.into_iter().enumerate().map(point).collect()
    });
    figure::over_log(&OverLog {
        title: format!("Rate of the {}", surface(&judged.raw.halves[half], number)),
        description: "Rms rate of the surface by source over the corner of a low-pass.".into(),
        x: ("corner of the low-pass".into(), "Hz".into()),
        y: ("rms rate".into(), "deg/s".into()),
        curves: curves.to_vec(),
        dots,
        level: None,
    })
}
