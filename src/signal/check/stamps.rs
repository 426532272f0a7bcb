//! Time stamps: what rate they say, whether they can be trusted, where samples are missing.
//!
//! Rules, with T the period:
//! - A row with the same stamp as the row before is a *repeated stamp*; the step to the next new stamp is shared
//!   among the rows it covers.
//! - The typical step is the middle of the two quartiles, the robust spread their distance over 1.349. The stamps
//!   are *usable* if the spread is at most 0.35 of the typical step, and if long steps are rare (at most 2 %) or
//!   explain at most 30 % of the time. Otherwise they are taken for host arrival times: only their mean rate is used
//!   (least-squares line through all stamps) and no gap is inferred.
//! - A step longer than 1.5 T is a *gap* of round(step/T) − 1 samples, unless the next step is short by as much (two
//!   steps within 2.5 T): then one stamp was late.
//! - T is the typical step, refined to (span − gaps) / (steps outside gaps), so that it does not drift over a long log.

use pulp::{Arch, NullaryFnOnce};

use super::line::Line;
use super::robust::{Sample, quantile};
use super::windows::Extent;
use super::{Place, Places};
use crate::signal::Gap;

/// More gaps than this are no gaps but another clock.
const MOST_CANDIDATES: usize = 1 << 20;
const STARTUP: usize = 1024;
const LARGEST_SPREAD: f64 = 0.35;
const RARE: f64 = 0.02;
const LARGEST_MISSING_SHARE: f64 = 0.3;
/// A gap is counted up to here, some years of any sensor: sums over all gaps do not overflow. Longer ones come from
/// damaged stamps.
const LONGEST_GAP: u64 = 1 << 40;

/// The step that ends at `place` and covers `periods` rows.
#[derive(Clone, Copy, Debug)]
struct Step {
    place: Place,
    seconds: f64,
    periods: u64,
}

impl Step {
    fn each(&self) -> f64 {
        self.seconds / self.periods as f64
    }
}

/// How often and where first.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Count {
    pub(super) count: u64,
    pub(super) first: Option<Place>,
}

impl Count {
    pub(super) fn add(&mut self, place: Place) {
        self.count += 1;
        self.first.get_or_insert(place);
    }
}

/// Streaming statistics of the stamps.
#[derive(Clone, Debug)]
pub(super) struct Stamps {
    rows: u64,
    first: f64,
    last: f64,
    repeats: u64,
    pub(super) repeated: Count,
    pub(super) backward: Count,
    /// Period from the first steps (or from an earlier pass); long steps are kept relative to it.
    provisional: Option<f64>,
    second_pass: bool,
    startup: Vec<Step>,
    /// Steps over 1.2 provisional periods, each with the step after it.
    long: Vec<(Step, f64)>,
    next_wanted: bool,
    overflow: bool,
    sample: Sample,
    steps: u64,
    pub(super) longest: f64,
    /// Of the stamps over the row numbers.
    line: Line,
    scratch: Vec<f64>,
}

/// What the stamps say.
#[derive(Clone, Debug)]
pub(super) struct Timing {
    pub(super) usable: bool,
    pub(super) period: f64,
    /// Robust spread of the steps, s.
    pub(super) spread: f64,
    pub(super) gaps: Vec<Gap>,
    pub(super) longest_gap: f64,
    /// Stamp of the first sample after a gap.
    pub(super) first_gap_s: f64,
}

pub(super) enum Verdict {
    Timing(Timing),
    /// The beginning was not typical: look again, knowing the period.
    LookAgain(f64),
    /// No two different stamps.
    NoTime,
}

/// [`Stamps::add_steps`] as it is called where the processor can do more at once; every way gives the same.
struct Regular<'a> {
    stamps: &'a mut Stamps,
    times: &'a [f64],
    row: u64,
}

impl NullaryFnOnce for Regular<'_> {
    type Output = bool;

    #[inline(always)]
    fn call(self) -> bool {
        self.stamps.add_steps(self.times, self.row)
    }
}

impl Stamps {
    pub(super) fn new(period: Option<f64>) -> Self {
        Stamps {
            rows: 0,
            first: f64::NAN,
            last: f64::NAN,
            repeats: 0,
            repeated: Count::default(),
            backward: Count::default(),
            provisional: period,
            second_pass: period.is_some(),
            startup: Vec::new(),
            long: Vec::new(),
            next_wanted: false,
            overflow: false,
            sample: Sample::new(1 << 16),
            steps: 0,
            longest: 0.0,
            line: Line::default(),
            scratch: Vec::new(),
        }
    }

    /// The stamps of further rows, those that are not finite left out: many at once where the steps are regular,
    /// with the same result as one by one. The first row at which time goes back and the stamp before it, if
    /// `strict`; nothing is read beyond.
    pub(super) fn add_all(&mut self, mut places: Places, strict: bool) -> Option<(usize, f64)> {
        const PART: usize = 512;
        let mut done = 0;
        while !places.times.is_empty() {
            let part = &places.times[..places.times.len().min(PART)];
            if !self.add_regular(part, places.first) {
                for (i, time) in part.iter().enumerate().filter(|(_, time)| time.is_finite()) {
                    let back = self.add(Place { index: places.first + i as u64, time_s: *time });
                    if let Some(from) = back.filter(|_| strict) {
                        return Some((done + i, from));
                    }
                }
            }
            done += part.len();
            places = places.skip(part.len());
        }
        None
    }

    /// Takes the stamps if every step goes on and none is long.
    fn add_regular(&mut self, times: &[f64], row: u64) -> bool {
        Arch::new().dispatch(Regular { stamps: self, times, row })
    }

    #[inline(always)]
    fn add_steps(&mut self, times: &[f64], row: u64) -> bool {
        let Some(period) = self.provisional.filter(|_| self.rows > 0 && self.repeats == 0) else { return false };
        let mut steps = std::mem::take(&mut self.scratch);
        steps.clear();
        steps.push(times[0] - self.last);
        steps.extend(times.windows(2).map(|pair| pair[1] - pair[0]));
        let regular = steps.iter().fold(true, |all, step| all & (*step > 0.0) & (*step <= 1.2 * period));
        if regular {
            self.rows += times.len() as u64;
            self.line.add(row, times);
            self.last = times[times.len() - 1];
            self.longest = self.longest.max(Extent::of(&steps).largest);
            self.steps += steps.len() as u64;
            self.sample.add_all(&steps);
            if let Some((_, next)) = self.long.last_mut().filter(|_| self.next_wanted) {
                *next = steps[0];
            }
            self.next_wanted = false;
        }
        self.scratch = steps;
        regular
    }

    /// The stamp of the next row; `Some(previous)` if time goes back.
    pub(super) fn add(&mut self, place: Place) -> Option<f64> {
        let time = place.time_s;
        self.rows += 1;
        self.line.add(place.index, &[time]);
        if self.rows == 1 {
            (self.first, self.last) = (time, time);
            return None;
        }
        let seconds = time - self.last;
        if seconds == 0.0 {
            self.repeats += 1;
            self.repeated.add(place);
            return None;
        }
        let previous = self.last;
        self.last = time;
        let periods = self.repeats + 1;
        self.repeats = 0;
        if seconds < 0.0 {
            self.backward.add(place);
            return Some(previous);
        }
        self.longest = self.longest.max(seconds);
        self.record(Step { place, seconds, periods });
        None
    }

    fn record(&mut self, step: Step) {
        self.steps += 1;
        self.sample.add(step.each());
        match self.provisional {
            Some(period) => self.sift(period, step),
            None => {
                self.startup.push(step);
                if self.startup.len() == STARTUP {
                    self.settle();
                }
            }
        }
    }

    fn settle(&mut self) {
        let startup = std::mem::take(&mut self.startup);
        let (period, _) = typical_and_spread(startup.iter().map(Step::each).collect());
        self.provisional = Some(period);
        startup.into_iter().for_each(|step| self.sift(period, step));
    }

    fn sift(&mut self, period: f64, step: Step) {
        if self.next_wanted {
            if let Some((_, next)) = self.long.last_mut() {
                *next = step.each();
            }
            self.next_wanted = false;
        }
        if step.each() > 1.2 * period {
            if self.long.len() < MOST_CANDIDATES {
                self.long.push((step, f64::INFINITY));
                self.next_wanted = true;
            } else {
                self.overflow = true;
            }
        }
    }

    /// Mean period by least squares.
    pub(super) fn mean_period(&self) -> f64 {
        self.line.slope()
    }

    pub(super) fn finish(mut self) -> Verdict {
        if self.provisional.is_none() {
            self.settle();
        }
        let mean = self.mean_period();
        if self.steps == 0 || mean.is_nan() || mean <= 0.0 {
            return Verdict::NoTime;
        }
        let (step, spread) = typical_and_spread(self.sample.values());
        let known = self.provisional.is_some_and(|p| step >= 0.8 * p && !(self.overflow && step > 1.2 * p));
        if !known && !self.second_pass {
            return Verdict::LookAgain(step);
        }
        let arrival =
            Timing { usable: false, period: mean, spread, gaps: Vec::new(), longest_gap: 0.0, first_gap_s: f64::NAN };
        if self.overflow || spread > LARGEST_SPREAD * step {
            return Verdict::Timing(arrival);
        }
        let long: Vec<Step> = self
            .long
            .iter()
            .filter(|(long, next)| long.each() > 1.5 * step && long.each() + next > 2.5 * step)
            .map(|(long, _)| *long)
            .collect();
        // the steps that are not long, and the time they take
        let all: u64 = self.rows - 1 - self.repeats - self.backward.count;
        let inside = all.saturating_sub(long.iter().map(|s| s.periods).sum());
        let regular = (self.last - self.first) - long.iter().map(|s| s.seconds).sum::<f64>();
        let period = if inside > 0 && self.backward.count == 0 { regular / inside as f64 } else { step };
        let missing =
            |step: &Step| ((step.seconds / period).round() as u64).saturating_sub(step.periods).min(LONGEST_GAP);
        let open: Vec<&Step> = long.iter().filter(|step| missing(step) > 0).collect();
        let gaps: Vec<Gap> =
            open.iter().map(|step| Gap { index: step.place.index as usize, missing: missing(step) }).collect();
        let absent: u64 = gaps.iter().map(|g| g.missing).sum();
        let share = absent as f64 / (absent + self.rows) as f64;
        if gaps.len() as f64 > RARE * self.steps as f64 && share > LARGEST_MISSING_SHARE {
            return Verdict::Timing(arrival);
        }
        let longest_gap = open.iter().map(|s| s.seconds).fold(0.0, f64::max);
        let first_gap_s = open.first().map_or(f64::NAN, |s| s.place.time_s);
        Verdict::Timing(Timing { usable: true, period, spread, gaps, longest_gap, first_gap_s })
    }
}

/// Middle and distance of the quartiles, the distance as the standard deviation of a normal law.
fn typical_and_spread(mut steps: Vec<f64>) -> (f64, f64) {
    steps.sort_unstable_by(f64::total_cmp);
    let (lower, upper) = (quantile(&steps, 0.25), quantile(&steps, 0.75));
    let (typical, spread) = (0.5 * (lower + upper), (upper - lower) / 1.349);
    // below the rounding of the stamps there is no spread
    (typical, if spread < 1e-9 * typical { 0.0 } else { spread })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn judge(times: &[f64]) -> Verdict {
        let run = |period| {
            let mut stamps = Stamps::new(period);
            for (i, t) in times.iter().enumerate() {
                stamps.add(Place { index: i as u64, time_s: *t });
            }
            stamps.finish()
        };
        match run(None) {
            Verdict::LookAgain(period) => run(Some(period)),
            other => other,
        }
    }
    fn timing(times: &[f64]) -> Timing {
        match judge(times) {
            Verdict::Timing(timing) => timing,
            _ => panic!("no timing"),
        }
    }
    fn regular(n: usize, period: f64) -> Vec<f64> {
        (0..n).map(|i| i as f64 * period).collect()
    }

    #[test]
    fn a_period_between_the_digits_of_the_stamps_does_not_drift() {
        // 285.714 Hz in whole milliseconds: steps of 3 and 4 ms
        let times: Vec<f64> = (0..100_000).map(|i| (f64::from(i) * 3.5).floor() * 1e-3).collect();
        let timing = timing(&times);
        assert!(timing.usable && timing.gaps.is_empty());
        assert!((timing.period / 3.5e-3 - 1.0).abs() < 1e-5, "{}", timing.period);
    }

    #[test]
    fn gaps_are_counted_where_they_are_and_late_stamps_are_none() {
        let mut times = regular(5000, 0.01);
        times[3000..].iter_mut().for_each(|t| *t += 0.03);
        times[4000..].iter_mut().for_each(|t| *t += 7.25);
        times[100] += 0.008; // late, and the next step is short
        let timing = timing(&times);
        assert!(timing.usable);
        assert_eq!(timing.gaps, [Gap { index: 3000, missing: 3 }, Gap { index: 4000, missing: 725 }]);
        assert!((timing.period - 0.01).abs() < 1e-9);
    }

    #[test]
    fn bursts_give_only_a_mean_rate() {
        // ten samples a packet, 1 ms apart inside, packets every 100 ms
        let times: Vec<f64> = (0..20_000).map(|i| (i / 10) as f64 * 0.1 + (i % 10) as f64 * 1e-3).collect();
        let timing = timing(&times);
        assert!(!timing.usable && timing.gaps.is_empty());
        assert!((timing.period / 0.01 - 1.0).abs() < 1e-6, "{}", timing.period);
    }

    #[test]
    fn random_loss_keeps_the_stamps_usable() {
        // every seventh sample lost: 14 % of the time, 17 % of the steps
        let times: Vec<f64> = (0..7000).filter(|i| i % 7 != 3).map(|i| i as f64 * 0.005).collect();
        let timing = timing(&times);
        assert!(timing.usable);
        assert_eq!(timing.gaps.iter().map(|g| g.missing).sum::<u64>(), 1000);
        assert!((timing.period - 0.005).abs() < 1e-9);
    }

    /// Damaged stamps: sums of what is missing do not overflow.
    #[test]
    fn gaps_without_measure_are_counted_up_to_a_bound() {
        let mut times = regular(5000, 0.01);
        times[3000..].iter_mut().for_each(|t| *t += 1e18);
        times[4000..].iter_mut().for_each(|t| *t += 1e200);
        let timing = timing(&times);
        assert_eq!(timing.gaps.iter().map(|gap| gap.missing).collect::<Vec<_>>(), [LONGEST_GAP; 2]);
    }

    #[test]
    fn repeated_stamps_share_the_step_to_the_next() {
        // 8 kHz stamped in milliseconds
        let times: Vec<f64> = (0..8000).map(|i| (i / 8) as f64 * 1e-3).collect();
        let timing = timing(&times);
        assert!(timing.usable && timing.gaps.is_empty());
        assert!((timing.period / 1.25e-4 - 1.0).abs() < 1e-6, "{}", timing.period);
        assert!(matches!(judge(&[1.0, 1.0, 1.0]), Verdict::NoTime));
    }

    #[test]
    fn an_untypical_beginning_is_looked_at_again() {
        // the first 2000 samples at 10 Hz, then 100 000 at 100 Hz with one gap
        let mut times = regular(2000, 0.1);
        times.extend(regular(100_000, 0.01).iter().map(|t| t + 200.0));
        times[50_000..].iter_mut().for_each(|t| *t += 0.05);
        let timing = timing(&times);
        assert!(timing.usable);
        assert!((timing.period - 0.01).abs() < 1e-9);
        assert_eq!(timing.gaps.iter().find(|g| g.index == 50_000).map(|g| g.missing), Some(5));
    }
}
