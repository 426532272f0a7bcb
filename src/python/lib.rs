//! The native module of the Python package: a handful of functions over `kfdesign::ops`, which take and give JSON and
//! arrays. Everything with a name that a user types is Python, in `kfdesign/`.

mod arrays;
mod errors;
mod job;

use std::path::PathBuf;

use kfdesign::allan::{Deviation, deviation::variances};
use kfdesign::cli;
use kfdesign::cli::named::{Made, asked, make};
use kfdesign::export::atomic::AtomicFile;
use kfdesign::input::{Block, LogReader};
use kfdesign::numerics::distribution::chi_square_quantile;
use kfdesign::ops::reading::{Reading, note_check};
use kfdesign::units::Unit;
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::types::PyBytes;
use serde_json::json;

use crate::arrays::{Lent, bytes, doubles};
use crate::errors::raised;
use crate::job::call;

/// What a command is asked for, as JSON, becomes its result. `logs`: those in memory, under their names.
#[pyfunction]
fn run(
    py: Python<'_>,
    name: &str,
    request: &str,
    logs: Vec<Lent>,
    listener: Option<Py<PyAny>>,
    threads: Option<usize>,
) -> PyResult<Outcome> {
    let (made, notes) = call(py, &logs, listener, threads, || make(name, request, true))?;
    Ok(Outcome { made, notes })
}

/// What was made.
#[pyclass(frozen, module = "kfdesign._native")]
struct Outcome {
    made: Made,
    #[pyo3(get)]
    notes: Vec<String>,
}

#[pymethods]
impl Outcome {
    #[getter]
    fn json(&self) -> &str {
        &self.made.json
    }

    #[getter]
    fn file(&self) -> Option<&str> {
        self.made.file.as_deref()
    }

    #[getter]
    fn files(&self) -> Vec<(Option<String>, String)> {
        self.made.files.clone()
    }

    /// Texts by name: `brief` and `full` as on a terminal, `page` of HTML, `figures` as SVG, `junit`.
    fn shown(&self, py: Python<'_>, name: &str) -> PyResult<Option<String>> {
        // on threads of its own like any work: figures of runs are simulated
        Ok(call(py, &[], None, None, || self.made.shown(name))?.0)
    }
}

/// A log: what is in it as JSON, notes; where wished, its axes and stamps as bytes of doubles, SI.
#[pyfunction]
fn log<'py>(
    py: Python<'py>,
    request: &str,
    logs: Vec<Lent>,
    data: bool,
) -> PyResult<(String, Vec<String>, Vec<Bound<'py, PyBytes>>)> {
    let read = || {
        let (log, reading): (PathBuf, Reading) = asked(request)?;
        let mut reader = reading.read(None, |options| LogReader::open(&log, &options))?;
        let check = reader.check().clone();
        if !data {
            note_check(&log.display().to_string(), &check);
        }
        let axes: Vec<_> = reader.axes().iter().map(|axis| (&axis.name, axis.unit.text())).collect();
        let count = if data { axes.len() + 1 } else { 0 };
        let (quantity, sha256) = (reader.quantity(), reader.sha256());
        let text = json!({ "quantity": quantity, "axes": axes, "sha256": sha256, "check": check }).to_string();
        let mut columns: Vec<Vec<f64>> = (0..count).map(|_| Vec::with_capacity(check.samples as usize)).collect();
        let mut block = Block::default();
        while data && reader.next_block(&mut block)? {
            let all = block.values.iter().chain([&block.time_s]);
            columns.iter_mut().zip(all).for_each(|(column, more)| column.extend_from_slice(more));
        }
        Ok((text, columns))
    };
    let ((text, columns), notes) = call(py, &logs, None, None, read)?;
    // one after the other is freed
    Ok((text, notes, columns.into_iter().map(|column| bytes(py, &column)).collect::<PyResult<_>>()?))
}

/// Deviations of a phase, and the number of differences behind each, at averaging factors.
#[pyfunction]
fn deviations(py: Python<'_>, kind: &str, phase: &[u8], dt: f64, factors: Vec<u64>) -> PyResult<Vec<(f64, u64)>> {
    use Deviation::{Adev, Hdev, Mdev, Oadev, Ohdev, Totdev};
    let named = [Adev, Oadev, Mdev, Hdev, Ohdev, Totdev].into_iter().find(|one| json!(one) == kind);
    let kind = named.ok_or_else(|| PyValueError::new_err(format!("no deviation {kind}")))?;
    let phase = &doubles(phase);
    let (found, _) = call(py, &[], None, None, || Ok(variances(kind, phase, dt, &factors)?))?;
    Ok(found.iter().map(|one| (one.variance.sqrt(), one.terms)).collect())
}

/// The factor from a unit to SI, and the name of its dimension.
#[pyfunction]
fn unit(text: &str) -> PyResult<(f64, String)> {
    let unit = Unit::parse(text).map_err(|error| PyValueError::new_err(error.to_string()))?;
    Ok((unit.to_si(1.0), unit.dimension().name()))
}

/// The value below which this share of χ² with so many degrees of freedom lies.
#[pyfunction]
fn chi_square(share: f64, degrees: f64) -> f64 {
    chi_square_quantile(share, degrees)
}

/// Files that appear whole, and all of them or none.
#[pyfunction]
fn write(files: Vec<(PathBuf, String)>) -> PyResult<()> {
    let create = |(path, text): &(PathBuf, String)| {
        let mut output = AtomicFile::create(path)?;
        std::io::Write::write_all(&mut output, text.as_bytes())?;
        anyhow::Ok(output)
    };
    let open = files.iter().map(create).collect::<anyhow::Result<Vec<_>>>();
    open.and_then(|open| Ok(open.into_iter().try_for_each(AtomicFile::commit)?)).map_err(|error| raised(&error))
}

/// The command `kfdesign` with these arguments, in a process that is nothing else; its exit status.
#[pyfunction(name = "cli")]
fn command(py: Python<'_>, arguments: Vec<std::ffi::OsString>) -> u8 {
    py.detach(|| {
        let stop = std::sync::Arc::new(cli::Stop::default());
        cli::watch_signals(&stop);
        cli::run(arguments, &stop)
    })
}

#[pymodule]
fn _native(module: &Bound<'_, PyModule>) -> PyResult<()> {
    // a panic is caught and raised; what Rust prints about it would not reach a notebook
    std::panic::set_hook(Box::new(|_| {}));
    module.add("__version__", env!("CARGO_PKG_VERSION"))?;
    module.add_class::<Outcome>()?;
    module.add_function(wrap_pyfunction!(run, module)?)?;
    module.add_function(wrap_pyfunction!(log, module)?)?;
    module.add_function(wrap_pyfunction!(unit, module)?)?;
    module.add_function(wrap_pyfunction!(deviations, module)?)?;
    module.add_function(wrap_pyfunction!(chi_square, module)?)?;
    module.add_function(wrap_pyfunction!(write, module)?)?;
    module.add_function(wrap_pyfunction!(command, module)?)
}
