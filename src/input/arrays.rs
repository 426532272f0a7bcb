//! Files of named arrays (MATLAB, HDF5): arrays of one length in one group are the columns of one table.
//!
//! Samples run along the longer side of a matrix. Its columns are named after it: `_x, _y, _z` of three, `_w, _x,
//! _y, _z` of four whose name says quaternion, `_1, _2, …` of any other number, which then say nothing of a sensor.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, PoisonError};

use super::account::Account;
use super::names::{Head, is_rate, words};
use super::number::{Split, since};
use super::table::{Source, Topic};
use super::{BLOCK, InputError, Rows, Table};

/// More columns than this are no channels of a log.
const MOST_COLUMNS: u64 = 4096;

/// An array of numbers in a file.
#[derive(Clone, Debug)]
pub(super) struct Array {
    /// `group/name`, or `structure.name`.
    pub(super) path: String,
    /// As stored: rows and columns where the first index is that of the row.
    pub(super) rows: u64,
    pub(super) columns: u64,
    /// As the file says it.
    pub(super) unit: Option<String>,
    /// Names of the columns, where the file says them.
    pub(super) fields: Vec<String>,
}

/// Where a number stands.
pub(super) type Put<'a> = dyn FnMut(u64, u64, Split) + 'a;

/// A file of arrays.
pub(super) trait ArrayFile: Send {
    fn format(&self) -> &'static str;
    /// Of at least one number each.
    fn arrays(&self) -> &[Array];
    /// Numbers that stand alone: name and value.
    fn scalars(&self) -> &[(String, f64)];
    /// What cannot be read: names and classes.
    fn objects(&self) -> &[(String, String)];
    /// Hands every number of an array out, with its row and column, in whatever order it is stored.
    fn load(&mut self, array: usize, put: &mut Put) -> Result<(), InputError>;
}

type SharedFile = Arc<Mutex<Box<dyn ArrayFile>>>;

pub(super) struct ArraySource {
    path: PathBuf,
    account: Account,
    rate: Option<(String, f64)>,
    format: &'static str,
    /// Of all tables.
    file: SharedFile,
    topics: Vec<Topic>,
    /// Per topic and column: the array, its column, and whether samples run along the stored columns.
    places: Vec<Vec<Place>>,
}

#[derive(Clone, Copy, Debug)]
struct Place {
    array: usize,
    column: u64,
    across: bool,
}

impl ArraySource {
    pub(super) fn new(path: &Path, file: Box<dyn ArrayFile>, account: &Account) -> Result<ArraySource, InputError> {
        let mut groups: BTreeMap<(String, u64), usize> = BTreeMap::new();
        let (mut topics, mut places): (Vec<Topic>, Vec<Vec<Place>>) = (Vec::new(), Vec::new());
        for (i, array) in file.arrays().iter().enumerate() {
            let across = array.columns > array.rows && array.fields.is_empty();
            let (rows, columns) = if across { (array.columns, array.rows) } else { (array.rows, array.columns) };
            if rows < 2 || columns > MOST_COLUMNS {
                continue;
            }
            let (group, name) = array.path.rsplit_once(['/', '.']).unwrap_or(("", &array.path));
            let longest = array.fields.iter().map(String::len).max().unwrap_or(name.len() + 5);
            let held = account.columns(columns, longest).and_then(|()| account.columns(1, array.path.len()));
            held.map_err(|excess| InputError::new(format!("{}: {excess}", path.display())))?;
            let at = *groups.entry((group.to_string(), rows)).or_insert_with(|| {
                let mut topic = Topic::new(array.path.clone(), Vec::new());
                topic.aliases.push(group.to_string());
                topic.rows = Some(rows);
                topics.push(topic);
                places.push(Vec::new());
                topics.len() - 1
            });
            topics[at].aliases.push(array.path.clone());
            topics[at].heads.extend(heads(name, columns, array));
            places[at].extend((0..columns).map(|column| Place { array: i, column, across }));
        }
        for (name, class) in file.objects() {
            topics.push(Topic { kind: class.clone(), object: true, ..Topic::new(name.clone(), Vec::new()) });
            places.push(Vec::new());
        }
        if topics.is_empty() {
            let names: Vec<&str> = file.arrays().iter().take(40).map(|a| a.path.as_str()).collect();
            let found = if names.is_empty() { "none at all".into() } else { format!("only {}", names.join(", ")) };
            let message = format!("{}: no array of two or more rows of numbers; there is {found}", path.display());
            return Err(InputError::new(message));
        }
        let (path, account, rate) = (path.to_path_buf(), account.clone(), rate(file.scalars()));
        Ok(ArraySource { path, account, rate, format: file.format(), file: Arc::new(Mutex::new(file)), topics, places })
    }
}

/// What the columns of an array are called.
fn heads(name: &str, columns: u64, array: &Array) -> Vec<Head> {
    let quaternion = words(name).iter().any(|word| ["quat", "quaternion", "quaternions", "q"].contains(&word.as_str()));
    let axes: Vec<String> = match columns {
        _ if !array.fields.is_empty() => array.fields.clone(),
        1 => vec![name.to_string()],
        3 => ["x", "y", "z"].iter().map(|axis| format!("{name}_{axis}")).collect(),
        4 if quaternion => ["w", "x", "y", "z"].iter().map(|axis| format!("{name}_{axis}")).collect(),
        _ => (1..=columns).map(|i| format!("{name}_{i}")).collect(),
    };
    // a unit of the whole array stands behind its name
    let whole = Head::parse(name);
    let silent = array.fields.is_empty() && columns != 1 && columns != 3 && !(columns == 4 && quaternion);
    axes.iter()
        .map(|name| {
            let mut head = Head::parse(name);
            if let Some(unit) = &array.unit {
                head.set_unit_below(unit);
            }
            if let (None, Some(unit), true) = (&head.unit, &whole.unit, array.fields.is_empty()) {
                let axis = name.strip_prefix(&whole.full).unwrap_or_default();
                (head.unit, head.name) = (Some(unit.clone()), format!("{}{axis}", whole.name));
            }
            head.silent = silent;
            head
        })
        .collect()
}

impl Source for ArraySource {
    fn format(&self) -> &'static str {
        self.format
    }
    fn topics(&self) -> &[Topic] {
        &self.topics
    }
    fn table(&mut self, topic: usize) -> Result<Box<dyn Table + Send>, InputError> {
        Ok(Box::new(ArrayTable {
            path: self.path.clone(),
            account: self.account.clone(),
            rate: self.rate.clone(),
            file: self.file.clone(),
            topic: self.topics[topic].clone(),
            places: self.places[topic].clone(),
            time: None,
            axes: Vec::new(),
            loaded: None,
            next: 0,
        }))
    }
}

/// The sample rate in Hz, if a number of the file is called so.
fn rate(scalars: &[(String, f64)]) -> Option<(String, f64)> {
    scalars.iter().find_map(|(path, value)| {
        let name = path.rsplit(['/', '.']).next().unwrap_or(path);
        (is_rate(name) && value.is_finite() && *value > 0.0).then(|| (path.clone(), *value))
    })
}

/// The selected columns of one table, in memory: the arrays of such files are compressed as a whole.
struct ArrayTable {
    path: PathBuf,
    account: Account,
    file: SharedFile,
    topic: Topic,
    places: Vec<Place>,
    rate: Option<(String, f64)>,
    time: Option<usize>,
    /// The axes and what is beside them.
    axes: Vec<usize>,
    loaded: Option<Loaded>,
    next: usize,
}

#[derive(Default)]
struct Loaded {
    /// First stamp, whole and fraction.
    origin: Split,
    /// Since then.
    time: Vec<f64>,
    values: Vec<Vec<f64>>,
}

impl ArrayTable {
    fn load(&mut self) -> Result<Loaded, InputError> {
        let rows = self.topic.rows.unwrap_or(0) as usize;
        let mut loaded = Loaded::default();
        let time = self.time.map(|column| self.places[column]);
        let wanted: Vec<Place> = self.axes.iter().map(|&column| self.places[column]).collect();
        let mut arrays: Vec<usize> = wanted.iter().chain(&time).map(|place| place.array).collect();
        arrays.sort_unstable();
        arrays.dedup();
        // since the stamp that is met first, which is that of the first row unless blocks are stored in another order
        let (mut met, mut earliest): (Option<Split>, Option<(usize, Split)>) = (None, None);
        loaded.values.resize_with(wanted.len(), Vec::new);
        for array in arrays {
            let here: Vec<(usize, Place)> =
                wanted.iter().copied().enumerate().filter(|(_, place)| place.array == array).collect();
            let stamp = time.filter(|place| place.array == array);
            let (values, stamps) = (&mut loaded.values, &mut loaded.time);
            let mut file = self.file.lock().unwrap_or_else(PoisonError::into_inner);
            file.load(array, &mut |row, column, number| {
                let at = |place: &Place| {
                    let (row, column) = if place.across { (column, row) } else { (row, column) };
                    (column == place.column && row < rows as u64).then_some(row as usize)
                };
                for (axis, place) in &here {
                    if let Some(row) = at(place) {
                        let column = &mut values[*axis];
                        if column.len() <= row {
                            column.resize(row + 1, f64::NAN); // as far as numbers are there, not as far as promised
                        }
                        let x = number.0 as f64 + number.1;
                        column[row] = if x.is_finite() { x } else { f64::NAN };
                    }
                }
                if let Some(row) = stamp.as_ref().and_then(at) {
                    if stamps.len() <= row {
                        stamps.resize(row + 1, f64::NAN);
                    }
                    stamps[row] = since(&mut met, number);
                    if number.1.is_finite() && earliest.is_none_or(|(first, _)| row < first) {
                        earliest = Some((row, number));
                    }
                }
            })?;
        }
        loaded.origin = earliest.map_or((0, 0.0), |(_, stamp)| stamp);
        let before = since(&mut met, loaded.origin);
        if before != 0.0 {
            loaded.time.iter_mut().for_each(|stamp| *stamp -= before);
        }
        let short =
            loaded.values.iter().any(|column| column.len() != rows) || (time.is_some() && loaded.time.len() != rows);
        if short {
            return Err(InputError::new(format!(
                "{}: truncated: an array holds fewer numbers than it declares",
                self.path.display()
            )));
        }
        Ok(loaded)
    }
}

impl Table for ArrayTable {
    fn heads(&self) -> Vec<&Head> {
        self.topic.heads.iter().collect()
    }
    fn named(&self) -> bool {
        true
    }
    fn place(&self) -> String {
        self.path.display().to_string()
    }
    fn row_place(&self, row: u64) -> String {
        format!("{}: row {row}", self.path.display())
    }
    /// What an array declares is not yet there.
    fn rows(&self) -> Option<u64> {
        None
    }
    fn rate(&self) -> Option<(String, f64)> {
        self.rate.clone()
    }
    fn select(&mut self, time: Option<usize>, axes: &[usize], beside: Option<usize>) {
        self.time = time;
        self.axes = axes.iter().copied().chain(beside).collect();
        self.loaded = None;
    }
    fn rewind(&mut self) -> Result<(), InputError> {
        self.account.renew();
        self.next = 0;
        Ok(())
    }
    fn origin(&self) -> f64 {
        self.loaded.as_ref().map_or(0.0, |loaded| loaded.origin.0 as f64 + loaded.origin.1)
    }
    fn next_rows(&mut self, rows: &mut Rows) -> Result<bool, InputError> {
        rows.clear(self.axes.len());
        if self.loaded.is_none() {
            self.loaded = Some(self.load()?);
        }
        let Some(loaded) = &self.loaded else { return Ok(false) };
        let end = (self.next + BLOCK).min(self.topic.rows.unwrap_or(0) as usize);
        let range = self.next..end;
        self.next = end;
        for (out, column) in rows.values.iter_mut().zip(&loaded.values) {
            out.extend_from_slice(&column[range.clone()]);
        }
        if self.time.is_some() {
            rows.time.extend_from_slice(&loaded.time[range.clone()]);
        }
        rows.lines.extend(range.clone().map(|row| row as u64 + 1));
        Ok(!range.is_empty())
    }
}
