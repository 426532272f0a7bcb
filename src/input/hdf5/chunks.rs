//! Where the numbers of a dataset are: in the header, in one piece, or in chunks found by an index.

use std::collections::BTreeSet;

use super::super::account::{STEP, deeper};
use super::super::bytes::Bytes;
use super::datatype::Datatype;
use super::filters::{self, Filter};
use super::{NOWHERE, Store};

#[derive(Clone, Debug)]
pub(super) enum Layout {
    Compact(Vec<u8>),
    Contiguous { address: u64 },
    Chunked { chunk: Vec<u64>, index: Index },
}

/// How chunks are found.
#[derive(Clone, Debug)]
pub(super) enum Index {
    Tree(u64),
    /// The only chunk, its stored size if it went through filters, and the filters left out.
    One {
        address: u64,
        stored: Option<(u64, u32)>,
    },
    /// One behind the other.
    InOrder(u64),
    FixedArray(u64),
}

/// Where one chunk begins in the dataset, and where it is stored.
struct Chunk {
    origin: [u64; 2],
    address: u64,
    stored: u64,
    mask: u32,
}

impl Layout {
    /// The layout message of a dataset with this many dimensions.
    pub(super) fn parse(store: &Store, mut bytes: Bytes, rank: usize) -> Result<Layout, String> {
        let version = bytes.u8()?;
        let class = match version {
            1 | 2 => {
                let dimensions = bytes.u8()?;
                let class = bytes.u8()?;
                bytes.take(5)?;
                let address = if class == 0 { NOWHERE } else { store.address(&mut bytes)? };
                let sizes: Vec<u64> = numbers(&mut bytes, dimensions, 4)?;
                return match class {
                    0 => {
                        let size = bytes.u32()? as usize;
                        Ok(Layout::Compact(bytes.take(size)?.to_vec()))
                    }
                    1 => Ok(Layout::Contiguous { address }),
                    _ => chunked(sizes, rank, Index::Tree(address)),
                };
            }
            3..=5 => bytes.u8()?,
            _ => return Err(format!("numbers kept in a form that is not read (layout {version})")),
        };
        match class {
            0 => {
                let size = usize::from(bytes.u16()?);
                Ok(Layout::Compact(bytes.take(size)?.to_vec()))
            }
            1 => Ok(Layout::Contiguous { address: store.address(&mut bytes)? }),
            2 if version == 3 => {
                let dimensions = bytes.u8()?;
                let tree = store.address(&mut bytes)?;
                chunked(numbers(&mut bytes, dimensions, 4)?, rank, Index::Tree(tree))
            }
            2 => {
                let (flags, dimensions, width) = (bytes.u8()?, bytes.u8()?, bytes.u8()?);
                let sizes = numbers(&mut bytes, dimensions, usize::from(width.min(8)))?;
                let index = match bytes.u8()? {
                    1 => {
                        let stored = match flags & 2 {
                            0 => None,
                            _ => Some((store.length(&mut bytes)?, bytes.u32()?)),
                        };
                        Index::One { address: store.address(&mut bytes)?, stored }
                    }
                    2 => Index::InOrder(store.address(&mut bytes)?),
                    3 => {
                        bytes.u8()?;
                        Index::FixedArray(store.address(&mut bytes)?)
                    }
                    kind => {
                        return Err(format!(
                            "chunks indexed in a form that is not read ({kind}); save with libver='earliest'"
                        ));
                    }
                };
                chunked(sizes, rank, index)
            }
            class => Err(format!("numbers kept in a form that is not read (class {class})")),
        }
    }
}

fn numbers(bytes: &mut Bytes, count: u8, width: usize) -> Result<Vec<u64>, String> {
    (0..count).map(|_| Ok(bytes.number(width)?)).collect()
}

/// The last of the sizes is that of an element.
fn chunked(mut sizes: Vec<u64>, rank: usize, index: Index) -> Result<Layout, String> {
    sizes.pop();
    if sizes.len() != rank || sizes.contains(&0) {
        return Err("damaged: chunks of another shape than the data".into());
    }
    Ok(Layout::Chunked { chunk: sizes, index })
}

impl Dataset {
    /// Hands out every element with its first and second index.
    pub(super) fn load(&self, store: &mut Store, put: &mut dyn FnMut(u64, u64, &[u8])) -> Result<(), String> {
        let size = self.datatype.size().max(1) as u64;
        let (first, second) = match self.shape[..] {
            [] => (1, 1),
            [first] => (first, 1),
            [first, second] => (first, second),
            _ => return Err(format!("{} dimensions; one or two are read", self.shape.len())),
        };
        let bytes =
            first.checked_mul(second).and_then(|n| n.checked_mul(size)).ok_or("damaged: larger than any file")?;
        match &self.layout {
            Layout::Compact(data) if data.len() as u64 >= bytes => spread(data, size, second, 0, put),
            Layout::Compact(_) => return Err("damaged: fewer numbers than it declares".into()),
            Layout::Contiguous { address: NOWHERE } => return Err("nothing was written into it".into()),
            Layout::Contiguous { address } => {
                let piece = (1 << 20) / size * size;
                let mut done = 0;
                if address.checked_add(bytes).is_none_or(|end| end > store.length) {
                    return Err("truncated: its numbers lie beyond the end of the file".into());
                }
                while done < bytes && piece > 0 {
                    let data = store.read(address + done, piece.min(bytes - done))?;
                    store.account.work(self.steps(data.len() as u64 / size))?;
                    spread(&data, size, second, done / size, put);
                    done += data.len() as u64;
                }
            }
            Layout::Chunked { chunk, index } => {
                let shape = [first, second];
                let extent = [chunk.first().copied().unwrap_or(1), chunk.get(1).copied().unwrap_or(1)];
                let length = extent[0].checked_mul(extent[1]).and_then(|n| n.checked_mul(size));
                let length = length.ok_or("damaged: larger than any file")?;
                let wanted = first.div_ceil(extent[0]).saturating_mul(second.div_ceil(extent[1]));
                // unpacked, and as a filter before left it; and where the blocks are, in a list that grows by doubling
                let unpacked = length.saturating_mul(self.filters.len().clamp(1, 2) as u64);
                store.account.room(wanted.saturating_mul(2 * size_of::<Chunk>() as u64).saturating_add(unpacked))?;
                let chunks = self.chunks(store, index, extent, length, wanted)?;
                if chunks.len() as u64 != wanted {
                    return Err(format!("{} of {wanted} blocks of numbers are there", chunks.len()));
                }
                let places: BTreeSet<u64> = chunks.iter().map(|chunk| chunk.address).collect();
                if places.len() < chunks.len() {
                    return Err("damaged: a block at the address of another".into());
                }
                for chunk in chunks {
                    let passes = length.saturating_mul(self.filters.len() as u64 + 1);
                    store.account.work(passes.saturating_add(self.steps(length / size)))?;
                    let stored = store.read(chunk.address, chunk.stored)?;
                    let data = filters::undo(&self.filters, chunk.mask, stored, length as usize)?;
                    let at = chunk.origin;
                    for (i, element) in data.chunks_exact(size as usize).enumerate() {
                        let (row, column) = (at[0] + i as u64 / extent[1], at[1] + i as u64 % extent[1]);
                        if row < shape[0] && column < shape[1] {
                            put(row, column, element);
                        }
                    }
                }
            }
        }
        Ok(())
    }

    /// Work of handing out so many elements: an eighth of a step for each of their numbers.
    fn steps(&self, elements: u64) -> u64 {
        let numbers = if let Datatype::Record { fields, .. } = &self.datatype { fields.len() as u64 } else { 1 };
        elements.saturating_mul(numbers * STEP / 8)
    }

    fn chunks(
        &self,
        store: &mut Store,
        index: &Index,
        extent: [u64; 2],
        length: u64,
        wanted: u64,
    ) -> Result<Vec<Chunk>, String> {
        // each has its address in the file, or its numbers in line
        if wanted > store.length / store.offsets.min(8) as u64 {
            return Err("damaged: more blocks than bytes".into());
        }
        let rank = self.shape.len();
        let across = self.shape.get(1).map_or(1, |second| second.div_ceil(extent[1]));
        let origin = |i: u64| match rank {
            1 => [i * extent[0], 0],
            _ => [i / across * extent[0], i % across * extent[1]],
        };
        let mut chunks = Vec::new();
        match *index {
            Index::Tree(NOWHERE) | Index::FixedArray(NOWHERE) => {}
            Index::Tree(tree) => self.tree(store, tree, &mut chunks, wanted, 0)?,
            Index::One { address, stored } => {
                let (stored, mask) = stored.unwrap_or((length, 0));
                chunks.push(Chunk { origin: [0, 0], address, stored, mask });
            }
            Index::InOrder(address) => {
                for i in 0..wanted {
                    let address = address.saturating_add(i.saturating_mul(length));
                    chunks.push(Chunk { origin: origin(i), address, stored: length, mask: 0 });
                }
            }
            Index::FixedArray(address) => {
                let head = store.read(address, 8 + (store.lengths + store.offsets) as u64)?;
                let bytes = &mut Bytes(&head);
                if bytes.take(4)? != b"FAHD" {
                    return Err("damaged: no index of blocks".into());
                }
                let (_, filtered, size, page) = (bytes.u8()?, bytes.u8()?, bytes.u8()?, bytes.u8()?);
                let count = store.length(bytes)?;
                let block = store.address(bytes)?;
                if page < 64 && count > 1 << page {
                    return Err("an index of blocks in pages, which is not read; save with libver='earliest'".into());
                }
                if count > wanted {
                    return Err("damaged: more blocks than the numbers need".into());
                }
                let entries = store
                    .read(block.saturating_add(6 + store.offsets as u64), count.saturating_mul(u64::from(size)))?;
                for i in 0..count {
                    let entry = &mut Bytes(&entries[i as usize * usize::from(size)..]);
                    let address = store.address(entry)?;
                    let (stored, mask) = match filtered {
                        0 => (length, 0),
                        _ => (entry.number(usize::from(size).saturating_sub(store.offsets + 4).min(8))?, entry.u32()?),
                    };
                    if address != NOWHERE {
                        chunks.push(Chunk { origin: origin(i), address, stored, mask });
                    }
                }
            }
        }
        Ok(chunks)
    }

    /// Chunks of a tree of version 1.
    fn tree(
        &self,
        store: &mut Store,
        address: u64,
        chunks: &mut Vec<Chunk>,
        wanted: u64,
        depth: usize,
    ) -> Result<(), String> {
        let depth = deeper(depth)?;
        let head = store.read(address, 8)?;
        if !head.starts_with(b"TREE") || head[4] != 1 {
            return Err("damaged: no index of blocks".into());
        }
        let (level, count) = (head[5], usize::from(Bytes(&head[6..]).u16()?));
        let rank = self.shape.len();
        let key = 8 + 8 * (rank + 1);
        let at = address + 8 + 2 * store.offsets as u64;
        let entries = store.read(at, (count * (key + store.offsets)) as u64)?;
        let bytes = &mut Bytes(&entries);
        for _ in 0..count {
            let (stored, mask) = (u64::from(bytes.u32()?), bytes.u32()?);
            let mut origin = [0; 2];
            for at in origin.iter_mut().take(rank) {
                *at = bytes.number(8)?;
            }
            bytes.take(8)?;
            let address = store.address(bytes)?;
            if level > 0 {
                self.tree(store, address, chunks, wanted, depth)?;
            } else if origin.iter().zip(&self.shape).all(|(at, size)| at < size) {
                chunks.push(Chunk { origin, address, stored, mask });
            }
            if chunks.len() as u64 > wanted {
                return Err("damaged: more blocks than the numbers need".into());
            }
        }
        Ok(())
    }
}

fn spread(data: &[u8], size: u64, second: u64, from: u64, put: &mut dyn FnMut(u64, u64, &[u8])) {
    for (i, element) in (from..).zip(data.chunks_exact(size as usize)) {
        put(i / second, i % second, element);
    }
}

/// A dataset as its header describes it.
#[derive(Clone, Debug)]
pub(super) struct Dataset {
    pub(super) shape: Vec<u64>,
    pub(super) datatype: Datatype,
    pub(super) layout: Layout,
    pub(super) filters: Vec<Filter>,
}
