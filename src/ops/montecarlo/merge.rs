//! One verdict from documents of runs.

use std::path::PathBuf;

use anyhow::{Context, bail};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::{Judging, Simulated};
use crate::montecarlo::document::{Shard, in_order};

/// Documents of one experiment.
#[derive(Clone, Debug, clap::Args, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Request {
    /// Documents in any order
    #[arg(required = true)]
    pub shards: Vec<PathBuf>,
    /// The document: verdict, curves and sums
    #[arg(short, long, value_name = "FILE")]
    #[serde(default)]
    pub output: Option<PathBuf>,
    #[command(flatten)]
    #[serde(default)]
    pub judging: Judging,
}

/// Their runs, not judged yet.
pub fn run(request: &Request) -> anyhow::Result<Simulated> {
    request.judging.check()?;
    let shards = request.shards.iter().map(|path| Shard::read(path)).collect::<Result<Vec<_>, _>>()?;
    let shards = in_order(shards)?;
    let (Some(first), Some(last)) = (shards.first(), shards.last()) else { bail!("nothing to merge") };
    let experiment = first.experiment.clone();
    let course = experiment.course().with_context(|| first.path.clone())?;
    let runs = first.runs.first..last.runs.end;
    let mut totals = first.totals(&course)?;
    for shard in &shards[1..] {
        totals.iter_mut().zip(shard.totals(&course)?).for_each(|(sum, more)| sum.merge(&more));
    }
    let names: Vec<&str> = shards.iter().map(|shard| shard.path.as_str()).collect();
    let sources = vec![("merged from".to_string(), names.join(", "))];
    Ok(Simulated { experiment, course, totals, runs, sources, output: request.output.clone(), threads: None })
}
