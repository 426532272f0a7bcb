//! One flight from its start to its last row.

use super::FlightError;
use super::air::MovingAir;
use super::autopilot::Autopilot;
use super::motion::{Instant, Rate, State, World, attitude, inertial_rate, position, step};
use super::plan::Plan;
use super::rows::{self, Measured, Measurements};
use super::start::servo_of;
use super::surfaces::{Surface, Surfaces};
use super::vector::to_euler;
use crate::aircraft::airframe::Controls;
use crate::aircraft::atmosphere::Gust;
use crate::aircraft::atmosphere::standard::DensityNear;
use crate::numerics::linalg::eigenvalues;
use nalgebra::DMatrix;

/// Real part of λh down to which the Runge–Kutta method of order 4 is stable (Hairer and Wanner 1996, section IV.2).
const STABLE: f64 = 2.785;

/// An airplane under way.
struct Flying<'a> {
    plan: &'a Plan,
    world: World<'a>,
    x: State,
    surfaces: Surfaces,
    air: MovingAir,
    density: DensityNear,
    /// First of the rows of commands that is not ordered yet.
    next_command: usize,
    /// The derivative at a sample, with its controls: that of the first step from there.
    known: Option<(Controls, State)>,
}

impl Plan {
    /// Flies run number `run` and hands out the rows in order. Errors: the airplane meets the ground or leaves the
    /// standard atmosphere, the integration becomes unstable, or what `hand_out` says.
    pub(super) fn fly<E: From<FlightError>>(
        &self,
        seed: u64,
        run: u64,
        mut hand_out: impl FnMut(&[f64]) -> Result<(), E>,
    ) -> Result<(), E> {
        let mut flying = Flying::new(self, seed, run)?;
        let euler = flying.euler();
        let mut autopilot = self.autopilot.map(|a| {
            Autopilot::new(a.law, a.reference, a.every as f64 / self.grid.rate, a.filter, [euler[0], euler[1]])
        });
        let commander = autopilot.as_mut().map(|autopilot| autopilot as &mut dyn Commander);
        let mut row = Vec::new();
        flying.samples(seed, run, commander, |flying, sample| {
            if sample.number.is_multiple_of(self.grid.row) || sample.number == self.grid.samples {
                let (instant, gust, measured) = (&sample.instant, &sample.gust, &sample.measured);
                rows::row(&mut row, self, sample.time, (&flying.x, instant), &flying.surfaces, gust, measured);
                hand_out(&row)?;
            }
            Ok(())
        })
    }

    /// Flies run number `run` by the commands of `commander` instead of the document's autopilot, with its rate and
    /// delay; `look` sees every sample. Errors: as of a flight; the document has no autopilot.
    pub fn fly_by(
        &self,
        seed: u64,
        run: u64,
        commander: &mut dyn Commander,
        mut look: impl FnMut(f64, &Truth),
    ) -> Result<(), FlightError> {
        if self.autopilot.is_none() {
            return Err(FlightError("autopilot: missing; give its rate and delay".into()));
        }
        let mut flying = Flying::new(self, seed, run)?;
        flying.samples(seed, run, Some(commander), |flying, sample| {
            let truth = Truth {
                velocity: flying.world.through_air(&flying.x),
                rate: inertial_rate(&flying.x),
                angles: [sample.measured.euler[0], sample.measured.euler[1]],
                surfaces: flying.surfaces.angles(),
                surface_rates: flying.surfaces.rates(),
            };
            look(sample.time, &truth);
            Ok(())
        })
    }

    /// About the start. Errors: outside the standard atmosphere.
    fn density(&self) -> Result<DensityNear, FlightError> {
        let height = self.earth.height(position(&self.start));
        DensityNear::new(height).map_err(|e| FlightError(format!("at the start: {e}")))
    }

    /// The linear motion about the start is one that the step can follow. Errors: it is not, with the step.
    pub(super) fn check_step(&self) -> Result<(), FlightError> {
        let world = self.world();
        let [elevator, aileron, rudder, throttle] = self.initial_commands();
        let controls = Controls { elevator, aileron, rudder, throttle };
        let density = self.density()?;
        let rate = |x: &State| world.instant(x, &controls, &Gust::default(), &density).derivative;
        let at = rate(&self.start);
        // velocity and rate are where fast modes live; a millionth of their size is small against what is not linear
        let fast = [3, 4, 5, 10, 11, 12];
        let mut jacobian = DMatrix::zeros(6, 6);
        for (j, &state) in fast.iter().enumerate() {
            let by = 1e-6 * if state < 10 { self.start[3].abs().max(1.0) } else { 1.0 };
            let mut x = self.start;
            x[state] += by;
            let moved = rate(&x);
            for (i, &row) in fast.iter().enumerate() {
                jacobian[(i, j)] = (moved[row] - at[row]) / by;
            }
        }
        let fastest = eigenvalues(&jacobian).into_iter().map(|(re, im)| re.hypot(im)).fold(0.0, f64::max);
        let h = self.step();
        if fastest * h > STABLE {
            return Err(FlightError(format!(
                "a step of {h} s is too long for this airplane, whose fastest mode has {fastest:.1} rad/s: \
                 the integration would be unstable; give `step` {:.1e} s or less",
                1.0 / fastest
            )));
        }
        Ok(())
    }
}

/// What a commander sees of one sample: rates of the gyro (rad/s), roll and pitch (rad) of the attitude reference, NaN
/// where they were not measured, and the true velocity through the steady air (m/s).
#[derive(Clone, Copy, Debug)]
pub struct Seen {
    pub rate: [f64; 3],
    pub angles: [f64; 2],
    pub velocity: [f64; 3],
}

/// Who moves the surfaces.
pub trait Commander {
    /// Elevator, aileron, rudder, rad.
    fn command(&mut self, seen: &Seen) -> [f64; 3];
}

impl Commander for Autopilot {
    fn command(&mut self, seen: &Seen) -> [f64; 3] {
        Autopilot::command(self, seen.rate, seen.angles, seen.velocity)
    }
}

/// How it is at one sample, SI: velocity through the steady air, rate against inertial space, roll and pitch, elevator,
/// aileron and rudder with their rates.
#[derive(Clone, Copy, Debug)]
pub struct Truth {
    pub velocity: [f64; 3],
    pub rate: [f64; 3],
    pub angles: [f64; 2],
    pub surfaces: [f64; 3],
    pub surface_rates: [f64; 3],
}

/// One sample of a flight.
struct Sample {
    number: u64,
    time: f64,
    instant: Instant,
    gust: Gust,
    measured: Measured,
}

impl<'a> Flying<'a> {
    /// From the first sample to the last, each handed to `at` after its command was given.
    fn samples<E: From<FlightError>>(
        &mut self,
        seed: u64,
        run: u64,
        mut commander: Option<&mut dyn Commander>,
        mut at: impl FnMut(&Self, &Sample) -> Result<(), E>,
    ) -> Result<(), E> {
        let plan = self.plan;
        let mut measurements = Measurements::new(plan, seed, run)?;
        for number in 0..=plan.grid.samples {
            let time = number as f64 / plan.grid.rate;
            self.surfaces.receive(time);
            self.air.begin(time, self.x[13]);
            let gust = self.air.gust(0.0, self.x[13]);
            let density = self.density(time)?;
            let controls = self.surfaces.controls();
            let instant = self.world.instant(&self.x, &controls, &gust, &density);
            self.known = Some((controls, instant.derivative));
            let measured = measurements.take(plan, number, &self.x, &instant);
            if let (Some(commander), Some(autopilot)) = (commander.as_deref_mut(), &plan.autopilot)
                && number.is_multiple_of(autopilot.every)
            {
                let angles = [measured.attitude[0], measured.attitude[1]];
                let velocity = self.world.through_air(&self.x);
                let command = commander.command(&Seen { rate: measured.gyro, angles, velocity });
                for (surface, command) in self.surfaces.0.iter_mut().zip(command) {
                    surface.order(time + autopilot.delay, command);
                }
            }
            at(self, &Sample { number, time, instant, gust, measured })?;
            if number < plan.grid.samples {
                self.advance(number)?;
            }
        }
        Ok(())
    }

    fn new(plan: &'a Plan, seed: u64, run: u64) -> Result<Flying<'a>, FlightError> {
        let commands = plan.initial_commands();
        let surface = |i: usize| {
            let (servo, delay) = servo_of(&plan.airplane, i);
            Surface::new(servo, delay, commands[i])
        };
        let air = MovingAir::new(&plan.dryden, &plan.discrete, plan.step(), seed, run)
            .map_err(|e| FlightError(format!("gusts: {e}")))?;
        let next_command = plan.commands.rows.iter().take_while(|(time, _)| *time <= 0.0).count();
        Ok(Flying {
            plan,
            world: plan.world(),
            x: plan.start,
            surfaces: Surfaces(std::array::from_fn(surface)),
            air,
            density: plan.density()?,
            next_command,
            known: None,
        })
    }

    fn euler(&self) -> [f64; 3] {
        to_euler(&self.plan.earth.body_to_local(position(&self.x), attitude(&self.x)))
    }

    /// About where the airplane is. Errors: on the ground, outside the standard atmosphere, or nowhere at all.
    fn density(&mut self, time: f64) -> Result<DensityNear, FlightError> {
        let height = self.plan.earth.height(position(&self.x));
        let ground = self.plan.ground;
        if height < ground && !self.unsteady() {
            return Err(FlightError(format!(
                "at {time:.3} s: the airplane meets the ground, which is at {ground} m; start higher, or end the \
                 flight before with `duration`"
            )));
        }
        if !self.density.reaches(height) {
            self.density = DensityNear::new(height).map_err(|error| {
                if self.unsteady() { self.unstable(time) } else { FlightError(format!("at {time:.3} s: {error}")) }
            })?;
        }
        Ok(self.density)
    }

    /// Rotation of more than a radian in a step cannot be followed by it.
    fn unsteady(&self) -> bool {
        let turn = self.x[10..13].iter().fold(0.0_f64, |m, w| m.max(w.abs())) * self.plan.step();
        turn > 1.0 || self.x.iter().any(|x| !x.is_finite())
    }

    fn unstable(&self, time: f64) -> FlightError {
        FlightError(format!(
            "at {time:.3} s: the integration is unstable with its step of {} s; give a shorter one with `step`",
            self.plan.step()
        ))
    }

    /// Over one sample, in steps that are cut where a command arrives or a discrete gust begins.
    fn advance(&mut self, sample: u64) -> Result<(), FlightError> {
        let grid = &self.plan.grid;
        let h = grid.step();
        let start = sample as f64 / grid.rate;
        let end = (sample + 1) as f64 / grid.rate;
        while let Some((time, row)) = self.plan.commands.rows.get(self.next_command).filter(|(time, _)| *time <= end) {
            // the autopilot moves the surfaces, the file then the throttle
            let moved = if self.plan.autopilot.is_some() { 3 } else { 0 };
            let controls = self.surfaces.0.iter_mut().zip(row).skip(moved);
            controls.for_each(|(surface, command)| surface.order(*time, *command));
            self.next_command += 1;
        }
        for i in 0..grid.steps {
            let from = start + i as f64 * h;
            // times and parts of the step: a whole one is h to the last bit, so that servos know it again
            let (mut now, mut first) = (from, 0.0);
            while first < 1.0 {
                self.surfaces.receive(now);
                self.air.begin(now, self.x[13]);
                let cuts = [self.surfaces.next_arrival(now, from + h), self.air.next_begin(now, from + h)];
                let cut = cuts.into_iter().flatten().min_by(f64::total_cmp);
                let (next, last) = cut.map_or((from + h, 1.0), |cut| (cut, (cut - from) / h));
                self.piece(now, (last - first) * h, first, last)?;
                (now, first) = (next, last);
            }
            self.air.step();
        }
        if self.unsteady() {
            return Err(self.unstable(end));
        }
        Ok(())
    }

    /// A step with `parts`: where in the step of the turbulence it begins and ends.
    #[inline(always)]
    fn piece(&mut self, now: f64, h: f64, first: f64, last: f64) -> Result<(), FlightError> {
        let mut controls = [self.surfaces.controls(); 3];
        for controls in controls.iter_mut().skip(1) {
            self.surfaces.advance(0.5 * h);
            *controls = self.surfaces.controls();
        }
        let parts = [first, 0.5 * (first + last), last];
        let density = self.density(now)?;
        let (world, air) = (&self.world, &self.air);
        // not where a surface without a servo has moved since
        let first = self.known.take().filter(|(moved, _)| *moved == controls[0]).map(|(_, derivative)| derivative);
        self.x = step(&self.x, h, first, &Stages { world, air, parts, controls, density });
        Ok(())
    }
}

/// Surroundings of the airplane during a step.
struct Stages<'a> {
    world: &'a World<'a>,
    air: &'a MovingAir,
    /// Of the step of the turbulence, at the beginning, the middle and the end.
    parts: [f64; 3],
    controls: [Controls; 3],
    density: DensityNear,
}

impl Rate for Stages<'_> {
    // four copies of it are no faster
    #[inline(never)]
    fn rate(&self, part: usize, x: &State) -> State {
        let gust = self.air.gust(self.parts[part], x[13]);
        self.world.instant(x, &self.controls[part], &gust, &self.density).derivative
    }
}
