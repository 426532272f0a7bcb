//! What every reader of logs makes of a file: tables of rows.

use super::InputError;
use super::names::Head;
use super::rows::Rows;

/// Rows a table hands out at a time.
pub(super) const BLOCK: usize = 4096;

/// A file of columns, read from the beginning as often as needed.
pub(super) trait Table {
    fn heads(&self) -> Vec<&Head>;
    /// False when the columns have only numbers.
    fn named(&self) -> bool;
    /// File and place of the names, for messages.
    fn place(&self) -> String;
    fn row_place(&self, line: u64) -> String;
    /// What of the file could not be read, after a pass.
    fn notes(&self) -> Vec<String> {
        Vec::new()
    }
    /// `beside`: a column behind the axes, in which text is a missing value.
    fn select(&mut self, time: Option<usize>, axes: &[usize], beside: Option<usize>);
    fn rewind(&mut self) -> Result<(), InputError>;
    /// Number of rows, where it is known to be true.
    fn rows(&self) -> Option<u64>;
    /// So many rows, or a few more or less.
    fn about(&self) -> Option<u64> {
        self.rows()
    }
    /// Further rows cost nothing: they have been read.
    fn at_hand(&self) -> bool {
        false
    }
    /// The sample rate in Hz and what the file calls it, where it says it.
    fn rate(&self) -> Option<(String, f64)> {
        None
    }
    /// The first stamp of the file, in the file's unit.
    fn origin(&self) -> f64;
    /// Up to [`BLOCK`] further rows; false at the end.
    fn next_rows(&mut self, rows: &mut Rows) -> Result<bool, InputError>;
}

/// One table of a file: a message of a flight log, a topic of a bag, arrays of one length; a text log is one.
#[derive(Clone, Debug)]
pub(super) struct Topic {
    pub(super) name: String,
    /// Other names by which `--topic` finds it.
    pub(super) aliases: Vec<String>,
    pub(super) heads: Vec<Head>,
    /// False when the columns have only numbers.
    pub(super) named: bool,
    /// Of messages: their type; of an object: its class.
    pub(super) kind: String,
    /// An object of MATLAB, which cannot be read.
    pub(super) object: bool,
    /// Where the file says it, or the reader has counted.
    pub(super) rows: Option<u64>,
    /// First and last stamp, s, where the reader has counted.
    pub(super) span_s: Option<(f64, f64)>,
    /// Of several with the sensor that is looked for, the highest is taken: output of a sensor before what was made of
    /// it.
    pub(super) rank: u8,
}

impl Topic {
    pub(super) fn new(name: String, heads: Vec<Head>) -> Topic {
        let (aliases, kind) = (Vec::new(), String::new());
        Topic { name, aliases, heads, named: true, kind, object: false, rows: None, span_s: None, rank: 0 }
    }

    /// What to say of an object.
    pub(super) fn unread_object(&self) -> String {
        let class = &self.kind;
        format!("a MATLAB object of the class '{class}', which cannot be read; save what is in it as arrays of numbers")
    }
}

/// An open file.
pub(super) trait Source: Send {
    /// "HDF5", "PX4 ULog".
    fn format(&self) -> &'static str;
    fn topics(&self) -> &[Topic];
    /// Another topic each time.
    fn table(&mut self, topic: usize) -> Result<Box<dyn Table + Send>, InputError>;
}
