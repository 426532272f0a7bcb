//! A result as a person reads it (floor 6): one [`Report`], which `view` makes of a result record, and its two back
//! ends, [`terminal`] and [`html`]. Figures are drawn when a back end wants them.

pub mod allan;
pub mod figure;
pub mod html;
pub mod print;
pub mod terminal;

use std::fmt;

use serde::{Serialize, Serializer};

use crate::consistency::Verdict;

/// The least detail at which a block of a section is shown.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Level {
    /// Where everything is shown.
    #[default]
    Full,
    /// On the page alone.
    Page,
}

/// A result in words, numbers and figures. Every number is already text: a back end only places it.
#[derive(Debug, Default, Serialize)]
pub struct Report<'a> {
    pub title: String,
    /// One line under the title: what this is about.
    pub subtitle: String,
    pub verdict: Option<Conclusion>,
    /// What a person acts on, in a few lines; its heading says what this is about.
    pub answer: Section<'a>,
    /// Label and value: log, samples, method, version, seed.
    pub provenance: Vec<(String, String)>,
    pub sections: Vec<Section<'a>>,
    /// What was written where, one line each; a page does not say it.
    #[serde(skip)]
    pub written: Vec<String>,
    /// The command that mostly comes next.
    #[serde(skip)]
    pub next: Option<String>,
}

/// The verdict in words with its sentence.
#[derive(Clone, Debug, Serialize)]
pub struct Conclusion {
    /// "consistent", "inconsistent", "inconclusive".
    pub word: String,
    /// What was decided and at which level.
    pub sentence: String,
    /// The same where only what matters most is said.
    #[serde(skip)]
    pub brief: String,
}

/// Blocks under a heading.
#[derive(Debug, Default, Serialize)]
pub struct Section<'a> {
    pub heading: String,
    /// Of the heading.
    level: Level,
    blocks: Vec<Shown<'a>>,
    /// Of the blocks to come.
    #[serde(skip)]
    next: Level,
}

#[derive(Debug, Serialize)]
struct Shown<'a> {
    level: Level,
    #[serde(flatten)]
    block: Block<'a>,
}

/// What a section holds, in order.
#[derive(Debug, Serialize)]
#[serde(tag = "kind", rename_all = "snake_case")]
enum Block<'a> {
    /// Paragraphs or, as a list, sentences one below the other.
    Text {
        lines: Vec<String>,
        list: bool,
    },
    /// Sentences that should not be missed, behind the word "note" or "warning".
    Findings {
        word: &'static str,
        items: Vec<String>,
    },
    /// What to type, and what for.
    Command {
        purpose: String,
        command: String,
    },
    Table(Table),
    /// Side by side where there is room.
    Figures {
        figures: Vec<Figure<'a>>,
    },
}

#[derive(Clone, Debug, Serialize)]
struct Table {
    caption: String,
    columns: Vec<Column>,
    rows: Vec<Vec<String>>,
    /// The column that says what came of a row, where a page folds the rows that pass.
    folded: Option<usize>,
    /// How many rows pass.
    passed: usize,
}

#[derive(Clone, Debug, Serialize)]
struct Column {
    /// With its unit.
    name: String,
    align: Align,
    importance: Importance,
}

/// How a column is set.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
enum Align {
    /// Right aligned.
    Number,
    /// Left aligned.
    Word,
    /// Left aligned and wrapped.
    Sentence,
}

/// Which columns are left out first where a table is wider than the terminal.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "snake_case")]
enum Importance {
    Minor,
    Usual,
    /// Never left out: what a row is about, and what came of it.
    Key,
}

/// A picture that is drawn when it is wanted.
struct Figure<'a> {
    draw: Box<dyn Fn() -> String + 'a>,
    caption: String,
}

/// Names of columns that say what came of a row.
const VERDICTS: [&str; 2] = ["result", "verdict"];
/// What a row says that needs no attention.
const PASS: &str = "pass";
/// Fewer rows that pass are seen at a glance: folding them would hide more than it shows.
const FEWEST_FOLDED: usize = 4;
/// A column with a longer cell than this is one of sentences.
const LONGEST_WORD: usize = 32;

impl Align {
    /// A column of numbers has one, or nothing, in every cell.
    fn of<'c>(cells: impl Iterator<Item = &'c str> + Clone) -> Align {
        let number = |cell: &str| {
            let start = cell.trim_start_matches(['-', '−', '<', '>', '≤', '≥', '±', ' ']);
            let words = ["above ", "below ", "NaN", "inf", "–"];
            cell.is_empty()
                || start.starts_with(|c: char| c.is_ascii_digit())
                || words.iter().any(|w| cell.starts_with(w))
                || cell == "-"
        };
        if cells.clone().any(|cell| cell.chars().count() > LONGEST_WORD) {
            Align::Sentence
        } else if cells.clone().all(number) && cells.clone().any(|cell| !cell.is_empty()) {
            Align::Number
        } else {
            Align::Word
        }
    }
}

impl Table {
    fn new<H: AsRef<str>>(caption: String, header: &[H], rows: Vec<Vec<String>>) -> Table {
        let column = |(i, name): (usize, &H)| {
            let name = name.as_ref().to_owned();
            let key = i == 0 || VERDICTS.contains(&name.as_str());
            let align = Align::of(rows.iter().filter_map(|row| row.get(i)).map(String::as_str));
            Column { name, align, importance: if key { Importance::Key } else { Importance::Usual } }
        };
        let columns: Vec<Column> = header.iter().enumerate().map(column).collect();
        let judged = columns.iter().position(|column| VERDICTS.contains(&column.name.as_str()));
        let passes = |row: &&Vec<String>| judged.is_some_and(|i| row.get(i).is_some_and(|cell| cell == PASS));
        let passed = rows.iter().filter(passes).count();
        Table { caption, columns, folded: judged.filter(|_| passed >= FEWEST_FOLDED), passed, rows }
    }
}

impl Conclusion {
    pub fn new(verdict: Verdict, sentence: impl Into<String>) -> Conclusion {
        let sentence = sentence.into();
        Conclusion { word: verdict.word().into(), brief: sentence.clone(), sentence }
    }

    /// With what matters most.
    #[must_use]
    pub fn brief(self, brief: impl Into<String>) -> Conclusion {
        Conclusion { brief: brief.into(), ..self }
    }
}

/// The page has one style sheet for all its figures instead of one in each.
impl Serialize for Figure<'_> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let style = format!("<style>{}</style>\n", figure::style_sheet());
        ((self.draw)().replacen(&style, "", 1), &self.caption).serialize(serializer)
    }
}

impl fmt::Debug for Figure<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Figure").field("caption", &self.caption).finish_non_exhaustive()
    }
}

impl<'a> Section<'a> {
    /// Without a heading where that is empty.
    pub fn new(heading: impl Into<String>) -> Section<'a> {
        Section { heading: heading.into(), ..Section::default() }
    }

    /// With a heading that only the page has.
    pub fn of_page(heading: impl Into<String>) -> Section<'a> {
        Section { level: Level::Page, ..Section::new(heading) }
    }

    /// The level of what is added from here on.
    #[must_use]
    pub fn at(mut self, level: Level) -> Section<'a> {
        self.next = level;
        self
    }

    fn add(mut self, block: Block<'a>) -> Section<'a> {
        self.blocks.push(Shown { level: self.next, block });
        self
    }

    fn text(self, lines: Vec<String>, list: bool) -> Section<'a> {
        if lines.is_empty() { self } else { self.add(Block::Text { lines, list }) }
    }

    #[must_use]
    pub fn paragraph(self, text: impl Into<String>) -> Section<'a> {
        self.text(vec![text.into()], false)
    }

    #[must_use]
    pub fn paragraphs(self, texts: Vec<String>) -> Section<'a> {
        self.text(texts, false)
    }

    #[must_use]
    pub fn list(self, items: Vec<String>) -> Section<'a> {
        self.text(items, true)
    }

    #[must_use]
    pub fn findings(self, word: &'static str, items: Vec<String>) -> Section<'a> {
        if items.is_empty() { self } else { self.add(Block::Findings { word, items }) }
    }

    #[must_use]
    pub fn command(self, purpose: impl Into<String>, command: impl Into<String>) -> Section<'a> {
        self.add(Block::Command { purpose: purpose.into(), command: command.into() })
    }

    /// Nothing without rows. The first column, and one that is called `result` or `verdict`, is never left out.
    #[must_use]
    pub fn table<H: AsRef<str>, R: IntoIterator<Item: Into<String>>>(
        self,
        caption: impl Into<String>,
        header: &[H],
        rows: impl IntoIterator<Item = R>,
    ) -> Section<'a> {
        let row = |row: R| row.into_iter().map(Into::into).collect();
        let rows: Vec<Vec<String>> = rows.into_iter().map(row).collect();
        if rows.is_empty() { self } else { self.add(Block::Table(Table::new(caption.into(), header, rows))) }
    }

    /// These columns of the last table are the first to be left out.
    #[must_use]
    pub fn minor(mut self, names: &[&str]) -> Section<'a> {
        if let Some(Shown { block: Block::Table(table), .. }) = self.blocks.last_mut() {
            let minor = table.columns.iter_mut().filter(|column| names.contains(&column.name.as_str()));
            minor.for_each(|column| column.importance = Importance::Minor);
        }
        self
    }

    /// Beside the figures before it, where there is room.
    #[must_use]
    pub fn figure(mut self, caption: impl Into<String>, draw: impl Fn() -> String + 'a) -> Section<'a> {
        let figure = Figure { draw: Box::new(draw), caption: caption.into() };
        match self.blocks.last_mut() {
            Some(Shown { level, block: Block::Figures { figures } }) if *level == self.next => figures.push(figure),
            _ => return self.add(Block::Figures { figures: vec![figure] }),
        }
        self
    }
}

impl Report<'_> {
    /// The figures, but for those of the page alone, one below the other.
    pub fn sheet(&self, title: &str) -> String {
        let shown = self.sections.iter().flat_map(|section| &section.blocks).filter(|shown| shown.level < Level::Page);
        let figures = shown.filter_map(|shown| match &shown.block {
            Block::Figures { figures } => Some(figures),
            _ => None,
        });
        let drawn: Vec<String> = figures.flatten().map(|figure| (figure.draw)()).collect();
        figure::sheet(title, &drawn)
    }
}
