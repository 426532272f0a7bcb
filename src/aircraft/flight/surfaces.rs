//! Commands on their way to the surfaces: computing delay, servo, stop.

use std::collections::VecDeque;

use super::servo::{Motion, Servo, ServoState};
use crate::aircraft::airframe::Controls;

/// Elevator, aileron, rudder, throttle or thrust.
pub(super) const CONTROLS: usize = 4;

/// Times closer than this are one moment, s: sums of steps differ by rounding.
pub(super) const SAME_TIME: f64 = 1e-9;

/// One surface with what moves it; the throttle has no servo.
#[derive(Clone, Debug)]
pub(super) struct Surface {
    servo: Option<Servo>,
    /// From the command to the servo, s.
    delay: f64,
    command: f64,
    state: ServoState,
    /// Of the last step.
    motion: Option<Motion>,
    /// When which command arrives.
    pending: VecDeque<(f64, f64)>,
}

impl Surface {
    /// At rest at a command.
    pub(super) fn new(servo: Option<Servo>, delay: f64, command: f64) -> Surface {
        let state = servo.map_or(ServoState { angle: command, rate: 0.0 }, |servo| servo.at_rest(command));
        Surface { servo, delay, command, state, motion: None, pending: VecDeque::new() }
    }

    /// A command given at a time.
    pub(super) fn order(&mut self, time: f64, command: f64) {
        self.pending.push_back((time + self.delay, command));
    }

    fn receive(&mut self, time: f64) {
        while let Some((_, command)) = self.pending.front().filter(|(at, _)| *at <= time + SAME_TIME) {
            self.command = *command;
            self.pending.pop_front();
        }
        if self.servo.is_none() {
            self.state = ServoState { angle: self.command, rate: 0.0 };
        }
    }

    #[inline(always)]
    fn advance(&mut self, dt: f64) {
        if let Some(servo) = &self.servo {
            servo.advance_again(&mut self.state, self.command, dt, &mut self.motion);
        }
    }
}

/// All of them.
#[derive(Clone, Debug)]
pub(super) struct Surfaces(pub(super) [Surface; CONTROLS]);

impl Surfaces {
    /// Takes the commands that have arrived.
    pub(super) fn receive(&mut self, time: f64) {
        self.0.iter_mut().for_each(|surface| surface.receive(time));
    }

    #[inline(always)]
    pub(super) fn advance(&mut self, dt: f64) {
        self.0.iter_mut().for_each(|surface| surface.advance(dt));
    }

    /// The first arrival of a command within an interval, ends left out.
    pub(super) fn next_arrival(&self, after: f64, before: f64) -> Option<f64> {
        let inside = |time: &f64| *time > after + SAME_TIME && *time < before - SAME_TIME;
        let arrivals = self.0.iter().flat_map(|s| s.pending.iter().map(|(time, _)| *time).find(inside));
        arrivals.min_by(f64::total_cmp)
    }

    pub(super) fn controls(&self) -> Controls {
        let [elevator, aileron, rudder, throttle] = self.0.each_ref().map(|s| s.state.angle);
        Controls { elevator, aileron, rudder, throttle }
    }

    pub(super) fn angles(&self) -> [f64; 3] {
        [0, 1, 2].map(|i| self.0[i].state.angle)
    }

    pub(super) fn rates(&self) -> [f64; 3] {
        [0, 1, 2].map(|i| self.0[i].state.rate)
    }

    /// The last commands that were given, on their way or there.
    pub(super) fn commands(&self) -> [f64; 3] {
        [0, 1, 2].map(|i| self.0[i].pending.back().map_or(self.0[i].command, |(_, command)| *command))
    }
}
