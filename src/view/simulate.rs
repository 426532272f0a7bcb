//! What was simulated.

use crate::report::{Report, Section};
use crate::simulate::Summary;
use crate::units::digits;

pub fn simulate<'a>(summary: &Summary) -> Report<'a> {
    let unit = &summary.unit;
    let [bias, mean, sigma] = ["bias", "mean", "std dev"].map(|what| format!("{what} ({unit})"));
    let rows = summary
        .axes
        .iter()
        .map(|a| [a.name.clone(), digits(a.bias), digits(a.mean), digits(a.std_dev), a.saturated.to_string()]);
    let sentence = format!(
        "{}: {} samples at {} Hz ({} s), seed {}, run {}.",
        summary.log,
        summary.samples,
        summary.sample_rate_hz,
        digits(summary.duration_s),
        summary.seed,
        summary.run
    );
    let section = Section::new("").table("", &["axis", &bias, &mean, &sigma, "saturated"], rows).paragraph(sentence);
    Report { title: summary.log.clone(), sections: vec![section], ..Report::default() }
}
