//! A linear system and what it does at a frequency.

use nalgebra::{Complex, DMatrix};

use crate::numerics::linalg::eigenvalues;

/// ẋ = A x + B u, or x⁺ = A x + B u every `interval` seconds; y = C x + D u. A n×n, B n×m, C p×n, D p×m.
#[derive(Clone, Debug, PartialEq)]
pub struct StateSpace {
    pub a: DMatrix<f64>,
    pub b: DMatrix<f64>,
    pub c: DMatrix<f64>,
    pub d: DMatrix<f64>,
    /// s; a continuous system has none.
    pub interval: Option<f64>,
}

impl StateSpace {
    /// Gains without a state, D.
    pub fn gain(d: DMatrix<f64>, interval: Option<f64>) -> StateSpace {
        let (p, m) = d.shape();
        StateSpace { a: DMatrix::zeros(0, 0), b: DMatrix::zeros(0, m), c: DMatrix::zeros(p, 0), d, interval }
    }

    pub fn states(&self) -> usize {
        self.a.nrows()
    }

    pub fn inputs(&self) -> usize {
        self.b.ncols()
    }

    /// `next` behind this: next(self(u)), states of this first.
    #[must_use]
    pub fn then(&self, next: &StateSpace) -> StateSpace {
        let (n, k) = (self.states(), next.states());
        let mut a = DMatrix::zeros(n + k, n + k);
        a.view_mut((0, 0), (n, n)).copy_from(&self.a);
        a.view_mut((n, 0), (k, n)).copy_from(&(&next.b * &self.c));
        a.view_mut((n, n), (k, k)).copy_from(&next.a);
        let mut b = DMatrix::zeros(n + k, self.inputs());
        b.view_mut((0, 0), (n, self.inputs())).copy_from(&self.b);
        b.view_mut((n, 0), (k, self.inputs())).copy_from(&(&next.b * &self.d));
        let mut c = DMatrix::zeros(next.c.nrows(), n + k);
        c.view_mut((0, 0), (next.c.nrows(), n)).copy_from(&(&next.d * &self.c));
        c.view_mut((0, n), (next.c.nrows(), k)).copy_from(&next.c);
        StateSpace { a, b, c, d: &next.d * &self.d, interval: self.interval }
    }

    /// Both side by side: inputs and outputs of this, then those of `other`.
    #[must_use]
    pub fn beside(&self, other: &StateSpace) -> StateSpace {
        StateSpace {
            a: diagonal(&[&self.a, &other.a]),
            b: diagonal(&[&self.b, &other.b]),
            c: diagonal(&[&self.c, &other.c]),
            d: diagonal(&[&self.d, &other.d]),
            interval: self.interval,
        }
    }

    /// With output fed back to input by `gain` (m × p): A + B K (I − D K)⁻¹ C. `None` where that inverse does not
    /// exist.
    pub fn closed(&self, gain: &DMatrix<f64>) -> Option<DMatrix<f64>> {
        let p = self.c.nrows();
        let direct = DMatrix::<f64>::identity(p, p) - &self.d * gain;
        Some(&self.a + &self.b * gain * direct.lu().solve(&self.c)?)
    }

    /// Poles in 1/s, of a discrete system ln(z)/interval; a pole at z = 0 is left out.
    pub fn poles(&self) -> Vec<(f64, f64)> {
        in_time(&eigenvalues(&self.a), self.interval)
    }

    /// What the frequency response is taken from: C, and A, B on the Hessenberg form of A, which makes each frequency
    /// n² work instead of n³ (Laub 1981, IEEE Trans. Automatic Control 26).
    pub fn response(&self) -> Response {
        if self.a.is_empty() {
            return Response {
                h: self.a.clone(),
                b: self.b.clone(),
                c: self.c.clone(),
                d: self.d.clone(),
                ..Response::of(self)
            };
        }
        let (q, h) = self.a.clone().hessenberg().unpack();
        Response { h, b: q.transpose() * &self.b, c: &self.c * &q, d: self.d.clone(), ..Response::of(self) }
    }
}

/// Discrete poles as continuous ones.
pub fn in_time(poles: &[(f64, f64)], interval: Option<f64>) -> Vec<(f64, f64)> {
    let Some(interval) = interval else { return poles.to_vec() };
    let one = |(re, im): &(f64, f64)| {
        let modulus = re.hypot(*im);
        // a pole that forgets within a step has no time constant
        (modulus > 1e-12).then(|| (modulus.ln() / interval, im.atan2(*re) / interval))
    };
    poles.iter().filter_map(one).collect()
}

/// A block diagonal matrix.
pub fn diagonal(blocks: &[&DMatrix<f64>]) -> DMatrix<f64> {
    let rows = blocks.iter().map(|b| b.nrows()).sum();
    let columns = blocks.iter().map(|b| b.ncols()).sum();
    let mut out = DMatrix::zeros(rows, columns);
    let (mut row, mut column) = (0, 0);
    for block in blocks {
        out.view_mut((row, column), block.shape()).copy_from(block);
        (row, column) = (row + block.nrows(), column + block.ncols());
    }
    out
}

/// A system ready to be asked for its response.
#[derive(Clone, Debug)]
pub struct Response {
    h: DMatrix<f64>,
    b: DMatrix<f64>,
    c: DMatrix<f64>,
    d: DMatrix<f64>,
    interval: Option<f64>,
}

impl Response {
    fn of(system: &StateSpace) -> Response {
        let empty = DMatrix::zeros(0, 0);
        Response { h: empty.clone(), b: empty.clone(), c: empty.clone(), d: empty, interval: system.interval }
    }

    /// C (λI − A)⁻¹ B + D at λ = jω or e^(jω·interval), ω in rad/s.
    pub fn at(&self, omega: f64) -> DMatrix<Complex<f64>> {
        let point = match self.interval {
            None => Complex::new(0.0, omega),
            Some(interval) => Complex::new(0.0, omega * interval).exp(),
        };
        let (n, m) = self.b.shape();
        let mut h = DMatrix::from_fn(n, n, |i, j| {
            let own = if i == j { point } else { Complex::ZERO };
            own - Complex::new(self.h[(i, j)], 0.0)
        });
        let mut x = self.b.map(|v| Complex::new(v, 0.0));
        // elimination of the one entry below each pivot, the larger of both rows first
        for k in 0..n.saturating_sub(1) {
            if h[(k + 1, k)].norm_sqr() > h[(k, k)].norm_sqr() {
                h.swap_rows(k, k + 1);
                x.swap_rows(k, k + 1);
            }
            if h[(k, k)] == Complex::ZERO {
                continue;
            }
            let factor = h[(k + 1, k)] / h[(k, k)];
            if factor != Complex::ZERO {
                for j in k..n {
                    let above = h[(k, j)];
                    h[(k + 1, j)] -= factor * above;
                }
                for j in 0..m {
                    let above = x[(k, j)];
                    x[(k + 1, j)] -= factor * above;
                }
            }
        }
        for k in (0..n).rev() {
            for j in 0..m {
                let known: Complex<f64> = (k + 1..n).map(|i| h[(k, i)] * x[(i, j)]).sum();
                x[(k, j)] = (x[(k, j)] - known) / h[(k, k)];
            }
        }
        DMatrix::from_fn(self.c.nrows(), m, |i, j| {
            (0..n).map(|k| x[(k, j)] * self.c[(i, k)]).sum::<Complex<f64>>() + self.d[(i, j)]
        })
    }
}
