//! Delimited text, plain or gzip.
