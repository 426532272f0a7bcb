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
