//! A table written row block by row block: csv, csv.gz or npy by the extension of the path.

use std::path::Path;

use super::atomic::WriteError;

/// Streaming writer; nothing appears at `path` before `finish`.
pub struct TableWriter {
    _private: (),
}

impl TableWriter {
    /// `header`: column names with units, e.g. `gyro_x (deg/s)`. For npy: a structured 1-D array of f8 fields with these names.
    pub fn create(path: &Path, header: &[String]) -> Result<TableWriter, WriteError> {
        let _ = (path, header);
        todo!()
    }
    /// Column slices of equal length.
    pub fn write(&mut self, columns: &[&[f64]]) -> Result<(), WriteError> {
        let _ = columns;
        todo!()
    }
    pub fn finish(self) -> Result<(), WriteError> {
        todo!()
    }
}
