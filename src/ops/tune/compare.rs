//! Designs ranked on logs.

use std::path::{Path, PathBuf};

use anyhow::{Context, bail};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::plant_flags::PlantFlags;
use crate::compare::designs::{Contest, RankError, Ranking};
use crate::filter::FilterDesign;
use crate::input::InputError;
use crate::ops::checked;
use crate::ops::logs::{Logs, Opened};
use crate::ops::reading::Reading;
use crate::params::{Params, place};
use crate::tune::{TuneOptions, tune};

/// Designs and logs on which they are ranked.
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Request {
    /// filter.json, or params.json as identified; and logs.
    pub files: Vec<PathBuf>,
    /// Last share of each log that is foretold.
    pub held_out: f64,
    pub flicker_horizon: f64,
    #[serde(default)]
    pub plant: PlantFlags,
    #[serde(default)]
    pub reading: Reading,
}

/// The ranking, and the first design.
pub fn run(request: &Request) -> anyhow::Result<(Ranking, FilterDesign)> {
    let options = TuneOptions { design: None, flicker_horizon_s: request.flicker_horizon };
    let logs_of = Logs { reading: &request.reading, aids: &request.plant.columns() };
    let held_out = request.held_out;
    if !(held_out > 0.0 && held_out <= 0.9) {
        bail!("`held_out` is {held_out}; expected a share of the log above 0 and up to 0.9");
    }
    let (designs, logs): (Vec<&PathBuf>, Vec<&PathBuf>) =
        request.files.iter().partition(|path| path.extension().is_some_and(|e| e == "json"));
    if designs.is_empty() || logs.is_empty() {
        bail!(
            "`rank`: found {} designs (.json) and {} logs; expected designs and then at least one log",
            designs.len(),
            logs.len()
        );
    }
    let designs = designs.iter().map(|path| design(path, &options)).collect::<anyhow::Result<Vec<_>>>()?;
    let Some((_, first)) = designs.first().cloned() else { bail!("`rank`: no design") };
    let mut contest = Contest::new(designs, held_out)?;
    for path in logs {
        let Opened { name, mut reader, shape, .. } = logs_of.open(path, &first)?;
        let rows = reader.check().samples;
        contest
            .log(&name, &shape, rows, |block| reader.next_block(block).map_err(Failed::Input))
            .with_context(|| name.clone())?;
    }
    Ok((contest.conclude(), first))
}

#[derive(Debug, thiserror::Error)]
enum Failed {
    #[error(transparent)]
    Input(InputError),
    #[error(transparent)]
    Rank(#[from] RankError),
}

/// filter.json, or the nominal design of params.json.
fn design(path: &Path, options: &TuneOptions) -> anyhow::Result<(String, FilterDesign)> {
    let name = path.display().to_string();
    let text = std::fs::read_to_string(path).with_context(|| format!("{name}: cannot read"))?;
    let format = place::parse(&text).ok().and_then(|value| value.get("format")?.as_str().map(str::to_string));
    if format.is_some_and(|format| format.starts_with("kfdesign-params/")) {
        let params = Params::from_json(&text, &name)?;
        checked::say(path, params.failed_check().as_deref());
        let tuned = tune(&params, options).with_context(|| name.clone())?;
        return Ok((name, tuned.design));
    }
    let design = FilterDesign::from_json(&text, &name)?;
    checked::say(path, checked::recorded(&design.tuning));
    Ok((name, design))
}
