//! Bags: files of messages on named topics (ROS 1 bag, MCAP, ROS 2 sqlite), of which `sensor_msgs/Imu` are read.
//!
//! Units are those of the message definition and REP 103: rad/s, m/s². The time of a row is that of the message
//! header, in nanoseconds; when it was recorded is `log_time`.

use std::collections::BTreeMap;
use std::path::Path;

use super::InputError;
use super::account::{Account, Excess};
use super::bytes::{Bytes, Short, zstd};
use super::names::Head;
use super::number::Split;
use super::records::{Messages, RecordSource, failure, head, tally};
use super::table::Topic;

const MOST_TOPICS: usize = 10_000;

/// How a message is written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Encoding {
    /// ROS 1: fields one behind the other.
    Ros1,
    /// ROS 2: the common data representation, aligned.
    Cdr,
    /// JSON, Protobuf and others.
    Other,
}

/// One stream of messages.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Channel {
    pub(super) topic: String,
    /// `sensor_msgs/msg/Imu`.
    pub(super) kind: String,
    pub(super) encoding: Encoding,
}

impl Channel {
    fn is_imu(&self) -> bool {
        let name = ["sensor_msgs/Imu", "sensor_msgs/msg/Imu", "sensor_msgs::msg::dds_::Imu_"].contains(&&*self.kind);
        name && self.encoding != Encoding::Other
    }
}

/// A file of messages of many topics.
pub(super) trait Bag: Send + Sized + 'static {
    const FORMAT: &'static str;
    fn open(path: &Path, account: &Account) -> Result<Self, String>;
    fn rewind(&mut self) -> Result<(), String>;
    /// The number of the channel of the next message, and when it was recorded, in nanoseconds.
    fn next(&mut self) -> Result<Option<(u32, u64)>, String>;
    /// The content of that message.
    fn message(&self) -> &[u8];
    /// A channel that was met.
    fn channel(&self, number: u32) -> Option<&Channel>;
    fn damage(&self) -> Option<String>;
}

fn heads() -> Vec<Head> {
    let mut heads = vec![head("stamp", "stamp", Some("ns")), head("log_time", "log_time", Some("ns"))];
    let groups = [("angular_velocity", Some("rad/s")), ("linear_acceleration", Some("m/s^2"))];
    for (group, unit) in groups {
        heads.extend(["x", "y", "z"].iter().map(|axis| format!("{group}.{axis}")).map(|name| head(&name, &name, unit)));
    }
    heads.extend(
        ["x", "y", "z", "w"].iter().map(|axis| format!("orientation.{axis}")).map(|name| head(&name, &name, None)),
    );
    heads
}

/// Appends the row of a message.
fn imu(encoding: Encoding, message: &[u8], log_time: u64, row: &mut Vec<Split>) -> Result<(), Short> {
    let mut bytes = Bytes(message);
    let mut big_endian = false;
    if encoding == Encoding::Cdr {
        big_endian = bytes.take(4)?[1] & 1 == 0;
    } else {
        bytes.take(4)?;
    }
    let body = bytes.0.len();
    let word = |bytes: &mut Bytes| {
        let word = bytes.u32()?;
        Ok(if big_endian { word.swap_bytes() } else { word })
    };
    let (s, ns) = (word(&mut bytes)?, word(&mut bytes)?);
    let s = if encoding == Encoding::Cdr { i128::from(s as i32) } else { i128::from(s) };
    let name = word(&mut bytes)?;
    bytes.take(name as usize)?;
    if encoding == Encoding::Cdr {
        bytes.take((8 - (body - bytes.0.len()) % 8) % 8)?;
    }
    let mut numbers = [f64::NAN; 37];
    for number in &mut numbers {
        let raw = bytes.number(8)?;
        *number = f64::from_bits(if big_endian { raw.swap_bytes() } else { raw });
    }
    // orientation, its covariance, rate, its covariance, acceleration, its covariance
    row.extend([(s * 1_000_000_000 + i128::from(ns), 0.0), (i128::from(log_time), 0.0)]);
    row.extend([13, 14, 15, 25, 26, 27, 0, 1, 2, 3].map(|i: usize| (0, numbers[i])));
    Ok(())
}

/// Opens a bag and counts what is in it.
pub(super) fn open<B: Bag>(path: &Path, account: &Account) -> Result<RecordSource, InputError> {
    let fail = |what: String| failure(path, &what);
    let over = |excess: Excess| fail(excess.into());
    let mut bag = B::open(path, account).map_err(fail)?;
    let mut places: BTreeMap<String, usize> = BTreeMap::new();
    let mut topics: Vec<Topic> = Vec::new();
    let mut row = Vec::new();
    while let Some((number, log_time)) = bag.next().map_err(fail)? {
        let Some(channel) = bag.channel(number) else { continue };
        let at = match places.get(&channel.topic) {
            Some(&at) => at,
            None if topics.len() == MOST_TOPICS => continue,
            None => {
                let heads = if channel.is_imu() { heads() } else { Vec::new() };
                account.name(channel.topic.len()).map_err(over)?;
                account.columns(1 + heads.len() as u64, channel.topic.len().max(30)).map_err(over)?;
                places.insert(channel.topic.clone(), topics.len());
                topics.push(Topic { kind: channel.kind.clone(), ..Topic::new(channel.topic.clone(), heads) });
                topics.len() - 1
            }
        };
        row.clear();
        let read = channel.is_imu() && imu(channel.encoding, bag.message(), log_time, &mut row).is_ok();
        if read || !channel.is_imu() {
            let stamp = row.first().copied().unwrap_or((i128::from(log_time), 0.0));
            tally(&mut topics[at], Some(stamp), 1e-9);
        }
    }
    if topics.is_empty() {
        return Err(fail(bag.damage().unwrap_or_else(|| "no messages in it".into())));
    }
    let (file, drawn) = (path.to_path_buf(), account.clone());
    let names: Vec<String> = topics.iter().map(|topic| topic.name.clone()).collect();
    let messages = move |topic: usize| {
        let bag = B::open(&file, &drawn)?;
        Ok(Box::new(BagTopic { bag, topic: names[topic].clone(), damaged: 0 }) as Box<dyn Messages>)
    };
    let (path, account) = (path.to_path_buf(), account.clone());
    Ok(RecordSource { format: B::FORMAT, path, account, topics, messages: Box::new(messages) })
}

/// The messages of one topic.
struct BagTopic<B> {
    bag: B,
    topic: String,
    /// Messages that end too early.
    damaged: u64,
}

impl<B: Bag> Messages for BagTopic<B> {
    fn rewind(&mut self) -> Result<(), String> {
        self.damaged = 0;
        self.bag.rewind()
    }
    fn next(&mut self, row: &mut Vec<Split>) -> Result<bool, String> {
        while let Some((number, log_time)) = self.bag.next()? {
            let Some(channel) = self.bag.channel(number).filter(|c| c.topic == self.topic && c.is_imu()) else {
                continue;
            };
            match imu(channel.encoding, self.bag.message(), log_time, row) {
                Ok(()) => return Ok(true),
                Err(Short) => self.damaged += 1,
            }
        }
        Ok(false)
    }
    fn damage(&self) -> Option<String> {
        let short =
            (self.damaged > 0).then(|| format!("damaged: {} messages end too early and are left out", self.damaged));
        self.bag.damage().or(short)
    }
}

/// The file's blocks one behind the other, and what of them could not be read.
pub(super) struct Blocks {
    reader: std::io::BufReader<std::fs::File>,
    pub(super) account: Account,
    pub(super) at: u64,
    length: u64,
    first_damage: Option<(u64, String)>,
    passed_over: u64,
}

impl Blocks {
    pub(super) fn open(path: &Path, account: &Account) -> Result<Blocks, String> {
        let io = |error: std::io::Error| format!("cannot read: {error}");
        let file = std::fs::File::open(path).map_err(io)?;
        let length = file.metadata().map_err(io)?.len();
        let reader = std::io::BufReader::with_capacity(1 << 16, file);
        Ok(Blocks { reader, account: account.clone(), at: 0, length, first_damage: None, passed_over: 0 })
    }
    pub(super) fn jump(&mut self, at: u64) -> Result<(), String> {
        use std::io::{Seek, SeekFrom};
        self.at = at.min(self.length);
        self.reader.seek(SeekFrom::Start(self.at)).map_err(|error| format!("cannot read: {error}"))?;
        Ok(())
    }
    pub(super) fn rewind(&mut self, to: u64) -> Result<(), String> {
        (self.first_damage, self.passed_over) = (None, 0);
        self.jump(to)
    }
    /// The next bytes; `None` and nothing more if the file does not have them.
    pub(super) fn take(&mut self, count: u64, into: &mut Vec<u8>) -> Result<Option<()>, String> {
        use std::io::Read;
        into.clear();
        if count > self.length - self.at {
            if self.at < self.length || count > 0 {
                self.damaged(self.length - self.at, "the file ends inside a record");
            }
            self.at = self.length;
            return Ok(None);
        }
        into.resize(count as usize, 0);
        self.reader.read_exact(into).map_err(|error| format!("cannot read on: {error}"))?;
        self.at += count;
        Ok(Some(()))
    }
    pub(super) fn ended(&self) -> bool {
        self.at >= self.length
    }
    pub(super) fn damaged(&mut self, bytes: u64, why: &str) {
        self.passed_over += bytes;
        self.first_damage.get_or_insert_with(|| (self.at, why.into()));
    }
    pub(super) fn damage(&self) -> Option<String> {
        let (at, why) = self.first_damage.as_ref()?;
        Some(format!("damaged at byte {at}: {why}; {} of {} bytes were passed over", self.passed_over, self.length))
    }
}

/// Keeps a channel, unless it is known as it is: bags repeat them.
pub(super) fn keep(
    channels: &mut BTreeMap<u32, Channel>,
    number: u32,
    channel: Channel,
    account: &Account,
) -> Result<(), Excess> {
    if channels.get(&number) != Some(&channel) {
        account.name(channel.topic.len())?;
        account.name(channel.kind.len())?;
        channels.insert(number, channel);
    }
    Ok(())
}

/// A compressed block. `size`: what it is declared to hold, and no more is read.
pub(super) fn decompress(
    compression: &str,
    data: &[u8],
    size: u64,
    account: &Account,
) -> Result<Result<Vec<u8>, String>, Excess> {
    if !["", "none"].contains(&compression) {
        account.work(size)?;
        // beside it the window of what takes it apart, and the record that is taken out of it
        account.room(size.saturating_mul(3))?;
    }
    Ok(unpacked(compression, data, size))
}

fn unpacked(compression: &str, data: &[u8], size: u64) -> Result<Vec<u8>, String> {
    use std::io::Read;
    let mut out = Vec::new();
    let read = match compression {
        "" | "none" => return Ok(data.to_vec()),
        "bz2" => bzip2::read::BzDecoder::new(data).take(size).read_to_end(&mut out),
        "lz4" => lz4_flex::frame::FrameDecoder::new(data).take(size).read_to_end(&mut out),
        "zstd" => match zstd(data, size) {
            Ok(decoder) => decoder.take(size).read_to_end(&mut out),
            Err(error) => return Err(format!("a block compressed with zstd cannot be read ({error})")),
        },
        other => return Err(format!("a block compressed with '{other}', which is not read; none, bz2, lz4, zstd are")),
    };
    match read {
        Ok(_) if out.len() as u64 == size => Ok(out),
        Ok(_) => Err(format!("a block of {size} bytes holds {}", out.len())),
        Err(error) => Err(format!("a compressed block cannot be read ({error})")),
    }
}
