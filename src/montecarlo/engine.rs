//! The runs: truth and filter side by side, gains computed once, sums added in the order of the runs.

use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;

use super::{MonteCarloError, Plan};
use crate::consistency::low_frequency::{block_lengths, time_constants};
use crate::filter::{AxisDesign, Kalman};
use crate::model::LinearModel;
use crate::numerics::linalg::{LinalgError, cholesky, cholesky_semidefinite};
use crate::numerics::random::{StreamId, fill_normal, stream};

/// Runs whose sums are kept before they are added: bounds the memory for any number of runs.
const BATCH: u64 = 256;
/// Normal numbers drawn at a time.
const CHUNK: usize = 4096;
/// Stream number of a verification run; simulated terms use small numbers.
const VERIFY_TERM: u32 = 1_000_000;

/// Part of a run at which the errors are judged: the first measurement, then these shares of the run.
const EPOCHS: [f64; 4] = [0.001, 0.03, 0.3, 1.0];

/// Everything about one axis that does not depend on the random numbers.
#[derive(Clone, Debug)]
pub(super) struct Axis {
    filter: Matrices,
    truth: Matrices,
    /// Roots of P0 and Q of the truth.
    start: Root,
    process: Root,
    /// K of every step, n numbers each.
    gains: Vec<f64>,
    /// 1/√S of every step.
    weight: Vec<f64>,
    pub(super) epochs: Vec<EpochPlan>,
    /// Samples per block of the low-frequency test.
    pub(super) block: u64,
    pub(super) dt: f64,
}

/// A time at which errors are judged.
#[derive(Clone, Debug)]
pub(super) struct EpochPlan {
    pub(super) step: u64,
    /// The error is that of every state; else that of the whole drift.
    all_states: bool,
    /// L⁻¹ of the error's covariance L Lᵀ: error to independent N(0, 1).
    whiten: DMatrix<f64>,
}

impl EpochPlan {
    /// Number of components of the error.
    pub(super) fn size(&self) -> usize {
        self.whiten.nrows()
    }
}

/// The numbers of a model as the inner loop wants them.
#[derive(Clone, Debug)]
struct Matrices {
    n: usize,
    /// Entries of F that are not zero: (row, column, value). Most models are nearly diagonal.
    f: Vec<(usize, usize, f64)>,
    h: Vec<f64>,
    x0: Vec<f64>,
    root_r: f64,
}

impl Matrices {
    fn new(model: &LinearModel) -> Matrices {
        let n = model.x0.len();
        let entries = (0..n).flat_map(|i| (0..n).map(move |j| (i, j))).map(|(i, j)| (i, j, model.f[(i, j)]));
        Matrices {
            n,
            f: entries.filter(|entry| entry.2 != 0.0).collect(),
            h: model.h.row(0).iter().copied().collect(),
            x0: model.x0.as_slice().to_vec(),
            root_r: model.r[(0, 0)].sqrt(),
        }
    }
    fn measure(&self, x: &[f64]) -> f64 {
        self.h.iter().zip(x).map(|(h, x)| h * x).sum()
    }
    /// x ← F x.
    fn advance(&self, x: &mut [f64], scratch: &mut [f64]) {
        scratch.fill(0.0);
        for &(i, j, f) in &self.f {
            scratch[i] += f * x[j];
        }
        x.copy_from_slice(scratch);
    }
}

/// What is added up over runs.
#[derive(Clone, Debug)]
pub(super) struct Sums {
    /// Per epoch: Σ NEES, and Σ of the whitened error per component.
    pub(super) nees: Vec<f64>,
    pub(super) error: Vec<DVector<f64>>,
    /// Σ y², Σ y_k y_(k+1), of normalised innovations y.
    pub(super) nis: f64,
    pub(super) neighbours: f64,
    /// Σ (sum of a block)²/length, and number of blocks.
    pub(super) low_frequency: f64,
    pub(super) blocks: u64,
}

impl Sums {
    fn new(axis: &Axis) -> Sums {
        Sums {
            nees: vec![0.0; axis.epochs.len()],
            error: axis.epochs.iter().map(|e| DVector::zeros(e.size())).collect(),
            nis: 0.0,
            neighbours: 0.0,
            low_frequency: 0.0,
            blocks: 0,
        }
    }
    fn add(&mut self, other: &Sums) {
        for (sum, value) in self.nees.iter_mut().zip(&other.nees) {
            *sum += value;
        }
        for (sum, value) in self.error.iter_mut().zip(&other.error) {
            *sum += value;
        }
        self.nis += other.nis;
        self.neighbours += other.neighbours;
        self.low_frequency += other.low_frequency;
        self.blocks += other.blocks;
    }
}

impl Axis {
    pub(super) fn new(design: &AxisDesign, truth: &LinearModel, plan: &Plan) -> Result<Axis, MonteCarloError> {
        let model = &design.model;
        for model in [model, truth] {
            if model.measurements.len() != 1 || model.every != [1] {
                let count = model.measurements.len();
                return Err(MonteCarloError::Measurements { axis: design.name.clone(), count });
            }
        }
        let failed = |what, source| MonteCarloError::Truth { axis: design.name.clone(), what, source };
        let same_states = model.states == truth.states && model.h == truth.h;
        let mut filter = Kalman::new(model);
        let steps = plan.steps as usize;
        let wanted: Vec<u64> = epoch_steps(plan.steps);
        let mut axis = Axis {
            filter: Matrices::new(model),
            truth: Matrices::new(truth),
            start: Root::new(&cholesky_semidefinite(&truth.p0).map_err(|e| failed("P0", e))?),
            process: Root::new(&cholesky_semidefinite(&truth.q).map_err(|e| failed("Q", e))?),
            gains: Vec::with_capacity(steps * model.x0.len()),
            weight: Vec::with_capacity(steps),
            epochs: Vec::with_capacity(wanted.len()),
            block: block_length(&design.steady_state.poles, plan.steps),
            dt: model.dt,
        };
        for step in 0..plan.steps {
            if step > 0 {
                filter.predict();
            }
            let update = filter.update(0, 0.0, None);
            axis.weight.push(1.0 / update.variance.sqrt());
            // K = P(k|k) hᵀ / r, the same as P(k|k−1) hᵀ / S
            axis.gains.extend((&filter.p * model.h.transpose() / model.r[(0, 0)]).iter());
            if wanted.contains(&step) {
                // states that are known exactly have no NEES; the whole drift always has one
                let all = if same_states { whitening(&filter.p).ok() } else { None };
                let all_states = all.is_some();
                let whiten = match all {
                    Some(whiten) => whiten,
                    None => {
                        whitening(&(&model.h * &filter.p * model.h.transpose())).map_err(|e| failed("P(k|k)", e))?
                    }
                };
                axis.epochs.push(EpochPlan { step, all_states, whiten });
            }
        }
        Ok(axis)
    }

    /// One run of the axis.
    fn simulate(&self, run: u64, axis_number: u32, plan: &Plan) -> Sums {
        let mut sums = Sums::new(self);
        let mut normal = Normals::new(plan.seed, run, axis_number);
        let (n, m) = (self.filter.n, self.truth.n);
        let mut truth = self.truth.x0.clone();
        normal.add(&self.start, &mut truth);
        let mut x = self.filter.x0.clone();
        let (mut scratch, mut scratch_truth) = (vec![0.0; n], vec![0.0; m]);
        let (mut previous, mut block, mut filled) = (0.0, 0.0, 0);
        let mut epochs = self.epochs.iter().enumerate().peekable();
        for (step, (gain, weight)) in self.gains.chunks_exact(n).zip(&self.weight).enumerate() {
            if step > 0 {
                self.truth.advance(&mut truth, &mut scratch_truth);
                normal.add(&self.process, &mut truth);
                self.filter.advance(&mut x, &mut scratch);
            }
            let z = self.truth.measure(&truth) + self.truth.root_r * normal.next();
            let innovation = z - self.filter.measure(&x);
            for (x, k) in x.iter_mut().zip(gain) {
                *x += k * innovation;
            }
            let y = innovation * weight;
            sums.nis += y * y;
            sums.neighbours += y * previous;
            previous = y;
            block += y;
            filled += 1;
            if filled == self.block {
                sums.low_frequency += block * block / self.block as f64;
                sums.blocks += 1;
                (block, filled) = (0.0, 0);
            }
            if let Some((i, epoch)) = epochs.next_if(|(_, epoch)| epoch.step == step as u64) {
                let error = if epoch.all_states {
                    DVector::from_fn(n, |i, _| truth[i] - x[i])
                } else {
                    DVector::from_element(1, self.truth.measure(&truth) - self.filter.measure(&x))
                };
                let error = &epoch.whiten * error;
                sums.nees[i] = error.norm_squared();
                sums.error[i] = error;
            }
        }
        sums
    }
}

/// All runs; the sums are added in the order of the runs, whatever thread made them.
pub(super) fn run(axis: &Axis, axis_number: u32, plan: &Plan, progress: &(dyn Fn(u64) + Sync)) -> Sums {
    let mut total = Sums::new(axis);
    let mut first = 0;
    while first < plan.runs {
        let last = (first + BATCH).min(plan.runs);
        let batch: Vec<Sums> = (first..last)
            .into_par_iter()
            .map(|run| {
                let sums = axis.simulate(run, axis_number, plan);
                progress(1);
                sums
            })
            .collect();
        for sums in &batch {
            total.add(sums);
        }
        first = last;
    }
    total
}

/// Independent standard normal numbers of one run.
struct Normals {
    rng: rand::rngs::ChaCha8Rng,
    buffer: Vec<f64>,
    at: usize,
}

impl Normals {
    fn new(seed: u64, run: u64, axis: u32) -> Normals {
        let rng = stream(seed, StreamId { run, axis, term: VERIFY_TERM });
        Normals { rng, buffer: vec![0.0; CHUNK], at: CHUNK }
    }
    fn next(&mut self) -> f64 {
        if self.at == CHUNK {
            fill_normal(&mut self.rng, &mut self.buffer);
            self.at = 0;
        }
        self.at += 1;
        self.buffer[self.at - 1]
    }
    /// x ← x + L n.
    fn add(&mut self, root: &Root, x: &mut [f64]) {
        for column in &root.columns {
            let normal = self.next();
            for &(i, l) in column {
                x[i] += l * normal;
            }
        }
    }
}

/// A lower factor L as its columns that are not zero: (row, value).
#[derive(Clone, Debug)]
struct Root {
    columns: Vec<Vec<(usize, f64)>>,
}

impl Root {
    fn new(l: &DMatrix<f64>) -> Root {
        let column = |j: usize| l.column(j).iter().copied().enumerate().filter(|(_, v)| *v != 0.0).collect();
        let columns: Vec<Vec<(usize, f64)>> = (0..l.ncols()).map(column).collect();
        Root { columns: columns.into_iter().filter(|c| !c.is_empty()).collect() }
    }
}

/// L⁻¹ of a covariance L Lᵀ.
fn whitening(covariance: &DMatrix<f64>) -> Result<DMatrix<f64>, LinalgError> {
    let l = cholesky(covariance)?;
    let identity = DMatrix::identity(l.nrows(), l.nrows());
    l.solve_lower_triangular(&identity).ok_or(LinalgError::Singular)
}

fn epoch_steps(steps: u64) -> Vec<u64> {
    let last = steps - 1;
    let mut wanted = vec![0];
    wanted.extend(EPOCHS.iter().map(|share| (last as f64 * share).round() as u64));
    wanted.dedup();
    wanted
}

/// The longest block length of the replay's low-frequency test that still gives 30 blocks per run, at least 2 samples.
fn block_length(poles: &[(f64, f64)], steps: u64) -> u64 {
    let lengths = block_lengths(&time_constants(poles));
    lengths.into_iter().filter(|length| length * 30 <= steps).max().unwrap_or(2)
}
