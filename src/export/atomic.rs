//! Files that appear whole or not at all: a temporary file beside the target, renamed on success.

use std::path::Path;

#[derive(Debug, thiserror::Error)]
#[error("{path}: cannot write: {reason}")]
pub struct WriteError {
    pub path: String,
    pub reason: String,
}

/// Write all bytes atomically.
pub fn write(path: &Path, bytes: &[u8]) -> Result<(), WriteError> {
    let _ = (path, bytes);
    todo!()
}
