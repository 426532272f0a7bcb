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
        let motion = match known {
            Some(motion) if motion.time == dt => motion,
            _ => {
                let parts = (self.frequency * dt / LONGEST_TURN).ceil().max(1.0);
                known.insert(Motion { time: dt, parts: parts as u64, part: self.transition(dt / parts) })
            }
        };
        for _ in 0..motion.parts {
            self.advance_part(state, command, &motion.part);
        }
    }

    #[inline(always)]
    fn advance_part(&self, state: &mut ServoState, command: f64, whole: &Transition) {
        // quick: far from every limit from the beginning to the end
        let (start, end) = (*state, whole.apply(*state, command));
        let accelerations = [start, end].map(|s| self.acceleration(s, command).abs());
        let fastest = start.rate.abs().max(end.rate.abs()) + accelerations[0].max(accelerations[1]) * whole.dt;
        let room = |s: ServoState| (self.travel[1] - s.angle).min(s.angle - self.travel[0]);
        if fastest < self.rate_limit && room(start).min(room(end)) > fastest * whole.dt {
            *state = end;
            return;
        }
        self.advance_limited(state, command, whole.dt);
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
        self.transition(dt).apply(state, command)
    }

    /// The linear motion over a time.
    fn transition(&self, dt: f64) -> Transition {
        let (w, z) = (self.frequency, self.damping);
        let decay = (-z * w * dt).exp();
        // e(t) = e^(−ζωt)(e c + (v + ζω e) s), c = cos ωd t and s = sin(ωd t)/ωd, or their limits and hyperbolic forms
        let square = 1.0 - z * z;
        let (c, s) = if square > 1e-12 {
            let wd = w * square.sqrt();
            let (sin, cos) = (wd * dt).sin_cos();
            (cos, sin / wd)
        } else if square < -1e-12 {
            let wd = w * (-square).sqrt();
            ((wd * dt).cosh(), (wd * dt).sinh() / wd)
        } else {
            (1.0, dt)
        };
        let z = z * w;
        Transition { dt, m: [[decay * (c + z * s), decay * s], [-decay * w * w * s, decay * (c - z * s)]] }
    }
}

/// A time in equal parts, each with its linear motion.
#[derive(Clone, Copy, Debug)]
pub(super) struct Motion {
    time: f64,
    parts: u64,
    part: Transition,
}

/// (δ − δc, v) after a time, a matrix by rows.
#[derive(Clone, Copy, Debug)]
struct Transition {
    dt: f64,
    m: [[f64; 2]; 2],
}

impl Transition {
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
