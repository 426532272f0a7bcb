//! The noise of a log.

use super::answer::{self, three};
use super::{allan, by_name, or_dash, parameters, provenance};
use crate::identify::graphical::Step;
use crate::identify::temperature::SMOOTHING_S;
use crate::identify::{Candidate, Identified, IdentifiedAxis, OnTemperature, SharedTime};
use crate::params::{AxisParams, Measured, NotIdentified, Params, TermEntry};
use crate::report::{Report, Section};
use crate::units::{Quantity, Unit, digits, duration, significant};

/// Below this p-value the axes have different correlation times.
const SAME_TIME: f64 = 0.01;
/// Above this p-value the log does not show that the bias follows the temperature.
const FOLLOWS: f64 = 0.05;
/// Below this share of temperature in what was taken for it, its noise is said.
const RELIABLE: f64 = 0.9;
/// Candidates shown; all are in the JSON document.
const SHOWN_CANDIDATES: usize = 6;

/// `shared`: one correlation time for all axes, where that can be asked.
pub fn identify<'a>(params: &Params, axes: &'a [IdentifiedAxis], shared: Option<&SharedTime>) -> Report<'a> {
    let source = params.source.clone().unwrap_or_default();
    let log = source.log.unwrap_or_default();
    let failed = params.failed_check();
    let mut sections: Vec<Section<'_>> = axes.iter().map(|axis| of_axis(axis, params)).collect();
    sections.extend(shared.map(|shared| Section::of_page("All axes").paragraph(same_time(shared))));
    Report {
        title: format!("Noise parameters from {log}"),
        subtitle: failed.map_or_else(
            || "What a log of the sensor at rest says about its noise, and what it cannot say".into(),
            |failed| format!("A check failed: {failed}"),
        ),
        provenance: provenance([
            ("log", log),
            ("log SHA-256", source.sha256.unwrap_or_default()),
            ("samples", source.samples.map(|n| n.to_string()).unwrap_or_default()),
            ("span", source.span_s.map(|s| format!("{} s", digits(s))).unwrap_or_default()),
            ("sample rate", format!("{} Hz", digits(params.sample_rate_hz))),
            ("method", source.method.unwrap_or_default()),
        ]),
        sections,
        answer: answer(params, axes),
        ..Report::default()
    }
}

/// What is known of each axis, how good the sensor is, and what the log does not tell.
fn answer<'a>(params: &Params, axes: &[IdentifiedAxis]) -> Section<'a> {
    let source = params.source.clone().unwrap_or_default();
    let found = || axes.iter().map(|axis| &axis.found);
    let mut heading = format!(
        "{}: {} samples, {} Hz",
        source.log.unwrap_or_default(),
        source.samples.map_or("-".into(), |n| n.to_string()),
        three(params.sample_rate_hz)
    );
    heading.extend(source.span_s.map(|span| format!(", {}", answer::time(span))));
    let mut section = Section::new(heading);
    match params.failed_check() {
        Some(failed) => section = section.paragraph(format!("CHECK FAILED (exit 1): {failed}")),
        None => section.heading += ", at rest",
    }
    let Some(bias) = params.axes.first().map(|axis| axis.display_unit(params.quantity)) else { return section };
    let density = bias.times_time(1);
    let row = |found: &Identified| {
        let white = Some(found.model.wideband_density()).filter(|density| *density > 0.0);
        let precise = found.precision.iter().find(|p| p.parameter == "white.density" && p.std_dev_percent.is_finite());
        [
            found.params.name.clone(),
            or_dash_three(white.map(|si| density.from_si(si))),
            precise.map_or("-".into(), |p| format!("{} %", significant(p.std_dev_percent, 2))),
            or_dash_three(found.params.bias.as_ref().map(|value| bias.from_si(value.si()))),
            drift(&found.params),
        ]
    };
    let [of_white, of_bias] = [&density, &bias].map(answer::unit);
    let header = ["", &format!("N, {of_white}"), "±", &format!("bias, {of_bias}"), "drift"];
    let named = |found: &Identified, said: Vec<String>| match said.is_empty() {
        true => None,
        false => Some(format!("{} {}", found.params.name, said.join(", "))),
    };
    let joined = |said: Vec<String>| if said.is_empty() { None } else { Some(said.join("; ")) };
    let needed = found().flat_map(|f| &f.not_identified).filter_map(|entry| entry.needed_log_s).reduce(f64::max);
    let needed = needed.map_or_else(String::new, |s| format!(" (about {} would tell)", answer::time(s)));
    let unknown = joined(found().filter_map(|f| named(f, unknown(f))).collect());
    let unknown = unknown.map(|terms| answer::cut(&format!("Not told by this log: {terms}")) + &needed + ".");
    let lines = joined(found().filter_map(|f| named(f, lines(&f.params))).collect());
    let lines = lines.map(|lines| answer::cut(&format!("Lines (vibration, interference): {lines}")) + ".");
    section
        .table("", &header, found().map(row))
        .paragraphs(grade(params, axes).into_iter().chain(unknown).chain(lines).collect())
        .findings("warning", answer::warnings(by_name(found().map(|f| (f.params.name.as_str(), &*f.warnings)))))
}

fn or_dash_three(value: Option<f64>) -> String {
    value.map_or_else(|| "-".into(), three)
}

/// Slow terms in words: "0.0281 deg/s over 194 s".
fn drift(params: &AxisParams) -> String {
    let shown = |value: &Measured| format!("{} {}", three(value.value), answer::unit(&value.unit));
    let term = |term: &TermEntry| match term {
        TermEntry::GaussMarkov { std_dev, correlation_time } => {
            Some(format!("{} over {} s", shown(std_dev), three(correlation_time.si())))
        }
        TermEntry::RateRandomWalk { density } => Some(format!("K {}", shown(density))),
        TermEntry::BiasInstability { coefficient } => Some(format!("flicker {}", shown(coefficient))),
        TermEntry::RateRamp { slope } => Some(format!("ramp {}", shown(slope))),
        _ => None,
    };
    let terms: Vec<String> = params.terms.iter().filter_map(term).collect();
    if !terms.is_empty() {
        return terms.join(" + ");
    }
    let limit = params.not_identified.iter().find_map(|entry| entry.upper_limit.as_ref());
    limit.map_or("none seen".into(), |limit| format!("none seen (K < {})", shown(limit)))
}

/// What the log does not tell.
fn unknown(found: &Identified) -> Vec<String> {
    found.not_identified.iter().map(|entry| entry.term.clone()).collect()
}

/// Lines of a spectrum.
fn lines(params: &AxisParams) -> Vec<String> {
    let line = |term: &TermEntry| match term {
        TermEntry::Oscillation { frequency, .. } => Some(format!("{} {}", three(frequency.value), frequency.unit)),
        _ => None,
    };
    params.terms.iter().filter_map(line).collect()
}

/// Classes of gyros by angle random walk, deg/√h: Yazdi, Ayazi and Najafi, Micromachined inertial sensors, Proc. IEEE
/// 86(8), 1998, table 1: rate above 0.5, tactical 0.05 to 0.5, inertial below 0.001.
const GRADES: [(f64, &str); 3] = [
    (0.5, "rate grade, consumer or industrial"),
    (0.05, "tactical grade"),
    (0.001, "between tactical and inertial grade"),
];

/// How good the gyro is, by the worst of its axes.
fn grade(params: &Params, axes: &[IdentifiedAxis]) -> Option<String> {
    let unit = Unit::parse("deg/sqrt(h)").ok().filter(|_| params.quantity == Quantity::AngularRate)?;
    let walk = axes.iter().map(|axis| axis.found.model.wideband_density()).reduce(f64::max)?;
    let walk = unit.from_si(walk);
    let grade = GRADES.iter().find(|(above, _)| walk > *above).map_or("inertial grade", |(_, grade)| grade);
    Some(format!(
        "Angle random walk {} deg/√h: {grade} (rate above 0.5, tactical 0.05 to 0.5, inertial below 0.001; \
         Yazdi, Ayazi, Najafi 1998).",
        three(walk)
    ))
}

fn of_axis<'a>(axis: &'a IdentifiedAxis, params: &Params) -> Section<'a> {
    let found = &axis.found;
    let section = Section::of_page(found.params.name.clone()).paragraph(headline(axis));
    let section = parameters::table(section, found, params.quantity)
        .figure("The measured curve with exact 95 % intervals for the model, and the model's terms.", || {
            allan::figure(&axis.measured)
        });
    let section = match &found.hold {
        Some(hold) => section.paragraph(hold.sentence()),
        None => section,
    };
    let mut section = candidates(section, &found.candidates);
    if !found.steps.is_empty() {
        section = section
            .table("The recipe, step by step", &["step", "formula", "value", "unit"], found.steps.iter().map(step))
            .paragraph("What each step costs:")
            .list(found.steps.iter().map(|s| format!("{}: {}", s.what, s.cost)).collect());
    }
    if let Some(temperature) = &axis.temperature {
        section = on_temperature(section, temperature);
    }
    if !found.between.is_empty() {
        let each = found.between.iter().map(|b| format!("{} p = {}", b.parameter, digits(b.p_value)));
        section = section.paragraph(format!("Whether the logs are alike: {}", each.collect::<Vec<_>>().join(", ")));
    }
    if !found.not_identified.is_empty() {
        section = section
            .paragraph("What this log does not tell:")
            .list(found.not_identified.iter().map(not_identified).collect());
    }
    section.findings("warning", found.warnings.clone())
}

/// Whether the axes have one correlation time.
fn same_time(shared: &SharedTime) -> String {
    let limit = |limit: Option<f64>| limit.map_or("open".into(), digits);
    format!(
        "One correlation time for all axes: {} s ({} … {}); likelihood ratio {}, p = {}: {}",
        digits(shared.correlation_time_s),
        limit(shared.lower_s),
        limit(shared.upper_s),
        digits(shared.likelihood_ratio),
        digits(shared.p_value),
        if shared.p_value < SAME_TIME { "the axes differ" } else { "the log does not tell the axes apart" }
    )
}

/// "gyro_x: white+gm from 720000 samples (2 h); fit p = 0.41".
fn headline(axis: &IdentifiedAxis) -> String {
    let (found, samples) = (&axis.found, axis.found.samples);
    let (name, span) = (&found.params.name, duration(samples as f64 * found.curve.dt));
    let Some(chosen) = found.candidates.iter().find(|c| c.chosen) else {
        return format!("{name}: the graphical recipe on {samples} samples ({span})");
    };
    let used = found.first_tau_s.map_or_else(String::new, |tau| format!(", averaging times from {} s", digits(tau)));
    format!("{name}: {} from {samples} samples ({span}); fit p = {}{used}", chosen.model, digits(found.fit_p_value))
}

fn step(s: &Step) -> [String; 4] {
    [s.what.clone(), s.formula.clone(), or_dash(s.value), s.unit.clone()]
}

fn not_identified(entry: &NotIdentified) -> String {
    let needed =
        entry.needed_log_s.map_or_else(String::new, |s| format!("; a log of about {} would tell", duration(s)));
    format!("{}: {}{needed}", entry.term, entry.reason)
}

/// The models that were compared; none for the graphical recipe.
fn candidates<'a>(section: Section<'a>, candidates: &[Candidate]) -> Section<'a> {
    let Some(chosen) = candidates.iter().find(|c| c.chosen) else { return section };
    let best = candidates.iter().map(|c| c.score).fold(f64::INFINITY, f64::min);
    let against = |value: Option<f64>, chosen: Option<f64>| match (value, chosen) {
        (Some(value), Some(chosen)) => format!("{:+.2}", value - chosen),
        _ => "-".into(),
    };
    let row = |(_, c): (usize, &Candidate)| {
        let mark = match (c.chosen, c.identified) {
            (true, _) => "chosen",
            (false, false) => "not identified",
            (false, true) => "",
        };
        let [a, b, score] = match c.chi_square.zip(c.dof) {
            Some((chi_square, dof)) => [digits(chi_square), dof.to_string(), digits(c.score)],
            None => [
                against(c.log_likelihood, chosen.log_likelihood),
                against(c.held_out, chosen.held_out),
                format!("{:+.2}", c.score - best),
            ],
        };
        [c.model.clone(), c.parameters.to_string(), a, b, score, mark.into()]
    };
    let shown = candidates.iter().enumerate().filter(|(place, c)| *place < SHOWN_CANDIDATES || c.chosen);
    let (caption, [a, b]) = match chosen.chi_square {
        Some(_) => {
            let caption = "Candidates (score = chi-square + 4 per parameter + 4 per process; lowest wins)";
            (caption, ["chi-square", "dof"])
        }
        None => (
            "Candidates (ln L of the log, and of its last third under what the first two thirds give, against the \
             chosen; \
             score: -2 ln L plus a cost for every process, lowest wins, unless one within 6 of it foretells that third \
             better by more than 3)",
            ["ln L", "held out"],
        ),
    };
    section.table(caption, &["model", "parameters", a, b, "score", ""], shown.map(row))
}

/// What of the bias follows the temperature, and the parameters without and with that.
fn on_temperature<'a>(section: Section<'a>, of: &OnTemperature) -> Section<'a> {
    let [low, high] = of.range.map(digits);
    let unit = &of.reference.unit;
    let filled = match of.missing {
        0.0 => String::new(),
        share => format!("; {} % of the samples have none and are filled in", digits(100.0 * share)),
    };
    let column = &of.column;
    let averaged =
        format!("Temperature {column}, averaged over {} s: {low} … {high} {unit}{filled}.", digits(SMOOTHING_S));
    let found = match &of.found {
        Ok(found) => found,
        Err(reason) => return section.paragraph(format!("{averaged} No regression: {reason}.")),
    };
    let coefficient = of.coefficient(found);
    let [from, to] = coefficient.interval.map_or_else(Default::default, |ends| ends.map(digits));
    let verdict = if found.p_value < FOLLOWS {
        "the bias follows the temperature".to_string()
    } else {
        format!("a span of {} {unit} does not show that the bias follows the temperature", digits(of.span.value))
    };
    let mut sentences = vec![format!(
        "{averaged} Bias with temperature: {} {} (95 %: {from} … {to}); 2 Δ ln L {}, p = {}: {verdict}.",
        digits(coefficient.value),
        of.per,
        digits(found.likelihood_ratio),
        digits(found.p_value)
    )];
    sentences.extend(found.reliability.filter(|share| *share < RELIABLE).map(|share| {
        let percent = digits(100.0 * share);
        format!("The temperature is noisy: this coefficient is on average {percent} % of the true one.")
    }));
    let cells = |measured: &Measured| {
        let [low, high] = measured.interval.unwrap_or([0.0, f64::INFINITY]);
        let value = Some(measured.value).filter(|_| measured.interval.is_none() || (low > 0.0 && high.is_finite()));
        [value, Some(low).filter(|low| *low > 0.0), Some(high).filter(|high| high.is_finite())].map(or_dash)
    };
    let rows = found.parameters.iter().map(|pair| {
        let numbers = cells(&pair.without).into_iter().chain(cells(&pair.with));
        [pair.parameter.clone()].into_iter().chain(numbers).chain([pair.without.unit.to_string()])
    });
    section.paragraphs(sentences).table(
        "Parameters without the regression, which are those above and those written, and with it",
        &["parameter", "without", "95 % from", "to", "with", "95 % from", "to", "unit"],
        rows,
    )
}
