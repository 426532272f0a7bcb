//! `kfdesign info`.

use std::path::PathBuf;

use super::Status;
use super::output::{digits, duration, print_json, print_text, table};
use crate::input::inspect::{ColumnInfo, Inventory, TopicInfo, inspect};

/// What is in a log: its topics, columns, units, rates and spans
///
/// Nothing is chosen and nothing judged; the commands that take a log do that, and choose a topic with --topic.
#[derive(Debug, clap::Args)]
#[command(after_help = "Example: kfdesign info flight.ulg")]
pub struct Args {
    /// A log of any format that is read
    log: PathBuf,
    /// Every topic with all its columns, not only those with a gyro or an accelerometer
    #[arg(long)]
    all: bool,
    /// One JSON document on stdout, with everything
    #[arg(long)]
    json: bool,
}

pub(super) fn run(args: &Args) -> anyhow::Result<Status> {
    let found = inspect(&args.log)?;
    if args.json {
        print_json(&found)?;
    } else {
        print_text(&text(&args.log.display().to_string(), &found, args.all));
    }
    Ok(Status::Done)
}

fn text(name: &str, found: &Inventory, all: bool) -> String {
    let count = found.topics.len();
    let mut out = format!("{name}: {}, {count} topic{}\n", found.file, if count == 1 { "" } else { "s" });
    let shown = |number: Option<f64>, text: fn(f64) -> String| number.map_or("-".into(), text);
    let rows: Vec<Vec<String>> = found
        .topics
        .iter()
        .map(|topic| {
            vec![
                if topic.name.is_empty() { "(the table)".into() } else { topic.name.clone() },
                topic.rows.map_or("-".into(), |rows| rows.to_string()),
                shown(topic.rate_hz, digits),
                shown(topic.span_s, duration),
            ]
        })
        .collect();
    out.push_str(&table(&["topic", "rows", "rate (Hz)", "span"], &rows));
    let speaks = |topic: &&TopicInfo| all || count == 1 || topic.columns.iter().any(|c| is_sensor(c.unit.as_deref()));
    for topic in found.topics.iter().filter(speaks).filter(|topic| !topic.columns.is_empty()) {
        let column = |column: &ColumnInfo| match &column.unit {
            // a header may say it in the name
            Some(unit) if !column.name.ends_with([')', ']']) => format!("{} ({unit})", column.name),
            _ => column.name.clone(),
        };
        let columns: Vec<String> = topic.columns.iter().map(column).collect();
        let of = if topic.name.is_empty() { "columns".to_string() } else { topic.name.clone() };
        out.push_str(&format!("{of}: {}\n", columns.join(", ")));
    }
    for topic in &found.topics {
        let of = if topic.name.is_empty() { "" } else { &format!("{}: ", topic.name) };
        if let Some(kind) = &topic.kind {
            out.push_str(&format!("note: {of}messages of the type '{kind}' are not read\n"));
        }
        if let Some(note) = &topic.note {
            out.push_str(&format!("note: {of}{note}\n"));
        }
    }
    out
}

/// A unit of angular rate or specific force.
fn is_sensor(unit: Option<&str>) -> bool {
    use crate::units::{Quantity, Unit};
    let dimension = unit.and_then(|unit| Unit::parse(unit).ok()).map(|unit| unit.dimension());
    [Quantity::AngularRate, Quantity::SpecificForce].iter().any(|quantity| Some(quantity.dimension()) == dimension)
}
