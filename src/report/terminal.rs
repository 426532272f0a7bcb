//! A report as text for a terminal of a given width, or for a file, which takes lines of any length.

use super::{Align, Block, Column, Importance, Level, Report, Table};

/// Between columns.
const GAP: usize = 2;
/// A column of sentences is wrapped down to this width before columns are left out: three or four words.
const NARROWEST: usize = 24;
/// Before the items of a list, and before what a wrapped item goes on with.
const INDENT: &str = "  ";

/// All of the report down to `level`, the verdict last. `width`: characters in a line, where there is a limit.
pub fn text(report: &Report<'_>, level: Level, width: Option<usize>) -> String {
    let width = width.unwrap_or(usize::MAX);
    let mut out = String::new();
    for section in &report.sections {
        let shown = section.blocks.iter().filter(|shown| shown.level <= level).map(|shown| &shown.block);
        let mut blocks = shown.filter(|block| !matches!(block, Block::Figures { .. })).peekable();
        if blocks.peek().is_none() {
            continue;
        }
        apart(&mut out);
        let mut first = true;
        if section.level <= level && !section.heading.is_empty() {
            wrap(&mut out, &section.heading, "", width);
        }
        for block in blocks {
            match block {
                Block::Text { lines, list: false } => lines.iter().for_each(|line| wrap(&mut out, line, "", width)),
                Block::Text { lines, list: true } => lines.iter().for_each(|line| wrap(&mut out, line, INDENT, width)),
                Block::Findings { word, items } => {
                    items.iter().for_each(|item| wrap(&mut out, &format!("{word}: {item}"), "", width));
                }
                Block::Command { purpose, command } => out.push_str(&format!("{purpose}: {command}\n")),
                Block::Table(table) => {
                    if !table.caption.is_empty() && !first {
                        apart(&mut out);
                    }
                    wrap(&mut out, &table.caption, "", width);
                    out.push_str(&rows(table, width));
                }
                Block::Figures { .. } => {}
            }
            first = false;
        }
    }
    if let Some(verdict) = &report.verdict {
        apart(&mut out);
        wrap(&mut out, &format!("{}: {}", verdict.word, verdict.sentence), "", width);
    }
    if !report.written.is_empty() {
        apart(&mut out);
        report.written.iter().for_each(|line| wrap(&mut out, line, "", width));
    }
    out
}

/// A table alone, with every column.
pub fn table<H: AsRef<str>>(header: &[H], rows_of: &[Vec<String>]) -> String {
    rows(&Table::new(String::new(), header, rows_of.to_vec()), usize::MAX)
}

/// An empty line, but not at the beginning.
fn apart(out: &mut String) {
    if !out.is_empty() {
        out.push('\n');
    }
}

/// Lines of at most `width` characters, broken between words. A word that is longer stays whole.
fn broken(text: &str, width: usize) -> Vec<String> {
    let mut lines: Vec<String> = Vec::new();
    for paragraph in text.lines() {
        let mut words = paragraph.split(' ');
        let mut line = words.next().unwrap_or_default().to_owned();
        for word in words {
            if line.chars().count() + 1 + word.chars().count() > width {
                lines.push(std::mem::replace(&mut line, word.to_owned()));
            } else {
                line.push(' ');
                line.push_str(word);
            }
        }
        lines.push(line);
    }
    lines
}

fn wrap(out: &mut String, text: &str, indent: &str, width: usize) {
    for line in broken(text, width.saturating_sub(indent.len())) {
        out.push_str(&format!("{indent}{line}\n"));
    }
}

/// Characters of the longest cell, the name of the column among them.
fn natural(table: &Table, column: usize) -> usize {
    let cells = table.rows.iter().filter_map(|row| row.get(column)).map(|cell| cell.chars().count());
    cells.chain([table.columns[column].name.chars().count()]).max().unwrap_or(0)
}

/// The columns that fit, each with its width: of the others the least important go first, the last of them before
/// those on their left. A last column of sentences gives way before.
fn fitting(table: &Table, width: usize) -> Vec<(usize, usize)> {
    let mut kept: Vec<(usize, usize)> = (0..table.columns.len()).map(|i| (i, natural(table, i))).collect();
    loop {
        let total = kept.iter().map(|(_, room)| room + GAP).sum::<usize>().saturating_sub(GAP);
        let over = total.saturating_sub(width);
        if let Some((i, room)) = kept.last_mut()
            && table.columns[*i].align == Align::Sentence
        {
            let narrowest = NARROWEST.max(table.columns[*i].name.chars().count()).min(*room);
            if over <= *room - narrowest {
                *room -= over;
                return kept;
            }
        }
        let importance = |place: &usize| table.columns[kept[*place].0].importance;
        let least = (0..kept.len()).rev().filter(|place| importance(place) < Importance::Key).min_by_key(importance);
        match least.filter(|_| over > 0) {
            Some(place) => kept.remove(place),
            None => return kept,
        };
    }
}

/// First column and sentences left, the others right aligned.
fn rows(table: &Table, width: usize) -> String {
    let kept = fitting(table, width);
    let mut out = String::new();
    let names: Vec<String> = table.columns.iter().map(|column: &Column| column.name.clone()).collect();
    let named = names.iter().any(|name| !name.is_empty());
    for row in named.then_some(&names).into_iter().chain(&table.rows) {
        let cell = |(i, room): &(usize, usize)| {
            let text = row.get(*i).map_or("", String::as_str);
            if table.columns[*i].align == Align::Sentence { broken(text, *room) } else { vec![text.to_owned()] }
        };
        let cells: Vec<Vec<String>> = kept.iter().map(cell).collect();
        for k in 0..cells.iter().map(Vec::len).max().unwrap_or(0) {
            let mut line = String::new();
            for ((i, room), cell) in kept.iter().zip(&cells) {
                let text = cell.get(k).map_or("", String::as_str);
                let pad = " ".repeat(room.saturating_sub(text.chars().count()));
                match *i == 0 || table.columns[*i].align == Align::Sentence {
                    true => line += &format!("{text}{pad}"),
                    false => line += &format!("{pad}{text}"),
                }
                line += &" ".repeat(GAP);
            }
            out.push_str(line.trim_end());
            out.push('\n');
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::super::{Conclusion, Section};
    use super::*;
    use crate::consistency::Verdict;

    /// A table with its verdict in the middle, 55 characters wide.
    fn tests_of_axes() -> Section<'static> {
        let header = ["axis", "statistic", "result", "interval", "tolerated", "p"];
        let row =
            |axis: &'static str, result: &'static str| [axis, "1.0002", result, "0.9 … 1.1", "0.8 … 1.2", "0.8870"];
        Section::new("").table("", &header, [row("gyro_x", "pass"), row("gyro_y", "FAIL")])
    }

    fn report(section: Section<'_>) -> Report<'_> {
        Report { sections: vec![section], ..Report::default() }
    }

    fn header_at(width: usize, section: Section<'_>) -> Vec<String> {
        let shown = text(&report(section), Level::Full, Some(width));
        assert!(shown.contains("FAIL"), "{width}:\n{shown}");
        assert!(shown.lines().all(|line| line.chars().count() <= width.max(16)), "{width}:\n{shown}");
        shown.lines().next().unwrap_or("").split_whitespace().map(String::from).collect()
    }

    #[test]
    fn columns_go_by_importance_and_then_from_the_right_but_never_the_verdict() {
        let all = ["axis", "statistic", "result", "interval", "tolerated", "p"];
        assert_eq!(header_at(80, tests_of_axes()), all);
        assert_eq!(header_at(40, tests_of_axes()), all[..4]);
        assert_eq!(header_at(40, tests_of_axes().minor(&["statistic"])), ["axis", "result", "interval", "tolerated"]);
        assert_eq!(
            header_at(50, tests_of_axes().minor(&["interval"])),
            ["axis", "statistic", "result", "tolerated", "p"]
        );
        // nothing more can go
        assert_eq!(header_at(10, tests_of_axes()), ["axis", "result"]);
    }

    #[test]
    fn a_file_keeps_every_column_and_every_line() {
        let long = "word ".repeat(60).trim_end().to_string();
        let shown = text(&report(tests_of_axes().paragraph(long.clone())), Level::Full, None);
        assert!(shown.contains(&long) && shown.contains("tolerated"), "{shown}");
    }

    #[test]
    fn sentences_are_wrapped_before_columns_go() {
        let meaning = "the filter expects more slow drift than there is in this log";
        let table = || Section::new("").table("", &["axis", "n", "result", "meaning"], [["x", "1", "FAIL", meaning]]);
        let shown = text(&report(table()), Level::Full, Some(44));
        assert!(shown.lines().all(|line| line.chars().count() <= 44), "{shown}");
        let words = shown.split_whitespace().collect::<Vec<_>>().join(" ");
        assert!(words.ends_with(&format!("x 1 FAIL {meaning}")), "{shown}");
        assert_eq!(header_at(30, table()), ["axis", "n", "result"]);
    }

    #[test]
    fn paragraphs_items_and_captions_are_wrapped() {
        let section = Section::new("One heading that is long")
            .paragraph("A paragraph that is long.")
            .list(vec!["an item that is long too".into()])
            .findings("note", vec!["mind this".into()])
            .table("A caption that is long", &["a"], [["1"]]);
        let verdict = Some(Conclusion::new(Verdict::Consistent, "all is as claimed"));
        let shown = text(&Report { verdict, ..report(section) }, Level::Full, Some(16));
        let expected = "One heading that\nis long\nA paragraph that\nis long.\n  an item that\n  is long too\nnote: mind this\n\n\
                        A caption that\nis long\na\n1\n\nconsistent: all\nis as claimed\n";
        assert_eq!(shown, expected);
    }

    #[test]
    fn a_level_shows_what_is_at_it_and_before_it() {
        let section = Section::of_page("heading")
            .at(Level::Page)
            .paragraph("page")
            .at(Level::Brief)
            .paragraph("brief")
            .at(Level::Full)
            .paragraph("full");
        let all = report(section);
        assert_eq!(text(&all, Level::Brief, None), "brief\n");
        assert_eq!(text(&all, Level::Full, None), "brief\nfull\n");
        assert_eq!(text(&all, Level::Page, None), "heading\npage\nbrief\nfull\n");
    }
}
