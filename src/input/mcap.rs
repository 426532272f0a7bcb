//! MCAP files: <https://mcap.dev/spec>. Read from the beginning without the index, so that a file that was not
//! closed is read as well.

use std::collections::BTreeMap;
use std::path::Path;

use super::account::{Account, Excess, Fault, LONGEST_NAME, STEP};
use super::bytes::{Bytes, Short, printable};
use super::ros::{Bag, Blocks, Channel, Encoding, decompress, keep};

pub(super) const SIGNATURE: &[u8] = b"\x89MCAP0\r\n";

const FOOTER: u8 = 2;
const SCHEMA: u8 = 3;
const CHANNEL: u8 = 4;
const MESSAGE: u8 = 5;
const CHUNK: u8 = 6;

pub(super) struct Mcap {
    blocks: Blocks,
    /// Names of the types of messages.
    schemas: BTreeMap<u16, String>,
    channels: BTreeMap<u32, Channel>,
    /// What a chunk holds, and what of it is used.
    chunk: Vec<u8>,
    used: usize,
    record: Vec<u8>,
    /// Where in the record the message begins.
    start: usize,
}

fn text(bytes: &mut Bytes) -> Result<String, Fault> {
    let size = bytes.u32()? as usize;
    let name = bytes.take(size)?;
    if size > LONGEST_NAME {
        return Err(Excess::Name(size).into());
    }
    Ok(printable(name))
}

impl Mcap {
    /// What a record says; channel and time of a message.
    fn take(&mut self, code: u8) -> Result<Option<(u32, u64)>, Fault> {
        let account = &self.blocks.account;
        account.work(STEP)?;
        let mut bytes = Bytes(&self.record);
        match code {
            SCHEMA => {
                let number = bytes.u16()?;
                let name = text(&mut bytes)?;
                if self.schemas.get(&number) != Some(&name) {
                    account.name(name.len())?;
                    self.schemas.insert(number, name);
                }
            }
            CHANNEL => {
                let (number, schema) = (bytes.u16()?, bytes.u16()?);
                let (topic, encoding) = (text(&mut bytes)?, text(&mut bytes)?);
                let encoding = match encoding.as_str() {
                    "ros1" => Encoding::Ros1,
                    "cdr" => Encoding::Cdr,
                    _ => Encoding::Other,
                };
                let kind = self.schemas.get(&schema).cloned().unwrap_or_default();
                keep(&mut self.channels, u32::from(number), Channel { topic, kind, encoding }, account)?;
            }
            MESSAGE => {
                let (channel, _, time, _) = (bytes.u16()?, bytes.u32()?, bytes.number(8)?, bytes.number(8)?);
                self.start = self.record.len() - bytes.0.len();
                return Ok(Some((u32::from(channel), time)));
            }
            _ => {}
        }
        Ok(None)
    }

    fn inside(&mut self) -> Result<Option<(u32, u64)>, Fault> {
        let mut bytes = Bytes(&self.chunk[self.used..]);
        let whole = bytes.0.len();
        let code = bytes.u8()?;
        let size = bytes.number(8)?.min(usize::MAX as u64) as usize;
        self.record.clear();
        self.record.extend_from_slice(bytes.take(size)?);
        self.used += whole - bytes.0.len();
        self.take(code)
    }

    /// The inner error: why the chunk is left out.
    fn open_chunk(&mut self) -> Result<Result<(), String>, Fault> {
        let mut bytes = Bytes(&self.record);
        bytes.take(16)?;
        let size = bytes.number(8)?;
        bytes.take(4)?;
        let compression = text(&mut bytes)?;
        let stored = bytes.number(8)?.min(usize::MAX as u64) as usize;
        let chunk = decompress(&compression, bytes.take(stored)?, size, &self.blocks.account)?;
        self.used = 0;
        Ok(chunk.map(|chunk| self.chunk = chunk))
    }
}

impl Bag for Mcap {
    const FORMAT: &'static str = "MCAP file";

    fn open(path: &Path, account: &Account) -> Result<Self, String> {
        let blocks = Blocks::open(path, account)?;
        let (schemas, channels, chunk, record) = (BTreeMap::new(), BTreeMap::new(), Vec::new(), Vec::new());
        let mut mcap = Mcap { blocks, schemas, channels, chunk, used: 0, record, start: 0 };
        mcap.rewind()?;
        Ok(mcap)
    }
    fn rewind(&mut self) -> Result<(), String> {
        self.chunk.clear();
        self.used = 0;
        self.blocks.rewind(SIGNATURE.len() as u64)
    }
    fn next(&mut self) -> Result<Option<(u32, u64)>, String> {
        loop {
            while self.used < self.chunk.len() {
                match self.inside() {
                    Ok(Some(found)) => return Ok(Some(found)),
                    Ok(None) => {}
                    Err(Fault::Short) => {
                        self.blocks.damaged(0, "a block ends inside a record");
                        self.used = self.chunk.len();
                    }
                    Err(Fault::Excess(excess)) => return Err(excess.into()),
                }
            }
            if self.blocks.ended() {
                return Ok(None);
            }
            let mut head = Vec::new();
            if self.blocks.take(9, &mut head)?.is_none() {
                return Ok(None);
            }
            let (code, size) = (head[0], Bytes(&head[1..]).number(8)?);
            if self.blocks.take(size, &mut self.record)?.is_none() {
                return Ok(None);
            }
            match code {
                FOOTER => self.blocks.jump(u64::MAX)?,
                CHUNK => {
                    let why = match self.open_chunk() {
                        Ok(Ok(())) => continue,
                        Ok(Err(why)) => why,
                        Err(Fault::Short) => Short.into(),
                        Err(Fault::Excess(excess)) => return Err(excess.into()),
                    };
                    self.blocks.damaged(size, &why);
                    self.chunk.clear();
                }
                _ => match self.take(code) {
                    Ok(Some(found)) => return Ok(Some(found)),
                    Ok(None) => {}
                    Err(Fault::Short) => self.blocks.damaged(size, "a record ends too early"),
                    Err(Fault::Excess(excess)) => return Err(excess.into()),
                },
            }
        }
    }
    fn message(&self) -> &[u8] {
        self.record.get(self.start..).unwrap_or_default()
    }
    fn channel(&self, number: u32) -> Option<&Channel> {
        self.channels.get(&number)
    }
    fn damage(&self) -> Option<String> {
        self.blocks.damage()
    }
}
