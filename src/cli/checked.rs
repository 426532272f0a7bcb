//! Parameters and designs as commands read them: what the log behind them failed is said each time.

use std::path::Path;

use super::output;
use crate::filter::FilterDesign;
use crate::params::{Params, ParamsError};

/// params.json.
pub(super) fn params(path: &Path) -> Result<Params, ParamsError> {
    let params = Params::read(path)?;
    say(path, params.failed_check().as_deref());
    Ok(params)
}

/// filter.json.
pub(super) fn design(path: &Path) -> anyhow::Result<FilterDesign> {
    let design = FilterDesign::read(path)?;
    say(path, recorded(&design.tuning));
    Ok(design)
}

/// What `tune` has recorded of the parameters.
pub(super) fn recorded(tuning: &serde_json::Value) -> Option<&str> {
    tuning.get(crate::tune::FAILED_CHECK)?.as_str()
}

pub(super) fn say(path: &Path, failed: Option<&str>) {
    if let Some(failed) = failed {
        output::say(&format!("  warning: {}: identified although a check failed: {failed}", path.display()));
    }
}
