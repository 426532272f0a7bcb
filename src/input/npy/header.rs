//! The header of an npy file: magic, version, and a Python dictionary with `descr`, `fortran_order` and `shape`.

use std::io::{Read, Seek, SeekFrom};

use super::super::account::{Account, Excess, deeper};
use super::super::number::{Kind, Number};
use super::MOST_COLUMNS;
use crate::units::plain;

/// Longer headers are damage or an attack.
const LONGEST: u64 = 1 << 20;

/// One field of a structured array, or the only one of a plain array.
#[derive(Clone, Debug)]
pub(super) struct Field {
    pub(super) name: String,
    pub(super) number: Number,
    pub(super) offset: u64,
    /// From `datetime64[ns]`.
    pub(super) time_unit: Option<&'static str>,
}

#[derive(Clone, Debug)]
pub(super) struct Header {
    pub(super) fields: Vec<Field>,
    /// True for a structured array.
    pub(super) named: bool,
    pub(super) item_size: u64,
    pub(super) fortran_order: bool,
    pub(super) shape: Vec<u64>,
    pub(super) data_start: u64,
}

impl Header {
    /// Reads the header of a file of this length.
    pub(super) fn read(file: &mut (impl Read + Seek), length: u64, account: &Account) -> Result<Header, String> {
        let cut = |_| "truncated: the header is incomplete".to_string();
        let mut start = [0u8; 8];
        let known = start.len().min(length as usize);
        file.read_exact(&mut start[..known]).map_err(cut)?;
        match start {
            [0x93, b'N', b'U', b'M', b'P', b'Y', ..] => {}
            [b'P', b'K', 3, 4, ..] => return Err("this is an npz archive; save one array with numpy.save".into()),
            [0x80, 2..=5, ..] => {
                return Err(
                    "this is a Python pickle, not an npy array; it is not read, because reading it runs code".into()
                );
            }
            _ => return Err("this is no npy file (it does not begin with \\x93NUMPY)".into()),
        }
        let (size_bytes, major) = match start[6] {
            1 => (2, 1),
            major @ 2..=3 => (4, major),
            major => return Err(format!("npy version {major} is not known; 1 to 3 are")),
        };
        let mut size = [0u8; 4];
        file.read_exact(&mut size[..size_bytes]).map_err(cut)?;
        let size = u64::from(u32::from_le_bytes(size));
        let data_start = 8 + size_bytes as u64 + size;
        if size > LONGEST || data_start > length {
            return Err(format!("truncated or damaged: a header of {size} bytes is declared"));
        }
        let mut bytes = vec![0u8; size as usize];
        file.read_exact(&mut bytes).map_err(cut)?;
        file.seek(SeekFrom::Start(data_start)).map_err(cut)?;
        let text = if major == 3 {
            String::from_utf8_lossy(&bytes).into_owned()
        } else {
            bytes.iter().map(|b| char::from(*b)).collect() // Latin-1
        };
        parse(&text, data_start, account)
    }
}

fn parse(text: &str, data_start: u64, account: &Account) -> Result<Header, String> {
    let damaged = || "damaged: the header is not the dictionary that NumPy writes".to_string();
    let mut parser = Parser { rest: text, account, excess: None };
    let parsed = parser.literal(0);
    if let Some(excess) = parser.excess {
        return Err(excess.into());
    }
    let Some(Literal::Dict(entries)) = parsed else { return Err(damaged()) };
    let entry = |key: &str| entries.iter().find(|(k, _)| k == key).map(|(_, v)| v);
    let (Some(descr), Some(Literal::Bool(fortran_order)), Some(Literal::List(shape))) =
        (entry("descr"), entry("fortran_order"), entry("shape"))
    else {
        return Err(damaged());
    };
    let shape: Option<Vec<u64>> = shape
        .iter()
        .map(|n| match n {
            Literal::Int(n) => Some(u64::try_from(*n).unwrap_or(u64::MAX)),
            _ => None,
        })
        .collect();
    let shape = shape.ok_or_else(damaged)?;
    let mut fields = Vec::new();
    let mut item_size = 0u64;
    let named = matches!(descr, Literal::List(_));
    match descr {
        Literal::Str(dtype) => item_size = add_field(&mut fields, 0, "", dtype)?,
        Literal::List(list) => {
            for item in list {
                let Literal::List(item) = item else { return Err(damaged()) };
                let name = match item.first() {
                    Some(Literal::Str(name)) => name,
                    // (title, name)
                    Some(Literal::List(pair)) => match pair.get(1) {
                        Some(Literal::Str(name)) => name,
                        _ => return Err(damaged()),
                    },
                    _ => return Err(damaged()),
                };
                let dtype = match item.get(1) {
                    Some(Literal::Str(dtype)) => dtype,
                    Some(_) => return Err(format!("field '{name}' is a structure itself; only numbers are read")),
                    None => return Err(damaged()),
                };
                let repeat = match item.get(2) {
                    None => None,
                    Some(Literal::List(sizes)) => match sizes[..] {
                        [Literal::Int(n)] => Some(n),
                        _ => return Err(format!("field '{name}' has several dimensions; one is read")),
                    },
                    Some(_) => return Err(damaged()),
                };
                if repeat.is_some_and(|n| n > MOST_COLUMNS as u128) {
                    return Err(format!("field '{name}' holds too many values in one row"));
                }
                for i in 0..repeat.unwrap_or(1) {
                    let name = if repeat.is_some() { format!("{name}[{i}]") } else { name.clone() };
                    account.columns(1, name.len())?;
                    item_size += add_field(&mut fields, item_size, &name, dtype)?;
                }
            }
        }
        _ => return Err(damaged()),
    }
    Ok(Header { fields, named, item_size, fortran_order: *fortran_order, shape, data_start })
}

/// Adds a column of numbers; text and padding are passed over. Returns its size in bytes.
fn add_field(fields: &mut Vec<Field>, offset: u64, name: &str, dtype: &str) -> Result<u64, String> {
    let of = if name.is_empty() { "the array".to_string() } else { format!("field '{name}'") };
    let not_read = || format!("{of} has dtype '{dtype}', which is not read; floats (f2, f4, f8) and integers are");
    let (big_endian, code) = match dtype.split_at_checked(1) {
        Some(("<" | "|" | "=", code)) => (false, code),
        Some((">", code)) => (true, code),
        _ => (false, dtype),
    };
    if code.starts_with('O') {
        return Err(format!(
            "{of} holds Python objects (a pickle): it is not read, because reading it runs code; save numbers, for \
             example with astype(float)"
        ));
    }
    let (letter, size) = code.split_at_checked(1).ok_or_else(not_read)?;
    let (size, unit) = size.split_once('[').map_or((size, None), |(size, unit)| (size, unit.strip_suffix(']')));
    let size: u64 = size.parse().ok().filter(|n| *n < 1 << 20).ok_or_else(not_read)?;
    let mut time_unit = None;
    let kind = match (letter, size) {
        ("f", 2 | 4 | 8) => Kind::Float(size as u8),
        ("i", 1 | 2 | 4 | 8) => Kind::Signed(size as u8),
        ("u", 1 | 2 | 4 | 8) | ("b", 1) => Kind::Unsigned(size as u8),
        ("M" | "m", 8) => {
            time_unit = ["s", "ms", "us", "ns"].into_iter().find(|u| unit == Some(u));
            if time_unit.is_none() {
                return Err(not_read());
            }
            Kind::Time
        }
        // text or padding beside the numbers
        ("V" | "S" | "a", _) if !name.is_empty() || letter == "V" => return Ok(size),
        ("U", _) if !name.is_empty() => return Ok(4 * size),
        _ => return Err(not_read()),
    };
    fields.push(Field { name: name.to_string(), number: Number { kind, big_endian }, offset, time_unit });
    Ok(size)
}

/// What a Python literal can be here; tuples and lists are the same.
#[derive(Clone, Debug)]
enum Literal {
    Str(String),
    Int(u128),
    Bool(bool),
    List(Vec<Literal>),
    Dict(Vec<(String, Literal)>),
}

struct Parser<'a> {
    rest: &'a str,
    account: &'a Account,
    excess: Option<Excess>,
}

impl Parser<'_> {
    fn skip(&mut self, token: char) -> bool {
        self.rest = self.rest.trim_start();
        match self.rest.strip_prefix(token) {
            Some(rest) => {
                self.rest = rest;
                true
            }
            None => false,
        }
    }

    /// `None` for anything else than the literals above.
    fn literal(&mut self, depth: usize) -> Option<Literal> {
        self.rest = self.rest.trim_start();
        let first = self.rest.chars().next()?;
        // with the list that it is in, which grows by doubling
        match deeper(depth).and_then(|_| self.account.hold(4 * size_of::<Literal>() as u64)) {
            Ok(()) => {}
            Err(excess) => {
                self.excess = Some(excess);
                return None;
            }
        }
        match first {
            '\'' | '"' => self.string(first).map(Literal::Str),
            '[' | '(' => {
                self.rest = &self.rest[1..];
                let close = if first == '[' { ']' } else { ')' };
                let mut items = Vec::new();
                while !self.skip(close) {
                    items.push(self.literal(depth + 1)?);
                    if !self.skip(',') && !self.rest.trim_start().starts_with(close) {
                        return None;
                    }
                }
                Some(Literal::List(items))
            }
            '{' => {
                self.rest = &self.rest[1..];
                let mut entries = Vec::new();
                while !self.skip('}') {
                    let Literal::Str(key) = self.literal(depth + 1)? else { return None };
                    if !self.skip(':') {
                        return None;
                    }
                    entries.push((key, self.literal(depth + 1)?));
                    if !self.skip(',') && !self.rest.trim_start().starts_with('}') {
                        return None;
                    }
                }
                Some(Literal::Dict(entries))
            }
            '0'..='9' => {
                let end = self.rest.find(|c: char| !c.is_ascii_digit()).unwrap_or(self.rest.len());
                let digits = self.rest[..end].parse().unwrap_or(u128::MAX);
                self.rest = self.rest[end..].strip_prefix('L').unwrap_or(&self.rest[end..]);
                Some(Literal::Int(digits))
            }
            _ => {
                for (word, value) in [("True", true), ("False", false)] {
                    if let Some(rest) = self.rest.strip_prefix(word) {
                        self.rest = rest;
                        return Some(Literal::Bool(value));
                    }
                }
                None
            }
        }
    }

    fn string(&mut self, quote: char) -> Option<String> {
        let mut out = String::new();
        let mut chars = self.rest.char_indices().skip(1);
        while let Some((i, c)) = chars.next() {
            match c {
                '\\' => match chars.next()?.1 {
                    'n' => out.push('\n'),
                    'r' => out.push('\r'),
                    't' => out.push('\t'),
                    digits @ ('x' | 'u') => {
                        let mut code = 0;
                        for _ in 0..if digits == 'x' { 2 } else { 4 } {
                            code = code * 16 + chars.next()?.1.to_digit(16)?;
                        }
                        out.push(char::from_u32(code)?);
                    }
                    other => out.push(other),
                },
                c if c == quote => {
                    self.rest = &self.rest[i + 1..];
                    // names and types stand in messages of one line
                    return Some(plain(&out).into_owned());
                }
                c => out.push(c),
            }
        }
        None
    }
}
