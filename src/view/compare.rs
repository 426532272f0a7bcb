//! A noise model held against a log.

use super::answer::{self, three};
use super::{by_name, or_dash, provenance, verdict};
use crate::compare::{AxisComparison, Band, Beside, Comparison};
use crate::consistency::TestKind;
use crate::report::figure::{self, SpectrumRatio};
use crate::report::{self, Level, Report, Section};
use crate::units::{Unit, digits};

/// `unit`: of the log.
pub fn compare<'a>(result: &'a Comparison, unit: &'a Unit) -> Report<'a> {
    let given = |value: &Option<String>| value.clone().unwrap_or_default();
    let axes = &result.axes;
    // they differ in their numbers alone, which the table has
    let mut sentences = axes.iter().map(|a| format!("{}: {}.", a.name, a.means.sentence));
    let means = Section::of_page("Means, which prove nothing")
        .table(
            format!("Means in {unit}, which prove nothing"),
            &["axis", "log column", "samples", "mean of log", "simulated mean", "sigma of a mean"],
            axes.iter().map(|a| {
                let [real, simulated, sigma] =
                    [a.means.real, a.means.simulated, a.means.std_dev].map(|v| digits(unit.from_si(v)));
                [a.name.clone(), a.log_axis.clone(), a.samples.to_string(), real, simulated, sigma]
            }),
        )
        .list(sentences.next().into_iter().collect())
        .at(Level::Page)
        .list(sentences.collect());
    let numbers = Section::of_page("The file's numbers")
        .table(
            "The file's numbers and the log's own (95 % intervals, each alone)",
            &["axis", "parameter", "file", "this log", "from", "to", "unit", "file/log", "held against"],
            result.parameters.iter().map(number_row),
        )
        .list(result.parameters.iter().map(|b| format!("{}.", b.meaning)).collect());
    let notes =
        Section::of_page("Notes").findings("note", by_name(axes.iter().map(|a| (a.name.as_str(), a.notes.as_slice()))));
    let tests = verdict::tests("the model on this log", "", &result.tests, result.alpha);
    let mut sections = vec![tests, numbers, notes];
    sections.extend(axes.iter().map(|axis| figures(axis, result.alpha, unit)));
    sections.push(means);
    Report {
        title: format!("{} against {}", given(&result.log), given(&result.params)),
        subtitle: "A noise model held against a log: does it fit?".into(),
        verdict: Some(answer::conclusion(result.verdict, &result.meaning, &result.tests)),
        answer: answer(result, unit),
        provenance: provenance([
            ("parameters", given(&result.params)),
            ("log", given(&result.log)),
            ("log SHA-256", given(&result.log_sha256)),
            ("sample rate of the log", format!("{} Hz", digits(result.sample_rate))),
            ("alpha", result.alpha.to_string()),
        ]),
        sections,
        ..Report::default()
    }
}

fn answer<'a>(result: &Comparison, unit: &Unit) -> Section<'a> {
    let axes = &result.axes;
    let row = |axis: &AxisComparison| {
        let tests = || result.tests.iter().filter(|test| test.axis == axis.name);
        let nis = tests().find(|test| test.kind == TestKind::Nis).map_or("-".into(), |test| three(test.statistic));
        let mean = three(unit.from_si(axis.means.real));
        [axis.name.clone(), axis.samples.to_string(), nis, mean, answer::result(tests())]
    };
    let mean = format!("mean ({unit})");
    let outside = result
        .parameters
        .iter()
        .filter(|beside| !beside.inside.unwrap_or(true))
        .map(|beside| format!("{}.", beside.meaning));
    Section::new("")
        .table("", &["", "samples", "NIS", &mean, "result"], axes.iter().map(row))
        .paragraphs(outside.take(3).collect())
        .findings("note", answer::warnings(by_name(axes.iter().map(|a| (a.name.as_str(), a.notes.as_slice())))))
}

fn number_row(b: &Beside) -> [String; 9] {
    let number = |value: Option<f64>| or_dash(value.filter(|v| v.is_finite()));
    let [low, high] = b.interval.map_or([None; 2], |ends| ends.map(Some)).map(number);
    let (axis, parameter, unit, how) = (b.axis.clone(), b.parameter.clone(), b.unit.clone(), b.how.clone());
    [axis, parameter, number(Some(b.file)), number(b.log), low, high, unit, number(b.ratio), how]
}

fn figures<'a>(axis: &'a AxisComparison, alpha: f64, unit: &'a Unit) -> Section<'a> {
    let level = digits(100.0 * (1.0 - alpha));
    let caption =
        format!("A log of the model stays in the envelope at all averaging times with probability {level} %.");
    let ratio = move || {
        let bands = axis.spectrum.iter().map(|b: &Band| [b.from_hz, b.to_hz, b.ratio, b.lower, b.upper]).collect();
        figure::spectrum_ratio(&SpectrumRatio {
            title: format!("{}: spectrum of the log over that of the model", axis.name),
            bands,
            band_label: format!("{level} % for all bands together"),
        })
    };
    Section::new(axis.name.clone())
        .figure(caption, move || report::allan::envelope(&axis.name, &axis.allan, alpha, unit))
        .figure("Where the steps leave the band, the model has too little (above one) or too much power.", ratio)
}
