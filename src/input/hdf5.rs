//! HDF5 files, which MATLAB files of version 7.3 are: datasets of numbers with one or two dimensions, or records of
//! numbers.
//!
//! Format: The HDF Group, "HDF5 File Format Specification", version 3.0. Read are the structures that h5py, MATLAB
//! and the C library write by default (superblock 0 to 3, object headers 1 and 2, groups as symbol tables or as
//! links in the header; compact, contiguous and chunked data with the filters deflate, shuffle, Fletcher-32 and
//! LZF). What only `libver="latest"` writes (dense groups, some chunk indexes) is named and refused. Every length is
//! compared with the file's before it is read.

mod chunks;
mod datatype;
mod filters;
mod object;

use std::collections::BTreeSet;
use std::fs::File;
use std::io::{Read, Seek, SeekFrom};
use std::path::{Path, PathBuf};

use self::chunks::Dataset;
use self::datatype::{Datatype, Element};
use self::object::Object;
use super::InputError;
use super::account::{Account, JUMP, deeper};
use super::arrays::{Array, ArrayFile, Put};
use super::bytes::Bytes;

pub(super) const SIGNATURE: &[u8] = b"\x89HDF\r\n\x1a\n";

const MOST_OBJECTS: usize = 10_000;
/// The address that means none.
const NOWHERE: u64 = u64::MAX;

pub(super) struct Hdf5 {
    path: PathBuf,
    store: Store,
    arrays: Vec<Array>,
    datasets: Vec<Dataset>,
    scalars: Vec<(String, f64)>,
    objects: Vec<(String, String)>,
    /// MATLAB stores matrices with the dimensions in reverse.
    matlab: bool,
}

/// The file's bytes by address.
struct Store {
    file: File,
    /// Where address 0 is.
    base: u64,
    /// Bytes from there to the end.
    length: u64,
    /// Bytes of an address, and of a length.
    offsets: usize,
    lengths: usize,
    /// What points back at itself ends here.
    account: Account,
}

impl Store {
    fn read(&mut self, at: u64, count: u64) -> Result<Vec<u8>, String> {
        self.account.work(count.saturating_add(JUMP))?;
        if at.checked_add(count).is_none_or(|end| end > self.length) {
            return Err(format!("truncated or damaged: {count} bytes at {at} lie beyond its end ({})", self.length));
        }
        self.account.room(count)?;
        let mut bytes = vec![0; count as usize];
        let read = self.file.seek(SeekFrom::Start(self.base + at)).and_then(|_| self.file.read_exact(&mut bytes));
        read.map_err(|error| format!("cannot read: {error}"))?;
        Ok(bytes)
    }
    fn address(&self, bytes: &mut Bytes) -> Result<u64, String> {
        let address = bytes.number(self.offsets)?;
        Ok(if self.offsets < 8 && address == (1 << (8 * self.offsets)) - 1 { NOWHERE } else { address })
    }
    fn length(&self, bytes: &mut Bytes) -> Result<u64, String> {
        Ok(bytes.number(self.lengths)?)
    }
}

impl Hdf5 {
    pub(super) fn open(path: &Path, account: &Account) -> Result<Hdf5, InputError> {
        Self::read(path, account).map_err(|what| InputError::new(format!("{}: {what}", path.display())))
    }

    fn read(path: &Path, account: &Account) -> Result<Hdf5, String> {
        let io = |error: std::io::Error| format!("cannot read: {error}");
        let mut file = File::open(path).map_err(io)?;
        let length = file.metadata().map_err(io)?.len();
        let mut head = Vec::new();
        (&mut file).take(4096).read_to_end(&mut head).map_err(io)?;
        let base =
            [0, 512, 1024, 2048].into_iter().find(|&at| head.get(at..).is_some_and(|h| h.starts_with(SIGNATURE)));
        let base = base.ok_or("this is no HDF5 file")?;
        let mut bytes = Bytes(&head[base + SIGNATURE.len()..]);
        let version = bytes.u8()?;
        let skipped = match version {
            0 | 1 => 4,
            2 | 3 => 0,
            _ => return Err(format!("HDF5 superblock {version} is not known; 0 to 3 are")),
        };
        bytes.take(skipped)?;
        let (offsets, lengths) = (bytes.u8()? as usize, bytes.u8()? as usize);
        if ![2, 4, 8].contains(&offsets) || ![2, 4, 8].contains(&lengths) {
            return Err(format!("damaged: addresses of {offsets} bytes and lengths of {lengths}"));
        }
        let length = length - base as u64;
        let mut store = Store { file, base: base as u64, length, offsets, lengths, account: account.clone() };
        let root = if version <= 1 {
            // reserved, tree sizes, flags; then four addresses and the name of the root
            bytes.take(1 + 4 + 4 + if version == 1 { 4 } else { 0 } + 4 * offsets + offsets)?;
            store.address(&mut bytes)?
        } else {
            bytes.take(1 + 3 * offsets)?;
            store.address(&mut bytes)?
        };
        let (groups, found, scalars, objects) = (BTreeSet::new(), Vec::new(), Vec::new(), Vec::new());
        let mut tree = Tree { store: &mut store, groups, found, scalars, objects };
        tree.collect(root, "", 0)?;
        let Tree { found, scalars, objects, .. } = tree;
        let matlab = base == 512 && head.starts_with(b"MATLAB");
        let mut hdf5 = Hdf5 {
            path: path.to_path_buf(),
            store,
            arrays: Vec::new(),
            datasets: Vec::new(),
            scalars,
            objects,
            matlab,
        };
        for (name, dataset, unit) in found {
            hdf5.add(name, dataset, unit)?;
        }
        Ok(hdf5)
    }

    /// Keeps a dataset if it holds numbers in one or two dimensions.
    fn add(&mut self, path: String, dataset: Dataset, unit: Option<String>) -> Result<(), String> {
        let fields = match &dataset.datatype {
            Datatype::Number(_) => Vec::new(),
            Datatype::Record { fields, .. } if dataset.shape.len() == 1 && !fields.is_empty() => {
                fields.iter().map(|(name, ..)| name.clone()).collect()
            }
            _ => return Ok(()),
        };
        let (rows, columns) = match dataset.shape[..] {
            _ if dataset.shape.contains(&0) => return Ok(()),
            [] => (1, 1),
            [rows] if fields.is_empty() => (rows, 1),
            [rows] => (rows, fields.len() as u64),
            [columns, rows] if self.matlab => (rows, columns),
            [rows, columns] => (rows, columns),
            _ => return Ok(()),
        };
        if rows == 1 && columns == 1 && fields.is_empty() {
            let mut value = None;
            dataset.load(&mut self.store, &mut |_, _, bytes| value = Some(dataset.datatype.number(0, bytes)))?;
            self.scalars.extend(value.map(|(whole, part)| (path.clone(), whole as f64 + part)));
        }
        self.arrays.push(Array { path, rows, columns, unit, fields });
        self.datasets.push(dataset);
        Ok(())
    }
}

/// What is found from the root down.
struct Tree<'a> {
    store: &'a mut Store,
    /// Groups that were met: each is known by its first name, so that groups that lead to each other have an end.
    groups: BTreeSet<u64>,
    /// With their units.
    found: Vec<(String, Dataset, Option<String>)>,
    /// Also numbers in attributes.
    scalars: Vec<(String, f64)>,
    /// Of MATLAB, with their classes.
    objects: Vec<(String, String)>,
}

impl Tree<'_> {
    fn collect(&mut self, address: u64, path: &str, depth: usize) -> Result<(), String> {
        let depth = deeper(depth)?;
        if self.found.len() > MOST_OBJECTS {
            return Err("more groups or datasets than a log has".into());
        }
        let account = self.store.account.clone();
        let below = |name: &str| {
            account.name(path.len() + 1 + name.len())?;
            Ok::<_, String>(if path.is_empty() { name.to_string() } else { format!("{path}/{name}") })
        };
        let Object { links, dataset, attributes } = Object::read(self.store, address).map_err(|what| match path {
            "" => what,
            _ => format!("{what} (in '{path}')"),
        })?;
        let (mut unit, mut class, mut object) = (None, String::new(), false);
        for (name, value) in attributes {
            match value {
                Element::Text(text) if name == "MATLAB_class" => class = text,
                Element::Number(_) if name == "MATLAB_object_decode" => object = true,
                Element::Number(value) => self.scalars.push((below(&name)?, value)),
                Element::Text(text) if ["unit", "units"].contains(&name.to_lowercase().as_str()) => unit = Some(text),
                Element::Text(_) => {}
            }
        }
        if object {
            account.name(path.len() + class.len())?;
            self.objects.push((path.to_string(), class));
        } else if let Some(dataset) = dataset {
            account.hold(dataset.held() + unit.as_ref().map_or(0, String::len) as u64)?;
            self.found.push((path.to_string(), dataset, unit));
        }
        if !links.is_empty() && !self.groups.insert(address) {
            return Ok(());
        }
        for (name, address) in links {
            // where MATLAB keeps what cells and objects point at
            if !name.starts_with('#') {
                self.collect(address, &below(&name)?, depth)?;
            }
        }
        Ok(())
    }
}

impl ArrayFile for Hdf5 {
    fn format(&self) -> &'static str {
        if self.matlab { "MATLAB 7.3 file (HDF5)" } else { "HDF5 file" }
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
        let (dataset, matlab) = (&self.datasets[array], self.matlab);
        let fields = self.arrays[array].fields.len();
        let loaded = dataset.load(&mut self.store, &mut |first, second, bytes| match fields {
            0 if matlab && dataset.shape.len() == 2 => put(second, first, dataset.datatype.number(0, bytes)),
            0 => put(first, second, dataset.datatype.number(0, bytes)),
            _ => (0..fields).for_each(|field| put(first, field as u64, dataset.datatype.number(field, bytes))),
        });
        loaded.map_err(|what| {
            InputError::new(format!("{}: {what} (in '{}')", self.path.display(), self.arrays[array].path))
        })
    }
}
