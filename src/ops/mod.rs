//! One file per command: what it is asked for, a `Request`, becomes a result with its document (floor 8).
//!
//! A request is described once: its fields are flags of the command line, and keys of a JSON object (unknown ones are
//! refused). Nothing here prints: notes and progress go to who waits ([`crate::numerics::progress`]), files other than
//! tables that are longer than memory are written by who asked. Errors are one line each, for a person.

pub mod aid_columns;
pub mod allan;
pub mod amounts;
pub mod checked;
pub mod compare;
pub mod identify;
pub mod inflate;
mod logs;
pub mod plan;
pub mod reading;
pub mod replay;
pub mod simulate;
pub mod stretch;
pub mod tune;
pub mod windows;
