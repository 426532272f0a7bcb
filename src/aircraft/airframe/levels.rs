//! Handling-quality levels of MIL-F-8785C, class I, as flown and for an airplane of another size by Froude's law.
//!
//! The limits are those of piloted airplanes. Rows of the lateral modes and of roll performance agree with a second
//! transcription, those of short period, CAP and phugoid with textbooks (Cook, Flight Dynamics Principles; Stevens and
//! Lewis); the document itself was not read line by line. At a scale N = full size/model times go with √N, frequencies
//! with 1/√N and CAP with 1/N (Foster and Bowman, AIAA 2005-1023).

use nalgebra::DVector;

use super::Airplane;
use super::linear::LinearModels;
use super::modes::{Mode, ModeName, named};
use super::trim::Trim;
use crate::aircraft::atmosphere::standard::GRAVITY;

/// Printed beside every level.
pub const CAUTION: &str = "limits of MIL-F-8785C for piloted airplanes of class I (small and light; II to IV are not \
    held), flight phases A, B, C, from transcriptions; a guide, no requirement, for one without a pilot aboard";

/// Flight phases: A rapid manoeuvring, B climb, cruise and descent, C take-off and landing.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Category {
    A,
    B,
    C,
}

pub const CATEGORIES: [Category; 3] = [Category::A, Category::B, Category::C];

impl Category {
    pub fn name(self) -> &'static str {
        match self {
            Category::A => "A",
            Category::B => "B",
            Category::C => "C",
        }
    }
}

/// One criterion in one category.
#[derive(Clone, Debug, PartialEq)]
pub struct Criterion {
    /// "short_period_damping", "cap" …
    pub name: &'static str,
    pub category: Category,
    /// SI; "1/(g s^2)" for CAP.
    pub unit: &'static str,
    /// As flown; absent when the airplane has no such mode, or the mode is stable where a time to double is asked for.
    pub value: Option<f64>,
    /// 1, 2 or 3; 4 beyond Level 3; absent when it cannot be judged.
    pub level: Option<u8>,
    pub scaled_value: Option<f64>,
    pub scaled_level: Option<u8>,
    /// Why there is no value or no level.
    pub note: Option<String>,
}

/// What levels are judged by.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct Measures {
    short_period: Option<(f64, f64)>,
    cap: Option<f64>,
    phugoid: Option<Mode>,
    dutch_roll: Option<(f64, f64)>,
    roll_constant: Option<f64>,
    spiral: Option<f64>,
    /// Time to bank 30 and 60 deg.
    bank: [Option<f64>; 2],
}

/// Name, unit, value, level, note.
type Judged = (&'static str, &'static str, Option<f64>, Option<u8>, Option<String>);

/// n/α = −Zw V/g, 1/rad.
pub fn load_per_angle(models: &LinearModels, speed: f64) -> f64 {
    -models.longitudinal.a[(1, 1)] * speed / GRAVITY
}

/// CAP = ω²sp/(n/α), rad²/s² per g.
pub fn cap(modes: &[Mode], models: &LinearModels, speed: f64) -> Option<f64> {
    named(modes, ModeName::ShortPeriod).map(|mode| mode.frequency().powi(2) / load_per_angle(models, speed))
}

/// Level by rows of limits, the first that holds.
fn level(rows: [bool; 3]) -> u8 {
    rows.iter().position(|holds| *holds).map_or(4, |i| i as u8 + 1)
}

fn within(x: f64, [low, high]: [f64; 2]) -> bool {
    (low..=high).contains(&x)
}

impl Measures {
    /// At a scale N.
    fn scaled(&self, n: f64) -> Measures {
        let slow = n.sqrt();
        let pair = |(zeta, omega): (f64, f64)| (zeta, omega / slow);
        Measures {
            short_period: self.short_period.map(pair),
            cap: self.cap.map(|cap| cap / n),
            phugoid: self.phugoid.map(|m| Mode { eigenvalue: (m.eigenvalue.0 / slow, m.eigenvalue.1 / slow), ..m }),
            dutch_roll: self.dutch_roll.map(pair),
            roll_constant: self.roll_constant.map(|t| t * slow),
            spiral: self.spiral.map(|lambda| lambda / slow),
            bank: self.bank.map(|t| t.map(|t| t * slow)),
        }
    }

    /// Name, unit, value, level and why not, of every criterion.
    fn judged(&self, category: Category) -> Vec<Judged> {
        use Category::{A, B, C};
        let infinite = f64::INFINITY;
        let missing = |mode: &str| Some(format!("the airplane has no {mode} mode here"));
        let without = |value: Option<f64>, mode: &str| if value.is_none() { missing(mode) } else { None };
        let mut out = Vec::new();
        let [wide, wider] = if category == B { [[0.30, 2.0], [0.20, 2.0]] } else { [[0.35, 1.3], [0.25, 2.0]] };
        let damping = self.short_period.map(|(zeta, _)| zeta);
        let of = damping.map(|z| level([within(z, wide), within(z, wider), z >= 0.15]));
        out.push(("short_period_damping", "1", damping, of, without(damping, "short-period")));
        let ([one, two, three], frequencies) = match category {
            A => ([[0.28, 3.6], [0.16, 10.0], [0.16, infinite]], [1.0, 0.6]),
            B => ([[0.085, 3.6], [0.038, 10.0], [0.038, infinite]], [0.0, 0.0]),
            C => ([[0.16, 3.6], [0.096, 10.0], [0.096, infinite]], [0.87, 0.6]),
        };
        let of = self.cap.zip(self.short_period).map(|(cap, (_, omega))| {
            let [first, second] = frequencies;
            level([within(cap, one) && omega >= first, within(cap, two) && omega >= second, within(cap, three)])
        });
        out.push(("cap", "1/(g s^2)", self.cap, of, without(self.cap, "short-period")));
        let zeta = self.phugoid.map(|mode| mode.damping());
        let of = self.phugoid.map(|mode| {
            let slow = mode.time_to_double().is_none_or(|t| t >= 55.0);
            level([mode.damping() >= 0.04, mode.damping() >= 0.0, slow])
        });
        out.push(("phugoid_damping", "1", zeta, of, without(zeta, "phugoid")));
        let (first, second) = match category {
            A => ([0.19, 0.35, 1.0], [0.02, 0.05, 0.4]),
            B => ([0.08, 0.15, 0.4], [0.02, 0.05, 0.4]),
            C => ([0.08, 0.15, 1.0], [0.02, 0.05, 0.4]),
        };
        let meets = |(zeta, omega): (f64, f64), [z, zo, o]: [f64; 3]| zeta >= z && zeta * omega >= zo && omega >= o;
        let of = self.dutch_roll.map(|d| level([meets(d, first), meets(d, second), d.0 >= 0.0 && d.1 >= 0.4]));
        let zeta = self.dutch_roll.map(|d| d.0);
        out.push(("dutch_roll_damping", "1", zeta, of, without(zeta, "Dutch-roll")));
        let limits = if category == B { [1.4, 3.0, 10.0] } else { [1.0, 1.4, 10.0] };
        let of = self.roll_constant.map(|t| level(limits.map(|limit| t > 0.0 && t <= limit)));
        out.push(("roll_time_constant", "s", self.roll_constant, of, without(self.roll_constant, "roll")));
        let limits = if category == B { [20.0, 8.0, 4.0] } else { [12.0, 8.0, 4.0] };
        let double = self.spiral.filter(|l| *l > 0.0).map(|l| std::f64::consts::LN_2 / l);
        let of = self.spiral.map(|_| level(limits.map(|limit| double.is_none_or(|t| t >= limit))));
        let note = match self.spiral {
            None => missing("spiral"),
            Some(lambda) if lambda <= 0.0 => Some("stable: it does not double".into()),
            Some(_) => None,
        };
        out.push(("spiral_time_to_double", "s", double, of, note));
        let (time, limits, angle) = match category {
            A => (self.bank[1], [1.3, 1.7, 2.6], 60),
            B => (self.bank[1], [1.7, 2.5, 3.4], 60),
            C => (self.bank[0], [1.3, 1.8, 2.6], 30),
        };
        let of = time.map(|t| level(limits.map(|limit| t <= limit)));
        let note = match time {
            Some(_) => format!("time to bank {angle} deg"),
            None => format!("no time to bank {angle} deg: no aileron stop is given, or it is not reached in 10 s"),
        };
        out.push(("roll_performance", "s", time, of, Some(note)));
        out
    }
}

/// Every criterion in every category; `scale` is N of Froude's law.
pub fn criteria(
    airplane: &Airplane,
    trim: &Trim,
    models: &LinearModels,
    modes: [&[Mode]; 2],
    scale: Option<f64>,
) -> Vec<Criterion> {
    let [along, across] = modes;
    let speed = trim.airspeed();
    let pair = |mode: &Mode| (mode.damping(), mode.frequency());
    let measures = Measures {
        short_period: named(along, ModeName::ShortPeriod).map(pair),
        cap: cap(along, models, speed),
        phugoid: named(along, ModeName::Phugoid).copied(),
        dutch_roll: named(across, ModeName::DutchRoll).map(pair),
        roll_constant: named(across, ModeName::Roll).and_then(Mode::time_constant),
        spiral: named(across, ModeName::Spiral).map(|mode| mode.eigenvalue.0),
        bank: [30.0_f64, 60.0].map(|angle| time_to_bank(airplane, trim, models, angle.to_radians())),
    };
    let scaled = scale.map(|n| measures.scaled(n));
    let mut out = Vec::new();
    for category in CATEGORIES {
        let other = scaled.map(|m| m.judged(category));
        for (i, (name, unit, value, level, note)) in measures.judged(category).into_iter().enumerate() {
            let other = other.as_ref().map(|rows| (rows[i].2, rows[i].3));
            out.push(Criterion {
                name,
                category,
                unit,
                value,
                level,
                scaled_value: other.and_then(|o| o.0),
                scaled_level: other.and_then(|o| o.1),
                note,
            });
        }
    }
    out
}

/// Longest time looked at, s.
const LONGEST: f64 = 10.0;

/// Time until the lateral model has banked by an angle (rad) when the aileron runs from its trim to the nearer stop, at
/// its rate limit: s. Absent without a stop, or when 10 s are not enough.
fn time_to_bank(airplane: &Airplane, trim: &Trim, models: &LinearModels, angle: f64) -> Option<f64> {
    let servo = airplane.actuators[1]?;
    let [low, high] = servo.travel.map(|stop| (stop - trim.controls.aileron).abs());
    let travel = low.min(high);
    if !travel.is_finite() {
        return None;
    }
    let (a, b) = (&models.lateral.a, models.lateral.b.column(0).into_owned());
    let rate = |t: f64, x: &DVector<f64>| a * x + &b * travel.min(servo.rate_limit * t);
    // Runge-Kutta steps far shorter than any mode of an airplane
    let h = 1e-3;
    let mut x = DVector::<f64>::zeros(4);
    let phi = 3;
    for k in 0..(LONGEST / h) as usize {
        let t = k as f64 * h;
        let k1 = rate(t, &x);
        let k2 = rate(t + 0.5 * h, &(&x + &k1 * (0.5 * h)));
        let k3 = rate(t + 0.5 * h, &(&x + &k2 * (0.5 * h)));
        let k4 = rate(t + h, &(&x + &k3 * h));
        let next = &x + (k1 + (k2 + k3) * 2.0 + k4) * (h / 6.0);
        if next[phi] >= angle {
            return Some(t + h * (angle - x[phi]) / (next[phi] - x[phi]));
        }
        x = next;
    }
    None
}
