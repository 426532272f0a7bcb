//! The longest part of a moving log in which it is as calm as it ever is.
//!
//! An axis at its calmest: the smallest standard deviation that [`TOGETHER`] consecutive windows keep, none of which
//! stands still. A window is calm if it does not stand still and its own is at most [`NEAR`] times that, its mean is
//! within as much of that of a calm window before it, and it does not turn fast. The part is calm on every axis, and
//! a window shorter on a side that ends in motion: motion may have begun there.

use std::ops::Range;

use super::windows::{PIECE, Windows};
use super::{Clock, FindingKind, Note, Place};
use crate::numerics::reduce::Moments;

/// Windows of which the calmest ones are sought: fewer say too little of a standard deviation's usual scatter.
const TOGETHER: usize = 5;
/// Twice as many: any few windows are calm by their own measure.
const SHORTEST: u64 = 10;
/// Of 64 normal samples the standard deviation is within 1.5 times the usual one but in 1 of 10⁶; correlated ones
/// scatter more. The log check calls a window of three times the usual one motion.
const NEAR: f64 = 2.0;

/// One axis as it is looked at.
pub(super) struct AxisWindows<'a> {
    pub(super) windows: &'a Windows,
    /// What its values are multiples of, if there is such a step.
    pub(super) step: Option<f64>,
    /// The largest mean of a sensor at rest …
    pub(super) most_mean: f64,
    /// … and how far apart the means of its windows are at most.
    pub(super) most_spread: f64,
}

/// The part as a note of the log check; nothing where no part is calm for [`SHORTEST`] windows, or the whole log is.
pub(super) fn note(axes: &[AxisWindows], rows: u64, clock: &Clock) -> Option<Note> {
    let size = axes.iter().map(|axis| axis.windows.size).max()?;
    let part = longest(axes, rows, size)?;
    // where a window begins, for there the time is known
    let places = || axes.iter().flat_map(|axis| &axis.windows.done).map(|(_, place)| *place);
    let first = places().filter(|place| place.index >= part.start).min_by_key(|place| place.index)?;
    let end = places().filter(|place| place.index <= part.end).max_by_key(|place| place.index)?;
    let until = if part.end < rows { end.index } else { rows };
    // nothing is left where the part is rows without a value
    let count = until.checked_sub(first.index).filter(|count| *count >= SHORTEST * PIECE as u64)?;
    // inwards, to the power of ten below a window
    let decimals = -(size as f64 / clock.rate_hz).log10().floor();
    let shown = |seconds: f64, round: fn(f64) -> f64| {
        let scale = 10_f64.powf(decimals);
        format!("{:.*}", decimals.max(0.0) as usize, round(seconds * scale) / scale)
    };
    let mut flags = Vec::new();
    if part.start > 0 {
        flags.push(format!("`start` {}", shown(clock.seconds(first), f64::ceil)));
    }
    if part.end < rows {
        flags.push(format!("`end` {}", shown(clock.seconds(end), f64::floor)));
    }
    Some(Note {
        kind: FindingKind::Calm,
        count,
        first: Some(first),
        message: format!("calmest on every axis: the {count} samples that {} leaves", flags.join(" ")),
        serious: false,
    })
}

/// Rows of the longest part that is calm on every axis.
fn longest(axes: &[AxisWindows], rows: u64, size: u64) -> Option<Range<u64>> {
    let mut moving: Vec<Range<u64>> = Vec::new();
    for axis in axes {
        moving.extend(axis.moving(rows)?);
    }
    moving.sort_unstable_by_key(|range| range.start);
    let mut parts = Vec::new();
    let mut begin = 0;
    for range in moving.into_iter().chain(std::iter::once(rows..rows)) {
        // a window less where motion is next
        let start = if begin > 0 { begin + size } else { 0 };
        let end = if range.start < rows { range.start.saturating_sub(size) } else { rows };
        if end >= start + SHORTEST * size {
            parts.push(start..end);
        }
        begin = begin.max(range.end);
    }
    // the first of those of one length
    parts.sort_by_key(|part| std::cmp::Reverse(part.end - part.start));
    parts.into_iter().find(|part| axes.iter().all(|axis| axis.stays(part))).filter(|part| *part != (0..rows))
}

impl AxisWindows<'_> {
    /// Rows of the windows that are not calm; `None` where nothing can be told.
    fn moving(&self, rows: u64) -> Option<Vec<Range<u64>>> {
        let done = &self.windows.done;
        let deviation = |(moments, _): &(Moments, Place)| moments.variance().sqrt();
        let deviations: Vec<f64> = done.iter().map(deviation).collect();
        let together = |few: &[f64]| few.iter().copied().fold(0.0, f64::max);
        let measures = deviations.windows(TOGETHER).filter(|few| few.iter().all(|d| *d > 0.0)).map(together);
        let calmest = measures.min_by(f64::total_cmp)?;
        // steps that are crossed now and then scatter by up to half of one
        let most = NEAR * calmest.max(0.5 * self.step.unwrap_or(0.0));
        // a log with an offset has a mean that says nothing
        let slow = |moments: &Moments| moments.mean.abs() <= self.most_mean;
        let any_slow = done.iter().any(|window| slow(&window.0) && deviation(window) <= most);
        let ends = done.iter().skip(1).map(|(_, place)| place.index).chain([rows]);
        let mut before = None;
        let mut moving = Vec::new();
        for (((moments, place), deviation), end) in done.iter().zip(deviations).zip(ends) {
            let moved = before.is_some_and(|before: f64| (moments.mean - before).abs() > most);
            // where values stand still that have no steps, there is no sensor
            let lives = deviation > 0.0 || self.step.is_some();
            let calm = lives && deviation <= most && !moved && (slow(moments) || !any_slow);
            before = calm.then_some(moments.mean);
            if !calm {
                moving.push(place.index..end);
            }
        }
        Some(moving)
    }

    /// Whether these rows have values that change, and the means of their windows stay together as those of a sensor
    /// at rest.
    fn stays(&self, rows: &Range<u64>) -> bool {
        let within = || self.windows.done.iter().filter(|(_, place)| rows.contains(&place.index)).map(|(m, _)| m);
        let low = within().fold(f64::INFINITY, |low, m| low.min(m.mean));
        let high = within().fold(f64::NEG_INFINITY, |high, m| high.max(m.mean));
        let values: u64 = within().map(|m| m.count).sum();
        let lives = within().any(|m| m.variance() > 0.0);
        lives && 2 * values >= rows.end - rows.start && high - low <= self.most_spread
    }
}

#[cfg(test)]
mod tests {
    use super::super::Places;
    use super::*;
    use crate::numerics::random::{StreamId, fill_normal, stream};

    const RATE_HZ: f64 = 100.0;
    const ROWS: usize = 20_000;

    fn rest(axis: u32) -> Vec<f64> {
        let mut x = vec![0.0; ROWS];
        fill_normal(&mut stream(11, StreamId { run: 0, axis, term: 0 }), &mut x);
        x
    }

    /// In units of the noise at rest.
    fn found(axes: &[Vec<f64>], step: Option<f64>) -> Option<Note> {
        let windows: Vec<Windows> = axes
            .iter()
            .map(|x| {
                let mut windows = Windows::new();
                // as the check hands them on: without what is not a number
                for (i, v) in x.iter().enumerate().filter(|(_, v)| v.is_finite()) {
                    windows.add_all(&[*v], Places { first: i as u64, times: &[] });
                }
                windows
            })
            .collect();
        let of = |windows| AxisWindows { windows, step, most_mean: 100.0, most_spread: 10.0 };
        let axes: Vec<AxisWindows> = windows.iter().map(of).collect();
        note(&axes, ROWS as u64, &Clock { stamped: false, rate_hz: RATE_HZ, offset_s: 0.0 })
    }

    fn flags_by(axes: &[Vec<f64>], step: Option<f64>) -> String {
        found(axes, step)
            .map_or("none".into(), |note| note.message.split("that ").nth(1).unwrap().replace(" leaves", ""))
    }

    fn flags(axes: &[Vec<f64>]) -> String {
        flags_by(axes, None)
    }

    fn shake(x: &mut [f64], rows: Range<usize>) {
        rows.for_each(|i| x[i] += 20.0 * (i as f64 / 5.0).sin());
    }

    // White noise leaves a window with a probability below 1e-9: nothing here is a matter of chance.
    #[test]
    fn the_longest_part_without_motion_on_any_axis_is_named() {
        assert_eq!(flags(&[rest(0), rest(1)]), "none", "all of it is calm");
        let [mut x, mut y] = [rest(0), rest(1)];
        shake(&mut x, 4000..5000);
        shake(&mut y, 12_500..13_500);
        // windows of 64 samples: the first after the shaking is at 5056, the next shaken one at 12480; and one less
        // on both sides
        assert_eq!(flags(&[x.clone(), y.clone()]), "`start` 51.2 `end` 124.1");
        shake(&mut y, 17_000..17_010);
        assert_eq!(flags(&[x.clone(), y.clone()]), "`start` 51.2 `end` 124.1");
        shake(&mut x, 9000..9100);
        assert_eq!(flags(&[x.clone(), y.clone()]), "`end` 39.0", "from the start on");
        assert_eq!(found(&[x.clone(), y.clone()], None).unwrap().count, 3904);
        // samples that are missing on one axis move its windows
        (100..130).for_each(|i| y[i] = f64::NAN);
        assert_eq!(flags(&[x.clone(), y.clone()]), "`end` 39.0");
        shake(&mut y, 1000..1100);
        assert_eq!(flags(&[x.clone(), y]), "`start` 51.2 `end` 88.9");
        // motion that grows all the time
        (0..ROWS).for_each(|i| x[i] = (i as f64 / 5.0).sin() * 1.01_f64.powi(i as i32));
        assert_eq!(flags(&[x]), "none");
    }

    #[test]
    fn a_turn_that_is_even_is_no_rest() {
        let mut x = rest(2);
        // at rest for 30 s, then an even turn
        (3000..ROWS).for_each(|i| x[i] += 300.0);
        assert_eq!(flags(&[x.clone()]), "`end` 28.8");
        // an offset of a converter is no turn
        x.iter_mut().for_each(|v| *v += 5000.0);
        assert_eq!(flags(&[x]), "`start` 30.8");
        // another position, between two windows
        let mut x = rest(5);
        (3200..ROWS).for_each(|i| x[i] += 5.0);
        assert_eq!(flags(&[x]), "`start` 33.3");
        // slow, and slowly changing
        let mut x = rest(3);
        shake(&mut x, 0..1000);
        assert_eq!(flags(&[x.clone()]), "`start` 10.9");
        (0..ROWS).for_each(|i| x[i] += 20.0 * (i as f64 / 3000.0).sin());
        assert_eq!(flags(&[x]), "none");
    }

    /// With stamps the flags are times of theirs, beyond a gap and where the window after the motion lacks values.
    #[test]
    fn times_are_those_of_the_stamps() {
        let mut x = rest(7);
        shake(&mut x, 4000..5000);
        (5060..5070).for_each(|i| x[i] = f64::NAN);
        let times: Vec<f64> = (0..ROWS).map(|i| 0.01 * i as f64 + if i < 3000 { 0.0 } else { 7.0 }).collect();
        let mut windows = Windows::new();
        for i in (0..ROWS).filter(|i| x[*i].is_finite()) {
            windows.add_all(&[x[i]], Places { first: i as u64, times: &times[i..=i] });
        }
        let axes = [AxisWindows { windows: &windows, step: None, most_mean: 100.0, most_spread: 10.0 }];
        let note = note(&axes, ROWS as u64, &Clock { stamped: true, rate_hz: RATE_HZ, offset_s: 0.0 }).unwrap();
        // the first window after the motion has 74 rows, 5056 to 5129, and is left out: 51.3 s and the gap
        assert_eq!((note.first.unwrap().index, note.count), (5130, ROWS as u64 - 5130), "{}", note.message);
        assert!(note.message.contains("that `start` 58.3 leaves"), "{}", note.message);
    }

    /// A hole of thousands of rows between two motions is no calm part.
    #[test]
    fn rows_without_values_are_not_named() {
        let mut x = rest(8);
        shake(&mut x, 400..4992);
        shake(&mut x, 15_016..ROWS);
        // one calm window, half before the hole and half after
        (5040..15_000).for_each(|i| x[i] = f64::NAN);
        assert_eq!(flags(&[x.clone()]), "none");
        assert_eq!(flags(&[x, vec![f64::NAN; ROWS]]), "none", "an axis without any value");
    }

    /// Values that stand still are neither a rest nor a measure of the noise, however long.
    #[test]
    fn a_stuck_value_is_not_calm() {
        let mut x = rest(4);
        (0..1000).for_each(|i| x[i] = 0.0);
        shake(&mut x, 9000..10_000);
        (10_000..ROWS).for_each(|i| x[i] = 0.0);
        // 960 is the first window that is not all of one value, and one less on that side; 8960 the first with motion
        assert_eq!(flags(&[x]), "`start` 10.3 `end` 88.9");
    }

    /// The longest part without motion has values of two axes only; then the next is named.
    #[test]
    fn all_axes_have_values_in_what_is_named() {
        let [mut x, mut y] = [rest(9), rest(10)];
        shake(&mut x, 5000..6000);
        (6500..ROWS).for_each(|i| y[i] = f64::NAN);
        assert_eq!(flags(&[x.clone()]), "`start` 60.8");
        assert_eq!(flags(&[x, y]), "`end` 49.2");
    }

    /// Of noise of a fifth of a step, windows have none to five values of another step.
    #[test]
    fn steps_that_are_crossed_now_and_then_are_calm() {
        let mut x: Vec<f64> = rest(6).iter().map(|v| (0.2 * v).round()).collect();
        shake(&mut x, 15_000..16_000);
        assert_eq!(flags_by(&[x.clone()], Some(1.0)), "`end` 149.1");
        // but not where they are never crossed
        (0..15_000).for_each(|i| x[i] = 0.0);
        assert_eq!(flags_by(&[x], Some(1.0)), "`start` 160.7");
    }
}
