//! Forces and moments of the air by derivatives, with stall.
//!
//! α = atan2(w, u), β = asin(v/V), p̂ = bp/2V, q̂ = cq/2V, r̂ = br/2V. CL blends the linear lift CL0 + CLα α into that
//! of a flat plate behind the stall (Beard and McLain 2012, section 4.2); drag is a parasitic part and one of the lift.
//! Rotation into body axes by α alone, the side force in body axes.

use super::{AirState, Controls, Size, Wrench};

/// Derivatives of the lift.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Lift {
    pub zero: f64,
    pub alpha: f64,
    pub pitch_rate: f64,
    pub elevator: f64,
}

/// Of the pitching moment.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Pitch {
    pub zero: f64,
    pub alpha: f64,
    pub pitch_rate: f64,
    pub elevator: f64,
}

/// Of the side force, the rolling or the yawing moment.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Lateral {
    pub zero: f64,
    pub beta: f64,
    pub p: f64,
    pub r: f64,
    pub aileron: f64,
    pub rudder: f64,
}

/// The part of the drag that lift makes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Drag {
    /// k (CL0 + CLα α)², with Oswald's factor e and the area S: k = S/(π e b²).
    Linear { factor: f64 },
    /// k (CL − CL of least drag)² of the whole lift.
    Polar { factor: f64, least: f64 },
}

/// Sharpness M and angle α0 (rad) of the blend σ = (1 + e₁ + e₂)/((1 + e₁)(1 + e₂)), e₁ = e^(−M(α − α0)), e₂ = e^(M(α +
/// α0)).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Stall {
    pub sharpness: f64,
    pub angle: f64,
    /// e^(−2Mα0), what both exponentials have in common.
    common: f64,
}

#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Aerodynamics {
    pub lift: Lift,
    pub parasitic: f64,
    pub drag: Drag,
    pub drag_pitch_rate: f64,
    pub drag_elevator: f64,
    pub pitch: Pitch,
    pub side: Lateral,
    pub roll: Lateral,
    pub yaw: Lateral,
    /// Linear lift at every angle without it.
    pub stall: Option<Stall>,
}

/// atan2(y, x); where |y| ≤ x/5, as in flight, by the series of the arctangent, of which 11 terms are the whole to
/// rounding.
#[inline(always)]
fn direction(y: f64, x: f64) -> f64 {
    if x > 0.0 && y.abs() <= 0.2 * x {
        let t = y / x;
        let z = t * t;
        let q = z * z;
        let even = 1.0 + q * (1.0 / 5.0 + q * (1.0 / 9.0 + q * (1.0 / 13.0 + q * (1.0 / 17.0 + q * (1.0 / 21.0)))));
        let odd = 1.0 / 3.0 + q * (1.0 / 7.0 + q * (1.0 / 11.0 + q * (1.0 / 15.0 + q * (1.0 / 19.0))));
        t * (even - z * odd)
    } else {
        y.atan2(x)
    }
}

impl Stall {
    pub fn new(sharpness: f64, angle: f64) -> Stall {
        Stall { sharpness, angle, common: (-2.0 * sharpness * angle).exp() }
    }

    /// σ: 0 far below the stall, 1 far above. With g = e^(M(|α| − α0)) = 1/e₁ and e₂ = g/e^(−2Mα0) it is even in α and
    /// takes one exponential and one division.
    #[inline(always)]
    pub fn blend(&self, alpha: f64) -> f64 {
        // e^600 is the largest product below; the least number there is stands against 0/0
        let g = (self.sharpness * (alpha.abs() - self.angle)).min(300.0).exp();
        let sum = g + self.common + f64::MIN_POSITIVE;
        (g * sum + self.common) / ((1.0 + g) * sum)
    }
}

impl Lateral {
    #[inline(always)]
    fn at(&self, beta: f64, p: f64, r: f64, controls: &Controls) -> f64 {
        self.zero
            + self.beta * beta
            + self.p * p
            + self.r * r
            + self.aileron * controls.aileron
            + self.rudder * controls.rudder
    }
}

impl Aerodynamics {
    /// CL and CD at an angle of attack (rad), a pitch rate q̂ and an elevator (rad).
    pub fn lift_and_drag(&self, alpha: f64, q: f64, elevator: f64) -> (f64, f64) {
        self.along_and_across(alpha, alpha.sin_cos(), q, elevator)
    }

    /// The same with sine and cosine of α beside it.
    #[inline(always)]
    fn along_and_across(&self, alpha: f64, (sin, cos): (f64, f64), q: f64, elevator: f64) -> (f64, f64) {
        let linear = self.lift.zero + self.lift.alpha * alpha;
        let steady = match &self.stall {
            None => linear,
            Some(stall) => {
                let part = stall.blend(alpha);
                // sign(α) sin²α = |sin α| sin α
                (1.0 - part) * linear + part * 2.0 * sin.abs() * sin * cos
            }
        };
        let lift = steady + self.lift.pitch_rate * q + self.lift.elevator * elevator;
        let of_lift = match self.drag {
            Drag::Linear { factor } => factor * linear * linear,
            Drag::Polar { factor, least } => factor * (lift - least) * (lift - least),
        };
        (lift, self.parasitic + of_lift + self.drag_pitch_rate * q + self.drag_elevator * elevator)
    }

    /// Of the air alone; `speed` is the length of the velocity.
    #[inline(always)]
    pub(super) fn forces(&self, size: &Size, air: &AirState, speed: f64, controls: &Controls, density: f64) -> Wrench {
        let [u, v, w] = air.velocity;
        if speed == 0.0 {
            return Wrench::default();
        }
        let per_speed = 1.0 / speed;
        let along = (u * u + w * w).sqrt();
        // asin(v/V) by both sides of its triangle, which rounding cannot leave
        let per_along = 1.0 / along;
        let (alpha, beta) = (direction(w, u), direction(v, along));
        let (sin, cos) = if along > 0.0 { (w * per_along, u * per_along) } else { (0.0, 1.0) };
        let half = 0.5 * per_speed;
        let [p, q, r] = [size.span, size.chord, size.span].map(|length| length * half);
        let (p, q, r) = (p * air.rate[0], q * air.rate[1], r * air.rate[2]);
        let (lift, drag) = self.along_and_across(alpha, (sin, cos), q, controls.elevator);
        let pitch = self.pitch.zero
            + self.pitch.alpha * alpha
            + self.pitch.pitch_rate * q
            + self.pitch.elevator * controls.elevator;
        let [side, roll, yaw] = [&self.side, &self.roll, &self.yaw].map(|d| d.at(beta, p, r, controls));
        let pressure = 0.5 * density * speed * speed * size.area;
        Wrench {
            force: [pressure * (lift * sin - drag * cos), pressure * side, pressure * (-lift * cos - drag * sin)],
            moment: [pressure * size.span * roll, pressure * size.chord * pitch, pressure * size.span * yaw],
        }
    }
}

#[cfg(test)]
mod tests {
    use super::{Stall, direction};

    /// The published form, where it has no product of large numbers, and the ends where it has.
    #[test]
    fn the_blend_is_the_published_one() {
        for (sharpness, angle) in [(50.0, 0.47), (5.0, 0.2), (0.5, 0.05)] {
            let stall = Stall::new(sharpness, angle);
            for i in -150..=150 {
                let alpha = f64::from(i) * 0.01;
                let [a, b] = [(-sharpness * (alpha - angle)).exp(), (sharpness * (alpha + angle)).exp()];
                let expected = (1.0 + a + b) / ((1.0 + a) * (1.0 + b));
                let found = stall.blend(alpha);
                assert!((found - expected).abs() <= 1e-13 * expected, "{sharpness} {alpha}: {found} {expected}");
            }
        }
        let sharp = Stall::new(5000.0, 0.3);
        assert_eq!(
            [0.0, 0.29, 0.31, -3.0, 3.0].map(|alpha| sharp.blend(alpha) > 0.5),
            [false, false, true, true, true]
        );
        assert!([0.0, 0.3, 3.0].iter().all(|alpha| (0.0..=1.0).contains(&sharp.blend(*alpha))));
    }

    /// To two units in the last place, on both sides of where the series ends, and where there is no direction.
    #[test]
    fn a_direction_is_that_of_the_library() {
        for i in -4000..=4000 {
            for x in [25.0, 1e-3, -2.0] {
                let y = f64::from(i) * 1e-4 * x;
                let (found, expected) = (direction(y, x), y.atan2(x));
                assert!((found - expected).abs() <= 4.5e-16 * expected.abs(), "{y} {x}: {found} {expected}");
            }
        }
        assert_eq!([direction(0.0, 0.0), direction(1.0, 0.0)], [0.0, std::f64::consts::FRAC_PI_2]);
        assert!(direction(f64::NAN, 1.0).is_nan() && direction(1.0, f64::NAN).is_nan());
    }
}
