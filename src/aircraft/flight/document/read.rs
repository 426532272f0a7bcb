//! flight.json key by key.

use std::path::PathBuf;

use serde_json::Value;

use super::values::{ANGLE, LENGTH, RATE, VELOCITY, linked, required, value, word};
use super::{
    AutopilotEntry, ControlsEntry, DriftEntry, EarthEntry, ErrorEntry, FORMAT, FlightDocument, GainsEntry, GnssEntry,
    GustEntry, InitialEntry, PlaceEntry, SensorsEntry, TrimEntry, WindEntry, criteria, feeds, optimize, rule,
    uncertainty, weights,
};
use crate::aircraft::atmosphere::discrete::Form;
use crate::aircraft::atmosphere::dryden::Specification;
use crate::params::place::{KeyError, Place};
use crate::params::{Measured, Range};
use crate::units::Dimension;

const LATERAL: [&str; 3] = ["zero_sideslip", "zero_side_force", "wings_level"];

pub(super) fn flight(place: &Place<'_>) -> Result<FlightDocument, KeyError> {
    let known = [
        "format",
        "airplane",
        "trim",
        "initial",
        "controls",
        "earth",
        "ground",
        "wind",
        "gusts",
        "sensors",
        "autopilot",
        "feeds",
        "criteria",
        "uncertainty",
        "optimize",
    ];
    let o = place.document(FORMAT, "flight.json", &known)?;
    let many = |place: Place<'_>| place.one_or_many()?.iter().map(gust).collect::<Result<Vec<_>, _>>();
    let feeds = o.optional("feeds").map(|p| feeds::feeds(&p)).transpose()?.unwrap_or_default();
    Ok(FlightDocument {
        format: FORMAT.into(),
        airplane: linked(&o.required("airplane")?)?,
        trim: o.optional("trim").map(|p| trim(&p)).transpose()?,
        initial: o.optional("initial").map(|p| initial(&p)).transpose()?,
        controls: o.optional("controls").map(|p| controls(&p)).transpose()?.unwrap_or_default(),
        earth: o.optional("earth").map(|p| earth(&p)).transpose()?.unwrap_or_default(),
        ground: value(&o, "ground", LENGTH, Range::Any)?,
        wind: o.optional("wind").map(|p| wind(&p)).transpose()?,
        gusts: o.optional("gusts").map(many).transpose()?.unwrap_or_default(),
        sensors: o.optional("sensors").map(|p| sensors(&p)).transpose()?.unwrap_or_default(),
        autopilot: o.optional("autopilot").map(|p| autopilot(&p)).transpose()?,
        criteria: o.optional("criteria").map(|p| criteria::criteria(&p)).transpose()?,
        feeds,
        uncertainty: o.optional("uncertainty").map(|p| uncertainty::uncertainty(&p)).transpose()?,
        optimize: o.optional("optimize").map(|p| optimize::optimize(&p)).transpose()?,
    })
}

fn trim(place: &Place<'_>) -> Result<TrimEntry, KeyError> {
    let o = place.object(&["airspeed", "altitude", "climb", "turn_rate", "bank", "lateral"])?;
    let altitude =
        o.required("altitude").map_err(|e| KeyError { message: "missing; for example \"100 m\"".into(), ..e })?;
    let entry = TrimEntry {
        airspeed: required(&o, "airspeed", VELOCITY)?,
        altitude: Measured::from_place(&altitude, LENGTH, Range::Any)?,
        climb: value(&o, "climb", ANGLE, Range::Any)?,
        turn_rate: value(&o, "turn_rate", RATE, Range::Any)?,
        bank: value(&o, "bank", ANGLE, Range::Any)?,
        lateral: o.optional("lateral").map(|p| word(&p, &LATERAL).map(str::to_string)).transpose()?,
    };
    if let (Some(_), Some(bank)) = (&entry.turn_rate, o.optional("bank")) {
        return Err(bank.error("stands beside turn_rate; give one of both"));
    }
    Ok(entry)
}

fn initial(place: &Place<'_>) -> Result<InitialEntry, KeyError> {
    let known = ["u", "v", "w", "phi", "theta", "psi", "p", "q", "r", "altitude", "latitude", "longitude"];
    let o = place.object(&known)?;
    let get = |key: &str, dimension| value(&o, key, dimension, Range::Any);
    Ok(InitialEntry {
        u: get("u", VELOCITY)?,
        v: get("v", VELOCITY)?,
        w: get("w", VELOCITY)?,
        phi: get("phi", ANGLE)?,
        theta: get("theta", ANGLE)?,
        psi: get("psi", ANGLE)?,
        p: get("p", RATE)?,
        q: get("q", RATE)?,
        r: get("r", RATE)?,
        altitude: get("altitude", LENGTH)?,
        latitude: get("latitude", ANGLE)?,
        longitude: get("longitude", ANGLE)?,
    })
}

fn controls(place: &Place<'_>) -> Result<ControlsEntry, KeyError> {
    if let Value::String(path) = place.value() {
        return Ok(ControlsEntry { file: Some(path.into()), ..ControlsEntry::default() });
    }
    let o = place.object(&["elevator", "aileron", "rudder", "throttle", "thrust", "file"])?;
    let angle = |key: &str| value(&o, key, ANGLE, Range::Any);
    let throttle = o.optional("throttle");
    let entry = ControlsEntry {
        elevator: angle("elevator")?,
        aileron: angle("aileron")?,
        rudder: angle("rudder")?,
        throttle: throttle.as_ref().map(Place::plain).transpose()?,
        thrust: value(&o, "thrust", Dimension::FORCE, Range::Any)?,
        file: o.optional("file").map(|p| p.text().map(PathBuf::from)).transpose()?,
    };
    if let (Some(place), Some(throttle)) = (&throttle, entry.throttle)
        && !(0.0..=1.0).contains(&throttle)
    {
        return Err(place.error(format!("found {throttle}, expected 0 to 1")));
    }
    if let (Some(place), Some(_)) = (&throttle, &entry.thrust) {
        return Err(place.error("stands beside thrust; give the one that the airplane's propulsion has"));
    }
    Ok(entry)
}

fn earth(place: &Place<'_>) -> Result<EarthEntry, KeyError> {
    match place.value() {
        Value::String(text) if text == "flat" => return Ok(EarthEntry::Flat),
        Value::String(text) if text == "wgs84" => {
            return Ok(EarthEntry::Wgs84(Box::default()));
        }
        Value::String(text) => return Err(place.error(format!("'{text}' is not known; known are flat, wgs84"))),
        _ => {}
    }
    let o = place.object(&["wgs84"])?.required("wgs84")?;
    let o = o.object(&["latitude", "longitude", "heading"])?;
    let angle = |key: &str| value(&o, key, ANGLE, Range::Any);
    Ok(EarthEntry::Wgs84(Box::new(PlaceEntry {
        latitude: angle("latitude")?,
        longitude: angle("longitude")?,
        heading: angle("heading")?,
    })))
}

fn wind(place: &Place<'_>) -> Result<WindEntry, KeyError> {
    let o = place.object(&["north", "east", "down"])?;
    let velocity = |key: &str| value(&o, key, VELOCITY, Range::Any);
    Ok(WindEntry { north: velocity("north")?, east: velocity("east")?, down: velocity("down")? })
}

fn gust(place: &Place<'_>) -> Result<GustEntry, KeyError> {
    let known = [
        "model",
        "specification",
        "wind_at_20ft",
        "std_dev",
        "exceedance",
        "height",
        "airspeed",
        "form",
        "length",
        "u",
        "v",
        "w",
        "start",
    ];
    let model = word(&place.object(&known)?.required("model")?, &["dryden", "1-cos"])?;
    if model == "dryden" {
        let o =
            place.object(&["model", "specification", "wind_at_20ft", "std_dev", "exceedance", "height", "airspeed"])?;
        let named = o.required("specification")?;
        let specification = Specification::from_name(named.text()?)
            .ok_or_else(|| named.error(format!("known are {}", Specification::NAMES.join(", "))))?;
        let exceedance = o.optional("exceedance");
        if let (Some(_), Some(place)) = (o.optional("std_dev"), &exceedance) {
            return Err(place.error("stands beside std_dev; give one of both"));
        }
        return Ok(GustEntry::Dryden {
            specification,
            exceedance: exceedance.as_ref().map(Place::plain).transpose()?,
            wind_at_20ft: value(&o, "wind_at_20ft", VELOCITY, Range::Positive)?,
            std_dev: value(&o, "std_dev", VELOCITY, Range::Positive)?,
            height: value(&o, "height", LENGTH, Range::Positive)?,
            airspeed: value(&o, "airspeed", VELOCITY, Range::Positive)?,
        });
    }
    let o = place.object(&["model", "form", "length", "u", "v", "w", "start"])?;
    let form = match word(&o.required("form")?, &["hold", "return"])? {
        "hold" => Form::Hold,
        _ => Form::Return,
    };
    let velocity = |key: &str| value(&o, key, VELOCITY, Range::Any);
    let entry = GustEntry::Discrete {
        form,
        length: required(&o, "length", LENGTH)?,
        u: velocity("u")?,
        v: velocity("v")?,
        w: velocity("w")?,
        start: value(&o, "start", Dimension::TIME, Range::Any)?,
    };
    if let GustEntry::Discrete { u: None, v: None, w: None, .. } = entry {
        return Err(place.error("no velocity; give u, v or w, for example \"w\": \"-3 m/s\" for an up-gust"));
    }
    Ok(entry)
}

fn sensors(place: &Place<'_>) -> Result<SensorsEntry, KeyError> {
    let o = place.object(&["rate", "gyro", "accelerometer", "attitude", "airspeed", "altitude", "gnss"])?;
    let error = |key: &str, dimension| o.optional(key).map(|p| errors(&p, dimension)).transpose();
    Ok(SensorsEntry {
        rate: value(&o, "rate", Dimension::FREQUENCY, Range::Positive)?,
        gyro: o.optional("gyro").map(|p| linked(&p)).transpose()?,
        accelerometer: o.optional("accelerometer").map(|p| linked(&p)).transpose()?,
        attitude: error("attitude", ANGLE)?,
        airspeed: error("airspeed", VELOCITY)?,
        altitude: error("altitude", LENGTH)?,
        gnss: o.optional("gnss").map(|p| gnss(&p)).transpose()?,
    })
}

fn gnss(place: &Place<'_>) -> Result<GnssEntry, KeyError> {
    let o = place.object(&["position", "velocity", "rate"])?;
    let error = |key: &str, dimension| o.optional(key).map(|p| errors(&p, dimension)).transpose();
    Ok(GnssEntry {
        position: error("position", LENGTH)?,
        velocity: error("velocity", VELOCITY)?,
        rate: value(&o, "rate", Dimension::FREQUENCY, Range::Positive)?,
    })
}

/// White noise: a density, or the standard deviation of one measurement.
fn white(place: &Place<'_>, dimension: Dimension) -> Result<Measured, KeyError> {
    let density = Measured::from_place(place, dimension.times_time(1), Range::Positive);
    density.or_else(|_| Measured::from_place(place, dimension, Range::Positive))
}

fn errors(place: &Place<'_>, dimension: Dimension) -> Result<ErrorEntry, KeyError> {
    let short = place.value().is_string() || place.value().get("value").is_some();
    if short {
        return Ok(ErrorEntry { white: Some(white(place, dimension)?), gauss_markov: None, rate: None });
    }
    let o = place.object(&["white", "gauss_markov", "rate"])?;
    let drift = |p: Place<'_>| -> Result<DriftEntry, KeyError> {
        let o = p.object(&["std_dev", "correlation_time"])?;
        Ok(DriftEntry {
            std_dev: required(&o, "std_dev", dimension)?,
            correlation_time: required(&o, "correlation_time", Dimension::TIME)?,
        })
    };
    Ok(ErrorEntry {
        white: o.optional("white").map(|p| white(&p, dimension)).transpose()?,
        gauss_markov: o.optional("gauss_markov").map(drift).transpose()?,
        rate: value(&o, "rate", Dimension::FREQUENCY, Range::Positive)?,
    })
}

fn autopilot(place: &Place<'_>) -> Result<AutopilotEntry, KeyError> {
    let o = place.object(&["rate", "delay", "gains", "lqr", "rule", "attitude_filter", "pitch", "bank"])?;
    let (of_gains, of_lqr, of_rule) = (o.optional("gains"), o.optional("lqr"), o.optional("rule"));
    if [&of_gains, &of_lqr, &of_rule].into_iter().flatten().count() != 1 {
        return Err(place.error("expected one of gains, lqr and rule, by which the surfaces move"));
    }
    Ok(AutopilotEntry {
        rate: required(&o, "rate", Dimension::FREQUENCY)?,
        delay: o.optional("delay").map(|p| samples(&p)).transpose()?.unwrap_or(1),
        gains: of_gains.map(|p| gains(&p)).transpose()?,
        lqr: of_lqr.map(|p| weights::lqr(&p)).transpose()?,
        rule: of_rule.map(|p| rule::rule(&p)).transpose()?,
        attitude_filter: value(&o, "attitude_filter", Dimension::TIME, Range::Positive)?,
        pitch: value(&o, "pitch", ANGLE, Range::Any)?,
        bank: value(&o, "bank", ANGLE, Range::Any)?,
    })
}

/// 1, "1" or "1 sample".
fn samples(place: &Place<'_>) -> Result<u64, KeyError> {
    let Value::String(text) = place.value() else { return place.count() };
    let mut words = text.split_whitespace();
    let count = words.next().and_then(|word| word.parse().ok());
    let unit = words.next().is_none_or(|word| matches!(word, "sample" | "samples"));
    count.filter(|_| unit && words.next().is_none()).ok_or_else(|| {
        place.error(format!("expected a whole number of samples, for example \"1 sample\", found \"{text}\""))
    })
}

fn gains(place: &Place<'_>) -> Result<GainsEntry, KeyError> {
    let o = place.object(&["kq", "ktheta", "kp", "kphi", "kr", "washout"])?;
    let time = |key: &str| Measured::from_place(&o.required(key)?, Dimension::TIME, Range::Any);
    Ok(GainsEntry {
        kq: time("kq")?,
        ktheta: o.required("ktheta")?.plain()?,
        kp: time("kp")?,
        kphi: o.required("kphi")?.plain()?,
        kr: time("kr")?,
        washout: value(&o, "washout", Dimension::TIME, Range::Positive)?,
    })
}
