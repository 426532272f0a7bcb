//! A report on a terminal: which columns are left out, where lines break, which level shows what.

use kfdesign::consistency::Verdict;
use kfdesign::report::terminal::text;
use kfdesign::report::{Conclusion, Level, Report, Section};

/// A table with its verdict in the middle, 55 characters wide.
fn tests_of_axes() -> Section<'static> {
    let header = ["axis", "statistic", "result", "interval", "tolerated", "p"];
    let row = |axis: &'static str, result: &'static str| [axis, "1.0002", result, "0.9 … 1.1", "0.8 … 1.2", "0.8870"];
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
    assert_eq!(header_at(50, tests_of_axes().minor(&["interval"])), ["axis", "statistic", "result", "tolerated", "p"]);
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
