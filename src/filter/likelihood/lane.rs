//! One number of each of several models, side by side, so that one instruction serves them all.

use std::ops::{Add, AddAssign, Div, Mul, MulAssign, Sub};

/// Models side by side: as many numbers as the widest registers hold, or twice or four times what narrower ones do.
pub(super) const LANES: usize = 8;

/// Lanes never mix, so numbers do not depend on how many of them a register holds.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Lane(pub(super) [f64; LANES]);

impl Lane {
    pub(super) const ZERO: Lane = Lane([0.0; LANES]);

    #[inline(always)]
    pub(super) fn all(value: f64) -> Lane {
        Lane([value; LANES])
    }

    #[inline(always)]
    fn with(mut self, other: Lane, of: impl Fn(f64, f64) -> f64) -> Lane {
        for (a, b) in self.0.iter_mut().zip(other.0) {
            *a = of(*a, b);
        }
        self
    }

    #[inline(always)]
    pub(super) fn max(self, other: Lane) -> Lane {
        self.with(other, |a, b| if a > b { a } else { b })
    }

    #[inline(always)]
    pub(super) fn abs(self) -> Lane {
        self.with(self, |a, _| a.abs())
    }

    /// In every lane.
    #[inline(always)]
    pub(super) fn all_at_most(self, other: Lane) -> bool {
        let mut count = 0;
        for (a, b) in self.0.iter().zip(&other.0) {
            count += usize::from(a <= b);
        }
        count == LANES
    }
}

impl Add for Lane {
    type Output = Lane;
    #[inline(always)]
    fn add(self, other: Lane) -> Lane {
        self.with(other, |a, b| a + b)
    }
}

impl Sub for Lane {
    type Output = Lane;
    #[inline(always)]
    fn sub(self, other: Lane) -> Lane {
        self.with(other, |a, b| a - b)
    }
}

impl Mul for Lane {
    type Output = Lane;
    #[inline(always)]
    fn mul(self, other: Lane) -> Lane {
        self.with(other, |a, b| a * b)
    }
}

impl Div for Lane {
    type Output = Lane;
    #[inline(always)]
    fn div(self, other: Lane) -> Lane {
        self.with(other, |a, b| a / b)
    }
}

impl AddAssign for Lane {
    #[inline(always)]
    fn add_assign(&mut self, other: Lane) {
        *self = *self + other;
    }
}

impl MulAssign for Lane {
    #[inline(always)]
    fn mul_assign(&mut self, other: Lane) {
        *self = *self * other;
    }
}

#[inline(always)]
pub(super) fn dot(a: &[Lane], b: &[Lane]) -> Lane {
    let mut sum = Lane::ZERO;
    for (a, b) in a.iter().zip(b) {
        sum += *a * *b;
    }
    sum
}
