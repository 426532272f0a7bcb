//! Parameters and designs as commands read them: what the log behind them failed is said each time.

use std::path::Path;

use crate::filter::FilterDesign;
use crate::params::{Params, ParamsError};

/// params.json.
pub(crate) fn params(path: &Path) -> Result<Params, ParamsError> {
    let params = Params::read(path)?;
    say(path, params.failed_check().as_deref());
    Ok(params)
}

/// filter.json.
pub(crate) fn design(path: &Path) -> anyhow::Result<FilterDesign> {
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
        crate::numerics::progress::note(&format!(
            "  warning: {}: identified although a check failed: {failed}",
            path.display()
        ));
    }
}
