//! Filters that cannot become source code.

use serde_json::{Value, json};

use super::{Row, assert_refused, filter};

#[test]
fn filters_that_cannot_become_code() {
    fn row<'a>(command: &'a str, words: &'a [&'a str]) -> Row<'a> {
        changed(command, command, &|_| {}, words)
    }
    fn changed<'a>(what: &'a str, command: &'a str, change: &dyn Fn(&mut Value), words: &'a [&'a str]) -> Row<'a> {
        (what, "filter.json", filter(change), command, words)
    }
    let c = "export filter.json --to c -o drift.c";
    assert_refused(vec![
        ("missing file", "", vec![], c, &["filter.json: cannot read"]),
        (
            "not a filter",
            "filter.json",
            b"{\"format\": \"kfdesign-params/1\"}".to_vec(),
            c,
            &["format", "kfdesign-filter/1"],
        ),
        ("attitude", "filter.json", b"{\"format\": \"kfdesign-attitude/1\"}".to_vec(), c, &["attitude", "nonlinear"]),
        row("export filter.json --to c", &["--to c writes three files: give -o NAME.c"]),
        row("export filter.json --to c -o drift.h", &["-o drift.h: --to c writes NAME.c"]),
        row("export filter.json --to rust -o drift.c", &["-o drift.c: --to rust writes NAME.rs"]),
        row("export filter.json --to c -o 2fast.c", &["'2fast'", "small letters"]),
        row("export filter.json --to rust -o static.rs", &["'static'", "no word of C"]),
        row("export filter.json --to c -o float.c", &["'float'"]),
        row("export filter.json --to c -o no/such/drift.c", &["no/such/drift.c: cannot write"]),
        row("export filter.json --to c -o drift.c --axis w", &["--axis w: the axes are x"]),
        row("export filter.json --to c -o drift.c --inflate 2", &["--inflate is for noise parameters"]),
        row("export filter.json --to c -o drift.c --walk short", &["--walk is for noise parameters"]),
        row("export filter.json --to kalibr --precision double", &["--precision is for --to c and --to rust"]),
        row("export filter.json --to kalibr --form full", &["--form is for --to c and --to rust"]),
        row("export filter.json --to c -o drift.c --precision half", &["float, double"]),
        changed(
            "too small for a float",
            c,
            &|d| {
                d["axes"][0]["steady_state"] = Value::Null;
                d["axes"][0].as_object_mut().unwrap().remove("steady_state");
                d["axes"][0]["Q"][1][1] = json!(1e-35);
            },
            &["axis 'x': Q holds", "single precision", "--precision double"],
        ),
    ]);
}
