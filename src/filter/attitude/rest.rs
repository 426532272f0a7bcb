//! Does the body rest? A window in which gyro and accelerometer spread no more than their own noise.

use std::collections::VecDeque;

use nalgebra::Vector3;

use super::RestModel;

/// Running moments of the last window.
#[derive(Clone, Debug)]
pub(super) struct Rest {
    model: RestModel,
    length: usize,
    rows: VecDeque<[f64; 6]>,
    /// Of the rows, about `origin`.
    sums: [f64; 6],
    squares: [f64; 6],
    origin: [f64; 6],
}

impl Rest {
    pub(super) fn new(model: RestModel, dt: f64) -> Rest {
        // shorter windows say nothing of a spread
        let length = ((model.window / dt).round() as usize).max(10);
        Rest {
            model,
            length,
            rows: VecDeque::with_capacity(length),
            sums: [0.0; 6],
            squares: [0.0; 6],
            origin: [0.0; 6],
        }
    }

    pub(super) fn clear(&mut self) {
        self.rows.clear();
        (self.sums, self.squares) = ([0.0; 6], [0.0; 6]);
    }

    /// The mean rate of the window, if the body rested in all of it.
    pub(super) fn push(&mut self, rate: &Vector3<f64>, force: &Vector3<f64>) -> Option<Vector3<f64>> {
        let row = [rate.x, rate.y, rate.z, force.x, force.y, force.z];
        if self.rows.is_empty() {
            self.origin = row;
        }
        if self.rows.len() == self.length
            && let Some(old) = self.rows.pop_front()
        {
            self.add(&old, -1.0);
        }
        self.rows.push_back(row);
        self.add(&row, 1.0);
        if self.rows.len() < self.length {
            return None;
        }
        let n = self.length as f64;
        let variance = |i: usize| (self.squares[i] - self.sums[i] * self.sums[i] / n) / (n - 1.0);
        let greatest = |i: usize| if i < 3 { self.model.gyro[i] } else { self.model.accelerometer };
        let rests = (0..6).all(|i| variance(i) <= greatest(i) * greatest(i));
        rests.then(|| Vector3::from_fn(|i, _| self.origin[i] + self.sums[i] / n))
    }

    fn add(&mut self, row: &[f64; 6], sign: f64) {
        for (i, value) in row.iter().enumerate() {
            let d = value - self.origin[i];
            self.sums[i] += sign * d;
            self.squares[i] += sign * d * d;
        }
    }
}
