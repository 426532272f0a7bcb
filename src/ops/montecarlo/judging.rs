//! The verdict on runs, and what the gate would have seen.

use std::borrow::Cow;

use anyhow::{Context, bail};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::Simulated;
use crate::export::atomic;
use crate::montecarlo::calibration::{self, MAX_REPLICATES, REPLICATES};
use crate::montecarlo::document;
use crate::montecarlo::gate::Gate;
use crate::montecarlo::power::{self, Mistuning};
use crate::montecarlo::{Course, Experiment, Outcome, conclude};
use crate::numerics::progress::{begin, on_threads};
use crate::ops::amounts::whole;
use crate::view::montecarlo::{self, MonteCarlo};

/// What is to be known of the gate itself.
#[derive(Clone, Debug, Default, clap::Args, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Judging {
    /// Print what the gate would see: the smallest mistuning of every parameter that is caught with 90 % probability
    #[arg(long)]
    #[serde(default)]
    pub power: bool,
    /// Simulate each of these sizes, and the given truth, in this many whole experiments and count what is caught
    #[arg(long, default_value_t = 0, value_name = "N", value_parser = whole::<u64>, allow_negative_numbers = true)]
    #[serde(default)]
    pub confirm: u64,
    /// How many runs, or how long ones, see this mistuning: "gauss_markov.std_dev x1.3" (the filter's value is 1.3
    /// times the true one)
    #[arg(long, alias = "plan", value_name = "PARAMETER xFACTOR")]
    #[serde(default, alias = "plan")]
    pub runs_for: Vec<String>,
}

/// The verdict.
pub struct Judged {
    pub outcome: Outcome,
    /// The document, as `output` has it.
    pub json: String,
    simulated: Simulated,
    power: bool,
    /// What wished sensitivities cost, one sentence each.
    plans: Vec<String>,
}

impl Simulated {
    /// The verdict on the sums; the document is in `output`.
    pub fn judge(self, judging: &Judging) -> anyhow::Result<Judged> {
        on_threads(self.threads, || self.judge_here(judging))
    }

    fn judge_here(self, judging: &Judging) -> anyhow::Result<Judged> {
        let Simulated { experiment, course, totals, runs, .. } = &self;
        let count = runs.end - runs.start;
        let gate = calibration::gate(course, count, experiment.alpha, REPLICATES);
        let mut outcome = conclude(course, totals, runs.clone(), &gate);
        outcome.false_alarm_rate = Some(match experiment.replicates {
            0 => calibration::false_alarms(course, &gate, count),
            replicates => {
                begin("false alarms", (replicates * count).saturating_mul(course.axes.len() as u64));
                let own = experiment.own_course()?;
                calibration::false_alarms_of_experiments(&own, &gate, count, replicates)
            }
        });
        if experiment.truth.is_some() && !experiment.truth_spread {
            outcome.rejection = power::rejection(course, &gate, count);
            if let Some(rejection) = outcome.rejection.as_mut().filter(|_| judging.confirm > 0) {
                begin("confirm", (judging.confirm * count).saturating_mul(course.axes.len() as u64));
                let (axes, critical) = (&gate.axes, gate.critical);
                rejection.confirmed =
                    Some(calibration::caught_of_experiments(course, axes, critical, count, judging.confirm));
            }
        }
        let detects = experiment.truth.is_none() || judging.power;
        let mut plans = Vec::new();
        if detects || !judging.runs_for.is_empty() {
            plans = judging.look(experiment, course, &gate, detects, &mut outcome)?;
        }
        let json = document::to_json(experiment, &outcome, totals);
        if let Some(path) = &self.output {
            atomic::write(path, json.as_bytes())?;
        }
        Ok(Judged { outcome, json, power: judging.power, plans, simulated: self })
    }
}

impl Judged {
    /// A page always has the table of what the gate sees; the document has it only where it was asked for.
    pub fn complete(&mut self) -> anyhow::Result<()> {
        let Simulated { experiment, course, runs, threads, .. } = &self.simulated;
        if self.outcome.detects.is_empty() {
            let count = runs.end - runs.start;
            self.outcome.detects = on_threads(*threads, || {
                let gate = calibration::gate(course, count, experiment.alpha, REPLICATES);
                let (course, gate) = as_own_truth(experiment, course, &gate, count)?;
                anyhow::Ok(power::detectable(experiment, &course, &gate, count))
            })?;
        }
        Ok(())
    }

    /// As a person reads it.
    pub fn shown(&self) -> MonteCarlo<'_> {
        let Simulated { experiment, course, sources, .. } = &self.simulated;
        MonteCarlo { experiment, course, outcome: &self.outcome, sources, power: self.power, plans: &self.plans }
    }
}

impl Judging {
    pub(super) fn check(&self) -> anyhow::Result<()> {
        if self.confirm > MAX_REPLICATES {
            bail!("`confirm` {}: expected at most {MAX_REPLICATES} experiments", self.confirm);
        }
        Ok(())
    }

    /// Every plan names a parameter and a factor: better known before the runs than after.
    pub(super) fn check_plans(&self, experiment: &Experiment) -> anyhow::Result<()> {
        if !self.runs_for.is_empty() {
            let own = experiment.own_course()?;
            self.runs_for.iter().try_for_each(|text| planned(experiment, &own, text).map(|_| ()))?;
        }
        Ok(())
    }

    /// What the gate sees when the design is wrong, into the outcome if `detects` says so; the plans in words.
    fn look(
        &self,
        experiment: &Experiment,
        course: &Course,
        gate: &Gate,
        detects: bool,
        outcome: &mut Outcome,
    ) -> anyhow::Result<Vec<String>> {
        let runs = outcome.runs.count();
        let (course, gate) = as_own_truth(experiment, course, gate, runs)?;
        let (course, gate) = (course.as_ref(), gate.as_ref());
        let plans: Vec<(usize, Mistuning, f64, &str)> =
            self.runs_for.iter().map(|text| planned(experiment, course, text)).collect::<Result<_, _>>()?;
        if detects {
            outcome.detects = power::detectable(experiment, course, gate, runs);
        }
        if self.confirm > 0 {
            let sizes: usize =
                outcome.detects.iter().map(|d| d.too_large.iter().count() + d.too_small.iter().count()).sum();
            begin("confirm", (self.confirm * runs).saturating_mul(sizes as u64));
            power::confirm(experiment, course, gate, runs, self.confirm, &mut outcome.detects)?;
        }
        let plan = |(number, what, size, wished): (usize, Mistuning, f64, &str)| {
            let needed = power::plan(experiment, course, gate, runs, number, &what, size)?;
            Ok(montecarlo::plan(outcome, wished, &needed))
        };
        plans.into_iter().map(plan).collect()
    }
}

/// Course and gate of the design as its own truth: what power is about. Another truth may be judged by other
/// components.
fn as_own_truth<'a>(
    experiment: &Experiment,
    course: &'a Course,
    gate: &'a Gate,
    runs: u64,
) -> anyhow::Result<(Cow<'a, Course>, Cow<'a, Gate>)> {
    if experiment.truth.is_none() && !experiment.truth_spread {
        return Ok((Cow::Borrowed(course), Cow::Borrowed(gate)));
    }
    let own = experiment.own_course()?;
    let gate = calibration::gate(&own, runs, experiment.alpha, REPLICATES);
    Ok((Cow::Owned(own), Cow::Owned(gate)))
}

/// The axis, what is wrong about it and by how much: `gauss_markov.std_dev x1.3`, with `y:` before it for another
/// axis than the first.
fn planned<'a>(
    experiment: &Experiment,
    course: &Course,
    text: &'a str,
) -> anyhow::Result<(usize, Mistuning, f64, &'a str)> {
    let (axis, rest) = text.split_once(':').map_or((None, text), |(axis, rest)| (Some(axis.trim()), rest));
    let number = match axis {
        None => 0,
        Some(name) => course.axes.iter().position(|a| a.name == name).with_context(|| {
            let names: Vec<&str> = course.axes.iter().map(|a| a.name.as_str()).collect();
            format!("`runs_for` \"{text}\": no axis '{name}'; there are {}", names.join(", "))
        })?,
    };
    let course = &course.axes[number];
    let all = Mistuning::all(experiment, number, course);
    let names: Vec<String> = all.iter().map(|what| what.name(course)).collect();
    let expected = || {
        format!(
            "`runs_for` \"{text}\": expected a parameter and a factor like \"{} x1.3\"; parameters: {}",
            names.first().map_or("P0 of bias", String::as_str),
            names.join(", ")
        )
    };
    let (name, factor) = rest.trim().rsplit_once(char::is_whitespace).with_context(expected)?;
    let what = all
        .iter()
        .zip(&names)
        .find(|(_, known)| *known == name.trim())
        .map(|(what, _)| what.clone())
        .with_context(expected)?;
    let factor = factor.trim_start_matches(['x', '×']);
    let size = factor
        .parse::<f64>()
        .ok()
        .filter(|f| f.is_finite() && *f > 0.0 && *f != 1.0 && (1e-3..=1e3).contains(f))
        .with_context(expected)?;
    Ok((number, what, size, text))
}
