//! Results of imu_utils, `NAME_imu_param.yaml`, in its dialects.
//!
//! gaowenliang/imu_utils, src/gyr_lib/fitallan_gyr.cpp (2cdda91): gyr_n = √rate σ_A(1 s) of its fitted curve, the
//! deviation of one sample, although its README says density; gyr_w the least value of that curve, no walk. Its unit
//! lines say `rad/s` and `m/s^2`. So they did in early versions (41520b7, fitallan_gyr.h), which wrote gyr_n = σ_A(1
//! s), hence N; the results that lie in its data folder are of that kind. No point of a curve is below its least
//! value: gyr_n/√rate < gyr_w tells an early file. mintar/imu_utils, the same files: gyr_n = N, gyr_w = K, as Kalibr
//! takes them. Its unit lines name both numbers.

use super::yaml::Entry;
use super::{Imported, Problem, axis, measured, sensor_name, three_alike, white_and_walk};
use crate::noise::FLICKER_FLOOR;
use crate::params::{Params, TermEntry};
use crate::units::{Quantity, digits};

/// Which program wrote the file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Dialect {
    /// A deviation per sample and the floor of the Allan deviation.
    Deviation,
    /// The Allan deviation at 1 s and its floor.
    Early,
    /// N and K.
    Densities,
}

/// An early file's numbers contradict the later meaning by more than the grid of its averaging times, 1 % apart in
/// the deviation.
const BELOW: f64 = 0.98;

/// Section and its keys.
const SENSORS: [(Quantity, &str, &str, &str); 2] =
    [(Quantity::AngularRate, "Gyr", "gyr_n", "gyr_w"), (Quantity::SpecificForce, "Acc", "acc_n", "acc_w")];

pub(super) fn knows(entries: &[Entry]) -> bool {
    entries.iter().any(|e| {
        SENSORS.iter().any(|(_, section, white, _)| e.key == *white && e.above.first().is_some_and(|a| a == section))
    })
}

pub(super) fn parse(entries: &[Entry], rate_hz: Option<f64>) -> Result<Imported, Problem> {
    let (mut sensors, mut rules, mut warnings) = (Vec::new(), Vec::new(), Vec::new());
    let mut origin = "";
    let early = rate_hz.map(|rate| is_early(entries, rate)).transpose()?.unwrap_or(false);
    for (quantity, section, white_key, walk_key) in SENSORS {
        let own: Vec<&Entry> = entries.iter().filter(|e| e.above.first().is_some_and(|a| a == section)).collect();
        if own.is_empty() {
            continue;
        }
        let dialect = match dialect(&own, section, white_key, quantity)? {
            Dialect::Deviation if early => Dialect::Early,
            other => other,
        };
        let find = |of: &str, key: &str| own.iter().find(|e| e.above.get(1).is_some_and(|a| a == of) && e.key == key);
        let numbers = |of: &str| -> Result<Option<(f64, f64)>, Problem> {
            match (find(of, white_key), find(of, walk_key)) {
                (None, None) => Ok(None),
                (Some(white), Some(walk)) => {
                    let value = white.number()?;
                    if value == 0.0 {
                        return Err(white.problem("found 0, but every sensor has white noise"));
                    }
                    Ok(Some((value, walk.number()?)))
                }
                (Some(one), None) => Err(one.problem(format!("stands without {walk_key}"))),
                (None, Some(one)) => Err(one.problem(format!("stands without {white_key}"))),
            }
        };
        let why = match dialect {
            Dialect::Deviation => {
                format!("its unit lines say that {white_key} is N sqrt(rate), and the file has no rate")
            }
            Dialect::Early | Dialect::Densities => "the file has no rate".into(),
        };
        let sample_rate_hz = super::rate(rate_hz, &why)?;
        let terms = |numbers: (f64, f64)| terms(dialect, quantity, numbers, sample_rate_hz);
        let mut axes = Vec::new();
        for (name, of) in [("x", "x-axis"), ("y", "y-axis"), ("z", "z-axis")] {
            if let Some(numbers) = numbers(of)? {
                axes.push(axis(name, None, None, terms(numbers)?));
            }
        }
        if axes.is_empty() {
            let average = numbers("avg-axis")?.ok_or_else(|| {
                Problem::whole(format!("{section} has no axis; expected x-axis, y-axis, z-axis or avg-axis"))
            })?;
            warnings.push(format!("{section} has only avg-axis: it stands for x, y and z"));
            axes = three_alike(&terms(average)?);
        }
        if dialect == Dialect::Early {
            warnings.push(format!(
                "{white_key}/sqrt({} Hz) would lie below {walk_key}, the least value of the same curve: so this is a \
                 file of an early version, \
                 which wrote {white_key} = N",
                digits(sample_rate_hz)
            ));
        }
        if dialect != Dialect::Densities {
            warnings.push(format!(
                "{walk_key} is no random walk, and K cannot be got back from this file; the least value of a fitted \
                 Allan curve also has N and K in it, so that \
                 the {}'s flicker is an upper limit",
                sensor_name(quantity)
            ));
        }
        origin = match dialect {
            Dialect::Deviation => "imu_utils (gaowenliang)",
            Dialect::Early => "imu_utils (gaowenliang, early)",
            Dialect::Densities => "imu_utils (fork mintar)",
        };
        rules.push(match dialect {
            Dialect::Deviation => format!(
                "{white_key} is the deviation of one sample: N = {white_key}/sqrt({} Hz); {walk_key} is the floor of \
                 the Allan deviation: flicker B = \
                 {walk_key}/{FLICKER_FLOOR:.4}",
                digits(sample_rate_hz)
            ),
            Dialect::Early => format!(
                "{white_key} is the Allan deviation at 1 s: N = {white_key}; {walk_key} is its floor: flicker B = \
                 {walk_key}/{FLICKER_FLOOR:.4}"
            ),
            Dialect::Densities => format!("{white_key} is N and {walk_key} is K, both continuous: taken as they are"),
        });
        sensors.push(Params { quantity, sample_rate_hz, axes, design: None, source: None });
    }
    Ok(Imported { origin, sensors, rules, warnings })
}

/// Whether on some axis one point of the curve would lie below its least value.
fn is_early(entries: &[Entry], rate_hz: f64) -> Result<bool, Problem> {
    for (_, section, white_key, walk_key) in SENSORS {
        for white in entries.iter().filter(|e| e.key == white_key && e.above.first().is_some_and(|a| a == section)) {
            let Some(floor) = entries.iter().find(|e| e.key == walk_key && e.above == white.above) else { continue };
            if white.number()? / rate_hz.sqrt() < BELOW * floor.number()? {
                return Ok(true);
            }
        }
    }
    Ok(false)
}

/// By the unit line of the section.
fn dialect(own: &[&Entry], section: &str, white_key: &str, quantity: Quantity) -> Result<Dialect, Problem> {
    let Some(unit) = own.iter().find(|e| e.key == "unit") else {
        return Err(Problem::whole(format!(
            "{section} has no unit line, which alone tells the two kinds of imu_utils apart: a deviation per sample, \
             or a density"
        )));
    };
    let said: String = unit.value.chars().filter(|c| !c.is_whitespace()).collect();
    if said == quantity.si_unit() {
        Ok(Dialect::Deviation)
    } else if said.contains(&format!("{white_key}:")) && said.contains("sqrt") {
        Ok(Dialect::Densities)
    } else {
        Err(unit.problem(format!(
            "found '{}', expected '{}' (a deviation per sample) or '{white_key}: {}/sqrt(Hz), …' (a density)",
            unit.value.trim(),
            quantity.si_unit(),
            quantity.si_unit()
        )))
    }
}

fn terms(
    dialect: Dialect,
    quantity: Quantity,
    (white, drift): (f64, f64),
    rate_hz: f64,
) -> Result<Vec<TermEntry>, Problem> {
    match dialect {
        Dialect::Densities => white_and_walk(quantity, white, drift),
        Dialect::Deviation | Dialect::Early => {
            let density = if dialect == Dialect::Early { white } else { white / rate_hz.sqrt() };
            let mut terms = white_and_walk(quantity, density, 0.0)?;
            if drift > 0.0 {
                let coefficient = measured(drift / FLICKER_FLOOR, quantity.si_unit())?;
                terms.push(TermEntry::BiasInstability { coefficient });
            }
            Ok(terms)
        }
    }
}
