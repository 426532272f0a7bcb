//! Measurements at several rates: after how many samples their pattern repeats, and what one such period does to a
//! covariance.

use nalgebra::DMatrix;

use crate::model::LinearModel;
use crate::numerics::linalg::LinalgError;
use crate::numerics::riccati::Flow;

/// Longer periods are refused: every sample of one is gone through.
pub const LONGEST_PERIOD: u64 = 1_000_000;

/// The pattern of measurements of a model, from a sample at which all are taken.
#[derive(Clone, Debug, PartialEq)]
pub struct Cycle {
    /// Samples; the least common multiple of `every`.
    pub period: u64,
    every: Vec<u64>,
}

/// Consecutive samples at which the same measurements are taken.
struct Run {
    taken: Vec<usize>,
    steps: u64,
}

impl Cycle {
    /// `None` when the pattern repeats only after more than a million samples.
    pub fn new(every: &[usize]) -> Option<Cycle> {
        let every: Vec<u64> = every.iter().map(|&e| e.max(1) as u64).collect();
        let mut period: u64 = 1;
        for e in &every {
            period = (period / greatest_common_divisor(period, *e)).checked_mul(*e)?;
        }
        (period <= LONGEST_PERIOD).then_some(Cycle { period, every })
    }

    /// Measurements taken at a sample.
    pub fn taken(&self, step: u64) -> Vec<usize> {
        (0..self.every.len()).filter(|&i| step.is_multiple_of(self.every[i])).collect()
    }

    /// The first `steps` samples of a period, each its measurements and then a prediction: P(0|−1) to P(steps|steps−1).
    pub fn flow(
        &self,
        f: &DMatrix<f64>,
        h: &DMatrix<f64>,
        q: &DMatrix<f64>,
        r: &DMatrix<f64>,
        steps: u64,
    ) -> Result<Flow, LinalgError> {
        let mut known: Vec<(Run, Flow)> = Vec::new();
        let mut result = Flow::none(f.nrows());
        for run in self.runs(steps) {
            let same = known.iter().find(|(other, _)| other.taken == run.taken && other.steps == run.steps);
            if let Some((_, flow)) = same {
                result = result.then(flow)?;
                continue;
            }
            let one = if run.taken.is_empty() {
                Flow::prediction(f, q)?
            } else {
                let r = r.select_rows(&run.taken).select_columns(&run.taken);
                Flow::one_step(f, &h.select_rows(&run.taken), q, &r)?
            };
            let flow = one.times(run.steps)?;
            result = result.then(&flow)?;
            known.push((run, flow));
        }
        Ok(result)
    }

    /// [`flow`](Cycle::flow) of a whole model.
    pub fn flow_of(&self, model: &LinearModel, steps: u64) -> Result<Flow, LinalgError> {
        self.flow(&model.f, &model.h, &model.q, &model.r, steps)
    }

    fn runs(&self, steps: u64) -> Vec<Run> {
        let mut runs: Vec<Run> = Vec::new();
        let mut step = 0;
        while step < steps {
            let taken = self.taken(step);
            // to the next sample at which something else is taken
            let after = |e: &u64| (step / e + 1) * e;
            let next = if taken.is_empty() { self.every.iter().map(after).min().unwrap_or(steps) } else { step + 1 };
            let length = next.min(steps) - step;
            match runs.last_mut().filter(|last| last.taken == taken) {
                Some(last) => last.steps += length,
                None => runs.push(Run { taken, steps: length }),
            }
            step += length;
        }
        runs
    }
}

fn greatest_common_divisor(a: u64, b: u64) -> u64 {
    if b == 0 { a } else { greatest_common_divisor(b, a % b) }
}
