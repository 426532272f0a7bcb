//! The filter in the control loop.

use std::path::{Path, PathBuf};

use anyhow::{Context, bail};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::amounts::{whole, with_unit};
use crate::aircraft::closed_loop::curves::{Drawn, corners};
use crate::aircraft::closed_loop::flights::{flown, needed, one};
use crate::aircraft::closed_loop::optimize::{again, optimize};
use crate::aircraft::closed_loop::rule::resolved;
use crate::aircraft::closed_loop::schedule::price;
use crate::aircraft::closed_loop::spread::spread;
use crate::aircraft::closed_loop::sweep::{Variable, sweep};
use crate::aircraft::closed_loop::{Judged, LoopError};
use crate::aircraft::flight::document::FeedEntry;
use crate::aircraft::flight::{FlightDocument, Plan, Times};
use crate::numerics::progress::note;
use crate::units::{Dimension, digits, significant};

/// More cases than a share needs are a slip of the hand.
const MOST_CASES: u64 = 100_000;

/// Which feeds are judged in which flight.
#[derive(Clone, Debug, clap::Args, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Request {
    /// flight.json with autopilot, feeds and criteria
    pub flight: PathBuf,
    /// Fly the same gains and filters in this flight.json instead: another airplane, speed, gust or sensor
    #[arg(long, value_name = "FLIGHT")]
    #[serde(default)]
    pub truth: Option<PathBuf>,
    /// Also vary one thing
    #[arg(long, value_name = "WHAT", value_parser = Variable::ALL.map(Variable::name))]
    #[serde(default)]
    pub sweep: Option<String>,
    /// Also judge N airplanes and sensors drawn from the flight's uncertainty and the intervals of the gyro's
    /// parameters
    #[arg(long, value_name = "N", value_parser = whole::<u64>, allow_negative_numbers = true)]
    #[serde(default)]
    pub spread: Option<u64>,
    /// Also choose the corner and the gains of each feed by which the cost in the flight is least while the criteria
    /// hold; with flights, fly these too, from another seed
    #[arg(long)]
    #[serde(default)]
    pub optimize: bool,
    /// Also fly every feed N times in six degrees of freedom, in the same gusts and noise
    #[arg(long, value_name = "N", value_parser = whole::<u64>, allow_negative_numbers = true)]
    #[serde(default)]
    pub montecarlo: Option<u64>,
    /// Length of a flight, for example 60s
    #[arg(long, value_name = "TIME", default_value = "60s", allow_hyphen_values = true)]
    #[serde(default = "minute")]
    pub duration: String,
    /// Seed of all random numbers
    #[arg(long, default_value_t = 1, value_name = "N", value_parser = whole::<u64>, allow_negative_numbers = true)]
    #[serde(default = "seed")]
    pub seed: u64,
}

fn minute() -> String {
    "60s".into()
}

fn seed() -> u64 {
    1
}

impl Request {
    /// Files that are read, in the order of the flags.
    pub fn inputs(&self) -> Vec<&Path> {
        std::iter::once(self.flight.as_path()).chain(self.truth.as_deref()).collect()
    }
}

/// What `loop` found.
#[derive(Debug)]
pub struct Done {
    pub judged: Judged,
    pub drawn: Drawn,
}

/// `figures`: also what only figures show. Errors: one line each, with the file.
pub fn run(request: &Request, figures: bool) -> anyhow::Result<Done> {
    let flight = flight(&request.flight)?;
    let truth = request.truth.as_deref().map(self::flight).transpose()?;
    let shown = request.flight.display();
    let other = truth.as_ref().zip(request.truth.as_deref()).map(|(document, path)| (document, folder(path)));
    let named = |e: LoopError| anyhow::anyhow!("{shown}: {e}");
    let mut judged = Judged::new(&flight, folder(&request.flight), other).map_err(named)?;
    judged.document.notes.extend(price(&judged, &flight.feeds, folder(&request.flight)).map_err(named)?);
    if let Some(name) = &request.sweep {
        let known = || Variable::ALL.map(Variable::name).join(", ");
        let variable = Variable::named(name).with_context(|| format!("`sweep` {name}: known are {}", known()))?;
        judged.document.sweep = Some(sweep(&judged, &flight.feeds, folder(&request.flight), variable).map_err(named)?);
    }
    if let Some(cases) = request.spread {
        if !(2..=MOST_CASES).contains(&cases) {
            bail!("`spread` {cases}: expected 2 to {MOST_CASES} cases");
        }
        let uncertainty = flight.uncertainty.unwrap_or_default();
        judged.document.spread = Some(spread(&judged, &uncertainty, cases, request.seed).map_err(named)?);
    }
    let mut better = None;
    if request.optimize {
        let wanted = flight.optimize.clone().unwrap_or_default();
        let feeds = if flight.feeds.is_empty() { vec![FeedEntry::Raw { name: None }] } else { flight.feeds.clone() };
        let (optimized, feeds) = optimize(&judged, &feeds, folder(&request.flight), &wanted).map_err(named)?;
        judged.document.optimized = Some(optimized);
        better = Some(feeds);
    }
    let plan = || -> anyhow::Result<Plan> {
        let duration = with_unit("`duration`", &request.duration, Dimension::TIME, "60s")?;
        let times = Times { duration, every: None, step: None };
        let (document, path) = match (&truth, &request.truth) {
            (Some(truth), Some(path)) => (truth, path),
            _ => (&flight, &request.flight),
        };
        Plan::new(document, folder(path), &times).map_err(|e| named(e.into()))
    };
    if let Some(runs) = request.montecarlo {
        if !(2..=MOST_CASES).contains(&runs) {
            bail!("`montecarlo` {runs}: expected 2 to {MOST_CASES} flights");
        }
        let plan = plan()?;
        let duration = plan.duration();
        if let Some(feeds) = better {
            // flights that the first seed has not seen
            let again = again(&judged, feeds, &plan, runs, request.seed.wrapping_add(1)).map_err(named)?;
            judged.document.optimized.iter_mut().for_each(|optimized| optimized.flights.clone_from(&again));
        }
        let wanted = needed(&judged.raw, duration).map_err(named)?;
        note(&format!(
            "{runs} flights of {} s know every rms to some {} %; {wanted} know them to 1 %",
            digits(duration),
            significant((wanted as f64 / runs as f64).sqrt(), 2)
        ));
        let mut flown = flown(&judged, &plan, runs, request.seed).map_err(named)?;
        judged.document.paired = std::mem::take(&mut flown.paired);
        judged.document.flights = Some(flown);
    }
    let mut drawn = Drawn::NONE;
    if figures {
        drawn.corners = corners(&judged.setting, &judged.truth).map_err(named)?;
        // a loop that is judged has its page, whether it can be flown for so long or not
        drawn.flight = plan().map(|plan| one(&judged, &plan, request.seed)).map_err(|e| LoopError(format!("{e:#}")));
    }
    Ok(Done { judged, drawn })
}

/// A flight with the gains that its rule gives.
pub(super) fn flight(path: &Path) -> anyhow::Result<FlightDocument> {
    let document = FlightDocument::read(path)?;
    resolved(document, folder(path)).map_err(|e| anyhow::anyhow!("{}: {e}", path.display()))
}

/// Where the paths in a document are taken from.
fn folder(path: &Path) -> &Path {
    path.parent().unwrap_or(Path::new("."))
}
