//! One self-contained HTML page: no script, nothing fetched, readable on a phone, in the dark and on paper.

use minijinja::value::Serde;
use minijinja::{Environment, UndefinedBehavior, context};
use serde::Serialize;

use super::figure;
use crate::consistency::Verdict;

/// A report. Every number is already text: the template only places it.
#[derive(Clone, Debug, Default, Serialize)]
pub struct Page {
    pub title: String,
    /// One line under the title: what this is about.
    pub subtitle: String,
    pub badge: Option<Badge>,
    /// Label and value: log, samples, method, version, seed.
    pub provenance: Vec<(String, String)>,
    pub sections: Vec<Section>,
}

/// The verdict in words with its sentence.
#[derive(Clone, Debug, Serialize)]
pub struct Badge {
    /// "consistent", "inconsistent", "inconclusive".
    pub word: String,
    /// What was decided and at which level.
    pub sentence: String,
}

#[derive(Clone, Debug, Default, Serialize)]
pub struct Section {
    pub heading: String,
    pub blocks: Vec<Block>,
}

/// What a section holds, in order.
#[derive(Clone, Debug, Serialize)]
#[serde(tag = "kind", rename_all = "snake_case")]
pub enum Block {
    Paragraph {
        text: String,
    },
    /// Sentences one below the other.
    List {
        items: Vec<String>,
    },
    /// A sentence that should not be missed.
    Warning {
        text: String,
    },
    Table(Table),
    /// Side by side where there is room.
    Figures {
        figures: Vec<Figure>,
    },
}

#[derive(Clone, Debug, Default, Serialize)]
pub struct Table {
    pub caption: String,
    /// With units.
    pub header: Vec<String>,
    pub rows: Vec<Vec<String>>,
    /// How each column is set.
    pub columns: Vec<Column>,
}

/// How a column is set.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Column {
    /// Right aligned.
    Number,
    /// Left aligned.
    Word,
    /// Left aligned and wrapped.
    Sentence,
}

impl Column {
    /// A column of numbers has one, or nothing, in every cell.
    fn of<'a>(cells: impl Iterator<Item = &'a str> + Clone) -> Column {
        let number = |cell: &str| {
            let start = cell.trim_start_matches(['-', '−', '<', '>', '≤', '≥', '±', ' ']);
            let words = ["above ", "below ", "NaN", "inf", "–"];
            cell.is_empty()
                || start.starts_with(|c: char| c.is_ascii_digit())
                || words.iter().any(|w| cell.starts_with(w))
                || cell == "-"
        };
        if cells.clone().any(|cell| cell.chars().count() > 32) {
            Column::Sentence
        } else if cells.clone().all(number) && cells.clone().any(|cell| !cell.is_empty()) {
            Column::Number
        } else {
            Column::Word
        }
    }
}

#[derive(Clone, Debug, Default, Serialize)]
pub struct Figure {
    /// From [`super::figure`].
    pub svg: String,
    pub caption: String,
}

/// The page could not be made: a fault of the template, not of the data.
#[derive(Debug, thiserror::Error)]
#[error("report page: {message}")]
pub struct PageError {
    pub message: String,
}

impl Badge {
    pub fn new(verdict: Verdict, sentence: impl Into<String>) -> Badge {
        let word = match verdict {
            Verdict::Consistent => "consistent",
            Verdict::Inconsistent => "inconsistent",
            Verdict::Inconclusive => "inconclusive",
        };
        Badge { word: word.into(), sentence: sentence.into() }
    }
}

impl Section {
    pub fn new(heading: impl Into<String>) -> Section {
        Section { heading: heading.into(), blocks: vec![] }
    }
    #[must_use]
    pub fn paragraph(mut self, text: impl Into<String>) -> Section {
        self.blocks.push(Block::Paragraph { text: text.into() });
        self
    }
    #[must_use]
    pub fn list(mut self, items: Vec<String>) -> Section {
        if !items.is_empty() {
            self.blocks.push(Block::List { items });
        }
        self
    }
    #[must_use]
    pub fn warning(mut self, text: impl Into<String>) -> Section {
        self.blocks.push(Block::Warning { text: text.into() });
        self
    }
    #[must_use]
    pub fn table(mut self, caption: impl Into<String>, header: &[&str], rows: Vec<Vec<String>>) -> Section {
        let header: Vec<String> = header.iter().map(|h| (*h).to_owned()).collect();
        let cells = |i: usize| rows.iter().filter_map(move |row| row.get(i)).map(String::as_str);
        let columns = (0..header.len()).map(|i| Column::of(cells(i))).collect();
        self.blocks.push(Block::Table(Table { caption: caption.into(), header, rows, columns }));
        self
    }
    /// Figures with captions, side by side where there is room.
    #[must_use]
    pub fn figures(mut self, figures: Vec<(String, String)>) -> Section {
        let figures = figures.into_iter().map(|(svg, caption)| Figure { svg, caption }).collect();
        self.blocks.push(Block::Figures { figures });
        self
    }
}

impl Page {
    /// The page as HTML.
    pub fn to_html(&self) -> Result<String, PageError> {
        let mut environment = Environment::new();
        environment.set_undefined_behavior(UndefinedBehavior::Strict);
        let failed = |e: minijinja::Error| PageError { message: format!("{e:#}") };
        environment.add_template("page.html", include_str!("templates/page.html")).map_err(failed)?;
        let mut page = self.clone();
        // one style sheet for the page instead of one in every figure
        let style = figure::style_sheet();
        let repeated = format!("<style>{style}</style>\n");
        for block in page.sections.iter_mut().flat_map(|s| &mut s.blocks) {
            if let Block::Figures { figures } = block {
                for figure in figures {
                    figure.svg = figure.svg.replacen(&repeated, "", 1);
                }
            }
        }
        let template = environment.get_template("page.html").map_err(failed)?;
        template
            .render(context! {
                page => Serde(&page),
                figure_style => style,
                version => env!("CARGO_PKG_VERSION"),
            })
            .map_err(failed)
    }
}
