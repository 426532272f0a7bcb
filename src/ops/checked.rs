//! Parameters and designs as commands read them: what the log behind them failed is said each time.

use std::fs::File;
use std::io::Read;
use std::path::Path;

use anyhow::bail;

use crate::filter::FilterDesign;
use crate::numerics::progress::warning;
use crate::params::Params;

/// Refuses two files that are swapped: a log where a document should be, and the other way round. `order`: in which
/// they should be.
pub(crate) fn not_swapped(document: &Path, log: &Path, order: &str) -> anyhow::Result<()> {
    if is_json(document) == Some(false) && is_json(log) == Some(true) {
        let [document, log] = [document, log].map(Path::display);
        bail!("{document} is no JSON document, but {log} is one: swapped? The order is {order}");
    }
    Ok(())
}

/// Whether the file begins as a JSON object does; `None`: it cannot be read.
fn is_json(path: &Path) -> Option<bool> {
    let mut start = [0; 64];
    let read = File::open(path).and_then(|mut file| file.read(&mut start)).ok()?;
    let text = start[..read].trim_ascii_start();
    Some(text.strip_prefix("\u{feff}".as_bytes()).unwrap_or(text).first() == Some(&b'{'))
}

/// What is read where a document of this kind should be.
///
/// A file that is called .json is a document with a slip of the pen, of which its reader says the line.
fn expect_json(path: &Path, what: &str, how: &str) -> anyhow::Result<()> {
    if path.extension().is_none_or(|ending| ending != "json") && is_json(path) == Some(false) {
        bail!("{}: expected {what}, found no JSON document; {how}", path.display());
    }
    Ok(())
}

/// params.json.
pub(crate) fn params(path: &Path) -> anyhow::Result<Params> {
    expect_json(path, "params.json", "if it is a log, kfdesign identify makes params.json of it")?;
    let params = Params::read(path)?;
    say(path, params.failed_check().as_deref());
    Ok(params)
}

/// filter.json.
pub(crate) fn design(path: &Path) -> anyhow::Result<FilterDesign> {
    expect_json(path, "filter.json", "kfdesign tune makes one of params.json")?;
    let design = FilterDesign::read(path)?;
    say(path, recorded(&design.tuning));
    Ok(design)
}

/// What `tune` has recorded of the parameters.
pub(crate) fn recorded(tuning: &serde_json::Value) -> Option<&str> {
    tuning.get(crate::tune::FAILED_CHECK)?.as_str()
}

pub(crate) fn say(path: &Path, failed: Option<&str>) {
    if let Some(failed) = failed {
        warning(&format!("{}: identified although a check failed: {failed}", path.display()));
    }
}
