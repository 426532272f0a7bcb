//! Many runs of one plan, and what is said of each.

use rayon::prelude::*;
use schemars::JsonSchema;
use serde::Serialize;

use super::FlightError;
use super::plan::Plan;
use super::rows;
use crate::numerics::reduce::Moments;

/// What `fly` says of its runs; the rows themselves are in the logs.
#[derive(Clone, Debug, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct FlightReport {
    #[schemars(extend("const" = "kfdesign-fly/1"))]
    pub format: &'static str,
    /// Of the program.
    pub version: &'static str,
    pub airplane: String,
    pub seed: u64,
    pub duration_s: f64,
    /// Between two steps of the integration.
    pub step_s: f64,
    /// Between two rows.
    pub every_s: f64,
    pub runs: Vec<RunReport>,
}

/// One run.
#[derive(Clone, Debug, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct RunReport {
    pub run: u64,
    /// The file of its rows, if there is one.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub log: Option<String>,
    pub rows: u64,
    pub columns: Vec<ColumnReport>,
}

/// A column over all rows that have a value, in its unit.
#[derive(Clone, Debug, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ColumnReport {
    /// With its unit.
    pub name: String,
    pub mean: f64,
    /// About the mean.
    pub std_dev: f64,
    pub least: f64,
    pub greatest: f64,
    pub last: f64,
}

/// Where the rows of a run go.
pub trait RowSink<E> {
    /// Columns of equal length.
    fn write(&mut self, columns: &[Vec<f64>]) -> Result<(), E>;
    /// All rows were written; the name of the log.
    fn finish(self) -> Result<Option<String>, E>;
}

/// Values looked at together.
const LANES: usize = 8;

/// Rows handed over at once.
const BLOCK: usize = 1024;

impl Plan {
    /// Names and units of the columns.
    pub fn columns(&self) -> Vec<String> {
        rows::header(self)
    }

    /// Of the surfaces, rad, each once.
    pub fn stops(&self) -> Vec<f64> {
        let stops = self.airplane.actuators.iter().flatten().flat_map(|actuator| actuator.travel);
        let mut stops: Vec<f64> = stops.filter(|stop| stop.is_finite()).collect();
        stops.sort_by(f64::total_cmp);
        stops.dedup();
        stops
    }

    pub(super) fn has_gusts(&self) -> bool {
        !(self.dryden.is_empty() && self.discrete.is_empty())
    }
}

/// Flies runs 0 … `runs` − 1 on all threads; `open` gives the place for the rows of a run. Memory does not grow with
/// the length of a flight. Errors: the first run that fails, in the order of runs.
pub fn fly<E, S>(
    plan: &Plan,
    seed: u64,
    runs: u64,
    open: impl Fn(u64) -> Result<S, E> + Sync,
) -> Result<FlightReport, E>
where
    E: From<FlightError> + Send,
    S: RowSink<E>,
{
    let reports: Vec<Result<RunReport, E>> =
        (0..runs).into_par_iter().map(|run| one(plan, seed, run, open(run)?)).collect();
    Ok(FlightReport {
        format: "kfdesign-fly/1",
        version: env!("CARGO_PKG_VERSION"),
        airplane: plan.airplane.name.clone(),
        seed,
        duration_s: plan.duration(),
        step_s: plan.step(),
        every_s: plan.grid.row as f64 / plan.grid.rate,
        runs: reports.into_iter().collect::<Result<_, _>>()?,
    })
}

/// Running figures of a column, over the values that are there.
#[derive(Clone, Copy)]
struct Figures {
    moments: Moments,
    least: f64,
    greatest: f64,
    last: f64,
}

impl Figures {
    const NONE: Figures =
        Figures { moments: Moments::NONE, least: f64::INFINITY, greatest: f64::NEG_INFINITY, last: f64::NAN };

    /// `there` is room for the values of a column that has gaps.
    fn add(&mut self, column: &[f64], there: &mut Vec<f64>) {
        let values = if column.iter().all(|x| x.is_finite()) {
            column
        } else {
            there.clear();
            there.extend(column.iter().copied().filter(|x| x.is_finite()));
            there
        };
        self.moments.merge(&Moments::of(values));
        let (parts, rest) = values.as_chunks::<LANES>();
        let (mut least, mut greatest) = ([self.least; LANES], [self.greatest; LANES]);
        for part in parts {
            for (i, x) in part.iter().enumerate() {
                least[i] = if *x < least[i] { *x } else { least[i] };
                greatest[i] = if *x > greatest[i] { *x } else { greatest[i] };
            }
        }
        self.least = least.iter().chain(rest).copied().fold(self.least, f64::min);
        self.greatest = greatest.iter().chain(rest).copied().fold(self.greatest, f64::max);
        self.last = values.last().copied().unwrap_or(self.last);
    }
}

fn one<E: From<FlightError>, S: RowSink<E>>(plan: &Plan, seed: u64, run: u64, mut sink: S) -> Result<RunReport, E> {
    let names = plan.columns();
    let mut figures = vec![Figures::NONE; names.len()];
    let mut there = Vec::new();
    let mut block: Vec<Vec<f64>> = vec![Vec::with_capacity(BLOCK); names.len()];
    let mut count = 0;
    let mut hand_over = |block: &mut [Vec<f64>]| {
        figures.iter_mut().zip(&*block).for_each(|(figures, column)| figures.add(column, &mut there));
        sink.write(block)?;
        block.iter_mut().for_each(Vec::clear);
        Ok::<(), E>(())
    };
    plan.fly(seed, run, |row| {
        block.iter_mut().zip(row).for_each(|(column, value)| column.push(*value));
        count += 1;
        if count % BLOCK as u64 == 0 { hand_over(&mut block) } else { Ok(()) }
    })?;
    if count % BLOCK as u64 != 0 {
        hand_over(&mut block)?;
    }
    let columns = names
        .into_iter()
        .zip(figures)
        .map(|(name, f)| ColumnReport {
            name,
            mean: f.moments.mean,
            std_dev: f.moments.variance().max(0.0).sqrt(),
            least: f.least,
            greatest: f.greatest,
            last: f.last,
        })
        .collect();
    Ok(RunReport { run, log: sink.finish()?, rows: count, columns })
}
