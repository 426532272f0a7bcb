//! Weights of optimal gains, key by key.

use super::{LateralWeights, LongitudinalWeights, LqrEntry};
use crate::params::place::{KeyError, Object, Place};

pub(super) fn lqr(place: &Place<'_>) -> Result<LqrEntry, KeyError> {
    let o = place.object(&["longitudinal", "lateral"])?;
    Ok(LqrEntry {
        longitudinal: longitudinal(&o.required("longitudinal")?)?,
        lateral: lateral(&o.required("lateral")?)?,
    })
}

pub(super) fn longitudinal(place: &Place<'_>) -> Result<LongitudinalWeights, KeyError> {
    let o = place.object(&["states", "elevator"])?;
    Ok(LongitudinalWeights { states: state_weights(&o, "u, w, q, theta")?, elevator: input_weight(&o, "elevator")? })
}

pub(super) fn lateral(place: &Place<'_>) -> Result<LateralWeights, KeyError> {
    let o = place.object(&["states", "aileron", "rudder"])?;
    Ok(LateralWeights {
        states: state_weights(&o, "v, p, r, phi")?,
        aileron: input_weight(&o, "aileron")?,
        rudder: input_weight(&o, "rudder")?,
    })
}

fn state_weights(object: &Object<'_>, names: &str) -> Result<[f64; 4], KeyError> {
    let place = object.required("states")?;
    let values = place.list()?.iter().map(Place::plain).collect::<Result<Vec<f64>, _>>()?;
    <[f64; 4]>::try_from(values.as_slice())
        .ok()
        .filter(|values| values.iter().all(|x| *x >= 0.0))
        .ok_or_else(|| place.error(format!("expected the weights of {names}: four numbers of zero or more")))
}

fn input_weight(object: &Object<'_>, key: &str) -> Result<f64, KeyError> {
    let place = object.required(key)?;
    let value = place.plain()?;
    if value > 0.0 { Ok(value) } else { Err(place.error(format!("found {value}, expected more than zero"))) }
}
