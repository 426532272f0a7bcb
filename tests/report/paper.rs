//! Figures for paper: PDF and PNG say what the SVG says, in the size that was asked for.

use std::io::Read;

use kfdesign::report::figure::{self, sheet};
use kfdesign::report::print::{Width, print};

use super::{allan_data, gallery};
use crate::support::{Bench, data};

fn all() -> String {
    let figures: Vec<String> = gallery().into_iter().map(|(_, svg)| svg).collect();
    sheet("all figures", &figures)
}

fn width(text: &str) -> Option<Width> {
    Some(text.parse().unwrap())
}

/// Width, height, pixels per metre, colours.
fn decoded(png: &[u8]) -> (u32, u32, Option<u32>, Vec<[u8; 3]>) {
    let mut reader = png::Decoder::new(std::io::Cursor::new(png)).read_info().unwrap();
    let mut bytes = vec![0; reader.output_buffer_size().unwrap()];
    reader.next_frame(&mut bytes).unwrap();
    let info = reader.info();
    let pixels = bytes.chunks(3).map(|c| [c[0], c[1], c[2]]).collect();
    (info.width, info.height, info.pixel_dims.map(|d| d.xppu), pixels)
}

/// Numbers of the page box, and the operators of the page.
fn opened(pdf: &[u8]) -> (Vec<f64>, String) {
    let text = String::from_utf8_lossy(pdf);
    assert!(text.starts_with("%PDF-1.7") && text.trim_end().ends_with("%%EOF"));
    let page = text.split("/MediaBox [").nth(1).unwrap().split(']').next().unwrap();
    let page = page.split_whitespace().map(|v| v.parse().unwrap()).collect();
    let start = pdf.windows(7).position(|w| w == b"stream\n").unwrap() + 7;
    let mut operators = String::new();
    flate2::read::ZlibDecoder::new(&pdf[start..]).read_to_string(&mut operators).unwrap();
    (page, operators)
}

/// Every element of the SVG is painted once, each page is as large as it was asked to be.
#[test]
fn a_pdf_has_every_element_of_the_svg() {
    let svg = all();
    let (page, operators) = opened(&print(&svg, "pdf", width("85mm"), false).unwrap());
    assert!((page[2] - 85.0 / 25.4 * 72.0).abs() < 1e-3, "{page:?}");
    let size = |key: &str| svg.split(&format!(" {key}=\"")).nth(1).unwrap().split('"').next().unwrap().parse::<f64>();
    let shape = size("height").unwrap() / size("width").unwrap();
    assert!((page[3] / page[2] - shape).abs() < 1e-5, "{page:?}");
    let elements = |name: &str| svg.matches(&format!("<{name} class=\"kf")).count();
    let lines = ["line", "polyline"].map(elements).iter().sum::<usize>();
    let rings = svg.matches(&format!("<circle class=\"kf{}", 6)).count();
    let filled = ["rect", "circle", "polygon", "text"].map(elements).iter().sum::<usize>() - rings;
    let count = |operator: &str| operators.lines().filter(|line| *line == operator).count();
    assert_eq!((count("S"), count("f")), (lines + rings, filled));
    // 440 px of a 96th of an inch where nobody asks
    let (page, _) = opened(&print(&svg, "pdf", None, false).unwrap());
    assert!((page[2] - 330.0).abs() < 1e-3, "{page:?}");
}

#[test]
fn a_png_is_as_wide_as_asked_and_shows_the_figure() {
    let svg = sheet("one", &[figure::allan(&allan_data("gyro_x", 1))]);
    for (asked, pixels, per_metre) in [
        (None, 1320, None),
        (width("900px"), 900, None),
        // at 300 dots per inch
        (width("85mm"), 1004, Some(11811)),
        (width("3.3in"), 990, Some(11811)),
    ] {
        let (columns, rows, dims, colours) = decoded(&print(&svg, "png", asked, false).unwrap());
        assert_eq!((columns, dims), (pixels, per_metre));
        assert!((f64::from(rows) / f64::from(columns) - 388.0 / 440.0).abs() < 0.2, "{rows} by {columns}");
        assert_eq!(colours[0], [255; 3]);
        // the title's ink, the measured dots, the fitted line: each colour of the light theme is there
        for ink in [[0x1b, 0x1f, 0x24], [0x1d, 0x5f, 0xa6], [0xc0, 0x49, 0x1a]] {
            assert!(colours.iter().filter(|c| **c == ink).count() > 40, "{ink:?}");
        }
        let dark = colours.iter().filter(|c| c.iter().all(|v| *v < 128)).count();
        assert!(dark < colours.len() / 20, "{dark} of {}", colours.len());
    }
}

#[test]
fn an_svg_for_paper_is_light_and_as_wide_as_asked() {
    let svg = all();
    let plain = print(&svg, "svg", None, false).unwrap();
    assert_eq!(String::from_utf8(plain).unwrap(), svg);
    let paper = String::from_utf8(print(&svg, "svg", width("85mm"), true).unwrap()).unwrap();
    assert!(!paper.contains("prefers-color-scheme") && paper.contains("#1d5fa6"));
    let first = paper.lines().next().unwrap();
    let size = |key: &str| -> f64 {
        let value = first.split(&format!(" {key}=\"")).nth(1).unwrap().split('"').next().unwrap();
        value.strip_suffix("mm").unwrap().parse().unwrap()
    };
    let view = first.split("viewBox=\"0 0 440 ").nth(1).unwrap().split('"').next().unwrap();
    assert_eq!(size("width"), 85.0);
    assert!((size("height") / 85.0 - view.parse::<f64>().unwrap() / 440.0).abs() < 1e-4, "{first}");
    assert_eq!(paper.split_once("<title>").unwrap().1.len(), {
        let light = figure::style_sheet().len() - figure::light_style_sheet().len();
        svg.split_once("<title>").unwrap().1.len() - light
    });
}

#[test]
fn a_width_has_a_unit_and_bounds() {
    for wrong in ["85", "mm", "85 parsec", "-3mm", "0px", "NaNmm", "1e9px", "infin", "5000px"] {
        assert!(wrong.parse::<Width>().unwrap_err().starts_with("expected "), "{wrong}");
    }
    assert_eq!("8.5cm".parse::<Width>().unwrap().to_string(), "8.5cm");
}

/// By the command: the ending decides, and `--width` without `--plot` is refused.
#[test]
fn the_ending_decides_what_is_written() {
    let bench = Bench::new();
    bench.run_args(&["airplane", data("airplanes/aerosonde.json").to_str().unwrap(), "--plot", "a.pdf"]);
    bench.run_args(&[
        "airplane",
        data("airplanes/aerosonde.json").to_str().unwrap(),
        "--plot",
        "a.PNG",
        "--width",
        "200px",
    ]);
    bench.run_args(&["airplane", data("airplanes/aerosonde.json").to_str().unwrap(), "--plot", "a.svg", "--light"]);
    let read = |name: &str| std::fs::read(bench.path(name)).unwrap();
    opened(&read("a.pdf"));
    assert_eq!(decoded(&read("a.PNG")).0, 200);
    assert!(!bench.read("a.svg").contains("prefers-color-scheme"));
    let out = bench.run("airplane none.json --width 85mm");
    assert_eq!((out.status, out.stderr.lines().count()), (2, 1));
    assert!(out.stderr.contains("--plot"), "{}", out.stderr);
    let out = bench.run("airplane none.json --plot a.png --width 85");
    assert!(out.stderr.contains("--width") && out.stderr.contains("85mm"), "{}", out.stderr);
}
