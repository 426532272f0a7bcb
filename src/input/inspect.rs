//! What a file holds, without choosing anything in it.

use std::path::Path;

use schemars::JsonSchema;
use serde::Serialize;

use super::names::Head;
use super::source;
use super::table::Topic;
use super::{InputError, LogOptions, Rows, Table, columns};

/// The tables of a file.
#[derive(Clone, Debug, Serialize, JsonSchema)]
pub struct Inventory {
    /// "kfdesign-info/1".
    pub format: String,
    /// "PX4 ULog".
    pub file: String,
    pub topics: Vec<TopicInfo>,
}

/// One table.
#[derive(Clone, Debug, Serialize, JsonSchema)]
pub struct TopicInfo {
    /// What `--topic` takes; empty where the file has one table without a name.
    pub name: String,
    /// Type of messages that are not read.
    pub kind: Option<String>,
    pub rows: Option<u64>,
    /// Name of the column that is the time if no flag says otherwise.
    pub time: Option<String>,
    /// Seconds from the first to the last row, where a time column has a unit.
    pub span_s: Option<f64>,
    /// Mean rate: (rows − 1) / span; or what the file says.
    pub rate_hz: Option<f64>,
    pub columns: Vec<ColumnInfo>,
    /// Why there is less than one would expect.
    pub note: Option<String>,
}

/// One column.
#[derive(Clone, Debug, Serialize, JsonSchema)]
pub struct ColumnInfo {
    pub name: String,
    /// As it is known without `--unit`.
    pub unit: Option<String>,
}

/// Looks at every table of a file.
pub fn inspect(path: &Path) -> Result<Inventory, InputError> {
    let path = &source::resolve(path)?;
    let mut opened = source::open(path)?;
    let file = opened.format().to_string();
    let topics: Vec<Topic> = opened.topics().to_vec();
    let mut found = Vec::with_capacity(topics.len());
    for (at, topic) in topics.iter().enumerate() {
        let time = time(topic);
        let column =
            |head: &Head| ColumnInfo { name: head.full.clone(), unit: head.unit.as_ref().map(|u| u.to_string()) };
        let mut info = TopicInfo {
            name: topic.name.clone(),
            kind: (topic.heads.is_empty() && !topic.object).then(|| topic.kind.clone()),
            rows: topic.rows,
            time: time.map(|column| topic.heads[column].full.clone()),
            span_s: topic.span_s.map(|(first, last)| last - first),
            rate_hz: None,
            columns: topic.heads.iter().map(column).collect(),
            note: topic.object.then(|| topic.unread_object()),
        };
        if info.span_s.is_none() && !topic.heads.is_empty() {
            let mut table = opened.table(at)?;
            info.rate_hz = table.rate().filter(|_| time.is_none()).map(|(_, rate)| rate);
            match pass(table.as_mut(), time) {
                Ok((rows, span)) => {
                    info.rows = Some(rows);
                    info.span_s = span.and_then(|span| Some(topic.heads[time?].unit.as_ref()?.to_si(span)));
                }
                Err(error) => info.note = Some(error.message),
            }
        }
        let steps = info.rows.unwrap_or(0).saturating_sub(1) as f64;
        match (info.span_s, info.rate_hz) {
            (Some(span), None) if span > 0.0 && steps > 0.0 => info.rate_hz = Some(steps / span),
            (None, Some(rate)) => info.span_s = Some(steps / rate),
            _ => {}
        }
        found.push(info);
    }
    Ok(Inventory { format: "kfdesign-info/1".into(), file, topics: found })
}

/// The column that is the time if no flag says otherwise; it has a unit.
fn time(topic: &Topic) -> Option<usize> {
    let heads: Vec<&Head> = topic.heads.iter().collect();
    let table = columns::Table { heads: &heads, named: topic.named, place: "", rate_hz: Some(1.0) };
    table.time(&LogOptions::default()).ok().flatten().map(|(column, _)| column)
}

/// Number of rows, and from the first stamp to the last, in the unit of the file.
fn pass(table: &mut dyn Table, time: Option<usize>) -> Result<(u64, Option<f64>), InputError> {
    // an array needs some column to be read at all
    let some: &[usize] = if time.is_none() { &[0] } else { &[] };
    table.select(time, &[], some.first().copied());
    let mut rows = Rows::default();
    let (mut count, mut first, mut last) = (0, None, None);
    while table.next_rows(&mut rows)? {
        count += rows.lines.len() as u64;
        let mut stamps = rows.time.iter().copied().filter(|t| t.is_finite());
        if first.is_none() {
            first = stamps.next();
            last = first;
        }
        last = stamps.next_back().or(last);
    }
    Ok((count, first.zip(last).map(|(first, last)| last - first)))
}
