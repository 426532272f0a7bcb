//! A drawing as PNG.

use tiny_skia::{Color, FillRule, LineJoin, Paint, Pixmap, Shader, Stroke, StrokeDash, Transform};

use super::PrintError;
use super::shapes::Drawing;

/// `width`: pixels. `dots_per_inch`: where the picture has a length on paper.
pub(super) fn write(drawing: &Drawing, width: f64, dots_per_inch: Option<f64>) -> Result<Vec<u8>, PrintError> {
    let scale = (width / f64::from(drawing.width)) as f32;
    let [columns, rows] = [width, f64::from(scale * drawing.height)].map(|v| v.round().max(1.0) as u32);
    let mut pixels = Pixmap::new(columns, rows).ok_or(PrintError::Size(columns, rows))?;
    pixels.fill(Color::WHITE);
    let place = Transform::from_scale(scale, scale);
    for shape in &drawing.shapes {
        let [r, g, b] = shape.ink.colour;
        let alpha = (255.0 * shape.ink.opacity).round() as u8;
        let paint = Paint {
            shader: Shader::SolidColor(Color::from_rgba8(r, g, b, alpha)),
            anti_alias: true,
            ..Paint::default()
        };
        match &shape.line {
            None => pixels.fill_path(&shape.path, &paint, FillRule::Winding, place, None),
            Some(line) => {
                let stroke = Stroke {
                    width: line.width,
                    line_join: if line.round { LineJoin::Round } else { LineJoin::Miter },
                    dash: StrokeDash::new(line.dashes.clone(), 0.0),
                    ..Stroke::default()
                };
                pixels.stroke_path(&shape.path, &paint, &stroke, place, None);
            }
        }
    }
    let mut out = Vec::new();
    let mut encoder = png::Encoder::new(&mut out, columns, rows);
    encoder.set_color(png::ColorType::Rgb);
    encoder.set_depth(png::BitDepth::Eight);
    if let Some(density) = dots_per_inch {
        let per_metre = (density / 0.0254).round() as u32;
        encoder.set_pixel_dims(Some(png::PixelDimensions { xppu: per_metre, yppu: per_metre, unit: png::Unit::Meter }));
    }
    // white paper: no pixel is transparent
    let colours: Vec<u8> = pixels.pixels().iter().flat_map(|p| [p.red(), p.green(), p.blue()]).collect();
    let mut writer = encoder.write_header()?;
    writer.write_image_data(&colours)?;
    writer.finish()?;
    Ok(out)
}
