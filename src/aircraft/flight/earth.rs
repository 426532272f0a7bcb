//! The two earths: flat at rest, and the rotating WGS84 ellipsoid with gravitation to J2.

use super::vector::{Matrix, Vector, back, matrix, product, quaternion, transpose};
use crate::aircraft::atmosphere::standard::GRAVITY;

/// WGS84 (NIMA TR8350.2, 2000): semi-major axis, flattening, GM, J2, rate.
const A: f64 = 6_378_137.0;
const F: f64 = 1.0 / 298.257_223_563;
const GM: f64 = 3.986_004_418e14;
const J2: f64 = 1.082_629_82e-3;
pub const EARTH_RATE: f64 = 7.292_115e-5;
/// e².
const E2: f64 = F * (2.0 - F);

/// What the airplane flies over.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Earth {
    /// At rest, gravity 9.80665 m/s² down; positions are north, east, down.
    Flat,
    /// Rotating; positions are earth-centred and earth-fixed.
    Wgs84,
}

/// A place above the ellipsoid: rad, rad, m.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Geodetic {
    pub latitude: f64,
    pub longitude: f64,
    pub height: f64,
}

impl Geodetic {
    pub fn to_ecef(self) -> [f64; 3] {
        let (s, c) = self.latitude.sin_cos();
        let (sl, cl) = self.longitude.sin_cos();
        let n = A / (1.0 - E2 * s * s).sqrt();
        [(n + self.height) * c * cl, (n + self.height) * c * sl, (n * (1.0 - E2) + self.height) * s]
    }

    /// By Bowring's formula for the parametric latitude, twice (Bowring 1976, Survey Review 23): below 1e-9 m for
    /// flight.
    pub fn from_ecef([x, y, z]: [f64; 3]) -> Geodetic {
        let p = x.hypot(y);
        let b = A * (1.0 - F);
        let second = E2 / (1.0 - E2);
        let (mut s, mut c) = normal(z * A, p * b);
        let mut latitude = (0.0, 1.0);
        for _ in 0..2 {
            latitude = normal(z + second * b * s * s * s, p - E2 * A * c * c * c);
            (s, c) = normal((1.0 - F) * latitude.0, latitude.1);
        }
        let (s, c) = latitude;
        // along the normal: exact where sine or cosine vanishes
        let height = p * c + z * s - A * (1.0 - E2 * s * s).sqrt();
        Geodetic { latitude: s.atan2(c), longitude: y.atan2(x), height }
    }

    /// Rows north, east, down in earth-fixed axes: turns these into local ones.
    pub(super) fn axes(self) -> Matrix {
        let (s, c) = self.latitude.sin_cos();
        let (sl, cl) = self.longitude.sin_cos();
        [[-s * cl, -s * sl, c], [-sl, cl, 0.0], [-c * cl, -c * sl, -s]]
    }
}

/// Sine and cosine of atan2(y, x).
fn normal(y: f64, x: f64) -> (f64, f64) {
    let length = y.hypot(x);
    (y / length, x / length)
}

/// Gravitation with J2 in earth-fixed axes, m/s².
pub fn gravitation(r: [f64; 3]) -> [f64; 3] {
    let square = r.iter().map(|x| x * x).sum::<f64>();
    let distance = square.sqrt();
    let s2 = r[2] * r[2] / square;
    let k = 1.5 * J2 * A * A / square;
    let g = -GM / (square * distance);
    let across = g * (1.0 + k * (1.0 - 5.0 * s2));
    [across * r[0], across * r[1], g * (1.0 + k * (3.0 - 5.0 * s2)) * r[2]]
}

/// What the earth does to a body at a place, in the axes of the body.
#[derive(Clone, Copy, Debug)]
pub(super) struct Field {
    /// Geometric height, m.
    pub height: f64,
    /// Acceleration of free fall of a body at rest on the earth, m/s².
    pub gravity: Vector,
    /// Rate of the earth.
    pub rate: Vector,
}

impl Earth {
    /// At a position; `c` turns the axes of the body into those of the position.
    #[inline(always)]
    pub(super) fn field(self, r: Vector, c: &Matrix) -> Field {
        match self {
            Earth::Flat => Field { height: -r[2], gravity: c[2].map(|x| x * GRAVITY), rate: [0.0; 3] },
            Earth::Wgs84 => {
                let [x, y, z] = gravitation(r);
                let square = EARTH_RATE * EARTH_RATE;
                Field {
                    height: Geodetic::from_ecef(r).height,
                    gravity: back(c, [x + square * r[0], y + square * r[1], z]),
                    rate: c[2].map(|x| x * EARTH_RATE),
                }
            }
        }
    }

    /// Geometric height of a position, m.
    pub(super) fn height(self, r: Vector) -> f64 {
        match self {
            Earth::Flat => -r[2],
            Earth::Wgs84 => Geodetic::from_ecef(r).height,
        }
    }

    /// Local north, east, down in the axes of the position, as rows.
    pub(super) fn local(self, r: Vector) -> Matrix {
        match self {
            Earth::Flat => [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]],
            Earth::Wgs84 => Geodetic::from_ecef(r).axes(),
        }
    }

    /// Body to local north, east, down of an attitude against the axes of the position.
    pub(super) fn body_to_local(self, r: Vector, attitude: [f64; 4]) -> Matrix {
        match self {
            Earth::Flat => matrix(attitude),
            Earth::Wgs84 => product(&self.local(r), &matrix(attitude)),
        }
    }

    /// A vector in local north, east, down turned into the axes of the position.
    pub(super) fn of_local(self, r: Vector, v: Vector) -> Vector {
        back(&self.local(r), v)
    }

    /// Quaternion of body against the axes of the position from a body to local matrix.
    pub(super) fn attitude(self, r: Vector, body_to_local: &Matrix) -> [f64; 4] {
        let c = product(&transpose(&self.local(r)), body_to_local);
        quaternion(&c)
    }
}
