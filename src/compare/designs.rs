//! Designs of the same sensor ranked on logs: by the likelihood of what comes last in each log, with verdicts and
//! what they claim.

use schemars::JsonSchema;
use serde::Serialize;

use crate::consistency::Verdict;
use crate::filter::{AxisDesign, FilterDesign};
use crate::input::Block;
use crate::replay::{Estimates, LogShape, Options, ReplayError, Replayer};
use crate::units::digits;

/// Parts of the held-out rows by which the uncertainty of a difference is told.
const PARTS: usize = 50;
/// A design is clearly behind when so many standard deviations are.
const CLEARLY: f64 = 3.0;

#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum RankError {
    #[error(transparent)]
    Replay(#[from] ReplayError),
    #[error(
        "{design} measures {found}, {first} measures {expected}; only designs that measure the same can be ranked by \
         likelihood"
    )]
    Measurements { design: String, found: String, first: String, expected: String },
}

/// What `tune --rank` prints.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
pub struct Ranking {
    /// "kfdesign-ranking/1".
    pub format: String,
    /// Last share of each log that counts for the likelihood.
    pub held_out: f64,
    pub logs: Vec<String>,
    /// The best first.
    pub designs: Vec<RankedDesign>,
    /// What it means.
    pub meaning: String,
}

#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
pub struct RankedDesign {
    pub design: String,
    /// From its record of the tuning.
    pub objective: Option<String>,
    /// ln L of the held-out rows of all logs given those before, SI.
    pub held_out_log_likelihood: f64,
    /// Measurements that count.
    pub measurements: u64,
    /// ln L of the best less its own, and the standard deviation of that.
    pub behind: f64,
    pub behind_std_dev: f64,
    /// Of the whole log, in the order of the logs.
    pub verdicts: Vec<Verdict>,
    pub steady: Vec<SteadySigma>,
}

/// Claimed sigma of the whole drift after a long time, SI.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
pub struct SteadySigma {
    pub axis: String,
    pub sigma: f64,
}

/// Designs on their way through logs.
#[derive(Debug)]
pub struct Contest {
    designs: Vec<(String, FilterDesign)>,
    held_out: f64,
    logs: Vec<String>,
    /// By design.
    sums: Vec<Sums>,
}

#[derive(Clone, Debug, Default)]
struct Sums {
    /// ln L of each part of the held-out rows of every log.
    parts: Vec<f64>,
    measurements: u64,
    verdicts: Vec<Verdict>,
}

impl Contest {
    /// `held_out`: share of each log, above 0. Errors: designs of different axes or measurements.
    pub fn new(designs: Vec<(String, FilterDesign)>, held_out: f64) -> Result<Contest, RankError> {
        let measured = |design: &FilterDesign| -> String {
            let of = |axis: &AxisDesign| {
                let names = axis.model.measurements.iter().map(|m| m.name.as_str()).collect::<Vec<_>>().join(" and ");
                format!("{names} of {}", axis.name)
            };
            design.axes.iter().map(of).collect::<Vec<_>>().join(", ")
        };
        if let Some((first, one)) = designs.first() {
            for (name, design) in &designs {
                let (found, expected) = (measured(design), measured(one));
                if found != expected {
                    let (design, first) = (name.clone(), first.clone());
                    return Err(RankError::Measurements { design, found, first, expected });
                }
            }
        }
        let sums = vec![Sums::default(); designs.len()];
        Ok(Contest { designs, held_out, logs: Vec::new(), sums })
    }

    /// The next log of `rows` rows through every design; `next` fills a block and says false at the end.
    pub fn log<E: From<RankError>>(
        &mut self,
        name: &str,
        shape: &LogShape,
        rows: u64,
        mut next: impl FnMut(&mut Block) -> Result<bool, E>,
    ) -> Result<(), E> {
        let start = |(_, design): &(String, FilterDesign)| Replayer::new(design, shape, Options::default());
        let replayers: Result<Vec<Replayer>, ReplayError> = self.designs.iter().map(start).collect();
        let mut replayers = replayers.map_err(RankError::from)?;
        let first = ((rows as f64) * (1.0 - self.held_out)).round() as u64;
        let each = ((rows - first) as f64 / PARTS as f64).max(1.0);
        let parts_before = self.sums.first().map_or(0, |sums| sums.parts.len());
        self.sums.iter_mut().for_each(|sums| sums.parts.resize(parts_before + PARTS, 0.0));
        let (mut block, mut estimates, mut done) = (Block::default(), Estimates::default(), 0_u64);
        while next(&mut block)? {
            let length = block.time_s.len() as u64;
            for (replayer, sums) in replayers.iter_mut().zip(&mut self.sums) {
                if done + length <= first {
                    replayer.push(&block, None);
                    continue;
                }
                replayer.push(&block, Some(&mut estimates));
                for update in estimates.axes.iter().flat_map(|axis| &axis.updates) {
                    let rows = (done..).zip(update.innovation_sigma.iter().zip(&update.nis));
                    for (row, (sigma, nis)) in rows.filter(|(row, (_, nis))| *row >= first && nis.is_finite()) {
                        let part = (((row - first) as f64 / each) as usize).min(PARTS - 1);
                        sums.parts[parts_before + part] -= 0.5 * ((std::f64::consts::TAU * sigma * sigma).ln() + nis);
                        sums.measurements += 1;
                    }
                }
            }
            done += length;
        }
        for (replayer, sums) in replayers.into_iter().zip(&mut self.sums) {
            sums.verdicts.push(replayer.finish().verdict);
        }
        self.logs.push(name.to_string());
        Ok(())
    }

    pub fn conclude(self) -> Ranking {
        let total = |sums: &Sums| sums.parts.iter().sum::<f64>();
        let best = self.sums.iter().max_by(|a, b| total(a).total_cmp(&total(b))).cloned().unwrap_or_default();
        let of = |((name, design), sums): (&(String, FilterDesign), &Sums)| {
            let behind: Vec<f64> = best.parts.iter().zip(&sums.parts).map(|(best, own)| best - own).collect();
            let count = behind.len() as f64;
            let mean = behind.iter().sum::<f64>() / count;
            let variance = behind.iter().map(|b| (b - mean).powi(2)).sum::<f64>() / (count - 1.0);
            let steady = |axis: &AxisDesign| SteadySigma { axis: axis.name.clone(), sigma: steady_sigma(axis) };
            RankedDesign {
                design: name.clone(),
                objective: design.tuning.get("objective").and_then(|value| value.as_str()).map(str::to_string),
                held_out_log_likelihood: total(sums),
                measurements: sums.measurements,
                behind: mean * count,
                behind_std_dev: (variance * count).sqrt(),
                verdicts: sums.verdicts.clone(),
                steady: design.axes.iter().map(steady).collect(),
            }
        };
        let mut designs: Vec<RankedDesign> = self.designs.iter().zip(&self.sums).map(of).collect();
        designs.sort_by(|a, b| b.held_out_log_likelihood.total_cmp(&a.held_out_log_likelihood));
        Ranking {
            format: "kfdesign-ranking/1".into(),
            held_out: self.held_out,
            logs: self.logs,
            meaning: meaning(&designs),
            designs,
        }
    }
}

/// √(d P(k|k) dᵀ) at a sample at which every measurement is taken.
fn steady_sigma(axis: &AxisDesign) -> f64 {
    let (steady, d) = (&axis.steady_state, axis.model.drift_row());
    let p = &steady.predicted_covariance;
    let updated = p - &steady.gain * &axis.model.h * p;
    (&d * updated * d.transpose())[(0, 0)].max(0.0).sqrt()
}

fn meaning(designs: &[RankedDesign]) -> String {
    let [best, others @ ..] = designs else { return String::new() };
    let near: Vec<&str> =
        others.iter().filter(|d| d.behind <= CLEARLY * d.behind_std_dev).map(|d| d.design.as_str()).collect();
    let consistent = best.verdicts.iter().all(|verdict| *verdict != Verdict::Inconsistent);
    let but = if consistent { "" } else { ", but its innovations contradict it: see replay" };
    match (near.as_slice(), others) {
        ([], []) => format!("{} is alone{but}", best.design),
        ([], [second, ..]) => format!(
            "{} foretells what was held out clearly best: {} ± {} in ln L before {}{but}",
            best.design,
            digits(second.behind),
            digits(second.behind_std_dev),
            second.design
        ),
        (near, _) => format!(
            "{} foretells what was held out best, not clearly better than {}{but}",
            best.design,
            near.join(", ")
        ),
    }
}
