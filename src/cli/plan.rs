//! `kfdesign plan`.

use std::path::PathBuf;

use anyhow::{Context, bail};
use rayon::prelude::*;
use schemars::JsonSchema;
use serde::Serialize;

use super::Status;
use super::files::{self, Kind};
use super::output::{digits, duration, notes_of_rate, print_json, print_text, say_all, table};
use crate::cli::checked;
use crate::export::atomic;
use crate::identify::plan::{LONGEST_S, Planned, Sampling, Thinning};
use crate::noise::NoiseModel;
use crate::params::{AxisParams, Params};

/// How long to record, and at which rate, to know a parameter to a wished precision
///
/// The precision is the relative standard deviation (1 sigma) of a maximum likelihood estimate with the model of params.json; its Cramér-Rao
/// bound at these parameters is what is planned with. Exit status 1 when no log of up to ten years is enough.
#[derive(Debug, clap::Args)]
#[command(
    after_help = "Example: kfdesign plan data/params.json --parameter gauss_markov.correlation_time --precision 10%"
)]
pub struct Args {
    /// Noise parameters: guesses of the right size, from a short log or a datasheet
    params: PathBuf,
    /// As in the document: white.density, gauss_markov[1].std_dev, …; also gauss_markov.driving_noise (sigma sqrt(2/Tc))
    #[arg(long, value_name = "NAME")]
    parameter: String,
    /// Relative standard deviation, 1 sigma: 10% or 0.1
    #[arg(long, value_name = "SHARE", allow_hyphen_values = true)]
    precision: String,
    /// One axis [default: every axis that has the parameter]
    #[arg(long, value_name = "NAME")]
    axis: Option<String>,
    /// Sample rate of the sensor in Hz [default: sample_rate of the parameters]
    #[arg(long, value_name = "HZ", allow_negative_numbers = true)]
    rate: Option<f64>,
    /// The plan as a JSON document
    #[arg(short, long, value_name = "FILE.json")]
    output: Option<PathBuf>,
    /// One JSON document on stdout
    #[arg(long)]
    json: bool,
}

/// Lengths of the reverse table, h.
const HOURS: [f64; 4] = [1.0, 2.0, 4.0, 10.0];
/// A lower rate is worth its while when the log becomes longer by at most this.
const WORTH: f64 = 1.05;
/// The table of rates ends with one at which the log is this much longer.
const DEAR: f64 = 2.0;
/// Samples of the sensor in one of the log, at most.
const MOST: usize = 100_000;

/// What `plan --json` prints.
#[derive(Debug, Serialize, JsonSchema)]
pub(super) struct Document<'a> {
    /// "kfdesign-plan/1".
    format: &'static str,
    parameter: &'a str,
    /// Wished relative standard deviation, 1 sigma.
    precision: f64,
    sample_rate_hz: f64,
    axes: &'a [Axis],
}

#[derive(Clone, Debug, Serialize, JsonSchema)]
struct Axis {
    name: String,
    /// At the sensor's own rate; absent when ten years are not enough.
    duration_s: Option<f64>,
    /// Relative standard deviation after ten years, when those are not enough; absent when they say nothing at all.
    #[serde(skip_serializing_if = "Option::is_none")]
    precision_after_ten_years: Option<f64>,
    rates: Vec<Rate>,
    /// The lowest rate of which the log is at most 5 % longer.
    recommended: Option<Rate>,
    parameters: Vec<Parameter>,
    #[serde(skip)]
    value: Option<String>,
    #[serde(skip)]
    model: NoiseModel,
}

/// A rate, and what it asks for.
#[derive(Clone, Debug, Serialize, JsonSchema)]
struct Rate {
    rate_hz: f64,
    /// Samples of the sensor in one of the log.
    every: usize,
    #[serde(skip_serializing_if = "Option::is_none")]
    thinning: Option<Thinning>,
    duration_s: Option<f64>,
    /// Against the sensor's own rate.
    ratio: Option<f64>,
}

/// Relative standard deviations; absent where the log cannot tell the parameter.
#[derive(Clone, Debug, Serialize, JsonSchema)]
struct Parameter {
    parameter: String,
    after_duration: Option<f64>,
    after_hours: Vec<Hours>,
}

#[derive(Clone, Copy, Debug, Serialize, JsonSchema)]
struct Hours {
    hours: f64,
    precision: Option<f64>,
}

pub(super) fn run(args: &Args) -> anyhow::Result<Status> {
    files::check(&[("-o", &args.output, Kind::Json)], &[&args.params])?;
    let params = checked::params(&args.params)?;
    let precision = share(&args.precision)?;
    let rate_hz = args.rate.unwrap_or(params.sample_rate_hz);
    if !(rate_hz.is_finite() && rate_hz > 0.0) {
        bail!("--rate {rate_hz}: expected a positive number of Hz");
    }
    let chosen = chosen(args, &params)?;
    for axis in &chosen {
        axis.noise()
            .check_rate(1.0 / rate_hz)
            .with_context(|| format!("{}: axis {}", args.params.display(), axis.name))?;
    }
    say_all(&notes_of_rate(&params, &chosen, rate_hz));
    // axes alike are planned once
    let mut unlike: Vec<&AxisParams> = Vec::new();
    for axis in &chosen {
        if !unlike.iter().any(|other| other.noise() == axis.noise()) {
            unlike.push(axis);
        }
    }
    let plans: Vec<Axis> = unlike
        .into_par_iter()
        .map(|axis| plan(axis, &args.parameter, precision, rate_hz))
        .collect::<anyhow::Result<_>>()?;
    let of = |axis: &&AxisParams| {
        let plan = plans.iter().find(|plan| plan.model == axis.noise())?;
        Some(Axis { name: axis.name.clone(), ..plan.clone() })
    };
    let axes: Vec<Axis> = chosen.iter().filter_map(of).collect();
    let document = Document {
        format: "kfdesign-plan/1",
        parameter: &args.parameter,
        precision,
        sample_rate_hz: rate_hz,
        axes: &axes,
    };
    if let Some(path) = &args.output {
        let mut text = serde_json::to_string_pretty(&document)?;
        text.push('\n');
        atomic::write(path, text.as_bytes())?;
    }
    if args.json {
        print_json(&document)?;
    } else {
        print_text(&text(&document));
    }
    Ok(if axes.iter().all(|axis| axis.duration_s.is_some()) { Status::Done } else { Status::CheckFailed })
}

/// "10%" or "0.1".
fn share(text: &str) -> anyhow::Result<f64> {
    let (number, unit) = text.trim().strip_suffix('%').map_or((text.trim(), 1.0), |number| (number.trim(), 0.01));
    match number.parse::<f64>().map(|value| value * unit) {
        Ok(share) if share > 0.0 && share <= 1.0 => Ok(share),
        _ => bail!("--precision {text}: expected a share above 0 and at most 1, such as 10% or 0.1"),
    }
}

/// The axes that are asked for and have the parameter.
fn chosen<'a>(args: &Args, params: &'a Params) -> anyhow::Result<Vec<&'a AxisParams>> {
    let file = args.params.display();
    let asked: Vec<&AxisParams> =
        params.axes.iter().filter(|axis| args.axis.as_ref().is_none_or(|name| axis.name == *name)).collect();
    if asked.is_empty() {
        let names: Vec<&str> = params.axes.iter().map(|axis| axis.name.as_str()).collect();
        let name = args.axis.as_deref().unwrap_or_default();
        bail!("--axis {name}: {file} has no such axis; it has {}", names.join(", "));
    }
    let mut known: Vec<String> = Vec::new();
    let mut found = Vec::new();
    for axis in asked {
        let planned = Planned::new(&axis.noise());
        if planned.names().any(|name| name == args.parameter) {
            found.push(axis);
        }
        for name in planned.names().filter(|name| !known.iter().any(|k| k == name)).collect::<Vec<_>>() {
            known.push(name.to_string());
        }
    }
    if found.is_empty() {
        let known = if known.is_empty() { "no noise parameter at all".to_string() } else { known.join(", ") };
        bail!("--parameter {}: {file} has no such parameter; it has {known}", args.parameter);
    }
    Ok(found)
}

fn plan(axis: &AxisParams, parameter: &str, precision: f64, rate_hz: f64) -> anyhow::Result<Axis> {
    let model = axis.noise();
    let planned = Planned::new(&model);
    let index = planned.names().position(|name| name == parameter).context("the axis has the parameter")?;
    let own = Sampling { sensor_rate_hz: rate_hz, every: 1, thinning: Thinning::Averages };
    let duration_s = planned.duration(index, precision, &own);
    let row = |sampling: &Sampling, of_the_sensor: bool| {
        let needed = planned.duration(index, precision, sampling);
        Rate {
            rate_hz: sampling.rate_hz(),
            every: sampling.every,
            thinning: (!of_the_sensor).then_some(sampling.thinning),
            duration_s: needed,
            ratio: needed.zip(duration_s).map(|(needed, own)| needed / own),
        }
    };
    let faster = model.of_samples().is_none();
    let rates = if duration_s.is_some() { rates(&own, &row, faster) } else { vec![] };
    let recommended = duration_s.map(|_| recommended(&own, &row));
    let at = |span_s: f64| planned.precision(span_s, &own);
    let after: Vec<f64> = duration_s.map(&at).unwrap_or_default();
    let after_hours = HOURS.map(|hours| (hours, at(3600.0 * hours)));
    let finite = |values: &[f64], i: usize| values.get(i).copied().filter(|v| v.is_finite());
    let parameters = planned.names().enumerate().map(|(i, name)| Parameter {
        parameter: name.to_string(),
        after_duration: finite(&after, i),
        after_hours: after_hours
            .iter()
            .map(|(hours, all)| Hours { hours: *hours, precision: finite(all, i) })
            .collect(),
    });
    let mut written = axis.clone();
    let value = written.noise_parameters().find(|(name, _)| name == parameter);
    Ok(Axis {
        name: axis.name.clone(),
        precision_after_ten_years: if duration_s.is_some() { None } else { finite(&at(LONGEST_S), index) },
        duration_s,
        rates,
        recommended,
        parameters: parameters.collect(),
        value: value.map(|(_, value)| format!("{} {}", digits(value.value), value.unit)),
        model,
    })
}

/// Ten times the rate (if no term counts samples), the rate itself, a tenth, … until averages ask for a log twice as long.
fn rates(own: &Sampling, row: &impl Fn(&Sampling, bool) -> Rate, faster: bool) -> Vec<Rate> {
    let ten_times = Sampling { sensor_rate_hz: 10.0 * own.sensor_rate_hz, ..*own };
    let of_the_sensor = if faster { vec![ten_times, *own] } else { vec![*own] };
    let mut rates: Vec<Rate> = of_the_sensor.iter().map(|sampling| row(sampling, true)).collect();
    let mut every = 10;
    while every <= MOST {
        let averages = row(&Sampling { every, ..*own }, false);
        let dear = averages.ratio.is_none_or(|ratio| ratio > DEAR);
        rates.push(averages);
        if dear {
            break;
        }
        rates.push(row(&Sampling { every, thinning: Thinning::Decimation, ..*own }, false));
        every *= 10;
    }
    rates
}

/// Means of 2, 5, 10, 20 … samples, as many as cost at most 5 %.
fn recommended(own: &Sampling, row: &impl Fn(&Sampling, bool) -> Rate) -> Rate {
    let mut best = row(own, true);
    let steps = (0..).flat_map(|decade| [1, 2, 5].map(|digit| digit * 10_usize.pow(decade)));
    for every in steps.skip(1).take_while(|every| *every <= MOST) {
        let next = row(&Sampling { every, ..*own }, false);
        if next.ratio.is_none_or(|ratio| ratio > WORTH) {
            break;
        }
        best = next;
    }
    best
}

fn percent(share: Option<f64>) -> String {
    // beyond, nothing is known
    share.filter(|share| *share < 10.0).map_or("-".into(), |share| digits(100.0 * share))
}

fn text(plan: &Document) -> String {
    let mut out = String::new();
    // axes alike are told once
    let mut rest = plan.axes;
    while let Some(axis) = rest.first() {
        let alike = rest.iter().take_while(|other| other.model == axis.model).count();
        let names: Vec<&str> = rest[..alike].iter().map(|axis| axis.name.as_str()).collect();
        if !out.is_empty() {
            out.push('\n');
        }
        out += &of_axis(plan, axis, &names.join(", "));
        rest = &rest[alike..];
    }
    out.push_str(
        "\nPrecision: relative standard deviation (1 sigma) of a maximum likelihood estimate, Cramér-Rao bound at these parameters.\n\
         Assumed: a sensor at rest, the model of the parameters; the same coefficients at a higher rate (white noise of the same density);\n\
         a lower rate either as means of consecutive samples or with samples thrown away.\n",
    );
    out
}

fn of_axis(plan: &Document, axis: &Axis, names: &str) -> String {
    let wish = format!("{} %", digits(100.0 * plan.precision));
    let value = axis.value.as_ref().map_or_else(String::new, |value| format!(" ({value})"));
    let what = format!("{names}: {}{value}", plan.parameter);
    let rate = digits(plan.sample_rate_hz);
    let mut out = match axis.duration_s {
        Some(seconds) => format!("{what} to {wish}: {} at {rate} Hz\n", duration(seconds)),
        None => {
            let after = match axis.precision_after_ten_years.filter(|share| *share < 10.0) {
                Some(share) => format!("ten years at {rate} Hz give {} %", digits(100.0 * share)),
                None => format!(
                    "ten years at {rate} Hz say nothing of it: the model cannot tell it from its other parameters"
                ),
            };
            format!("{what} to {wish}: no log is long enough; {after}\n")
        }
    };
    if !axis.rates.is_empty() {
        let rows: Vec<Vec<String>> = axis.rates.iter().map(rate_row).collect();
        out += &format!("\n{}", table(&["rate (Hz)", "samples", "length", "against own rate"], &rows));
    }
    if let Some(best) = &axis.recommended {
        out += &format!("Lowest rate for at most 5 % more: {}\n", advice(best));
    }
    let mut header = vec!["precision (%) after".to_string()];
    header.extend(axis.duration_s.map(duration));
    header.extend(HOURS.map(|hours| format!("{hours} h")));
    let row = |parameter: &Parameter| {
        let planned = axis.duration_s.map(|_| percent(parameter.after_duration));
        let hours = parameter.after_hours.iter().map(|after| percent(after.precision));
        std::iter::once(parameter.parameter.clone()).chain(planned).chain(hours).collect()
    };
    let rows: Vec<Vec<String>> = axis.parameters.iter().map(row).collect();
    let header: Vec<&str> = header.iter().map(String::as_str).collect();
    out + &format!("\n{}", table(&header, &rows))
}

fn samples(rate: &Rate) -> String {
    match rate.thinning {
        None => "of the sensor".into(),
        Some(Thinning::Averages) => format!("means of {}", rate.every),
        Some(Thinning::Decimation) => format!("one of {}", rate.every),
    }
}

fn rate_row(rate: &Rate) -> Vec<String> {
    let length = rate.duration_s.map_or("above 10 years".into(), duration);
    vec![digits(rate.rate_hz), samples(rate), length, rate.ratio.map_or("-".into(), |ratio| format!("{ratio:.3}"))]
}

fn advice(best: &Rate) -> String {
    let length = best.duration_s.map_or_else(String::new, duration);
    match best.thinning {
        None => format!("{} Hz, the sensor's own", digits(best.rate_hz)),
        Some(_) => format!("{} Hz, {}: {length}", digits(best.rate_hz), samples(best)),
    }
}
