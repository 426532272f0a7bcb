//! ROS 1 bags, version 2.0: <http://wiki.ros.org/Bags/Format/2.0>. Read from the beginning without the index, so
//! that a bag that was not closed is read as well.

use std::collections::BTreeMap;
use std::path::Path;

use super::account::{Account, Excess, LONGEST_NAME, STEP};
use super::bytes::{Bytes, printable};
use super::ros::{Bag, Blocks, Channel, Encoding, decompress, keep};

pub(super) const SIGNATURE: &[u8] = b"#ROSBAG V2.0\n";

const MESSAGE: u8 = 2;
const CHUNK: u8 = 5;
const CONNECTION: u8 = 7;

pub(super) struct Rosbag {
    blocks: Blocks,
    channels: BTreeMap<u32, Channel>,
    /// What a chunk holds, and what of it is used.
    chunk: Vec<u8>,
    used: usize,
    header: Vec<u8>,
    message: Vec<u8>,
}

/// The fields of a record's header.
fn fields(header: &[u8]) -> impl Fn(&str) -> Option<Vec<u8>> + '_ {
    move |wanted| {
        let mut bytes = Bytes(header);
        loop {
            let size = bytes.u32().ok()? as usize;
            let field = bytes.take(size).ok()?;
            let equals = field.iter().position(|b| *b == b'=')?;
            if &field[..equals] == wanted.as_bytes() {
                return Some(field[equals + 1..].to_vec());
            }
        }
    }
}

impl Rosbag {
    /// A record: its code and, of a message, connection and time; its data are in `message`.
    fn record(&mut self) -> Result<Option<(u8, u32, u64)>, String> {
        let field = fields(&self.header);
        let number = |name: &str| field(name).and_then(|value| Bytes(&value).number(value.len().min(8)).ok());
        self.blocks.account.work(STEP)?;
        let Some(code) = number("op").map(|code| code as u8) else { return Ok(None) };
        let connection = number("conn").unwrap_or(u64::MAX) as u32;
        if code == CONNECTION && field("topic").is_some() {
            let text = |value: Option<Vec<u8>>| match value.unwrap_or_default() {
                long if long.len() > LONGEST_NAME => Err(Excess::Name(long.len())),
                value => Ok(printable(&value)),
            };
            let kind = text(fields(&self.message)("type"))?;
            let topic = text(field("topic"))?;
            let channel = Channel { topic, kind, encoding: Encoding::Ros1 };
            keep(&mut self.channels, connection, channel, &self.blocks.account)?;
        }
        let time = number("time").unwrap_or(0);
        Ok(Some((code, connection, (time & 0xffff_ffff) * 1_000_000_000 + (time >> 32))))
    }

    /// The next record of the chunk that is open.
    fn inside(&mut self) -> Result<Option<(u8, u32, u64)>, String> {
        let mut bytes = Bytes(&self.chunk[self.used..]);
        let whole = bytes.0.len();
        let mut part = |into: &mut Vec<u8>| {
            let size = bytes.u32().ok()? as usize;
            into.clear();
            into.extend_from_slice(bytes.take(size).ok()?);
            Some(())
        };
        let read = part(&mut self.header).and_then(|()| part(&mut self.message));
        self.used += whole - bytes.0.len();
        if read.is_none() {
            self.blocks.damaged(0, "a block ends inside a record");
            self.used = self.chunk.len();
            return Ok(None);
        }
        self.record()
    }
}

impl Bag for Rosbag {
    const FORMAT: &'static str = "ROS 1 bag";

    fn open(path: &Path, account: &Account) -> Result<Self, String> {
        let blocks = Blocks::open(path, account)?;
        let (channels, chunk, header, message) = (BTreeMap::new(), Vec::new(), Vec::new(), Vec::new());
        let mut bag = Rosbag { blocks, channels, chunk, used: 0, header, message };
        bag.rewind()?;
        Ok(bag)
    }
    fn rewind(&mut self) -> Result<(), String> {
        self.chunk.clear();
        self.used = 0;
        self.blocks.rewind(SIGNATURE.len() as u64)
    }
    fn next(&mut self) -> Result<Option<(u32, u64)>, String> {
        loop {
            while self.used < self.chunk.len() {
                if let Some((MESSAGE, connection, time)) = self.inside()? {
                    return Ok(Some((connection, time)));
                }
            }
            if self.blocks.ended() {
                return Ok(None);
            }
            let mut size = Vec::new();
            for header in [true, false] {
                if self.blocks.take(4, &mut size)?.is_none() {
                    return Ok(None);
                }
                let count = u64::from(Bytes(&size).u32()?);
                let into = if header { &mut self.header } else { &mut self.message };
                if self.blocks.take(count, into)?.is_none() {
                    return Ok(None);
                }
            }
            match self.record()? {
                Some((MESSAGE, connection, time)) => return Ok(Some((connection, time))),
                Some((CHUNK, ..)) => {
                    let field = fields(&self.header);
                    let compression = field("compression").unwrap_or_default();
                    let size = field("size").and_then(|size| Bytes(&size).u32().ok()).unwrap_or(0);
                    let (name, account) = (printable(&compression), &self.blocks.account);
                    match decompress(&name, &self.message, u64::from(size), account)? {
                        Ok(chunk) => (self.chunk, self.used) = (chunk, 0),
                        Err(why) => self.blocks.damaged(self.message.len() as u64, &why),
                    }
                }
                _ => {}
            }
        }
    }
    fn message(&self) -> &[u8] {
        &self.message
    }
    fn channel(&self, number: u32) -> Option<&Channel> {
        self.channels.get(&number)
    }
    fn damage(&self) -> Option<String> {
        self.blocks.damage()
    }
}
