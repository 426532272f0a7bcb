//! Logs in memory: columns of NumPy, lent to the work without a copy.
//!
//! The work runs on threads that outlive no call and hold no interpreter, and an array must not leave the call that
//! borrowed it. So the thread that waits keeps the arrays, and hands rows over when they are asked for (`job`): whole
//! arrays are neither copied nor written to a file, and no lifetime is stretched.

use std::ops::Range;
use std::sync::mpsc::{Sender, channel};

use kfdesign::numerics::progress::Samples;
use numpy::ndarray::ArrayView1;
use numpy::{PyArrayMethods, PyReadonlyArray1};
use pyo3::prelude::*;

use crate::job::Message;

/// A log under its name: heads of its columns (none: unnamed), and the columns, all of one length.
pub(crate) struct Lent {
    pub(crate) name: String,
    pub(crate) heads: Vec<String>,
    pub(crate) columns: Vec<Py<numpy::PyArray1<f64>>>,
}

impl<'a, 'py> FromPyObject<'a, 'py> for Lent {
    type Error = PyErr;

    fn extract(object: Borrowed<'a, 'py, PyAny>) -> PyResult<Lent> {
        let (name, heads, columns) = object.extract()?;
        Ok(Lent { name, heads, columns })
    }
}

impl Lent {
    pub(crate) fn borrowed<'py>(&self, py: Python<'py>) -> PyResult<Vec<PyReadonlyArray1<'py, f64>>> {
        self.columns.iter().map(|column| Ok(column.bind(py).try_readonly()?)).collect()
    }
}

/// What the work sees of it.
pub(crate) struct Asked {
    pub(crate) number: usize,
    pub(crate) heads: Vec<String>,
    pub(crate) columns: usize,
    pub(crate) rows: u64,
    pub(crate) ask: Sender<Message>,
}

impl Samples for Asked {
    fn names(&self) -> Vec<String> {
        self.heads.clone()
    }
    fn columns(&self) -> usize {
        self.columns
    }
    fn rows(&self) -> u64 {
        self.rows
    }
    fn read(&self, column: usize, rows: Range<u64>, into: &mut Vec<f64>) {
        let (back, answer) = channel();
        // who is gone answers nothing
        let _ = self.ask.send(Message::Rows { log: self.number, column, rows, back });
        into.extend(answer.recv().unwrap_or_default());
    }
}

/// These rows of a column, whatever its stride.
pub(crate) fn rows(column: &ArrayView1<'_, f64>, rows: Range<u64>) -> Vec<f64> {
    let here = rows.start as usize..rows.end as usize;
    match column.as_slice() {
        Some(values) => values.get(here).unwrap_or_default().to_vec(),
        None => column.iter().skip(here.start).take(here.len()).copied().collect(),
    }
}
