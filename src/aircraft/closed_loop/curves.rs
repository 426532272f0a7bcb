//! What figures of a loop are drawn of: loop gains, sensitivities and what a low-pass of any corner would do.

use nalgebra::Complex;

use super::LoopError;
use super::analysis::{FeedResult, HalfResult, gust_of, loop_gain, of_feed, response};
use super::feed::{Designed, Feed, Kind};
use super::filters::lowpass;
use super::flights::Course;
use super::half::{ANGLE, Half};
use super::half_feed::raw;
use crate::aircraft::flight::Setting;

/// Frequencies of a curve, rad/s, over the motions of an airplane and up to half the rate of the autopilot.
fn frequencies(half: &HalfResult) -> Vec<f64> {
    let (low, high): (f64, f64) = (0.1, std::f64::consts::PI / half.circuit.interval);
    (0..=300).map(|i| low * (high / low).powf(f64::from(i) / 300.0)).collect()
}

/// L of a surface, the others closed, with its frequencies (rad/s).
pub fn gain(half: &HalfResult, surface: usize) -> Vec<(f64, Complex<f64>)> {
    let frequencies = frequencies(half);
    let gains = loop_gain(&half.circuit, surface, &frequencies);
    frequencies.into_iter().zip(gains).collect()
}

/// The angle (rad) over time (s) after the airplane meets a 1 − cos gust, of a stable loop.
pub fn gust_answer(truth: &Setting, half: &HalfResult) -> Vec<(f64, f64)> {
    if half.steady.is_none() {
        return Vec::new();
    }
    let gust = gust_of(truth, half.circuit.half);
    let course = response(&half.circuit, &half.circuit.command, Some(&gust));
    course.iter().enumerate().map(|(k, x)| (k as f64 * half.circuit.interval, x[ANGLE])).collect()
}

/// What only figures show.
#[derive(Clone, Debug)]
pub struct Drawn {
    pub corners: Vec<Corner>,
    /// One flight of every feed, or why there is none.
    pub flight: Result<Vec<Course>, LoopError>,
}

impl Drawn {
    /// Where nothing is drawn.
    pub const NONE: Drawn = Drawn { corners: Vec::new(), flight: Ok(Vec::new()) };
}

/// What a low-pass of order two does at a corner.
#[derive(Clone, Debug)]
pub struct Corner {
    /// Hz.
    pub corner: f64,
    pub result: FeedResult,
}

/// Raw gyro behind a second-order low-pass, at corners from a fortieth to four tenths of the rate.
pub fn corners(setting: &Setting, truth: &Setting) -> Result<Vec<Corner>, LoopError> {
    // below a fortieth of the rate no rate loop of that rate lives; above four tenths the low-pass is none
    let (low, high): (f64, f64) = (setting.rate / 40.0, 0.4 * setting.rate);
    (0..=8)
        .map(|i| {
            let corner = low * (high / low).powf(f64::from(i) / 8.0);
            let filter = lowpass(2, corner, setting.interval());
            let half = |half: Half| raw(setting, half).behind(&[filter.clone(), filter.clone()], half);
            let feed = Feed {
                name: format!("LP2 {corner:.3} Hz"),
                kind: Kind::Lowpass,
                halves: Half::BOTH.map(half),
                designed: Designed::default(),
                of_true_states: None,
            };
            Ok(Corner { corner, result: of_feed(setting, truth, &feed)? })
        })
        .collect()
}
