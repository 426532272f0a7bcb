//! The look: colours, line styles and type, light and dark, and the pass that turns plotters' output into styled SVG.
//!
//! plotters writes a colour into every element. A figure that follows the reader's light or dark setting needs
//! classes instead, so each [`Class`] is drawn in a colour that is only a number, and [`document`] replaces that
//! colour, with the presentation attributes beside it, by the class.

use plotters::style::RGBColor;

/// plotters rounds to whole units; ten of ours make one pixel of the finished figure.
pub(in crate::report) const UNITS: i32 = 10;
/// Width of every figure, px: readable at phone width, two side by side on a desk.
pub(super) const WIDTH: i32 = 440;

/// What an element is; the style sheet says how it looks.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Class {
    Title,
    /// Tick and axis labels.
    Label,
    Note,
    Grid,
    FineGrid,
    Axis,
    /// A limit that values should respect.
    Bound,
    /// The value that theory expects.
    Expected,
    /// What is known to be true.
    Truth,
    Bar,
    /// A word beside a point.
    Tag,
    /// Dense data behind a line.
    Cloud,
    Line(usize),
    /// A hair line, for dense data.
    Thread(usize),
    Marker(usize),
    Band(usize),
    /// A thin companion of line `k` in its colour (its steady state, its slope).
    Thin(usize),
}

const PLAIN: [Class; 12] = [
    Class::Title,
    Class::Label,
    Class::Note,
    Class::Grid,
    Class::FineGrid,
    Class::Axis,
    Class::Bound,
    Class::Expected,
    Class::Truth,
    Class::Bar,
    Class::Tag,
    Class::Cloud,
];

/// Distinct series; further ones start again.
const SERIES: usize = 6;
/// Blue, vermilion, green, purple, ochre, grey: distinct for the common colour-vision types, with distinct dashes
/// beside.
const LIGHT: [&str; SERIES] = ["#1d5fa6", "#c0491a", "#1a7a56", "#82489a", "#8a6900", "#5b636b"];
const DARK: [&str; SERIES] = ["#7fb4f0", "#f2996a", "#5fc9a1", "#cba2e0", "#dcb94c", "#a3acb5"];
const DASHES: [&str; SERIES] = ["none", "60 32", "18 22", "90 28 18 28", "130 40", "50 22 18 22 18 22"];

impl Class {
    fn code(self) -> u8 {
        let series = |first: usize, k: usize| (first + k % SERIES) as u8;
        match self {
            Class::Line(k) => series(20, k),
            Class::Thread(k) => series(60, k),
            Class::Marker(k) => series(30, k),
            Class::Band(k) => series(40, k),
            Class::Thin(k) => series(50, k),
            plain => 1 + PLAIN.iter().position(|&p| p == plain).unwrap_or(0) as u8,
        }
    }

    /// The number that stands for this class while plotters draws.
    pub(super) fn token(self) -> RGBColor {
        RGBColor(0, 0, self.code())
    }
}

/// Colours of everything but the series.
struct Theme {
    ink: &'static str,
    muted: &'static str,
    faint: &'static str,
    paper: &'static str,
    bound: &'static str,
}

const LIGHT_THEME: Theme =
    Theme { ink: "#1b1f24", muted: "#57606a", faint: "#dfe3e8", paper: "#ffffff", bound: "#a83a2c" };
const DARK_THEME: Theme =
    Theme { ink: "#e4e8ec", muted: "#a3acb5", faint: "#343b43", paper: "#14181d", bound: "#f08a7c" };

fn rules(theme: &Theme, series: &[&str; SERIES]) -> String {
    let Theme { ink, muted, faint, paper, bound } = theme;
    let fill = |class: Class, colour: &str| format!(".kf{}{{fill:{colour}}}", class.code());
    let stroke = |class: Class, colour: &str| format!(".kf{}{{stroke:{colour}}}", class.code());
    let mut css = format!(".kf-paper{{fill:{paper}}}");
    css += &fill(Class::Title, ink);
    css += &fill(Class::Label, muted);
    css += &fill(Class::Note, muted);
    css += &fill(Class::Tag, ink);
    css += &stroke(Class::Cloud, series[5]);
    css += &stroke(Class::Grid, faint);
    css += &stroke(Class::FineGrid, faint);
    css += &stroke(Class::Axis, muted);
    css += &stroke(Class::Bound, bound);
    css += &stroke(Class::Expected, ink);
    css += &stroke(Class::Truth, ink);
    css += &fill(Class::Bar, series[0]);
    for (k, colour) in series.iter().enumerate() {
        css += &stroke(Class::Line(k), colour);
        css += &stroke(Class::Thread(k), colour);
        css += &fill(Class::Marker(k), colour);
        css += &fill(Class::Band(k), colour);
        css += &stroke(Class::Thin(k), colour);
    }
    css
}

/// The style sheet that every figure carries.
pub fn style_sheet() -> String {
    let mut css = light_style_sheet();
    css += "@media (prefers-color-scheme:dark){";
    css += &rules(&DARK_THEME, &DARK);
    css += "}";
    // a page printed from a dark screen is black on white
    css += "@media print{";
    css += &rules(&LIGHT_THEME, &LIGHT);
    css + "}"
}

/// The same for white paper, whatever the reader's setting. Lengths are in figure units (`UNITS` to the pixel).
pub fn light_style_sheet() -> String {
    let class = |class: Class| format!(".kf{}", class.code());
    let mut css = String::from(".kf text{font-family:\"Helvetica Neue\",Arial,sans-serif;stroke:none}");
    css += &format!("{}{{font-size:138px;font-weight:600}}", class(Class::Title));
    css += &format!("{}{{font-size:122px}}", class(Class::Label));
    css += &format!("{}{{font-size:112px}}", class(Class::Note));
    css += &format!("{}{{font-size:122px;font-weight:600}}", class(Class::Tag));
    for (what, width, more) in [
        (Class::Grid, 8, ""),
        (Class::FineGrid, 5, ";stroke-opacity:.55"),
        (Class::Axis, 9, ""),
        (Class::Bound, 12, ";stroke-dasharray:70 35"),
        (Class::Expected, 12, ";stroke-dasharray:25 25"),
        (Class::Truth, 9, ""),
        (Class::Cloud, 8, ";stroke-opacity:.4;stroke-linejoin:round"),
    ] {
        css += &format!("{}{{fill:none;stroke-width:{width}{more}}}", class(what));
    }
    css += &format!("{}{{fill-opacity:.45}}", class(Class::Bar));
    for (k, dashes) in DASHES.iter().enumerate() {
        css += &format!(
            "{}{{fill:none;stroke-width:15;stroke-linejoin:round;stroke-dasharray:{dashes}}}",
            class(Class::Line(k))
        );
        css += &format!("{}{{fill:none;stroke-width:10;stroke-dasharray:15 25}}", class(Class::Thin(k)));
        css += &format!("{}{{fill:none;stroke-width:8;stroke-linejoin:round}}", class(Class::Thread(k)));
        css += &format!("{}{{fill-opacity:.17}}", class(Class::Band(k)));
    }
    css + &rules(&LIGHT_THEME, &LIGHT)
}

/// A finished figure: plotters' elements with classes, under a title and a description for a screen reader.
pub(super) fn document(drawn: &str, height: i32, title: &str, description: &str) -> String {
    let (w, h) = (WIDTH * UNITS, height * UNITS);
    let mut svg = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" class=\"kf\" role=\"img\" width=\"{WIDTH}\" height=\"{height}\" \
         viewBox=\"0 0 {w} {h}\">\n\
         <title>{}</title>\n<desc>{}</desc>\n<style>{}</style>\n<rect class=\"kf-paper\" width=\"{w}\" \
         height=\"{h}\"/>\n",
        escape(title),
        escape(description),
        style_sheet()
    );
    // one element a line; the first and the last are plotters' own <svg>
    for line in drawn.lines().filter(|l| !l.starts_with("<svg") && !l.starts_with("</svg")) {
        let inner = line.strip_prefix('<').filter(|l| !l.starts_with('/'));
        match inner {
            Some(inner) => svg.push_str(&restyle(inner)),
            None => svg.push_str(line),
        }
        svg.push('\n');
    }
    svg.push_str("</svg>\n");
    svg
}

/// One element, without its leading `<`: geometry stays, colours become a class, presentation goes.
fn restyle(element: &str) -> String {
    let (name, mut rest) = element.split_once(' ').unwrap_or((element, ""));
    let mut geometry = String::new();
    let mut class = None;
    while let Some((key, after)) = rest.split_once("=\"") {
        let Some((value, after)) = after.split_once('"') else { break };
        match key.trim() {
            "fill" | "stroke" => class = class.or_else(|| u8::from_str_radix(value.strip_prefix("#0000")?, 16).ok()),
            "opacity" | "stroke-width" | "font-family" | "font-size" => {}
            // half the cap height of a digit, in every font
            "dy" if value == "0.5ex" => geometry.push_str(" dy=\"0.36em\""),
            key => geometry.push_str(&format!(" {key}=\"{}\"", value.trim())),
        }
        rest = after;
    }
    let class = class.map(|c| format!(" class=\"kf{c}\"")).unwrap_or_default();
    format!("<{name}{class}{geometry}{}", rest.trim_start())
}

/// Text for XML: the five special characters escaped, control characters (which XML has no way to write) as blanks.
pub(super) fn escape(text: &str) -> String {
    let mut out = String::with_capacity(text.len());
    for c in text.chars() {
        match c {
            '<' => out.push_str("&lt;"),
            '>' => out.push_str("&gt;"),
            '&' => out.push_str("&amp;"),
            '"' => out.push_str("&quot;"),
            '\'' => out.push_str("&#39;"),
            other => out.push(printable(other)),
        }
    }
    out
}

/// A blank for characters that XML does not allow or that would break a line.
pub(super) fn printable(c: char) -> char {
    if c.is_control() || matches!(c, '\u{fffe}' | '\u{ffff}') { ' ' } else { c }
}

/// Width of a text in figure units, from average letter widths of sans-serif type (within 15 % of common fonts, on
/// the wide side).
pub(super) fn text_width(text: &str, size: i32) -> i32 {
    let ems: f64 = text
        .chars()
        .map(|c| match c {
            'i' | 'l' | 'j' | '.' | ',' | ':' | ';' | '\'' | '|' | '!' | '·' => 0.3,
            'f' | 't' | 'r' | '(' | ')' | '[' | ']' | ' ' | '/' | '-' | '⁻' | '¹' | '²' | '³' => 0.38,
            'm' | 'w' | 'M' | 'W' | '%' => 0.9,
            c if c.is_uppercase() => 0.7,
            _ => 0.58,
        })
        .sum();
    (ems * f64::from(size)).round() as i32
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Contrast ratio of WCAG 2.2.
    fn contrast(a: &str, b: &str) -> f64 {
        let luminance = |colour: &str| {
            let channel = |i: usize| {
                let c = f64::from(u8::from_str_radix(&colour[i..i + 2], 16).unwrap()) / 255.0;
                if c <= 0.04045 { c / 12.92 } else { ((c + 0.055) / 1.055).powf(2.4) }
            };
            0.2126 * channel(1) + 0.7152 * channel(3) + 0.0722 * channel(5)
        };
        let (a, b) = (luminance(a), luminance(b));
        (a.max(b) + 0.05) / (a.min(b) + 0.05)
    }

    #[test]
    fn colours_can_be_read_on_both_papers() {
        assert!((contrast("#ffffff", "#000000") - 21.0).abs() < 1e-9);
        for (theme, series) in [(&LIGHT_THEME, &LIGHT), (&DARK_THEME, &DARK)] {
            assert!(contrast(theme.ink, theme.paper) > 7.0 && contrast(theme.muted, theme.paper) > 4.5);
            for colour in series.iter().chain([&theme.bound]) {
                assert!(contrast(colour, theme.paper) > 4.5, "{colour}");
            }
        }
    }

    #[test]
    fn series_differ_without_colour() {
        for (i, a) in DASHES.iter().enumerate() {
            assert!(DASHES.iter().skip(i + 1).all(|b| a != b));
        }
    }

    #[test]
    fn classes_have_codes_of_their_own() {
        let series = |make: fn(usize) -> Class| (0..SERIES).map(make);
        let all = PLAIN
            .into_iter()
            .chain(series(Class::Line))
            .chain(series(Class::Thread))
            .chain(series(Class::Marker))
            .chain(series(Class::Band))
            .chain(series(Class::Thin));
        let mut codes: Vec<u8> = all.map(Class::code).collect();
        let count = codes.len();
        codes.sort_unstable();
        codes.dedup();
        assert_eq!(codes.len(), count);
    }

    #[test]
    fn elements_keep_geometry_and_lose_presentation() {
        let line = "polyline fill=\"none\" opacity=\"1\" stroke=\"#000014\" stroke-width=\"1\" points=\"1,2 3,4 \"/>";
        assert_eq!(restyle(line), "<polyline class=\"kf20\" points=\"1,2 3,4\"/>");
        let text = "text x=\"5\" y=\"6\" dy=\"0.5ex\" text-anchor=\"end\" font-family=\"sans-serif\" font-size=\"98\" \
                    opacity=\"1\" fill=\"#000002\">";
        assert_eq!(restyle(text), "<text class=\"kf2\" x=\"5\" y=\"6\" dy=\"0.36em\" text-anchor=\"end\">");
    }
}
