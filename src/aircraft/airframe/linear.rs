//! Small motions about a steady flight: ẋ = A x + B u + E g.
//!
//! With V the velocity and ω the rate in body axes, V̇ = F/m + g_b − ω×V, J ω̇ = M − ω×(Jω), φ̇ = p + tan θ (q sin φ +
//! r cos φ), θ̇ = q cos φ − r sin φ (Stevens, Lewis and Johnson 2016, section 1.7); F and M belong to the motion
//! relative to the air, so that a gust enters as its negative there and nowhere else: E holds the negative columns of A
//! without gravity and without the ω×V part. The density stays that of the trim.

use nalgebra::DMatrix;

use super::trim::Trim;
use super::{AirState, Airplane, Controls, Inertia, Propulsion};
use crate::aircraft::atmosphere::standard;

/// A state, an input or a gust: name and SI unit.
pub type Port = (&'static str, &'static str);

/// Names and units of the eight states; the first four are longitudinal.
pub const STATES: [Port; 8] = [
    ("u", "m/s"),
    ("w", "m/s"),
    ("q", "rad/s"),
    ("theta", "rad"),
    ("v", "m/s"),
    ("p", "rad/s"),
    ("r", "rad/s"),
    ("phi", "rad"),
];
/// Of the gusts; the first three are longitudinal.
pub const GUSTS: [Port; 6] =
    [("u_g", "m/s"), ("w_g", "m/s"), ("q_g", "rad/s"), ("v_g", "m/s"), ("p_g", "rad/s"), ("r_g", "rad/s")];

/// ẋ = A x + B u + E g, deviations from the trim, SI.
#[derive(Clone, Debug, PartialEq)]
pub struct LinearModel {
    pub name: &'static str,
    pub states: Vec<Port>,
    pub inputs: Vec<Port>,
    pub gusts: Vec<Port>,
    pub a: DMatrix<f64>,
    pub b: DMatrix<f64>,
    pub e: DMatrix<f64>,
}

/// The eight states together and its two diagonal blocks.
#[derive(Clone, Debug, PartialEq)]
pub struct LinearModels {
    pub longitudinal: LinearModel,
    pub lateral: LinearModel,
    pub full: LinearModel,
}

impl LinearModels {
    pub fn all(&self) -> [&LinearModel; 3] {
        [&self.longitudinal, &self.lateral, &self.full]
    }
}

/// State, controls and gust of the eight-state motion.
#[derive(Clone, Copy)]
struct Point {
    state: [f64; 8],
    controls: [f64; 4],
    gust: [f64; 6],
}

impl Trim {
    /// m/s.
    pub fn airspeed(&self) -> f64 {
        self.velocity.iter().map(|v| v * v).sum::<f64>().sqrt()
    }
}

impl Inertia {
    /// xx, yy, zz, xz of J⁻¹ with J = [xx 0 −xz; 0 yy 0; −xz 0 zz].
    pub fn inverse(&self) -> [f64; 4] {
        let per_determinant = 1.0 / (self.xx * self.zz - self.xz * self.xz);
        [self.zz * per_determinant, 1.0 / self.yy, self.xx * per_determinant, self.xz * per_determinant]
    }

    /// ω̇ of J ω̇ = M − ω×(Jω), with the inverse of J.
    #[inline(always)]
    pub fn acceleration(&self, inverse: &[f64; 4], moment: [f64; 3], [p, q, r]: [f64; 3]) -> [f64; 3] {
        let [hx, hy, hz] = [self.xx * p - self.xz * r, self.yy * q, self.zz * r - self.xz * p];
        let l = moment[0] - (q * hz - r * hy);
        let m = moment[1] - (r * hx - p * hz);
        let n = moment[2] - (p * hy - q * hx);
        let [xx, yy, zz, xz] = *inverse;
        [xx * l + xz * n, yy * m, xz * l + zz * n]
    }
}

impl Airplane {
    /// Elevator, throttle (or thrust), aileron, rudder: names and units in the order of the full model.
    pub fn inputs(&self) -> [Port; 4] {
        let engine = match self.propulsion {
            Propulsion::Thrust { .. } => ("thrust", "N"),
            Propulsion::Motor(_) => ("throttle", "1"),
        };
        [("elevator", "rad"), engine, ("aileron", "rad"), ("rudder", "rad")]
    }

    fn rates(&self, at: &Point, density: f64) -> [f64; 8] {
        let [u, w, q, theta, v, p, r, phi] = at.state;
        let [ug, wg, qg, vg, pg, rg] = at.gust;
        let [elevator, throttle, aileron, rudder] = at.controls;
        let air = AirState { velocity: [u - ug, v - vg, w - wg], rate: [p - pg, q - qg, r - rg] };
        let wrench = self.forces(&air, &Controls { elevator, aileron, rudder, throttle }, density);
        let [fx, fy, fz] = wrench.force.map(|f| f / self.mass);
        let ((sf, cf), (st, ct)) = (phi.sin_cos(), theta.sin_cos());
        let g = standard::GRAVITY;
        let [p_dot, q_dot, r_dot] = self.inertia.acceleration(&self.inertia.inverse(), wrench.moment, [p, q, r]);
        [
            fx - g * st - (q * w - r * v),
            fz + g * cf * ct - (p * v - q * u),
            q_dot,
            q * cf - r * sf,
            fy + g * sf * ct - (r * u - p * w),
            p_dot,
            r_dot,
            p + st / ct * (q * sf + r * cf),
        ]
    }

    /// A, B and E at a trim by central differences with three steps, extrapolated to step zero twice (Richardson): the
    /// error is of order six in the step, below 1e-9 of the largest entry of a row for derivatives that change over
    /// more than a tenth of the angles.
    pub fn linear(&self, trim: &Trim) -> LinearModels {
        let ([u, v, w], [p, q, r]) = (trim.velocity, trim.rate);
        let c = trim.controls;
        let at = Point {
            state: [u, w, q, trim.theta, v, p, r, trim.phi],
            controls: [c.elevator, c.throttle, c.aileron, c.rudder],
            gust: [0.0; 6],
        };
        let speed = (u * u + v * v + w * w).sqrt();
        let weight = self.mass * standard::GRAVITY;
        // a step turns the flow, or the airplane, by a thousandth
        let step = |unit: &str| {
            1e-3 * match unit {
                "m/s" => speed,
                "N" => weight,
                _ => 1.0,
            }
        };
        let inputs = self.inputs();
        let columns = |ports: &[Port], of: fn(&mut Point) -> &mut [f64]| {
            let mut out = DMatrix::zeros(8, ports.len());
            for (j, (_, unit)) in ports.iter().enumerate() {
                let difference = |h: f64| -> [f64; 8] {
                    let (mut ahead, mut behind) = (at, at);
                    of(&mut ahead)[j] += h;
                    of(&mut behind)[j] -= h;
                    let (a, b) = (self.rates(&ahead, trim.density), self.rates(&behind, trim.density));
                    std::array::from_fn(|i| (a[i] - b[i]) / (2.0 * h))
                };
                let h = step(unit);
                let [d1, d2, d4] = [h, 0.5 * h, 0.25 * h].map(difference);
                let limit: [f64; 8] = std::array::from_fn(|i| {
                    let (once, again) = ((4.0 * d2[i] - d1[i]) / 3.0, (4.0 * d4[i] - d2[i]) / 3.0);
                    (16.0 * again - once) / 15.0
                });
                out.column_mut(j).copy_from_slice(&limit);
            }
            out
        };
        let full = LinearModel {
            name: "full",
            states: STATES.to_vec(),
            a: columns(&STATES, |p| &mut p.state),
            b: columns(&inputs, |p| &mut p.controls),
            e: columns(&GUSTS, |p| &mut p.gust),
            inputs: inputs.to_vec(),
            gusts: GUSTS.to_vec(),
        };
        let part = |name: &'static str, state: usize, input: usize, gust: usize| LinearModel {
            name,
            states: STATES[state..state + 4].to_vec(),
            inputs: inputs[input..input + 2].to_vec(),
            gusts: GUSTS[gust..gust + 3].to_vec(),
            a: full.a.view((state, state), (4, 4)).into_owned(),
            b: full.b.view((state, input), (4, 2)).into_owned(),
            e: full.e.view((state, gust), (4, 3)).into_owned(),
        };
        LinearModels { longitudinal: part("longitudinal", 0, 0, 0), lateral: part("lateral", 4, 2, 3), full }
    }
}

impl LinearModel {
    /// The model in states with velocities divided by `speed`, so that every state is an angle or a rate.
    #[must_use]
    pub fn in_angles(&self, speed: f64) -> LinearModel {
        let scale: Vec<f64> = self.states.iter().map(|s| if s.1 == "m/s" { speed } else { 1.0 }).collect();
        let mut model = self.clone();
        for (i, by) in scale.iter().enumerate() {
            for matrix in [&mut model.a, &mut model.b, &mut model.e] {
                matrix.row_mut(i).scale_mut(1.0 / by);
            }
        }
        for (j, by) in scale.iter().enumerate() {
            model.a.column_mut(j).scale_mut(*by);
        }
        model
    }

    pub fn state(&self, name: &str) -> Option<usize> {
        self.states.iter().position(|s| s.0 == name)
    }
}
