//! What is in a log.

use super::or_dash;
use crate::input::inspect::{ColumnInfo, Inventory, TopicInfo};
use crate::report::figure::{self, Curve};
use crate::report::{Report, Section};
use crate::signal::check::{Finding, FindingKind};
use crate::signal::course::{AVERAGED, Course};
use crate::units::{Quantity, Unit, digits, duration};

/// `all`: every topic with its columns, not only those with a gyro or an accelerometer.
pub fn info<'a>(name: &str, found: &Inventory, all: bool) -> Report<'a> {
    let count = found.topics.len();
    let rows = found.topics.iter().map(|topic| {
        [
            if topic.name.is_empty() { "(the table)".into() } else { topic.name.clone() },
            topic.rows.map_or("-".into(), |rows| rows.to_string()),
            or_dash(topic.rate_hz),
            topic.span_s.map_or("-".into(), duration),
        ]
    });
    let wanted = |topic: &&TopicInfo| all || count == 1 || topic.columns.iter().any(|c| is_sensor(c.unit.as_deref()));
    let topics = found.topics.iter().filter(wanted).filter(|topic| !topic.columns.is_empty());
    let notes = found.topics.iter().flat_map(|topic| {
        let of = if topic.name.is_empty() { String::new() } else { format!("{}: ", topic.name) };
        let kind = topic.kind.iter().map(|kind| format!("messages of the type '{kind}' are not read"));
        kind.chain(topic.note.clone()).map(move |note| format!("{of}{note}")).collect::<Vec<_>>()
    });
    let plural = if count == 1 { "" } else { "s" };
    let section = Section::new("")
        .paragraph(format!("{name}: {}, {count} topic{plural}", found.file))
        .table("", &["topic", "rows", "rate (Hz)", "span"], rows)
        .paragraphs(topics.map(columns).collect())
        .findings("note", notes.collect());
    Report { title: name.into(), sections: vec![section], ..Report::default() }
}

/// The log over time, a figure for each axis.
pub fn course(course: &Course) -> Report<'_> {
    let axes = 0..course.recording.axes.len();
    let section = axes.fold(Section::new(""), |section, i| section.figure("", move || of_axis(course, i)));
    Report { title: course.recording.name.clone(), sections: vec![section], ..Report::default() }
}

fn of_axis(course: &Course, i: usize) -> String {
    let Course { recording, check, averages } = course;
    let axis = &recording.axes[i];
    let dt = recording.dt();
    let mut gaps = recording.gaps.iter().peekable();
    let mut missing = 0;
    let mut points = Vec::with_capacity(axis.values.len());
    let mut average = Vec::with_capacity(axis.values.len());
    for (k, (value, mean)) in axis.values.iter().zip(&averages[i]).enumerate() {
        while let Some(gap) = gaps.next_if(|gap| gap.index == k) {
            // nothing is drawn over a gap
            points.push(((k as u64 + missing) as f64 * dt, f64::NAN));
            average.push(((k as u64 + missing) as f64 * dt, f64::NAN));
            missing += gap.missing;
        }
        let time = (k as u64 + missing) as f64 * dt;
        points.push((time, axis.unit.from_si(*value)));
        average.push((time, axis.unit.from_si(*mean)));
    }
    let here = |finding: &&Finding| finding.axis.as_ref().is_none_or(|name| *name == axis.name);
    let place = |finding: &Finding| {
        let what = of_place(finding.kind)?;
        let times = if finding.count > 1 { format!(", first of {}", finding.count) } else { String::new() };
        Some((finding.first_s, format!("{what} at {} s{times}", digits(finding.first_s))))
    };
    figure::course(&figure::Course {
        title: format!("{}: {}", axis.name, recording.name),
        quantity: axis.name.clone(),
        unit: axis.unit.text().into(),
        points,
        average: Curve {
            label: format!("mean of {AVERAGED} samples, {} s", digits(AVERAGED as f64 * dt)),
            points: average,
        },
        findings: check.findings.iter().filter(here).filter_map(place).collect(),
    })
}

/// In words, where a finding has a place in the log.
fn of_place(kind: FindingKind) -> Option<&'static str> {
    Some(match kind {
        FindingKind::Gap => "gap",
        FindingKind::RepeatedStamp => "repeated stamp",
        FindingKind::BackwardStamp => "stamp backward",
        FindingKind::ZeroRow => "row of zeros",
        FindingKind::RepeatedRow => "repeated row",
        FindingKind::Nan => "no number",
        FindingKind::Overflow => "overflow",
        FindingKind::Stuck => "stuck",
        FindingKind::Saturated => "saturated",
        FindingKind::Outlier => "outlier",
        FindingKind::Motion => "motion",
        FindingKind::Jitter
        | FindingKind::TimeUnit
        | FindingKind::Rate
        | FindingKind::Quantised
        | FindingKind::Calm
        | FindingKind::Temperature
        | FindingKind::Topic
        | FindingKind::Damaged => return None,
    })
}

fn columns(topic: &TopicInfo) -> String {
    let column = |column: &ColumnInfo| match &column.unit {
        // a header may say it in the name
        Some(unit) if !column.name.ends_with([')', ']']) => format!("{} ({unit})", column.name),
        _ => column.name.clone(),
    };
    let names: Vec<String> = topic.columns.iter().map(column).collect();
    let of = if topic.name.is_empty() { "columns" } else { topic.name.as_str() };
    format!("{of}: {}", names.join(", "))
}

/// A unit of angular rate or specific force.
fn is_sensor(unit: Option<&str>) -> bool {
    let dimension = unit.and_then(|unit| Unit::parse(unit).ok()).map(|unit| unit.dimension());
    [Quantity::AngularRate, Quantity::SpecificForce].iter().any(|quantity| Some(quantity.dimension()) == dimension)
}
