//! The filter in two stages while its gains still change: covariance carried, everything in registers.

use pulp::NullaryFnOnce;

use super::usable;
use crate::filter::kalman::{predict_fixed, update_fixed};

/// Steps between looks at whether the gains stand still, and variances whose product, each over R, is taken before
/// its logarithm: up to 1e19 times R cannot make it overflow.
pub(super) const LOOK: usize = 16;

/// `N` states beside the bias, started: the state is that after an update.
pub(super) struct Approach<'a, const N: usize> {
    /// F, Q by columns, h, R; F of the bias into the states, h of the bias.
    pub(super) f: [[f64; N]; N],
    pub(super) q: [[f64; N]; N],
    pub(super) h: [f64; N],
    pub(super) r: f64,
    pub(super) couple: [f64; N],
    pub(super) seen: f64,
    pub(super) x: &'a mut [f64; N],
    pub(super) p: &'a mut [[f64; N]; N],
    /// How the states answer to the bias; b̂ and its information.
    pub(super) answer: &'a mut [f64; N],
    pub(super) bias: &'a mut f64,
    pub(super) information: &'a mut f64,
    pub(super) z: &'a [f64],
    pub(super) innovation: &'a mut [f64],
    pub(super) weight: &'a mut [f64],
}

/// How far it came.
pub(super) struct Came {
    pub(super) samples: usize,
    pub(super) log_variance: f64,
    pub(super) nis: f64,
    /// The last step changed neither covariance nor answer by more than a few roundings.
    pub(super) settled: bool,
}

impl<const N: usize> NullaryFnOnce for Approach<'_, N> {
    type Output = Came;
    /// Whole looks only, up to one with a sample that cannot be used.
    #[inline(always)]
    fn call(self) -> Came {
        let mut came = Came { samples: 0, log_variance: 0.0, nis: 0.0, settled: false };
        let (mut x, mut p, mut answer) = (*self.x, *self.p, *self.answer);
        let (mut bias, mut information) = (*self.bias, *self.information);
        let inverse_r = 1.0 / self.r;
        let looks = self.z.as_chunks::<LOOK>().0.iter().zip(self.innovation.as_chunks_mut::<LOOK>().0);
        for ((z, innovation), weight) in looks.zip(self.weight.as_chunks_mut::<LOOK>().0) {
            if !z.iter().all(|z| usable(*z)) || came.settled {
                break;
            }
            let (mut product, mut before) = (1.0, (p, answer));
            for ((z, innovation), weight) in z.iter().zip(innovation).zip(weight) {
                before = (p, answer);
                predict_fixed(&self.f, &self.q, &mut x, &mut p);
                let mut next = self.couple;
                for (k, answer) in answer.iter().enumerate() {
                    for (next, f) in next.iter_mut().zip(&self.f[k]) {
                        *next += f * answer;
                    }
                }
                let s = self.seen + self.h.iter().zip(&next).map(|(h, a)| h * a).sum::<f64>();
                let rest = update_fixed(&self.h, self.r, *z, f64::INFINITY, &mut x, &mut p);
                // K = P(k|k) hᵀ/R
                let drop = s / self.r;
                for (i, next) in next.iter_mut().enumerate() {
                    *next -= drop * (0..N).map(|j| p[j][i] * self.h[j]).sum::<f64>();
                }
                answer = next;
                let inverse = 1.0 / rest.variance;
                let variance = rest.variance + s * s / information;
                *innovation = rest.innovation - s * bias;
                *weight = 1.0 / variance;
                information += s * s * inverse;
                bias += s * inverse / information * *innovation;
                product *= variance * inverse_r;
                came.nis += *innovation * *innovation * *weight;
            }
            came.log_variance += product.ln() - LOOK as f64 * inverse_r.ln();
            came.samples += LOOK;
            came.settled = still(&before.0, &p, &before.1, &answer);
        }
        (*self.x, *self.p, *self.answer) = (x, p, answer);
        (*self.bias, *self.information) = (bias, information);
        came
    }
}

/// No entry of P differs from that of the step before by more than four roundings of its diagonal, nor the answer by
/// four of its own.
#[inline(always)]
fn still<const N: usize>(before: &[[f64; N]; N], now: &[[f64; N]; N], answered: &[f64; N], answer: &[f64; N]) -> bool {
    const ROUNDINGS: f64 = 4.0 * f64::EPSILON;
    let covariance = (0..N).all(|i| {
        (0..=i).all(|j| {
            let change = (now[j][i] - before[j][i]) / ROUNDINGS;
            change * change <= now[i][i] * now[j][j]
        })
    });
    covariance && answer.iter().zip(answered).all(|(a, b)| (a - b).abs() <= ROUNDINGS * a.abs())
}
