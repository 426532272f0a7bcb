//! The front door: what a file is by its content, the tables in it, and which of them is meant.

use std::fs::File;
use std::io::Read;
use std::path::{Path, PathBuf};

use super::account::Account;
use super::names::Head;
use super::table::{Source, Topic};
use super::{
    InputError, LogOptions, Table, arrays, columns, dataflash, hdf5, mat, mcap, memory, npy, parquet, ros, rosbag,
    sqlite, text, ulog,
};
use crate::numerics::progress::lent;
use crate::units::Quantity;

/// A file with one table.
struct Single {
    format: &'static str,
    topic: [Topic; 1],
    /// Until it is handed out.
    table: Option<Box<dyn Table + Send>>,
}

impl Single {
    fn new(format: &'static str, table: Box<dyn Table + Send>) -> Single {
        let heads = table.heads().into_iter().cloned().collect();
        let (named, rows) = (table.named(), table.rows());
        let topic = Topic { named, rows, ..Topic::new(String::new(), heads) };
        Single { format, topic: [topic], table: Some(table) }
    }
}

impl Source for Single {
    fn format(&self) -> &'static str {
        self.format
    }
    fn topics(&self) -> &[Topic] {
        &self.topic
    }
    fn table(&mut self, _: usize) -> Result<Box<dyn Table + Send>, InputError> {
        self.table.take().ok_or_else(|| InputError::new("its only table is being read"))
    }
}

/// The file of a log: itself, or the one in a folder of the EuRoC (ASL) layout or of a ROS 2 bag.
pub(super) fn resolve(path: &Path) -> Result<PathBuf, InputError> {
    let fail = |what: String| Err(InputError::new(format!("{}: {what}", path.display())));
    if lent(path).is_some() {
        return Ok(path.to_path_buf());
    }
    match std::fs::metadata(path) {
        // not what comes down a pipe
        Err(_) if path == Path::new("-") => {
            return fail("a log is read more than once: save it to a file first".into());
        }
        Err(error) if error.kind() == std::io::ErrorKind::NotFound => return fail("there is no such file".into()),
        Err(error) => return fail(format!("cannot read: {error}")),
        Ok(found) if found.is_file() => return Ok(path.to_path_buf()),
        Ok(found) if found.is_dir() => {}
        Ok(_) => return fail("a log is read more than once: save it to a file first".into()),
    }
    for inside in ["mav0/imu0/data.csv", "imu0/data.csv", "data.csv"] {
        if path.join(inside).is_file() {
            return Ok(path.join(inside));
        }
    }
    let files = std::fs::read_dir(path).into_iter().flatten().flatten().map(|entry| entry.path());
    let mut bags: Vec<PathBuf> =
        files.filter(|file| file.extension().is_some_and(|e| e == "db3" || e == "mcap")).collect();
    bags.sort();
    match &mut bags[..] {
        [] => fail("this is a folder, not a log; it has no data.csv (EuRoC) and no .db3 or .mcap (ROS 2 bag)".into()),
        [bag] => Ok(std::mem::take(bag)),
        bags => {
            let names: Vec<String> = bags.iter().map(|bag| bag.display().to_string()).collect();
            fail(format!("a bag of several files; give one: {}", names.join(", ")))
        }
    }
}

/// Opens a log of any format.
pub(super) fn open(path: &Path) -> Result<Box<dyn Source>, InputError> {
    let fail = |what: String| Err(InputError::new(format!("{}: {what}", path.display())));
    if let Some(samples) = lent(path) {
        return Ok(Box::new(Single::new("array", Box::new(memory::MemoryTable::new(path, samples)))));
    }
    let mut start = Vec::new();
    let opened = File::open(path).and_then(|file| {
        let length = file.metadata()?.len();
        file.take(4096).read_to_end(&mut start).map(|_| length)
    });
    let account = match opened {
        Ok(length) => &Account::new(length),
        Err(error) => return fail(format!("cannot read: {error}")),
    };
    let npy = path.extension().is_some_and(|e| e.eq_ignore_ascii_case("npy"));
    if npy || start.starts_with(b"\x93NUMPY") {
        return Ok(Box::new(Single::new("NumPy array", Box::new(npy::NpyTable::open(path, account)?))));
    }
    // a file may have a block of its user's before the signature: MATLAB 7.3 has 512 bytes of text
    if [0, 512, 1024, 2048].iter().any(|&at| start.get(at..).is_some_and(|rest| rest.starts_with(hdf5::SIGNATURE))) {
        return Ok(Box::new(arrays::ArraySource::new(path, Box::new(hdf5::Hdf5::open(path, account)?), account)?));
    }
    if start.starts_with(mat::SIGNATURE) {
        return Ok(Box::new(arrays::ArraySource::new(path, Box::new(mat::Mat::open(path, account)?), account)?));
    }
    let is = |signature: &[u8]| start.starts_with(signature);
    if is(ulog::SIGNATURE) {
        return Ok(Box::new(ulog::open(path, account)?));
    }
    if is(dataflash::SIGNATURE) {
        return Ok(Box::new(dataflash::open(path, account)?));
    }
    if is(parquet::SIGNATURE) || is(parquet::ENCRYPTED) {
        return Ok(Box::new(Single::new("Parquet", Box::new(parquet::ParquetTable::open(path, account)?))));
    }
    if is(rosbag::SIGNATURE) {
        return Ok(Box::new(ros::open::<rosbag::Rosbag>(path, account)?));
    }
    if is(mcap::SIGNATURE) {
        return Ok(Box::new(ros::open::<mcap::Mcap>(path, account)?));
    }
    if is(sqlite::SIGNATURE) {
        return Ok(Box::new(ros::open::<sqlite::Database>(path, account)?));
    }
    Ok(Box::new(Single::new("text", Box::new(text::TextTable::open(path, account)?))))
}

/// The table that is meant, and a sentence on which it is where others could be.
pub(super) fn choose(
    path: &Path,
    mut source: Box<dyn Source>,
    options: &LogOptions,
) -> Result<(Box<dyn Table + Send>, Option<String>), InputError> {
    let fail = |what: String| Err(InputError::new(format!("{}: {what}", path.display())));
    let topics = source.topics();
    if let Some(wanted) = &options.topic {
        let lower = wanted.trim().to_lowercase();
        let is = |name: &String| *name == lower || name.strip_suffix(":0").is_some_and(|stem| stem == lower);
        let named =
            |topic: &Topic| [&topic.name].into_iter().chain(&topic.aliases).any(|name| is(&name.to_lowercase()));
        let found = topics.iter().position(named);
        return match found {
            Some(at) if topics[at].heads.is_empty() => {
                let (name, kind) = (&topics[at].name, &topics[at].kind);
                if topics[at].object {
                    return fail(format!("{name} is {}", topics[at].unread_object()));
                }
                fail(format!("topic {name} has messages of the type '{kind}', which are not read; sensor_msgs/Imu are"))
            }
            Some(topic) => Ok((source.table(topic)?, None)),
            None if topics.len() == 1 && topics[0].name.is_empty() => {
                fail(format!("`topic` {wanted}: this is {} with one table; drop the flag", source.format()))
            }
            None => fail(format!("no topic '{wanted}'; {}", there_are(topics))),
        };
    }
    let mut readable = (0..topics.len()).filter(|&i| !topics[i].heads.is_empty());
    if let (Some(only), None) = (readable.next(), readable.next()) {
        return Ok((source.table(only)?, None));
    }
    let quantities: &[Quantity] = match options.sought() {
        Some(Quantity::AngularRate) => &[Quantity::AngularRate],
        Some(Quantity::SpecificForce) => &[Quantity::SpecificForce],
        None => &[Quantity::AngularRate, Quantity::SpecificForce],
    };
    for quantity in quantities {
        let has = |topic: &Topic| {
            let heads: Vec<&Head> = topic.heads.iter().collect();
            let table = columns::Table { heads: &heads, named: topic.named, place: "", rate_hz: None };
            match &options.columns {
                Some(list) => list.iter().all(|name| name.parse::<usize>().is_err() && table.find(name).is_ok()),
                None => table.has(*quantity, options),
            }
        };
        let mut hits: Vec<usize> = (0..topics.len()).filter(|&i| has(&topics[i])).collect();
        // of equals the one that stands first
        hits.sort_by_key(|&i| std::cmp::Reverse((topics[i].rank, topics[i].rows)));
        if let Some((&taken, others)) = hits.split_first() {
            let name = |i: usize| match topics[i].rows {
                Some(rows) => format!("{} ({rows} rows)", topics[i].name),
                None => topics[i].name.clone(),
            };
            let others: Vec<String> = others.iter().map(|&i| name(i)).collect();
            let note = (!others.is_empty())
                .then(|| format!("topic {} is read; `topic` chooses another: {}", name(taken), others.join(", ")));
            return Ok((source.table(taken)?, note));
        }
    }
    let wanted = match (&options.columns, quantities) {
        (Some(list), _) => format!("no topic has the columns {}", list.join(",")),
        (None, [Quantity::AngularRate]) => "no topic has a gyro known by its name or unit".into(),
        (None, [Quantity::SpecificForce]) => "no topic has an accelerometer known by its name or unit".into(),
        _ => "no topic has a gyro or an accelerometer known by its name or unit".into(),
    };
    fail(format!("{wanted}; choose with `topic` and `columns`; {}", there_are(topics)))
}

/// `there are imu (100 rows: time gyro_x gyro_y), …`, those with a sensor first; columns only where the list stays
/// short.
fn there_are(topics: &[Topic]) -> String {
    const MOST: usize = 40;
    const WITH_COLUMNS: usize = 6;
    let columns = |topic: &Topic| {
        let names: Vec<&str> = topic.heads.iter().take(12).map(|head| head.full.as_str()).collect();
        format!(": {}{}", names.join(" "), if topic.heads.len() > names.len() { " …" } else { "" })
    };
    let one = |topic: &Topic| {
        let rows = topic.rows.unwrap_or(0);
        match (topic.heads.is_empty(), topics.len() <= WITH_COLUMNS) {
            (true, _) if topic.object => format!("{} ({}, an object)", topic.name, topic.kind),
            (true, _) => format!("{} ({rows} {})", topic.name, topic.kind),
            (false, true) => format!("{} ({rows} rows{})", topic.name, columns(topic)),
            (false, false) => format!("{} ({rows} rows)", topic.name),
        }
    };
    let mut order: Vec<&Topic> = topics.iter().collect();
    order.sort_by_key(|topic| std::cmp::Reverse(topic.rank));
    let mut list: Vec<String> = order.into_iter().take(MOST).map(one).collect();
    if topics.len() > MOST {
        list.push(format!("… {} in all (kfdesign info lists them)", topics.len()));
    }
    format!("there are {}", list.join(", "))
}
