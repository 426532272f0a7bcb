//! A text log in chunks of whole lines, parsed on all threads; a thread parses what it has just read, which is then in its cache. Order and
//! numbers do not depend on how many threads there are, nor on where the chunks end.

use std::collections::VecDeque;
use std::io::{BufRead, ErrorKind};
use std::sync::{Mutex, PoisonError};

use rayon::prelude::*;

use super::LONGEST_LINE;
use super::digits::LEAD;
use super::fast::{Lines, ROOM, Text};
use super::row::{Fault, Form};
use crate::input::Rows;

/// Bytes of a chunk; one with a longer line grows.
pub(super) const CHUNK: usize = 1 << 18;
/// Chunks at a time, however many threads there are.
const MOST: usize = 64;

/// Lines and what was read of them.
#[derive(Debug, Default)]
pub(super) struct Chunk {
    /// In the order of the file, among those read together.
    number: usize,
    /// [`LEAD`] bytes, the lines, [`ROOM`] bytes.
    text: Vec<u8>,
    /// Where the lines end.
    end: usize,
    unended: bool,
    parser: Lines,
    /// Line numbers count from the beginning of the chunk.
    pub(super) rows: Rows,
    pub(super) lines: u64,
    /// Of the line behind the last one.
    pub(super) fault: Option<Fault>,
}

impl Chunk {
    fn parse(&mut self, form: &Form) {
        self.rows.clear(form.columns_of_values());
        let (lines, fault) = {
            let text = Text { bytes: &self.text, end: self.end, unended: self.unended };
            self.parser.read(form, text, &mut self.rows)
        };
        self.lines = lines;
        // a line that cannot be read stands behind all others
        self.fault = fault.or(self.fault.take());
    }
}

/// Chunks in the order of the file.
#[derive(Debug)]
pub(super) struct Ahead {
    size: usize,
    parsed: VecDeque<Chunk>,
    spare: Vec<Chunk>,
    /// The beginning of the line at which the last chunk was cut.
    tail: Vec<u8>,
    ended: bool,
}

impl Ahead {
    pub(super) fn new(size: usize) -> Self {
        Ahead { size, parsed: VecDeque::new(), spare: Vec::new(), tail: Vec::new(), ended: false }
    }

    /// The next chunk, parsed; `step`: the most that is asked of the reader at once.
    pub(super) fn next(&mut self, reader: &mut (dyn BufRead + Send), step: usize, form: &Form) -> Option<Chunk> {
        if self.parsed.is_empty() {
            let chunks = (4 * rayon::current_num_threads()).clamp(4, MOST);
            // who has the file reads a chunk, and parses it while others read and parse theirs
            let file = Mutex::new((&mut *self, reader, 0));
            let done = Mutex::new(Vec::new());
            (0..chunks).into_par_iter().for_each(|_| {
                let mut chunk = {
                    let mut file = file.lock().unwrap_or_else(PoisonError::into_inner);
                    let (ahead, reader, number) = &mut *file;
                    let mut chunk = ahead.spare.pop().unwrap_or_default();
                    if !ahead.fill(&mut chunk, *reader, step) {
                        return;
                    }
                    chunk.number = *number;
                    *number += 1;
                    chunk
                };
                chunk.parse(form);
                done.lock().unwrap_or_else(PoisonError::into_inner).push(chunk);
            });
            let mut done = done.into_inner().unwrap_or_else(PoisonError::into_inner);
            done.sort_unstable_by_key(|chunk| chunk.number);
            self.parsed.extend(done);
        }
        self.parsed.pop_front()
    }

    /// A chunk that is no longer needed.
    pub(super) fn give_back(&mut self, chunk: Chunk) {
        self.spare.push(chunk);
    }

    /// False if there is nothing more.
    fn fill(&mut self, chunk: &mut Chunk, reader: &mut (dyn BufRead + Send), step: usize) -> bool {
        if self.ended {
            return false;
        }
        let mut end = LEAD + self.tail.len();
        let mut most = LEAD + self.size.max(self.tail.len() + 1).min(LONGEST_LINE as usize);
        chunk.text.resize(chunk.text.len().max(most + ROOM), 0);
        chunk.text[LEAD..end].copy_from_slice(&self.tail);
        self.tail.clear();
        (chunk.unended, chunk.fault) = (false, None);
        loop {
            if end == most {
                if chunk.text[LEAD..end].contains(&b'\n') {
                    break;
                }
                if end - LEAD == LONGEST_LINE as usize {
                    (chunk.fault, self.ended) = (Some(Fault::TooLong), true);
                    break;
                }
                most = (LEAD + 2 * (end - LEAD)).min(LEAD + LONGEST_LINE as usize);
                chunk.text.resize(chunk.text.len().max(most + ROOM), 0);
            }
            match reader.read(&mut chunk.text[end..most.min(end.saturating_add(step))]) {
                Ok(0) => {
                    self.ended = true;
                    break;
                }
                Ok(more) => end += more,
                Err(error) if error.kind() == ErrorKind::Interrupted => {}
                Err(error) => {
                    (chunk.fault, self.ended) = (Some(Fault::Unreadable(error.to_string())), true);
                    break;
                }
            }
        }
        let whole = chunk.text[LEAD..end].iter().rposition(|b| *b == b'\n').map_or(LEAD, |last| LEAD + last + 1);
        chunk.end = whole;
        if !self.ended {
            self.tail.extend_from_slice(&chunk.text[whole..end]);
        } else if chunk.fault.is_none() && whole < end {
            // the file stops inside a line
            chunk.text[end] = b'\n';
            (chunk.end, chunk.unended) = (end + 1, true);
        }
        chunk.end > LEAD || chunk.fault.is_some()
    }
}
