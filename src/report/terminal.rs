//! A report as text for a terminal of a given width, or for a file, which takes lines of any length.

use super::{Align, Block, Column, Importance, Level, Report, Section, Table};

/// Between columns.
const GAP: usize = 2;
/// A column of sentences is wrapped down to this width before columns are left out: three or four words.
const NARROWEST: usize = 24;
/// Before the items of a list, and before what a wrapped item goes on with.
const INDENT: &str = "  ";

/// All sections of the report but what the page alone has, the verdict last. `width`: characters in a line, where
/// there is a limit.
pub fn full(report: &Report<'_>, width: Option<usize>) -> String {
    let width = width.unwrap_or(usize::MAX);
    let mut out = String::new();
    report.sections.iter().for_each(|part| section(&mut out, part, width));
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

/// The verdict or the heading, the answer, what was written and what comes next. `ending`: behind the verdict's word.
pub fn brief(report: &Report<'_>, ending: &str, width: usize) -> String {
    let mut out = String::new();
    if report.verdict.is_some() {
        first_line(report, ending).iter().for_each(|line| wrap(&mut out, line, "", width));
    }
    let answered = !report.answer.blocks.is_empty();
    match answered {
        true => section(&mut out, &report.answer, width),
        // what is short has no shorter answer
        false => report.sections.iter().for_each(|part| section(&mut out, part, width)),
    }
    let next = report.next.as_ref().map(|next| format!("next: {next}"));
    let mut last: Vec<String> = report.written.iter().cloned().chain(next).collect();
    if answered && !report.sections.is_empty() {
        last.push("(-v: all tables)".into());
    }
    if !last.is_empty() {
        apart(&mut out);
        let one = last.join("    ");
        let lines = if one.chars().count() <= width { vec![one] } else { last };
        lines.iter().for_each(|line| wrap(&mut out, line, "", width));
    }
    out
}

/// The verdict with its sentence; where nothing is judged, what the answer is about.
pub fn first_line(report: &Report<'_>, ending: &str) -> Option<String> {
    match &report.verdict {
        Some(verdict) => Some(format!("{}{ending}: {}", verdict.word.to_uppercase(), verdict.brief)),
        None => Some(report.answer.heading.clone()).filter(|heading| !heading.is_empty()),
    }
}

fn section(out: &mut String, section: &Section<'_>, width: usize) {
    let shown = section.blocks.iter().filter(|shown| shown.level < Level::Page).map(|shown| &shown.block);
    let mut blocks = shown.filter(|block| !matches!(block, Block::Figures { .. })).peekable();
    if blocks.peek().is_none() {
        return;
    }
    apart(out);
    let mut first = true;
    if section.level < Level::Page && !section.heading.is_empty() {
        wrap(out, &section.heading, "", width);
    }
    for block in blocks {
        match block {
            Block::Text { lines, list: false } => lines.iter().for_each(|line| wrap(out, line, "", width)),
            Block::Text { lines, list: true } => lines.iter().for_each(|line| wrap(out, line, INDENT, width)),
            Block::Findings { word, items } => {
                items.iter().for_each(|item| wrap(out, &format!("{word}: {item}"), "", width));
            }
            Block::Command { purpose, command } => out.push_str(&format!("{purpose}: {command}\n")),
            Block::Table(table) => {
                if !table.caption.is_empty() && !first {
                    apart(out);
                }
                wrap(out, &table.caption, "", width);
                out.push_str(&rows(table, width));
            }
            Block::Figures { .. } => {}
        }
        first = false;
    }
}

/// An empty line, but not at the beginning.
fn apart(out: &mut String) {
    if !out.is_empty() {
        out.push('\n');
    }
}

/// Lines of at most `width` characters, broken between words. A word that is longer stays whole.
pub fn broken(text: &str, width: usize) -> Vec<String> {
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
