//! `kfdesign export --to c|rust`.

use std::io::Write;
use std::path::{Path, PathBuf};

use anyhow::{Context, anyhow, bail};

use super::super::Status;
use super::super::files;
use super::super::output::{print_report, print_text};
use super::{Args, TargetFlag};
use crate::export::atomic::{self, AtomicFile};
use crate::export::code::{self, Code, Gain, Precision, Source};
use crate::input::sha256;
use crate::ops::checked;
use crate::view;

/// Of the code.
#[derive(Debug, clap::Args)]
pub(super) struct Flags {
    /// c, rust: numbers that the code computes with [default: float]
    #[arg(long, value_enum)]
    precision: Option<PrecisionFlag>,
    /// c, rust: carry the covariance, or use the gains of the steady state from the first sample on [default: full]
    #[arg(long, value_enum)]
    form: Option<FormFlag>,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
enum PrecisionFlag {
    Float,
    Double,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
enum FormFlag {
    Full,
    ConstantGain,
}

impl Flags {
    /// For targets that are not code.
    pub(super) fn refuse(&self) -> anyhow::Result<()> {
        match (self.precision, self.form) {
            (None, None) => Ok(()),
            (Some(_), _) => bail!("--precision is for --to c and --to rust"),
            (None, Some(_)) => bail!("--form is for --to c and --to rust"),
        }
    }
}

pub(super) fn run(args: &Args) -> anyhow::Result<Status> {
    let others = [
        ("--accelerometer", args.accelerometer.is_some()),
        ("--rate", args.rate.is_some()),
        ("--inflate", args.inflate.is_some()),
        ("--walk", args.walk.is_some()),
        ("--allow-zero-walk", args.allow_zero_walk),
    ];
    if let Some((flag, _)) = others.iter().find(|(_, given)| *given) {
        bail!("{flag} is for noise parameters; tune a filter with them, then export it as code");
    }
    let path = &args.params;
    let (folder, name) = place(args)?;
    files::check(&[], &[path])?;
    let mut design = checked::design(path)?;
    if let Some(axis) = &args.axis {
        let names: Vec<String> = design.axes.iter().map(|a| a.name.clone()).collect();
        design.axes.retain(|a| a.name == *axis);
        if design.axes.is_empty() {
            bail!("--axis {axis}: the axes are {}", names.join(", "));
        }
    }
    let shown = path.file_name().unwrap_or_default().to_string_lossy();
    let code = Code {
        precision: match args.code.precision.unwrap_or(PrecisionFlag::Float) {
            PrecisionFlag::Float => Precision::Float,
            PrecisionFlag::Double => Precision::Double,
        },
        gain: match args.code.form.unwrap_or(FormFlag::Full) {
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
    let sources = match args.to {
        TargetFlag::C => code::c(&design, &code).map_err(failed)?,
        _ => vec![code::rust(&design, &code).map_err(failed)?],
    };
    match folder {
        Some(folder) => {
            let files = write(&folder, &name, &sources, path)?;
            let test = (args.to == TargetFlag::C).then(|| code::self_test_command(&name));
            print_report(&view::export::export(&files, test));
        }
        None => print_text(&sources.iter().map(|source| source.text.as_str()).collect::<String>()),
    }
    Ok(Status::Done)
}

/// Folder and name of what is written; a module of Rust without a file is called filter.
fn place(args: &Args) -> anyhow::Result<(Option<PathBuf>, String)> {
    let (language, extension) = if args.to == TargetFlag::C { ("c", "c") } else { ("rust", "rs") };
    let Some(output) = &args.output else {
        if args.to == TargetFlag::C {
            bail!("--to c writes three files: give -o NAME.c");
        }
        return Ok((None, "filter".into()));
    };
    let name = output.file_stem().unwrap_or_default().to_string_lossy().into_owned();
    if output.extension().is_none_or(|found| found != extension) {
        bail!("-o {}: --to {language} writes NAME.{extension}", output.display());
    }
    code::check_name(&name).map_err(|message| anyhow!("-o {}: {message}", output.display()))?;
    Ok((Some(output.parent().unwrap_or(Path::new("")).to_path_buf()), name))
}

/// All files or, when one cannot be made, none; their names.
fn write(folder: &Path, name: &str, sources: &[Source], input: &Path) -> anyhow::Result<Vec<String>> {
    let mut files = Vec::new();
    for source in sources {
        let path = folder.join(format!("{name}{}", source.suffix));
        atomic::refuse_input_as_output(&path, input)?;
        let mut file = AtomicFile::create(&path)?;
        file.write_all(source.text.as_bytes()).with_context(|| path.display().to_string())?;
        files.push(file);
    }
    let mut names = Vec::new();
    for file in files {
        names.push(file.path().display().to_string());
        file.commit()?;
    }
    Ok(names)
}
