//! A report as one self-contained HTML page: no script, nothing fetched, readable on a phone, in the dark and on paper.

use minijinja::value::Serde;
use minijinja::{Environment, UndefinedBehavior, context};

use super::{Report, figure};

/// The page could not be made: a fault of the template, not of the data.
#[derive(Debug, thiserror::Error)]
#[error("report page: {message}")]
pub struct PageError {
    pub message: String,
}

/// Everything that is in the report.
pub fn page(report: &Report<'_>) -> Result<String, PageError> {
    let mut environment = Environment::new();
    environment.set_undefined_behavior(UndefinedBehavior::Strict);
    let failed = |e: minijinja::Error| PageError { message: format!("{e:#}") };
    environment.add_template("page.html", include_str!("templates/page.html")).map_err(failed)?;
    let template = environment.get_template("page.html").map_err(failed)?;
    template
        .render(context! {
            report => Serde(report),
            figure_style => figure::style_sheet(),
            version => env!("CARGO_PKG_VERSION"),
        })
        .map_err(failed)
}
