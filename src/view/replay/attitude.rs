//! A log through an attitude filter.

use crate::filter::AttitudeDesign;
use crate::replay::attitude::{AttitudeReplay, Errors};
use crate::report::{Conclusion, Report, Section};
use crate::units::digits;

pub fn attitude<'a>(result: &AttitudeReplay, design: &AttitudeDesign) -> Report<'a> {
    let used = [("horizontal specific force", result.specific_force), ("heading", result.heading)];
    let used = used
        .iter()
        .filter(|(_, used)| used.samples > 0)
        .map(|(name, used)| [name.to_string(), used.samples.to_string(), used.outliers.to_string(), digits(used.nis)]);
    let mut sections = vec![
        Section::of_page("Samples")
            .paragraph(format!(
                "{} samples, {} gaps ({} missing), {} unusable; gyro taken as its own drift, at rest: {}",
                result.samples, result.gaps, result.missing, result.unusable, result.at_rest
            ))
            .table("Measurements", &["measurement", "taken", "outliers (weighted down)", "mean NIS"], used),
    ];
    sections.extend(result.errors.as_ref().map(errors));
    let of_axes = design.axes.iter().flat_map(|axis| [axis.clone(), "sigma".into(), "mean rate".into()]);
    let header: Vec<String> = ["rest (s)".to_string()].into_iter().chain(of_axes).collect();
    sections.push(Section::of_page("Rests").table(
        "Gyro drift at the end of each rest, with sigma, and the mean rate of the rest (deg/s)",
        &header,
        result.rests.iter().map(|rest| {
            let numbers = (0..3).flat_map(|i| [rest.drift[i], rest.sigma[i], rest.mean_rate[i]]);
            let span = format!("{} to {}", digits(rest.start_s), digits(rest.end_s));
            std::iter::once(span).chain(numbers.map(|rad| digits(rad.to_degrees()))).collect::<Vec<_>>()
        }),
    ));
    Report {
        title: format!("Replay of {}", result.log.as_deref().unwrap_or_default()),
        verdict: Some(Conclusion::new(result.verdict, result.meaning.clone())),
        sections,
        ..Report::default()
    }
}

fn errors<'a>(errors: &Errors) -> Section<'a> {
    let row =
        |name: &str, rmse: f64, sigma: Option<f64>| [name.to_string(), digits(rmse), super::super::or_dash(sigma)];
    let rows = [
        row("total", errors.total_rmse_deg, None),
        row("heading", errors.heading_rmse_deg, Some(errors.heading_sigma_deg).filter(|_| errors.degrees == 3)),
        row("inclination", errors.inclination_rmse_deg, Some(errors.inclination_sigma_deg)),
    ];
    let offset = errors
        .heading_offset_deg
        .map(|offset| format!("a constant heading of {} deg was taken off: nothing measures it", digits(offset)));
    let percent = |share: f64| digits(100.0 * share);
    let up = errors.covered_up.map_or(String::new(), |share| format!(", about the vertical {} %", percent(share)));
    let honesty = [
        format!(
            "mean NEES {} of {} with {} deg and {} ms of the reference allowed for, {} without",
            digits(errors.nees),
            errors.degrees,
            digits(errors.reference_std_dev_deg),
            digits(1e3 * errors.reference_timing_s),
            digits(errors.nees_of_claim)
        ),
        format!(
            "in the claimed 3 sigma: {} % of the samples; about east {} %, about north {} %{up}",
            percent(errors.covered),
            percent(errors.covered_east),
            percent(errors.covered_north)
        ),
    ];
    Section::of_page("Errors")
        .table(
            format!("Errors against the reference, {} samples (deg)", errors.samples),
            &["error", "RMSE", "mean claimed sigma"],
            rows,
        )
        .paragraphs(offset.into_iter().chain(honesty).collect())
}
