//! What is in a log.

use super::or_dash;
use crate::input::inspect::{ColumnInfo, Inventory, TopicInfo};
use crate::report::{Report, Section};
use crate::units::{Quantity, Unit, duration};

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
