//! ROS 2 bags in a database (`.db3`): the tables `topics` and `messages`, read straight from the pages.
//!
//! Format: <https://www.sqlite.org/fileformat2.html>, tables only. What a write-ahead log beside the file holds is
//! not read.

use std::collections::BTreeMap;
use std::fs::File;
use std::io::{Read, Seek, SeekFrom};
use std::path::Path;

use super::account::{Account, DEEPEST, Excess, Fault, JUMP, STEP};
use super::bytes::{Bytes, Short, printable};
use super::ros::{Bag, Channel, Encoding, keep};

pub(super) const SIGNATURE: &[u8] = b"SQLite format 3\0";

/// A row of the tables of a bag has fewer columns.
const MOST_VALUES: usize = 32;
const LEAF: u8 = 13;
const INTERIOR: u8 = 5;

pub(super) struct Database {
    pages: Pages,
    channels: BTreeMap<u32, Channel>,
    /// First page of the messages.
    root: u32,
    walk: Walk,
    message: Vec<u8>,
}

struct Pages {
    file: File,
    size: usize,
    /// Bytes of a page that hold content.
    usable: usize,
    count: u32,
    /// A tree that leads back to itself ends here.
    account: Account,
    damaged: u64,
}

/// A place in a tree: pages from the root down.
#[derive(Default)]
struct Walk {
    stack: Vec<Place>,
}

struct Place {
    number: u32,
    page: Vec<u8>,
    /// The next cell.
    cell: usize,
    /// Bytes that cells may still have: they do not overlap, also where damaged pointers say so.
    left: usize,
}

/// One value of a row.
enum Value {
    Number(i64),
    Bytes(Vec<u8>),
    None,
}

fn big(bytes: &[u8]) -> u64 {
    bytes.iter().fold(0, |sum, byte| sum << 8 | u64::from(*byte))
}

fn varint(bytes: &mut Bytes) -> Result<u64, Short> {
    let mut value = 0u64;
    for i in 0..9 {
        let byte = bytes.u8()?;
        if i == 8 {
            return Ok(value << 8 | u64::from(byte));
        }
        value = value << 7 | u64::from(byte & 0x7f);
        if byte & 0x80 == 0 {
            break;
        }
    }
    Ok(value)
}

impl Pages {
    fn page(&mut self, number: u32) -> Result<Vec<u8>, Fault> {
        if number == 0 || number > self.count {
            return Err(Fault::Short);
        }
        self.account.work(JUMP + self.size as u64)?;
        let mut page = vec![0; self.size];
        let at = SeekFrom::Start(u64::from(number - 1) * self.size as u64);
        self.file.seek(at).and_then(|_| self.file.read_exact(&mut page)).map_err(|_| Short)?;
        Ok(page)
    }

    /// Content of a cell of a leaf: the number of its row, and the row. `left`: bytes that cells of this page may
    /// still have.
    fn cell(&mut self, page: &[u8], at: usize, left: &mut usize) -> Result<(u64, Vec<u8>), Fault> {
        self.account.work(STEP)?;
        let mut bytes = Bytes(page.get(at..).ok_or(Short)?);
        let size = varint(&mut bytes)?;
        let row = varint(&mut bytes)?;
        if size > u64::from(self.count) * self.size as u64 {
            return Err(Fault::Short);
        }
        // as it lies in the pages, grown by doubling, and what of it is kept
        self.account.room(size.saturating_mul(3))?;
        let (size, usable) = (size as usize, self.usable);
        let most = usable - 35;
        let least = (usable - 12) * 32 / 255 - 23;
        let here = match size {
            _ if size <= most => size,
            _ => Some(least + (size - least) % (usable - 4)).filter(|n| *n <= most).unwrap_or(least),
        };
        *left = left.checked_sub(here).ok_or(Short)?;
        let mut content = bytes.take(here)?.to_vec();
        if here < size {
            let mut next = big(bytes.take(4)?) as u32;
            while content.len() < size {
                let page = self.page(next)?;
                next = big(&page[..4]) as u32;
                let part = (size - content.len()).min(usable - 4);
                content.extend_from_slice(&page[4..4 + part]);
            }
        }
        Ok((row, content))
    }

    /// The next row of a table.
    fn next(&mut self, walk: &mut Walk) -> Result<Option<(u64, Vec<u8>)>, Excess> {
        while let Some(Place { number, page, cell, left }) = walk.stack.last_mut() {
            let start = if *number == 1 { 100 } else { 0 };
            let (kind, count) = (page[start], big(&page[start + 3..start + 5]) as usize);
            let pointers = start + if kind == INTERIOR { 12 } else { 8 };
            let index = *cell;
            *cell += 1;
            let place = page.get(pointers + 2 * index..pointers + 2 * index + 2).map(|two| big(two) as usize);
            let child = match (kind, place) {
                (LEAF, Some(at)) if index < count => {
                    match self.cell(page, at, left) {
                        Ok(found) => return Ok(Some(found)),
                        Err(Fault::Short) => self.damaged += 1,
                        Err(Fault::Excess(excess)) => return Err(excess),
                    }
                    continue;
                }
                (INTERIOR, Some(at)) if index < count => page.get(at..at + 4).map(big),
                (INTERIOR, _) if index == count => Some(big(&page[start + 8..start + 12])),
                (LEAF | INTERIOR, _) => {
                    walk.stack.pop();
                    continue;
                }
                _ => {
                    self.damaged += 1;
                    walk.stack.pop();
                    continue;
                }
            };
            match child.and_then(|child| u32::try_from(child).ok()) {
                Some(child) if walk.stack.len() < DEEPEST => self.enter(walk, child)?,
                _ => self.damaged += 1,
            }
        }
        Ok(None)
    }

    fn enter(&mut self, walk: &mut Walk, page: u32) -> Result<(), Excess> {
        match self.page(page) {
            Ok(content) => walk.stack.push(Place { number: page, page: content, cell: 0, left: self.usable }),
            Err(Fault::Short) => self.damaged += 1,
            Err(Fault::Excess(excess)) => return Err(excess),
        }
        Ok(())
    }

    /// All rows of a small table.
    fn all(&mut self, root: u32) -> Result<Vec<(u64, Vec<Value>)>, Excess> {
        const MOST: usize = 10_000;
        let mut walk = Walk::default();
        self.enter(&mut walk, root)?;
        let mut rows = Vec::new();
        while let Some((row, content)) = self.next(&mut walk)? {
            self.account.hold((MOST_VALUES * size_of::<Value>() + content.len()) as u64)?;
            rows.extend(values(&content).ok().map(|values| (row, values)));
            if rows.len() == MOST {
                break;
            }
        }
        Ok(rows)
    }
}

/// The values of a row.
fn values(content: &[u8]) -> Result<Vec<Value>, Short> {
    let mut whole = Bytes(content);
    let size = varint(&mut whole)? as usize;
    let mut header = Bytes(content.get(content.len() - whole.0.len()..size).ok_or(Short)?);
    let mut body = Bytes(content.get(size..).ok_or(Short)?);
    let mut values = Vec::new();
    while !header.0.is_empty() {
        if values.len() == MOST_VALUES {
            return Err(Short);
        }
        let mut number = |size: usize| {
            let unused = 64 - 8 * size as u32;
            body.take(size).map(|bytes| Value::Number(((big(bytes) << unused) as i64) >> unused))
        };
        values.push(match varint(&mut header)? {
            0 => Value::None,
            size @ 1..=4 => number(size as usize)?,
            5 => number(6)?,
            6 => number(8)?,
            7 => {
                body.take(8)?;
                Value::None
            }
            constant @ 8..=9 => Value::Number(constant as i64 - 8),
            code => Value::Bytes(body.take(usize::try_from(code.saturating_sub(12) / 2).map_err(|_| Short)?)?.to_vec()),
        });
    }
    Ok(values)
}

fn text(value: Option<&Value>) -> String {
    match value {
        Some(Value::Bytes(bytes)) => printable(bytes),
        _ => String::new(),
    }
}

impl Bag for Database {
    const FORMAT: &'static str = "ROS 2 bag (sqlite)";

    fn open(path: &Path, account: &Account) -> Result<Self, String> {
        let io = |error: std::io::Error| format!("cannot read: {error}");
        let mut file = File::open(path).map_err(io)?;
        let length = file.metadata().map_err(io)?.len();
        let mut head = [0; 100];
        file.read_exact(&mut head).map_err(|_| "truncated: the header is incomplete")?;
        let size = match big(&head[16..18]) as usize {
            1 => 65536,
            size => size,
        };
        let usable = size.saturating_sub(usize::from(head[20]));
        if !size.is_power_of_two() || size < 512 || usable < 480 {
            return Err(format!("damaged: pages of {size} bytes"));
        }
        let count = (length / size as u64).min(u64::from(u32::MAX)) as u32;
        let mut pages = Pages { file, size, usable, count, account: account.clone(), damaged: 0 };
        // the table of tables: type, name, table, first page, and how it was made
        let (mut topics, mut root, mut names) = (0, 0, Vec::new());
        for (_, row) in pages.all(1)? {
            let (name, page) = (text(row.get(1)), row.get(3));
            if text(row.first()) != "table" {
                continue;
            }
            match (name.as_str(), page) {
                ("topics", Some(Value::Number(page))) => topics = *page as u32,
                ("messages", Some(Value::Number(page))) => root = *page as u32,
                _ => {}
            }
            names.push(name);
        }
        if topics == 0 || root == 0 {
            let tables = if names.is_empty() { "none".into() } else { names.join(", ") };
            return Err(format!(
                "this is a database, but no ROS 2 bag: no tables 'topics' and 'messages'; there are {tables}"
            ));
        }
        let mut channels = BTreeMap::new();
        for (number, row) in pages.all(topics)? {
            let encoding = if text(row.get(3)) == "cdr" { Encoding::Cdr } else { Encoding::Other };
            let channel = Channel { topic: text(row.get(1)), kind: text(row.get(2)), encoding };
            keep(&mut channels, number as u32, channel, account)?;
        }
        let mut database = Database { pages, channels, root, walk: Walk::default(), message: Vec::new() };
        database.rewind()?;
        Ok(database)
    }
    fn rewind(&mut self) -> Result<(), String> {
        self.walk.stack.clear();
        self.pages.damaged = 0;
        Ok(self.pages.enter(&mut self.walk, self.root)?)
    }
    fn next(&mut self) -> Result<Option<(u32, u64)>, String> {
        while let Some((_, content)) = self.pages.next(&mut self.walk)? {
            // number, topic, time, message
            let Ok(mut row) = values(&content) else {
                self.pages.damaged += 1;
                continue;
            };
            let (Some(Value::Bytes(message)), Some(Value::Number(time)), Some(Value::Number(topic))) =
                (row.pop().filter(|_| row.len() == 3), row.pop(), row.pop())
            else {
                self.pages.damaged += 1;
                continue;
            };
            self.message = message;
            return Ok(Some((topic as u32, time as u64)));
        }
        Ok(None)
    }
    fn message(&self) -> &[u8] {
        &self.message
    }
    fn channel(&self, number: u32) -> Option<&Channel> {
        self.channels.get(&number)
    }
    fn damage(&self) -> Option<String> {
        let count = self.pages.damaged;
        (count > 0).then(|| format!("damaged: {count} rows or pages of the database cannot be read and are left out"))
    }
}
