//! Files made on purpose: a few kB that declare, lead to or unpack to far more. Each is refused in one line or read,
//! within the memory that docs/formats.md promises; each ended in an abort, gigabytes or minutes in the readers
//! before there was one account.

use std::io::Write;

use super::super::support::Bench;
use super::memory::within;

const ROOM: &str = "more memory than four times the file and 16 MiB";
const WORK: &str = "more than 1 GiB and 64 times the file";

fn npy(shape: &str, descr: &str) -> Vec<u8> {
    let header = format!("{{'descr': {descr}, 'fortran_order': False, 'shape': {shape}, }}\n");
    [b"\x93NUMPY\x02\x00", &(header.len() as u32).to_le_bytes()[..], header.as_bytes()].concat()
}

fn ulog(messages: &[(u8, &[u8])]) -> Vec<u8> {
    let mut file = b"ULog\x01\x12\x35\x01\xe8\x03\0\0\0\0\0\0".to_vec();
    for (kind, content) in messages {
        file.extend((content.len() as u16).to_le_bytes());
        file.push(*kind);
        file.extend(*content);
    }
    file
}

fn packed(text: &str) -> Vec<u8> {
    let mut packed = flate2::write::GzEncoder::new(Vec::new(), flate2::Compression::new(9));
    packed.write_all(text.as_bytes()).unwrap();
    packed.finish().unwrap()
}

/// A MATLAB file with one compressed variable.
fn mat(variable: impl FnOnce(&mut dyn Write)) -> Vec<u8> {
    let mut packed = flate2::write::ZlibEncoder::new(Vec::new(), flate2::Compression::new(9));
    variable(&mut packed);
    let packed = packed.finish().unwrap();
    let mut file = b"MATLAB 5.0 MAT-file".to_vec();
    file.resize(124, b' ');
    file.extend(b"\0\x01IM");
    file.extend([15, packed.len() as u32].map(u32::to_le_bytes).concat());
    file.extend(packed);
    file
}

/// The same with so many objects, each with names of this length.
fn objects(count: usize, length: usize) -> Vec<u8> {
    let name = vec![b'o'; length];
    let parts = [element(6, &[17, 0, 0, 0, 0, 0, 0, 0]), element(1, &name), element(1, b"MCOS"), element(1, &name)];
    let one = mat(|out| out.write_all(&element(14, &parts.concat())).unwrap());
    let (head, object) = one.split_at(128);
    [head, &object.repeat(count)].concat()
}

fn element(kind: u32, content: &[u8]) -> Vec<u8> {
    let mut element = [kind, content.len() as u32].map(u32::to_le_bytes).concat();
    element.extend(content);
    element.resize(element.len().next_multiple_of(8), 0);
    element
}

/// What stands before the values of the fields of a structure.
fn structure(name: &[u8], count: i32, fields: &[u8]) -> Vec<u8> {
    let shape: Vec<u8> = [count, 1].iter().flat_map(|n| n.to_le_bytes()).collect();
    let parts =
        [element(6, &[2, 0, 0, 0, 0, 0, 0, 0]), element(5, &shape), element(1, name), element(5, &1i32.to_le_bytes())];
    [parts.concat(), element(1, fields)].concat()
}

/// An HDF5 file in the making: superblock 2, object headers 2.
struct Hdf5(Vec<u8>);

impl Hdf5 {
    fn new() -> Hdf5 {
        Hdf5(vec![0; 48])
    }
    fn put(&mut self, bytes: &[u8]) -> u64 {
        self.0.extend(bytes);
        (self.0.len() - bytes.len()) as u64
    }
    fn object(&mut self, messages: &[(u8, Vec<u8>)]) -> u64 {
        let mut body = Vec::new();
        for (kind, content) in messages {
            body.push(*kind);
            body.extend((content.len() as u16).to_le_bytes());
            body.push(0);
            body.extend(content);
        }
        let head = [b"OHDR\x02\x02", &(body.len() as u32).to_le_bytes()[..], &body, &[0; 4]].concat();
        self.put(&head)
    }
    fn group(&mut self, links: &[(&str, u64)]) -> u64 {
        let link = |name: &str, to: u64| {
            let size = (name.len() as u32).to_le_bytes();
            [&[1, 2], &size[..], name.as_bytes(), &to.to_le_bytes()].concat()
        };
        let links: Vec<(u8, Vec<u8>)> = links.iter().map(|(name, to)| (6, link(name, *to))).collect();
        self.object(&links)
    }
    /// Bytes in the header of the dataset, or where its layout says.
    fn dataset(&mut self, rows: u64, layout: Vec<u8>) -> u64 {
        let shape = [&[2, 1, 0, 1], &rows.to_le_bytes()[..]].concat();
        let unsigned = vec![0x10, 0, 0, 0, 1, 0, 0, 0, 0, 0, 8, 0];
        self.object(&[(1, shape), (3, unsigned), (8, layout), (0xb, vec![2, 1, 1, 0, 0, 0, 0, 0])])
    }
    fn file(mut self, root: u64) -> Vec<u8> {
        let places = [0, u64::MAX, self.0.len() as u64, root].map(u64::to_le_bytes).concat();
        self.0[..44].copy_from_slice(&[&b"\x89HDF\r\n\x1a\n\x02\x08\x08\x00"[..], &places].concat());
        self.0
    }
}

/// A dataset of `count` blocks of 1 MiB, all at one address.
fn shared_block(count: u16) -> Vec<u8> {
    let mut file = Hdf5::new();
    let mut packed = flate2::write::ZlibEncoder::new(Vec::new(), flate2::Compression::new(9));
    packed.write_all(&vec![0; 1 << 20]).unwrap();
    let packed = packed.finish().unwrap();
    let at = file.put(&packed);
    let mut tree = [&b"TREE\x01\x00"[..], &count.to_le_bytes(), &[0xff; 16]].concat();
    for i in 0..u64::from(count) {
        tree.extend([packed.len() as u32, 0].map(u32::to_le_bytes).concat());
        tree.extend([i << 20, 0, at].map(u64::to_le_bytes).concat());
    }
    tree.extend([[0; 8], (u64::from(count) << 20).to_le_bytes(), [0; 8]].concat());
    let tree = file.put(&tree);
    let layout = [&[3, 2, 2][..], &tree.to_le_bytes(), &[0, 0, 16, 0, 1, 0, 0, 0]].concat();
    let data = file.dataset(u64::from(count) << 20, layout);
    let root = file.group(&[("gyro_x", data)]);
    file.file(root)
}

/// Groups of `each` links to the next level, at the bottom a dataset of four bytes.
fn ladder(levels: usize, each: usize, name: &str) -> Vec<u8> {
    let mut file = Hdf5::new();
    let mut below = file.dataset(4, vec![3, 0, 4, 0, 1, 2, 3, 4]);
    for _ in 0..levels {
        let names: Vec<String> = (0..each).map(|i| format!("{name}{i}")).collect();
        let links: Vec<(&str, u64)> = names.iter().map(|name| (name.as_str(), below)).collect();
        below = file.group(&links);
    }
    file.file(below)
}

/// A Parquet file without rows, of these columns: name and number of children.
fn parquet(columns: &[(Vec<u8>, u32)]) -> Vec<u8> {
    let number = |mut n: u32| {
        let mut out = Vec::new();
        while n > 127 {
            out.push((n & 127 | 128) as u8);
            n >>= 7;
        }
        out.push(n as u8);
        out
    };
    let mut contents = [&[0x15, 2, 0x19, 0xfc][..], &number(columns.len() as u32)].concat();
    for (i, (name, children)) in columns.iter().enumerate() {
        // type double or none, required (not the root), name, children
        contents.extend(match (i, children) {
            (0, _) => &[][..],
            (_, 0) => &[0x15, 10, 0x25, 0],
            _ => &[0x35, 0],
        });
        contents.push(if i == 0 { 0x48 } else { 0x18 });
        contents.extend(number(name.len() as u32));
        contents.extend(name);
        if *children > 0 {
            contents.push(0x15);
            contents.extend(number(2 * children));
        }
        contents.push(0);
    }
    contents.extend([0x16, 0, 0x19, 0x0c, 0]);
    [b"PAR1", &contents[..], &(contents.len() as u32).to_le_bytes(), b"PAR1"].concat()
}

fn mcap(records: &[(u8, Vec<u8>)]) -> Vec<u8> {
    let mut file = b"\x89MCAP0\r\n".to_vec();
    for (code, content) in records {
        file.push(*code);
        file.extend((content.len() as u64).to_le_bytes());
        file.extend(content);
    }
    file
}

/// A bag of ROS 2 whose only message is a row of as many values as bytes.
fn row_of_values(bytes: usize) -> Vec<u8> {
    const PAGE: usize = 65536;
    fn varint(mut n: usize) -> Vec<u8> {
        let mut out = vec![(n & 127) as u8];
        while n > 127 {
            n >>= 7;
            out.insert(0, (n & 127 | 128) as u8);
        }
        out
    }
    let row = |values: &[&[u8]], page: u32| {
        let mut head: Vec<u8> = values.iter().flat_map(|text| varint(13 + 2 * text.len())).collect();
        let mut body = values.concat();
        if page > 0 {
            head.insert(3, 4);
            body.splice(body.len() - 1.., page.to_be_bytes().into_iter().chain([b'x']));
        }
        [&[head.len() as u8 + 1], &head[..], &body].concat()
    };
    let cell = |number: u8, row: &[u8]| [varint(row.len()), vec![number], row.to_vec()].concat();
    let leaf = |cells: &[Vec<u8>], start: usize| {
        let mut page = vec![0; PAGE];
        let mut at = PAGE;
        page[start] = 13;
        page[start + 4] = cells.len() as u8;
        for (i, cell) in cells.iter().enumerate() {
            at -= cell.len();
            page[at..at + cell.len()].copy_from_slice(cell);
            page[start + 8 + 2 * i..start + 10 + 2 * i].copy_from_slice(&(at as u16).to_be_bytes());
        }
        page
    };
    let table = |name: &[u8], page: u32| row(&[b"table", name, name, b"x"], page);
    let mut file = leaf(&[cell(1, &table(b"topics", 2)), cell(2, &table(b"messages", 3))], 100);
    file[..21].copy_from_slice(b"SQLite format 3\0\0\x01\0\0\0");
    file.extend(leaf(&[cell(1, &row(&[b"1", b"/imu", b"sensor_msgs/msg/Imu", b"cdr"], 0))], 0));
    let size = varint(bytes);
    let content = [&size[..], &vec![8; bytes - size.len()]].concat();
    let least = (PAGE - 12) * 32 / 255 - 23;
    let here = Some(least + (bytes - least) % (PAGE - 4)).filter(|here| *here <= PAGE - 35).unwrap_or(least);
    file.extend(leaf(&[[&size[..], &[1], &content[..here], &[0, 0, 0, 4]].concat()], 0));
    let chunks: Vec<&[u8]> = content[here..].chunks(PAGE - 4).collect();
    for (i, chunk) in chunks.iter().enumerate() {
        file.extend((if i + 1 < chunks.len() { i as u32 + 5 } else { 0 }).to_be_bytes());
        file.extend(*chunk);
        file.resize(file.len().next_multiple_of(PAGE), 0);
    }
    file
}

#[cfg(target_os = "linux")]
#[test]
fn files_made_on_purpose_take_no_more_than_others() {
    let gyro = |i: usize| (format!("gyro{i}").into_bytes(), 0);
    let nested = |depth: usize| {
        let levels = (0..depth).map(|_| (b"g".to_vec(), 1));
        parquet(&levels.chain([(b"gyro".to_vec(), 0)]).collect::<Vec<_>>())
    };
    let many = |children: u32| parquet(&[(b"root".to_vec(), children), gyro(0)]);
    let below_a_long_name = [(b"root".to_vec(), 1), (vec![b'L'; 20_000], 4000)].into_iter().chain((0..4000).map(gyro));
    let fields = "('a', 'u1', (4096,)), ".repeat(1000);
    let long = [&b"q:uint8_t[8192] "[..], &[b'N'; 2000], b";"].concat();
    let wide: &[(u8, &[u8])] = &[(b'F', b"q:uint8_t[8192] n;"), (b'A', b"\0\0\0q")];
    let wide: Vec<(u8, &[u8])> = [wide, &vec![(b'D', &[0, 0][..]); 100_000]].concat();
    let names = vec![b'a'; 1 << 20];
    let window = [&[0; 16][..], &(1u64 << 40).to_le_bytes(), &[0; 4], b"\x04\0\0\0zstd", &[0; 8]].concat();
    let files: [(&str, Vec<u8>, &str); 19] = [
        ("repeated.npy", npy("(0,)", &format!("[{fields}]")), ROOM),
        ("long.ulg", ulog(&[(b'F', &long), (b'A', b"\0\0\0q"), (b'D', b"\0\0\x01")]), "a name of 2003 bytes"),
        ("wide.ulg", ulog(&wide), WORK),
        (
            "names.mat",
            mat(|out| {
                let head = (0..8).map(|_| structure(b"s", 1, &names)).collect::<Vec<_>>();
                let matrix = |rest: u32| [14, rest].map(u32::to_le_bytes).concat();
                (0..8).for_each(|i| {
                    let rest: usize = head[i..].iter().map(|level| level.len() + 8).sum();
                    out.write_all(&matrix(rest as u32 - 8)).unwrap();
                    out.write_all(&head[i]).unwrap();
                });
            }),
            "a name or shape of over 64 KiB",
        ),
        (
            "elements.mat",
            mat(|out| {
                let head = structure(b"s", 10_000, &[b'a'; 10_000]);
                out.write_all(&[14, head.len() as u32 + 160_000_000].map(u32::to_le_bytes).concat()).unwrap();
                out.write_all(&head).unwrap();
                let many = [14, 0].map(u32::to_le_bytes).concat().repeat(100_000);
                (0..200).for_each(|_| out.write_all(&many).unwrap());
            }),
            WORK,
        ),
        ("objects.mat", objects(5000, 1000), ROOM),
        ("nameless.mat", objects(45_000, 0), ROOM),
        ("shared.h5", shared_block(300), "a block at the address of another"),
        ("long.h5", ladder(6, 8, &"N".repeat(1000)), "a name of 2003 bytes"),
        ("ladder.h5", ladder(16, 20, ""), ""),
        ("deep.h5", ladder(40, 1, "g"), "nested deeper than 32 levels"),
        ("deep.parquet", nested(20_000), "nested deeper than 32 levels"),
        ("long.parquet", parquet(&below_a_long_name.collect::<Vec<_>>()), "a name of 20005 bytes"),
        ("children.parquet", many(1 << 30), "declares more than there is"),
        ("window.mcap", mcap(&[(6, window)]), WORK),
        ("row.db3", row_of_values(8 << 20), "1 rows or pages of the database cannot be read"),
        ("lines.csv.gz", packed(&"0.5\n0.505\n\n..\n".repeat(600_000)), ""),
        ("columns.csv.gz", packed(&[&"0.5\t".repeat(16_580)[..], "0.5\n"].concat().repeat(2)), ROOM),
        ("columns.csv", [&"1,".repeat(100_000)[..], "1\n"].concat().repeat(3).into_bytes(), ROOM),
    ];
    for (name, bytes, expected) in files {
        let bench = Bench::new();
        let path = bench.file(name, &bytes);
        let commands: &[&[&str]] = &[&["info"], &["allan", "--unit", "deg/s", "--rate", "100"]];
        for command in commands {
            let (status, stderr, stdout) = within(&path, command, bytes.len());
            let said = stderr.lines().any(|line| line.contains(expected)) || stdout.contains(expected);
            let fine = matches!(status, Some(0 | 2)) && said && stderr.lines().count() <= 4;
            assert!(fine, "{command:?} of {name}, {} bytes: {status:?} {stderr}", bytes.len());
        }
    }
}
