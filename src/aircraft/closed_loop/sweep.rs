//! The same feeds where one thing is another: corner of the low-pass, noise, airspeed, gust, gain of the surfaces,
//! delay.

use std::path::Path;

use rayon::prelude::*;

use super::LoopError;
use super::analysis::{FeedResult, analyse};
use super::document::KNOT;
use super::feed::{Feed, feeds};
use super::judged::Judged;
use super::varied::{Point, Sweep};
use super::verdict::{best, feed_points, judge};
use crate::aircraft::flight::Setting;
use crate::aircraft::flight::document::FeedEntry;
use crate::params::Measured;
use crate::units::{Unit, digits};

/// What is varied.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Variable {
    Lowpass,
    Noise,
    Airspeed,
    Gust,
    Gain,
    Delay,
}

impl Variable {
    pub const ALL: [Variable; 6] =
        [Variable::Lowpass, Variable::Noise, Variable::Airspeed, Variable::Gust, Variable::Gain, Variable::Delay];

    /// As in requests.
    pub fn name(self) -> &'static str {
        match self {
            Variable::Lowpass => "lowpass",
            Variable::Noise => "noise",
            Variable::Airspeed => "airspeed",
            Variable::Gust => "gust",
            Variable::Gain => "gain",
            Variable::Delay => "delay",
        }
    }

    pub fn named(name: &str) -> Option<Variable> {
        Variable::ALL.into_iter().find(|variable| variable.name() == name)
    }

    /// Unit and meaning of a value.
    fn meaning(self) -> (&'static str, &'static str) {
        match self {
            Variable::Lowpass => ("Hz", "corner of every low-pass"),
            Variable::Noise => {
                ("", "white noise of the gyros over that of the flight; Kalman filters are designed for it")
            }
            Variable::Airspeed => {
                ("m/s", "airspeed; gains and filters stay those of the flight, unless they are scheduled")
            }
            Variable::Gust => ("kt", "wind at 20 ft; filters stay those of the flight"),
            Variable::Gain => ("", "effect of the surfaces over that modelled; gains and filters stay"),
            Variable::Delay => ("samples", "delay from measurement to command; gains and filters stay"),
        }
    }

    fn values(self, setting: &Setting) -> Vec<f64> {
        let speed = setting.trim.airspeed();
        match self {
            Variable::Lowpass => [0.025, 0.035, 0.05, 0.07, 0.1, 0.14, 0.2, 0.28, 0.4].map(|x| x * setting.rate).into(),
            Variable::Noise => vec![0.1, 0.3, 1.0, 2.0, 3.0, 5.0, 10.0, 30.0],
            Variable::Airspeed => [0.7, 0.8, 0.9, 1.0, 1.1, 1.2, 1.3].map(|x| x * speed).into(),
            Variable::Gust => vec![1.0, 5.0, 10.0, 15.0, 20.0, 30.0, 45.0],
            Variable::Gain => vec![0.5, 0.7, 0.8, 1.0, 1.25, 1.5, 2.0],
            Variable::Delay => (0..=5).map(f64::from).collect(),
        }
    }
}

/// Everything that is judged at one value.
fn at(
    judged: &Judged,
    entries: &[FeedEntry],
    folder: &Path,
    variable: Variable,
    value: f64,
) -> Result<Vec<FeedResult>, LoopError> {
    let mut truth = judged.truth.clone();
    let mut setting = judged.setting.clone();
    let mut made: Option<Vec<Feed>> = None;
    match variable {
        Variable::Lowpass => {
            let corner = |corner: &mut Measured| *corner = Measured::from_si(value, None, Unit::hertz());
            let mut entries = entries.to_vec();
            for entry in &mut entries {
                let name = entry.name();
                match entry {
                    FeedEntry::Lowpass { name: given, corner: own, .. } => {
                        corner(own);
                        *given = Some(name);
                    }
                    FeedEntry::Drift { name: given, lowpass: Some(low), .. }
                    | FeedEntry::Airframe { name: given, lowpass: Some(low), .. } => {
                        corner(&mut low.corner);
                        *given = Some(name);
                    }
                    _ => {}
                }
            }
            made = Some(feeds(&setting, &entries, folder, truth.trim.airspeed())?);
        }
        Variable::Noise => {
            for setting in [&mut setting, &mut truth] {
                let gyro = setting
                    .gyro
                    .as_mut()
                    .ok_or_else(|| LoopError("sensors.gyro: missing; there is no noise to vary".into()))?;
                let white = |path: &str| ["white", "moving_average", "band_limit"].iter().any(|k| path.starts_with(k));
                for axis in &mut gyro.axes {
                    let densities = axis.noise_parameters().filter(|(path, _)| white(path));
                    densities.for_each(|(_, density)| density.value *= value);
                }
            }
            // files of filters stay what they are
            made = Some(feeds(&setting, entries, folder, truth.trim.airspeed())?);
        }
        Variable::Airspeed => {
            truth = truth.designed_for(Some(value), None)?;
            // a schedule knows the airspeed
            made = Some(feeds(&setting, entries, folder, value)?);
        }
        Variable::Gust => truth = truth.designed_for(None, Some(value * KNOT))?,
        Variable::Gain => truth.scale_surfaces(value),
        Variable::Delay => truth.delay = value as u64,
    }
    analyse(&setting, &truth, made.as_deref().unwrap_or(&judged.feeds))
}

/// All values in parallel; `entries` and `folder` are those of the document. Errors: there is nothing to vary.
pub fn sweep(judged: &Judged, entries: &[FeedEntry], folder: &Path, variable: Variable) -> Result<Sweep, LoopError> {
    let has_low = |entry: &FeedEntry| {
        matches!(
            entry,
            FeedEntry::Lowpass { .. }
                | FeedEntry::Drift { lowpass: Some(_), .. }
                | FeedEntry::Airframe { lowpass: Some(_), .. }
        )
    };
    if variable == Variable::Lowpass && !entries.iter().any(has_low) {
        return Err(LoopError("feeds: no low-pass whose corner could be varied; add one".into()));
    }
    if variable == Variable::Gust && judged.truth.wind_at_20ft.is_none() {
        return Err(LoopError("gusts: no turbulence by a wind at 20 ft that could be varied; add it".into()));
    }
    let values = variable.values(&judged.truth);
    let point = |value: &f64| match at(judged, entries, folder, variable, *value) {
        Err(error) => Point { value: *value, none: Some(error.0), feeds: Vec::new(), best: None },
        Ok(results) => {
            let feeds = feed_points(&results, &judge(&results.iter().collect::<Vec<_>>(), &judged.criteria));
            Point { value: *value, none: None, best: best(&feeds).map(|feed| feed.name.clone()), feeds }
        }
    };
    let points: Vec<Point> = values.par_iter().map(point).collect();
    let (unit, meaning) = variable.meaning();
    let changes = changes(&points, unit);
    Ok(Sweep { variable: variable.name(), unit, meaning, points, changes })
}

fn changes(points: &[Point], unit: &str) -> Vec<String> {
    let name = |point: &Point| point.best.clone().unwrap_or_else(|| "no feed keeps every criterion".into());
    let known: Vec<&Point> = points.iter().filter(|point| point.none.is_none()).collect();
    let change = |pair: &[&Point]| {
        (pair[0].best != pair[1].best).then(|| {
            format!(
                "between {} and {}: {} -> {}",
                digits(pair[0].value),
                format!("{} {unit}", digits(pair[1].value)).trim_end(),
                name(pair[0]),
                name(pair[1])
            )
        })
    };
    known.windows(2).filter_map(change).collect()
}
