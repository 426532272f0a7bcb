//! Runs side by side: eight at a time go through the same gains, so that one instruction serves several runs.
//!
//! Lanes never mix: the numbers of a run do not depend on which runs are beside it.

use nalgebra::DMatrix;

use crate::model::LinearModel;
use crate::numerics::linalg::cholesky_semidefinite;

/// Runs side by side.
pub(super) const LANES: usize = 8;
/// One number of each run.
pub(super) type Lane = [f64; LANES];

/// Lanes in memory that starts at a cache line, so that a register of a whole lane never crosses two.
#[derive(Clone, Debug)]
pub(super) struct Aligned {
    numbers: Vec<f64>,
    /// Numbers before the first lane.
    offset: usize,
    length: usize,
}

impl Aligned {
    /// Room for so many lanes; empty.
    pub(super) fn new(capacity: usize) -> Aligned {
        let numbers = vec![0.0; (capacity + 1) * LANES];
        // where a platform cannot say, lanes are right but slower
        let offset = numbers.as_ptr().align_offset(size_of::<Lane>());
        Aligned { numbers, offset: if offset < LANES { offset } else { 0 }, length: 0 }
    }
    /// As many lanes, zero.
    pub(super) fn zeros(count: usize) -> Aligned {
        let mut lanes = Aligned::new(count);
        lanes.grow(count);
        lanes
    }
    pub(super) fn len(&self) -> usize {
        self.length
    }
    #[inline(always)]
    pub(super) fn lanes(&self) -> &[Lane] {
        &self.numbers[self.offset..].as_chunks().0[..self.length]
    }
    #[inline(always)]
    pub(super) fn lanes_mut(&mut self) -> &mut [Lane] {
        &mut self.numbers[self.offset..].as_chunks_mut().0[..self.length]
    }
    /// So many lanes more, zero; beyond the capacity there are none.
    #[inline(always)]
    pub(super) fn grow(&mut self, count: usize) {
        let from = self.length;
        self.length = (from + count).min(self.numbers.len() / LANES - 1);
        self.lanes_mut()[from..].fill([0.0; LANES]);
    }
    #[inline(always)]
    pub(super) fn push(&mut self, lane: Lane) {
        self.grow(1);
        if let Some(last) = self.lanes_mut().last_mut() {
            *last = lane;
        }
    }
    pub(super) fn clear(&mut self) {
        self.length = 0;
    }
    #[inline(always)]
    pub(super) fn keep_last(&mut self, count: usize) {
        let from = self.length - count;
        self.lanes_mut().copy_within(from.., 0);
        self.length = count;
    }
}

/// Steps whose random numbers are drawn at once.
pub(super) const CHUNK: usize = 256;

/// Entries of a matrix that are not zero in some lane: (row, column, values).
pub(super) type Entries<T> = Vec<(usize, usize, T)>;

/// The truth as the inner loop wants it, one model per lane.
#[derive(Clone, Debug)]
pub(super) struct Truth {
    pub(super) x0: Vec<Lane>,
    pub(super) f: Transition<Lane>,
    pub(super) h: Vec<Vec<Lane>>,
    /// Columns of the roots of P0 and Q: (row, value).
    pub(super) start: Vec<Vec<(usize, Lane)>>,
    pub(super) process: Vec<Vec<(usize, Lane)>>,
    pub(super) root_r: Vec<Lane>,
}

/// x ← F x.
#[derive(Clone, Debug)]
pub(super) struct Transition<T> {
    /// Set when F is diagonal.
    pub(super) diagonal: Vec<T>,
    pub(super) entries: Entries<T>,
}

impl Truth {
    pub(super) fn of_one(model: &LinearModel) -> Truth {
        Truth::of([model; LANES])
    }

    /// The models must be of the same shape.
    pub(super) fn of(models: [&LinearModel; LANES]) -> Truth {
        let n = models[0].x0.len();
        // P0 and Q were checked when the course was made; a root that cannot be taken is that of no noise
        let root = |m: &DMatrix<f64>| cholesky_semidefinite(m).unwrap_or_else(|_| DMatrix::zeros(n, n));
        let (f, h) = (models.map(|m| &m.f), models.map(|m| &m.h));
        let start: [DMatrix<f64>; LANES] = models.map(|m| root(&m.p0));
        let process: [DMatrix<f64>; LANES] = models.map(|m| root(&m.q));
        Truth {
            x0: (0..n).map(|i| models.map(|m| m.x0[i])).collect(),
            f: Transition::new(n, entries(f)),
            h: (0..h[0].nrows()).map(|row| (0..n).map(|j| h.map(|h| h[(row, j)])).collect()).collect(),
            start: columns(n, &entries(start.each_ref())),
            process: columns(n, &entries(process.each_ref())),
            root_r: (0..h[0].nrows()).map(|i| models.map(|m| m.r[(i, i)].sqrt())).collect(),
        }
    }
}

pub(super) fn entries(matrices: [&DMatrix<f64>; LANES]) -> Entries<Lane> {
    let (rows, columns) = matrices[0].shape();
    let all = (0..rows).flat_map(|i| (0..columns).map(move |j| (i, j)));
    all.map(|(i, j)| (i, j, matrices.map(|m| m[(i, j)]))).filter(|(_, _, v)| *v != [0.0; LANES]).collect()
}

/// Columns that are not zero, in order.
fn columns(n: usize, entries: &Entries<Lane>) -> Vec<Vec<(usize, Lane)>> {
    let column = |j: usize| entries.iter().filter(move |e| e.1 == j).map(|&(i, _, v)| (i, v)).collect();
    (0..n).map(column).filter(|c: &Vec<(usize, Lane)>| !c.is_empty()).collect()
}

impl<T: Copy> Transition<T> {
    pub(super) fn new(n: usize, entries: Entries<T>) -> Transition<T> {
        let diagonal = entries.len() == n && entries.iter().all(|(i, j, _)| i == j);
        Transition { diagonal: if diagonal { entries.iter().map(|e| e.2).collect() } else { Vec::new() }, entries }
    }
}
