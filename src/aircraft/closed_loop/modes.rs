//! Motions of a closed loop and what they are called: by who takes part in them.
//!
//! The part of state i in a mode is |vᵢ wᵢ| with right and left eigenvectors v and w (participation factors,
//! Pérez-Arriaga, Verghese and Schweppe 1982, IEEE Trans. Power Apparatus 101), which no choice of units changes.

use nalgebra::{Complex, DMatrix, DVector};

use super::circuit::Circuit;
use super::half::{ANGLE, Half};
use crate::aircraft::airframe::modes::ModeName;
use crate::numerics::linalg::eigenvalues;

/// Slower oscillations are path and drift, which an autopilot of attitude does not damp: rad/s of the imaginary part.
const SLOWEST: f64 = 1.5;
/// A motion is the airplane's when so much of it is: servos and filters share the fast ones.
const OF_AIRFRAME: f64 = 1.0 / 3.0;
/// A motion is one of the airplane at all from a hundredth on: lines and their filters take part by rounding alone.
const IN_AIRPLANE: f64 = 0.01;
/// A double eigenvalue has no vector of its own: inverse iteration starts this far from it, of its distance to zero.
const BESIDE: f64 = 1e-9;

/// One motion; of a pair the one above the axis.
#[derive(Clone, Debug, PartialEq)]
pub struct LoopMode {
    /// short_period, phugoid, dutch_roll, roll, spiral; servo, gust, sensor, filter.
    pub name: &'static str,
    /// In continuous time, 1/s.
    pub eigenvalue: (f64, f64),
    /// Part that airframe, servos and commands take in it.
    pub flies: f64,
}

impl LoopMode {
    /// |λ|, rad/s.
    pub fn frequency(&self) -> f64 {
        self.eigenvalue.0.hypot(self.eigenvalue.1)
    }

    pub fn damping(&self) -> f64 {
        -self.eigenvalue.0 / self.frequency()
    }

    /// One that damping is asked of: a vibration line of the gyro, and a filter that follows it, are no motion of the
    /// airplane.
    pub fn oscillates(&self) -> bool {
        self.eigenvalue.1 > SLOWEST && self.flies > IN_AIRPLANE
    }
}

/// Motions of a loop, slowest first; those that are over within a sample are left out.
pub fn modes(circuit: &Circuit) -> Vec<LoopMode> {
    let mut found: Vec<LoopMode> = Vec::new();
    for z in eigenvalues(&circuit.a).into_iter().filter(|z| z.1 >= 0.0) {
        let modulus = z.0.hypot(z.1);
        if modulus < 1e-12 {
            continue;
        }
        let eigenvalue = (modulus.ln() / circuit.interval, z.1.atan2(z.0) / circuit.interval);
        let (name, flies) = name(circuit, z, eigenvalue.1 > 0.0);
        found.push(LoopMode { name, eigenvalue, flies });
    }
    found.sort_by(|a, b| a.frequency().total_cmp(&b.frequency()));
    found
}

/// The least damped oscillation.
pub fn least_damped(modes: &[LoopMode]) -> Option<&LoopMode> {
    modes.iter().filter(|mode| mode.oscillates()).min_by(|a, b| a.damping().total_cmp(&b.damping()))
}

/// What it is called, and the part of airframe, servos and commands.
fn name(circuit: &Circuit, z: (f64, f64), pair: bool) -> (&'static str, f64) {
    let Some(shares) = participation(&circuit.a, z) else { return ("filter", 1.0) };
    let of = |range: std::ops::Range<usize>| shares[range].iter().sum::<f64>();
    let airframe = of(0..4);
    let gusty = |i: &usize| circuit.states[*i].name.starts_with("gust");
    let gust: f64 = (0..circuit.plant).filter(gusty).map(|i| shares[i]).sum();
    let servo = of(4..circuit.plant) - gust;
    let sensor = of(circuit.plant..circuit.truth);
    let filter = of(circuit.truth..shares.len());
    let groups = [("servo", servo), ("gust", gust), ("sensor", sensor), ("filter", filter)];
    let other = groups.into_iter().max_by(|a, b| a.1.total_cmp(&b.1)).filter(|_| airframe < OF_AIRFRAME);
    if let Some((name, _)) = other {
        return (name, airframe + servo);
    }
    let largest = (0..4).max_by(|a, b| shares[*a].total_cmp(&shares[*b])).unwrap_or(ANGLE);
    let mode = match (circuit.half, pair, largest) {
        (Half::Pitch, true, 1 | 2) => ModeName::ShortPeriod,
        (Half::Pitch, true, _) => ModeName::Phugoid,
        (Half::RollYaw, true, 0 | 2) => ModeName::DutchRoll,
        (Half::RollYaw, true, _) => ModeName::Oscillation,
        (Half::RollYaw, false, 1) => ModeName::Roll,
        (Half::RollYaw, false, ANGLE) => ModeName::Spiral,
        _ => ModeName::Real,
    };
    (mode.text(), airframe + servo)
}

/// Parts of the states, which sum to one; `None` where there is no eigenvector.
fn participation(a: &DMatrix<f64>, z: (f64, f64)) -> Option<Vec<f64>> {
    let n = a.nrows();
    let beside = Complex::new(z.0, z.1) * (1.0 + BESIDE) + Complex::new(BESIDE * BESIDE, 0.0);
    let shifted =
        DMatrix::from_fn(n, n, |i, j| Complex::new(a[(i, j)], 0.0) - if i == j { beside } else { Complex::ZERO });
    let vector = |matrix: DMatrix<Complex<f64>>| -> Option<DVector<Complex<f64>>> {
        let lu = matrix.lu();
        // not along any axis, so that every mode is in it
        let mut x = DVector::from_fn(n, |i, _| Complex::new(1.0, 0.3 * i as f64 / n as f64));
        for _ in 0..2 {
            x = lu.solve(&x)?;
            let size = x.iter().map(|x| x.norm()).fold(0.0, f64::max);
            x.iter_mut().for_each(|x| *x /= size);
        }
        x.iter().all(|x| x.is_finite()).then_some(x)
    };
    let right = vector(shifted.clone())?;
    let left = vector(shifted.transpose())?;
    let shares: Vec<f64> = right.iter().zip(&left).map(|(v, w)| (v * w).norm()).collect();
    let sum: f64 = shares.iter().sum();
    (sum > 0.0).then(|| shares.iter().map(|share| share / sum).collect())
}
