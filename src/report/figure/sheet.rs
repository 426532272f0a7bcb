//! Several figures above one another in one SVG.

use super::style::{UNITS, WIDTH, escape, style_sheet};

/// Figures made by this module, stacked: what `--plot` writes for a log with several axes.
pub fn sheet(title: &str, figures: &[String]) -> String {
    let style = format!("<style>{}</style>\n", style_sheet());
    let mut inner = String::new();
    let mut y = 0;
    for figure in figures {
        let height = height(figure);
        // nested <svg> elements keep their own title and description for a screen reader
        let placed = figure.replacen(&style, "", 1).replacen("<svg ", &format!("<svg y=\"{y}\" "), 1);
        inner.push_str(&placed);
        y += height;
    }
    format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" class=\"kf\" width=\"{WIDTH}\" height=\"{y}\" viewBox=\"0 0 {WIDTH} \
         {y}\">\n\
         <title>{}</title>\n{style}{inner}</svg>\n",
        escape(title)
    )
}

/// The height that [`super::style::document`] wrote, px.
fn height(figure: &str) -> i32 {
    figure
        .split_once(" height=\"")
        .and_then(|(_, rest)| rest.split_once('"'))
        .and_then(|(number, _)| number.parse().ok())
        .unwrap_or(WIDTH / UNITS)
}
