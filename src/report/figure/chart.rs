//! A chart with two axes: marks are collected, then drawn by plotters on a canvas ten times as fine as the figure.

use plotters::coord::Shift;
use plotters::coord::cartesian::Cartesian2d;
use plotters::prelude::*;
use plotters::style::text_anchor::{HPos, Pos, VPos};

use super::scale::Scale;
use super::style::{self, Class, UNITS, WIDTH, text_width};

type Area<'a> = DrawingArea<SVGBackend<'a>, Shift>;
type Plot<'a, 'b> = ChartContext<'b, SVGBackend<'a>, Cartesian2d<Scale, Scale>>;
type Drawn<T> = Result<T, DrawingAreaErrorKind<std::io::Error>>;

const TITLE_SIZE: i32 = 138;
const LABEL_SIZE: i32 = 122;
const NOTE_SIZE: i32 = 112;
const EDGE: i32 = 80;
const TITLE_ROW: i32 = 230;
const LEGEND_ROW: i32 = 190;
/// Length of the line sample in the legend.
const SAMPLE: i32 = 260;
/// Marks per line beyond which a line keeps only the extremes of each stretch.
const COLUMNS: usize = 700;

/// One thing in the plot.
#[derive(Clone, Debug)]
enum Mark {
    Line {
        class: Class,
        points: Vec<(f64, f64)>,
    },
    Band {
        series: usize,
        edges: Vec<(f64, f64, f64)>,
    },
    Dots {
        series: usize,
        points: Vec<(f64, f64)>,
    },
    Stems {
        series: usize,
        points: Vec<(f64, f64)>,
    },
    Bars {
        bars: Vec<(f64, f64, f64)>,
    },
    Level {
        class: Class,
        y: f64,
    },
    Upright {
        class: Class,
        x: f64,
    },
    /// A word beside a point, which may have a ring.
    Tag {
        ring: Option<usize>,
        at: (f64, f64),
        word: String,
    },
}

#[derive(Clone, Copy, Debug)]
enum Sample {
    Line(Class),
    Band(usize),
    Dots(usize),
    Bar,
}

/// A named axis.
#[derive(Clone, Debug)]
pub(super) struct Axis {
    pub(super) name: String,
    pub(super) unit: String,
    pub(super) scale: Scale,
}

#[derive(Clone, Debug)]
pub(super) struct Chart {
    title: String,
    description: String,
    x: Axis,
    y: Axis,
    /// Height of the plotting area, px.
    plot_height: i32,
    marks: Vec<Mark>,
    legend: Vec<(Sample, String)>,
    /// Labelled stretches along the top edge.
    stretches: Vec<(f64, f64, String)>,
}

impl Chart {
    pub(super) fn new(title: &str, description: &str, x: Axis, y: Axis) -> Chart {
        let clean = |text: &str| text.chars().map(style::printable).collect::<String>();
        let axis = |a: Axis| Axis { name: clean(&a.name), unit: clean(&a.unit), scale: a.scale };
        Chart {
            title: clean(title),
            description: clean(description),
            x: axis(x),
            y: axis(y),
            plot_height: 210,
            marks: vec![],
            legend: vec![],
            stretches: vec![],
        }
    }

    pub(super) fn plot_height(&mut self, px: i32) {
        self.plot_height = px;
    }

    pub(super) fn line(&mut self, class: Class, points: Vec<(f64, f64)>) {
        self.marks.push(Mark::Line { class, points: thin(points, &self.x.scale) });
    }

    pub(super) fn x_ends(&self) -> (f64, f64) {
        self.x.scale.ends()
    }

    /// (x, lower, upper).
    pub(super) fn band(&mut self, series: usize, edges: Vec<(f64, f64, f64)>) {
        self.marks.push(Mark::Band { series, edges: thin_band(edges, &self.x.scale) });
    }

    pub(super) fn dots(&mut self, series: usize, points: Vec<(f64, f64)>) {
        self.marks.push(Mark::Dots { series, points });
    }

    pub(super) fn stems(&mut self, series: usize, points: Vec<(f64, f64)>) {
        self.marks.push(Mark::Stems { series, points });
    }

    /// (left, right, top), standing on the lower edge of the plot.
    pub(super) fn bars(&mut self, bars: Vec<(f64, f64, f64)>) {
        self.marks.push(Mark::Bars { bars });
    }

    pub(super) fn level(&mut self, class: Class, y: f64) {
        self.marks.push(Mark::Level { class, y });
    }

    pub(super) fn upright(&mut self, class: Class, x: f64) {
        self.marks.push(Mark::Upright { class, x });
    }

    /// Both ends of a band as lines, which stay visible under whatever was drawn before them.
    pub(super) fn edges(&mut self, class: Class, edges: &[(f64, f64, f64)]) {
        self.line(class, edges.iter().map(|e| (e.0, e.1)).collect());
        self.line(class, edges.iter().map(|e| (e.0, e.2)).collect());
    }

    /// A word beside a point, and a ring around it in the colour of a series; nothing outside the plot.
    pub(super) fn tag(&mut self, ring: Option<usize>, at: (f64, f64), word: &str) {
        let word = word.chars().map(style::printable).collect();
        self.marks.push(Mark::Tag { ring, at, word });
    }

    pub(super) fn legend_line(&mut self, class: Class, label: &str) {
        self.entry(Sample::Line(class), label);
    }

    pub(super) fn legend_band(&mut self, series: usize, label: &str) {
        self.entry(Sample::Band(series), label);
    }

    pub(super) fn legend_dots(&mut self, series: usize, label: &str) {
        self.entry(Sample::Dots(series), label);
    }

    pub(super) fn legend_bar(&mut self, label: &str) {
        self.entry(Sample::Bar, label);
    }

    fn entry(&mut self, sample: Sample, label: &str) {
        self.legend.push((sample, label.chars().map(style::printable).collect()));
    }

    /// A word over x from `low` to `high`; left out where it does not fit.
    pub(super) fn stretch(&mut self, low: f64, high: f64, label: &str) {
        self.stretches.push((low, high, label.chars().map(style::printable).collect()));
    }

    /// Self-contained SVG.
    pub(super) fn render(&self) -> String {
        let legend = self.legend_places();
        let rows = legend.iter().map(|&(_, row)| row + 1).max().unwrap_or(0);
        let top = EDGE + TITLE_ROW + rows * LEGEND_ROW + 260;
        let height = (top + self.plot_height * UNITS + 430) / UNITS;
        let mut drawn = String::new();
        let outcome = {
            let root = SVGBackend::with_string(&mut drawn, ((WIDTH * UNITS) as u32, (height * UNITS) as u32))
                .into_drawing_area();
            self.draw(&root, &legend, top)
        };
        debug_assert!(outcome.is_ok(), "drawing into a string does no input or output: {outcome:?}");
        style::document(&drawn, height, &self.title, &self.description)
    }

    fn draw(&self, root: &Area<'_>, legend: &[(i32, i32)], top: i32) -> Drawn<()> {
        text(root, &self.title, Class::Title, TITLE_SIZE, (EDGE, EDGE), HPos::Left, VPos::Top)?;
        for ((sample, label), &(x, row)) in self.legend.iter().zip(legend) {
            draw_entry(root, *sample, label, (x, EDGE + TITLE_ROW + row * LEGEND_ROW + LEGEND_ROW / 2 - 15))?;
        }
        let left = EDGE + 80 + self.y.scale.tick_labels().map(|l| text_width(&l, LABEL_SIZE)).max().unwrap_or(0);
        let caption = self.y.scale.caption(&self.y.name, &self.y.unit);
        text(root, &caption, Class::Label, LABEL_SIZE, (EDGE, top - 75), HPos::Left, VPos::Bottom)?;

        let mut chart = ChartBuilder::on(root)
            .margin_top(top)
            .margin_right(210)
            .margin_bottom(EDGE / 2)
            .y_label_area_size(left)
            .x_label_area_size(390)
            .build_cartesian_2d(self.x.scale.clone(), self.y.scale.clone())?;
        let label = text_style(Class::Label, LABEL_SIZE);
        chart
            .configure_mesh()
            .bold_line_style(Class::Grid.token())
            .light_line_style(Class::FineGrid.token())
            .axis_style(Class::Axis.token())
            .label_style(label.clone())
            .axis_desc_style(label)
            .x_desc(self.x.scale.caption(&self.x.name, &self.x.unit))
            .set_all_tick_mark_size(32)
            .draw()?;
        for mark in &self.marks {
            self.draw_mark(&mut chart, mark)?;
        }
        self.draw_tags(root, &chart)?;
        self.draw_stretches(root, &chart)?;
        if self.marks.iter().all(|m| m.is_empty(&self.x.scale, &self.y.scale)) {
            let (xs, ys) = chart.plotting_area().get_pixel_range();
            let middle = ((xs.start + xs.end) / 2, (ys.start + ys.end) / 2);
            text(root, "no data", Class::Note, NOTE_SIZE, middle, HPos::Center, VPos::Center)?;
        }
        root.present()
    }

    fn draw_mark(&self, chart: &mut Plot<'_, '_>, mark: &Mark) -> Drawn<()> {
        let (x, y) = (&self.x.scale, &self.y.scale);
        let (x_ends, y_ends) = (x.ends(), y.ends());
        match mark {
            Mark::Line { class, points } => {
                for piece in clip(points, x, y) {
                    chart.draw_series(std::iter::once(PathElement::new(piece, class.token())))?;
                }
            }
            Mark::Level { class, y: level } => {
                for piece in clip(&[(x_ends.0, *level), (x_ends.1, *level)], x, y) {
                    chart.draw_series(std::iter::once(PathElement::new(piece, class.token())))?;
                }
            }
            Mark::Upright { class, x: at } => {
                for piece in clip(&[(*at, y_ends.0), (*at, y_ends.1)], x, y) {
                    chart.draw_series(std::iter::once(PathElement::new(piece, class.token())))?;
                }
            }
            Mark::Band { series, edges } => {
                for (upper, lower) in band_pieces(edges, x, y) {
                    let outline: Vec<(f64, f64)> = upper.into_iter().chain(lower.into_iter().rev()).collect();
                    chart.draw_series(std::iter::once(Polygon::new(outline, Class::Band(*series).token().filled())))?;
                }
            }
            Mark::Dots { series, points } => {
                let radius = if points.len() > 60 { 18 } else { 26 };
                let fill = Class::Marker(*series).token().filled();
                let seen = points.iter().filter(|p| inside(**p, x, y));
                chart.draw_series(seen.map(|&p| Circle::new(p, radius, fill)))?;
            }
            Mark::Stems { series, points } => {
                for &(at, value) in points {
                    for piece in clip(&[(at, 0.0), (at, value)], x, y) {
                        chart.draw_series(std::iter::once(PathElement::new(piece, Class::Line(*series).token())))?;
                    }
                }
                if points.len() <= 60 {
                    self.draw_mark(chart, &Mark::Dots { series: *series, points: points.clone() })?;
                }
            }
            Mark::Bars { bars } => {
                let fill = Class::Bar.token().filled();
                let rectangles = bars.iter().filter_map(|&(left, right, height)| {
                    let t = y.to_unit(height);
                    (t > 0.0 && left < right)
                        .then(|| Rectangle::new([(left, y.value_at(t.min(1.0))), (right, y_ends.0)], fill))
                });
                chart.draw_series(rectangles)?;
            }
            Mark::Tag { .. } => {}
        }
        Ok(())
    }

    /// Over everything else.
    fn draw_tags(&self, root: &Area<'_>, chart: &Plot<'_, '_>) -> Drawn<()> {
        let (xs, ys) = chart.plotting_area().get_pixel_range();
        for mark in &self.marks {
            let Mark::Tag { ring, at, word } = mark else { continue };
            if !inside(*at, &self.x.scale, &self.y.scale) {
                continue;
            }
            let x = xs.start + (self.x.scale.to_unit(at.0) * f64::from(xs.end - xs.start)).round() as i32;
            let y = ys.end - (self.y.scale.to_unit(at.1) * f64::from(ys.end - ys.start)).round() as i32;
            if let Some(series) = ring {
                root.draw(&Circle::new((x, y), 48, Class::Thread(*series).token()))?;
            }
            // away from the nearer end of the plot
            let (side, anchor) = if x > (xs.start + xs.end) / 2 { (-75, HPos::Right) } else { (75, HPos::Left) };
            let down = if y - ys.start < 300 { 110 } else { -110 };
            text(root, word, Class::Tag, LABEL_SIZE, (x + side, y + down), anchor, VPos::Center)?;
        }
        Ok(())
    }

    fn draw_stretches(&self, root: &Area<'_>, chart: &Plot<'_, '_>) -> Drawn<()> {
        let (xs, ys) = chart.plotting_area().get_pixel_range();
        let place = |v: f64| xs.start + (self.x.scale.to_unit(v).clamp(0.0, 1.0) * f64::from(xs.end - xs.start)) as i32;
        for (low, high, label) in &self.stretches {
            let (from, to) = (place(*low), place(*high));
            if text_width(label, NOTE_SIZE) + 60 > to - from {
                continue;
            }
            let y = ys.start + 110;
            root.draw(&PathElement::new(vec![(from + 15, y + 95), (to - 15, y + 95)], Class::Axis.token()))?;
            text(root, label, Class::Note, NOTE_SIZE, ((from + to) / 2, y), HPos::Center, VPos::Center)?;
        }
        Ok(())
    }

    /// (x, row) of each legend entry, wrapped to the width of the figure.
    fn legend_places(&self) -> Vec<(i32, i32)> {
        let (mut x, mut row) = (EDGE, 0);
        self.legend
            .iter()
            .map(|(_, label)| {
                let width = SAMPLE + 60 + text_width(label, LABEL_SIZE) + 160;
                if x > EDGE && x + width > WIDTH * UNITS {
                    (x, row) = (EDGE, row + 1);
                }
                let place = (x, row);
                x += width;
                place
            })
            .collect()
    }
}

impl Mark {
    fn is_empty(&self, x: &Scale, y: &Scale) -> bool {
        match self {
            Mark::Line { points, .. } | Mark::Dots { points, .. } | Mark::Stems { points, .. } => {
                points.iter().all(|&p| !inside(p, x, y))
            }
            Mark::Band { edges, .. } => edges.is_empty(),
            Mark::Bars { bars } => bars.is_empty(),
            Mark::Level { .. } | Mark::Upright { .. } | Mark::Tag { .. } => true,
        }
    }
}

fn draw_entry(root: &Area<'_>, sample: Sample, label: &str, (x, y): (i32, i32)) -> Drawn<()> {
    let swatch = |class: Class| Rectangle::new([(x, y - 55), (x + SAMPLE, y + 55)], class.token().filled());
    let line = |class: Class| PathElement::new(vec![(x, y), (x + SAMPLE, y)], class.token());
    let dot = |series: usize| Circle::new((x + SAMPLE / 2, y), 26, Class::Marker(series).token().filled());
    match sample {
        Sample::Line(class) => root.draw(&line(class))?,
        Sample::Band(series) => root.draw(&swatch(Class::Band(series)))?,
        Sample::Bar => root.draw(&swatch(Class::Bar))?,
        Sample::Dots(series) => root.draw(&dot(series))?,
    }
    text(root, label, Class::Label, LABEL_SIZE, (x + SAMPLE + 60, y), HPos::Left, VPos::Center)
}

fn text_style(class: Class, size: i32) -> TextStyle<'static> {
    let mut style = TextStyle::from(("sans-serif", size));
    style.color = class.token().to_backend_color();
    style
}

pub(super) fn text(
    root: &Area<'_>,
    words: &str,
    class: Class,
    size: i32,
    at: (i32, i32),
    h: HPos,
    v: VPos,
) -> Drawn<()> {
    root.draw_text(words, &text_style(class, size).pos(Pos::new(h, v)), at)
}

fn inside(point: (f64, f64), x: &Scale, y: &Scale) -> bool {
    let within = |t: f64| (-1e-9..=1.0 + 1e-9).contains(&t);
    within(x.to_unit(point.0)) && within(y.to_unit(point.1))
}

/// The parts of a line that are inside the plot; a value that cannot be shown breaks it (Liang and Barsky 1984).
fn clip(points: &[(f64, f64)], x: &Scale, y: &Scale) -> Vec<Vec<(f64, f64)>> {
    let mut pieces: Vec<Vec<(f64, f64)>> = vec![];
    let mut open = false;
    for pair in points.windows(2) {
        let &[a, b] = pair else { continue };
        let (a, b) = ((x.to_unit(a.0), y.to_unit(a.1)), (x.to_unit(b.0), y.to_unit(b.1)));
        let Some((from, to)) = visible(a, b) else {
            open = false;
            continue;
        };
        let at = |t: f64| (x.value_at(a.0 + t * (b.0 - a.0)), y.value_at(a.1 + t * (b.1 - a.1)));
        match pieces.last_mut() {
            Some(piece) if open && from == 0.0 => piece.push(at(to)),
            _ => pieces.push(vec![at(from), at(to)]),
        }
        open = to == 1.0;
    }
    pieces
}

/// The part of the segment, as fractions of it, that lies in the unit square.
fn visible(a: (f64, f64), b: (f64, f64)) -> Option<(f64, f64)> {
    let (dx, dy) = (b.0 - a.0, b.1 - a.1);
    if !(dx.is_finite() && dy.is_finite()) {
        return None;
    }
    let (mut from, mut to) = (0.0_f64, 1.0_f64);
    for (step, room) in [(-dx, a.0), (dx, 1.0 - a.0), (-dy, a.1), (dy, 1.0 - a.1)] {
        if step == 0.0 {
            if room < -1e-9 {
                return None;
            }
        } else if step < 0.0 {
            from = from.max(room / step);
        } else {
            to = to.min(room / step);
        }
    }
    (from <= to).then_some((from, to))
}

type Edge = Vec<(f64, f64)>;

/// Upper and lower edge of every unbroken piece of a band, cut to the plot.
fn band_pieces(edges: &[(f64, f64, f64)], x: &Scale, y: &Scale) -> Vec<(Edge, Edge)> {
    let mut pieces: Vec<(Edge, Edge)> = vec![];
    let mut open = false;
    for &(at, lower, upper) in edges {
        let cut = |v: f64| y.value_at(y.to_unit(v).clamp(0.0, 1.0));
        // a lower edge at or below zero on a logarithmic axis goes to the bottom of the plot
        let lower = if y.to_unit(lower).is_nan() && lower <= 0.0 { y.ends().0 } else { cut(lower) };
        let upper = cut(upper);
        if !inside((at, upper), x, y) || lower.is_nan() {
            open = false;
            continue;
        }
        match pieces.last_mut() {
            Some((upper_edge, lower_edge)) if open => {
                upper_edge.push((at, upper));
                lower_edge.push((at, lower));
            }
            _ => pieces.push((vec![(at, upper)], vec![(at, lower)])),
        }
        open = true;
    }
    pieces.retain(|(upper, _)| upper.len() > 1);
    pieces
}

/// First, smallest, largest and last point of each of [`COLUMNS`] stretches of a long line: what the eye would see
/// of it.
fn thin(points: Vec<(f64, f64)>, x: &Scale) -> Vec<(f64, f64)> {
    if points.len() <= 4 * COLUMNS {
        return points;
    }
    let column = |p: &(f64, f64)| (x.to_unit(p.0) * COLUMNS as f64).floor();
    let mut out = Vec::with_capacity(4 * COLUMNS);
    for group in points.chunk_by(|a, b| column(a) == column(b)) {
        let value = |i: &usize| group[*i].1;
        let extreme = |less: fn(f64, f64) -> bool| {
            (0..group.len()).reduce(|best, i| if less(value(&i), value(&best)) { i } else { best }).unwrap_or(0)
        };
        let mut keep = [0, extreme(|a, b| a < b), extreme(|a, b| a > b), group.len() - 1];
        keep.sort_unstable();
        let mut last = usize::MAX;
        for i in keep {
            if i != last {
                out.push(group[i]);
            }
            last = i;
        }
    }
    out
}

/// The envelope of each stretch of a long band.
fn thin_band(edges: Vec<(f64, f64, f64)>, x: &Scale) -> Vec<(f64, f64, f64)> {
    if edges.len() <= 4 * COLUMNS {
        return edges;
    }
    let column = |e: &(f64, f64, f64)| (x.to_unit(e.0) * COLUMNS as f64).floor();
    let envelope = |a: (f64, f64, f64), b: &(f64, f64, f64)| (a.0, a.1.min(b.1), a.2.max(b.2));
    edges
        .chunk_by(|a, b| column(a) == column(b))
        .filter_map(|group| group.split_first().map(|(first, rest)| rest.iter().fold(*first, envelope)))
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn unit() -> Scale {
        Scale::linear_between(0.0, 1.0, 5.0)
    }

    #[test]
    fn clipping_cuts_at_the_frame() {
        let pieces = clip(&[(-1.0, 0.5), (0.5, 0.5), (0.5, 2.0), (0.7, 2.0), (0.7, 0.5)], &unit(), &unit());
        assert_eq!(pieces, vec![vec![(0.0, 0.5), (0.5, 0.5), (0.5, 1.0)], vec![(0.7, 1.0), (0.7, 0.5)]]);
    }

    #[test]
    fn a_gap_breaks_the_line() {
        let pieces = clip(&[(0.1, 0.1), (0.2, 0.1), (0.3, f64::NAN), (0.4, 0.1), (0.5, 0.1)], &unit(), &unit());
        assert_eq!(pieces.len(), 2);
    }

    #[test]
    fn thinning_keeps_extremes() {
        let mut points: Vec<(f64, f64)> = (0..100_000).map(|i| (f64::from(i) / 1e5, f64::from(i % 7))).collect();
        points[31_415].1 = 99.0;
        points[27_182].1 = -99.0;
        let thinned = thin(points.clone(), &unit());
        assert!(thinned.len() <= 4 * COLUMNS);
        assert!(thinned.contains(&points[31_415]) && thinned.contains(&points[27_182]));
        assert_eq!((thinned.first(), thinned.last()), (points.first(), points.last()));
        assert!(thinned.windows(2).all(|w| w[0].0 < w[1].0));
    }
}
