//! MATLAB files of level 5 (`save -v6`, `-v7`): numeric arrays, also inside structures.
//!
//! Format: MathWorks, "MAT-File Format", chapter 1. Opening inflates no more of a variable than its name and shape;
//! numbers are read when they are selected, straight into the columns. Cells, text, sparse and complex matrices are
//! passed over, objects named.

use std::fs::File;
use std::io::{self, BufReader, Read, Seek, SeekFrom};
use std::path::{Path, PathBuf};

use flate2::bufread::ZlibDecoder;

use super::InputError;
use super::account::{Account, Excess, LONGEST_NAME, Metered, STEP, deeper};
use super::arrays::{Array, ArrayFile, Put};
use super::bytes::printable;
use super::number::{Kind, Number};

pub(super) const SIGNATURE: &[u8] = b"MATLAB 5.0 MAT-file";

const HEADER: u64 = 128;
const MATRIX: u32 = 14;
const COMPRESSED: u32 = 15;
const MOST_ARRAYS: usize = 10_000;
/// Names of the fields of a structure, all together: a thousand and more of the longest.
const MOST_NAMES: u32 = 1 << 16;

pub(super) struct Mat {
    path: PathBuf,
    account: Account,
    arrays: Vec<Array>,
    /// Per array: its variable, and how many arrays of the variable come before it.
    places: Vec<(Variable, usize)>,
    scalars: Vec<(String, f64)>,
    objects: Vec<(String, String)>,
    big_endian: bool,
}

#[derive(Clone, Copy, Debug)]
struct Variable {
    start: u64,
    size: u32,
    compressed: bool,
}

/// One array as it is met: rows and columns, how its numbers are stored, and the numbers.
struct Met<'a> {
    path: &'a str,
    rows: u64,
    columns: u64,
    number: Number,
    numbers: &'a mut dyn Read,
}

type Visit<'a> = dyn FnMut(Met) -> io::Result<()> + 'a;

fn bad(what: &str) -> io::Error {
    io::Error::new(io::ErrorKind::InvalidData, what)
}

impl Mat {
    pub(super) fn open(path: &Path, account: &Account) -> Result<Mat, InputError> {
        let (arrays, places, scalars, objects) = (Vec::new(), Vec::new(), Vec::new(), Vec::new());
        let (path, account) = (path.to_path_buf(), account.clone());
        let mut mat = Mat { path, account, arrays, places, scalars, objects, big_endian: false };
        match mat.index() {
            Ok(()) => Ok(mat),
            Err(error) => mat.fail(&error),
        }
    }

    fn fail<T>(&self, error: &io::Error) -> Result<T, InputError> {
        let what = match error.kind() {
            _ if error.get_ref().is_some_and(|inner| inner.is::<Excess>()) => error.to_string(),
            io::ErrorKind::UnexpectedEof => "truncated: the file ends inside a variable".into(),
            io::ErrorKind::InvalidData | io::ErrorKind::InvalidInput => format!("damaged: {error}"),
            _ => format!("cannot read: {error}"),
        };
        Err(InputError::new(format!("{}: {what}", self.path.display())))
    }

    /// Finds all variables.
    fn index(&mut self) -> io::Result<()> {
        let mut file = BufReader::new(File::open(&self.path)?);
        let length = file.get_ref().metadata()?.len();
        let mut header = [0; HEADER as usize];
        file.read_exact(&mut header)?;
        self.big_endian = match &header[126..] {
            b"IM" => false,
            b"MI" => true,
            _ => return Err(bad("the header does not say the byte order")),
        };
        // what objects are made of is kept in a variable of its own, which is none
        let mut subsystem: [u8; 8] = header[116..124].try_into().unwrap_or_default();
        if self.big_endian {
            subsystem.reverse();
        }
        let subsystem = u64::from_le_bytes(subsystem);
        let (mut at, mut read) = (HEADER, HEADER);
        while at < length {
            self.account.work(STEP)?;
            // what is in the buffer stays there
            file.seek_relative((at - read) as i64)?;
            read = at + 8;
            let (kind, size) = (self.word(&mut file)?, self.word(&mut file)?);
            let variable = Variable { start: at + 8, size, compressed: kind == COMPRESSED };
            at += 8 + u64::from(size);
            if at > length {
                return Err(io::ErrorKind::UnexpectedEof.into());
            }
            if (kind == MATRIX || kind == COMPRESSED) && variable.start - 8 != subsystem {
                let (arrays, places, scalars) = (&mut self.arrays, &mut self.places, &mut self.scalars);
                let mut count = 0;
                let account = &self.account;
                let objects = walk(&mut file, account, variable, self.big_endian, &mut |met| {
                    if met.rows.checked_mul(met.columns) == Some(1) {
                        let mut bytes = [0; 8];
                        met.numbers.read_exact(&mut bytes[..met.number.size()])?;
                        let (whole, part) = met.number.decode(&bytes);
                        account.name(met.path.len())?;
                        scalars.push((met.path.to_string(), whole as f64 + part));
                    }
                    if arrays.len() == MOST_ARRAYS {
                        return Err(bad("more than 10,000 arrays"));
                    }
                    account.name(met.path.len())?;
                    account.hold(2 * size_of::<(Array, Variable)>() as u64)?;
                    let (rows, columns) = (met.rows, met.columns);
                    arrays.push(Array { path: met.path.into(), rows, columns, unit: None, fields: Vec::new() });
                    places.push((variable, count));
                    count += 1;
                    Ok(())
                })?;
                self.objects.extend(objects);
                read = file.stream_position()?;
            }
        }
        Ok(())
    }

    fn word(&self, from: &mut dyn Read) -> io::Result<u32> {
        word(from, self.big_endian)
    }
}

impl ArrayFile for Mat {
    fn format(&self) -> &'static str {
        "MATLAB file"
    }
    fn arrays(&self) -> &[Array] {
        &self.arrays
    }
    fn scalars(&self) -> &[(String, f64)] {
        &self.scalars
    }
    fn objects(&self) -> &[(String, String)] {
        &self.objects
    }
    fn load(&mut self, array: usize, put: &mut Put) -> Result<(), InputError> {
        let (variable, wanted) = self.places[array];
        let (rows, account) = (self.arrays[array].rows, &self.account);
        let mut count = 0;
        let mut visit = |met: Met| {
            count += 1;
            if count - 1 != wanted {
                return Ok(());
            }
            let size = met.number.size();
            let mut buffer = vec![0; size << 12];
            let (mut index, all) = (0, met.rows * met.columns);
            while index < all {
                let numbers = (all - index).min(1 << 12);
                account.work(numbers * STEP / 8)?;
                let bytes = &mut buffer[..numbers as usize * size];
                met.numbers.read_exact(bytes)?;
                for number in bytes.chunks_exact(size) {
                    put(index % rows, index / rows, met.number.decode(number));
                    index += 1;
                }
            }
            Ok(())
        };
        let read = File::open(&self.path).and_then(|file| {
            let mut file = BufReader::new(file);
            file.seek(SeekFrom::Start(variable.start))?;
            walk(&mut file, account, variable, self.big_endian, &mut visit).map(drop)
        });
        read.or_else(|error| self.fail(&error))
    }
}

fn word(from: &mut dyn Read, big_endian: bool) -> io::Result<u32> {
    let mut bytes = [0; 4];
    from.read_exact(&mut bytes)?;
    Ok(if big_endian { u32::from_be_bytes(bytes) } else { u32::from_le_bytes(bytes) })
}

/// Visits the arrays of one variable of the file, which stands at its beginning. Returns names and classes of objects.
fn walk(
    file: &mut BufReader<File>,
    account: &Account,
    variable: Variable,
    big_endian: bool,
    visit: &mut Visit,
) -> io::Result<Vec<(String, String)>> {
    let mut walker = Walker { big_endian, account, visit, objects: Vec::new() };
    let mut stored = file.take(u64::from(variable.size));
    if !variable.compressed {
        walker.matrix(&mut stored, "", 0)?;
        return Ok(walker.objects);
    }
    let mut inflated = Metered { inner: ZlibDecoder::new(stored), account: account.clone() };
    if let (MATRIX, size) = (word(&mut inflated, big_endian)?, word(&mut inflated, big_endian)?) {
        walker.matrix(&mut (&mut inflated as &mut dyn Read).take(u64::from(size)), "", 0)?;
    }
    Ok(walker.objects)
}

struct Walker<'a> {
    big_endian: bool,
    account: &'a Account,
    visit: &'a mut Visit<'a>,
    objects: Vec<(String, String)>,
}

impl Walker<'_> {
    /// Type and size of the element that follows, and its data if they are in the tag.
    fn tag(&self, from: &mut dyn Read) -> io::Result<(u32, u32, Option<[u8; 4]>)> {
        self.account.work(STEP)?;
        let first = word(from, self.big_endian)?;
        if first >> 16 == 0 {
            return Ok((first, word(from, self.big_endian)?, None));
        }
        let mut data = [0; 4];
        from.read_exact(&mut data)?;
        match first >> 16 {
            size @ 1..=4 => Ok((first & 0xffff, size, Some(data))),
            _ => Err(bad("an element of no known form")),
        }
    }

    /// A whole element that is known to be short.
    fn short(&self, from: &mut dyn Read) -> io::Result<Vec<u8>> {
        let (_, size, inside) = self.tag(from)?;
        if let Some(data) = inside {
            return Ok(data[..size as usize].to_vec());
        }
        if size > MOST_NAMES {
            return Err(bad("a name or shape of over 64 KiB"));
        }
        let mut data = Vec::new();
        from.take(u64::from(size)).read_to_end(&mut data)?;
        let padding = (8 - size % 8) % 8;
        let mut skipped = Vec::new();
        from.take(u64::from(padding)).read_to_end(&mut skipped)?;
        if data.len() != size as usize {
            return Err(io::ErrorKind::UnexpectedEof.into());
        }
        Ok(data)
    }

    /// What is inside a matrix element. `outer`: path of the structure it is in, with what it is called there.
    fn matrix(&mut self, from: &mut dyn Read, outer: &str, depth: usize) -> io::Result<()> {
        const STRUCTURE: u8 = 2;
        const OBJECT: u8 = 17;
        let flags = self.short(from)?;
        let (class, complex) = match flags[..] {
            [class, flags, ..] if !self.big_endian => (class, flags & 8 != 0),
            [_, _, flags, class, ..] => (class, flags & 8 != 0),
            _ => return Err(bad("a matrix without flags")),
        };
        if class == OBJECT {
            // without a shape: name, the system of types ("MCOS"), class
            let parts = [self.short(from)?, self.short(from)?, self.short(from)?].map(|part| printable(&part));
            let [name, _, class] = parts;
            let name = if depth == 0 { name } else { outer.to_string() };
            self.account.name(name.len())?;
            self.account.name(class.len())?;
            self.objects.push((name, class));
            return Ok(());
        }
        let shape: Vec<u64> = self
            .short(from)?
            .chunks_exact(4)
            .map(|b| [b[0], b[1], b[2], b[3]])
            .map(|b| u64::from(if self.big_endian { u32::from_be_bytes(b) } else { u32::from_le_bytes(b) }))
            .collect();
        let name = self.short(from)?;
        if name.len() > LONGEST_NAME {
            return Err(Excess::Name(name.len()).into());
        }
        let path = if depth == 0 { printable(&name) } else { outer.to_string() };
        let [rows, columns] = shape[..] else { return Ok(()) };
        match class {
            STRUCTURE => self.structure(from, &path, rows.saturating_mul(columns), deeper(depth)?),
            6..=15 if !complex && rows > 0 && columns > 0 => self.numbers(from, &path, rows, columns),
            _ => Ok(()),
        }
    }

    fn structure(&mut self, from: &mut dyn Read, path: &str, count: u64, depth: usize) -> io::Result<()> {
        let length = self.short(from)?;
        let length = match length[..] {
            [a, b, c, d] if self.big_endian => u32::from_be_bytes([a, b, c, d]),
            [a, b, c, d] => u32::from_le_bytes([a, b, c, d]),
            _ => return Err(bad("a structure without field names")),
        };
        let names = self.short(from)?;
        for element in 1..=count.min(MOST_ARRAYS as u64) {
            for name in names.chunks(length.max(1) as usize) {
                let (kind, size, in_tag) = self.tag(from)?;
                if in_tag.is_some() {
                    continue;
                }
                let mut inside = from.take(u64::from(size));
                if kind == MATRIX && size > 0 {
                    let name = super::bytes::Bytes::text(name);
                    let inner = if count == 1 { format!("{path}.{name}") } else { format!("{path}({element}).{name}") };
                    if inner.len() > LONGEST_NAME {
                        return Err(Excess::Name(inner.len()).into());
                    }
                    self.matrix(&mut inside, &inner, depth)?;
                }
                if io::copy(&mut inside, &mut io::sink())? == 0 && inside.limit() > 0 {
                    return Err(io::ErrorKind::UnexpectedEof.into());
                }
            }
        }
        Ok(())
    }

    fn numbers(&mut self, from: &mut dyn Read, path: &str, rows: u64, columns: u64) -> io::Result<()> {
        let (kind, size, inside) = self.tag(from)?;
        let kind = match kind {
            1 => Kind::Signed(1),
            2 => Kind::Unsigned(1),
            3 => Kind::Signed(2),
            4 => Kind::Unsigned(2),
            5 => Kind::Signed(4),
            6 => Kind::Unsigned(4),
            7 => Kind::Float(4),
            9 => Kind::Float(8),
            12 => Kind::Signed(8),
            13 => Kind::Unsigned(8),
            _ => return Err(bad("numbers of no known type")),
        };
        let number = Number { kind, big_endian: self.big_endian };
        if rows.checked_mul(columns).and_then(|n| n.checked_mul(number.size() as u64)) != Some(u64::from(size)) {
            return Err(bad(&format!("'{path}' has {rows} x {columns} numbers but {size} bytes of them")));
        }
        match inside {
            Some(data) => (self.visit)(Met { path, rows, columns, number, numbers: &mut &data[..] }),
            None => (self.visit)(Met { path, rows, columns, number, numbers: from }),
        }
    }
}
