//! Attitude errors by the definitions of the BROAD benchmark (Laidig, Caruso, Cereatti, Seel, Data 6(7), 2021).

use nalgebra::{Matrix2, Matrix3, UnitQuaternion, Vector2, Vector3};
use schemars::JsonSchema;
use serde::Serialize;

/// χ² of three and of two degrees of freedom at the probability of three sigma, 99.73 %.
const THREE_SIGMA: [f64; 2] = [14.156, 11.829];

/// What is known of the reference.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Reference {
    /// Of each component of its rotation, rad.
    pub std_dev: f64,
    /// Spread of its time, s: an error of |rate| times this.
    pub timing: f64,
}

/// One error in rad.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AttitudeError {
    /// The angle of the whole turn.
    pub total: f64,
    /// Of the turn about the vertical that leaves the smallest rest.
    pub heading: f64,
    /// Of that rest, about a horizontal axis.
    pub inclination: f64,
}

impl AttitudeError {
    /// Of e = q̂ q_ref⁻¹, the error in the earth frame: 2 acos|w|, 2 atan|z/w|, 2 acos √(w² + z²). Near zero the
    /// sines are used, which keep all digits.
    pub fn of(estimate: &UnitQuaternion<f64>, reference: &UnitQuaternion<f64>) -> AttitudeError {
        let e = estimate * reference.inverse();
        let (w, horizontal, z) = (e.w.abs(), e.i.hypot(e.j), e.k.abs());
        AttitudeError {
            total: 2.0 * horizontal.hypot(z).atan2(w),
            heading: 2.0 * z.atan2(w),
            inclination: 2.0 * horizontal.atan2(w.hypot(z)),
        }
    }
}

/// Errors over the samples that count: those that move, if the log says it, and have a reference.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
pub struct Errors {
    pub samples: u64,
    /// Root mean squares, deg.
    pub total_rmse_deg: f64,
    pub heading_rmse_deg: f64,
    pub inclination_rmse_deg: f64,
    /// Greatest total error, deg.
    pub greatest_deg: f64,
    /// Without a heading aid: the constant heading that was taken off the estimate, deg.
    pub heading_offset_deg: Option<f64>,
    /// Degrees of freedom of the NEES: 3, or 2 (the inclination) without a heading aid.
    pub degrees: u8,
    /// Mean of eᵀ (P + reference)⁻¹ e; correlated in time, so no test is made of it.
    pub nees: f64,
    /// The same without the reference's noise.
    pub nees_of_claim: f64,
    /// Share of the samples whose error is in the claimed 99.73 % region, the reference taken as exact.
    pub covered: f64,
    /// Shares for each component in its own 3 sigma.
    pub covered_east: f64,
    pub covered_north: f64,
    pub covered_up: Option<f64>,
    /// Mean claimed sigma, deg.
    pub inclination_sigma_deg: f64,
    pub heading_sigma_deg: f64,
    /// What was allowed for the reference.
    pub reference_std_dev_deg: f64,
    pub reference_timing_s: f64,
}

/// One sample that counts.
#[derive(Clone, Copy, Debug)]
struct Sample {
    estimate: UnitQuaternion<f64>,
    reference: UnitQuaternion<f64>,
    covariance: Matrix3<f64>,
    rate: f64,
}

/// Samples in progress; kept whole, since a free heading is taken off at the end.
#[derive(Clone, Debug)]
pub(super) struct Collected {
    reference: Reference,
    heading: bool,
    samples: Vec<Sample>,
}

impl Collected {
    pub(super) fn new(reference: Reference, heading: bool) -> Collected {
        Collected { reference, heading, samples: Vec::new() }
    }

    pub(super) fn push(
        &mut self,
        estimate: &UnitQuaternion<f64>,
        covariance: &Matrix3<f64>,
        reference: &UnitQuaternion<f64>,
        rate: f64,
        counts: bool,
    ) {
        if counts {
            self.samples.push(Sample { estimate: *estimate, reference: *reference, covariance: *covariance, rate });
        }
    }

    /// `None` without samples.
    pub(super) fn conclude(&self) -> Option<Errors> {
        if self.samples.is_empty() {
            return None;
        }
        let offset = if self.heading { 0.0 } else { self.offset() };
        let turn = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), -offset);
        let mut sums = Sums::default();
        for sample in &self.samples {
            // a turn about the vertical turns the covariance with it
            let r = *turn.to_rotation_matrix().matrix();
            let p = r * sample.covariance * r.transpose();
            self.add(&mut sums, &(turn * sample.estimate), &p, sample);
        }
        let n = self.samples.len() as f64;
        let rms = |sum: f64| (sum / n).sqrt().to_degrees();
        Some(Errors {
            samples: self.samples.len() as u64,
            total_rmse_deg: rms(sums.total),
            heading_rmse_deg: rms(sums.heading),
            inclination_rmse_deg: rms(sums.inclination),
            greatest_deg: sums.greatest.to_degrees(),
            heading_offset_deg: (!self.heading).then(|| offset.to_degrees()),
            degrees: if self.heading { 3 } else { 2 },
            nees: sums.nees / n,
            nees_of_claim: sums.nees_of_claim / n,
            covered: sums.covered / n,
            covered_east: sums.components[0] / n,
            covered_north: sums.components[1] / n,
            covered_up: self.heading.then(|| sums.components[2] / n),
            inclination_sigma_deg: (sums.sigmas[0] / n).to_degrees(),
            heading_sigma_deg: (sums.sigmas[1] / n).to_degrees(),
            reference_std_dev_deg: self.reference.std_dev.to_degrees(),
            reference_timing_s: self.reference.timing,
        })
    }

    fn add(&self, sums: &mut Sums, estimate: &UnitQuaternion<f64>, p: &Matrix3<f64>, sample: &Sample) {
        let error = AttitudeError::of(estimate, &sample.reference);
        sums.total += error.total * error.total;
        sums.heading += error.heading * error.heading;
        sums.inclination += error.inclination * error.inclination;
        sums.greatest = sums.greatest.max(error.total);
        // R = exp(θ) R̂
        let theta = (sample.reference * estimate.inverse()).scaled_axis();
        let allowed = self.reference.std_dev.powi(2) + (self.reference.timing * sample.rate).powi(2);
        let degrees = if self.heading { 3 } else { 2 };
        let claim = squared(&theta, p, degrees);
        sums.nees += squared(&theta, &(p + Matrix3::identity() * allowed), degrees);
        sums.nees_of_claim += claim;
        sums.covered += f64::from(claim <= THREE_SIGMA[3 - degrees]);
        for i in 0..3 {
            sums.components[i] += f64::from(theta[i] * theta[i] <= 9.0 * p[(i, i)]);
        }
        sums.sigmas[0] += p[(0, 0)].max(p[(1, 1)]).max(0.0).sqrt();
        sums.sigmas[1] += p[(2, 2)].max(0.0).sqrt();
    }

    /// The constant heading φ for which Rz(−φ) q̂ is nearest to the reference: with e = q̂ q_ref⁻¹ the maximum of
    /// Σ (cos(φ/2) w + sin(φ/2) z)².
    fn offset(&self) -> f64 {
        let (mut cosine, mut sine) = (0.0, 0.0);
        for sample in &self.samples {
            let e = sample.estimate * sample.reference.inverse();
            cosine += e.w * e.w - e.k * e.k;
            sine += 2.0 * e.w * e.k;
        }
        sine.atan2(cosine)
    }
}

#[derive(Clone, Debug, Default)]
struct Sums {
    total: f64,
    heading: f64,
    inclination: f64,
    greatest: f64,
    nees: f64,
    nees_of_claim: f64,
    covered: f64,
    components: [f64; 3],
    sigmas: [f64; 2],
}

/// θᵀ P⁻¹ θ of all three or of the first two components; infinite where P cannot be inverted.
fn squared(theta: &Vector3<f64>, p: &Matrix3<f64>, degrees: usize) -> f64 {
    if degrees == 3 {
        p.cholesky().map_or(f64::INFINITY, |c| theta.dot(&c.solve(theta)))
    } else {
        let (theta, p): (Vector2<f64>, Matrix2<f64>) = (theta.xy(), p.fixed_view::<2, 2>(0, 0).into_owned());
        p.cholesky().map_or(f64::INFINITY, |c| theta.dot(&c.solve(&theta)))
    }
}
