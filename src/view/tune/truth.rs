//! The design under another truth.

use super::{Design, states, title};
use crate::model::LinearModel;
use crate::report::Section;
use crate::tune::UnderTruth;
use crate::units::{Quantity, Unit, digits, shown_unit};

/// Axes of the same numbers.
struct Group<'a> {
    result: &'a UnderTruth,
    names: Vec<&'a str>,
    model: &'a LinearModel,
    quantity: Quantity,
    unit: Unit,
}

fn groups<'a>(of: &Design<'a>, results: &'a [UnderTruth]) -> Vec<Group<'a>> {
    let mut groups: Vec<Group<'_>> = Vec::new();
    let quantity = of.params.quantity;
    for ((result, design), axis) in results.iter().zip(&of.tuned.design.axes).zip(&of.params.axes) {
        let unit = axis.display_unit(quantity);
        let same = |g: &&mut Group<'_>| {
            let named = UnderTruth { name: g.result.name.clone(), ..result.clone() };
            g.unit == unit && *g.result == named && g.model.states == design.model.states
        };
        match groups.iter_mut().find(same) {
            Some(group) => group.names.push(&result.name),
            None => groups.push(Group { result, names: vec![&result.name], model: &design.model, quantity, unit }),
        }
    }
    groups
}

impl Group<'_> {
    /// States with columns of their own.
    fn states(&self) -> impl Iterator<Item = usize> + '_ {
        states::single(self.model).filter(|&i| i < self.result.states.len())
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
                let (error, scale) =
                    (&result.states[i], shown_unit(&self.model.states[i].unit, self.quantity, &self.unit).0);
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

/// One per group of axes; none without a truth.
pub(super) fn sections<'a>(of: &Design<'a>) -> Vec<Section<'a>> {
    let Some((name, results)) = of.truth else { return Vec::new() };
    let section = |group: &Group<'a>| {
        Section::new(format!("Under the truth {name}: {}", title(&group.names)))
            .table(
                "Root mean square error beside the sigma that the filter claims, exact, no simulation",
                &group.header(),
                group.rows(),
            )
            .paragraphs(vec![group.expected(), group.result.meaning.clone()])
            .findings("note", group.result.notes.clone())
    };
    groups(of, results).iter().map(section).collect()
}
