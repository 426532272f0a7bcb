//! The names of units and their SI factors.

use std::f64::consts::PI;

use super::Dimension;

/// A named unit: the spelling it is printed with, its factor to SI, its dimension.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Symbol {
    pub(super) name: String,
    pub(super) scale: f64,
    pub(super) dimension: Dimension,
}

const ANGLE: Dimension = Dimension::new(2, 0, 0);
const RATE: Dimension = Dimension::new(2, 0, -2);
const LENGTH: Dimension = Dimension::new(0, 2, 0);
const VELOCITY: Dimension = Dimension::new(0, 2, -2);
const FORCE: Dimension = Dimension::new(0, 2, -4);
const TEMPERATURE: Dimension = Dimension::TEMPERATURE;

const DEGREE: f64 = PI / 180.0;
/// m/s², by definition (CGPM 1901).
const STANDARD_GRAVITY: f64 = 9.80665;

/// Printed name, factor, dimension, allowed prefixes, other spellings (exact case), long names (any case).
type Row = (&'static str, f64, Dimension, &'static str, &'static [&'static str], &'static [&'static str]);

const TABLE: &[Row] = &[
    ("rad", 1.0, ANGLE, "mun", &[], &["rad", "rads", "radian", "radians"]),
    ("deg", DEGREE, ANGLE, "mu", &["°", "º", "˚"], &["deg", "degs", "degree", "degrees"]),
    ("arcmin", DEGREE / 60.0, ANGLE, "", &["′"], &["arcmin", "arcmins", "arcminute", "arcminutes"]),
    ("arcsec", DEGREE / 3600.0, ANGLE, "m", &["″"], &["arcsec", "arcsecs", "arcsecond", "arcseconds"]),
    ("rev", 2.0 * PI, ANGLE, "", &[], &["rev", "revs", "revolution", "revolutions"]),
    ("dps", DEGREE, RATE, "mu", &[], &["dps"]),
    ("dph", DEGREE / 3600.0, RATE, "m", &[], &["dph"]),
    ("rpm", 2.0 * PI / 60.0, RATE, "", &[], &["rpm"]),
    ("rps", 2.0 * PI, RATE, "", &[], &[]),
    ("m", 1.0, LENGTH, "munck", &[], &["metre", "metres", "meter", "meters"]),
    ("ft", 0.3048, LENGTH, "", &[], &["foot", "feet"]),
    ("kt", 1852.0 / 3600.0, VELOCITY, "", &["kn"], &["knot", "knots"]),
    ("g", STANDARD_GRAVITY, FORCE, "mun", &["gee"], &[]),
    ("Gal", 0.01, FORCE, "mu", &[], &[]),
    ("s", 1.0, Dimension::TIME, "mun", &[], &["sec", "secs", "second", "seconds"]),
    ("min", 60.0, Dimension::TIME, "", &[], &["min", "mins", "minute", "minutes"]),
    ("h", 3600.0, Dimension::TIME, "", &[], &["hr", "hrs", "hour", "hours"]),
    ("Hz", 1.0, Dimension::FREQUENCY, "mkMG", &[], &["hz", "hertz"]),
    ("kg", 1.0, Dimension::MASS, "", &[], &["kilogram", "kilograms"]),
    ("N", 1.0, Dimension::FORCE, "mk", &[], &["newton", "newtons"]),
    ("V", 1.0, Dimension::VOLTAGE, "mk", &[], &["volt", "volts"]),
    ("A", 1.0, Dimension::CURRENT, "m", &[], &["amp", "amps", "ampere", "amperes"]),
    ("ohm", 1.0, Dimension::RESISTANCE, "m", &["Ω", "Ω"], &["ohm", "ohms"]),
    ("K", 1.0, TEMPERATURE, "m", &[], &["kelvin"]),
    ("degC", 1.0, TEMPERATURE, "", &["℃"], &["degc", "celsius"]),
    ("degF", 5.0 / 9.0, TEMPERATURE, "", &["℉"], &["degf", "fahrenheit"]),
];

impl Symbol {
    pub(super) fn hertz() -> Symbol {
        Symbol { name: "Hz".into(), scale: 1.0, dimension: Dimension::FREQUENCY }
    }
    pub(super) fn second() -> Symbol {
        Symbol { name: "s".into(), scale: 1.0, dimension: Dimension::TIME }
    }
    /// The angle that a one-word angular rate (dps, mdps, dph) counts.
    pub(super) fn integral(&self) -> Option<Symbol> {
        let prefix = self.name.strip_suffix("dps").or_else(|| self.name.strip_suffix("dph"))?;
        find(&format!("{prefix}deg"))
    }
}

/// The symbol of this spelling.
pub(super) fn find(name: &str) -> Option<Symbol> {
    let lower = name.to_lowercase();
    let exact = TABLE.iter().find(|row| row.0 == name || row.4.contains(&name) || row.5.contains(&lower.as_str()));
    if let Some(row) = exact {
        return Some(Symbol { name: row.0.into(), scale: row.1, dimension: row.2 });
    }
    let mut letters = name.chars();
    let prefix = match letters.next()? {
        'µ' | 'μ' => 'u',
        other => other,
    };
    let base = letters.as_str();
    let row = TABLE.iter().find(|row| row.3.contains(prefix) && (row.0 == base || row.4.contains(&base)))?;
    Some(Symbol { name: format!("{prefix}{}", row.0), scale: row.1 * factor(prefix), dimension: row.2 })
}

fn factor(prefix: char) -> f64 {
    match prefix {
        'n' => 1e-9,
        'u' => 1e-6,
        'm' => 1e-3,
        'c' => 1e-2,
        'k' => 1e3,
        'M' => 1e6,
        _ => 1e9,
    }
}

/// What to write instead of a name that is not a unit here.
pub(super) fn hint(name: &str) -> String {
    let text = match name {
        "d" => "day or degree? write deg (angle) or h (time)",
        "G" | "mG" | "uG" | "MG" | "Mg" => "standard gravity is g (also mg, ug); G is read as gauss or giga",
        "o" | "O" => "a degree is written deg",
        "H" => "an hour is written h",
        "S" => "a second is written s",
        "C" | "F" => "a temperature is written degC, degF or K",
        "r" | "R" => "revolution or radian? write rev or rad",
        "M" => "metre or minute? write m or min",
        "gon" | "grad" | "Grad" => "an angle is written deg or rad",
        "LSB" | "lsb" | "LSBs" | "count" | "counts" | "raw" | "digit" | "digits" | "bit" | "bits" => {
            "a count is no unit; give the size of one count, for example \"1/131 deg/s\""
        }
        _ => {
            "known are rad, deg, arcmin, arcsec, rev, dps, rpm, m, ft, kt, g, s, min, h, Hz, K, kg, N, V, A, ohm with \
             prefixes (mdps, ug, kHz), for example deg/s, deg/s/sqrt(Hz), deg/sqrt(h), m/s^2, ug/sqrt(Hz)"
        }
    };
    text.to_string()
}
