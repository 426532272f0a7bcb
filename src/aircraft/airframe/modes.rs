//! Modes of a linear model and what they are called.
//!
//! ω = |λ|, ζ = −Re λ/|λ|; time to half or double ln 2/|Re λ| (Stevens, Lewis and Johnson 2016, section 4.2).

use nalgebra::DMatrix;

use super::linear::LinearModel;
use crate::numerics::linalg::{LinalgError, eigenvalues, singular_values};

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ModeName {
    ShortPeriod,
    Phugoid,
    DutchRoll,
    Roll,
    Spiral,
    /// A pair that is none of these.
    Oscillation,
    /// A real one that is none of these.
    Real,
}

/// A real eigenvalue, or a pair by the one above the axis.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Mode {
    pub name: ModeName,
    pub eigenvalue: (f64, f64),
}

impl ModeName {
    /// As in documents.
    pub fn text(self) -> &'static str {
        match self {
            ModeName::ShortPeriod => "short_period",
            ModeName::Phugoid => "phugoid",
            ModeName::DutchRoll => "dutch_roll",
            ModeName::Roll => "roll",
            ModeName::Spiral => "spiral",
            ModeName::Oscillation => "oscillation",
            ModeName::Real => "real",
        }
    }
}

impl Mode {
    /// |λ|, rad/s.
    pub fn frequency(&self) -> f64 {
        self.eigenvalue.0.hypot(self.eigenvalue.1)
    }
    /// ζ; 1 or −1 of a real one.
    pub fn damping(&self) -> f64 {
        -self.eigenvalue.0 / self.frequency()
    }
    /// s; absent when it grows or stays.
    pub fn time_to_half(&self) -> Option<f64> {
        (self.eigenvalue.0 < 0.0).then(|| std::f64::consts::LN_2 / -self.eigenvalue.0)
    }
    /// s; absent when it dies out or stays.
    pub fn time_to_double(&self) -> Option<f64> {
        (self.eigenvalue.0 > 0.0).then(|| std::f64::consts::LN_2 / self.eigenvalue.0)
    }
    /// Of a real one, s; negative when it grows.
    pub fn time_constant(&self) -> Option<f64> {
        (self.eigenvalue.1 == 0.0 && self.eigenvalue.0 != 0.0).then(|| -1.0 / self.eigenvalue.0)
    }
}

/// The left null vector v of A − λI, vᴴ(A − λI) = 0, of unit length, real parts then imaginary ones, by the smallest
/// singular value of the real form.
///
/// Errors: numbers that are not finite.
pub fn left_eigenvector(a: &DMatrix<f64>, (re, im): (f64, f64)) -> Result<Vec<f64>, LinalgError> {
    null_vector(&a.transpose(), (re, -im))
}

/// The right null vector of A − λI in the same form.
pub fn null_vector(a: &DMatrix<f64>, (re, im): (f64, f64)) -> Result<Vec<f64>, LinalgError> {
    let n = a.nrows();
    let (_, v) = singular_values(&real_form(&(a - DMatrix::identity(n, n) * re), im))?;
    Ok(v.column(2 * n - 1).iter().copied().collect())
}

/// [M, im I; −im I, M], whose singular values are those of M − i·im·I, each twice.
pub fn real_form(m: &DMatrix<f64>, im: f64) -> DMatrix<f64> {
    let (n, columns) = m.shape();
    let mut out = DMatrix::zeros(2 * n, 2 * columns);
    out.view_mut((0, 0), (n, columns)).copy_from(m);
    out.view_mut((n, columns), (n, columns)).copy_from(m);
    for i in 0..n {
        out[(i, columns + i)] = im;
        out[(n + i, i)] = -im;
    }
    out
}

/// Modes of a model, fastest first. A mode is longitudinal when most of its eigenvector is (velocities over the speed);
/// of the longitudinal pairs the faster is the short period and the slower the phugoid, the lateral pair is the Dutch
/// roll, the faster of two real lateral modes the roll and the slower the spiral. Motions of another kind are an
/// oscillation or real.
pub fn modes(model: &LinearModel, speed: f64) -> Result<Vec<Mode>, LinalgError> {
    let a = &model.in_angles(speed).a;
    let longitudinal: Vec<bool> = model.states.iter().map(|s| ["u", "w", "q", "theta"].contains(&s.0)).collect();
    let mut found = Vec::new();
    for eigenvalue in eigenvalues(a).into_iter().filter(|e| e.1 >= 0.0) {
        let vector = null_vector(a, eigenvalue)?;
        let share = vector.iter().zip(longitudinal.iter().cycle()).map(|(x, l)| if *l { x * x } else { 0.0 });
        let along = share.sum::<f64>() > 0.5;
        let name = if eigenvalue.1 > 0.0 { ModeName::Oscillation } else { ModeName::Real };
        found.push((along, Mode { name, eigenvalue }));
    }
    let of = |along: bool, pair: bool| -> Vec<usize> {
        let fits = |m: &(bool, Mode)| m.0 == along && (m.1.eigenvalue.1 > 0.0) == pair;
        (0..found.len()).filter(|i| fits(&found[*i])).collect()
    };
    let named = [
        (of(true, true), vec![ModeName::ShortPeriod, ModeName::Phugoid]),
        (of(false, true), vec![ModeName::DutchRoll]),
        (of(false, false), vec![ModeName::Roll, ModeName::Spiral]),
    ];
    // a single pair beside two real motions is the short period when those are slower, else the phugoid
    let real = of(true, false);
    for (places, names) in named {
        match (places.as_slice(), names.as_slice()) {
            ([one], [ModeName::ShortPeriod, ModeName::Phugoid]) => {
                let faster = real.iter().all(|r| found[*r].1.frequency() < found[*one].1.frequency());
                found[*one].1.name = if faster { ModeName::ShortPeriod } else { ModeName::Phugoid };
            }
            (places, names) if places.len() == names.len() => {
                places.iter().zip(names).for_each(|(place, name)| found[*place].1.name = *name);
            }
            _ => {}
        }
    }
    Ok(found.into_iter().map(|m| m.1).collect())
}

/// The mode of a name, if there is one.
pub fn named(modes: &[Mode], name: ModeName) -> Option<&Mode> {
    modes.iter().find(|mode| mode.name == name)
}
