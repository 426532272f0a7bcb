//! Figures and the report page of a Monte Carlo experiment: a view of [`Outcome`], and a few of its runs.

use super::text;
use crate::cli::output::digits;
use crate::consistency::Test;
use crate::montecarlo::course::AxisCourse;
use crate::montecarlo::outcome::{Component, FalseAlarmRate, Innovations};
use crate::montecarlo::{AxisOutcome, Course, Experiment, Outcome, Path};
use crate::params::{AxisParams, Measured};
use crate::report::figure::{self, Curve};
use crate::report::page::{Badge, Page, Section};
use crate::units::{Quantity, Unit};

/// Most points of a path.
const POINTS: u64 = 600;
/// Shares of a normal law within 1, 2 and 3 sigma.
const WITHIN: &str =
    "Share of runs and times within 1, 2 and 3 claimed sigma; 68.27, 95.45 and 99.73 % for a true filter";

/// What the page is made of.
pub(super) struct View<'a> {
    pub(super) experiment: &'a Experiment,
    pub(super) course: &'a Course,
    pub(super) outcome: &'a Outcome,
    /// Label and name of the files that were read.
    pub(super) sources: &'a [(String, String)],
}

/// The report page.
pub(super) fn page(view: &View<'_>) -> Page {
    let View { experiment, course, outcome, .. } = view;
    let every = course.steps.div_ceil(POINTS);
    let seen = outcome.runs.count().min(4) as usize;
    let mut sections = vec![summary(view), parameters(experiment), tests(outcome), gate(outcome)];
    for ((axis, paths), number) in outcome.axes.iter().zip(course.paths(outcome.runs.first, every)).zip(0..) {
        let sight = Sight::new(view, axis, number);
        sections.push(sight.section(&paths[..seen.min(paths.len())], every));
    }
    Page {
        title: "Monte Carlo consistency".into(),
        subtitle: format!("Does the filter's covariance tell the truth? {}", text::experiment(outcome)),
        badge: Some(Badge::new(outcome.verdict, outcome.meaning.clone())),
        provenance: provenance(view),
        sections,
    }
}

fn provenance(view: &View<'_>) -> Vec<(String, String)> {
    let View { experiment, outcome, sources, .. } = view;
    let design = &experiment.design;
    let names: Vec<&str> = design.axes.iter().map(|axis| axis.name.as_str()).collect();
    let truth = match (&experiment.truth, experiment.truth_spread) {
        (None, false) => "the filter's own model",
        (None, true) => "the filter's own model, parameters drawn from their intervals in every run",
        (Some(_), false) => "other parameters",
        (Some(_), true) => "other parameters, drawn from their intervals in every run",
    };
    let rest = [
        ("design", format!("plant {}, {} Hz, axes {}", design.plant, digits(design.sample_rate_hz), names.join(", "))),
        ("truth", truth.into()),
        ("runs", format!("{} ({}..{})", outcome.runs.count(), outcome.runs.first, outcome.runs.end)),
        ("duration", format!("{} s, {} samples", digits(outcome.duration_s), outcome.steps)),
        ("seed", outcome.seed.to_string()),
        ("alpha", outcome.alpha.to_string()),
        ("version", format!("kfdesign {}", env!("CARGO_PKG_VERSION"))),
    ];
    sources.iter().cloned().chain(rest.map(|(label, value)| (label.to_string(), value))).collect()
}

fn summary(view: &View<'_>) -> Section {
    Section::new("Summary").table(
        "NEES (per component) and NIS are 1 when the covariance is right; NCI and inclination are 0 dB",
        &text::AXES,
        text::axis_rows(view.outcome),
    )
}

/// Parameters of filter and truth beside each other.
fn parameters(experiment: &Experiment) -> Section {
    let rows = experiment.design.axes.iter().flat_map(|axis| {
        let truth = experiment.truth.as_ref();
        let truth = truth.map(|truth| truth.axes.iter().find(|a| a.name == axis.name).map(listed).unwrap_or_default());
        let own = listed(&axis.noise);
        let mut names: Vec<String> = own.iter().chain(truth.iter().flatten()).map(|(name, _)| name.clone()).collect();
        let mut seen = Vec::new();
        names.retain(|name| {
            !seen.contains(name) && {
                seen.push(name.clone());
                true
            }
        });
        let find =
            |list: &[(String, Measured)], name: &str| list.iter().find(|(n, _)| n == name).map(|(_, m)| m.clone());
        let rows: Vec<Vec<String>> = names
            .iter()
            .map(|name| {
                let filter = find(&own, name);
                let truth = truth.as_ref().map_or_else(|| filter.clone(), |truth| find(truth, name));
                row(&axis.name, name, filter.as_ref(), truth.as_ref(), experiment.truth_spread)
            })
            .collect();
        rows
    });
    let header = ["axis", "parameter", "filter", "truth", "filter / truth", "unit", "truth is drawn from"];
    let shown = if experiment.truth_spread { &header[..] } else { &header[..6] };
    Section::new("Filter and truth").table(
        "Noise parameters that the filter expects, and those that were simulated",
        shown,
        rows.collect(),
    )
}

/// Everything about an axis that has a number, by its name in documents.
fn listed(axis: &AxisParams) -> Vec<(String, Measured)> {
    let bias = axis.bias.iter().map(|m| ("bias".to_string(), m.clone()));
    let start = axis.turn_on_bias.iter().map(|m| ("turn_on_bias.std_dev".to_string(), m.clone()));
    let mut noise = axis.clone();
    let noise: Vec<(String, Measured)> = noise.noise_parameters().map(|(name, m)| (name, m.clone())).collect();
    bias.chain(start).chain(noise).collect()
}

fn row(axis: &str, name: &str, filter: Option<&Measured>, truth: Option<&Measured>, drawn: bool) -> Vec<String> {
    let unit = filter.or(truth).map_or_else(Unit::one, |m| m.unit.clone());
    let value = |m: Option<&Measured>| m.map(|m| unit.from_si(m.si()));
    let text = |value: Option<f64>| value.map_or_else(|| "–".into(), digits);
    let ratio =
        value(filter).zip(value(truth)).filter(|(_, truth)| *truth != 0.0).map(|(filter, truth)| filter / truth);
    let interval = truth.and_then(Measured::interval_si).map(|ends| ends.map(|end| digits(unit.from_si(end))));
    let mut row =
        vec![axis.into(), name.into(), text(value(filter)), text(value(truth)), text(ratio), unit.to_string()];
    if drawn {
        row.push(interval.map_or_else(|| "fixed".into(), |[lower, upper]| format!("{lower} … {upper}")));
    }
    row
}

fn tests(outcome: &Outcome) -> Section {
    let failed = outcome.tests.iter().filter(|t| !t.pass());
    Section::new("Tests")
        .list(failed.map(|t: &Test| format!("{}, {}: {}.", t.axis, t.name, t.meaning)).collect())
        .table(
            format!(
                "A true filter keeps within all bounds with {} %; a test is beyond its bounds when its p is at most {}, its family-wise p at most {}",
                text::kept(outcome),
                digits(outcome.critical_p_value),
                outcome.alpha
            ),
            &text::TESTS,
            text::test_rows(outcome),
        )
}

/// What the gate does to a true filter and to wrong ones.
fn gate(outcome: &Outcome) -> Section {
    let mut section = Section::new("Error rates of this gate");
    if let Some(rate) = &outcome.false_alarm_rate {
        let mut header = vec!["test"];
        header.extend(outcome.axes.iter().map(|axis| axis.name.as_str()));
        let caption = format!("False alarms of each test alone at level {} (%)", outcome.alpha);
        section = section.paragraph(format!("{}.", text::false_alarms(outcome, rate))).table(
            caption,
            &header,
            alarm_rows(outcome, rate),
        );
    }
    if let Some(rejection) = &outcome.rejection {
        section = section.paragraph(format!("{}.", text::rejected(rejection)));
    }
    section.table(
        "Mistuning that is caught with 90 % probability: the filter's value over the true one (x0: in sigmas of P0)",
        &text::POWER,
        text::power_rows(outcome),
    )
}

fn alarm_rows(outcome: &Outcome, rate: &FalseAlarmRate) -> Vec<Vec<String>> {
    let mut rows: Vec<Vec<String>> = Vec::new();
    for test in &rate.tests {
        if !rows.iter().any(|row| row[0] == test.name) {
            let of = |axis: &AxisOutcome| rate.tests.iter().find(|t| t.axis == axis.name && t.name == test.name);
            let cells = outcome.axes.iter().map(|axis| of(axis).map_or_else(String::new, |t| digits(100.0 * t.value)));
            rows.push(std::iter::once(test.name.clone()).chain(cells).collect());
        }
    }
    rows
}

/// One axis.
struct Sight<'a> {
    view: &'a View<'a>,
    axis: &'a AxisOutcome,
    course: &'a AxisCourse,
    unit: Unit,
}

impl<'a> Sight<'a> {
    fn new(view: &'a View<'a>, axis: &'a AxisOutcome, number: usize) -> Sight<'a> {
        let design = &view.experiment.design;
        let unit = design.axes[number].noise.display_unit(design.quantity);
        Sight { view, axis, course: &view.course.axes[number], unit }
    }

    fn quantity(&self) -> Quantity {
        self.view.experiment.design.quantity
    }

    /// SI value of one of the shown unit, and that unit.
    fn shown(&self, si: &str) -> (f64, String) {
        if si == self.quantity().si_unit() { (self.unit.scale(), self.unit.to_string()) } else { (1.0, si.into()) }
    }

    fn title(&self, what: &str) -> String {
        format!("{}: {what}", self.axis.name)
    }

    fn section(&self, paths: &[Path], every: u64) -> Section {
        let axis = self.axis;
        let mut section = Section::new(format!("Axis {}", axis.name))
            .figures(std::iter::once(self.nees()).chain(self.errors(paths, every)).chain(self.rms()).collect());
        section = section
            .table("Errors", &ERRORS, axis.errors.iter().map(|c| self.error_row(c)).collect())
            .table(WITHIN, &COVERAGE, axis.errors.iter().map(coverage_row).collect())
            .table("All components together", &["what", "value", "meaning"], self.facts());
        let many = axis.innovations.len() > 1;
        for innovations in &axis.innovations {
            let name = if many { format!("{}, innovations", innovations.name) } else { "innovations".into() };
            section = section.figures(self.of_innovations(innovations, &self.title(&name))).table(
                format!("{name}: power of block averages over what the filter says, and the band of the gate"),
                &["average over (s)", "ratio", "lower", "upper", ""],
                low_frequency_rows(innovations),
            );
        }
        section
    }

    fn nees(&self) -> (String, String) {
        let (nees, outcome) = (&self.axis.nees, self.view.outcome);
        let other = self.view.experiment.truth.is_some();
        let label =
            if self.view.experiment.truth_spread { "expected, nominal truth" } else { "expected with this truth" };
        let count = nees.time_s.len();
        let figure = figure::nees(&figure::Nees {
            title: self.title(&format!("NEES of {} runs", outcome.runs.count())),
            time_s: nees.time_s.clone(),
            nees: nees.mean.clone(),
            lower: vec![nees.lower; count],
            upper: vec![nees.upper; count],
            expected: 1.0,
            under_truth: other.then(|| Curve {
                label: label.into(),
                points: nees.time_s.iter().copied().zip(nees.expected.iter().copied()).collect(),
            }),
            band_label: "band of the gate, all times together".into(),
        });
        let caption = "Squared errors over the claimed covariance, per component: above 1 the filter is optimistic, below 1 pessimistic. \
                       For a true filter the whole curve is in the band.";
        (figure, caption.into())
    }

    /// Errors of some runs, of the whole drift and of each state.
    fn errors(&self, paths: &[Path], every: u64) -> Vec<(String, String)> {
        let (course, first) = (self.course, self.view.outcome.runs.first);
        let (filter, truth) = (&course.filter, &course.truth);
        let states = course.judge.components == filter.states;
        let mut parts = Vec::new();
        // with one state the drift is that state
        if !states || filter.states.len() > 1 {
            for (i, measured) in filter.measurements.iter().enumerate() {
                let name = if filter.measurements.len() == 1 { "whole drift" } else { &measured.name };
                parts.push((
                    name.to_string(),
                    measured.unit.clone(),
                    truth.h.row(i).clone_owned(),
                    filter.h.row(i).clone_owned(),
                ));
            }
        }
        if states {
            for (i, state) in filter.states.iter().enumerate() {
                let (a, b) =
                    (course.judge.of_truth.row(i).clone_owned(), course.judge.of_estimate.row(i).clone_owned());
                parts.push((state.name.clone(), state.unit.clone(), a, b));
            }
        }
        let label = match paths.len() {
            1 => format!("run {first}"),
            count => format!("runs {first} to {}", first + count as u64 - 1),
        };
        let one = |(name, si, of_truth, of_estimate): (
            String,
            String,
            nalgebra::RowDVector<f64>,
            nalgebra::RowDVector<f64>,
        )| {
            let (scale, unit) = self.shown(&si);
            let sum = |weights: &nalgebra::RowDVector<f64>, states: &[Vec<f64>], k: usize| -> f64 {
                weights.iter().zip(states).map(|(w, state)| w * state[k]).sum()
            };
            let run = |path: &Path| {
                let count = path.truth.first().map_or(0, Vec::len);
                let error = |k: usize| sum(&of_truth, &path.truth, k) - sum(&of_estimate, &path.estimate, k);
                let points = (0..count).map(|k| ((k as u64 * every) as f64 * self.view.course.dt, error(k) / scale));
                Curve { label: String::new(), points: points.collect() }
            };
            let sigma = |epoch: &crate::filter::gains::Epoch| {
                let variance = (&of_estimate * &epoch.covariance * of_estimate.transpose())[(0, 0)];
                (epoch.step as f64 * self.view.course.dt, variance.max(0.0).sqrt() / scale)
            };
            let figure = figure::errors(&figure::Errors {
                title: self.title(&format!("error of {name}")),
                quantity: format!("error of {name}"),
                unit,
                sigma: course.gains.epochs.iter().map(sigma).collect(),
                runs: paths.iter().map(run).collect(),
                label: label.clone(),
            });
            (figure, format!("Truth minus estimate, every {} s.", digits(every as f64 * self.view.course.dt)))
        };
        parts.into_iter().map(one).collect()
    }

    /// One figure for the components of each unit.
    fn rms(&self) -> Vec<(String, String)> {
        let mut units: Vec<&str> = Vec::new();
        for component in &self.axis.errors {
            if !units.contains(&component.unit.as_str()) {
                units.push(&component.unit);
            }
        }
        let one = |si: &str| {
            let (scale, unit) = self.shown(si);
            let scaled = |values: &[f64]| values.iter().map(|v| v / scale).collect();
            let components = self.axis.errors.iter().filter(|c| c.unit == si).map(|c| figure::Component {
                name: c.name.clone(),
                rms: scaled(&c.rms),
                claimed: scaled(&c.predicted_sigma),
            });
            let figure = figure::rms(&figure::Rms {
                title: self.title("errors and claims"),
                unit,
                time_s: self.axis.nees.time_s.clone(),
                components: components.collect(),
            });
            (figure, "Root mean square error over the runs beside the sigma that the filter claims.".to_string())
        };
        units.into_iter().map(one).collect()
    }

    fn error_row(&self, component: &Component) -> Vec<String> {
        let (scale, unit) = self.shown(&component.unit);
        let last = |values: &[f64]| digits(values.last().copied().unwrap_or(f64::NAN) / scale);
        let mut ratio = component.rms.iter().zip(&component.predicted_sigma).map(|(rms, sigma)| rms / sigma);
        let (least, most) = ratio.clone().fold((f64::INFINITY, 0.0), |(l, m): (f64, f64), r| (l.min(r), m.max(r)));
        let end = ratio.next_back().unwrap_or(f64::NAN);
        vec![
            component.name.clone(),
            unit,
            last(&component.mean),
            last(&component.rms),
            last(&component.predicted_sigma),
            digits(end),
            format!("{} … {}", digits(least), digits(most)),
        ]
    }

    /// Credibility and the time average, in rows of three.
    fn facts(&self) -> Vec<Vec<String>> {
        let (axis, average) = (self.axis, &self.axis.nees_average);
        let mut rows = vec![
            vec![
                "NEES over time".into(),
                format!("{:.4}", average.mean),
                format!(
                    "expected {:.4}; band of the gate {:.4} … {:.4}",
                    average.expected, average.lower, average.upper
                ),
            ],
            vec![
                "independent errors in a run".into(),
                digits(average.effective_epochs),
                "what the time average of one run is worth, from the filter's own transitions".into(),
            ],
        ];
        if let Some(c) = &axis.credibility {
            rows.push(vec![
                "noncredibility index (NCI)".into(),
                format!("{:.2} dB", c.nci_db),
                "0 dB for a perfect covariance; sampling alone gives a little".into(),
            ]);
            rows.push(vec![
                "inclination".into(),
                format!("{:+.2} dB", c.inclination_db),
                format!("{}; standard error {:.2} dB", c.meaning, c.standard_error_db),
            ]);
        }
        for i in &axis.innovations {
            let name = if axis.innovations.len() == 1 { "NIS".into() } else { format!("NIS of {}", i.name) };
            let meaning = format!("expected {:.5}; {} innovations, mean {}", i.expected_nis, i.updates, digits(i.mean));
            rows.push(vec![name, format!("{:.5}", i.nis), meaning]);
        }
        rows
    }

    fn of_innovations(&self, innovations: &Innovations, title: &str) -> Vec<(String, String)> {
        let titled = |what: &str| format!("{title}: {what}");
        let law = &innovations.nis_histogram;
        // the open last bin is drawn as wide as the others
        let mut edges = law.edges.clone();
        if let [.., before, last] = law.edges[..] {
            edges.push(2.0 * last - before);
        }
        let beyond = law.edges.last().copied().unwrap_or(0.0);
        let mut figures = vec![
            (
                figure::nis_histogram(&figure::Histogram {
                    title: titled("NIS"),
                    edges,
                    observed: law.observed.clone(),
                    expected: law.expected.clone(),
                    law: "χ²(1)".into(),
                }),
                format!(
                    "Normalised innovations squared beside their law; the last bar is everything beyond {}.",
                    digits(beyond)
                ),
            ),
            (
                figure::autocorrelation(&figure::Autocorrelation {
                    title: titled("autocorrelation"),
                    points: (1..).map(f64::from).zip(innovations.autocorrelation.iter().copied()).collect(),
                    bound: innovations.autocorrelation_bound,
                    bound_label: "bounds of the gate, all lags together".into(),
                }),
                "White innovations have no correlation at any lag.".into(),
            ),
        ];
        let periodogram = &innovations.cumulative_periodogram;
        if !periodogram.share.is_empty() {
            let points = periodogram.frequency_hz.iter().copied().zip(periodogram.share.iter().copied());
            figures.push((
                figure::cumulative_periodogram(&figure::Periodogram {
                    title: titled("cumulative periodogram"),
                    points: points.collect(),
                    half_width: periodogram.half_width,
                    band_label: "band of the gate".into(),
                }),
                "Power of the block-averaged innovations up to each frequency: above the band there is more slow power than the filter says, \
                 below it less."
                    .into(),
            ));
        }
        figures
    }
}

const ERRORS: [&str; 7] = [
    "component",
    "unit",
    "mean at the end",
    "rms at the end",
    "claimed sigma",
    "rms / claimed at the end",
    "over the run",
];
const COVERAGE: [&str; 4] = ["component", "1 sigma (%)", "2 sigma (%)", "3 sigma (%)"];

fn coverage_row(component: &Component) -> Vec<String> {
    let mean = |shares: &[f64]| format!("{:.2}", 100.0 * shares.iter().sum::<f64>() / shares.len() as f64);
    let shares = [&component.within_1_sigma, &component.within_2_sigma, &component.within_3_sigma];
    std::iter::once(component.name.clone()).chain(shares.map(|shares| mean(shares))).collect()
}

fn low_frequency_rows(innovations: &Innovations) -> Vec<Vec<String>> {
    let row = |l: &crate::montecarlo::outcome::LowFrequency| {
        let verdict = if l.ratio > l.upper {
            "too much: optimistic about slow drift"
        } else if l.ratio < l.lower {
            "too little: pessimistic about slow drift"
        } else {
            "within"
        };
        vec![digits(l.averaging_s), digits(l.ratio), digits(l.lower), digits(l.upper), verdict.into()]
    };
    innovations.low_frequency.iter().map(row).collect()
}
