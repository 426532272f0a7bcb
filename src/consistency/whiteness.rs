//! Is the innovation sequence white? Streaming autocorrelation, Ljung-Box, the largest lag, and Bartlett's
//! cumulative periodogram.

use super::effect::{AUTOCORRELATION_TOLERANCE, Effect, PERIODOGRAM_TOLERANCE, PREDICTABLE_TOLERANCE};
use super::{Test, TestKind};
use crate::numerics::distribution::{chi_square_quantile, chi_square_sf, kolmogorov_sf, normal_quantile, normal_sf};
use crate::numerics::optimize::bracketed_root;
use crate::signal::spectrum::periodogram;
use crate::units::digits;

/// Sums for the autocorrelation of a sequence at lags 1..=L, in one pass with memory for L samples.
///
/// The mean is taken as zero, as it is for the innovations of a true design; an offset shows as correlation at all
/// lags. Missing samples keep their place in time: a lag is always that many sample intervals.
#[derive(Clone, Debug)]
pub struct Autocorrelation {
    /// The last L samples twice in a row, so that the newest L are always one slice; 0 where a sample is missing.
    history: Vec<f64>,
    present: Vec<bool>,
    position: usize,
    /// Consecutive samples up to now, at most L.
    contiguous: usize,
    products: Vec<f64>,
    /// Pairs beside those counted in `full`.
    pairs: Vec<u64>,
    /// Samples that had a partner at every lag.
    full: u64,
    squares: f64,
    fourth: f64,
    count: u64,
}

impl Autocorrelation {
    pub fn new(lags: usize) -> Autocorrelation {
        let lags = lags.max(1);
        Autocorrelation {
            history: vec![0.0; 2 * lags],
            present: vec![false; 2 * lags],
            position: 0,
            contiguous: 0,
            products: vec![0.0; lags],
            pairs: vec![0; lags],
            full: 0,
            squares: 0.0,
            fourth: 0.0,
            count: 0,
        }
    }

    pub fn lags(&self) -> usize {
        self.products.len()
    }

    /// The next sample.
    pub fn push(&mut self, y: f64) {
        let lags = self.lags();
        let window = self.position..self.position + lags;
        // the window is oldest first, so lag h is at its end − h
        for (product, past) in self.products.iter_mut().zip(self.history[window.clone()].iter().rev()) {
            *product += y * past;
        }
        if self.contiguous == lags {
            self.full += 1;
        } else {
            for (pairs, present) in self.pairs.iter_mut().zip(self.present[window].iter().rev()) {
                *pairs += u64::from(*present);
            }
        }
        self.squares += y * y;
        self.fourth += y * y * y * y;
        self.count += 1;
        self.advance(y, true);
        self.contiguous = (self.contiguous + 1).min(lags);
    }

    /// `n` samples that are not there.
    pub fn skip(&mut self, n: u64) {
        for _ in 0..n.min(self.lags() as u64) {
            self.advance(0.0, false);
            self.contiguous = 0;
        }
    }

    fn advance(&mut self, y: f64, present: bool) {
        let lags = self.lags();
        for index in [self.position, self.position + lags] {
            self.history[index] = y;
            self.present[index] = present;
        }
        self.position = (self.position + 1) % lags;
    }

    /// Samples seen.
    pub fn count(&self) -> u64 {
        self.count
    }
    /// Σ y².
    pub fn squares(&self) -> f64 {
        self.squares
    }
    /// Σ y⁴.
    pub fn fourth(&self) -> f64 {
        self.fourth
    }

    /// The tests over all lags, but no more than a tenth of the samples, at level `alpha`.
    pub fn whiteness(&self, alpha: f64) -> Whiteness {
        let n = self.count as f64;
        let total = n * (n + 2.0);
        let pairs: Vec<f64> = self.pairs.iter().map(|p| (p + self.full) as f64).collect();
        // at most n/10 lags, where the chi-square approximation holds; lags with no pair at all say nothing
        let most = self.lags().min((self.count / 10).max(1) as usize);
        let used: Vec<usize> = (0..most).filter(|&i| pairs[i] > 0.0).collect();
        let normalised: Vec<f64> =
            used.iter().map(|&i| self.products[i] / self.squares * (total / pairs[i]).sqrt()).collect();
        let correlation: Vec<f64> = used.iter().map(|&i| self.products[i] / self.squares * n / pairs[i]).collect();
        let ljung_box: f64 = normalised.iter().map(|t| t * t).sum();
        let (at, largest) = largest_abs(&normalised);
        let lags = used.len() as f64;
        let level = 1.0 - (1.0 - alpha).powf(1.0 / lags);
        let quantile = normal_quantile(1.0 - level / 2.0);
        let single = 2.0 * normal_sf(largest);
        let (lag_at, max_abs) = largest_abs(&correlation);
        let spread = bartlett_variance(&correlation, lag_at).max(1.0);
        let pairs_at = used.get(lag_at).map_or(f64::NAN, |&i| pairs[i]);
        let half_width = quantile * (spread / pairs_at).sqrt();
        Whiteness {
            samples: self.count,
            lags: used.len(),
            lag: used.get(at).map_or(0, |i| i + 1),
            largest_normalised: largest,
            largest_bound: quantile,
            largest_p_value: -((-single).ln_1p() * lags).exp_m1(),
            max_abs_autocorrelation: max_abs,
            max_lag: used.get(lag_at).map_or(0, |i| i + 1),
            interval: [(max_abs - half_width).max(0.0), (max_abs + half_width).min(1.0)],
            ljung_box,
            ljung_box_lower: chi_square_quantile(alpha / 2.0, lags),
            ljung_box_upper: chi_square_quantile(1.0 - alpha / 2.0, lags),
            ljung_box_p_value: super::normalized::two_sided_p(ljung_box, lags),
            ljung_box_upper_p_value: chi_square_sf(ljung_box, lags),
            autocorrelation: correlation,
        }
    }
}

/// Index and value of the largest absolute value; (0, NaN) of nothing.
fn largest_abs(values: &[f64]) -> (usize, f64) {
    let mut best = (0, f64::NAN);
    for (index, value) in values.iter().enumerate() {
        if best.1.is_nan() || value.abs() > best.1 {
            best = (index, value.abs());
        }
    }
    best
}

/// n·var(r_h) of a linear process with autocorrelations r at lags 1..=L (zero beyond), h = `at` + 1.
///
/// Σ_j [r_j² + r_{j+h} r_{j−h} − 4 r_h r_j r_{j−h} + 2 r_h² r_j²] over all j. Source: Bartlett 1946; Brockwell &
/// Davis 1991, eq. 7.2.5.
fn bartlett_variance(r: &[f64], at: usize) -> f64 {
    let h = at as i64 + 1;
    let reach = r.len() as i64;
    let rho = |j: i64| match j.unsigned_abs() as usize {
        0 => 1.0,
        k => r.get(k - 1).copied().unwrap_or(0.0),
    };
    let rh = rho(h);
    (-reach - h..=reach + h)
        .map(|j| {
            let rj = rho(j);
            rj * rj + rho(j + h) * rho(j - h) - 4.0 * rh * rj * rho(j - h) + 2.0 * rh * rh * rj * rj
        })
        .sum()
}

/// What [`Autocorrelation`] says.
#[derive(Clone, Debug, PartialEq)]
pub struct Whiteness {
    pub samples: u64,
    /// Number of lags tested.
    pub lags: usize,
    /// Autocorrelation at lags 1..=lags, mean taken as zero.
    pub autocorrelation: Vec<f64>,
    /// Largest |r_h|·√(n(n+2)/(pairs at h))/n, and its lag: standard normal at each lag under the model, exactly of
    /// unit variance.
    pub largest_normalised: f64,
    pub lag: usize,
    /// Šidák bound of `largest_normalised` at level alpha.
    pub largest_bound: f64,
    pub largest_p_value: f64,
    /// Largest |r_h| and its lag.
    pub max_abs_autocorrelation: f64,
    pub max_lag: usize,
    /// Contains max_h |ρ_h| with confidence 1 − alpha: |r| ± the simultaneous half width over all lags, Bartlett's
    /// variance.
    pub interval: [f64; 2],
    /// Q = n(n+2) Σ r_h²/(n−h), with the number of pairs where samples are missing; χ²(lags) under the model.
    /// Source: Ljung & Box 1978.
    pub ljung_box: f64,
    pub ljung_box_lower: f64,
    pub ljung_box_upper: f64,
    /// Two-sided: correlations that are too small to be true are no sign of a good filter either.
    pub ljung_box_p_value: f64,
    /// The usual upper tail, P(χ² > Q).
    pub ljung_box_upper_p_value: f64,
}

impl Whiteness {
    /// "whiteness" (largest lag) and "ljung_box" (all lags together), with their effects; `dt` in s.
    pub fn tests(&self, axis: &str, dt: f64, alpha: f64) -> [Test; 2] {
        let worst = if self.largest_normalised <= self.largest_bound {
            "no lag is correlated beyond chance".to_string()
        } else {
            format!(
                "the innovations are correlated, most at lag {} ({} s): the model misses something that fast",
                self.lag,
                digits(self.lag as f64 * dt)
            )
        };
        let largest = Test::new(
            axis,
            TestKind::Whiteness,
            self.largest_normalised,
            [0.0, self.largest_bound],
            self.largest_p_value,
            worst,
        )
        .with_effect(Effect::new(
            "max_abs_autocorrelation",
            self.max_abs_autocorrelation,
            self.interval,
            [0.0, AUTOCORRELATION_TOLERANCE],
        ));
        let (share, interval) = self.predictable_share(alpha);
        let all = if self.ljung_box > self.ljung_box_upper {
            format!(
                "lags 1 to {} together are correlated: a better model could predict about {} % of the innovation \
                 variance",
                self.lags,
                digits(100.0 * share)
            )
        } else if self.ljung_box < self.ljung_box_lower {
            format!("lags 1 to {} are less correlated than chance allows: the samples are not a raw log", self.lags)
        } else {
            format!("lags 1 to {} together are white", self.lags)
        };
        let together = Test::new(
            axis,
            TestKind::LjungBox,
            self.ljung_box,
            [self.ljung_box_lower, self.ljung_box_upper],
            self.ljung_box_p_value,
            all,
        )
        .with_effect(Effect::new("predictable_share", share, interval, [0.0, PREDICTABLE_TOLERANCE]));
        [largest, together]
    }

    /// Share of the innovation variance that its own past predicts, s/(1 + s) with s = Σ ρ_h² over the lags, and its
    /// interval.
    ///
    /// Exact for a first-order autoregression, of first order in s otherwise. Q is noncentral χ²(lags, n·s), and √Q
    /// is close to N(√(lags − ½ + n·s), 1) (Fisher 1928, extended).
    fn predictable_share(&self, alpha: f64) -> (f64, [f64; 2]) {
        let n = self.samples as f64;
        let root = self.ljung_box.sqrt();
        let z = normal_quantile(1.0 - alpha / 2.0);
        let share = |excess: f64| {
            let sum = (excess / n).max(0.0);
            sum / (1.0 + sum)
        };
        let at = |r: f64| share(r.max(0.0).powi(2) - (self.lags as f64 - 0.5));
        (share(self.ljung_box - self.lags as f64), [at(root - z), at(root + z)])
    }
}

/// Bartlett's cumulative periodogram of a series.
#[derive(Clone, Debug, PartialEq)]
pub struct CumulativePeriodogram {
    /// Frequencies used: 1..=m of n, without zero and Nyquist.
    pub ordinates: usize,
    /// Share of the power at or below frequency j, j = 1..=m (the last is 1).
    pub share: Vec<f64>,
    /// Largest distance from the straight line, as for a sample distribution of m − 1 points, with its sign.
    pub distance: f64,
    /// Frequency of the largest distance, in cycles per sample.
    pub frequency: f64,
    pub p_value: f64,
    /// Bound of |distance| at level alpha.
    pub bound: f64,
}

/// Tests a series for whiteness by its cumulative periodogram: U_j = Σ_{i≤j} I_i / Σ I against j/m.
///
/// For Gaussian white noise the ordinates are independent exponentials, so U_1..U_{m−1} are the order statistics of
/// m − 1 uniform numbers and the distance is Kolmogorov's, here with Stephens' factor √k + 0.12 + 0.11/√k, k = m − 1.
/// `None` below 8 ordinates or for a series without power. Sources: Bartlett 1955; Durbin 1969, Biometrika 56;
/// Stephens 1970, JRSS B 32.
pub fn cumulative_periodogram(series: &[f64], alpha: f64) -> Option<CumulativePeriodogram> {
    let n = series.len();
    let ordinates = n.saturating_sub(1) / 2;
    if ordinates < 8 {
        return None;
    }
    let spectrum = periodogram(series, 1.0);
    let mut total = 0.0f64;
    let mut share: Vec<f64> = spectrum
        .psd
        .iter()
        .skip(1)
        .take(ordinates)
        .map(|power| {
            total += power;
            total
        })
        .collect();
    if !(total.is_finite() && total > 0.0) {
        return None;
    }
    share.iter_mut().for_each(|u| *u /= total);
    let k = (ordinates - 1) as f64;
    let (mut distance, mut at) = (0.0f64, 0usize);
    for (i, u) in share[..ordinates - 1].iter().enumerate() {
        for d in [u - i as f64 / k, u - (i + 1) as f64 / k] {
            if d.abs() > distance.abs() {
                (distance, at) = (d, i);
            }
        }
    }
    let factor = k.sqrt() + 0.12 + 0.11 / k.sqrt();
    Some(CumulativePeriodogram {
        ordinates,
        share,
        distance,
        frequency: (at + 1) as f64 / n as f64,
        p_value: kolmogorov_sf(factor * distance.abs()),
        bound: kolmogorov_quantile(alpha) / factor,
    })
}

/// x with `kolmogorov_sf`(x) = p, at most 20, where that is 0 in floating point; NaN where p is not from 0 to 1.
pub fn kolmogorov_quantile(p: f64) -> f64 {
    bracketed_root(|x| kolmogorov_sf(x) - p, 0.1, 20.0, 0.0).unwrap_or(f64::NAN)
}

impl CumulativePeriodogram {
    /// The record of the test; `interval_s` is the time between two points of the series.
    pub fn test(&self, axis: &str, interval_s: f64) -> Test {
        let period = digits(interval_s / self.frequency);
        let meaning = if self.distance.abs() <= self.bound {
            format!("the innovations are white at periods above {} s", digits(2.0 * interval_s))
        } else if self.distance > 0.0 {
            format!(
                "too much innovation power at periods above {period} s: the filter is optimistic about slow drift (it \
                 expects less than there is)"
            )
        } else {
            format!(
                "too little innovation power at periods above {period} s: the filter is pessimistic about slow drift \
                 (it expects more than there is)"
            )
        };
        let size = self.distance.abs();
        Test::new(
            axis,
            TestKind::CumulativePeriodogram,
            self.distance,
            [-self.bound, self.bound],
            self.p_value,
            meaning,
        )
        .with_averaging(interval_s)
        .with_effect(Effect::new(
            "periodogram_distance",
            size,
            [(size - self.bound).max(0.0), size + self.bound],
            [0.0, PERIODOGRAM_TOLERANCE],
        ))
    }
}

#[cfg(test)]
mod tests {
    use super::bartlett_variance;

    /// AR(1): n·var(r_h) = (1 + φ²)(1 − φ^2h)/(1 − φ²) − 2hφ^2h (Brockwell & Davis 1991, example 7.2.3); white
    /// noise: 1.
    #[test]
    fn bartlett_variance_of_an_autoregression() {
        let phi = 0.5_f64;
        let r: Vec<f64> = (1..=80).map(|h| phi.powi(h)).collect();
        for h in [1, 2, 5, 20] {
            let decay = phi.powi(2 * h);
            let expected = (1.0 + phi * phi) * (1.0 - decay) / (1.0 - phi * phi) - 2.0 * f64::from(h) * decay;
            assert!((bartlett_variance(&r, h as usize - 1) - expected).abs() < 1e-9, "lag {h}");
        }
        assert!((bartlett_variance(&[0.0; 10], 3) - 1.0).abs() < 1e-15);
    }
}
