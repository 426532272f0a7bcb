use std::io::{BufReader, Cursor, Write};

use super::ahead::Ahead;
use super::digits::{Bytes, LEAD, Words};
use super::fast::{Lines, ROOM, Text};
use super::row::{Fault, Form, Slot};
use super::*;
use crate::input::account::Account;
use crate::input::sniff::Delimiter;
use crate::numerics::random::{StreamId, stream};
use rand::RngExt;

/// Everything that is read of a text: bits, line numbers, and the line at which it ends otherwise than at the end.
#[derive(Debug, PartialEq, Default)]
struct Read {
    time: Vec<u64>,
    values: Vec<Vec<u64>>,
    lines: Vec<u64>,
    fault: Option<(u64, Fault)>,
}

impl Read {
    fn add(&mut self, rows: &Rows, before: u64) {
        let bits = |x: &[f64]| x.iter().map(|x| x.to_bits()).collect::<Vec<_>>();
        self.time.extend(bits(&rows.time));
        self.values.resize(rows.values.len(), Vec::new());
        self.values.iter_mut().zip(&rows.values).for_each(|(all, part)| all.extend(bits(part)));
        self.lines.extend(rows.lines.iter().map(|line| line + rows.before + before));
    }
}

/// Line by line.
fn plainly(text: &[u8], form: &Form) -> Read {
    let (mut form, mut rows, mut read) = (form.clone(), Rows::default(), Read::default());
    rows.clear(form.columns_of_values());
    let unended = text.last() != Some(&b'\n');
    let mut lines: Vec<&[u8]> = text.split(|b| *b == b'\n').collect();
    if !unended || text.is_empty() {
        lines.pop();
    }
    let count = lines.len();
    for (i, line) in lines.into_iter().enumerate() {
        let line = line.strip_suffix(b"\r").unwrap_or(line);
        let number = i as u64 + 1;
        if !Form::is_empty(line)
            && let Err(fault) = form.take(line, number, unended && i + 1 == count, &mut rows)
        {
            read.fault = Some((number, fault));
            break;
        }
    }
    read.add(&rows, 0);
    read
}

/// In chunks, by a reader that gives so many bytes at once.
fn in_chunks(text: &[u8], form: &Form, size: usize, step: usize) -> Read {
    let mut reader = BufReader::new(Cursor::new(text.to_vec()));
    let (mut ahead, mut read, mut before) = (Ahead::new(size, u64::MAX), Read::default(), 0);
    read.add(&Rows { values: vec![Vec::new(); form.columns_of_values()], ..Rows::default() }, 0);
    while let Some(mut chunk) = ahead.next(&mut reader, step, form) {
        read.add(&chunk.rows, before);
        before += chunk.lines;
        if let Some(fault) = chunk.fault.take() {
            read.fault = Some((before + 1, fault));
            break;
        }
        ahead.give_back(chunk);
    }
    read
}

/// At once, by the instructions that every processor has, and by those of each kind that this one has.
fn each_way(text: &[u8], form: &Form) -> Vec<Read> {
    let mut all = vec![by(Words, text, form)];
    #[cfg(target_arch = "x86_64")]
    {
        all.extend(pulp::x86::V3::try_new().map(|simd| by(simd, text, form)));
        all.extend(pulp::x86::V4::try_new().map(|simd| by(simd, text, form)));
    }
    all
}

fn by(simd: impl Bytes, text: &[u8], form: &Form) -> Read {
    let mut bytes = vec![b'7'; LEAD];
    bytes.extend(text);
    let end = bytes.len();
    bytes.resize(end + ROOM, b'7');
    let (mut rows, mut read) = (Rows::default(), Read::default());
    rows.clear(form.columns_of_values());
    let (lines, fault) = Lines::default().read_by(simd, form, Text { bytes: &bytes, end, unended: false }, &mut rows);
    read.add(&rows, 0);
    read.fault = fault.map(|fault| (lines + 1, fault));
    read
}

fn form(delimiter: Delimiter, decimal_comma: bool, slots: &[Slot]) -> Form {
    Form { delimiter, decimal_comma, slots: slots.to_vec(), origin: Some((1_403_636_579, 0.25)) }
}

struct Dice(rand::rngs::ChaCha8Rng);

impl Dice {
    fn new(run: u64) -> Dice {
        Dice(stream(20, StreamId { run, axis: 0, term: 0 }))
    }
    fn up_to(&mut self, n: usize) -> usize {
        self.0.random_range(0..=n)
    }
    fn one<'a>(&mut self, of: &[&'a str]) -> &'a str {
        of[self.up_to(of.len() - 1)]
    }
    fn digits(&mut self, count: usize) -> String {
        let zeros = if self.up_to(3) == 0 { self.up_to(count) } else { 0 };
        (0..count).map(|i| if i < zeros { '0' } else { char::from(b'0' + self.up_to(9) as u8) }).collect()
    }
    /// Numbers of every length, plain or with an exponent, near the limits of f64, and what only looks like one.
    fn field(&mut self, point: char) -> String {
        let odd = [
            "",
            "nan",
            "NaN",
            "-nan",
            "inf",
            "-inf",
            "NA",
            "null",
            "\"1.5\"",
            "\"1,5\"",
            " ",
            " 2.5 ",
            "1 ",
            "\t3",
            ".5",
            "5.",
            ".",
            "-",
            "+",
            "-.5",
            "+.5",
            "1e",
            "1e+",
            "e5",
            "1e5.0",
            "--1",
            "+-1",
            "1_000",
            "0x10",
            "x",
            "1.5.2",
            "1,5",
            "1.5",
            "9007199254740993",
            "9007199254740992.5",
            "18446744073709551615",
            "18446744073709551616",
            "1e400",
            "-1e400",
            "4.9e-324",
            "2.4703282292062327e-324",
            "2.2250738585072011e-308",
            "1.7976931348623157e308",
            "1e22",
            "1e23",
            "-0",
            "-0.0",
            "0e9",
            "00001.50000",
            "9223372036854775807",
            "9223372036854775808",
            "-9223372036854775808",
            "1403636579758555392",
            "1403636579.758555392",
            "\"",
            "a\"b",
            "#n/a",
            "1\r",
            "é",
            "1e0000001",
            "1E-5",
            "12345678.5",
            "123456789.5",
            "0.1234567890123456789012345",
        ];
        let sign = self.one(&["", "", "", "-", "-", "+"]);
        match self.up_to(19) {
            0 => self.one(&odd).to_string(),
            1..=9 => {
                let (whole, part) = (1 + self.up_to(2), 1 + self.up_to(19));
                format!("{sign}{}{point}{}", self.digits(whole), self.digits(part))
            }
            10 => {
                let count = 1 + self.up_to(25);
                format!("{sign}{}", self.digits(count))
            }
            11 | 12 => {
                let (whole, part) = (self.up_to(12), self.up_to(30));
                format!("{sign}{}{point}{}", self.digits(whole), self.digits(part))
            }
            13..=16 => {
                let part = self.up_to(20);
                let power = if self.up_to(3) == 0 { 330 } else { 40 };
                let power = self.up_to(2 * power) as i32 - power as i32;
                let e = self.one(&["e", "E"]);
                let power = if self.up_to(1) == 0 { format!("{power:+03}") } else { power.to_string() };
                let point = point.to_string();
                format!("{sign}{}{}{}{e}{power}", self.digits(1), if part > 0 { &point } else { "" }, self.digits(part))
            }
            // every f64 in its shortest form, exactly between two of them, and next to that
            17 | 18 => {
                let x = f64::from_bits(self.0.random());
                let text = if self.up_to(1) == 0 { format!("{x:e}") } else { format!("{}", x % 1e3) };
                text.replace('.', &point.to_string())
            }
            _ => {
                let whole = (1u64 << 53) + 2 * self.0.random_range(0..1u64 << 50) + 1;
                format!("{sign}{whole}{point}{}", self.one(&["0", "5", "00000001", ""]))
            }
        }
    }
}

/// Two million fields, each alone on its line, 1 in 20 of them odd: every bit and every fault as the plain way.
#[test]
fn every_number_is_that_of_the_plain_way() {
    for (run, slot) in [Slot::Axis(0), Slot::Time, Slot::Beside(0), Slot::Axis(0)].into_iter().enumerate() {
        let mut dice = Dice::new(run as u64);
        let comma = run == 3;
        let form = form(Delimiter::Byte(b';'), comma, &[slot]);
        let mut lines = Vec::new();
        for _ in 0..50_000 {
            // a line that is refused would end the comparison
            let line = dice.field(if comma { ',' } else { '.' });
            if plainly(format!("{line}\n").as_bytes(), &form).fault.is_none() {
                lines.push(line);
            }
        }
        assert!(lines.len() > 40_000, "{}", lines.len());
        let text = lines.join("\n") + "\n";
        let expected = plainly(text.as_bytes(), &form);
        let mut found = each_way(text.as_bytes(), &form);
        found.push(in_chunks(text.as_bytes(), &form, CHUNK, usize::MAX));
        for found in found {
            for (i, at) in expected.lines.iter().enumerate() {
                let bits =
                    |read: &Read| read.time.get(i).copied().or(read.values.first().and_then(|v| v.get(i).copied()));
                assert_eq!(bits(&found), bits(&expected), "{:?}", lines[*at as usize - 1]);
            }
            assert_eq!(found, expected);
        }
    }
}

/// Random texts in every form, with faults: read alike line by line, at once, and in chunks of any size.
#[test]
fn every_form_is_read_as_the_plain_way() {
    let delimiters = [(b',', ","), (b';', ";"), (b'\t', "\t"), (b' ', " "), (b' ', "  "), (b' ', " \t")];
    let mut faults = 0;
    for run in 0..3000 {
        let mut dice = Dice::new(1000 + run);
        let (byte, written) = delimiters[dice.up_to(5)];
        let comma = byte != b',' && dice.up_to(3) == 0;
        let delimiter = if byte == b' ' { Delimiter::Spaces } else { Delimiter::Byte(byte) };
        let columns = 1 + dice.up_to(4);
        let special = dice.up_to(3);
        let mut axes = 0;
        let mut axis = |beside: bool| {
            axes += 1;
            if beside { Slot::Beside(axes - 1) } else { Slot::Axis(axes - 1) }
        };
        let slots: Vec<Slot> = (0..columns)
            .map(|i| match special {
                0 if i == 0 => Slot::Time,
                1 if i + 1 == columns => axis(true),
                _ if dice.up_to(3) > 0 => axis(false),
                _ => Slot::Skip,
            })
            .collect();
        let form = form(delimiter, comma, &slots);
        let end = dice.one(&["\n", "\n", "\r\n"]);
        let (dangling, clean) = (dice.up_to(4) == 0, dice.up_to(4) > 0);
        let mut text = String::new();
        for _ in 0..dice.up_to(40) {
            let special = if clean { 60 } else { 20 };
            match dice.up_to(special) {
                0 => text += dice.one(&["# comment, 1, 2", "", "  ", "% x", "// 1,2", " # 3", "\t", "/ 5", "#n/a"]),
                1 => text += dice.one(&[",,,", "1", "1,2,3,4,5,6", ";;", "a b c", "\"x", "1;2;\"3;4\"", "  5  6  "]),
                _ => {
                    text += dice.one(&["", "", "", " "]);
                    for (column, slot) in slots.iter().enumerate() {
                        let point = if comma { ',' } else { '.' };
                        let skipped = matches!(slot, Slot::Skip) && dice.up_to(1) == 0;
                        text += &match (skipped, clean) {
                            (true, _) => {
                                dice.one(&["ok", "-", "a b", "\"a,b;c\"", "2020-01-01T00:00:00", "", "é"]).to_string()
                            }
                            (_, true) => format!("{}{point}{}", dice.digits(2), dice.digits(9)),
                            (_, false) => dice.field(point),
                        };
                        if column + 1 < columns || dangling {
                            text += written;
                        }
                    }
                }
            }
            text += end;
        }
        if dice.up_to(2) == 0 {
            let cut = dice.up_to(text.len());
            text.truncate(text.floor_char_boundary(cut));
        }
        let text = text.as_bytes();
        let expected = plainly(text, &form);
        faults += usize::from(expected.fault.is_some());
        let what = || format!("run {run}: {form:?} {:?}", String::from_utf8_lossy(text));
        for size in [CHUNK, 1, 3 + dice.up_to(100)] {
            let step = if size == CHUNK { usize::MAX } else { 1 + dice.up_to(5) };
            assert_eq!(in_chunks(text, &form, size, step), expected, "{}", what());
        }
        if text.is_empty() || text.ends_with(b"\n") {
            each_way(text, &form).into_iter().for_each(|read| assert_eq!(read, expected, "{}", what()));
        }
    }
    assert!((300..2700).contains(&faults), "{faults} of 3000 texts were refused");
}

/// A chunk may end at every byte of a line.
#[test]
fn chunks_end_anywhere() {
    let text = b"0.25,-1.5,a\r\n0.5,1e-3,\"b,c\"\r\n# no row\r\n\r\n0.75,12345678901234567890,d\r\n1,,e\r\n1.25,-0,f,\r\n1.5,7";
    let form = form(Delimiter::Byte(b','), false, &[Slot::Time, Slot::Axis(0), Slot::Skip]);
    let expected = plainly(text, &form);
    assert_eq!(expected.lines, [1, 2, 5, 6, 7]);
    assert_eq!(expected.fault, Some((8, Fault::Fields { count: 2, cut: true })));
    for size in 1..=text.len() + 1 {
        for step in [1, 2, usize::MAX] {
            assert_eq!(in_chunks(text, &form, size, step), expected, "{size}");
        }
    }
}

#[test]
fn a_line_may_be_nearly_a_mebibyte_long() {
    let form = form(Delimiter::Byte(b','), false, &[Slot::Axis(0), Slot::Skip]);
    for (length, fits) in [((1 << 20) - 1, true), (1 << 20, false)] {
        let text = format!("1,a\n2,b\n3,{}\n4,d\n", "x".repeat(length - 2));
        let read = in_chunks(text.as_bytes(), &form, CHUNK, usize::MAX);
        let expected = if fits { (vec![1, 2, 3, 4], None) } else { (vec![1, 2], Some((3, Fault::TooLong))) };
        assert_eq!((read.lines, read.fault), expected);
    }
}

/// Every way that a processor has gives the same for every byte and every number of digits.
#[test]
fn many_bytes_at_once() {
    let mut dice = Dice::new(5);
    for _ in 0..2000 {
        let dense = dice.up_to(20) == 0;
        let block: [u8; 64] = std::array::from_fn(|_| match dice.up_to(3) {
            _ if dense => b'\n',
            0 => dice.up_to(255) as u8,
            1 => b"\n\"; \t"[dice.up_to(4)],
            _ => b'0' + dice.up_to(9) as u8,
        });
        let bits = |is: &dyn Fn(u8) -> bool| block.iter().rev().fold(0, |all, b| all << 1 | u64::from(is(*b)));
        let (feeds, quotes) = (bits(&|x| x == b'\n'), bits(&|x| x == b'"'));
        let ends = |a: u8, b: u8| (bits(&|x| x == a || x == b) | feeds, feeds, quotes);
        let others = bits(&|x| !x.is_ascii_digit()) as u32;
        let start = block.first_chunk::<32>().unwrap();
        let digits = dice.digits(16);
        let text = <[u8; 16]>::try_from(digits.as_bytes()).unwrap();
        let numbers: Vec<u64> = (1..=16).map(|count| digits[16 - count..].parse().unwrap()).collect();
        let semicolons = ends(b';', b';');
        let places = (0..64).filter(|i| semicolons.0 >> i & 1 == 1).map(|i| i + 1000).collect();
        let expected = (ends(b' ', b'\t'), semicolons, others, numbers, places);
        type Found = ((u64, u64, u64), (u64, u64, u64), u32, Vec<u64>, Vec<u32>);
        fn all(simd: impl Bytes, block: &[u8; 64], start: &[u8; 32], text: &[u8; 16]) -> Found {
            let numbers = (1..=16).map(|count| simd.sixteen(text, count)).collect();
            let semicolons = simd.ends(block, [b';', b';']);
            let mut places = [0; 80];
            simd.places(semicolons.0, 1000, &mut places);
            let places = places[..semicolons.0.count_ones() as usize].to_vec();
            (simd.ends(block, [b' ', b'\t']), semicolons, simd.others(start), numbers, places)
        }
        assert_eq!(all(Words, &block, start, &text), expected);
        #[cfg(target_arch = "x86_64")]
        if let Some(simd) = pulp::x86::V3::try_new() {
            assert_eq!(all(simd, &block, start, &text), expected);
        }
        #[cfg(target_arch = "x86_64")]
        if let Some(simd) = pulp::x86::V4::try_new() {
            assert_eq!(all(simd, &block, start, &text), expected);
        }
    }
}

/// What a whole table hands out, and the message with which it ends.
fn table(path: &Path, chunk: Option<usize>) -> (Read, Option<String>) {
    let mut table = TextTable::open(path, &Account::new(u64::MAX)).unwrap();
    table.chunk = chunk;
    table.select(Some(0), &[1, 2], None);
    let (mut rows, mut read) = (Rows::default(), Read::default());
    loop {
        match table.next_rows(&mut rows) {
            Ok(true) => read.add(&rows, 0),
            Ok(false) => return (read, None),
            Err(error) => return (read, Some(error.message)),
        }
    }
}

/// A long log with something wrong in it, plain and compressed: the same rows and the same message, for any number
/// of threads.
#[test]
fn tables_are_refused_alike() {
    let folder = tempfile::tempdir().unwrap();
    let good: Vec<String> = (0..20_000)
        .map(|i| format!("{:.2},{:.9},{:e}", 0.01 * f64::from(i), f64::from(i).sin(), f64::from(i).cos()))
        .collect();
    let wrong =
        ["", "1,2", "1,2,3,4", "1,abc,3", "x,1,2", "1,2,\"3", "# rest", "1,2,3,", &"9".repeat(2 << 20), "1,é,3"];
    for (i, wrong) in wrong.iter().enumerate() {
        let mut lines = good.clone();
        lines[19_000] = (*wrong).to_string();
        let mut text = format!("\u{feff}# a log\nt_s,gx_dps,gy_dps\n{}\n", lines.join("\n")).into_bytes();
        if i == 0 {
            text.truncate(text.len() - 20); // inside a row
        }
        let plain = folder.path().join("log.csv");
        std::fs::write(&plain, &text).unwrap();
        let packed = folder.path().join("log.csv.gz");
        let mut gz = flate2::write::GzEncoder::new(Vec::new(), flate2::Compression::fast());
        gz.write_all(&text).unwrap();
        let mut bytes = gz.finish().unwrap();
        if i == 1 {
            bytes.truncate(bytes.len() / 2);
        }
        std::fs::write(&packed, &bytes).unwrap();
        for path in [&plain, &packed] {
            let expected = table(path, None);
            let rows = expected.0.lines.len();
            assert!(rows > 9000 && (expected.1.is_some() || rows == 19_999 || rows == 20_000), "{wrong}: {rows}");
            for threads in [1, 2, 3] {
                let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
                for size in [1000, 1 << 16, CHUNK] {
                    assert_eq!(pool.install(|| table(path, Some(size))), expected, "{i} {threads} {size}");
                }
            }
        }
    }
}
