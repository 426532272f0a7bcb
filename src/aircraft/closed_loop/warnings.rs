//! What a margin does not show.

use super::LoopError;
use super::analysis::{FeedResult, HalfResult, Steady, of_feed};
use super::circuit::Source;
use super::document::KNOT;
use super::feed::{Feed, Kind};
use super::half::Half;
use super::modes::least_damped;
use crate::aircraft::flight::Setting;
use crate::aircraft::flight::setting::Control;
use crate::units::digits;

/// An answer to gusts this much worse than that of the raw loop, with a margin that is not smaller: the filter has
/// let go of the airplane. One for a gyro ten times as loud has 1.5 times, for a good reason; one for calm air flown
/// in moderate turbulence 2.1 to 2.3 times.
const WEAKER: f64 = 1.75;
/// Airspeeds closer than this to the design are within what one design covers: 5 % of speed is 10 % of pressure.
const OFF_DESIGN: f64 = 0.05;
/// MIL-F-9490D (1975), 3.1.3.6: 6 dB of gain margin for the modes of the airplane.
const LEAST_GAIN: f64 = 6.0;
/// Surface effectiveness is known to some 20 % from strips and wind tunnels of small airplanes.
const MORE_SURFACE: f64 = 1.25;
/// A damping that falls by more than this share with so much more of the surfaces is one that rests on the model.
const LESS_DAMPING: f64 = 0.7;
/// Severe turbulence of MIL-F-8785C, kt.
const SEVERE: f64 = 45.0;
/// Peaks of a normal law in a minute or so, in standard deviations.
const PEAK: f64 = 3.0;

/// Warnings, feed by feed. `raw` is the loop without a filter.
pub fn warnings(
    setting: &Setting,
    truth: &Setting,
    feeds: &[Feed],
    results: &[FeedResult],
    raw: &FeedResult,
) -> Result<Vec<String>, LoopError> {
    let mut out = Vec::new();
    for (feed, result) in feeds.iter().zip(results) {
        for (half, of_raw) in result.halves.iter().zip(&raw.halves) {
            let (Some(steady), Some(without)) = (&half.steady, &of_raw.steady) else { continue };
            out.extend(weak_loop(result, half, steady, (of_raw, without)));
            out.extend(little_gain(result, half, steady));
            out.extend(saturation(truth, result, half, steady));
        }
        out.extend(off_design(truth, feed));
        if matches!(feed.kind, Kind::Airframe | Kind::Lqg) {
            out.extend(more_surface(setting, truth, feed, result)?);
            out.extend(optimal_gains(setting, feed, result));
        }
    }
    Ok(out)
}

/// A filter that believes its model: large margin, weak loop.
fn weak_loop(result: &FeedResult, half: &HalfResult, steady: &Steady, raw: (&HalfResult, &Steady)) -> Option<String> {
    let (of_raw, without) = raw;
    let name = half.circuit.half.angle_name();
    let gust = |steady: &Steady| steady.rms.iter().find(|rms| rms.name == name).map_or(0.0, |rms| rms.by[0]);
    let damping = |half: &HalfResult| digits(least_damped(&half.modes).map_or(1.0, |mode| mode.damping()));
    let each = half.circuit.half.surfaces().iter().zip(steady.margins.single.iter().zip(&without.margins.single));
    let (surface, (ours, theirs)) = each
        .map(|(surface, (ours, theirs))| (surface, (ours.disk.margin, theirs.disk.margin)))
        .find(|(_, (ours, theirs))| ours > theirs)?;
    (gust(steady) > WEAKER * gust(without)).then(|| {
        format!(
            "{}, {}: a large margin of a weak loop: the {surface} has a disk margin of {} (raw {}), but gusts move \
             {name} by {} deg rms (raw {}), and the least damping is {} (raw {}). The filter \
             follows its model instead of the gyros: was it designed for calmer air?",
            result.name,
            half.circuit.half.title(),
            digits(ours),
            digits(theirs),
            digits(gust(steady).to_degrees()),
            digits(gust(without).to_degrees()),
            damping(half),
            damping(of_raw)
        )
    })
}

/// Less than 6 dB to either side.
fn little_gain(result: &FeedResult, half: &HalfResult, steady: &Steady) -> Vec<String> {
    let surfaces = half.circuit.half.surfaces().iter().zip(&steady.margins.single);
    let mut out = Vec::new();
    for (surface, margins) in surfaces {
        let up = margins.gain_up.filter(|limit| limit.decibels() < LEAST_GAIN);
        out.extend(up.map(|limit| {
            format!(
                "{}, {surface}: a surface {} % more effective than modelled makes the loop oscillate at {} rad/s (gain \
                 margin {} dB; 6 dB is the rule)",
                result.name,
                digits(100.0 * (limit.factor - 1.0)),
                digits(limit.frequency),
                digits(limit.decibels())
            )
        }));
        let down = margins.gain_down.filter(|limit| -limit.decibels() < LEAST_GAIN);
        out.extend(down.map(|limit| {
            format!(
                "{}, {surface}: a surface {} % less effective than modelled makes the loop unstable",
                result.name,
                digits(100.0 * (1.0 - limit.factor))
            )
        }));
    }
    out
}

/// A limit of the servo at three standard deviations, in severe turbulence.
fn saturation(truth: &Setting, result: &FeedResult, half: &HalfResult, steady: &Steady) -> Vec<String> {
    let Some(wind) = truth.wind_at_20ft.filter(|wind| *wind > 0.0) else { return Vec::new() };
    let stronger = (SEVERE * KNOT / wind).max(1.0);
    let mut out = Vec::new();
    let trim = [truth.trim.controls.elevator, truth.trim.controls.aileron, truth.trim.controls.rudder];
    for (surface, number) in half.circuit.half.surfaces().iter().zip(half.circuit.half.actuators()) {
        let Some(actuator) = &truth.airplane.actuators[*number] else { continue };
        let peak = |name: &str, factor: f64| {
            let rms = steady.rms.iter().find(|rms| rms.name == name)?;
            let rest = rms.all * rms.all - rms.by[0] * rms.by[0];
            Some(PEAK * (rest + (factor * rms.by[0]).powi(2)).sqrt())
        };
        let travel = (actuator.travel[1] - trim[*number]).min(trim[*number] - actuator.travel[0]);
        for (name, what, limit, unit) in [
            (format!("{surface}_rate"), "rate", actuator.rate_limit, "deg/s"),
            ((*surface).to_string(), "travel", travel, "deg"),
        ] {
            let Some((here, there)) = peak(&name, 1.0).zip(peak(&name, stronger)) else { continue };
            if there > limit {
                let where_ = if here > limit { "in this turbulence" } else { "in severe turbulence (45 kt)" };
                let needed = if here > limit { here } else { there };
                out.push(format!(
                    "{}, {surface}: {where_} three standard deviations of {what} are {} {unit}, the servo has {}: it \
                     saturates, and nothing here holds then",
                    result.name,
                    digits(needed.to_degrees()),
                    digits(limit.to_degrees())
                ));
            }
        }
    }
    out
}

/// A filter of another airspeed.
fn off_design(truth: &Setting, feed: &Feed) -> Option<String> {
    let speed = truth.trim.airspeed();
    let of = feed.designed.airspeed.filter(|of| (speed / of - 1.0).abs() > OFF_DESIGN)?;
    let (how, what) = if speed > of {
        ("faster", "margins fall with the square of the speed; schedule the filter with the airspeed, as the gains")
    } else {
        ("slower", "it loses little margin, but its estimates rest on another airplane")
    };
    Some(format!("{}: designed for {} m/s and flown at {} m/s, {how}: {what}", feed.name, digits(of), digits(speed)))
}

/// A filter that knows the command and an airplane that answers more to it.
fn more_surface(
    setting: &Setting,
    truth: &Setting,
    feed: &Feed,
    result: &FeedResult,
) -> Result<Vec<String>, LoopError> {
    let mut more = truth.clone();
    more.scale_surfaces(MORE_SURFACE);
    let other = of_feed(setting, &more, feed)?;
    let mut out = Vec::new();
    for (half, with) in result.halves.iter().zip(&other.halves) {
        let damping = |half: &HalfResult| least_damped(&half.modes).map_or(1.0, |mode| mode.damping());
        let (before, after) = (damping(half), damping(with));
        if with.steady.is_none() || after < LESS_DAMPING * before {
            let unstable = if with.steady.is_none() { ", the loop is unstable" } else { "" };
            out.push(format!(
                "{}, {}: with surfaces 25 % more effective than the filter's model the least damping falls from {} to \
                 {}{unstable}",
                result.name,
                half.circuit.half.title(),
                digits(before),
                digits(after)
            ));
        }
    }
    Ok(out)
}

/// A regulator on estimates.
fn optimal_gains(setting: &Setting, feed: &Feed, result: &FeedResult) -> Option<String> {
    let of_true = match (&setting.control, &feed.of_true_states) {
        (_, Some(margins)) => {
            let of = |half: Half| half.surfaces().iter().zip(&margins[usize::from(half == Half::RollYaw)]);
            let each =
                Half::BOTH.into_iter().flat_map(of).map(|(surface, margin)| format!("{surface} {}", digits(*margin)));
            format!(", of the same gains on the true states {}", each.collect::<Vec<_>>().join(", "))
        }
        (Control::Regulator(_), None) => String::new(),
        _ => return None,
    };
    let disks: Vec<String> = result
        .halves
        .iter()
        .filter_map(|half| Some((half, half.steady.as_ref()?)))
        .flat_map(|(half, steady)| half.circuit.half.surfaces().iter().zip(&steady.margins.single))
        .map(|(surface, margins)| format!("{surface} {}", digits(margins.disk.margin)))
        .collect();
    Some(format!(
        "{}: optimal gains on estimated states (LQG) have no guaranteed margin (Doyle 1978); here the disk margins are \
         {}{of_true}. Loop transfer recovery brings them back at the price of surface rate",
        result.name,
        disks.join(", ")
    ))
}

/// What each feed makes better and worse than the raw loop, by more than a hundredth.
pub fn notes(results: &[FeedResult], raw: &FeedResult) -> Vec<String> {
    let mut out = Vec::new();
    for result in results.iter().filter(|result| result.kind != Kind::Raw) {
        let (mut better, mut worse) = (Vec::new(), Vec::new());
        for (half, of_raw) in result.halves.iter().zip(&raw.halves) {
            let (Some(steady), Some(without)) = (&half.steady, &of_raw.steady) else { continue };
            for (ours, theirs) in steady.rms.iter().zip(&without.rms) {
                let change = ours.all / theirs.all - 1.0;
                let words = format!(
                    "{} {} -> {} ({:+.1} %)",
                    ours.name.replace('_', " "),
                    digits(theirs.all.to_degrees()),
                    digits(ours.all.to_degrees()),
                    100.0 * change
                );
                if change < -0.01 {
                    better.push(words);
                } else if change > 0.01 {
                    worse.push(words);
                }
            }
        }
        let list = |words: Vec<String>| if words.is_empty() { "nothing".to_string() } else { words.join(", ") };
        out.push(format!("{}: rms better than raw: {}; worse: {}", result.name, list(better), list(worse)));
        if result.kind == Kind::Drift {
            out.extend(white_noise_stays(result, raw));
        }
    }
    out
}

/// A filter of drift does not take white noise out of the rate.
fn white_noise_stays(result: &FeedResult, raw: &FeedResult) -> Option<String> {
    let white = Source::ALL.iter().position(|source| *source == Source::GyroWhite)?;
    let mut said = Vec::new();
    for (half, of_raw) in result.halves.iter().zip(&raw.halves) {
        let (Some(steady), Some(without)) = (&half.steady, &of_raw.steady) else { continue };
        for (ours, theirs) in steady.rms.iter().zip(&without.rms).filter(|(rms, _)| rms.name.ends_with("_rate")) {
            // what a low-pass behind it takes out is not the filter's
            if ours.by[white] > 0.95 * theirs.by[white] {
                let [from, to] = [theirs, ours].map(|rms| format!("{:.3}", rms.by[white].to_degrees()));
                said.push(format!("{} {from} -> {to} deg/s", ours.name.replace('_', " ")));
            }
        }
    }
    (!said.is_empty()).then(|| {
        format!(
            "{}: does not lower the surface activity that the gyro's white noise makes ({}): it takes off drift; a \
             low-pass or a model takes off noise",
            result.name,
            said.join(", ")
        )
    })
}
