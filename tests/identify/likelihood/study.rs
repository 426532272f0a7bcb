//! Studies: `cargo test --release -- --ignored --nocapture likelihood_study` prints the figures of docs/validation.md.

use std::collections::BTreeMap;
use std::time::Instant;

use kfdesign::identify::{Identified, ModelChoice, parse_model};
use kfdesign::noise::{Filter, Kind, Term};
use rayon::prelude::*;

use super::super::{gauss_markov, log, white};
use super::{SIGMA, TC, bound, identify, ln_estimate};

const N: f64 = super::super::N;

/// Logs per row of a study.
fn runs(usual: u64) -> u64 {
    std::env::var("KFDESIGN_STUDY_RUNS").ok().and_then(|v| v.parse().ok()).unwrap_or(usual)
}

/// Seed of a study: other logs of the same kind.
fn seed(usual: u64) -> u64 {
    std::env::var("KFDESIGN_STUDY_SEED").ok().and_then(|v| v.parse().ok()).unwrap_or(usual)
}

fn mean_and_sd(values: &[f64]) -> (f64, f64) {
    let n = values.len() as f64;
    let mean = values.iter().sum::<f64>() / n;
    (mean, (values.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / (n - 1.0)).sqrt())
}

/// Errors of ln N, ln σ, ln Tc, ln q_c against the Cramér-Rao bound. Also the ratio of the printed bound to the
/// formula, both at the estimate.
///
/// A log in which Tc is not identified has lost its Gauss-Markov process; it is counted and left out.
#[test]
#[ignore = "a study of minutes that prints figures, not a check"]
fn likelihood_study_of_efficiency() {
    let (runs, forced) = (runs(200), parse_model("white+gm").unwrap());
    let truth = [N, SIGMA, TC, SIGMA * (2.0 / TC).sqrt()].map(f64::ln);
    println!("| log | parameter | logs | mean error/sd | sd | bound | (bound/sd)² | median printed bound/formula |");
    println!("| --- | --- | --- | --- | --- | --- | --- | --- |");
    let only = std::env::var("KFDESIGN_STUDY_CASE").unwrap_or_default();
    for hours in [1.0_f64, 2.0, 4.0, 10.0].into_iter().filter(|h| format!("{h} h").contains(&only)) {
        let samples = (hours * 3600.0) as usize;
        let started = Instant::now();
        let found: Vec<(Identified, [f64; 4])> = (0..runs)
            .into_par_iter()
            .filter_map(|run| {
                let rate = log(&[white(N), gauss_markov(SIGMA, TC)], samples, 1.0, seed(31), run);
                let found = identify(&rate, 1.0, &forced);
                ln_estimate(&found).map(|estimate| (found, estimate))
            })
            .collect();
        let at_truth = bound(N, SIGMA, TC, samples, 1.0);
        for (i, name) in ["N", "sigma", "Tc", "q_c"].iter().enumerate() {
            let errors: Vec<f64> = found.iter().map(|(_, estimate)| estimate[i] - truth[i]).collect();
            let (mean, sd) = mean_and_sd(&errors);
            let mut ratios: Vec<f64> = found
                .iter()
                .filter_map(|(found, e)| {
                    let [n, sigma, tc] = [e[0], e[1], e[2]].map(f64::exp);
                    let printed = found.precision.get(i)?.cramer_rao_percent / 100.0;
                    Some(printed / bound(n, sigma, tc, samples, 1.0)[i])
                })
                .collect();
            ratios.sort_by(f64::total_cmp);
            let ratio = ratios.get(ratios.len() / 2).map_or("".into(), |r| format!("{r:.4}"));
            println!(
                "| {hours} h | {name} | {} | {:+.2} | {sd:.5} | {:.5} | {:.2} | {ratio} |",
                errors.len(),
                mean / sd,
                at_truth[i],
                (at_truth[i] / sd).powi(2)
            );
        }
        println!("{hours} h: {:.3} s a log on all cores", started.elapsed().as_secs_f64() / runs as f64);
    }
}

/// What the log says about one parameter: limits, each of which may be missing.
fn limits(found: &Identified, interval: [f64; 2], parameter: &str) -> Option<[f64; 2]> {
    if interval.iter().all(|v| v.is_finite()) {
        return Some(interval);
    }
    let said = &found.not_identified.iter().find(|n| n.term == parameter)?.reason;
    let number = |word: &str| said.split(word).nth(1)?.trim().split(' ').next()?.parse::<f64>().ok();
    if said.starts_with("above") { Some([number("above")?, f64::INFINITY]) } else { Some([0.0, number("below")?]) }
}

#[test]
#[ignore = "a study of minutes that prints figures, not a check"]
fn likelihood_study_of_coverage() {
    let (runs, forced) = (runs(1000), parse_model("white+gm").unwrap());
    let truth = [N, SIGMA, TC];
    println!("| log | parameter | two-sided, covered | one-sided, right | nothing said | all that is said, right |");
    println!("| --- | --- | --- | --- | --- | --- |");
    for hours in [1.0, 2.0, 4.0] {
        let found: Vec<Identified> = (0..runs)
            .into_par_iter()
            .map(|run| {
                identify(
                    &log(&[white(N), gauss_markov(SIGMA, TC)], (hours * 3600.0) as usize, 1.0, 32, run),
                    1.0,
                    &forced,
                )
            })
            .collect();
        let dropped = found.iter().filter(|f| f.model.terms.len() < 2).count();
        let names = ["white.density", "gauss_markov.std_dev", "gauss_markov.correlation_time"];
        for (i, parameter) in names.iter().enumerate() {
            let (mut written, mut inside, mut said, mut right, mut below) = (0, 0, 0, 0, 0);
            for f in &found {
                let interval = super::super::intervals(f)[i];
                let Some([low, high]) = limits(f, interval, parameter) else { continue };
                let holds = low <= truth[i] && truth[i] <= high;
                below += usize::from(truth[i] < low);
                if interval.iter().all(|v| v.is_finite()) {
                    written += 1;
                    inside += usize::from(holds);
                } else {
                    said += 1;
                    right += usize::from(holds);
                }
            }
            println!(
                "| {hours} h | {parameter} | {inside} of {written} ({:.3}) | {right} of {said} | {} | {:.3}; truth below the interval {:.3} |",
                inside as f64 / written as f64,
                runs as usize - written - said,
                (inside + right) as f64 / (written + said) as f64,
                below as f64 / (written + said) as f64
            );
        }
        println!("{hours} h: Gauss-Markov dropped in {dropped} of {runs}");
    }
}

/// Numbers of processes by kind, the length of a moving average included.
fn structure(terms: &[Term]) -> BTreeMap<(Kind, u32), usize> {
    let mut counts = BTreeMap::new();
    for term in terms {
        let samples = if let Term::MovingAverage { samples, .. } = term { *samples } else { 0 };
        *counts.entry((term.kind(), samples)).or_insert(0) += 1;
    }
    counts
}

fn named(structure: &BTreeMap<(Kind, u32), usize>) -> String {
    let name = |((kind, samples), count): (&(Kind, u32), &usize)| {
        let average = if *samples > 0 { format!("({samples})") } else { String::new() };
        let times = if *count > 1 { format!("{count} ") } else { String::new() };
        format!("{times}{kind:?}{average}")
    };
    structure.iter().map(name).collect::<Vec<_>>().join("+")
}

/// How often `auto` finds the processes that are there, and how often more than these.
#[test]
#[ignore = "a study of minutes that prints figures, not a check"]
fn likelihood_study_of_model_choice() {
    let runs = runs(200);
    let line = Term::Oscillation { std_dev: 0.05, frequency_hz: 20.0, correlation_time: 10.0 };
    let average = Term::MovingAverage { density: 0.05, samples: 2 };
    let walk = Term::RateRandomWalk { density: SIGMA * (2.0 / TC).sqrt() };
    let low_pass = Filter::new(&[1.0, 2.0, 1.0], &[1.0, -1.142_980_502_539_901_1, 0.412_801_598_096_188_77]).unwrap();
    let limited = Term::BandLimit { density: 0.05, filter: low_pass };
    let cases: [(&str, Vec<Term>, usize, f64); 12] = [
        (
            "low-pass of order 2 at a tenth of the rate + gm, 2 h at 10 Hz",
            vec![white(0.0005), limited, gauss_markov(SIGMA, TC)],
            72_000,
            0.1,
        ),
        ("white, 2 h at 10 Hz", vec![white(N)], 72_000, 0.1),
        ("white + gm, 2 h at 10 Hz", vec![white(N), gauss_markov(SIGMA, TC)], 72_000, 0.1),
        (
            "white + 2 gm (0.03, 10 s; 0.03, 200 s; white 0.0562), 2 h at 10 Hz",
            vec![white(N), gauss_markov(0.03, 10.0), gauss_markov(0.03, 200.0)],
            72_000,
            0.1,
        ),
        (
            "white + 2 gm (0.03, 5 s; 0.03, 100 s; white 0.01), 2 h at 10 Hz",
            vec![white(0.01), gauss_markov(0.03, 5.0), gauss_markov(0.03, 100.0)],
            72_000,
            0.1,
        ),
        (
            "white + gm (0.03, 20 s) + line (0.05, 20 Hz, 10 s), 20 min at 100 Hz",
            vec![white(N), gauss_markov(0.03, 20.0), line],
            120_000,
            0.01,
        ),
        (
            "white 0.025 + moving average(2) 0.05 + gm, 2 h at 10 Hz",
            vec![white(0.025), average, gauss_markov(SIGMA, TC)],
            72_000,
            0.1,
        ),
        ("white + random walk, 2 h at 10 Hz", vec![white(N), walk], 72_000, 0.1),
        (
            "white + gm (0.05, 10 s) + line (0.05, 20 Hz, 10 s), 20 min at 100 Hz",
            vec![white(N), gauss_markov(0.05, 10.0), line],
            120_000,
            0.01,
        ),
        (
            "white + gm (0.03, 5 s) + line (0.05, 20 Hz, 10 s), 20 min at 100 Hz",
            vec![white(N), gauss_markov(0.03, 5.0), line],
            120_000,
            0.01,
        ),
        (
            "white + gm + line (0.05, 20 Hz, 10 s), 2 h at 100 Hz",
            vec![white(N), gauss_markov(SIGMA, TC), line],
            720_000,
            0.01,
        ),
        (
            "white + flicker 0.012, 2 h at 10 Hz",
            vec![white(N), Term::BiasInstability { coefficient: 0.012 }],
            72_000,
            0.1,
        ),
    ];
    println!("| truth | found | true and more | more processes than true | others | s a log |");
    println!("| --- | --- | --- | --- | --- | --- |");
    let wanted = std::env::var("KFDESIGN_STUDY_CASE").unwrap_or_default();
    for (name, terms, samples, dt) in cases.into_iter().filter(|(name, ..)| name.contains(&wanted)) {
        let started = Instant::now();
        let truth = structure(&terms);
        let chosen: Vec<_> = (0..runs)
            .into_par_iter()
            .map(|run| structure(&identify(&log(&terms, samples, dt, 33, run), dt, &ModelChoice::Auto).model.terms))
            .collect();
        let (mut exact, mut more, mut larger, mut wrong) = (0, 0, 0, BTreeMap::new());
        for found in &chosen {
            if *found == truth {
                exact += 1;
                continue;
            }
            more += usize::from(truth.iter().all(|(key, count)| found.get(key).is_some_and(|c| c >= count)));
            larger += usize::from(found.values().sum::<usize>() > terms.len());
            *wrong.entry(named(found)).or_insert(0) += 1;
        }
        let share = |count: usize| format!("{:.3}", count as f64 / runs as f64);
        println!(
            "| {name} | {} | {} | {} | {wrong:?} | {:.2} |",
            share(exact),
            share(more),
            share(larger),
            started.elapsed().as_secs_f64() / runs as f64
        );
    }
}
