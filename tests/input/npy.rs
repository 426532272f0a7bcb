//! NumPy files: what numpy wrote, and what must not be trusted.

use proptest::prelude::*;
use proptest::test_runner::RngSeed;

use super::{Flags, assert_close, read_bytes, shown};

/// Files as numpy 2.4.6 wrote them (`numpy.lib.format.write_array`): dtype, version, header length, header text, data.
/// All hold the rows (1, 10), (-2, 12), (3, -11), (4, 13), without the signs if the type has none.
const WRITTEN_BY_NUMPY: [(&str, u8, usize, &str, &str); 23] = [
    (
        "<f8",
        1,
        118,
        "{'descr': '<f8', 'fortran_order': False, 'shape': (4, 2), }",
        "000000000000f03f000000000000244000000000000000c00000000000002840000000000000084000000000000026c000000000000010400000000000002a40",
    ),
    (
        ">f8",
        1,
        118,
        "{'descr': '>f8', 'fortran_order': False, 'shape': (4, 2), }",
        "3ff00000000000004024000000000000c00000000000000040280000000000004008000000000000c0260000000000004010000000000000402a000000000000",
    ),
    (
        "<f4",
        1,
        118,
        "{'descr': '<f4', 'fortran_order': False, 'shape': (4, 2), }",
        "0000803f00002041000000c00000404100004040000030c10000804000005041",
    ),
    (
        ">f4",
        1,
        118,
        "{'descr': '>f4', 'fortran_order': False, 'shape': (4, 2), }",
        "3f80000041200000c00000004140000040400000c13000004080000041500000",
    ),
    ("<f2", 1, 118, "{'descr': '<f2', 'fortran_order': False, 'shape': (4, 2), }", "003c004900c0004a004280c90044804a"),
    ("|i1", 1, 118, "{'descr': '|i1', 'fortran_order': False, 'shape': (4, 2), }", "010afe0c03f5040d"),
    ("<i2", 1, 118, "{'descr': '<i2', 'fortran_order': False, 'shape': (4, 2), }", "01000a00feff0c000300f5ff04000d00"),
    (">i2", 1, 118, "{'descr': '>i2', 'fortran_order': False, 'shape': (4, 2), }", "0001000afffe000c0003fff50004000d"),
    (
        "<i4",
        1,
        118,
        "{'descr': '<i4', 'fortran_order': False, 'shape': (4, 2), }",
        "010000000a000000feffffff0c00000003000000f5ffffff040000000d000000",
    ),
    (
        ">i4",
        1,
        118,
        "{'descr': '>i4', 'fortran_order': False, 'shape': (4, 2), }",
        "000000010000000afffffffe0000000c00000003fffffff5000000040000000d",
    ),
    (
        "<i8",
        1,
        118,
        "{'descr': '<i8', 'fortran_order': False, 'shape': (4, 2), }",
        "01000000000000000a00000000000000feffffffffffffff0c000000000000000300000000000000f5ffffffffffffff04000000000000000d00000000000000",
    ),
    (
        ">i8",
        1,
        118,
        "{'descr': '>i8', 'fortran_order': False, 'shape': (4, 2), }",
        "0000000000000001000000000000000afffffffffffffffe000000000000000c0000000000000003fffffffffffffff50000000000000004000000000000000d",
    ),
    ("|u1", 1, 118, "{'descr': '|u1', 'fortran_order': False, 'shape': (4, 2), }", "010a020c030b040d"),
    ("<u2", 1, 118, "{'descr': '<u2', 'fortran_order': False, 'shape': (4, 2), }", "01000a0002000c0003000b0004000d00"),
    (
        ">u4",
        1,
        118,
        "{'descr': '>u4', 'fortran_order': False, 'shape': (4, 2), }",
        "000000010000000a000000020000000c000000030000000b000000040000000d",
    ),
    (
        "<u8",
        1,
        118,
        "{'descr': '<u8', 'fortran_order': False, 'shape': (4, 2), }",
        "01000000000000000a0000000000000002000000000000000c0000000000000003000000000000000b0000000000000004000000000000000d00000000000000",
    ),
    (
        ">u8",
        1,
        118,
        "{'descr': '>u8', 'fortran_order': False, 'shape': (4, 2), }",
        "0000000000000001000000000000000a0000000000000002000000000000000c0000000000000003000000000000000b0000000000000004000000000000000d",
    ),
    (
        "fortran f8",
        1,
        118,
        "{'descr': '<f8', 'fortran_order': True, 'shape': (4, 2), }",
        "000000000000f03f00000000000000c0000000000000084000000000000010400000000000002440000000000000284000000000000026c00000000000002a40",
    ),
    (
        "fortran i2",
        1,
        118,
        "{'descr': '<i2', 'fortran_order': True, 'shape': (4, 2), }",
        "0100feff030004000a000c00f5ff0d00",
    ),
    (
        "version 2",
        2,
        116,
        "{'descr': '<i2', 'fortran_order': False, 'shape': (4, 2), }",
        "01000a00feff0c000300f5ff04000d00",
    ),
    (
        "structured",
        1,
        182,
        "{'descr': [('time (s)', '<f8'), ('gyro_x (deg/s)', '<f4'), ('gyro_y (deg/s)', '>i2')], 'fortran_order': False, 'shape': (4,), }",
        "00000000000000000000803f000a7b14ae47e17a843f000000c0000c7b14ae47e17a943f00004040fff5b81e85eb51b89e3f00008040000d",
    ),
    (
        "datetime",
        1,
        182,
        "{'descr': [('t', '<M8[ns]'), ('label', '|S3'), ('gyr', '<f4', (2,))], 'fortran_order': False, 'shape': (4,), }",
        "0000a0d8855734166162000000803f00002041809638d985573416616200000000c000004041002dd1d98557341661620000004040000030c181c369da855734166162000000804000005041",
    ),
    (
        "aligned unicode",
        3,
        180,
        "{'descr': [('flag', '|u1'), ('', '|V7'), ('ωx', '<f8'), ('ωy', '<f8')], 'fortran_order': False, 'shape': (4,), }",
        "0000000000000000000000000000f03f0000000000002440000000000000000000000000000000c000000000000028400000000000000000000000000000084000000000000026c0000000000000000000000000000010400000000000002a40",
    ),
];

fn unhex(hex: &str) -> Vec<u8> {
    (0..hex.len() / 2).map(|i| u8::from_str_radix(&hex[2 * i..2 * i + 2], 16).unwrap()).collect()
}

fn npy(version: u8, length: usize, header: &str, data: &[u8]) -> Vec<u8> {
    let mut bytes = b"\x93NUMPY".to_vec();
    bytes.extend([version, 0]);
    let little = (length as u32).to_le_bytes();
    bytes.extend(&little[..if version == 1 { 2 } else { 4 }]);
    bytes.extend(header.as_bytes());
    bytes.extend(std::iter::repeat_n(b' ', length - 1 - header.len()));
    bytes.push(b'\n');
    bytes.extend(data);
    bytes
}

#[test]
fn npy_files_of_numpy_are_read_in_every_type_order_and_version() {
    // one file byte for byte, so that `npy` above is known to assemble what numpy writes
    let whole = "934e554d5059010076007b276465736372273a20273c6932272c2027666f727472616e5f6f72646572273a2046616c73652c20277368617065273a2028342c2032292c207d202020202020202020202020202020202020202020202020202020202020202020202020202020202020202020202020202020202020202020200a01000a00feff0c000300f5ff04000d00";
    let (_, version, length, header, data) = WRITTEN_BY_NUMPY.iter().find(|w| w.0 == "<i2").unwrap();
    assert_eq!(npy(*version, *length, header, &unhex(data)), unhex(whole));
    for (kind, version, length, header, data) in WRITTEN_BY_NUMPY {
        let bytes = npy(version, length, header, &unhex(data));
        let named = ["structured", "datetime", "aligned unicode"].contains(&kind);
        let flags: Flags = match kind {
            "structured" => &[],
            "datetime" => &[("unit", "deg/s")],
            "aligned unicode" => &[("columns", "ωx,ωy"), ("unit", "deg/s"), ("rate", "100")],
            _ => &[("columns", "1,2"), ("unit", "deg/s"), ("rate", "100")],
        };
        let (log, check) = read_bytes("log.npy", bytes, flags).unwrap_or_else(|e| panic!("{kind}: {e}"));
        let unsigned = kind.contains('u') && kind.len() == 3;
        let sign = |x: f64| if unsigned { x.abs() } else { x };
        assert_close(&shown(&log, 0), &[1.0, -2.0, 3.0, 4.0].map(sign), kind);
        assert_close(&shown(&log, 1), &[10.0, 12.0, -11.0, 13.0].map(sign), kind);
        assert!((check.sample_rate_hz - 100.0).abs() < 0.01, "{kind}: {}", check.sample_rate_hz);
        assert_eq!(log.axes[0].name.starts_with("column"), !named, "{kind}");
        if kind == "datetime" {
            assert!((log.start_s - 1.6e9).abs() < 1e-6);
            assert_eq!(log.axes[1].name, "gyr[1]");
        }
    }
}

#[test]
fn npy_files_that_cannot_be_trusted_are_refused_before_anything_is_allocated() {
    let plain = "{'descr': '<f8', 'fortran_order': False, 'shape': (4, 2), }";
    let good = npy(1, 118, plain, &[0; 64]);
    let shape = |shape: &str| npy(1, 118, &plain.replace("(4, 2)", shape), &[0; 64]);
    let dtype = |dtype: &str| npy(1, 118, &plain.replace("'<f8'", dtype), &[0; 64]);
    let table: [(&str, Vec<u8>, &str); 20] = [
        ("cut data", good[..good.len() - 5].to_vec(), "truncated: 4 rows are declared, but the file holds only 3"),
        ("cut header", good[..60].to_vec(), "truncated"),
        ("cut magic", good[..4].to_vec(), "npy"),
        ("empty", Vec::new(), "empty"),
        ("data behind", [good.clone(), vec![0; 8]].concat(), "8 bytes follow the array"),
        ("huge shape", shape("(100000000000000, 2)"), "truncated: 100000000000000 rows are declared"),
        ("overflowing shape", shape("(99999999999999999999999, 9)"), "truncated"),
        ("no rows", npy(1, 118, &plain.replace("(4, 2)", "(0, 2)"), &[]), "no rows"),
        ("no columns", npy(1, 118, &plain.replace("(4, 2)", "(4, 0)"), &[]), "no columns"),
        ("three dimensions", shape("(2, 2, 2)"), "3 dimensions"),
        ("no dimension", shape("()"), "0 dimensions"),
        ("objects", dtype("'|O'"), "Python objects"),
        ("object field", dtype("[('a', '|O'), ('b', '<f8')]"), "'a' holds Python objects"),
        ("complex", dtype("'<c16'"), "dtype '<c16'"),
        ("long double", dtype("'<f16'"), "dtype '<f16'"),
        ("text", dtype("'<U4'"), "dtype '<U4'"),
        ("nested", dtype("[('a', [('b', '<f8')])]"), "structure itself"),
        ("no dictionary", npy(1, 118, "exit()", &[0; 64]), "damaged"),
        ("pickle", b"\x80\x04\x95\x16\x00\x00\x00\x00\x00\x00\x00]\x94(K\x01K\x02e.".to_vec(), "pickle"),
        ("zip", b"PK\x03\x04________________".to_vec(), "npz"),
    ];
    for (what, bytes, words) in table {
        let flags = [("columns", "1"), ("unit", "deg/s"), ("rate", "100")];
        let message = read_bytes("log.npy", bytes, &flags).unwrap_err();
        assert!(message.starts_with("log.npy: ") && message.contains(words), "{what}: {message}");
    }
    let wide = npy(1, 118, &plain.replace("(4, 2)", "(1, 5000)").replace("<f8", "|i1"), &[0; 5000]);
    assert!(read_bytes("log.npy", wide, &[]).unwrap_err().contains("save the transpose"));
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 300, failure_persistence: None, rng_seed: RngSeed::Fixed(1), ..ProptestConfig::default() })]

    /// A good file with bytes changed, or cut, is read or refused in one line, never a panic.
    #[test]
    fn damaged_npy_never_panics(cuts in prop::collection::vec((0usize..300, any::<u8>()), 1..8), length in 0usize..300) {
        let header = "{'descr': [('time (s)', '<f8'), ('gyr', '<f4', (2,))], 'fortran_order': False, 'shape': (6,), }";
        let mut bytes = npy(1, 118, header, &[7; 96]);
        for (at, byte) in cuts {
            let at = at % bytes.len();
            bytes[at] = byte;
        }
        bytes.truncate(length.max(6));
        let _ = read_bytes("log.npy", &bytes, &[]);
        let _ = read_bytes("log.npy", &bytes, &[("columns", "1"), ("rate", "1"), ("unit", "deg/s")]);
    }
}

/// A damaged type with a line break in it is still refused in one line.
#[test]
fn control_characters_of_a_header_stay_out_of_messages() {
    let header = "{'descr': [('gyr', '\nf4', (2,))], 'fortran_order': False, 'shape': (6,), }";
    let message = read_bytes("log.npy", npy(1, 118, header, &[7; 48]), &[]).unwrap_err();
    assert!(message.contains("has dtype '\u{fffd}f4', which is not read"), "{message}");
}
