//! The design under another truth, as a person reads it.

use super::view::{View, shown, title, told};
use crate::cli::output::{digits, table};
use crate::model::LinearModel;
use crate::report::page::Section;
use crate::tune::UnderTruth;
use crate::units::{Quantity, Unit};

/// Axes of the same numbers.
struct Group<'a> {
    result: &'a UnderTruth,
    names: Vec<&'a str>,
    model: &'a LinearModel,
    quantity: Quantity,
    unit: Unit,
}

fn groups<'a>(view: &View<'a>) -> Vec<Group<'a>> {
    let mut groups: Vec<Group<'_>> = Vec::new();
    let (params, design) = (view.params, &view.tuned.design);
    let results = view.truth.map_or(&[][..], |truth| &truth.axes);
    for ((result, design), axis) in results.iter().zip(&design.axes).zip(&params.axes) {
        let unit = axis.display_unit(params.quantity);
        let same = |g: &&mut Group<'_>| {
            let named = UnderTruth { name: g.result.name.clone(), ..result.clone() };
            g.unit == unit && *g.result == named && g.model.states == design.model.states
        };
        match groups.iter_mut().find(same) {
            Some(group) => group.names.push(&result.name),
            None => {
                let (quantity, names) = (params.quantity, vec![result.name.as_str()]);
                groups.push(Group { result, names, model: &design.model, quantity, unit });
            }
        }
    }
    groups
}

impl Group<'_> {
    /// States with columns of their own.
    fn states(&self) -> impl Iterator<Item = usize> + '_ {
        told(self.model).filter(|&i| i < self.result.states.len())
    }

    fn header(&self) -> Vec<String> {
        let mut header = vec!["time (s)".to_string()];
        for i in self.states() {
            header.extend([self.result.states[i].name.clone(), "claimed".into()]);
        }
        header.extend([format!("whole drift ({})", self.unit), "claimed".into(), "NEES".into()]);
        header
    }

    fn rows(&self) -> Vec<Vec<String>> {
        let result = self.result;
        let row = |(k, &time): (usize, &f64)| {
            let mut row = vec![digits(time)];
            for i in self.states() {
                let (error, scale) = (&result.states[i], shown(self.model, i, self.quantity, &self.unit).0);
                row.extend([digits(error.real[k] / scale), digits(error.claimed[k] / scale)]);
            }
            let drift = &result.drift;
            row.extend([drift.real[k], drift.claimed[k]].map(|sigma| digits(self.unit.from_si(sigma))));
            row.push(result.nees[k].map_or_else(|| "-".into(), digits));
            row
        };
        result.time_s.iter().enumerate().map(row).collect()
    }

    fn expected(&self) -> String {
        let result = self.result;
        let per =
            if result.states.is_empty() { "of the whole drift (the truth has other states)" } else { "per state" };
        let span = result.time_s.last().copied().unwrap_or(0.0);
        format!(
            "Expected NEES {per}; expected NIS {} over {} s: both would be 1 if all were as claimed.",
            digits(result.nis),
            digits(span)
        )
    }
}

const CAPTION: &str = "root mean square error beside the sigma that the filter claims, exact, no simulation";

/// Nothing without a truth.
pub(super) fn text(view: &View<'_>) -> String {
    let Some(truth) = view.truth else { return String::new() };
    let mut out = format!("\nUnder the truth {}: {CAPTION}\n", truth.name);
    for group in groups(view) {
        let header = group.header();
        let header: Vec<&str> = header.iter().map(String::as_str).collect();
        out.push_str(&format!("{}\n{}", title(&group.names), table(&header, &group.rows())));
        out.push_str(&format!("{}\n{}\n", group.expected(), group.result.meaning));
        for note in &group.result.notes {
            out.push_str(&format!("note: {note}\n"));
        }
    }
    out
}

/// One section of the report page per group of axes.
pub(super) fn sections(view: &View<'_>) -> Vec<Section> {
    let Some(truth) = view.truth else { return Vec::new() };
    let section = |group: &Group<'_>| {
        let header = group.header();
        let header: Vec<&str> = header.iter().map(String::as_str).collect();
        let mut section = Section::new(format!("Under the truth {}: {}", truth.name, title(&group.names)))
            .paragraph(format!("{}. {}", group.result.meaning, group.expected()))
            .table(CAPTION, &header, group.rows());
        for note in &group.result.notes {
            section = section.warning(note.clone());
        }
        section
    };
    groups(view).iter().map(section).collect()
}
