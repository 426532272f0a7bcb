//! The running filter.

use nalgebra::{DMatrix, DVector, Matrix3, UnitQuaternion, Vector3};

use super::rest::Rest;
use super::{AttitudeModel, Layout, covariance};

/// Before the first alignment: inclination 10 deg beside it, acceleration 1 m/s², heading uniform over the circle.
const FIRST_INCLINATION: f64 = 10.0 * std::f64::consts::PI / 180.0;
const FIRST_ACCELERATION: f64 = 1.0;
const ANY_ANGLE: f64 = std::f64::consts::PI / 1.732_050_807_568_877_2;
/// |sine of the pitch| beyond which a measured yaw angle says nothing.
const STEEP: f64 = 0.98;
/// A field this much steeper than it is horizontal has no heading.
const VERTICAL: f64 = 0.02;

/// One row of a log, SI; a part that is not a number is missing.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Row {
    pub rate: Vector3<f64>,
    pub force: Vector3<f64>,
    pub heading: Option<Heading>,
}

/// A measured heading.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Heading {
    /// A vector in the body that points north and up or down, of any size: the magnetic field.
    Field(Vector3<f64>),
    /// The yaw angle in rad: that of the body's x axis, from east towards north.
    Yaw(f64),
}

/// What a row did.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Taken {
    /// Innovations over their sigma: force towards east, towards north, heading.
    pub normalised: [Option<f64>; 3],
    /// The gyro was taken as its own drift.
    pub rest: bool,
}

/// Attitude, error states and covariance in progress.
#[derive(Clone, Debug)]
pub struct Mekf {
    model: AttitudeModel,
    layout: Layout,
    attitude: Option<UnitQuaternion<f64>>,
    x: DVector<f64>,
    p: DMatrix<f64>,
    /// F and the noise of a step of each horizontal acceleration, for a size of 1.
    motion: (DMatrix<f64>, DMatrix<f64>),
    last_rate: Vector3<f64>,
    last_field: Option<Vector3<f64>>,
    rest: Rest,
    vertical: Witness,
    field: Field,
    scratch: Scratch,
}

#[derive(Clone, Debug)]
struct Scratch {
    /// −R̂ dt times what turns with the gyro states and C.
    a: DMatrix<f64>,
    /// P Aᵀ.
    w: DMatrix<f64>,
    ph: DVector<f64>,
    k: DVector<f64>,
    /// Of a block of states: F x, P Fᵀ.
    moved: Vec<f64>,
    columns: Vec<f64>,
}

/// Mean square of the vertical acceleration.
#[derive(Clone, Copy, Debug, Default)]
struct Witness {
    mean_square: f64,
    count: f64,
}

/// The field of reference and how far the field is from it.
#[derive(Clone, Copy, Debug, Default)]
struct Field {
    /// Horizontal and vertical part, smoothed deviations from it.
    reference: [f64; 2],
    deviation: [f64; 2],
    count: f64,
    /// Square of the disturbance that is seen, rad².
    size: f64,
    /// Share of the heading that the inclination error about north carries over, rad².
    leak: f64,
    /// Since the last one, s.
    since: f64,
}

impl Mekf {
    pub fn new(model: &AttitudeModel) -> Mekf {
        let layout = model.layout();
        let n = layout.states;
        let mut x = DVector::zeros(n);
        let mut p = DMatrix::zeros(n, n);
        for i in 0..3 {
            let sigma = if i < 2 { FIRST_INCLINATION } else { ANY_ANGLE };
            p[(i, i)] = sigma * sigma;
            let (first, gyro) = (layout.gyro[i], &model.gyro[i]);
            let size = gyro.states.len();
            x.rows_mut(first, size).copy_from(&gyro.x0);
            p.view_mut((first, first), (size, size)).copy_from(&gyro.p0);
            p[(layout.force_bias + i, layout.force_bias + i)] = model.accelerometer.bias_std_dev.powi(2);
        }
        for i in layout.scale..layout.scale + 9 {
            p[(i, i)] = model.scale_std_dev.powi(2);
        }
        let (f, stationary) = model.acceleration.process(model.dt);
        let gained = &stationary - &f * &stationary * f.transpose();
        for first in [layout.motion, layout.motion + 2] {
            p.view_mut((first, first), (2, 2)).copy_from(&(&stationary * FIRST_ACCELERATION.powi(2)));
        }
        if let Some(heading) = &model.heading {
            p[(layout.heading, layout.heading)] = heading.disturbance.powi(2);
            p[(layout.heading + 1, layout.heading + 1)] = heading.delay_std_dev.powi(2);
        }
        let turning = layout.force_bias - 3;
        Mekf {
            scratch: Scratch {
                a: DMatrix::zeros(3, turning),
                w: DMatrix::zeros(n, 3),
                ph: DVector::zeros(n),
                k: DVector::zeros(n),
                moved: vec![0.0; n],
                columns: vec![0.0; n * n],
            },
            rest: Rest::new(model.rest, model.dt),
            model: model.clone(),
            layout,
            attitude: None,
            x,
            p,
            motion: (f, gained),
            last_rate: Vector3::zeros(),
            last_field: None,
            vertical: Witness::default(),
            field: Field::default(),
        }
    }

    /// From the body to the earth; none before the first specific force.
    pub fn attitude(&self) -> Option<UnitQuaternion<f64>> {
        self.attitude
    }

    /// Of the rotation error about east, north and up, rad².
    pub fn attitude_covariance(&self) -> Matrix3<f64> {
        Matrix3::from_fn(|i, j| self.p[(i, j)])
    }

    /// Drift of each gyro axis with its sigma, rad/s.
    pub fn drift(&self) -> [(f64, f64); 3] {
        std::array::from_fn(|axis| {
            let (first, h) = (self.layout.gyro[axis], &self.model.gyro[axis].h);
            let n = h.ncols();
            let value = (0..n).map(|i| h[(0, i)] * self.x[first + i]).sum();
            let pairs = (0..n).flat_map(|i| (0..n).map(move |j| (i, j)));
            let variance: f64 = pairs.map(|(i, j)| h[(0, i)] * h[(0, j)] * self.p[(first + i, first + j)]).sum();
            (value, variance.max(0.0).sqrt())
        })
    }

    /// Estimates of the error states; the first three are zero, since they have been given to the attitude.
    pub fn states(&self) -> &DVector<f64> {
        &self.x
    }

    pub fn covariance(&self) -> &DMatrix<f64> {
        &self.p
    }

    /// The next row, before which `missing` rows are missing.
    pub fn step(&mut self, row: &Row, missing: u64) -> Taken {
        let usable = row.rate.iter().all(|v| v.is_finite());
        let force = Some(row.force).filter(|f| f.iter().all(|v| v.is_finite()) && f.norm() > 0.0);
        if self.attitude.is_none() {
            let Some(force) = force.filter(|_| usable) else { return Taken::default() };
            // the shortest turn that brings the specific force up
            self.attitude = UnitQuaternion::rotation_between(&force, &Vector3::z())
                .or_else(|| Some(UnitQuaternion::from_axis_angle(&Vector3::x_axis(), std::f64::consts::PI)));
            self.last_rate = row.rate;
        } else {
            if missing > 0 || !usable {
                self.rest.clear();
            }
            self.coast(missing + u64::from(!usable));
            if usable {
                self.predict(&row.rate);
                self.last_rate = row.rate;
            }
        }
        let mut taken = Taken::default();
        let Some(attitude) = self.attitude else { return taken };
        let turn = *attitude.to_rotation_matrix().matrix();
        if let Some(force) = force {
            let [east, north] = self.update_force(&turn, &force);
            (taken.normalised[0], taken.normalised[1]) = (Some(east), Some(north));
        }
        taken.normalised[2] = match row.heading {
            Some(Heading::Field(field)) => self.update_field(&turn, &field),
            Some(Heading::Yaw(yaw)) => self.update_yaw(&turn, yaw),
            None => None,
        };
        if let Some(mean) = force.filter(|_| usable).and_then(|force| self.rest.push(&row.rate, &force)) {
            taken.rest = self.update_rest(&row.rate, &mean);
        }
        let error = Vector3::new(self.x[0], self.x[1], self.x[2]);
        let mut turned = UnitQuaternion::from_scaled_axis(error) * attitude;
        turned.renormalize_fast();
        self.attitude = Some(turned);
        self.x.rows_mut(0, 3).fill(0.0);
        taken
    }

    /// Rows without a rate: the last one is held, and may be wrong by its own size.
    fn coast(&mut self, rows: u64) {
        if rows == 0 {
            return;
        }
        let rate = self.last_rate;
        // after half a turn of possible error nothing is known of the attitude that more rows would change
        let steps = rows.min(1_000_000);
        (0..steps).for_each(|_| self.predict(&rate));
        let spread = (rate.norm() * steps as f64 * self.model.dt).min(ANY_ANGLE);
        for i in 0..3 {
            self.p[(i, i)] += spread * spread;
        }
    }

    /// The measured rate less its errors.
    fn rate(&self, measured: &Vector3<f64>) -> Vector3<f64> {
        let c = self.layout.scale;
        Vector3::from_fn(|i, _| {
            let (first, h) = (self.layout.gyro[i], &self.model.gyro[i].h);
            let drift: f64 = (0..h.ncols()).map(|s| h[(0, s)] * self.x[first + s]).sum();
            let scale: f64 = (0..3).map(|k| self.x[c + 3 * i + k] * measured[k]).sum();
            measured[i] - drift - scale
        })
    }

    fn predict(&mut self, measured: &Vector3<f64>) {
        let Some(attitude) = self.attitude else { return };
        let dt = self.model.dt;
        let rate = self.rate(measured);
        let half = attitude * UnitQuaternion::from_scaled_axis(rate * (0.5 * dt));
        self.attitude = Some(attitude * UnitQuaternion::from_scaled_axis(rate * dt));
        let turn = *half.to_rotation_matrix().matrix();
        self.turn_covariance(&turn, measured);
        self.propagate_states();
        let motion = (self.model.motion_density * measured.norm()).powi(2) * dt;
        let white = Matrix3::from_diagonal(&Vector3::from_fn(|i, _| self.model.gyro[i].r[(0, 0)] * dt * dt));
        let noise = turn * white * turn.transpose() + Matrix3::identity() * motion;
        for i in 0..3 {
            for j in 0..3 {
                self.p[(i, j)] += noise[(i, j)];
            }
        }
    }

    /// P of the rotation, with A = −R̂ dt ∂(drift + C g): P_θθ + A P_xθ + P_θx Aᵀ + A P_xx Aᵀ and P_θx + A P_xx.
    fn turn_covariance(&mut self, turn: &Matrix3<f64>, measured: &Vector3<f64>) {
        let Scratch { a, w, .. } = &mut self.scratch;
        let dt = self.model.dt;
        for axis in 0..3 {
            let (first, h) = (self.layout.gyro[axis], &self.model.gyro[axis].h);
            for i in 0..3 {
                for s in 0..h.ncols() {
                    a[(i, first - 3 + s)] = -turn[(i, axis)] * h[(0, s)] * dt;
                }
                for k in 0..3 {
                    a[(i, self.layout.scale - 3 + 3 * axis + k)] = -turn[(i, axis)] * measured[k] * dt;
                }
            }
        }
        covariance::turn(self.p.as_mut_slice(), a.as_slice(), w.as_mut_slice());
    }

    /// x and P of every state but the rotation, block by block.
    fn propagate_states(&mut self) {
        let Mekf { model, layout, x, p, motion, vertical, field, scratch, .. } = self;
        let mut block = |first: usize, f: &DMatrix<f64>, q: &DMatrix<f64>, size: f64| {
            let m = f.nrows();
            let moved = &mut scratch.moved[..m];
            for (i, moved) in moved.iter_mut().enumerate() {
                *moved = (0..m).map(|j| f[(i, j)] * x[first + j]).sum();
            }
            x.as_mut_slice()[first..first + m].copy_from_slice(moved);
            let n = x.len();
            covariance::propagate(p.as_mut_slice(), n, first, f.as_slice(), q.as_slice(), size, &mut scratch.columns);
        };
        for (gyro, &first) in model.gyro.iter().zip(&layout.gyro) {
            block(first, &gyro.f, &gyro.q, 1.0);
        }
        let size = model.acceleration.std_dev.powi(2) + model.acceleration.ratio.powi(2) * vertical.mean_square;
        let (f, gained) = motion;
        for first in [layout.motion, layout.motion + 2] {
            block(first, f, gained, size);
        }
        field.since += model.dt;
        if let Some(heading) = &model.heading {
            let decay = (-model.dt / heading.correlation_time).exp();
            let size = heading.disturbance.powi(2) + field.size + field.leak;
            let gained = -(-2.0 * model.dt / heading.correlation_time).exp_m1() * size;
            let i = layout.heading;
            x[i] *= decay;
            p.row_mut(i).scale_mut(decay);
            p.column_mut(i).scale_mut(decay);
            p[(i, i)] += gained;
        }
    }

    fn update_force(&mut self, turn: &Matrix3<f64>, force: &Vector3<f64>) -> [f64; 2] {
        let g = self.model.gravity;
        let f = turn * force;
        let gain = smoothing(self.model.dt, self.model.acceleration.memory, &mut self.vertical.count);
        self.vertical.mean_square += gain * ((f.z - g).powi(2) - self.vertical.mean_square);
        let (bias, motion) = (self.layout.force_bias, self.layout.motion);
        let variance = self.model.accelerometer.variance;
        [0, 1].map(|c| {
            // f̂ = f − θ × g e_z: −g θ_y towards east, g θ_x towards north
            let of_rotation = if c == 0 { (1, -g) } else { (0, g) };
            let h = [
                of_rotation,
                (motion + 2 * c + 1, 1.0),
                (bias, turn[(c, 0)]),
                (bias + 1, turn[(c, 1)]),
                (bias + 2, turn[(c, 2)]),
            ];
            self.update(&h, f[c], variance, |_| true)
        })
    }

    fn update_field(&mut self, turn: &Matrix3<f64>, field: &Vector3<f64>) -> Option<f64> {
        let heading = self.model.heading.as_ref()?;
        // a value that is held is no new measurement
        if !field.iter().all(|v| v.is_finite()) || self.last_field == Some(*field) {
            return None;
        }
        self.last_field = Some(*field);
        let m = turn * field;
        let horizontal = m.x.hypot(m.y);
        if horizontal <= VERTICAL * m.norm() {
            return None;
        }
        let state = &mut self.field;
        let dt = std::mem::take(&mut state.since);
        let gain = smoothing(dt, heading.reference_time, &mut state.count);
        let first = state.count == 1.0;
        let attack = if first { 1.0 } else { -(-20.0 * dt / heading.memory).exp_m1() };
        for (part, value) in [horizontal, m.z].into_iter().enumerate() {
            state.reference[part] += gain * (value - state.reference[part]);
            state.deviation[part] += attack * (value - state.reference[part] - state.deviation[part]);
        }
        let strength = state.reference[0].abs().max(f64::MIN_POSITIVE);
        let white = heading.std_dev.powi(2) * attack / (2.0 - attack);
        let seen = state.deviation.iter().map(|d| (d / strength).powi(2)).sum::<f64>() / 2.0 - white;
        let release = -(-dt / heading.memory).exp_m1();
        state.size = seen.max(state.size + release * (seen - state.size)).max(0.0);
        let dip = m.z / horizontal;
        state.leak = dip * dip * self.p[(1, 1)];
        let rate = turn * self.rate(&self.last_rate);
        let jitter = heading.jitter * self.last_rate.norm() * m.norm() / horizontal;
        let variance = heading.std_dev.powi(2) + jitter * jitter;
        Some(self.update_heading(m.x.atan2(m.y), rate.y * dip - rate.z, variance))
    }

    fn update_yaw(&mut self, turn: &Matrix3<f64>, yaw: f64) -> Option<f64> {
        let heading = self.model.heading.as_ref()?;
        if !yaw.is_finite() || turn[(2, 0)].abs() > STEEP {
            return None;
        }
        let difference = yaw - turn[(1, 0)].atan2(turn[(0, 0)]);
        let difference = difference - (difference / std::f64::consts::TAU).round() * std::f64::consts::TAU;
        let rate = turn * self.rate(&self.last_rate);
        let variance = heading.std_dev.powi(2) + (heading.jitter * self.last_rate.norm()).powi(2);
        Some(self.update_heading(difference, -rate.z, variance))
    }

    /// θ_z + d + τ (turn of the heading).
    fn update_heading(&mut self, difference: f64, per_delay: f64, variance: f64) -> f64 {
        let Layout { scale, heading, .. } = self.layout;
        let h = [(2, 1.0), (heading, 1.0), (heading + 1, per_delay)];
        self.update(&h, difference, variance, |i| (2..scale).contains(&i) || i >= heading)
    }

    /// The rate is the drift; not when the mean of the window is too far from it to be at rest.
    fn update_rest(&mut self, rate: &Vector3<f64>, mean: &Vector3<f64>) -> bool {
        let drift = self.drift();
        let far = |i: usize| {
            let of_mean = (self.model.gyro[i].r[(0, 0)] * self.model.dt / self.model.rest.window).sqrt();
            let (value, sigma) = drift[i];
            (mean[i] - value).abs() > self.model.outlier * (sigma + of_mean)
        };
        if (0..3).any(far) {
            return false;
        }
        for axis in 0..3 {
            let (first, gyro) = (self.layout.gyro[axis], &self.model.gyro[axis]);
            let h: Vec<(usize, f64)> = (0..gyro.h.ncols()).map(|s| (first + s, gyro.h[(0, s)])).collect();
            let variance = gyro.r[(0, 0)];
            self.update(&h, rate[axis], variance, |_| true);
        }
        true
    }

    /// One scalar measurement z = Σ h x + noise with a gain on the states of `gains` alone: P − k (P h)ᵀ − (P h) kᵀ +
    /// S k kᵀ, which is Joseph's form for any gain k. Gives the innovation over its sigma.
    fn update(&mut self, h: &[(usize, f64)], z: f64, variance: f64, gains: impl Fn(usize) -> bool) -> f64 {
        let Scratch { ph, k, .. } = &mut self.scratch;
        let (x, p) = (&mut self.x, &mut self.p);
        let n = x.len();
        ph.fill(0.0);
        for &(i, value) in h {
            ph.axpy(value, &p.column(i), 1.0);
        }
        let innovation = z - h.iter().map(|&(i, value)| value * x[i]).sum::<f64>();
        let s = h.iter().map(|&(i, value)| value * ph[i]).sum::<f64>() + variance;
        let normalised = innovation / s.sqrt();
        // an innovation that is too large is as if its variance were so much larger that it is at the bound
        let inflated = s.max((innovation / self.model.outlier).powi(2));
        for i in 0..n {
            k[i] = if gains(i) { ph[i] / inflated } else { 0.0 };
        }
        x.axpy(innovation, k, 1.0);
        covariance::take_in(p.as_mut_slice(), k.as_slice(), ph.as_mut_slice(), inflated);
        normalised
    }
}

/// Weight of the newest value in a mean over `memory` seconds that begins as the plain mean.
fn smoothing(dt: f64, memory: f64, count: &mut f64) -> f64 {
    *count += 1.0;
    (1.0 / *count).max(-(-dt / memory).exp_m1())
}
