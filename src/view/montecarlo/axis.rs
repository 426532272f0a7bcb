//! One axis of a Monte Carlo experiment, on the page.

use std::rc::Rc;

use nalgebra::RowDVector;

use super::MonteCarlo;
use crate::filter::gains::Epoch;
use crate::montecarlo::course::AxisCourse;
use crate::montecarlo::outcome::{Component, Innovations, LowFrequency};
use crate::montecarlo::{AxisOutcome, Path};
use crate::numerics::distribution::chi_square_quantile;
use crate::report::figure::{self, Curve};
use crate::report::{Level, Section};
use crate::units::{Unit, digits};

/// Shares of a normal law within 1, 2 and 3 sigma.
const WITHIN: &str =
    "Share of runs and times within 1, 2 and 3 claimed sigma; 68.27, 95.45 and 99.73 % for a true filter";
const ERRORS: [&str; 7] = [
    "component",
    "unit",
    "mean at the end",
    "rms at the end",
    "claimed sigma",
    "rms / claimed at the end",
    "over the run",
];

/// The first runs, simulated again.
type Paths<'a> = Rc<dyn Fn() -> Vec<Path> + 'a>;

#[derive(Clone)]
pub(super) struct AxisView<'a> {
    of: MonteCarlo<'a>,
    axis: &'a AxisOutcome,
    course: &'a AxisCourse,
    unit: Unit,
}

/// Something whose errors are drawn: its weights in the states of the truth and in those of the filter.
struct Weighted {
    name: String,
    unit: String,
    of_truth: RowDVector<f64>,
    of_estimate: RowDVector<f64>,
}

impl<'a> AxisView<'a> {
    pub(super) fn new(of: MonteCarlo<'a>, axis: &'a AxisOutcome, number: usize) -> AxisView<'a> {
        let design = &of.experiment.design;
        let unit = design.axes[number].noise.display_unit(design.quantity);
        AxisView { of, axis, course: &of.course.axes[number], unit }
    }

    /// SI value of one of the shown unit, and that unit.
    fn shown(&self, si: &str) -> (f64, String) {
        let measured = si == self.of.experiment.design.quantity.si_unit();
        if measured { (self.unit.scale(), self.unit.to_string()) } else { (1.0, si.into()) }
    }

    fn title(&self, what: &str) -> String {
        format!("{}: {what}", self.axis.name)
    }

    pub(super) fn section(self, paths: Paths<'a>) -> Section<'a> {
        let axis = self.axis;
        let view = self.clone();
        let section = Section::new(format!("Axis {}", axis.name)).at(Level::Page).figure(
            "Squared errors over the claimed covariance, per component: above 1 the filter is optimistic, below 1 \
             pessimistic. For a true filter the whole curve is in the band.",
            move || view.nees(),
        );
        let section = self.rms(self.errors(section, &paths));
        let mut section = section
            .table("Errors", &ERRORS, axis.errors.iter().map(|c| self.error_row(c)))
            .table(WITHIN, &["component", "1 sigma (%)", "2 sigma (%)", "3 sigma (%)"], axis.errors.iter().map(within))
            .table("All components together", &["what", "value", "meaning"], self.facts());
        for innovations in &axis.innovations {
            let many = axis.innovations.len() > 1;
            let name = if many { format!("{}, innovations", innovations.name) } else { "innovations".into() };
            section = of_innovations(section, innovations, &self.title(&name)).table(
                format!("{name}: power of block averages over what the filter says, and the band of the gate"),
                &["average over (s)", "ratio", "lower", "upper", ""],
                innovations.low_frequency.iter().map(low_frequency),
            );
        }
        section
    }

    fn nees(&self) -> String {
        let (nees, experiment) = (&self.axis.nees, self.of.experiment);
        let label = if experiment.truth_spread { "expected, nominal truth" } else { "expected with this truth" };
        let points = || nees.time_s.iter().copied().zip(nees.expected.iter().copied()).collect();
        let expected = experiment.truth.is_some().then(|| Curve { label: label.into(), points: points() });
        super::nees(self.axis, self.of.outcome, expected)
    }

    /// Errors of some runs, of the whole drift and of each state.
    fn errors(&self, mut section: Section<'a>, paths: &Paths<'a>) -> Section<'a> {
        let (filter, truth, judge) = (&self.course.filter, &self.course.truth, &self.course.judge);
        let states = judge.components == filter.states;
        let mut parts = Vec::new();
        // with one state the drift is that state
        if !states || filter.states.len() > 1 {
            let one = filter.measurements.len() == 1;
            parts.extend(filter.measurements.iter().enumerate().map(|(i, measured)| Weighted {
                name: if one { "whole drift".into() } else { measured.name.clone() },
                unit: measured.unit.clone(),
                of_truth: truth.h.row(i).clone_owned(),
                of_estimate: filter.h.row(i).clone_owned(),
            }));
        }
        if states {
            parts.extend(filter.states.iter().enumerate().map(|(i, state)| Weighted {
                name: state.name.clone(),
                unit: state.unit.clone(),
                of_truth: judge.of_truth.row(i).clone_owned(),
                of_estimate: judge.of_estimate.row(i).clone_owned(),
            }));
        }
        for part in parts {
            let (view, paths) = (self.clone(), paths.clone());
            let caption =
                format!("Truth minus estimate, every {} s.", digits(self.of.every() as f64 * self.of.course.dt));
            section = section.figure(caption, move || view.error(&part, &paths()));
        }
        section
    }

    fn error(&self, part: &Weighted, paths: &[Path]) -> String {
        let (scale, unit) = self.shown(&part.unit);
        let (dt, every, first) = (self.of.course.dt, self.of.every(), self.of.outcome.runs.first);
        let sum = |weights: &RowDVector<f64>, states: &[Vec<f64>], k: usize| -> f64 {
            weights.iter().zip(states).map(|(w, state)| w * state[k]).sum()
        };
        let run = |path: &Path| {
            let count = path.truth.first().map_or(0, Vec::len);
            let error = |k: usize| sum(&part.of_truth, &path.truth, k) - sum(&part.of_estimate, &path.estimate, k);
            let points = (0..count).map(|k| ((k as u64 * every) as f64 * dt, error(k) / scale));
            Curve { label: String::new(), points: points.collect() }
        };
        let sigma = |epoch: &Epoch| {
            let variance = (&part.of_estimate * &epoch.covariance * part.of_estimate.transpose())[(0, 0)];
            (epoch.step as f64 * dt, variance.max(0.0).sqrt() / scale)
        };
        figure::errors(&figure::Errors {
            title: self.title(&format!("error of {}", part.name)),
            quantity: format!("error of {}", part.name),
            unit,
            sigma: self.course.gains.epochs.iter().map(sigma).collect(),
            runs: paths.iter().map(run).collect(),
            label: match paths.len() {
                1 => format!("run {first}"),
                count => format!("runs {first} to {}", first + count as u64 - 1),
            },
        })
    }

    /// Every component over its claim.
    fn rms(&self, section: Section<'a>) -> Section<'a> {
        if self.axis.errors.is_empty() {
            return section;
        }
        let view = self.clone();
        let caption = "Root mean square error over the runs, over the sigma that the filter claims.";
        section.figure(caption, move || {
            let components = view.axis.errors.iter().map(|c| figure::Component {
                name: c.name.clone(),
                rms: c.rms.clone(),
                claimed: c.predicted_sigma.clone(),
            });
            // the mean square of normal errors as large as claimed
            let runs = view.of.outcome.runs.count() as f64;
            let band = [0.025, 0.975].map(|p| (chi_square_quantile(p, runs) / runs).sqrt());
            figure::rms(&figure::Rms {
                title: view.title("errors and claims"),
                time_s: view.axis.nees.time_s.clone(),
                components: components.collect(),
                band: Some((band, "95 % at one time".into())),
            })
        })
    }

    fn error_row(&self, component: &Component) -> [String; 7] {
        let (scale, unit) = self.shown(&component.unit);
        let last = |values: &[f64]| digits(values.last().copied().unwrap_or(f64::NAN) / scale);
        let mut ratio = component.rms.iter().zip(&component.predicted_sigma).map(|(rms, sigma)| rms / sigma);
        let (least, most) = ratio.clone().fold((f64::INFINITY, 0.0), |(l, m): (f64, f64), r| (l.min(r), m.max(r)));
        let end = ratio.next_back().unwrap_or(f64::NAN);
        let [mean, rms, claimed] = [&component.mean, &component.rms, &component.predicted_sigma].map(|v| last(v));
        let range = format!("{} … {}", digits(least), digits(most));
        [component.name.clone(), unit, mean, rms, claimed, digits(end), range]
    }

    /// Credibility and the time average.
    fn facts(&self) -> Vec<[String; 3]> {
        let (axis, average) = (self.axis, &self.axis.nees_average);
        let band =
            format!("expected {:.4}; band of the gate {:.4} … {:.4}", average.expected, average.lower, average.upper);
        let worth = "what the time average of one run is worth, from the filter's own transitions".to_string();
        let mut rows = vec![
            ["NEES over time".into(), format!("{:.4}", average.mean), band],
            ["independent errors in a run".into(), digits(average.effective_epochs), worth],
        ];
        if let Some(c) = &axis.credibility {
            let nci = "0 dB for a perfect covariance; sampling alone gives a little".to_string();
            let meaning = format!("{}; standard error {:.2} dB", c.meaning, c.standard_error_db);
            rows.push(["noncredibility index (NCI)".into(), format!("{:.2} dB", c.nci_db), nci]);
            rows.push(["inclination".into(), format!("{:+.2} dB", c.inclination_db), meaning]);
        }
        for i in &axis.innovations {
            let name = if axis.innovations.len() == 1 { "NIS".into() } else { format!("NIS of {}", i.name) };
            let meaning = format!("expected {:.5}; {} innovations, mean {}", i.expected_nis, i.updates, digits(i.mean));
            rows.push([name, format!("{:.5}", i.nis), meaning]);
        }
        rows
    }
}

fn of_innovations<'a>(section: Section<'a>, innovations: &'a Innovations, title: &str) -> Section<'a> {
    let titled = |what: &str| format!("{title}: {what}");
    let [nis, correlation, power] = ["NIS", "autocorrelation", "cumulative periodogram"].map(titled);
    let law = &innovations.nis_histogram;
    let beyond = digits(law.edges.last().copied().unwrap_or(0.0));
    let section = section
        .figure(
            format!("Normalised innovations squared beside their law; the last bar is everything beyond {beyond}."),
            move || {
                // the open last bin is drawn as wide as the others
                let mut edges = law.edges.clone();
                if let [.., before, last] = law.edges[..] {
                    edges.push(2.0 * last - before);
                }
                figure::nis_histogram(&figure::Histogram {
                    title: nis.clone(),
                    edges,
                    observed: law.observed.clone(),
                    expected: law.expected.clone(),
                    law: "χ²(1)".into(),
                })
            },
        )
        .figure("White innovations have no correlation at any lag.", move || {
            figure::autocorrelation(&figure::Autocorrelation {
                title: correlation.clone(),
                points: (1..).map(f64::from).zip(innovations.autocorrelation.iter().copied()).collect(),
                bound: innovations.autocorrelation_bound,
                bound_label: "bounds of the gate, all lags together".into(),
            })
        });
    let periodogram = &innovations.cumulative_periodogram;
    if periodogram.share.is_empty() {
        return section;
    }
    let caption = "Power of the block-averaged innovations up to each frequency, less that of white noise: above the \
                   band there is more slow power than the filter says, below it less.";
    section.figure(caption, move || {
        figure::cumulative_periodogram(&figure::Periodogram {
            title: power.clone(),
            points: periodogram.frequency_hz.iter().copied().zip(periodogram.share.iter().copied()).collect(),
            half_width: periodogram.half_width,
            band_label: "band of the gate".into(),
        })
    })
}

fn within(component: &Component) -> [String; 4] {
    let mean = |shares: &[f64]| format!("{:.2}", 100.0 * shares.iter().sum::<f64>() / shares.len() as f64);
    let [one, two, three] = [&component.within_1_sigma, &component.within_2_sigma, &component.within_3_sigma];
    [component.name.clone(), mean(one), mean(two), mean(three)]
}

fn low_frequency(l: &LowFrequency) -> [String; 5] {
    let verdict = if l.ratio > l.upper {
        "too much: optimistic about slow drift"
    } else if l.ratio < l.lower {
        "too little: pessimistic about slow drift"
    } else {
        "within"
    };
    let [time, ratio, lower, upper] = [l.averaging_s, l.ratio, l.lower, l.upper].map(digits);
    [time, ratio, lower, upper, verdict.into()]
}
