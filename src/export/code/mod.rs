//! A filter as source code: C99 or a `no_std` module of Rust, made of one filter.json.
//!
//! The generated code does what [`Running`](crate::filter::Running) does, row by row: in double precision the
//! operations of [`Kalman`](crate::filter::Kalman) in their order, with the zeros of F, H, Q left out. In single
//! precision it keeps F − I in place of F, adds to x and P with the rounding error of every sum carried along (Knuth
//! 1997, The Art of Computer Programming 2, section 4.2.2, theorem B), and takes P − K h P for the entries of P that
//! an update hardly changes, the form of Bucy and Joseph for the others; docs/code.md has what that is worth.

mod names;
mod part;
mod vectors;

use minijinja::syntax::SyntaxConfig;
use minijinja::value::Serde;
use minijinja::{Environment, UndefinedBehavior};
use serde::Serialize;

use crate::filter::{AxisDesign, FilterDesign};
use crate::model::LinearModel;
use crate::units::{Quantity, digits};

use names::{comment, identifier, number, unique};
use part::Part;

/// Numbers that the code computes with.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Precision {
    Float,
    Double,
}

impl Precision {
    /// What the self-test allows: relative to a measurement and its sigma.
    fn tolerance(self) -> f64 {
        match self {
            Precision::Float => 2e-5,
            Precision::Double => 1e-12,
        }
    }

    /// Of S and P, relative: differences of large numbers where a state starts far more uncertain than a measurement.
    fn spread(self) -> f64 {
        match self {
            Precision::Float => 2e-4,
            Precision::Double => 1e-11,
        }
    }
}

/// What the code carries beside the estimate.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Gain {
    /// The covariance, and with it gains that fit every sample.
    Full,
    /// Nothing: the gains of the steady state.
    Constant,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Language {
    C,
    Rust,
}

/// What is to be written.
#[derive(Clone, Debug)]
pub struct Code {
    /// Of the files, the types and the functions; see [`check_name`].
    pub name: String,
    pub precision: Precision,
    pub gain: Gain,
    /// Lines about the origin, for the head of every file.
    pub origin: Vec<String>,
}

/// One file: what follows the name, and its text.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Source {
    pub suffix: &'static str,
    pub text: String,
}

/// Everything the templates show.
#[derive(Serialize)]
struct Sheet {
    name: String,
    upper: String,
    /// "float", "f64".
    real: &'static str,
    /// Behind a number in C.
    f: &'static str,
    /// Single precision, with its sums compensated.
    float: bool,
    full: bool,
    head: Vec<String>,
    parts: Vec<Part>,
    /// Several kinds of axes: types and functions of each have its name in theirs.
    several: bool,
    /// What the self-test allows of S and P, relative.
    spread: String,
    /// What builds and runs the self-test.
    build: String,
}

/// Headers of the C standard library, and words of both languages.
const TAKEN: [&str; 60] = [
    "abstract", "as", "assert", "async", "await", "become", "box", "break", "const", "continue", "core", "crate", "do",
    "dyn", "else", "enum", "extern", "false", "final", "float", "fn", "for", "gen", "if", "impl", "in", "let",
    "limits", "loop", "macro", "match", "math", "mod", "move", "mut", "override", "pub", "ref", "return", "self",
    "static", "std", "stdbool", "stdint", "stdio", "struct", "super", "trait", "true", "type", "use", "where", "while",
    "unsafe", "unsized", "typeof", "virtual", "yield", "try", "priv",
];
/// Of the types and functions that all axes share.
const SHARED: [&str; 6] = ["add", "entry", "is", "real", "update", "vector"];

/// A name must do for files, types and functions in both languages.
pub fn check_name(name: &str) -> Result<(), String> {
    let sound = name.starts_with(|c: char| c.is_ascii_lowercase())
        && name.chars().all(|c| c.is_ascii_lowercase() || c.is_ascii_digit() || c == '_')
        && name.len() <= 31;
    if sound && !TAKEN.contains(&name) {
        return Ok(());
    }
    Err(format!(
        "'{name}' becomes the name of types and functions: expected at most 31 small letters, digits and underscores, \
         a letter first, and no word of C, \
         Rust or their libraries"
    ))
}

/// Builds the self-test of the files of [`c`] as a program in their folder and runs it: status 0 when the code
/// reproduces our filter.
pub fn self_test_command(name: &str) -> String {
    let upper = name.to_ascii_uppercase();
    format!("cc -std=c99 -D{upper}_SELF_TEST_MAIN {name}.c {name}_test.c -o {name}_test && ./{name}_test")
}

/// NAME.h, NAME.c and NAME_test.c. Errors: a name that will not do, over 255 states, nothing that is measured, a
/// number that single precision does not carry.
pub fn c(design: &FilterDesign, code: &Code) -> Result<Vec<Source>, String> {
    let sheet = sheet(design, code, Language::C)?;
    Ok(vec![
        Source { suffix: ".h", text: render(include_str!("templates/header.h.jinja"), &sheet)? },
        Source { suffix: ".c", text: render(include_str!("templates/source.c.jinja"), &sheet)? },
        Source { suffix: "_test.c", text: render(include_str!("templates/test.c.jinja"), &sheet)? },
    ])
}

/// NAME.rs. Errors: as [`c`].
pub fn rust(design: &FilterDesign, code: &Code) -> Result<Source, String> {
    let sheet = sheet(design, code, Language::Rust)?;
    Ok(Source { suffix: ".rs", text: render(include_str!("templates/module.rs.jinja"), &sheet)? })
}

fn render(template: &str, sheet: &Sheet) -> Result<String, String> {
    let mut environment = Environment::new();
    environment.set_undefined_behavior(UndefinedBehavior::Strict);
    let failed = |error: minijinja::Error| format!("{error:#}");
    let syntax = SyntaxConfig::builder()
        .trim_blocks(true)
        .lstrip_blocks(true)
        .keep_trailing_newline(true)
        .build()
        .map_err(failed)?;
    environment.set_syntax(syntax);
    environment.render_str(template, Serde(sheet)).map_err(failed)
}

fn sheet(design: &FilterDesign, code: &Code, language: Language) -> Result<Sheet, String> {
    check_name(&code.name)?;
    // axes with the same numbers share one type
    let mut kinds: Vec<(&AxisDesign, Vec<&str>)> = Vec::new();
    for axis in &design.axes {
        match kinds.iter_mut().find(|(first, _)| same(&first.model, &axis.model)) {
            Some((_, names)) => names.push(&axis.name),
            None => kinds.push((axis, vec![&axis.name])),
        }
    }
    let several = kinds.len() > 1;
    let mut prefixes: Vec<String> = SHARED.iter().map(|word| format!("{}_{word}", code.name)).collect();
    let mut parts = Vec::new();
    for (axis, names) in &kinds {
        let prefix = if several {
            unique(&format!("{}_{}", code.name, identifier(&axis.name)), &mut prefixes)
        } else {
            code.name.clone()
        };
        let part =
            Part::new(axis, names, prefix, code).map_err(|message| format!("axis '{}': {message}", axis.name))?;
        parts.push(part);
    }
    let float = code.precision == Precision::Float;
    Ok(Sheet {
        name: code.name.clone(),
        upper: code.name.to_ascii_uppercase(),
        real: match (language, float) {
            (Language::C, true) => "float",
            (Language::C, false) => "double",
            (Language::Rust, true) => "f32",
            (Language::Rust, false) => "f64",
        },
        f: if float { "F" } else { "" },
        float,
        full: code.gain == Gain::Full,
        head: head(design, code),
        parts,
        several,
        spread: number(code.precision.spread(), float),
        build: self_test_command(&code.name),
    })
}

fn same(a: &LinearModel, b: &LinearModel) -> bool {
    let numbers = [(&a.f, &b.f), (&a.g, &b.g), (&a.h, &b.h), (&a.q, &b.q), (&a.r, &b.r), (&a.p0, &b.p0)];
    numbers.into_iter().all(|(a, b)| a == b)
        && a.x0 == b.x0
        && a.every == b.every
        && a.states == b.states
        && a.inputs == b.inputs
        && a.measurements == b.measurements
        && a.outputs == b.outputs
}

/// The lines at the head of every file.
fn head(design: &FilterDesign, code: &Code) -> Vec<String> {
    let quantity = match design.quantity {
        Quantity::AngularRate => "angular rate, rad/s",
        Quantity::SpecificForce => "specific force, m/s^2",
    };
    let mut lines = code.origin.clone();
    lines.push(format!("Sensor: {quantity}; plant: {}; every number is in SI units.", design.plant));
    lines.push(format!("Made for {} Hz, one prediction per sample.", digits(design.sample_rate_hz)));
    lines.push(match code.precision {
        Precision::Float => "Single precision; the rounding errors of the sums in x and P are carried along.".into(),
        Precision::Double => "Double precision.".into(),
    });
    lines.push(match code.gain {
        Gain::Full => "Full form: the covariance is carried, gains fit every sample from the first.".into(),
        Gain::Constant => "Constant gains, those of the steady state; no covariance is carried.".to_string(),
    });
    lines.iter().map(|line| comment(line)).collect()
}
