//! Types of elements: numbers, records of numbers, and short texts.

use super::super::account::deeper;
use super::super::bytes::Bytes;
use super::super::number::{Kind, Number};

const MOST_FIELDS: usize = 1000;

/// Of what a dataset or an attribute consists.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Datatype {
    Number(Number),
    /// Fields of numbers with their places; others are left out.
    Record {
        size: usize,
        fields: Vec<(String, usize, Number)>,
    },
    Text {
        size: usize,
    },
    /// A text kept elsewhere.
    FarText {
        size: usize,
    },
    Other {
        size: usize,
    },
}

/// The value of an attribute.
#[derive(Clone, Debug)]
pub(super) enum Element {
    Number(f64),
    Text(String),
}

impl Datatype {
    pub(super) fn size(&self) -> usize {
        match self {
            Datatype::Number(number) => number.size(),
            Datatype::Record { size, .. }
            | Datatype::Text { size }
            | Datatype::FarText { size }
            | Datatype::Other { size } => *size,
        }
    }

    /// One number of an element: whole and fraction.
    pub(super) fn number(&self, field: usize, element: &[u8]) -> (i128, f64) {
        match self {
            Datatype::Number(number) => number.decode(element),
            Datatype::Record { fields, .. } => match fields.get(field) {
                Some((_, offset, number)) => number.decode(element.get(*offset..).unwrap_or_default()),
                None => (0, f64::NAN),
            },
            _ => (0, f64::NAN),
        }
    }

    pub(super) fn parse(bytes: &mut Bytes) -> Result<Datatype, String> {
        Self::nested(bytes, 0)
    }

    fn nested(bytes: &mut Bytes, depth: usize) -> Result<Datatype, String> {
        let inner = deeper(depth)?;
        let class = bytes.u8()?;
        let flags = bytes.number(3)?;
        let size = bytes.u32()? as usize;
        let big_endian = flags & 1 == 1;
        match class & 15 {
            0 => {
                bytes.take(4)?;
                let kind = match (size, flags & 8) {
                    (1 | 2 | 4 | 8, 0) => Kind::Unsigned(size as u8),
                    (1 | 2 | 4 | 8, _) => Kind::Signed(size as u8),
                    _ => return Ok(Datatype::Other { size }),
                };
                Ok(Datatype::Number(Number { kind, big_endian }))
            }
            1 => {
                let layout = bytes.take(12)?;
                // where exponent and mantissa stand in the IEEE formats
                let known = match size {
                    2 => [16, 10, 5, 0, 10],
                    4 => [32, 23, 8, 0, 23],
                    8 => [64, 52, 11, 0, 52],
                    _ => return Ok(Datatype::Other { size }),
                };
                let stored = [layout[2], layout[4], layout[5], layout[6], layout[7]];
                if stored != known || flags & 0x40 != 0 {
                    return Ok(Datatype::Other { size });
                }
                Ok(Datatype::Number(Number { kind: Kind::Float(size as u8), big_endian }))
            }
            3 => Ok(Datatype::Text { size }),
            6 => Self::record(bytes, class >> 4, flags as usize & 0xffff, size, depth),
            // an enumeration, which a boolean is: by its numbers
            8 => {
                let base = Self::nested(bytes, inner)?;
                // names and values follow; only the end of a record needs them
                if depth > 0 {
                    for _ in 0..flags & 0xffff {
                        name(bytes, class >> 4)?;
                    }
                    bytes.take((flags as usize & 0xffff) * base.size())?;
                }
                Ok(base)
            }
            9 if flags & 15 == 1 => Ok(Datatype::FarText { size }),
            _ if depth == 0 => Ok(Datatype::Other { size }),
            class => Err(format!("a record with a field of a kind that is not read (class {class})")),
        }
    }

    fn record(bytes: &mut Bytes, version: u8, count: usize, size: usize, depth: usize) -> Result<Datatype, String> {
        let mut fields = Vec::new();
        for _ in 0..count.min(MOST_FIELDS) {
            let name = name(bytes, version)?;
            let offset = match version {
                3.. => bytes.number((1..=4).find(|&n| size < 1 << (8 * n)).unwrap_or(4))?,
                _ => u64::from(bytes.u32()?),
            } as usize;
            if version == 1 {
                bytes.take(1 + 3 + 4 + 4 + 16)?;
            }
            let inner = Self::nested(bytes, depth + 1)?;
            if offset.checked_add(inner.size()).is_none_or(|end| end > size) {
                return Err(format!("damaged: field '{name}' lies outside its record"));
            }
            if let Datatype::Number(number) = inner {
                fields.push((name, offset, number));
            }
        }
        Ok(Datatype::Record { size, fields })
    }
}

/// A name that ends at a zero byte, and its padding.
fn name(bytes: &mut Bytes, version: u8) -> Result<String, String> {
    let end = bytes.0.iter().position(|b| *b == 0).ok_or("damaged: a name without end")?;
    let stored = if version < 3 { (end / 8 + 1) * 8 } else { end + 1 };
    Ok(Bytes::text(bytes.take(stored)?))
}
