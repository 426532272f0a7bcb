//! What chunks went through before they were stored, undone.

use std::io::Read;

use flate2::read::ZlibDecoder;

use super::super::bytes::Bytes;

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Filter {
    Deflate,
    /// Bytes of the same place in every element stand together.
    Shuffle {
        size: usize,
    },
    Fletcher32,
    Lzf,
}

/// The filter pipeline message.
pub(super) fn parse(mut bytes: Bytes) -> Result<Vec<Filter>, String> {
    let version = bytes.u8()?;
    let count = bytes.u8()?;
    if version == 1 {
        bytes.take(6)?;
    }
    let mut filters = Vec::new();
    for _ in 0..count {
        let id = bytes.u16()?;
        let name = usize::from(if version == 1 || id >= 256 { bytes.u16()? } else { 0 });
        let _flags = bytes.u16()?;
        let values = bytes.u16()?;
        bytes.take(if version == 1 { name.div_ceil(8) * 8 } else { name })?;
        let mut first = 0;
        for i in 0..values {
            let value = bytes.u32()?;
            first = if i == 0 { value } else { first };
        }
        if version == 1 && values % 2 == 1 {
            bytes.take(4)?;
        }
        filters.push(match id {
            1 => Filter::Deflate,
            2 => Filter::Shuffle { size: first as usize },
            3 => Filter::Fletcher32,
            32000 => Filter::Lzf,
            4 => return Err("compressed with szip, which is not read; gzip and lzf are".into()),
            id => return Err(format!("stored through filter {id}, which is not read; gzip, lzf and shuffle are")),
        });
    }
    Ok(filters)
}

/// The chunk of `size` bytes that was stored as these. `mask`: filters left out.
pub(super) fn undo(filters: &[Filter], mask: u32, mut data: Vec<u8>, size: usize) -> Result<Vec<u8>, String> {
    for (i, filter) in filters.iter().enumerate().rev() {
        if i < 32 && mask >> i & 1 == 1 {
            continue;
        }
        data = match filter {
            Filter::Deflate => {
                let most = size as u64 + 4; // a checksum may still be behind it
                let mut inflated = Vec::with_capacity(size + 8);
                let read = ZlibDecoder::new(&data[..]).take(most + 1).read_to_end(&mut inflated);
                read.map_err(|error| format!("damaged: a compressed block cannot be read: {error}"))?;
                inflated
            }
            Filter::Shuffle { size } => unshuffle(&data, (*size).max(1)),
            Filter::Fletcher32 => {
                let (content, sum) = data.split_at_checked(data.len().saturating_sub(4)).ok_or("damaged")?;
                if fletcher(content).to_le_bytes() != *sum {
                    return Err("damaged: a block does not have its checksum".into());
                }
                content.to_vec()
            }
            Filter::Lzf => lzf(&data, size).ok_or("damaged: a block compressed with lzf cannot be read")?,
        };
    }
    match data.len() == size {
        true => Ok(data),
        false => Err(format!("damaged: a block of {size} bytes holds {}", data.len())),
    }
}

fn unshuffle(data: &[u8], size: usize) -> Vec<u8> {
    let count = data.len() / size;
    let mut out = Vec::with_capacity(data.len());
    for element in 0..count {
        out.extend((0..size).map(|byte| data[byte * count + element]));
    }
    out.extend_from_slice(&data[count * size..]);
    out
}

/// The checksum of the HDF5 library: Fletcher's over big-endian 16-bit words.
fn fletcher(data: &[u8]) -> u32 {
    let (mut low, mut high) = (0u32, 0u32);
    for block in data.chunks(720) {
        for word in block.chunks(2) {
            low += u32::from(word[0]) << 8 | u32::from(word.get(1).copied().unwrap_or(0));
            high += low;
        }
        low = (low & 0xffff) + (low >> 16);
        high = (high & 0xffff) + (high >> 16);
    }
    low = (low & 0xffff) + (low >> 16);
    high = (high & 0xffff) + (high >> 16);
    high << 16 | low
}

/// LibLZF: runs of bytes, and copies of earlier ones.
fn lzf(data: &[u8], most: usize) -> Option<Vec<u8>> {
    let mut out: Vec<u8> = Vec::with_capacity(most + 8);
    let mut at = 0;
    while at < data.len() {
        let control = usize::from(data[at]);
        at += 1;
        if control < 32 {
            out.extend_from_slice(data.get(at..at + control + 1)?);
            at += control + 1;
        } else {
            let mut length = control >> 5;
            if length == 7 {
                length += usize::from(*data.get(at)?);
                at += 1;
            }
            let back = ((control & 31) << 8 | usize::from(*data.get(at)?)) + 1;
            at += 1;
            let from = out.len().checked_sub(back)?;
            for i in 0..length + 2 {
                out.push(out[from + i]);
            }
        }
        if out.len() > most + 4 {
            return None;
        }
    }
    Some(out)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Its padding would be counted beyond 16 bits.
    #[test]
    fn a_name_longer_than_the_message_is_refused() {
        let name = [1, 0, 0xff, 0xff, 0, 0, 0, 0];
        let message: Vec<u8> = [1, 1, 0, 0, 0, 0, 0, 0].into_iter().chain(name).collect();
        assert!(parse(Bytes(&message)).is_err());
        let message: Vec<u8> = [1, 1, 0, 0, 0, 0, 0, 0].into_iter().chain([1, 0, 0, 0, 0, 0, 0, 0]).collect();
        assert_eq!(parse(Bytes(&message)).unwrap(), [Filter::Deflate]);
    }
}
