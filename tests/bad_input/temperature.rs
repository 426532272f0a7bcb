//! `identify --temperature`.

use super::{Row, assert_refused};

#[test]
fn temperatures_that_cannot_be_used() {
    fn row<'a>(flags: &'a str, words: &'a [&'a str]) -> Row<'a> {
        let heads = "t_s,gyro_x (deg/s),temp_c,other,hot (deg)";
        let rows: String = (0..40).map(|i| format!("{i},{},2{},1,2\n", i * 7 % 5, i % 3)).collect();
        (flags, "log.csv", format!("{heads}\n{rows}").into_bytes(), flags, words)
    }
    assert_refused(vec![
        row("identify log.csv --temperature warm", &["log.csv: line 1: no column 'warm'", "3 'temp_c'"]),
        row("identify log.csv --temperature 9", &["no column '9'"]),
        row(
            "identify log.csv --temperature other -o p.json",
            &["temperature column 'other' has no unit; say it with --temperature \"other:degC\""],
        ),
        row("identify log.csv --temperature 5", &["'hot (deg)' is in deg by its header, which is no temperature"]),
        row(
            "identify log.csv --temperature 5:degC",
            &["'hot (deg)' is in deg by its header, but --temperature says degC"],
        ),
        row(
            "identify log.csv --temperature temp_c:degF",
            &["'temp_c' is in degC by its header, but --temperature says degF"],
        ),
        row("identify log.csv --temperature other:deg", &["no column 'other:deg'"]),
        row("identify log.csv --temperature 1:K", &["column 't_s' is taken both as temperature and as time"]),
        row("identify log.csv --temperature 2:K", &["'gyro_x (deg/s)' is taken both as temperature and as an axis"]),
        row(
            "identify log.csv --temperature temp_c --method allan -o p.json",
            &["--temperature temp_c: only --method likelihood has a regression on temperature"],
        ),
    ]);
    let empty = "gyro_x (deg/s),temp_c\n0,\n1,\n2,nan\n".to_string().into_bytes();
    let run = "identify log.csv --rate 1 --temperature temp";
    assert_refused(vec![("empty", "log.csv", empty, run, &["temperature column 'temp' holds no number in 3 rows"])]);
}
