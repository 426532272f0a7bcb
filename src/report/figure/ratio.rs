//! Spectrum of a log over that of a model, in bands.

use super::chart::{Axis, Chart};
use super::scale::Scale;
use super::style::Class;

#[derive(Clone, Debug, Default, PartialEq)]
pub struct SpectrumRatio {
    pub title: String,
    /// From and to (Hz), ratio, and where it should be.
    pub bands: Vec<[f64; 5]>,
    /// "99 % for all bands together".
    pub band_label: String,
}

/// Log-log steps over the frequencies, one expected.
pub fn spectrum_ratio(data: &SpectrumRatio) -> String {
    let steps = |pick: usize| data.bands.iter().flat_map(move |b| [(b[0], b[pick]), (b[1], b[pick])]);
    let furthest = data
        .bands
        .iter()
        .map(|b| b[2])
        .filter(|r| *r > 0.0)
        .fold(1.0f64, |f, r| if r.ln().abs() > f.ln().abs() { r } else { f });
    let mut chart = Chart::new(
        &data.title,
        &format!(
            "Spectrum of the log over that of the model in {} bands; farthest from one: {furthest:.3}.",
            data.bands.len()
        ),
        Axis { name: "frequency".into(), unit: "Hz".into(), scale: Scale::log(steps(2).map(|p| p.0)) },
        Axis {
            name: "log over model".into(),
            unit: String::new(),
            // led by the ratios; the wide bounds of the lowest bands may run out
            scale: Scale::log(steps(2).map(|p| p.1).chain([0.5, 2.0])),
        },
    );
    chart.band(5, data.bands.iter().flat_map(|b| [(b[0], b[3], b[4]), (b[1], b[3], b[4])]).collect());
    chart.level(Class::Expected, 1.0);
    chart.line(Class::Line(0), steps(2).collect());
    chart.legend_line(Class::Line(0), "log over model");
    chart.legend_line(Class::Expected, "equal");
    chart.legend_band(5, &data.band_label);
    chart.render()
}
