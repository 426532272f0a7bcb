//! Figures for paper: what [`super::figure`] draws, as SVG, PDF or PNG of a stated width.
//!
//! PDF and PNG are always dark on white, and their text is drawn as outlines of an embedded font, so that a figure
//! looks the same on every machine.

mod pdf;
mod png;
mod shapes;

use std::fmt;
use std::str::FromStr;

use super::figure;

/// What a picture can be written as, by the ending of its file.
pub const ENDINGS: [&str; 3] = ["svg", "pdf", "png"];
/// Dots per inch of a PNG whose width is a length: what journals ask of line art in colour.
const DOTS_PER_INCH: f64 = 300.0;
/// Pixels of a PNG for each of a figure whose width nobody states: sharp on a screen of high density.
const PIXELS: f64 = 3.0;
/// Pixels of the widest and the narrowest picture. Six figures one below the other are five times as high as wide: at
/// 4000 px a PNG of them takes 320 MB while it is drawn.
const WIDEST: f64 = 4000.0;
const NARROWEST: f64 = 50.0;

/// A picture could not be made.
#[derive(Debug, thiserror::Error)]
pub enum PrintError {
    #[error("the embedded font cannot be read: {0}")]
    Font(#[from] ttf_parser::FaceParsingError),
    #[error("a picture of {0} by {1} pixels does not fit into memory; ask for a smaller width")]
    Size(u32, u32),
    #[error("{0}")]
    Png(#[from] ::png::EncodingError),
}

/// Width of a picture: "85mm", "3.35in", "1600px".
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Width {
    value: f64,
    unit: LengthUnit,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum LengthUnit {
    Pixel,
    Millimetre,
    Centimetre,
    Inch,
}

impl LengthUnit {
    const ALL: [LengthUnit; 4] = [LengthUnit::Millimetre, LengthUnit::Centimetre, LengthUnit::Inch, LengthUnit::Pixel];

    fn name(self) -> &'static str {
        match self {
            LengthUnit::Pixel => "px",
            LengthUnit::Millimetre => "mm",
            LengthUnit::Centimetre => "cm",
            LengthUnit::Inch => "in",
        }
    }

    /// Of one inch; a pixel is that of a style sheet.
    fn per_inch(self) -> f64 {
        match self {
            LengthUnit::Pixel => 96.0,
            LengthUnit::Millimetre => 25.4,
            LengthUnit::Centimetre => 2.54,
            LengthUnit::Inch => 1.0,
        }
    }
}

impl Width {
    fn inches(self) -> f64 {
        self.value / self.unit.per_inch()
    }

    /// Of a PNG.
    fn pixels(self) -> f64 {
        if self.unit == LengthUnit::Pixel { self.value } else { DOTS_PER_INCH * self.inches() }
    }
}

impl FromStr for Width {
    type Err = String;

    fn from_str(text: &str) -> Result<Width, String> {
        let expected = || "expected a number with mm, cm, in or px, such as 85mm or 1600px".to_owned();
        let unit = LengthUnit::ALL.into_iter().find(|unit| text.ends_with(unit.name())).ok_or_else(expected)?;
        let number = text.strip_suffix(unit.name()).unwrap_or(text).trim();
        let width = Width { value: number.parse().map_err(|_| expected())?, unit };
        let limit = |pixels: f64| match unit {
            LengthUnit::Pixel => format!("{pixels} px"),
            unit => format!("{:.1} {}", pixels / DOTS_PER_INCH * unit.per_inch(), unit.name()),
        };
        if (NARROWEST..=WIDEST).contains(&width.pixels()) {
            Ok(width)
        } else {
            Err(format!("expected a width from {} to {}", limit(NARROWEST), limit(WIDEST)))
        }
    }
}

impl fmt::Display for Width {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}{}", self.value, self.unit.name())
    }
}

/// A sheet of figures (see [`figure::sheet`]) in the format of `ending`; SVG for any that is not known. `width`: of
/// the whole, text included. `light`: dark on white whatever the reader's setting, as PDF and PNG always are.
pub fn print(sheet: &str, ending: &str, width: Option<Width>, light: bool) -> Result<Vec<u8>, PrintError> {
    match ending {
        "pdf" => {
            let drawing = shapes::read(sheet)?;
            let points = width.map(|width| 72.0 * width.inches());
            Ok(pdf::write(&drawing, points.unwrap_or(0.75 * f64::from(drawing.width)) as f32))
        }
        "png" => {
            let drawing = shapes::read(sheet)?;
            let pixels = width.map_or(PIXELS * f64::from(drawing.width), Width::pixels);
            let printed = width.is_some_and(|width| width.unit != LengthUnit::Pixel);
            png::write(&drawing, pixels, printed.then_some(DOTS_PER_INCH))
        }
        _ => Ok(svg(sheet, width, light).into_bytes()),
    }
}

fn svg(sheet: &str, width: Option<Width>, light: bool) -> String {
    let sheet = if light { sheet.replace(&figure::style_sheet(), &figure::light_style_sheet()) } else { sheet.into() };
    width.and_then(|width| sized(&sheet, width)).unwrap_or(sheet)
}

/// The size in the first element, which has it before its view box.
fn sized(sheet: &str, width: Width) -> Option<String> {
    let (start, rest) = sheet.split_once(" width=\"")?;
    let (_, view) = rest.split_once(" viewBox=\"0 0 ")?;
    let (columns, rows) = view.split_once('"')?.0.split_once(' ')?;
    let height = width.value * rows.parse::<f64>().ok()? / columns.parse::<f64>().ok()?;
    let unit = width.unit.name();
    Some(format!("{start} width=\"{width}\" height=\"{height:.3}{unit}\" viewBox=\"0 0 {view}"))
}
