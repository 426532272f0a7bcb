//! A report on a terminal: which columns are left out, where lines break, which level shows what.

use kfdesign::consistency::Verdict;
use kfdesign::report::terminal::{brief, first_line, full};
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
    let shown = full(&report(section), Some(width));
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
    let shown = full(&report(tests_of_axes().paragraph(long.clone())), None);
    assert!(shown.contains(&long) && shown.contains("tolerated"), "{shown}");
}

#[test]
fn sentences_are_wrapped_before_columns_go() {
    let meaning = "the filter expects more slow drift than there is in this log";
    let table = || Section::new("").table("", &["axis", "n", "result", "meaning"], [["x", "1", "FAIL", meaning]]);
    let shown = full(&report(table()), Some(44));
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
    let shown = full(&Report { verdict, ..report(section) }, Some(16));
    let expected = "One heading that\nis long\nA paragraph that\nis long.\n  an item that\n  is long too\nnote: mind this\n\n\
                    A caption that\nis long\na\n1\n\nconsistent: all\nis as claimed\n";
    assert_eq!(shown, expected);
}

#[test]
fn what_is_of_the_page_alone_is_on_no_terminal() {
    let section = Section::of_page("heading").at(Level::Page).paragraph("page").at(Level::Full).paragraph("full");
    assert_eq!(full(&report(section), None), "full\n");
}

#[test]
fn an_answer_is_verdict_table_and_what_comes_next() {
    let verdict = Some(Conclusion::new(Verdict::Inconsistent, "all that was found").brief("what matters most"));
    let answer = Section::new("log.csv: 3 samples").paragraph("said");
    let written = vec!["a.json written".to_string()];
    let next = Some("kfdesign tune a.json".to_string());
    let whole = Report { verdict, answer, written, next, ..report(tests_of_axes()) };
    let shown = brief(&whole, " (exit 1)", 80);
    let expected = "INCONSISTENT (exit 1): what matters most\n\nlog.csv: 3 samples\nsaid\n\n\
                    a.json written    next: kfdesign tune a.json    (-v: all tables)\n";
    assert_eq!(shown, expected);
    assert!(brief(&whole, "", 30).lines().all(|line| line.chars().count() <= 30));
    assert_eq!(first_line(&whole, "").unwrap(), "INCONSISTENT: what matters most");
    assert!(full(&whole, None).ends_with("inconsistent: all that was found\n\na.json written\n"));
    // what has no answer of its own is short enough
    let short = report(Section::new("").paragraph("one line"));
    assert_eq!(brief(&short, "", 80), "one line\n");
    assert_eq!(first_line(&short, ""), None);
}
