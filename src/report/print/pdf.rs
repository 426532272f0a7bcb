//! A drawing as one page of PDF, paths only.

use std::io::Write;

use flate2::Compression;
use flate2::write::ZlibEncoder;
use pdf_writer::types::LineJoinStyle;
use pdf_writer::{Content, Filter, Finish, Name, Pdf, Rect, Ref, TextStr};
use tiny_skia::PathSegment;

use super::shapes::{Drawing, Ink, Line};

/// `width`: points.
pub(super) fn write(drawing: &Drawing, width: f32) -> Vec<u8> {
    let scale = width / drawing.width;
    let height = scale * drawing.height;
    let [catalog, pages, page, contents, info] = [1, 2, 3, 4, 5].map(Ref::new);
    let (content, opacities) = content(drawing, scale, height);
    let mut pdf = Pdf::new();
    pdf.catalog(catalog).pages(pages);
    pdf.pages(pages).kids([page]).count(1);
    pdf.document_info(info).title(TextStr(&drawing.title)).creator(TextStr("kfdesign"));
    let mut sheet = pdf.page(page);
    sheet.media_box(Rect::new(0.0, 0.0, width, height)).parent(pages).contents(contents);
    let mut resources = sheet.resources();
    let mut states = resources.ext_g_states();
    for (i, opacity) in opacities.iter().enumerate() {
        let mut state = states.insert(Name(name(i).as_bytes())).start::<pdf_writer::writers::ExtGraphicsState<'_>>();
        state.stroking_alpha(*opacity).non_stroking_alpha(*opacity);
    }
    states.finish();
    resources.finish();
    sheet.finish();
    match packed(&content) {
        Some(packed) => pdf.stream(contents, &packed).filter(Filter::FlateDecode).finish(),
        None => pdf.stream(contents, &content).finish(),
    }
    pdf.finish()
}

fn packed(content: &[u8]) -> Option<Vec<u8>> {
    let mut encoder = ZlibEncoder::new(Vec::new(), Compression::default());
    encoder.write_all(content).ok()?;
    encoder.finish().ok()
}

/// Of the graphics state with the i-th opacity.
fn name(i: usize) -> String {
    format!("o{i}")
}

/// The page's operators, and the opacities that they name.
fn content(drawing: &Drawing, scale: f32, height: f32) -> (Vec<u8>, Vec<f32>) {
    let mut content = Content::new();
    let mut opacities: Vec<f32> = vec![];
    // y points up on a page
    content.transform([scale, 0.0, 0.0, -scale, 0.0, height]);
    content.set_miter_limit(4.0);
    let mut last = None;
    for shape in &drawing.shapes {
        let kind = (shape.ink, shape.line.is_some());
        if last != Some(kind) {
            ink(&mut content, &mut opacities, shape.ink, shape.line.is_some());
            last = Some(kind);
        }
        if let Some(line) = &shape.line {
            stroke(&mut content, line);
        }
        trace(&mut content, shape.path.segments());
        if shape.line.is_some() {
            content.stroke()
        } else {
            content.fill_nonzero()
        };
    }
    (content.finish().into_vec(), opacities)
}

fn ink(content: &mut Content, opacities: &mut Vec<f32>, ink: Ink, stroked: bool) {
    let [r, g, b] = ink.colour.map(|channel| f32::from(channel) / 255.0);
    if stroked {
        content.set_stroke_rgb(r, g, b)
    } else {
        content.set_fill_rgb(r, g, b)
    };
    let known = opacities.iter().position(|o| *o == ink.opacity);
    let place = known.unwrap_or_else(|| {
        opacities.push(ink.opacity);
        opacities.len() - 1
    });
    content.set_parameters(Name(name(place).as_bytes()));
}

fn stroke(content: &mut Content, line: &Line) {
    let join = if line.round { LineJoinStyle::RoundJoin } else { LineJoinStyle::MiterJoin };
    content.set_line_width(line.width).set_line_join(join).set_dash_pattern(line.dashes.iter().copied(), 0.0);
}

fn trace(content: &mut Content, segments: impl Iterator<Item = PathSegment>) {
    let (mut x, mut y) = (0.0, 0.0);
    for segment in segments {
        match segment {
            PathSegment::MoveTo(to) => {
                content.move_to(to.x, to.y);
                (x, y) = (to.x, to.y);
            }
            PathSegment::LineTo(to) => {
                content.line_to(to.x, to.y);
                (x, y) = (to.x, to.y);
            }
            // PDF knows cubic curves only
            PathSegment::QuadTo(by, to) => {
                let third = |from: f32, by: f32| from + 2.0 / 3.0 * (by - from);
                content.cubic_to(third(x, by.x), third(y, by.y), third(to.x, by.x), third(to.y, by.y), to.x, to.y);
                (x, y) = (to.x, to.y);
            }
            PathSegment::CubicTo(a, b, to) => {
                content.cubic_to(a.x, a.y, b.x, b.y, to.x, to.y);
                (x, y) = (to.x, to.y);
            }
            PathSegment::Close => {
                content.close_path();
            }
        }
    }
}
