//! A text log in chunks of whole lines, parsed on all threads; a thread parses what it has just read, which is then
//! in its cache. Order and numbers do not depend on how many threads there are, nor on where the chunks end.

use std::collections::VecDeque;
use std::io::{BufRead, ErrorKind};
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Mutex, PoisonError};

use rayon::prelude::*;

use super::LONGEST_LINE;
use super::digits::LEAD;
use super::fast::{Lines, ROOM, Text};
use super::row::{Fault, Form};
use crate::input::Rows;

/// Bytes of a chunk; one with a longer line grows.
pub(super) const CHUNK: usize = 1 << 18;
/// Chunks at a time: so many for each thread, that threads seldom wait for the last one, and no more.
const EACH: usize = 16;
const MOST: usize = 128;

/// What was read of consecutive lines.
#[derive(Debug, Default)]
pub(super) struct Chunk {
    /// In the order of the file, among those read together.
    number: usize,
    /// Line numbers count from the beginning of the chunk.
    pub(super) rows: Rows,
    pub(super) lines: u64,
    /// Of the line behind the last one.
    pub(super) fault: Option<Fault>,
}

/// Lines, in the hands of one thread until they are parsed.
#[derive(Debug, Default)]
struct Page {
    /// [`LEAD`] bytes, the lines, [`ROOM`] bytes.
    text: Vec<u8>,
    /// Where the lines end.
    end: usize,
    unended: bool,
    parser: Lines,
}

impl Page {
    fn parse(&mut self, form: &Form, chunk: &mut Chunk) {
        chunk.rows.clear(form.columns_of_values());
        let text = Text { bytes: &self.text, end: self.end, unended: self.unended };
        let (lines, fault) = self.parser.read(form, text, &mut chunk.rows);
        chunk.lines = lines;
        // a line that cannot be read stands behind all others
        chunk.fault = fault.or(chunk.fault.take());
    }
}

/// Chunks in the order of the file.
#[derive(Debug)]
pub(super) struct Ahead {
    size: usize,
    /// Bytes of rows that are enough for a time: short lines make many rows.
    most: u64,
    parsed: VecDeque<Chunk>,
    spare: Vec<Chunk>,
    /// As many as there are threads: each stays in the cache of one.
    pages: Vec<Page>,
    /// The beginning of the line at which the last chunk was cut.
    tail: Vec<u8>,
    ended: bool,
}

/// Of the threads that read chunks.
#[derive(Debug, Default)]
struct Hands {
    pages: Vec<Page>,
    done: Vec<Chunk>,
}

impl Ahead {
    pub(super) fn new(size: usize, most: u64) -> Self {
        let (parsed, spare, pages) = (VecDeque::new(), Vec::new(), Vec::new());
        Ahead { size, most, parsed, spare, pages, tail: Vec::new(), ended: false }
    }

    /// There are parsed chunks.
    pub(super) fn at_hand(&self) -> bool {
        !self.parsed.is_empty()
    }

    /// The next chunk, parsed; `step`: the most that is asked of the reader at once.
    pub(super) fn next(&mut self, reader: &mut (dyn BufRead + Send), step: usize, form: &Form) -> Option<Chunk> {
        if self.parsed.is_empty() && !self.ended {
            let chunks = (EACH * rayon::current_num_threads()).clamp(EACH, MOST);
            let hands = Mutex::new(Hands { pages: std::mem::take(&mut self.pages), done: Vec::new() });
            let (rows, most) = (AtomicU64::new(0), self.most);
            // a column grows by doubling
            let row = 2 * 8 * (2 + form.columns_of_values() as u64);
            let hands_now = || hands.lock().unwrap_or_else(PoisonError::into_inner);
            // who has the file reads a chunk, and parses it while others read and parse theirs
            let file = Mutex::new((&mut *self, reader, 0));
            (0..chunks).into_par_iter().with_max_len(1).for_each(|_| {
                let mut page = hands_now().pages.pop().unwrap_or_default();
                let chunk = {
                    let mut file = file.lock().unwrap_or_else(PoisonError::into_inner);
                    let (ahead, reader, number) = &mut *file;
                    let mut chunk = None;
                    if rows.load(Ordering::Relaxed) * row <= most {
                        *number += 1;
                        let mut next = ahead.spare.pop().unwrap_or_default();
                        next.number = *number;
                        if ahead.fill(&mut page, &mut next, *reader, step) {
                            // lines count when they are read: others read while these are parsed
                            let lines = page.text[LEAD..page.end].iter().filter(|b| **b == b'\n').count();
                            rows.fetch_add(lines as u64, Ordering::Relaxed);
                            chunk = Some(next);
                        }
                    }
                    chunk
                };
                let chunk = chunk.map(|mut chunk| {
                    page.parse(form, &mut chunk);
                    chunk
                });
                let mut hands = hands_now();
                hands.pages.push(page);
                hands.done.extend(chunk);
            });
            let Hands { pages, mut done } = hands.into_inner().unwrap_or_else(PoisonError::into_inner);
            done.sort_unstable_by_key(|chunk| chunk.number);
            self.pages = pages;
            self.parsed.extend(done);
        }
        self.parsed.pop_front()
    }

    /// A chunk that is no longer needed.
    pub(super) fn give_back(&mut self, chunk: Chunk) {
        self.spare.push(chunk);
    }

    /// False if there is nothing more.
    fn fill(&mut self, page: &mut Page, chunk: &mut Chunk, reader: &mut (dyn BufRead + Send), step: usize) -> bool {
        if self.ended {
            return false;
        }
        let mut end = LEAD + self.tail.len();
        let mut most = LEAD + self.size.max(self.tail.len() + 1).min(LONGEST_LINE as usize);
        page.text.resize(page.text.len().max(most + ROOM), 0);
        page.text[LEAD..end].copy_from_slice(&self.tail);
        self.tail.clear();
        (page.unended, chunk.fault) = (false, None);
        loop {
            if end == most {
                if page.text[LEAD..end].contains(&b'\n') {
                    break;
                }
                if end - LEAD == LONGEST_LINE as usize {
                    (chunk.fault, self.ended) = (Some(Fault::TooLong), true);
                    break;
                }
                most = (LEAD + 2 * (end - LEAD)).min(LEAD + LONGEST_LINE as usize);
                page.text.resize(page.text.len().max(most + ROOM), 0);
            }
            match reader.read(&mut page.text[end..most.min(end.saturating_add(step))]) {
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
        let whole = page.text[LEAD..end].iter().rposition(|b| *b == b'\n').map_or(LEAD, |last| LEAD + last + 1);
        page.end = whole;
        if !self.ended {
            self.tail.extend_from_slice(&page.text[whole..end]);
        } else if chunk.fault.is_none() && whole < end {
            // the file stops inside a line
            page.text[end] = b'\n';
            (page.end, page.unended) = (end + 1, true);
        }
        page.end > LEAD || chunk.fault.is_some()
    }
}
