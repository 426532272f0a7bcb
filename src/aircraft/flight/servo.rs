//! A servo of second order with limits of rate and travel, by its closed form.
//!
//! δ̇ = v, v̇ = ω²(δc − δ) − 2ζω v. At the rate limit |v| = R it runs at constant rate while v̇ would lead beyond; at a
//! stop δ stays with v = 0 while the law pushes outward. Between such moments the motion is linear and its solution
//! exact; the moments are found to rounding, so that the result does not depend on the length of the steps.

/// What a servo is; angles in rad.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Servo {
    /// ω, rad/s.
    pub frequency: f64,
    /// ζ.
    pub damping: f64,
    /// Stops, lower and upper.
    pub travel: [f64; 2],
    /// R, rad/s; infinite for none.
    pub rate_limit: f64,
}

/// Where it is and how fast it moves.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ServoState {
    pub angle: f64,
    pub rate: f64,
}

/// Steps are divided until ω dt is at most this: then rate and angle have at most one extremum in each.
const LONGEST_TURN: f64 = 0.5;

impl Servo {
    /// At rest at a command, within its travel.
    pub fn at_rest(&self, command: f64) -> ServoState {
        ServoState { angle: command.clamp(self.travel[0], self.travel[1]), rate: 0.0 }
    }

    /// Moves for `dt` (s) with the command held.
    pub fn advance(&self, state: &mut ServoState, command: f64, dt: f64) {
        self.advance_again(state, command, dt, &mut None);
    }

    /// The same; `known` is the motion of the call before, which serves again when the time is the same.
    #[inline(always)]
    pub(super) fn advance_again(&self, state: &mut ServoState, command: f64, dt: f64, known: &mut Option<Motion>) {
        if !self.meets_no_limit(*state, command) {
            let parts = (self.frequency * dt / LONGEST_TURN).ceil().max(1.0);
            (0..parts as u64).for_each(|_| self.advance_limited(state, command, dt / parts));
            return;
        }
        let motion = match known {
            Some(motion) if motion.dt == dt => motion,
            _ => known.insert(self.motion(dt)),
        };
        *state = motion.apply(*state, command);
    }

    /// Whatever the time: ω²(δ − δc)² + v² never grows, its derivative being −4ζω v², and bounds both.
    #[inline(always)]
    fn meets_no_limit(&self, state: ServoState, command: f64) -> bool {
        let turned = self.frequency * (state.angle - command);
        let most = turned * turned + state.rate * state.rate;
        let room = self.frequency * (self.travel[1] - command).min(command - self.travel[0]);
        most < self.rate_limit * self.rate_limit && room > 0.0 && most < room * room
    }

    /// Through the regimes that limits make.
    fn advance_limited(&self, state: &mut ServoState, command: f64, dt: f64) {
        let mut left = dt;
        // each pass ends at a limit or at the end; a pass of no length at all changes the regime at least once
        for _ in 0..16 {
            if left <= 0.0 {
                return;
            }
            left -= self.regime(state, command, left);
        }
        // no time is lost where limits meet within rounding
        let end = self.linear(*state, command, left);
        let [lowest, highest] = self.travel;
        *state = ServoState {
            angle: end.angle.clamp(lowest, highest),
            rate: end.rate.clamp(-self.rate_limit, self.rate_limit),
        };
    }

    fn acceleration(&self, state: ServoState, command: f64) -> f64 {
        self.frequency * (self.frequency * (command - state.angle) - 2.0 * self.damping * state.rate)
    }

    /// Moves to the end of the regime or of `dt`, whichever comes first; the time it took.
    fn regime(&self, state: &mut ServoState, command: f64, dt: f64) -> f64 {
        let [lowest, highest] = self.travel;
        let acceleration = self.acceleration(*state, command);
        let outward = if state.angle >= highest {
            1.0
        } else if state.angle <= lowest {
            -1.0
        } else {
            0.0
        };
        if outward != 0.0 && (outward * state.rate > 0.0 || (state.rate == 0.0 && outward * acceleration >= 0.0)) {
            *state = ServoState { angle: state.angle.clamp(lowest, highest), rate: 0.0 };
            if outward * self.acceleration(*state, command) >= 0.0 {
                return dt;
            }
            return self.free(state, command, dt);
        }
        let limited = state.rate.abs() >= self.rate_limit && acceleration * state.rate >= 0.0;
        if limited {
            state.rate = self.rate_limit.copysign(state.rate);
            // v̇ = 0 at δ = δc − 2ζ v/ω
            let leaves = (command - 2.0 * self.damping * state.rate / self.frequency - state.angle) / state.rate;
            let stop = if state.rate > 0.0 { highest } else { lowest };
            let hits = (stop - state.angle) / state.rate;
            let time = dt.min(leaves.max(0.0)).min(hits.max(0.0));
            state.angle += state.rate * time;
            if time == hits.max(0.0) {
                *state = ServoState { angle: stop, rate: 0.0 };
            } else if time >= leaves {
                // on the other side of the limit by rounding, so that the free regime takes over
                return time + self.free(state, command, dt - time);
            }
            return time;
        }
        self.free(state, command, dt)
    }

    /// The linear motion up to the first limit.
    fn free(&self, state: &mut ServoState, command: f64, dt: f64) -> f64 {
        let start = *state;
        let at = |t: f64| self.linear(start, command, t);
        // where rate and angle turn, at most once each; between them both are monotone
        let mut knots = vec![0.0, dt];
        for f in [&(|t: f64| self.acceleration(at(t), command)) as &dyn Fn(f64) -> f64, &|t| at(t).rate] {
            knots.extend(root(f, 0.0, dt));
        }
        knots.sort_by(f64::total_cmp);
        for pair in knots.windows(2) {
            let (from, to) = (pair[0], pair[1]);
            // beyond rounding: where the limit is left the rate is at it
            let rate = |t: f64| at(t).rate.abs() - self.rate_limit * (1.0 + 1e-12);
            let above = |t: f64| at(t).angle - self.travel[1];
            let below = |t: f64| self.travel[0] - at(t).angle;
            let first = [&rate as &dyn Fn(f64) -> f64, &above, &below]
                .into_iter()
                .enumerate()
                .filter(|(_, f)| f(to) > 0.0)
                .map(|(limit, f)| (if f(from) >= 0.0 { from } else { root(f, from, to).unwrap_or(to) }, limit))
                .min_by(|a, b| a.0.total_cmp(&b.0));
            if let Some((t, limit)) = first {
                *state = at(t);
                match limit {
                    0 => state.rate = self.rate_limit.copysign(state.rate),
                    1 => *state = ServoState { angle: self.travel[1], rate: 0.0 },
                    _ => *state = ServoState { angle: self.travel[0], rate: 0.0 },
                }
                return t;
            }
        }
        *state = at(dt);
        dt
    }

    /// Without limits.
    fn linear(&self, state: ServoState, command: f64, dt: f64) -> ServoState {
        self.motion(dt).apply(state, command)
    }

    /// The linear motion over a time.
    fn motion(&self, dt: f64) -> Motion {
        let (w, square) = (self.frequency, 1.0 - self.damping * self.damping);
        let z = self.damping * w;
        // e(t) = e c + (v + ζω e) s, c = e^(−ζωt) cos ωd t and s = e^(−ζωt) sin(ωd t)/ωd, or their limits and
        // hyperbolic forms, these without large numbers
        let (c, s) = if square < -1e-12 {
            let wd = w * (-square).sqrt();
            let slow = ((wd - z) * dt).exp();
            let fall = (-2.0 * wd * dt).exp_m1();
            (slow * (1.0 + 0.5 * fall), -0.5 * slow * fall / wd)
        } else {
            let decay = (-z * dt).exp();
            if square > 1e-12 {
                let wd = w * square.sqrt();
                let (sin, cos) = (wd * dt).sin_cos();
                (decay * cos, decay * sin / wd)
            } else {
                (decay, decay * dt)
            }
        };
        Motion { dt, m: [[c + z * s, s], [-w * w * s, c - z * s]] }
    }
}

/// (δ − δc, v) after a time, a matrix by rows.
#[derive(Clone, Copy, Debug)]
pub(super) struct Motion {
    dt: f64,
    m: [[f64; 2]; 2],
}

impl Motion {
    fn apply(&self, state: ServoState, command: f64) -> ServoState {
        let [[a, b], [c, d]] = self.m;
        let (e, v) = (state.angle - command, state.rate);
        ServoState { angle: command + a * e + b * v, rate: c * e + d * v }
    }
}

/// Where f changes sign between a and b, by bisection to rounding; `None` when it does not.
fn root(f: &dyn Fn(f64) -> f64, mut a: f64, mut b: f64) -> Option<f64> {
    let at_a = f(a);
    if at_a == 0.0 || at_a * f(b) >= 0.0 {
        return None;
    }
    for _ in 0..60 {
        let middle = 0.5 * (a + b);
        if f(middle) * at_a > 0.0 { a = middle } else { b = middle }
    }
    Some(b)
}
