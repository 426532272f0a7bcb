//! What is shown of a design: axes of the same numbers together.

use super::Truth;
use crate::cli::output::shown_unit;
use crate::filter::AxisDesign;
use crate::model::LinearModel;
use crate::montecarlo::Outcome;
use crate::params::Params;
use crate::tune::{AxisReport, Insight, Tuned};
use crate::units::{Quantity, Unit};

/// Everything that is shown.
pub(super) struct View<'a> {
    pub(super) name: &'a str,
    pub(super) params: &'a Params,
    pub(super) tuned: &'a Tuned,
    pub(super) verification: &'a Outcome,
    pub(super) truth: Option<&'a Truth>,
    /// Of every axis, if asked for.
    pub(super) insights: &'a [Insight],
}

/// One or more axes with the same design.
pub(super) struct Group<'a> {
    pub(super) names: Vec<&'a str>,
    pub(super) design: &'a AxisDesign,
    pub(super) report: &'a AxisReport,
    pub(super) unit: Unit,
}

impl View<'_> {
    /// Axes of the same numbers together, in order.
    pub(super) fn groups(&self) -> Vec<Group<'_>> {
        let mut groups: Vec<Group<'_>> = Vec::new();
        let axes = self.tuned.design.axes.iter().zip(&self.tuned.reports).zip(&self.params.axes);
        for ((design, report), params) in axes {
            let unit = params.display_unit(self.params.quantity);
            let same = |g: &&mut Group<'_>| {
                g.unit == unit
                    && g.design.model == design.model
                    && g.report.warnings == report.warnings
                    && g.report.predicted == report.predicted
            };
            match groups.iter_mut().find(same) {
                Some(group) => group.names.push(&design.name),
                None => groups.push(Group { names: vec![&design.name], design, report, unit }),
            }
        }
        groups
    }
}

impl<'a> View<'a> {
    pub(super) fn insight(&self, group: &Group<'_>) -> Option<&'a Insight> {
        self.insights.iter().find(|insight| Some(&insight.axis.as_str()) == group.names.first())
    }
}

impl Group<'_> {
    pub(super) fn title(&self) -> String {
        title(&self.names)
    }
}

pub(super) fn title(names: &[&str]) -> String {
    match names {
        [one] => format!("axis {one}"),
        many => format!("axes {} (identical)", many.join(", ")),
    }
}

/// A state's own unit, see [`shown_unit`].
pub(super) fn shown(model: &LinearModel, state: usize, quantity: Quantity, unit: &Unit) -> (f64, String) {
    shown_unit(&model.states[state].unit, quantity, unit)
}

/// States with a column of their own: not those that only together stand for flicker or an average.
pub(super) fn told(model: &LinearModel) -> impl Iterator<Item = usize> + '_ {
    let together = ["bias_instability", "moving_average", "band_limit"];
    (0..model.states.len()).filter(move |&i| !together.iter().any(|kind| model.states[i].name.starts_with(kind)))
}
