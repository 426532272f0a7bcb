//! Object headers: the messages that make an object a group or a dataset.

use super::super::account::{LONGEST_NAME, STEP, deeper};
use super::super::bytes::Bytes;
use super::chunks::{Dataset, Layout};
use super::datatype::{Datatype, Element};
use super::filters;
use super::{MOST_OBJECTS, NOWHERE, Store};

const LONGEST_HEAP: u64 = 1 << 16;

impl Dataset {
    /// Bytes in memory, about.
    pub(super) fn held(&self) -> u64 {
        let names = match &self.datatype {
            Datatype::Record { fields, .. } => fields.iter().map(|(name, ..)| 128 + name.len()).sum(),
            _ => 0,
        };
        let inside = if let Layout::Compact(data) = &self.layout { data.len() } else { 0 };
        (512 + names + inside + 16 * self.filters.len()) as u64
    }
}

/// What an object header says.
#[derive(Debug, Default)]
pub(super) struct Object {
    /// Name and address of what is in a group.
    pub(super) links: Vec<(String, u64)>,
    pub(super) dataset: Option<Dataset>,
    pub(super) attributes: Vec<(String, Element)>,
}

/// Kind and content of the messages of a header.
type Messages = Vec<(u16, Vec<u8>)>;

/// What a header with these messages takes.
fn held(messages: &Messages) -> u64 {
    messages.iter().map(|(_, content)| 64 + content.len() as u64).sum()
}

impl Object {
    pub(super) fn read(store: &mut Store, address: u64) -> Result<Object, String> {
        const SHAPE: u16 = 1;
        const DATATYPE: u16 = 3;
        const LAYOUT: u16 = 8;
        let messages = if store.read(address, 4)? == b"OHDR" {
            second_version(store, address)?
        } else {
            first_version(store, address)?
        };
        let mut object = Object::default();
        let mut pipeline = Ok(Vec::new());
        for (kind, content) in &messages {
            let bytes = &mut Bytes(content);
            match kind {
                0x02 => {
                    bytes.u8()?;
                    if bytes.u8()? & 1 == 1 {
                        bytes.take(8)?;
                    }
                    if store.address(bytes)? != NOWHERE {
                        return Err("a group kept in a form that is not read; save with libver='earliest'".into());
                    }
                }
                0x06 => object.links.extend(link(store, bytes)?),
                0x0b => pipeline = filters::parse(*bytes),
                0x0c => object.attributes.extend(attribute(store, bytes)),
                0x11 => {
                    let (tree, heap) = (store.address(bytes)?, store.address(bytes)?);
                    let names = heap_data(store, heap)?;
                    symbols(store, tree, &names, &mut object.links, 0)?;
                }
                _ => {}
            }
        }
        let find = |kind: u16| messages.iter().find(|(k, _)| *k == kind).map(|(_, content)| Bytes(content));
        if let (Some(mut shape), Some(mut datatype), Some(layout)) = (find(SHAPE), find(DATATYPE), find(LAYOUT)) {
            let shape = dimensions(store, &mut shape)?;
            let datatype = Datatype::parse(&mut datatype)?;
            if matches!(datatype, Datatype::Number(_) | Datatype::Record { .. }) {
                let layout = Layout::parse(store, layout, shape.len())?;
                object.dataset = Some(Dataset { shape, datatype, layout, filters: pipeline? });
            }
        }
        Ok(object)
    }
}

/// A header of version 1 with its continuations.
fn first_version(store: &mut Store, address: u64) -> Result<Messages, String> {
    let head = store.read(address, 16)?;
    let bytes = &mut Bytes(&head);
    if bytes.u8()? != 1 {
        return Err(format!("damaged: there is no object at {address}"));
    }
    bytes.take(7)?;
    let size = bytes.u32()?;
    let mut messages = Vec::new();
    let mut blocks = vec![(address + 16, u64::from(size))];
    while let Some((at, size)) = blocks.pop() {
        store.account.room(held(&messages).saturating_add(size))?;
        let block = store.read(at, size)?;
        let bytes = &mut Bytes(&block);
        while bytes.0.len() >= 8 {
            let (kind, size, flags) = (bytes.u16()?, bytes.u16()?, bytes.u8()?);
            bytes.take(3)?;
            let content = bytes.take(usize::from(size))?;
            keep(store, &mut messages, &mut blocks, kind, flags, content)?;
        }
    }
    Ok(messages)
}

/// A header of version 2 with its continuations.
fn second_version(store: &mut Store, address: u64) -> Result<Messages, String> {
    let head = store.read(address, 6)?;
    let flags = head[5];
    let times = if flags & 0x20 != 0 { 16 } else { 0 };
    let limits = if flags & 0x10 != 0 { 4 } else { 0 };
    let width = 1 << (flags & 3);
    let start = address + 6 + times + limits;
    let size = Bytes(&store.read(start, width)?).number(width as usize)?;
    let mut messages = Vec::new();
    // a first block is without frame; those that follow begin with a signature and end with a checksum
    let mut blocks = vec![(start + width, size)];
    let mut first = true;
    while let Some((at, size)) = blocks.pop() {
        store.account.room(held(&messages).saturating_add(size))?;
        let block = store.read(at, size)?;
        let mut bytes = Bytes(&block);
        if !first {
            if bytes.take(4)? != b"OCHK" {
                return Err("damaged: a header is not continued where it says".into());
            }
            bytes = Bytes(bytes.take(bytes.0.len().saturating_sub(4))?);
        }
        first = false;
        let order = if flags & 4 != 0 { 2 } else { 0 };
        while bytes.0.len() >= 4 + order {
            let (kind, size, flags) = (u16::from(bytes.u8()?), bytes.u16()?, bytes.u8()?);
            bytes.take(order)?;
            let content = bytes.take(usize::from(size))?;
            keep(store, &mut messages, &mut blocks, kind, flags, content)?;
        }
    }
    Ok(messages)
}

fn keep(
    store: &Store,
    messages: &mut Messages,
    blocks: &mut Vec<(u64, u64)>,
    kind: u16,
    flags: u8,
    content: &[u8],
) -> Result<(), String> {
    const SHARED: u8 = 2;
    const CONTINUATION: u16 = 0x10;
    if kind == CONTINUATION {
        let bytes = &mut Bytes(content);
        blocks.push((store.address(bytes)?, store.length(bytes)?));
    } else if flags & SHARED == 0 {
        messages.push((kind, content.to_vec()));
    }
    if messages.len() > MOST_OBJECTS || blocks.len() > MOST_OBJECTS {
        return Err("damaged: a header without end".into());
    }
    Ok(())
}

/// The dataspace message.
fn dimensions(store: &Store, bytes: &mut Bytes) -> Result<Vec<u64>, String> {
    let (version, rank, _flags) = (bytes.u8()?, bytes.u8()?, bytes.u8()?);
    bytes.take(if version == 1 { 5 } else { 1 })?;
    (0..rank).map(|_| store.length(bytes)).collect()
}

/// A link message; only links to objects of the same file.
fn link(store: &Store, bytes: &mut Bytes) -> Result<Option<(String, u64)>, String> {
    bytes.u8()?;
    let flags = bytes.u8()?;
    let kind = if flags & 8 != 0 { bytes.u8()? } else { 0 };
    if flags & 4 != 0 {
        bytes.take(8)?;
    }
    if flags & 16 != 0 {
        bytes.u8()?;
    }
    let length = bytes.number(1 << (flags & 3))?;
    let length = usize::try_from(length).map_err(|_| "damaged: a name without end")?;
    store.account.name(length)?;
    let name = Bytes::text(bytes.take(length)?);
    Ok(if kind == 0 { Some((name, store.address(bytes)?)) } else { None })
}

/// Names of the members of a group.
fn heap_data(store: &mut Store, address: u64) -> Result<Vec<u8>, String> {
    let head = store.read(address, (8 + 2 * store.lengths + store.offsets) as u64)?;
    let bytes = &mut Bytes(&head);
    if bytes.take(4)? != b"HEAP" {
        return Err("damaged: a group without names".into());
    }
    bytes.take(4)?;
    let size = store.length(bytes)?;
    store.length(bytes)?;
    let at = store.address(bytes)?;
    store.read(at, size)
}

/// The members of a group, from its tree.
fn symbols(
    store: &mut Store,
    address: u64,
    names: &[u8],
    links: &mut Vec<(String, u64)>,
    depth: usize,
) -> Result<(), String> {
    let depth = deeper(depth)?;
    if links.len() > MOST_OBJECTS {
        return Err("more members of a group than a log has".into());
    }
    let (offsets, lengths) = (store.offsets, store.lengths);
    match &store.read(address, 4)?[..] {
        b"TREE" => {
            let head = store.read(address, 8)?;
            let count = usize::from(Bytes(&head[6..]).u16()?);
            let at = address + 8 + 2 * offsets as u64;
            let entries = store.read(at, (count * (lengths + offsets)) as u64)?;
            let bytes = &mut Bytes(&entries);
            for _ in 0..count {
                store.length(bytes)?;
                let child = store.address(bytes)?;
                symbols(store, child, names, links, depth)?;
            }
        }
        b"SNOD" => {
            let head = store.read(address, 8)?;
            let count = u64::from(Bytes(&head[6..]).u16()?);
            let entries = store.read(address + 8, count * (2 * offsets as u64 + 24))?;
            let bytes = &mut Bytes(&entries);
            for _ in 0..count {
                let name = store.address(bytes)?;
                let object = store.address(bytes)?;
                let _kind = bytes.u32()?;
                bytes.take(20)?;
                let name =
                    usize::try_from(name).ok().and_then(|at| names.get(at..)).ok_or("damaged: a name is missing")?;
                let name = Bytes::text(&name[..name.len().min(LONGEST_NAME + 1)]);
                store.account.name(name.len())?;
                links.push((name, object));
            }
        }
        _ => return Err("damaged: a group without members".into()),
    }
    Ok(())
}

/// An attribute with one number or one text; others, and damaged ones, are passed over.
fn attribute(store: &mut Store, bytes: &mut Bytes) -> Option<(String, Element)> {
    let version = bytes.u8().ok()?;
    let shared = bytes.u8().ok()? & 3 != 0 && version > 1;
    let sizes = [bytes.u16().ok()?, bytes.u16().ok()?, bytes.u16().ok()?].map(usize::from);
    if version == 3 {
        bytes.u8().ok()?;
    }
    let stored = |size: usize| if version == 1 { size.div_ceil(8) * 8 } else { size };
    let name = Bytes::text(bytes.take(stored(sizes[0])).ok()?);
    store.account.work(STEP + name.len() as u64).ok()?;
    let mut datatype = Bytes(bytes.take(stored(sizes[1])).ok()?);
    let mut shape = Bytes(bytes.take(stored(sizes[2])).ok()?);
    if shared {
        return None;
    }
    let datatype = Datatype::parse(&mut datatype).ok()?;
    if dimensions(store, &mut shape).ok()?.iter().any(|&n| n != 1) {
        return None;
    }
    let value = bytes.take(datatype.size()).ok()?;
    let value = match datatype {
        Datatype::Number(_) => {
            let (whole, part) = datatype.number(0, value);
            Element::Number(whole as f64 + part)
        }
        Datatype::Text { size } if size <= LONGEST_NAME => Element::Text(Bytes::text(value)),
        Datatype::FarText { .. } => Element::Text(far_text(store, &mut Bytes(value)).ok()?),
        _ => return None,
    };
    Some((name, value))
}

/// A text in a global heap.
fn far_text(store: &mut Store, bytes: &mut Bytes) -> Result<String, String> {
    let length = u64::from(bytes.u32()?);
    let heap = store.address(bytes)?;
    let wanted = bytes.u32()?;
    let head = store.read(heap, 8 + store.lengths as u64)?;
    let size = store.length(&mut Bytes(&head[8..]))?;
    if !head.starts_with(b"GCOL") || size > LONGEST_HEAP {
        return Err("damaged: no text where an attribute says".into());
    }
    let heap = store.read(heap, size)?;
    let bytes = &mut Bytes(&heap);
    bytes.take(8 + store.lengths)?;
    loop {
        let index = u32::from(bytes.u16()?);
        bytes.take(6)?;
        let size = store.length(bytes)?.min(LONGEST_HEAP) as usize;
        if index == wanted {
            return Ok(Bytes::text(bytes.take(size.min(length as usize).min(LONGEST_NAME))?));
        }
        if index == 0 {
            return Err("damaged: a text is missing".into());
        }
        bytes.take(size.div_ceil(8) * 8)?;
    }
}
