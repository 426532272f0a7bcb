//! Power-law type of the noise at one averaging time, by the lag-1 autocorrelation (Riley and Greenhall 2004).

use pulp::{Arch, Simd, WithSimd};

use super::NoiseType;
use super::squares::folded;

/// Fewer averages than this say nothing about the type (Riley 2008, NIST SP 1065, section 5.5.6).
const FEWEST_AVERAGES: usize = 30;

/// Power-law exponent α of the rate spectrum S(f) ∝ f^α (white 0, flicker −1, random walk −2, quantisation +2),
/// real-valued: with z the rate averaged over m samples without its linear trend, differenced d times until
/// `δ = r_1/(1 + r_1)` is below 1/4, `α = −2(δ + d)`.
///
/// `phase`: n + 1 points, unit·s. None with fewer than 30 averages or constant ones.
/// Source: Riley and Greenhall 2004, "Power law noise identification using the lag 1 autocorrelation".
pub fn exponent(phase: &[f64], m: usize) -> Option<f64> {
    Averages::of(phase, m)?.evidence().exponent()
}

/// The type at averaging factor `m` from `phase` (n + 1 points, unit·s).
///
/// α rounded: 0 white, −1 flicker, −2 random walk, 1 or 2 quantisation (both fall as 1/tau in the Allan deviation);
/// a ramp where the mean step between averages is larger than their scatter. Unknown with fewer than 30 averages,
/// constant ones, and beyond α = −2.
pub fn identify(phase: &[f64], m: usize) -> NoiseType {
    Evidence::of(phase, m).kind()
}

/// What one log or several say about the type: the sums behind the autocorrelation, of averages without the trend of
/// their own log.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Evidence {
    /// Sums of squares of the averages, and of their first and second differences, all without their means.
    squares: [f64; 1 + MOST_DIFFERENCES],
    /// Sums of products of neighbours.
    products: [f64; 1 + MOST_DIFFERENCES],
    /// Steps between averages, times their mean squared.
    ramp: f64,
}

impl Evidence {
    /// None (all zero) with fewer than 30 averages.
    pub(super) fn of(phase: &[f64], m: usize) -> Evidence {
        Averages::of(phase, m).map(|averages| averages.evidence()).unwrap_or_default()
    }

    pub(super) fn add(&mut self, other: &Evidence) {
        for d in 0..=MOST_DIFFERENCES {
            self.squares[d] += other.squares[d];
            self.products[d] += other.products[d];
        }
        self.ramp += other.ramp;
    }

    pub(super) fn kind(&self) -> NoiseType {
        // a ramp makes up most of the Allan variance when the mean step squared is above the variance of the steps
        if self.ramp > self.squares[1] {
            return NoiseType::Ramp;
        }
        match self.exponent().map(f64::round) {
            Some(1.0 | 2.0) => NoiseType::Quantization,
            Some(0.0) => NoiseType::White,
            Some(-1.0) => NoiseType::Flicker,
            Some(-2.0) => NoiseType::RandomWalk,
            _ => NoiseType::Unknown,
        }
    }

    fn exponent(&self) -> Option<f64> {
        for differences in 0..=MOST_DIFFERENCES {
            let r1 = self.products[differences] / self.squares[differences];
            let delta = r1 / (1.0 + r1);
            if !delta.is_finite() {
                return None;
            }
            if delta < 0.25 || differences == MOST_DIFFERENCES {
                return Some(-2.0 * (delta + differences as f64));
            }
        }
        None
    }
}

/// Adjoining averages over m samples times m dt, `a_j = θ_{(j+1)m} − θ_{jm}`, at least [`FEWEST_AVERAGES`] of them;
/// never all in memory.
struct Averages<'a> {
    phase: &'a [f64],
    m: usize,
    count: usize,
    mean: f64,
    /// Of the least-squares line, per average.
    slope: f64,
}

/// Averages worked on at once.
const BLOCK: usize = 1 << 10;
/// Partial sums.
const LANES: usize = 8;
/// Times the averages are differenced at most.
const MOST_DIFFERENCES: usize = 2;

impl<'a> Averages<'a> {
    fn of(phase: &'a [f64], m: usize) -> Option<Averages<'a>> {
        let m = m.max(1);
        let count = phase.len().saturating_sub(1) / m;
        if count < FEWEST_AVERAGES {
            return None;
        }
        // both telescope: Σ a = θ_last − θ_0, Σ j a_j = (count − 1) θ_last − Σ_{0<j<count} θ_j
        let (first, last, averages) = (phase[0], phase[count * m], count as f64);
        let inside: f64 = (1..count)
            .step_by(BLOCK)
            .map(|start| (start..(start + BLOCK).min(count)).map(|j| phase[j * m] - first).sum::<f64>())
            .sum();
        let moment = (averages - 1.0) * (last - first) - inside - 0.5 * (averages - 1.0) * (last - first);
        let slope = moment * 12.0 / (averages * (averages * averages - 1.0));
        Some(Averages { phase, m, count, mean: (last - first) / averages, slope })
    }

    /// Averages `from .. from + out.len()` without their least-squares line.
    #[inline(always)]
    fn fill(&self, from: usize, out: &mut [f64]) {
        let middle = 0.5 * (self.count as f64 - 1.0);
        for (j, value) in (from..).zip(out) {
            let average = self.phase[(j + 1) * self.m] - self.phase[j * self.m];
            *value = average - (self.mean + self.slope * (j as f64 - middle));
        }
    }

    fn evidence(&self) -> Evidence {
        Arch::new().dispatch(Walk(self))
    }
}

struct Walk<'a>(&'a Averages<'a>);

impl WithSimd for Walk<'_> {
    type Output = Evidence;

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) -> Evidence {
        let Walk(averages) = self;
        let count = averages.count;
        // the mean of differences is known by their ends; the line took that of the averages
        let mut ends = [[0.0; 2]; 2];
        averages.fill(0, &mut ends[0]);
        averages.fill(count - 2, &mut ends[1]);
        let [[first, second], [before, last]] = ends;
        let steps = count as f64 - 1.0;
        let means = [0.0, (last - first) / steps, ((last - before) - (second - first)) / (steps - 1.0)];
        let ramp = steps * (means[1] + averages.slope).powi(2);
        let mut evidence = Evidence { ramp, ..Evidence::default() };
        let mut values = [0.0; BLOCK + 1 + MOST_DIFFERENCES];
        for start in (0..count).step_by(BLOCK) {
            let filled = values.len().min(count - start);
            averages.fill(start, &mut values[..filled]);
            for differences in 0..=MOST_DIFFERENCES {
                if differences > 0 {
                    for i in 0..filled - differences.min(filled) {
                        values[i] = values[i + 1] - values[i];
                    }
                }
                let own = &mut values[..filled.saturating_sub(differences)];
                let (squares, products) = neighbours(own, means[differences]);
                evidence.squares[differences] += squares;
                evidence.products[differences] += products;
            }
        }
        evidence
    }
}

/// Σ (x_i − mean)² over a block and Σ (x_i − mean)(x_{i+1} − mean) while there is a next one.
#[inline(always)]
fn neighbours(x: &[f64], mean: f64) -> (f64, f64) {
    let (mut squares, mut products) = ([0.0; LANES], [0.0; LANES]);
    let count = x.len().min(BLOCK);
    let paired = x.len().saturating_sub(1).min(BLOCK);
    let whole = paired - paired % LANES;
    for k in (0..whole).step_by(LANES) {
        let (now, next) = (&x[k..k + LANES], &x[k + 1..k + 1 + LANES]);
        for i in 0..LANES {
            let d = now[i] - mean;
            squares[i] += d * d;
            products[i] += d * (next[i] - mean);
        }
    }
    for k in whole..count {
        let d = x[k] - mean;
        squares[k - whole] += d * d;
        if k < paired {
            products[k - whole] += d * (x[k + 1] - mean);
        }
    }
    (folded(squares), folded(products))
}
