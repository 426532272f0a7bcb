//! A straight line through any number of points, in blocks.

const BLOCK: usize = 64;

/// Least squares of time over row number: sums about the means of blocks of 64 points, joined by the formula of
/// Chan, Golub and LeVeque (1979). How the points come, one by one or many at once, makes no difference.
#[derive(Clone, Debug, Default)]
pub(super) struct Line {
    count: f64,
    mean_row: f64,
    mean_time: f64,
    rows_rows: f64,
    rows_time: f64,
    /// The beginning of a block.
    rows: Vec<f64>,
    times: Vec<f64>,
}

impl Line {
    /// Times of consecutive rows.
    #[inline(always)]
    pub(super) fn add(&mut self, first: u64, times: &[f64]) {
        let mut row = first as f64;
        let mut left = times;
        while !left.is_empty() {
            let (part, rest) = left.split_at(left.len().min(BLOCK - self.times.len()));
            self.times.extend_from_slice(part);
            self.rows.extend((0..part.len()).map(|i| row + i as f64));
            if self.times.len() == BLOCK {
                self.close();
            }
            row += part.len() as f64;
            left = rest;
        }
    }

    #[inline(always)]
    fn close(&mut self) {
        let count = self.times.len() as f64;
        if count == 0.0 {
            return;
        }
        let mean = |x: &[f64]| by_eight(x, x, |v, _| v) / count;
        let (row, time) = (mean(&self.rows), mean(&self.times));
        let rows_rows = by_eight(&self.rows, &self.rows, |r, _| (r - row) * (r - row));
        let rows_time = by_eight(&self.rows, &self.times, |r, t| (r - row) * (t - time));
        let (from_row, from_time) = (row - self.mean_row, time - self.mean_time);
        let total = self.count + count;
        let weight = self.count * count / total;
        self.mean_row += from_row * count / total;
        self.mean_time += from_time * count / total;
        self.rows_rows += rows_rows + from_row * from_row * weight;
        self.rows_time += rows_time + from_row * from_time * weight;
        self.count = total;
        self.rows.clear();
        self.times.clear();
    }

    /// Time per row.
    pub(super) fn slope(&self) -> f64 {
        let mut whole = self.clone();
        whole.close();
        whole.rows_time / whole.rows_rows
    }
}

/// Sum of a term of each pair, in eight partial sums.
#[inline(always)]
fn by_eight(x: &[f64], y: &[f64], term: impl Fn(f64, f64) -> f64) -> f64 {
    let ((chunks, rest), (others, other_rest)) = (x.as_chunks::<8>(), y.as_chunks::<8>());
    let mut sums = [0.0; 8];
    for (x, y) in chunks.iter().zip(others) {
        for i in 0..8 {
            sums[i] += term(x[i], y[i]);
        }
    }
    for (sum, (x, y)) in sums.iter_mut().zip(rest.iter().zip(other_rest)) {
        *sum += term(*x, *y);
    }
    let [a, b, c, d, e, f, g, h] = sums;
    ((a + b) + (c + d)) + ((e + f) + (g + h))
}
