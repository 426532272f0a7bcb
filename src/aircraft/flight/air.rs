//! The moving air along one flight: turbulence at the steps, straight in between, and discrete gusts along the way.

use super::streams;
use crate::aircraft::atmosphere::Gust;
use crate::aircraft::atmosphere::discrete::DiscreteGust;
use crate::aircraft::atmosphere::dryden::Dryden;
use crate::aircraft::atmosphere::turbulence::Turbulence;
use crate::numerics::linalg::LinalgError;

/// Between two steps the gust goes straight: its spectrum then differs from the exact one by (ω h)²/6 at most, where a
/// held one lags by half a step too.
#[derive(Debug)]
pub(super) struct MovingAir {
    turbulence: Vec<Turbulence>,
    discrete: Vec<DiscreteGust>,
    /// Where on the way through the air each discrete gust begins.
    begins: Vec<Option<f64>>,
    now: Gust,
    next: Gust,
}

impl MovingAir {
    /// Steps of `h` (s).
    pub(super) fn new(
        dryden: &[Dryden],
        discrete: &[DiscreteGust],
        h: f64,
        seed: u64,
        run: u64,
    ) -> Result<MovingAir, LinalgError> {
        let turbulence = (0..)
            .zip(dryden)
            .map(|(i, dryden)| Turbulence::new(&dryden.model(), h, streams::gust(seed, run, i)))
            .collect::<Result<Vec<_>, _>>()?;
        let mut air = MovingAir {
            turbulence,
            discrete: discrete.to_vec(),
            begins: vec![None; discrete.len()],
            now: Gust::default(),
            next: Gust::default(),
        };
        air.now = air.sum();
        air.ahead();
        Ok(air)
    }

    fn sum(&self) -> Gust {
        self.turbulence.iter().fold(Gust::default(), |sum, t| sum.plus(&t.gust()))
    }

    fn ahead(&mut self) {
        self.turbulence.iter_mut().for_each(Turbulence::step);
        self.next = self.sum();
    }

    /// To the next step.
    pub(super) fn step(&mut self) {
        self.now = self.next;
        self.ahead();
    }

    /// Discrete gusts whose time has come begin here.
    pub(super) fn begin(&mut self, time: f64, way: f64) {
        for (gust, begin) in self.discrete.iter().zip(&mut self.begins) {
            if gust.start <= time + super::surfaces::SAME_TIME {
                begin.get_or_insert(way);
            }
        }
    }

    /// The first beginning of a discrete gust within an interval, ends left out.
    pub(super) fn next_begin(&self, after: f64, before: f64) -> Option<f64> {
        let same = super::surfaces::SAME_TIME;
        let starts = self.discrete.iter().map(|gust| gust.start);
        starts.filter(|start| *start > after + same && *start < before - same).min_by(f64::total_cmp)
    }

    /// At a part of the present step, 0 to 1, and a way through the air.
    #[inline(always)]
    pub(super) fn gust(&self, part: f64, way: f64) -> Gust {
        let turbulence = if self.turbulence.is_empty() { Gust::default() } else { self.now.towards(&self.next, part) };
        let begun = self.discrete.iter().zip(&self.begins).filter_map(|(gust, begin)| Some((gust, (*begin)?)));
        begun.fold(turbulence, |sum, (gust, begin)| sum.plus(&gust.at(way - begin)))
    }
}
