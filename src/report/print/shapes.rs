//! The SVG of our own figures as paths with a fill or a stroke: one element a line, its look in the style sheet.

use std::collections::BTreeMap;

use tiny_skia::{Path, PathBuilder, Rect, Transform};
use ttf_parser::{Face, OutlineBuilder};

use super::PrintError;
use crate::report::figure;

/// A sheet of figures; lengths in px.
pub(super) struct Drawing {
    pub(super) title: String,
    pub(super) width: f32,
    pub(super) height: f32,
    pub(super) shapes: Vec<Shape>,
}

pub(super) struct Shape {
    pub(super) path: Path,
    pub(super) ink: Ink,
    /// Filled where there is none.
    pub(super) line: Option<Line>,
}

#[derive(Clone, Copy, PartialEq)]
pub(super) struct Ink {
    pub(super) colour: [u8; 3],
    pub(super) opacity: f32,
}

#[derive(Clone)]
pub(super) struct Line {
    pub(super) width: f32,
    pub(super) dashes: Vec<f32>,
    pub(super) round: bool,
}

type Look<'s> = BTreeMap<&'s str, &'s str>;

/// Declarations of each class, the later over the earlier.
fn looks(style: &str) -> BTreeMap<&str, Look<'_>> {
    let mut looks: BTreeMap<&str, Look<'_>> = BTreeMap::new();
    for (selector, body) in style.split('}').filter_map(|rule| rule.split_once('{')) {
        let Some(class) = selector.strip_prefix('.') else { continue };
        let look = looks.entry(class).or_default();
        look.extend(body.split(';').filter_map(|declaration| declaration.split_once(':')));
    }
    looks
}

/// Figure units to px.
const SCALE: f32 = 1.0 / figure::UNITS as f32;

pub(super) fn read(sheet: &str) -> Result<Drawing, PrintError> {
    let style = figure::light_style_sheet();
    let looks = looks(&style);
    let plain = Face::parse(include_bytes!("fonts/Roboto-Regular.ttf"), 0)?;
    let bold = Face::parse(include_bytes!("fonts/Roboto-Bold.ttf"), 0)?;
    let mut lines = sheet.lines();
    let (mut title, mut size) = (String::new(), None);
    let mut shapes = vec![];
    // of the figure on the sheet, px
    let mut top = 0.0;
    while let Some(line) = lines.next() {
        let Some((name, attributes)) = element(line) else { continue };
        let number = |key: &str| attributes.get(key).and_then(|v| v.parse().ok()).unwrap_or(0.0_f32);
        if name == "title" && title.is_empty() {
            title = unescape(line.trim_start_matches("<title>").trim_end_matches("</title>"));
        }
        if name == "svg" {
            size.get_or_insert((number("width"), number("height")));
            top = number("y");
        }
        let Some(look) = attributes.get("class").and_then(|class| looks.get(class)) else { continue };
        let mut path = PathBuilder::new();
        match name {
            "rect" => {
                let [width, height] = ["width", "height"].map(number);
                if let Some(rect) = Rect::from_xywh(number("x"), number("y"), width, height) {
                    path.push_rect(rect);
                }
            }
            "circle" => path.push_circle(number("cx"), number("cy"), number("r")),
            "line" => {
                path.move_to(number("x1"), number("y1"));
                path.line_to(number("x2"), number("y2"));
            }
            "polyline" | "polygon" => {
                trace(&mut path, attributes.get("points").copied().unwrap_or_default());
                if name == "polygon" {
                    path.close();
                }
            }
            "text" => {
                let words = unescape(lines.next().unwrap_or_default());
                let face = if look.contains_key("font-weight") { &bold } else { &plain };
                let em = length(look, "font-size");
                let shift = attributes.get("dy").map_or(0.0, |dy| em * ems(dy, face));
                let anchor = attributes.get("text-anchor").copied().unwrap_or("start");
                write(&mut path, &words, face, em, (number("x"), number("y") + shift), anchor);
            }
            _ => {}
        }
        let place = Transform::from_row(SCALE, 0.0, 0.0, SCALE, 0.0, top);
        if let Some(path) = path.finish().and_then(|path| path.transform(place)) {
            shapes.extend(painted(&path, look));
        }
    }
    let (width, height) = size.unwrap_or_default();
    Ok(Drawing { title, width, height, shapes })
}

/// Name and attributes of an opening or empty element.
fn element(line: &str) -> Option<(&str, BTreeMap<&str, &str>)> {
    let inner = line.trim_start().strip_prefix('<')?.split('>').next()?.trim_end_matches('/');
    let (name, mut rest) = inner.split_once(' ').unwrap_or((inner, ""));
    let mut attributes = BTreeMap::new();
    while let Some((key, after)) = rest.split_once("=\"") {
        let (value, after) = after.split_once('"')?;
        attributes.insert(key.trim(), value);
        rest = after;
    }
    Some((name, attributes))
}

/// "1,2 3,4" as a line.
fn trace(path: &mut PathBuilder, points: &str) {
    let numbers = points.split_whitespace().filter_map(|pair| pair.split_once(','));
    let points = numbers.filter_map(|(x, y)| Some((x.parse().ok()?, y.parse().ok()?)));
    for (i, (x, y)) in points.enumerate() {
        if i == 0 { path.move_to(x, y) } else { path.line_to(x, y) }
    }
}

/// The path filled and stroked, as its class says.
fn painted(path: &Path, look: &Look<'_>) -> Vec<Shape> {
    let ink = |what: &str, opacity: &str| {
        let hex = look.get(what)?.strip_prefix('#')?;
        let channel = |i: usize| u8::from_str_radix(hex.get(i..i + 2)?, 16).ok();
        let opacity = look.get(opacity).and_then(|v| v.parse().ok()).unwrap_or(1.0);
        Some(Ink { colour: [channel(0)?, channel(2)?, channel(4)?], opacity })
    };
    let dashes = look.get("stroke-dasharray").copied().unwrap_or_default();
    let line = Line {
        width: SCALE * length(look, "stroke-width"),
        dashes: dashes.split(' ').filter_map(|v| Some(SCALE * v.parse::<f32>().ok()?)).collect(),
        round: look.contains_key("stroke-linejoin"),
    };
    let fill = ink("fill", "fill-opacity").map(|ink| Shape { path: path.clone(), ink, line: None });
    let stroke = ink("stroke", "stroke-opacity").map(|ink| Shape { path: path.clone(), ink, line: Some(line) });
    fill.into_iter().chain(stroke).collect()
}

fn length(look: &Look<'_>, what: &str) -> f32 {
    look.get(what).and_then(|v| v.trim_end_matches("px").parse().ok()).unwrap_or(1.0)
}

/// "0.36em", "-0.5ex" in ems.
fn ems(length: &str, face: &Face<'_>) -> f32 {
    let x_height = face.x_height().map_or(0.5, |h| f32::from(h) / f32::from(face.units_per_em()));
    let (number, of) = match length.strip_suffix("ex") {
        Some(number) => (number, x_height),
        None => (length.trim_end_matches("em"), 1.0),
    };
    of * number.parse().unwrap_or(0.0)
}

/// Outlines of `words` at `at`, the end of their base line that `anchor` names.
fn write(path: &mut PathBuilder, words: &str, face: &Face<'_>, em: f32, at: (f32, f32), anchor: &str) {
    let scale = em / f32::from(face.units_per_em());
    let glyphs: Vec<_> = words.chars().map(|c| face.glyph_index(c).unwrap_or_default()).collect();
    let advance = |glyph| scale * f32::from(face.glyph_hor_advance(glyph).unwrap_or_default());
    let width: f32 = glyphs.iter().copied().map(advance).sum();
    let start = match anchor {
        "middle" => -0.5 * width,
        "end" => -width,
        _ => 0.0,
    };
    let mut outline = Outline { path, scale, x: at.0 + start, y: at.1 };
    for glyph in glyphs {
        face.outline_glyph(glyph, &mut outline);
        outline.x += advance(glyph);
    }
}

/// Outlines of letters, whose y axis points up.
struct Outline<'p> {
    path: &'p mut PathBuilder,
    scale: f32,
    x: f32,
    y: f32,
}

impl Outline<'_> {
    fn place(&self, x: f32, y: f32) -> (f32, f32) {
        (self.x + self.scale * x, self.y - self.scale * y)
    }
}

impl OutlineBuilder for Outline<'_> {
    fn move_to(&mut self, x: f32, y: f32) {
        let (x, y) = self.place(x, y);
        self.path.move_to(x, y);
    }

    fn line_to(&mut self, x: f32, y: f32) {
        let (x, y) = self.place(x, y);
        self.path.line_to(x, y);
    }

    fn quad_to(&mut self, x1: f32, y1: f32, x: f32, y: f32) {
        let ((x1, y1), (x, y)) = (self.place(x1, y1), self.place(x, y));
        self.path.quad_to(x1, y1, x, y);
    }

    fn curve_to(&mut self, x1: f32, y1: f32, x2: f32, y2: f32, x: f32, y: f32) {
        let ((x1, y1), (x2, y2), (x, y)) = (self.place(x1, y1), self.place(x2, y2), self.place(x, y));
        self.path.cubic_to(x1, y1, x2, y2, x, y);
    }

    fn close(&mut self) {
        self.path.close();
    }
}

/// What [`figure`] escaped.
fn unescape(text: &str) -> String {
    let named = [("&lt;", "<"), ("&gt;", ">"), ("&quot;", "\""), ("&#39;", "'"), ("&apos;", "'"), ("&amp;", "&")];
    named.into_iter().fold(text.to_owned(), |text, (escape, letter)| text.replace(escape, letter))
}
