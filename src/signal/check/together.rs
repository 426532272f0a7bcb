//! Rows in which all axes are alike: all zero, or all as in the row before.

use pulp::{Arch, NullaryFnOnce};

use super::Places;
use super::stamps::Count;

/// Rows looked at together.
const PART: usize = 512;

/// Rows in which all axes are alike.
#[derive(Clone, Debug)]
pub(super) struct Alike {
    pub(super) rows: Count,
    /// Per axis, rows in which all the others are alike.
    pub(super) all_but: Vec<u64>,
}

/// Streaming count of such rows; none are counted for a single axis.
#[derive(Clone, Debug)]
pub(super) struct Together {
    pub(super) zero: Alike,
    pub(super) repeated: Alike,
    /// The last row.
    before: Vec<f64>,
}

/// [`Together::add_parts`] as it is called where the processor can do more at once; every way gives the same.
struct Adding<'a> {
    together: &'a mut Together,
    columns: &'a [&'a [f64]],
    places: Places<'a>,
}

impl NullaryFnOnce for Adding<'_> {
    type Output = ();

    #[inline(always)]
    fn call(self) {
        self.together.add_parts(self.columns, self.places);
    }
}

impl Together {
    pub(super) fn new(axes: usize) -> Self {
        let none = Alike { rows: Count::default(), all_but: vec![0; axes] };
        Together { zero: none.clone(), repeated: none, before: vec![f64::NAN; axes] }
    }

    /// One column of further rows for each axis.
    pub(super) fn add_all(&mut self, columns: &[&[f64]], places: Places) {
        Arch::new().dispatch(Adding { together: self, columns, places });
    }

    #[inline(always)]
    fn add_parts(&mut self, columns: &[&[f64]], places: Places) {
        let rows = columns.first().map_or(0, |column| column.len());
        if columns.len() < 2 {
            return;
        }
        for start in (0..rows).step_by(PART) {
            let end = rows.min(start + PART);
            let (mut with_zeros, mut with_repeats) = (0, 0);
            // no closures here: they would not be compiled for the instructions of the processor
            for (column, before) in columns.iter().zip(&self.before) {
                let part = &column[start..end];
                let mut zeros = false;
                for x in part {
                    zeros |= *x == 0.0;
                }
                let mut repeats = part[0] == if start == 0 { *before } else { column[start - 1] };
                for (x, next) in part.iter().zip(&part[1..]) {
                    repeats |= x == next;
                }
                with_zeros += usize::from(zeros);
                with_repeats += usize::from(repeats);
            }
            // all axes but one must have such a value for a row to count
            if with_zeros + 1 >= columns.len() {
                self.zero.add(columns.len(), start..end, places, |axis, row| columns[axis][row] == 0.0);
            }
            if with_repeats + 1 >= columns.len() {
                let before = &self.before;
                self.repeated.add(columns.len(), start..end, places, |axis, row| {
                    let x = columns[axis][row];
                    x.is_finite() && x == if row == 0 { before[axis] } else { columns[axis][row - 1] }
                });
            }
        }
        if rows > 0 {
            self.before.iter_mut().zip(columns).for_each(|(before, column)| *before = column[rows - 1]);
        }
    }
}

impl Alike {
    #[inline(never)]
    fn add(&mut self, axes: usize, rows: std::ops::Range<usize>, places: Places, is: impl Fn(usize, usize) -> bool) {
        for row in rows {
            let mut others = (0..axes).filter(|axis| !is(*axis, row));
            match (others.next(), others.next()) {
                (None, _) => self.rows.add(places.at(row)),
                (Some(axis), None) => self.all_but[axis] += 1,
                _ => {}
            }
        }
    }
}
