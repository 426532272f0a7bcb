//! Error budget: how much of the final variance each noise source causes.

use plotters::prelude::*;
use plotters::style::text_anchor::{HPos, VPos};

use super::chart::text;
use super::style::{self, Class, UNITS, WIDTH};

/// One noise source.
#[derive(Clone, Debug, PartialEq)]
pub struct BudgetItem {
    pub source: String,
    /// Fraction of the variance, 0..=1.
    pub share: f64,
    /// Written at the end of the bar, for instance the standard deviation with its unit; may be empty.
    pub value: String,
}

/// Horizontal bars, one per source, each under its name.
pub fn error_budget(title: &str, items: &[BudgetItem]) -> String {
    const TOP: i32 = 330;
    const ROW: i32 = 400;
    const EDGE: i32 = 80;
    const BAR: i32 = 130;
    let height = (TOP + items.len() as i32 * ROW + 40) / UNITS;
    let clean = |words: &str| words.chars().map(style::printable).collect::<String>();
    let mut drawn = String::new();
    let outcome = {
        let root =
            SVGBackend::with_string(&mut drawn, ((WIDTH * UNITS) as u32, (height * UNITS) as u32)).into_drawing_area();
        let draw = || {
            text(&root, &clean(title), Class::Title, 138, (EDGE, EDGE), HPos::Left, VPos::Top)?;
            let full = WIDTH * UNITS - 2 * EDGE;
            for (i, item) in items.iter().enumerate() {
                let y = TOP + i as i32 * ROW;
                let share = if item.share.is_finite() { item.share.clamp(0.0, 1.0) } else { 0.0 };
                let right = EDGE + (share * f64::from(full)).round() as i32;
                let percent = percent(item.share);
                let value = if item.value.is_empty() { percent } else { format!("{}  ·  {percent}", item.value) };
                text(&root, &clean(&item.source), Class::Label, 122, (EDGE, y), HPos::Left, VPos::Top)?;
                text(&root, &clean(&value), Class::Label, 122, (EDGE + full, y), HPos::Right, VPos::Top)?;
                let bar = |to: i32, class: Class| {
                    Rectangle::new([(EDGE, y + 160), (to, y + 160 + BAR)], class.token().filled())
                };
                root.draw(&bar(EDGE + full, Class::Band(5)))?;
                root.draw(&bar(right, Class::Bar))?;
            }
            root.present()
        };
        draw()
    };
    debug_assert!(outcome.is_ok(), "drawing into a string does no input or output: {outcome:?}");
    let words: Vec<String> = items.iter().map(|i| format!("{} {}", i.source, percent(i.share))).collect();
    style::document(&drawn, height, title, &format!("Shares of the final variance: {}.", words.join(", ")))
}

fn percent(share: f64) -> String {
    match 100.0 * share {
        p if !p.is_finite() => "–".into(),
        p if p > 0.0 && p < 0.1 => "< 0.1 %".into(),
        p => format!("{p:.1} %"),
    }
}
