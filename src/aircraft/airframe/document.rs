//! airplane.json: an airplane with every number in its unit.

use std::f64::consts::{PI, TAU};
use std::path::Path;

use super::{
    Actuator, Aerodynamics, Airplane, Curve, Drag, Inertia, Lateral, Lift, Motor, Pitch, Propulsion, Size, Stall,
};
use crate::params::place::{self, DocumentError, KeyError, Object, Place};
use crate::params::{Measured, Range};
use crate::units::{Dimension, Unit};

pub(super) const FORMAT: &str = "kfdesign-airplane/1";

/// By how much the largest principal moment may exceed the sum of the others: moments found by swinging are known to a
/// percent or so, and published sets have it (a warning says so).
const MEASURED: f64 = 0.01;

const ANGLE: Dimension = Dimension::new(2, 0, 0);
const RATE: Dimension = Dimension::new(2, 0, -2);
const LENGTH: Dimension = Dimension::new(0, 2, 0);
const AREA: Dimension = Dimension::new(0, 4, 0);
const PER_ANGLE: Dimension = Dimension::new(-2, 0, 0);

impl Airplane {
    /// Every complaint names `path` and the key.
    pub fn from_json(text: &str, path: &str) -> Result<Airplane, DocumentError> {
        place::document(text, path, airplane)
    }

    pub fn read(path: &Path) -> Result<Airplane, DocumentError> {
        place::read(path, airplane)
    }
}

fn airplane(place: &Place<'_>) -> Result<Airplane, KeyError> {
    let known = [
        "format",
        "name",
        "source",
        "licence",
        "note",
        "mass",
        "inertia",
        "reference",
        "aerodynamics",
        "propulsion",
        "actuators",
        "positions",
    ];
    let o = place.document(FORMAT, "airplane.json", &known)?;
    for key in ["source", "licence"] {
        o.required(key)?.text()?;
    }
    if let Some(note) = o.optional("note") {
        note.text()?;
    }
    let actuators = o.optional("actuators").map(|p| p.object(&["elevator", "aileron", "rudder"])).transpose()?;
    let actuator = |key: &str| actuators.as_ref().and_then(|o| o.optional(key)).map(|p| actuator(&p)).transpose();
    let reference = o.required("reference")?.object(&["area", "span", "chord"])?;
    let size = Size {
        area: positive(&reference, "area", AREA)?,
        span: positive(&reference, "span", LENGTH)?,
        chord: positive(&reference, "chord", LENGTH)?,
    };
    Ok(Airplane {
        name: o.required("name")?.text()?.to_string(),
        mass: positive(&o, "mass", Dimension::MASS)?,
        inertia: inertia(&o.required("inertia")?)?,
        size,
        aerodynamics: aerodynamics(&o.required("aerodynamics")?, &size)?,
        propulsion: propulsion(&o.required("propulsion")?)?,
        actuators: [actuator("elevator")?, actuator("aileron")?, actuator("rudder")?],
        positions: o.optional("positions").map(|p| positions(&p)).transpose()?.unwrap_or_default(),
    })
}

fn si(object: &Object<'_>, key: &str, dimension: Dimension, range: Range) -> Result<f64, KeyError> {
    Measured::from_place(&object.required(key)?, dimension, range).map(|m| m.si())
}

fn positive(object: &Object<'_>, key: &str, dimension: Dimension) -> Result<f64, KeyError> {
    let place = object.required(key)?;
    let measured = Measured::from_place(&place, dimension, Range::Any)?;
    if measured.value > 0.0 {
        return Ok(measured.si());
    }
    Err(place.error(format!("found {} {}, expected more than zero", measured.value, measured.unit)))
}

/// Plain.
fn more_than_zero(place: &Place<'_>) -> Result<f64, KeyError> {
    let value = place.plain()?;
    if value > 0.0 { Ok(value) } else { Err(place.error(format!("found {value}, expected more than zero"))) }
}

/// Plain, zero when absent.
fn optional(object: &Object<'_>, key: &str) -> Result<f64, KeyError> {
    object.optional(key).map_or(Ok(0.0), |place| place.plain())
}

/// A derivative: "5.61 1/rad" or "0.098 1/deg". `zero` says what a derivative of zero would mean, for one that is
/// missing.
fn derivative(object: &Object<'_>, key: &str, zero: &str) -> Result<f64, KeyError> {
    let place = object
        .required(key)
        .map_err(|e| KeyError { message: format!("missing; \"0 1/rad\" would mean that {zero}"), ..e })?;
    if let Some(text) = place.value().as_str() {
        let parts = text.trim().split_once(char::is_whitespace);
        let number = parts.and_then(|(number, _)| number.parse::<f64>().ok()).filter(|x| x.is_finite());
        if let (Some(number), Some((_, unit))) = (number, parts) {
            let unit = Unit::parse(unit).map_err(|e| place.error(e.to_string()))?;
            unit.require(PER_ANGLE).map_err(|e| place.error(e.to_string()))?;
            return Ok(unit.to_si(number));
        }
    }
    // rates are made dimensionless with the airspeed, so that theirs may be plain
    if let (true, Ok(number)) = (matches!(key, "p" | "r" | "pitch_rate"), place.plain()) {
        return Ok(number);
    }
    Err(place.error("expected a derivative with its unit, for example \"5.61 1/rad\""))
}

fn inertia(place: &Place<'_>) -> Result<Inertia, KeyError> {
    let o = place.object(&["xx", "yy", "zz", "xz"])?;
    let i = Inertia {
        xx: positive(&o, "xx", Dimension::INERTIA)?,
        yy: positive(&o, "yy", Dimension::INERTIA)?,
        zz: positive(&o, "zz", Dimension::INERTIA)?,
        xz: si(&o, "xz", Dimension::INERTIA, Range::Any)?,
    };
    let [a, b, c] = i.principal_moments();
    if a <= 0.0 || c > (1.0 + MEASURED) * (a + b) {
        return Err(place.error(format!(
            "principal moments {a:.4}, {b:.4}, {c:.4} kg m^2 belong to no body: each is at most the sum of \
             the other two; check the sign and size of xz (here the integral of x z dm)"
        )));
    }
    Ok(i)
}

fn lateral(o: &Object<'_>, key: &str, what: &str) -> Result<Lateral, KeyError> {
    let o = o.required(key)?.object(&["zero", "beta", "p", "r", "aileron", "rudder"])?;
    let of = |key: &str, cause: &str| derivative(&o, key, &format!("{cause} makes no {what}"));
    Ok(Lateral {
        zero: optional(&o, "zero")?,
        beta: of("beta", "sideslip")?,
        p: of("p", "roll rate")?,
        r: of("r", "yaw rate")?,
        aileron: of("aileron", "the aileron")?,
        rudder: of("rudder", "the rudder")?,
    })
}

fn aerodynamics(place: &Place<'_>, size: &Size) -> Result<Aerodynamics, KeyError> {
    let o = place.object(&["lift", "drag", "side", "roll", "pitch", "yaw", "stall"])?;
    let four = |key: &str, what: &str| -> Result<[f64; 4], KeyError> {
        let o = o.required(key)?.object(&["zero", "alpha", "pitch_rate", "elevator"])?;
        let of = |key: &str, cause: &str| derivative(&o, key, &format!("{cause} makes no {what}"));
        Ok([
            o.required("zero")?.plain()?,
            of("alpha", "the angle of attack")?,
            of("pitch_rate", "pitch rate")?,
            of("elevator", "the elevator")?,
        ])
    };
    let [zero, alpha, pitch_rate, elevator] = four("lift", "lift")?;
    let lift = Lift { zero, alpha, pitch_rate, elevator };
    if lift.alpha <= 0.0 {
        return Err(o
            .required("lift")?
            .error(format!("alpha {alpha} 1/rad: expected a lift that rises with the angle of attack")));
    }
    let [zero, alpha, pitch_rate, elevator] = four("pitch", "pitching moment")?;
    let drag_place = o.required("drag")?;
    let d = drag_place.object(&["parasitic", "oswald", "polar", "pitch_rate", "elevator"])?;
    let drag = match (d.optional("oswald"), d.optional("polar")) {
        (Some(e), None) => Drag::Linear { factor: size.area / (PI * more_than_zero(&e)? * size.span * size.span) },
        (None, Some(polar)) => match polar.list()?.as_slice() {
            [factor, least] => Drag::Polar { factor: factor.plain()?, least: least.plain()? },
            list => return Err(polar.error(format!("expected [k, CL of least drag], found {} values", list.len()))),
        },
        _ => return Err(drag_place.error("expected one of oswald and polar, which say what lift costs")),
    };
    let of_drag = |key: &str| if d.optional(key).is_some() { derivative(&d, key, "") } else { Ok(0.0) };
    let stall = o.optional("stall").map(|p| -> Result<Stall, KeyError> {
        let o = p.object(&["sharpness", "angle"])?;
        Ok(Stall::new(more_than_zero(&o.required("sharpness")?)?, positive(&o, "angle", ANGLE)?))
    });
    Ok(Aerodynamics {
        lift,
        parasitic: d.required("parasitic")?.plain()?,
        drag,
        drag_pitch_rate: of_drag("pitch_rate")?,
        drag_elevator: of_drag("elevator")?,
        pitch: Pitch { zero, alpha, pitch_rate, elevator },
        side: lateral(&o, "side", "side force")?,
        roll: lateral(&o, "roll", "rolling moment")?,
        yaw: lateral(&o, "yaw", "yawing moment")?,
        stall: stall.transpose()?,
    })
}

fn propulsion(place: &Place<'_>) -> Result<Propulsion, KeyError> {
    let known = [
        "type",
        "diameter",
        "speed_constant",
        "resistance",
        "no_load_current",
        "voltage",
        "thrust",
        "torque",
        "power",
        "advance_ratio",
        "turns",
        "greatest",
    ];
    let kind = place.object(&known)?.required("type")?;
    let common = ["type", "diameter", "speed_constant", "resistance", "no_load_current", "voltage", "turns", "thrust"];
    let (extra, table) = match kind.text()? {
        "thrust" => {
            let o = place.object(&["type", "greatest"])?;
            let greatest = o.optional("greatest").map(|_| positive(&o, "greatest", Dimension::FORCE)).transpose()?;
            return Ok(Propulsion::Thrust { greatest: greatest.unwrap_or(f64::INFINITY) });
        }
        "motor" => (vec!["torque"], false),
        "table" => (vec!["power", "advance_ratio"], true),
        other => return Err(kind.error(format!("'{other}' is not known; known are motor, table, thrust"))),
    };
    let o = place.object(&[common.as_slice(), extra.as_slice()].concat())?;
    let numbers = |key: &str| o.required(key)?.list()?.iter().map(Place::plain).collect::<Result<Vec<f64>, _>>();
    let turns = o.required("turns")?;
    let turns = match turns.text()? {
        "clockwise" => 1.0,
        "counterclockwise" => -1.0,
        other => {
            return Err(turns
                .error(format!("'{other}' is not known; known are clockwise, counterclockwise (seen from behind)")));
        }
    };
    let curve = |key: &str, scale: f64| -> Result<Curve, KeyError> {
        let values: Vec<f64> = numbers(key)?.into_iter().map(|c| c * scale).collect();
        if !table {
            let three = <[f64; 3]>::try_from(values.as_slice());
            return three.map(Curve::Quadratic).map_err(|_| KeyError {
                key: format!("{}.{key}", place.key()),
                message: format!("expected three coefficients c0 + c1 J + c2 J^2, found {}", values.len()),
            });
        }
        let ratios = numbers("advance_ratio")?;
        if ratios.len() != values.len() || ratios.len() < 2 || ratios.windows(2).any(|w| w[0] >= w[1]) {
            return Err(KeyError {
                key: format!("{}.{key}", place.key()),
                message: "expected as many values as advance_ratio has, at least two, and ratios that rise".into(),
            });
        }
        Ok(Curve::Table(ratios.into_iter().zip(values).map(|(j, c)| [j, c]).collect()))
    };
    let diameter = positive(&o, "diameter", LENGTH)?;
    let constant = 1.0 / positive(&o, "speed_constant", Dimension::RATE_PER_VOLTAGE)?;
    let resistance = positive(&o, "resistance", Dimension::RESISTANCE)?;
    Ok(Propulsion::Motor(Motor {
        diameter,
        constant,
        resistance,
        torque_per_volt: constant / resistance,
        loss: constant / resistance * constant * TAU / diameter,
        no_load_current: si(&o, "no_load_current", Dimension::CURRENT, Range::Any)?,
        voltage: positive(&o, "voltage", Dimension::VOLTAGE)?,
        thrust: curve("thrust", 1.0)?,
        // CQ = CP/2π
        torque: if table { curve("power", 1.0 / TAU)? } else { curve("torque", 1.0)? },
        turns,
    }))
}

fn actuator(place: &Place<'_>) -> Result<Actuator, KeyError> {
    let o = place.object(&["frequency", "damping", "limit", "rate_limit", "delay"])?;
    let angle = |p: &Place<'_>| Measured::from_place(p, ANGLE, Range::Any).map(|m| m.si());
    let travel = match o.optional("limit") {
        None => [f64::NEG_INFINITY, f64::INFINITY],
        Some(p) if p.value().is_array() => match p.list()?.as_slice() {
            [lower, upper] => [angle(lower)?, angle(upper)?],
            list => return Err(p.error(format!("expected [lower, upper], found {} values", list.len()))),
        },
        Some(p) => {
            let limit = angle(&p)?;
            [-limit, limit]
        }
    };
    if travel[0] >= travel[1] {
        return Err(place.error("limit: the lower stop is not below the upper one"));
    }
    let delay = o.optional("delay").map(|p| -> Result<f64, KeyError> {
        let delay = Measured::from_place(&p, Dimension::TIME, Range::Any)?;
        if delay.value >= 0.0 {
            return Ok(delay.si());
        }
        Err(p.error(format!("found {} {}, expected zero or more", delay.value, delay.unit)))
    });
    Ok(Actuator {
        frequency: positive(&o, "frequency", RATE)?,
        damping: more_than_zero(&o.required("damping")?)?,
        travel,
        rate_limit: o.optional("rate_limit").map_or(Ok(f64::INFINITY), |_| positive(&o, "rate_limit", RATE))?,
        delay: delay.transpose()?.unwrap_or(0.0),
    })
}

fn positions(place: &Place<'_>) -> Result<Vec<(String, [f64; 3])>, KeyError> {
    let known = ["gyro", "accelerometer", "gnss", "airspeed"];
    let o = place.object(&known)?;
    let mut out = Vec::new();
    for name in known {
        let Some(place) = o.optional(name) else { continue };
        let parts = place.list()?;
        let [x, y, z] = parts.as_slice() else {
            return Err(place.error(format!("expected three lengths forward, right, down, found {}", parts.len())));
        };
        let length = |p: &Place<'_>| Measured::from_place(p, LENGTH, Range::Any).map(|m| m.si());
        out.push((name.to_string(), [length(x)?, length(y)?, length(z)?]));
    }
    Ok(out)
}
