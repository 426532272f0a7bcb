//! Logs in memory: columns of NumPy, lent to the work.
//!
//! What a request names is a path, and the work holds no interpreter. So the thread that waits lends the arrays under a
//! name and has rows handed over as they are asked for ([`crate::job`]): no array is written to a file or copied as a
//! whole. Bytes cross the border: an array's own type would bring a second matrix library into the build, for nothing.

use std::ops::Range;
use std::sync::mpsc::{Sender, channel};

use kfdesign::numerics::progress::Samples;
use pyo3::prelude::*;
use pyo3::types::PyBytes;

use crate::job::Message;

/// A log under its name: heads of its columns (none: unnamed), how many columns and rows, and what hands over
/// `rows(column, start, end)` as bytes of doubles.
#[derive(FromPyObject)]
pub(crate) struct Lent(pub(crate) String, Vec<String>, usize, u64, Py<PyAny>);

impl Lent {
    pub(crate) fn rows(&self, py: Python<'_>, column: usize, rows: Range<u64>) -> PyResult<Vec<f64>> {
        let bytes = self.4.bind(py).call1((column, rows.start, rows.end))?;
        Ok(doubles(bytes.cast::<PyBytes>()?.as_bytes()))
    }

    pub(crate) fn seen(&self, number: usize, ask: Sender<Message>) -> Seen {
        Seen { number, heads: self.1.clone(), columns: self.2, rows: self.3, ask }
    }
}

/// What the work sees of it.
pub(crate) struct Seen {
    number: usize,
    heads: Vec<String>,
    columns: usize,
    rows: u64,
    ask: Sender<Message>,
}

impl Samples for Seen {
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

/// Doubles as this machine stores them; and back.
pub(crate) fn doubles(bytes: &[u8]) -> Vec<f64> {
    bytes.as_chunks().0.iter().map(|one| f64::from_ne_bytes(*one)).collect()
}

pub(crate) fn bytes<'py>(py: Python<'py>, values: &[f64]) -> PyResult<Bound<'py, PyBytes>> {
    PyBytes::new_with(py, values.len() * 8, |into| {
        into.as_chunks_mut().0.iter_mut().zip(values).for_each(|(one, value)| *one = value.to_ne_bytes());
        Ok(())
    })
}
