//! The text of a file: at most ten lines of comment, the numbers, then the details.

use super::numbers::Number;
use super::{Export, Written, exponent, walk_unit};
use crate::units::digits;

/// A file in the making.
pub(super) struct Page {
    /// What the reader wants first.
    pub(super) first: &'static str,
    /// Begins a comment; of XML its indent.
    pub(super) mark: &'static str,
    /// At most three lines: what the consumer does with the numbers.
    pub(super) about: Vec<String>,
    /// One line for each sensor: what its drift became, and the price.
    pub(super) price: Vec<String>,
    pub(super) body: String,
    pub(super) details: Vec<String>,
    pub(super) warnings: Vec<String>,
}

impl Page {
    pub(super) fn new(warnings: Vec<String>) -> Page {
        Page {
            first: "",
            mark: "#",
            about: Vec::new(),
            price: Vec::new(),
            body: String::new(),
            details: Vec::new(),
            warnings,
        }
    }

    pub(super) fn about(&mut self, lines: &[&str]) {
        self.about.extend(lines.iter().map(|line| (*line).to_owned()));
    }

    /// A comment among the numbers.
    pub(super) fn remark(&mut self, text: &str) {
        let comment = self.comment(&[text.to_owned()]);
        self.body.push_str(&comment);
    }

    /// Every text that comes from elsewhere enters a file here.
    fn comment(&self, lines: &[String]) -> String {
        let text: String = lines.iter().map(|line| format!("{} {line}\n", self.mark)).collect();
        match self.mark.trim().is_empty() {
            // two hyphens would end the comment
            true => format!("<!--\n{}-->\n", text.replace("--", "- -")),
            false => text,
        }
    }

    pub(super) fn finish(self, export: &Export) -> Written {
        let mut head = export.origin.clone();
        head.extend(self.about.iter().cloned());
        head.extend(self.price.iter().cloned());
        let drift = if export.measured_inflation.is_empty() { "" } else { "drift as " };
        let inflation = match (export.inflation == 1.0, export.measured_inflation.is_empty()) {
            (true, true) => "none".into(),
            (true, false) => "none beyond the measured one below".into(),
            (false, _) => format!("N and K (and sigma) are {} times those below", digits(export.inflation)),
        };
        // a log that moved says nothing of the sensor at rest, and a datasheet has none
        let origin = match (export.failed.is_empty(), export.from_log) {
            (true, true) => format!("{drift}identified at rest: a lower bound of what a moving vehicle shows"),
            (true, false) => format!("{drift}given, not from a log: a lower bound of what a moving vehicle shows"),
            (false, _) => format!("identified although a check failed: {}", export.failed.join("; ")),
        };
        head.push(format!("{origin}; inflation: {inflation}; details below"));
        let mut details = vec![export.choice_words()];
        details.extend(of_sensors(export));
        details.extend(self.details.iter().cloned());
        details.extend(export.measured_inflation.iter().cloned());
        let text = [self.first, &self.comment(&head), &self.body, &self.comment(&details)].concat();
        Written { text, warnings: self.warnings }
    }
}

/// The numbers of every axis with their intervals, before inflation.
fn of_sensors(export: &Export) -> Vec<String> {
    let mut lines = Vec::new();
    for sensor in export.sensors() {
        let unit = sensor.quantity.si_unit();
        for axis in &sensor.axes {
            let interval = |number: &Number| {
                number
                    .interval
                    .map_or_else(String::new, |[low, high]| format!(" [{}, {}]", exponent(low), exponent(high)))
            };
            let white = format!("N = {}{} {unit}/sqrt(Hz)", exponent(axis.white.value), interval(&axis.white));
            let unit_of_walk = walk_unit(sensor.quantity);
            let walk = match (&axis.walk, axis.walk_limit) {
                (Some(walk), _) => format!("K = {}{} {unit_of_walk}", exponent(walk.value), interval(walk)),
                (None, Some(limit)) => format!("no drift found, K below {} {unit_of_walk} (95 %)", exponent(limit)),
                (None, None) if axis.drift.is_empty() => "no drift is known".into(),
                (None, None) => "its drift:".into(),
            };
            lines.push(format!("{}: {white}, {walk}", axis.name));
            for process in &axis.processes {
                lines.push(format!(
                    "{}: Gauss-Markov drift of sigma {} {unit}, Tc {} s",
                    axis.name,
                    exponent(process.std_dev),
                    digits(process.correlation_time)
                ));
            }
            lines.extend(axis.note());
            if axis.ramp {
                let words =
                    "its ramp counts as the walk that has grown as far after a minute, or the horizon of the rule";
                lines.push(format!("{}: {words}", axis.name));
            }
            if !axis.left_out.is_empty() {
                lines.push(format!("{}: left out, no field for it: {}", axis.name, axis.left_out.join(", ")));
            }
        }
    }
    lines
}
