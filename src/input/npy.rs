//! NumPy .npy arrays.

use std::path::Path;

use super::columns::Head;
use super::{InputError, Rows, Table};

pub(super) struct NpyTable {}

impl NpyTable {
    pub(super) fn open(path: &Path) -> Result<NpyTable, InputError> {
        Err(InputError { message: format!("{}: npy is not read yet", path.display()) })
    }
}

impl Table for NpyTable {
    fn heads(&self) -> &[Head] {
        &[]
    }
    fn named(&self) -> bool {
        false
    }
    fn place(&self) -> String {
        String::new()
    }
    fn row_place(&self, _: u64) -> String {
        String::new()
    }
    fn select(&mut self, _: Option<usize>, _: &[usize]) {}
    fn rewind(&mut self) -> Result<(), InputError> {
        Ok(())
    }
    fn origin(&self) -> f64 {
        0.0
    }
    fn next_rows(&mut self, _: &mut Rows) -> Result<bool, InputError> {
        Ok(false)
    }
}
