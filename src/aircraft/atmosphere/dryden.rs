//! Dryden turbulence: what two documents say of it, its spectra, and linear filters that have exactly these spectra.
//!
//! One-sided spectra in ω (rad/s), σ² = ∫₀^∞ Φ dω, with T = L/V:
//!
//! Φu = σu² (2 Tu/π)/(1 + (Tu ω)²),  Φv,w = σ² (T/π)(1 + 3(Tω)²)/(1 + (Tω)²)²,
//! Φp = σw² 0.8 (πLw/4b)^(1/3)/(V Lw (1 + (4bω/πV)²)),  Φq = (ω/V)²/(1 + (4bω/πV)²) Φw,  Φr = (ω/V)²/(1 + (3bω/πV)²)
//! Φv.
//!
//! The filters are driven by white noise n of unit two-sided density, E[n(t)n(t')] = δ(t − t'), so that |H|² = πΦ.
//! Signs of the rates are those of air that turns like a rigid body, p = ∂w/∂y, q = −∂w/∂x, r = +∂v/∂x: the airplane
//! feels its own rate less these.
//!
//! MIL-F-8785C (1980), section 3.7, has lengths Lu = Lv, Lw; MIL-HDBK-1797 (1997) has half of these for v and w, and 2L
//! in the filters of v, w and p. The spectra are the same; lengths of one document in the filters of the other are
//! wrong by two.
//!
//! Not valid: within a wing span or so of the ground, where the spectra were not measured; for a span that is not small
//! beside L (the filters of p, q, r assume it); for flight so slow that the air changes while the airplane crosses it
//! (frozen field).

use std::f64::consts::PI;

use nalgebra::{DMatrix, SMatrix};

use super::AirError;
use crate::numerics::linalg::LinalgError;
use crate::numerics::riccati::lyapunov;
use crate::numerics::van_loan::van_loan;

pub const FOOT: f64 = 0.3048;
/// The low-altitude model holds between these heights, ft; between the second and the third lengths and intensities are
/// interpolated.
const LOW: [f64; 3] = [10.0, 1000.0, 2000.0];
/// Scale length above, ft.
const LENGTH_ALOFT: f64 = 1750.0;

/// The document whose scale lengths and filters are used.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Specification {
    MilF8785C,
    MilHdbk1797,
}

impl Specification {
    /// Names in documents.
    pub const NAMES: [&str; 2] = ["MIL-F-8785C", "MIL-HDBK-1797"];

    pub fn name(self) -> &'static str {
        Specification::NAMES[self as usize]
    }

    pub fn from_name(name: &str) -> Option<Specification> {
        let all = [Specification::MilF8785C, Specification::MilHdbk1797];
        all.into_iter().find(|s| s.name().eq_ignore_ascii_case(name))
    }

    /// The length in the filters of v, w and p as a multiple of the document's own.
    fn length_in_filters(self) -> f64 {
        match self {
            Specification::MilF8785C => 1.0,
            Specification::MilHdbk1797 => 2.0,
        }
    }
}

/// How strong the turbulence is; which of them is needed depends on the height.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Intensity {
    /// Mean wind 20 ft above the ground, m/s: 15, 30 and 45 kt are light, moderate and severe. Below 2000 ft.
    pub wind_at_20ft: Option<f64>,
    /// Standard deviation of u, v and w, m/s. Above 1000 ft; from the document's chart of exceedance.
    pub std_dev_aloft: Option<f64>,
}

/// Turbulence at one height and airspeed. SI.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Dryden {
    pub specification: Specification,
    /// Lu, Lv, Lw as the document defines them, m.
    pub lengths: [f64; 3],
    /// σu, σv, σw, m/s.
    pub std_devs: [f64; 3],
    pub airspeed: f64,
    pub span: f64,
}

/// States u | w1 w2 q | v1 v2 r | p of the filters, white noises u, w, v, p, and the gust u v w p q r = C x.
pub const STATES: usize = 8;

/// ẋ = A x + B n, gust = C x, n white of unit two-sided density.
#[derive(Clone, Debug, PartialEq)]
pub struct GustModel {
    pub a: SMatrix<f64, STATES, STATES>,
    pub b: SMatrix<f64, STATES, 4>,
    pub c: SMatrix<f64, 6, STATES>,
}

impl Dryden {
    /// Scale lengths and intensities at a height above ground (m), an airspeed (m/s) and for a span (m). Errors: below
    /// 10 ft, or the intensity that this height needs is not given.
    pub fn new(
        specification: Specification,
        height: f64,
        intensity: Intensity,
        airspeed: f64,
        span: f64,
    ) -> Result<Dryden, AirError> {
        let feet = height / FOOT;
        if feet.is_nan() || feet < LOW[0] {
            return Err(AirError(format!(
                "height {height} m: Dryden turbulence is defined from 10 ft (3.048 m) above the ground; fly higher or \
                 leave the gusts out"
            )));
        }
        if !(airspeed > 0.0 && span > 0.0) {
            return Err(AirError(format!("airspeed {airspeed} m/s, span {span} m: turbulence needs both above zero")));
        }
        let needs = |name: &str, value: Option<f64>| {
            value.ok_or_else(|| AirError(format!("at a height of {height} m ({feet:.0} ft) turbulence needs {name}")))
        };
        let low = |feet: f64| -> Result<[f64; 4], AirError> {
            let wind = needs("wind_at_20ft, for example \"15 kt\"", intensity.wind_at_20ft)?;
            let k = 0.177 + 0.000_823 * feet;
            let vertical = 0.1 * wind;
            Ok([feet / k.powf(1.2), feet, vertical / k.powf(0.4), vertical])
        };
        let aloft = || -> Result<[f64; 4], AirError> {
            let name = "std_dev, for example \"1.5 m/s\", or exceedance, for example 1e-2 for light turbulence";
            let std_dev = needs(name, intensity.std_dev_aloft)?;
            Ok([LENGTH_ALOFT, LENGTH_ALOFT, std_dev, std_dev])
        };
        let [horizontal, vertical, across, down] = if feet <= LOW[1] {
            low(feet)?
        } else if feet >= LOW[2] {
            aloft()?
        } else {
            let (below, above, part) = (low(LOW[1])?, aloft()?, (feet - LOW[1]) / (LOW[2] - LOW[1]));
            std::array::from_fn(|i| below[i] + part * (above[i] - below[i]))
        };
        let own = FOOT / specification.length_in_filters();
        Ok(Dryden {
            specification,
            lengths: [horizontal * FOOT, horizontal * own, vertical * own],
            std_devs: [across, across, down],
            airspeed,
            span,
        })
    }

    /// T = L/V of u, v, w in the form of the filters, s.
    fn times(&self) -> [f64; 3] {
        let times = self.specification.length_in_filters();
        let [u, v, w] = self.lengths;
        [u, times * v, times * w].map(|length| length / self.airspeed)
    }

    /// Time constants of the spanwise averages of p, q, r, s.
    fn span_times(&self) -> [f64; 3] {
        let b = self.span / (PI * self.airspeed);
        [4.0 * b, 4.0 * b, 3.0 * b]
    }

    /// Variance density of the roll gust at frequency zero, Φp(0).
    fn roll_density(&self) -> f64 {
        let length = self.times()[2] * self.airspeed;
        let sigma = self.std_devs[2];
        sigma * sigma * 0.8 * (PI * length / (4.0 * self.span)).cbrt() / (self.airspeed * length)
    }

    /// One-sided spectra Φ(ω) of u, v, w (m²/s² per rad/s) and p, q, r (rad²/s² per rad/s).
    pub fn spectra(&self, omega: f64) -> [f64; 6] {
        let [tu, tv, tw] = self.times();
        let [su, sv, sw] = self.std_devs;
        let one = |t: f64| 1.0 + (t * omega).powi(2);
        let u = su * su * 2.0 * tu / (PI * one(tu));
        let transverse = |s: f64, t: f64| s * s * t / PI * (1.0 + 3.0 * (t * omega).powi(2)) / (one(t) * one(t));
        let (v, w) = (transverse(sv, tv), transverse(sw, tw));
        let [tp, tq, tr] = self.span_times();
        let slope = (omega / self.airspeed).powi(2);
        [u, v, w, self.roll_density() / one(tp), slope / one(tq) * w, slope / one(tr) * v]
    }

    /// The filters as one linear system.
    pub fn model(&self) -> GustModel {
        let [tu, tv, tw] = self.times();
        let [su, sv, sw] = self.std_devs;
        let [tp, tq, tr] = self.span_times();
        let mut model = GustModel { a: SMatrix::zeros(), b: SMatrix::zeros(), c: SMatrix::zeros() };
        let GustModel { a, b, c } = &mut model;
        (a[(0, 0)], b[(0, 0)], c[(0, 0)]) = (-1.0 / tu, su * (2.0 / tu).sqrt(), 1.0);
        // (1 + √3 T s)/(1 + T s)² in the form [0 1; −1/T² −2/T], then the average over the span behind it
        let transverse = [(1, 1, 2, sw, tw, tq, 4, -1.0), (4, 2, 1, sv, tv, tr, 5, 1.0)];
        for (at, noise, output, sigma, t, span, rate, sign) in transverse {
            let gain = [sigma * t.powf(-1.5), sigma * 3.0_f64.sqrt() / t.sqrt()];
            a[(at, at + 1)] = 1.0;
            (a[(at + 1, at)], a[(at + 1, at + 1)]) = (-1.0 / (t * t), -2.0 / t);
            b[(at + 1, noise)] = 1.0;
            a[(at + 2, at + 2)] = -1.0 / span;
            // sign · (gust − its average)/(V T): sign · (s/V)/(1 + T s) of the gust
            let slope = sign / (self.airspeed * span);
            c[(rate, at + 2)] = -slope;
            for (i, gain) in gain.into_iter().enumerate() {
                c[(output, at + i)] = gain;
                a[(at + 2, at + i)] = gain / span;
                c[(rate, at + i)] = slope * gain;
            }
        }
        (a[(7, 7)], b[(7, 3)], c[(3, 7)]) = (-1.0 / tp, (PI * self.roll_density()).sqrt() / tp, 1.0);
        model
    }
}

/// The independent parts of the state, those of u, w and q, v and r, p: first state and length.
pub const PARTS: [(usize, usize); 4] = [(0, 1), (1, 3), (4, 3), (7, 1)];

/// x⁺ = F x + v, v ~ N(0, Q), exact over a step.
#[derive(Clone, Debug, PartialEq)]
pub struct DiscreteGusts {
    pub f: SMatrix<f64, STATES, STATES>,
    pub q: SMatrix<f64, STATES, STATES>,
}

impl GustModel {
    /// Exact over `dt` (s), part by part. Errors: numbers too large or small for it.
    pub fn over(&self, dt: f64) -> Result<DiscreteGusts, LinalgError> {
        let mut out = DiscreteGusts { f: SMatrix::zeros(), q: SMatrix::zeros() };
        for (at, n) in PARTS {
            // integrals of the driven state in units of dt, so that all entries of Q have one size however short the
            // step
            let unit = |i: usize| if n == 3 && i != 1 { dt } else { 1.0 };
            let a = DMatrix::from_fn(n, n, |i, j| self.a[(at + i, at + j)] * unit(j) / unit(i));
            let b = DMatrix::from_fn(n, 4, |i, k| self.b[(at + i, k)] / unit(i));
            let (f, q) = van_loan(&a, &(&b * b.transpose()), dt)?;
            for i in 0..n {
                for j in 0..n {
                    out.f[(at + i, at + j)] = f[(i, j)] * unit(i) / unit(j);
                    out.q[(at + i, at + j)] = q[(i, j)] * unit(i) * unit(j);
                }
            }
        }
        Ok(out)
    }

    /// Stationary covariance of the states. Errors: no convergence.
    pub fn state_covariance(&self) -> Result<SMatrix<f64, STATES, STATES>, LinalgError> {
        // the law does not depend on the step: one of the order of the slowest filter keeps the sum short
        let slowest = self.a[(0, 0)].abs().min(0.5 * self.a[(2, 2)].abs()).min(0.5 * self.a[(5, 5)].abs());
        let mut covariance = SMatrix::zeros();
        let step = self.over(0.5 / slowest)?;
        for (at, n) in PARTS {
            let part = |m: &SMatrix<f64, STATES, STATES>| DMatrix::from_fn(n, n, |i, j| m[(at + i, at + j)]);
            let solved = lyapunov(&part(&step.f), &part(&step.q))?;
            for i in 0..n {
                for j in 0..n {
                    covariance[(at + i, at + j)] = solved[(i, j)];
                }
            }
        }
        Ok(covariance)
    }

    /// Stationary covariance of the gust u v w p q r. Errors: no convergence.
    pub fn covariance(&self) -> Result<SMatrix<f64, 6, 6>, LinalgError> {
        Ok(self.c * self.state_covariance()? * self.c.transpose())
    }
}
