//! The servo with its limits: moments and angles of the closed form, and a second integration.

use kfdesign::aircraft::flight::servo::{Servo, ServoState};

fn servo(rate_limit: f64) -> Servo {
    let stop = 25.0_f64.to_radians();
    Servo { frequency: 50.0, damping: 0.7, travel: [-stop, stop], rate_limit: rate_limit.to_radians() }
}

/// Angle in degrees after `time` (s) from rest at zero, in equal steps.
fn after(servo: &Servo, time: f64, steps: u32) -> ServoState {
    let mut state = servo.at_rest(0.0);
    for _ in 0..steps {
        servo.advance(&mut state, 20.0_f64.to_radians(), time / f64::from(steps));
    }
    state
}

/// The sheet's angles after a command of 20 deg with 300 deg/s and without a limit.
#[test]
fn a_step_with_and_without_rate_limit() {
    let times = [0.01, 0.02, 0.03, 0.05, 0.08, 0.1];
    let limited = [1.921_738_0, 4.921_738_0, 7.921_738_0, 13.871_227_7, 19.547_381_6, 20.544_493_3];
    let free = [1.966_549_2, 6.118_912_4, 10.625_461_5, 17.411_456_8, 20.831_937_9, 20.795_498_1];
    for ((time, limited), free) in times.into_iter().zip(limited).zip(free) {
        for (rate, expected) in [(300.0, limited), (f64::INFINITY, free)] {
            let angle = after(&servo(rate), time, 1).angle.to_degrees();
            assert!((angle - expected).abs() < 6e-8, "{rate} deg/s, {time} s: {angle} against {expected}");
        }
    }
    // the moments at which the limit is reached and left
    let rate = |time: f64| after(&servo(300.0), time, 1).rate.to_degrees();
    let (reaches, leaves) = (0.008_069_222, 0.042_260_873);
    assert!(rate(reaches - 1e-7) < 300.0 - 1e-5 && (rate(reaches + 1e-7) - 300.0).abs() < 1e-9);
    assert!((rate(leaves - 1e-7) - 300.0).abs() < 1e-9 && rate(leaves + 1e-4) < 300.0 - 1e-3);
    assert!((after(&servo(300.0), leaves, 1).angle.to_degrees() - 11.6).abs() < 1e-6);
}

/// A rate limit that cuts each sample would depend on the samples: this one does not.
#[test]
fn the_length_of_the_steps_changes_nothing() {
    for rate in [100.0, 300.0, f64::INFINITY] {
        let whole = after(&servo(rate), 0.2, 1);
        for steps in [2, 7, 20, 333] {
            let parts = after(&servo(rate), 0.2, steps);
            assert!(
                (whole.angle - parts.angle).abs() < 1e-12 && (whole.rate - parts.rate).abs() < 1e-10,
                "{rate} {steps}"
            );
        }
    }
}

/// Against fine Runge–Kutta steps of the law as it is written, for damping below, at and above one, with stops in the
/// way.
#[test]
fn a_second_integration_agrees() {
    for damping in [0.3, 0.7, 1.0, 1.8] {
        for (limit, command) in [(f64::INFINITY, 20.0), (200.0, 20.0), (400.0, 28.0), (150.0, -40.0)] {
            let servo = Servo { damping, ..servo(limit) };
            let command = f64::to_radians(command);
            let (mut exact, mut fine) = (servo.at_rest(0.05), servo.at_rest(0.05));
            let h = 1e-6;
            for k in 1..=150_000 {
                // the midpoint rule; the rate stays within its limit at every one of these short steps
                let law = |s: ServoState| {
                    servo.frequency * (servo.frequency * (command - s.angle) - 2.0 * servo.damping * s.rate)
                };
                let a = law(fine);
                let middle = ServoState { angle: fine.angle + 0.5 * h * fine.rate, rate: fine.rate + 0.5 * h * a };
                let within = |rate: f64| rate.clamp(-servo.rate_limit, servo.rate_limit);
                let rate = within(fine.rate + h * law(middle));
                fine = ServoState { angle: fine.angle + h * within(middle.rate), rate };
                let [low, high] = servo.travel;
                if (fine.angle >= high && fine.rate > 0.0) || (fine.angle <= low && fine.rate < 0.0) {
                    fine = ServoState { angle: fine.angle.clamp(low, high), rate: 0.0 };
                }
                if k % 2500 == 0 {
                    servo.advance(&mut exact, command, 2.5e-3);
                    assert!(
                        (exact.angle - fine.angle).abs() < 1e-5,
                        "damping {damping}, limit {limit}, command {command}, {k}: {exact:?} against {fine:?}"
                    );
                }
            }
        }
    }
}

#[test]
fn it_rests_at_a_stop_and_leaves_it() {
    let servo = servo(f64::INFINITY);
    let mut state = servo.at_rest(0.0);
    servo.advance(&mut state, 1.0, 1.0);
    assert_eq!(state, ServoState { angle: servo.travel[1], rate: 0.0 });
    servo.advance(&mut state, 0.1, 1.0);
    assert!((state.angle - 0.1).abs() < 1e-12);
}

/// Where e^(ζωt) and cosh ωd t are beyond all numbers.
#[test]
fn a_long_step_of_a_stiff_servo_ends_at_the_command() {
    let servo = Servo { frequency: 1e4, damping: 5.0, ..servo(f64::INFINITY) };
    let mut state = servo.at_rest(0.0);
    servo.advance(&mut state, 0.1, 1.0);
    assert!((state.angle - 0.1).abs() < 1e-12 && state.rate.abs() < 1e-9, "{state:?}");
}
