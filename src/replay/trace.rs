//! A log of any length as at most two thousand points, for figures.

const MOST_POINTS: usize = 2000;

/// One point: means over its samples.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Point {
    /// s from the start of the log.
    pub time_s: f64,
    /// Measurement z, SI.
    pub measured: f64,
    /// H x(k|k), SI.
    pub estimate: f64,
    /// √(H P(k|k) Hᵀ), SI.
    pub sigma: f64,
    /// Normalised innovation, averaged and multiplied by √(samples of the point): N(0, 1) when the design is true.
    pub innovation: f64,
    /// Extremes of the normalised innovations.
    pub lowest: f64,
    pub highest: f64,
}

const EMPTY: Point = Point {
    time_s: 0.0,
    measured: 0.0,
    estimate: 0.0,
    sigma: 0.0,
    innovation: 0.0,
    lowest: f64::INFINITY,
    highest: f64::NEG_INFINITY,
};

/// Points that are merged in pairs, and cover twice as many samples each, whenever there are too many.
#[derive(Clone, Debug)]
pub struct Trace {
    per_point: u64,
    filled: u64,
    sum: Point,
    points: Vec<Point>,
}

impl Trace {
    pub(super) fn new() -> Trace {
        Trace { per_point: 1, filled: 0, sum: EMPTY, points: Vec::with_capacity(MOST_POINTS) }
    }

    pub(super) fn push(&mut self, time_s: f64, measured: f64, estimate: f64, sigma: f64, innovation: f64) {
        self.sum.time_s += time_s;
        self.sum.measured += measured;
        self.sum.estimate += estimate;
        self.sum.sigma += sigma;
        self.sum.innovation += innovation;
        self.sum.lowest = self.sum.lowest.min(innovation);
        self.sum.highest = self.sum.highest.max(innovation);
        self.filled += 1;
        if self.filled < self.per_point {
            return;
        }
        let n = self.filled as f64;
        self.points.push(Point {
            time_s: self.sum.time_s / n,
            measured: self.sum.measured / n,
            estimate: self.sum.estimate / n,
            sigma: self.sum.sigma / n,
            innovation: self.sum.innovation / n.sqrt(),
            ..self.sum
        });
        self.filled = 0;
        self.sum = EMPTY;
        if self.points.len() == MOST_POINTS {
            self.points = self.points.chunks_exact(2).map(|pair| pair[0].merge(&pair[1])).collect();
            self.per_point *= 2;
        }
    }

    /// The points of whole groups of samples, in order of time.
    pub fn points(&self) -> &[Point] {
        &self.points
    }
    pub fn samples_per_point(&self) -> u64 {
        self.per_point
    }
}

impl Point {
    fn merge(&self, other: &Point) -> Point {
        let mean = |a: f64, b: f64| 0.5 * (a + b);
        Point {
            time_s: mean(self.time_s, other.time_s),
            measured: mean(self.measured, other.measured),
            estimate: mean(self.estimate, other.estimate),
            sigma: mean(self.sigma, other.sigma),
            innovation: (self.innovation + other.innovation) * std::f64::consts::FRAC_1_SQRT_2,
            lowest: self.lowest.min(other.lowest),
            highest: self.highest.max(other.highest),
        }
    }
}
