//! A filter as source code in C or Rust.

use std::path::{Path, PathBuf};

use anyhow::{anyhow, bail};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::{Consumer, Done, File, Request};
use crate::export::code::{self, Code, Gain, Precision, Source};
use crate::input::sha256;
use crate::ops::checked;

/// Of the code.
#[derive(Clone, Debug, Default, clap::Args, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Flags {
    /// c, rust: numbers that the code computes with [default: float]
    #[arg(long, value_enum)]
    #[serde(default)]
    pub precision: Option<PrecisionFlag>,
    /// c, rust: carry the covariance, or use the gains of the steady state from the first sample on [default: full]
    #[arg(long, value_enum)]
    #[serde(default)]
    pub form: Option<FormFlag>,
}

/// Numbers that the code computes with.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum PrecisionFlag {
    Float,
    Double,
}

/// What the code carries beside the estimate.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum FormFlag {
    Full,
    ConstantGain,
}

impl Flags {
    /// For targets that are not code.
    pub(super) fn refuse(&self) -> anyhow::Result<()> {
        match (self.precision, self.form) {
            (None, None) => Ok(()),
            (Some(_), _) => bail!("`precision` is for `to` c and `to` rust"),
            (None, Some(_)) => bail!("`form` is for `to` c and `to` rust"),
        }
    }
}

pub(super) fn run(request: &Request) -> anyhow::Result<Done> {
    let others = [
        ("`accelerometer`", request.accelerometer.is_some()),
        ("`rate`", request.rate.is_some()),
        ("`inflate`", request.inflate.is_some()),
        ("`walk`", request.walk.is_some()),
        ("`allow_zero_walk`", request.allow_zero_walk),
    ];
    if let Some((flag, _)) = others.iter().find(|(_, given)| *given) {
        bail!("{flag} is for noise parameters; tune a filter with them, then export it as code");
    }
    let path = &request.params;
    let (folder, name) = place(request)?;
    let mut design = checked::design(path)?;
    if let Some(axis) = &request.axis {
        let names: Vec<String> = design.axes.iter().map(|a| a.name.clone()).collect();
        design.axes.retain(|a| a.name == *axis);
        if design.axes.is_empty() {
            bail!("`axis` {axis}: the axes are {}", names.join(", "));
        }
    }
    let shown = path.file_name().unwrap_or_default().to_string_lossy();
    let code = Code {
        precision: match request.code.precision.unwrap_or(PrecisionFlag::Float) {
            PrecisionFlag::Float => Precision::Float,
            PrecisionFlag::Double => Precision::Double,
        },
        gain: match request.code.form.unwrap_or(FormFlag::Full) {
            FormFlag::Full => Gain::Full,
            FormFlag::ConstantGain => Gain::Constant,
        },
        origin: vec![
            format!("Made by kfdesign {} from {shown}", env!("CARGO_PKG_VERSION")),
            format!("(sha256 {}).", sha256(path)?),
        ],
        name: name.clone(),
    };
    let failed = |message: String| anyhow!(message).context(path.display().to_string());
    let sources = match request.to {
        Consumer::C => code::c(&design, &code).map_err(failed)?,
        _ => vec![code::rust(&design, &code).map_err(failed)?],
    };
    let self_test = (request.to == Consumer::C).then(|| code::self_test_command(&name));
    let place = |source: &Source| Some(folder.as_ref()?.join(format!("{name}{}", source.suffix)));
    let files = sources.into_iter().map(|source| File { path: place(&source), text: source.text }).collect();
    Ok(Done { files, self_test })
}

/// Folder and name of what is written; a module of Rust without a file is called filter.
fn place(request: &Request) -> anyhow::Result<(Option<PathBuf>, String)> {
    let (language, extension) = if request.to == Consumer::C { ("c", "c") } else { ("rust", "rs") };
    let Some(output) = &request.output else {
        if request.to == Consumer::C {
            bail!("`to` c writes three files: give `output` NAME.c");
        }
        return Ok((None, "filter".into()));
    };
    let name = output.file_stem().unwrap_or_default().to_string_lossy().into_owned();
    if output.extension().is_none_or(|found| found != extension) {
        bail!("`output` {}: `to` {language} writes NAME.{extension}", output.display());
    }
    code::check_name(&name).map_err(|message| anyhow!("`output` {}: {message}", output.display()))?;
    Ok((Some(output.parent().unwrap_or(Path::new("")).to_path_buf()), name))
}
