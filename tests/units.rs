//! Units: every spelling people print, the dimension check, the round trip.

use kfdesign::units::{Dimension, Quantity, Unit};
use proptest::prelude::*;
use proptest::test_runner::RngSeed;

const DEG: f64 = std::f64::consts::PI / 180.0;
const G: f64 = 9.80665;

const RATE: Dimension = Dimension::new(2, 0, -2);
const RATE_DENSITY: Dimension = Dimension::new(2, 0, -1);
const RATE_WALK: Dimension = Dimension::new(2, 0, -3);
const RATE_RAMP: Dimension = Dimension::new(2, 0, -4);
const ANGLE: Dimension = Dimension::new(2, 0, 0);
const FORCE: Dimension = Dimension::new(0, 2, -4);
const FORCE_DENSITY: Dimension = Dimension::new(0, 2, -3);
const FORCE_WALK: Dimension = Dimension::new(0, 2, -5);
const VELOCITY: Dimension = Dimension::new(0, 2, -2);
const TIME: Dimension = Dimension::TIME;
const FREQUENCY: Dimension = Dimension::new(0, 0, -2);

/// Spelling, SI factor worked out by hand, dimension.
#[rustfmt::skip]
const SPELLINGS: &[(&str, f64, Dimension)] = &[
    // angle random walk: 1 deg/sqrt(h) = 1/60 deg/sqrt(s), and 1/sqrt(Hz) = sqrt(s)
    ("deg/sqrt(h)", DEG / 60.0, RATE_DENSITY), ("deg/√h", DEG / 60.0, RATE_DENSITY), ("deg/√(h)", DEG / 60.0, RATE_DENSITY),
    ("deg/rt-hr", DEG / 60.0, RATE_DENSITY), ("deg/rthr", DEG / 60.0, RATE_DENSITY), ("deg/rt(hr)", DEG / 60.0, RATE_DENSITY),
    ("°/√h", DEG / 60.0, RATE_DENSITY), ("º/√hr", DEG / 60.0, RATE_DENSITY), ("deg/sqrt(hr)", DEG / 60.0, RATE_DENSITY),
    ("deg/h^0.5", DEG / 60.0, RATE_DENSITY), ("deg/h^(1/2)", DEG / 60.0, RATE_DENSITY), ("deg h^-1/2", DEG / 60.0, RATE_DENSITY),
    ("deg/h^1/2", DEG / 60.0, RATE_DENSITY), ("degrees/sqrt(hour)", DEG / 60.0, RATE_DENSITY),
    ("deg/s/√Hz", DEG, RATE_DENSITY), ("deg/s/sqrt(Hz)", DEG, RATE_DENSITY), ("(deg/s)/sqrt(Hz)", DEG, RATE_DENSITY),
    ("(deg/s)/√Hz", DEG, RATE_DENSITY), ("°/s/√Hz", DEG, RATE_DENSITY), ("deg/s/rtHz", DEG, RATE_DENSITY),
    ("deg/s/rt-Hz", DEG, RATE_DENSITY), ("deg/s/root Hz", DEG, RATE_DENSITY), ("deg/sec/√Hz", DEG, RATE_DENSITY),
    ("deg/sec/sqrt(hz)", DEG, RATE_DENSITY), ("deg/s/Hz^0.5", DEG, RATE_DENSITY), ("deg/s/Hz^(1/2)", DEG, RATE_DENSITY),
    ("deg/(s*sqrt(Hz))", DEG, RATE_DENSITY), ("deg/(s·√Hz)", DEG, RATE_DENSITY), ("deg s^-1 Hz^-1/2", DEG, RATE_DENSITY),
    ("deg·s⁻¹·Hz⁻½", DEG, RATE_DENSITY), ("deg/sqrt(s)", DEG, RATE_DENSITY), ("deg/√s", DEG, RATE_DENSITY),
    ("deg per second per root hertz", DEG, RATE_DENSITY), ("dps/rtHz", DEG, RATE_DENSITY), ("dps/√Hz", DEG, RATE_DENSITY),
    ("mdps/√Hz", 1e-3 * DEG, RATE_DENSITY), ("mdps/sqrt(Hz)", 1e-3 * DEG, RATE_DENSITY),
    ("deg/h/sqrt(Hz)", DEG / 3600.0, RATE_DENSITY), ("°/h/√Hz", DEG / 3600.0, RATE_DENSITY),
    ("rad/s/sqrt(Hz)", 1.0, RATE_DENSITY), ("rad/s/√Hz", 1.0, RATE_DENSITY), ("rad/√s", 1.0, RATE_DENSITY),
    // angular rate
    ("deg/s", DEG, RATE), ("°/s", DEG, RATE), ("°/sec", DEG, RATE), ("dps", DEG, RATE), ("DPS", DEG, RATE), ("mdps", 1e-3 * DEG, RATE),
    ("deg/h", DEG / 3600.0, RATE), ("deg/hr", DEG / 3600.0, RATE), ("°/h", DEG / 3600.0, RATE), ("°/hr", DEG / 3600.0, RATE),
    ("dph", DEG / 3600.0, RATE), ("deg/min", DEG / 60.0, RATE), ("mdeg/s", 1e-3 * DEG, RATE), ("deg_per_s", DEG, RATE),
    ("rad/s", 1.0, RATE), ("rad s^-1", 1.0, RATE), ("[rad s^-1]", 1.0, RATE), ("rad*s^-1", 1.0, RATE), ("rad·s⁻¹", 1.0, RATE),
    ("rad s-1", 1.0, RATE), ("rad.s-1", 1.0, RATE), ("rad s^{-1}", 1.0, RATE), ("rad s**-1", 1.0, RATE), ("rads/s", 1.0, RATE),
    ("radians/second", 1.0, RATE), ("rad·Hz", 1.0, RATE), ("mrad/s", 1e-3, RATE), ("urad/s", 1e-6, RATE), ("µrad/s", 1e-6, RATE),
    ("rpm", 2.0 * std::f64::consts::PI / 60.0, RATE), ("rev/s", 2.0 * std::f64::consts::PI, RATE),
    ("arcsec/s", DEG / 3600.0, RATE),
    ("1/131 deg/s", DEG / 131.0, RATE), ("(1/131) deg/s", DEG / 131.0, RATE), ("1/131·deg/s", DEG / 131.0, RATE),
    ("0.061 mdps", 0.061e-3 * DEG, RATE), ("0.05 deg/s", 0.05 * DEG, RATE), ("1e-3 rad/s", 1e-3, RATE), ("1/16.4 dps", DEG / 16.4, RATE),
    // rate random walk
    ("deg/s/sqrt(s)", DEG, RATE_WALK), ("deg/s/√s", DEG, RATE_WALK), ("deg/h/sqrt(h)", DEG / 3600.0 / 60.0, RATE_WALK),
    ("deg/s/√hr", DEG / 60.0, RATE_WALK), ("rad/s^1.5", 1.0, RATE_WALK), ("rad/s^(3/2)", 1.0, RATE_WALK), ("rad/s^3/2", 1.0, RATE_WALK),
    ("rad/s^{1.5}", 1.0, RATE_WALK), ("deg/s^2/sqrt(Hz)", DEG, RATE_WALK), ("rad/s²/√Hz", 1.0, RATE_WALK), ("deg/hr^1.5", DEG / 3600.0 / 60.0, RATE_WALK),
    ("deg/s^2", DEG, RATE_RAMP), ("deg/h^2", DEG / 3600.0 / 3600.0, RATE_RAMP), ("rad/s/s", 1.0, RATE_RAMP),
    // angle
    ("deg", DEG, ANGLE), ("°", DEG, ANGLE), ("rad", 1.0, ANGLE), ("mrad", 1e-3, ANGLE), ("urad", 1e-6, ANGLE), ("µrad", 1e-6, ANGLE), ("μrad", 1e-6, ANGLE),
    ("arcsec", DEG / 3600.0, ANGLE), ("arcmin", DEG / 60.0, ANGLE), ("″", DEG / 3600.0, ANGLE), ("rev", 2.0 * std::f64::consts::PI, ANGLE),
    // specific force
    ("m/s²", 1.0, FORCE), ("m/s^2", 1.0, FORCE), ("m s^-2", 1.0, FORCE), ("m·s⁻²", 1.0, FORCE), ("m s-2", 1.0, FORCE), ("m/s2", 1.0, FORCE),
    ("m/s/s", 1.0, FORCE), ("m/sec^2", 1.0, FORCE), ("[m s^-2]", 1.0, FORCE), ("m/s**2", 1.0, FORCE), ("cm/s^2", 0.01, FORCE), ("Gal", 0.01, FORCE),
    ("mGal", 1e-5, FORCE), ("g", G, FORCE), ("mg", 1e-3 * G, FORCE), ("ug", 1e-6 * G, FORCE), ("µg", 1e-6 * G, FORCE), ("μg", 1e-6 * G, FORCE),
    ("micro-g", 1e-6 * G, FORCE), ("milli-g", 1e-3 * G, FORCE), ("1/16384 g", G / 16384.0, FORCE), ("ft/s^2", 0.3048, FORCE),
    ("m/s^2/sqrt(Hz)", 1.0, FORCE_DENSITY), ("m/s²/√Hz", 1.0, FORCE_DENSITY), ("(m/s^2)/√Hz", 1.0, FORCE_DENSITY), ("m/s^1.5", 1.0, FORCE_DENSITY),
    ("m/s/sqrt(h)", 1.0 / 60.0, FORCE_DENSITY), ("m/s/√hr", 1.0 / 60.0, FORCE_DENSITY), ("m/s/√s", 1.0, FORCE_DENSITY), ("m/s/rt-hr", 1.0 / 60.0, FORCE_DENSITY),
    ("ug/sqrt(Hz)", 1e-6 * G, FORCE_DENSITY), ("µg/√Hz", 1e-6 * G, FORCE_DENSITY), ("mg/√Hz", 1e-3 * G, FORCE_DENSITY), ("ug/rtHz", 1e-6 * G, FORCE_DENSITY),
    ("m/s^2/sqrt(s)", 1.0, FORCE_WALK), ("g/sqrt(s)", G, FORCE_WALK), ("m/s^3/sqrt(Hz)", 1.0, FORCE_WALK),
    ("m/s", 1.0, VELOCITY), ("g*s", G, VELOCITY),
    // the rest
    ("s", 1.0, TIME), ("sec", 1.0, TIME), ("ms", 1e-3, TIME), ("us", 1e-6, TIME), ("µs", 1e-6, TIME), ("ns", 1e-9, TIME), ("min", 60.0, TIME), ("h", 3600.0, TIME),
    ("hr", 3600.0, TIME), ("Hz", 1.0, FREQUENCY), ("kHz", 1e3, FREQUENCY), ("1/s", 1.0, FREQUENCY), ("s^-1", 1.0, FREQUENCY), ("1/ms", 1e3, FREQUENCY),
    ("degF", 5.0 / 9.0, Dimension::TEMPERATURE), ("°F", 5.0 / 9.0, Dimension::TEMPERATURE), ("deg/s/degC", DEG, RATE.per_temperature()),
    ("degC", 1.0, Dimension::TEMPERATURE), ("°C", 1.0, Dimension::TEMPERATURE),
    ("K", 1.0, Dimension::TEMPERATURE), ("1", 1.0, Dimension::NONE),
    ("(deg/s)^2/Hz", DEG * DEG, Dimension::new(4, 0, -2)),
];

#[test]
fn every_spelling_has_its_factor_and_dimension() {
    for &(text, factor, dimension) in SPELLINGS {
        let unit = Unit::parse(text).unwrap_or_else(|e| panic!("{text}: {e}"));
        assert_eq!(unit.dimension(), dimension, "{text}");
        let error = (unit.scale() / factor - 1.0).abs();
        assert!(error < 1e-15, "{text}: factor {} expected {factor}", unit.scale());
        assert!(unit.require(dimension).is_ok(), "{text}");
    }
}

#[test]
fn white_density_has_one_dimension_in_all_its_spellings() {
    // 1 deg/s/√Hz = 60 deg/√h: the seed paper's N = 0.0562 deg/s/√Hz is 3.372 deg/√h
    let per_root_hertz = Unit::parse("deg/s/√Hz").unwrap();
    let per_root_hour = Unit::parse("deg/sqrt(h)").unwrap();
    assert_eq!(per_root_hertz.dimension(), per_root_hour.dimension());
    let n = per_root_hour.from_si(per_root_hertz.to_si(0.0562));
    assert!((n - 3.372).abs() < 1e-12, "{n}");
    // K: deg/h/√h · 3600 · 60 = deg/s/√s
    let k = Unit::parse("deg/h/sqrt(h)").unwrap().from_si(Unit::parse("deg/s/sqrt(s)").unwrap().to_si(1.0));
    assert!((k - 216_000.0).abs() < 1e-9, "{k}");
}

#[test]
fn what_is_no_unit_or_could_be_two_is_refused_with_a_hint() {
    for (text, part) in [
        ("", "expected"),
        ("   ", "expected"),
        ("[]", "expected"),
        ("d", "day or degree"),
        ("G", "gravity is g"),
        ("mG/√Hz", "gravity is g"),
        ("MG", "gravity is g"),
        ("deg/S", "second is written s"),
        ("deg/H", "hour is written h"),
        ("LSB", "1/131 deg/s"),
        ("counts", "1/131 deg/s"),
        ("deg C", "degC"),
        ("foo", "known are"),
        ("W", "known are"),
        ("deg/s√Hz", "two ways"),
        ("deg/s·√Hz", "two ways"),
        ("deg/s sqrt(Hz)", "two ways"),
        ("m/s^2*√Hz", "two ways"),
        ("deg/s*s", "two ways"),
        ("deg//s", "missing"),
        ("/s", "missing"),
        ("deg/", "missing"),
        ("2*", "missing"),
        ("()", "missing"),
        ("(deg/s", "parentheses"),
        ("deg/s)", "parentheses"),
        ("deg/s/131", "in front"),
        ("s^", "half-integer"),
        ("s^0", "half-integer"),
        ("s^0.3", "half-integer"),
        ("s^99", "half-integer"),
        ("s^2.5e300", "half-integer"),
        ("s²²", "half-integer"),
        ("s12", "half-integer"),
        ("√√Hz", "fourth root"),
        ("sqrt(sqrt(h))", "fourth root"),
        ("(s^0.5)^0.5", "halves"),
        ("((s^6)^6)^6", "powers"),
        ("s^6*s^6*s^6*s^6", "powers"),
        ("0 deg/s", "positive"),
        ("-1 deg/s", "'-'"),
        ("1e999 deg/s", "positive"),
        ("1e-300 (1e-300 rad)", "positive"),
        ("deg/s?", "'?'"),
        ("deg/s%", "'%'"),
        ("rad-s", "s^-1"),
    ] {
        let Err(error) = Unit::parse(text) else { panic!("{text:?} was accepted") };
        let message = error.to_string();
        assert!(message.contains(part), "{text:?}: {message}");
        assert!(!message.contains('\n'), "{text:?}: one line");
    }
    let long = "deg/s".repeat(1000);
    assert!(Unit::parse(&long).unwrap_err().to_string().len() < 200);
    assert!(Unit::parse(&"(".repeat(119)).is_err());
    assert!(Unit::parse(&"√".repeat(119)).is_err());
}

#[test]
fn a_wrong_dimension_is_named_with_an_example() {
    let message = |text: &str, expected| Unit::parse(text).unwrap().require(expected).unwrap_err().to_string();
    assert_eq!(
        message("deg", RATE),
        "unit 'deg' is an angle, the integral of what is wanted, expected an angular rate (for example deg/s)"
    );
    assert_eq!(
        message("deg/s", RATE_DENSITY),
        "unit 'deg/s' is an angular rate, such as the standard deviation of one sample, \
         expected a noise density of angular rate (angle random walk) (for example deg/s/sqrt(Hz))"
    );
    assert_eq!(
        message("deg/s/√Hz", RATE),
        "unit 'deg/s/√Hz' is a noise density of angular rate (angle random walk), per root hertz, \
         expected an angular rate (for example deg/s)"
    );
    assert_eq!(
        message("(deg/s)^2/Hz", RATE_DENSITY),
        "unit '(deg/s)^2/Hz' is a power density of angular rate, the square of what is wanted, \
         expected a noise density of angular rate (angle random walk) (for example deg/s/sqrt(Hz))"
    );
    assert_eq!(
        message("m/s^2", RATE),
        "unit 'm/s^2' is a specific force, expected an angular rate (for example deg/s)"
    );
    assert_eq!(message("s", FREQUENCY), "unit 's' is a time, expected a frequency (for example Hz)");
    assert!(message("deg/s^3", RATE).contains("angle time^-3"));
    assert!(message("deg*m^0.5", RATE).contains("length^(1/2)"));
}

#[test]
fn parameters_are_shown_in_the_family_of_the_log() {
    // log unit; white density, random walk, integral (quantisation), ramp
    for (log, density, walk, integral, ramp) in [
        ("deg/s", "deg/s/sqrt(Hz)", "deg/s/sqrt(s)", "deg", "deg/s^2"),
        ("rad/s", "rad/s/sqrt(Hz)", "rad/s/sqrt(s)", "rad", "rad/s^2"),
        ("[rad s^-1]", "rad/s/sqrt(Hz)", "rad/s/sqrt(s)", "rad", "rad/s^2"),
        ("°/h", "deg/h/sqrt(Hz)", "deg/h/sqrt(h)", "deg", "deg/h^2"),
        ("mdps", "mdps/sqrt(Hz)", "mdps/sqrt(s)", "mdeg", "mdps/s"),
        ("dps", "dps/sqrt(Hz)", "dps/sqrt(s)", "deg", "dps/s"),
        ("1/131 deg/s", "deg/s/sqrt(Hz)", "deg/s/sqrt(s)", "deg", "deg/s^2"),
        ("rpm", "rpm/sqrt(Hz)", "rpm/sqrt(s)", "rpm*s", "rpm/s"),
        ("g", "g/sqrt(Hz)", "g/sqrt(s)", "g*s", "g/s"),
        ("mg", "mg/sqrt(Hz)", "mg/sqrt(s)", "mg*s", "mg/s"),
        ("m/s²", "m/s^2/sqrt(Hz)", "m/s^2/sqrt(s)", "m/s", "m/s^3"),
    ] {
        let unit = Unit::parse(log).unwrap();
        for (half_powers, expected) in [(1, density), (-1, walk), (2, integral), (-2, ramp)] {
            let shown = unit.times_time(half_powers);
            assert_eq!(shown.text(), expected, "{log} {half_powers:+}");
            assert_eq!(shown.dimension(), unit.dimension().times_time(half_powers), "{log} {half_powers:+}");
            let again = Unit::parse(shown.text()).unwrap();
            assert_eq!(again.dimension(), shown.dimension(), "{log} {half_powers:+}");
            assert!((again.scale() / shown.scale() - 1.0).abs() < 1e-15, "{log} {half_powers:+}");
        }
    }
    assert_eq!(Unit::parse("1/131 deg/s").unwrap().times_time(0).text(), "deg/s");
}

#[test]
fn a_unit_knows_its_quantity() {
    assert_eq!(Unit::parse("mdps").unwrap().quantity(), Some(Quantity::AngularRate));
    assert_eq!(Unit::parse("g").unwrap().quantity(), Some(Quantity::SpecificForce));
    assert_eq!(Unit::parse("deg").unwrap().quantity(), None);
}

proptest! {
    // failures are fixed, not collected in a file
    #![proptest_config(ProptestConfig { failure_persistence: None, rng_seed: RngSeed::Fixed(1), ..ProptestConfig::default() })]

    /// There and back: the two roundings of a multiplication and a division.
    #[test]
    fn to_si_and_back_is_the_same_number(index in 0..SPELLINGS.len(), value in -1e12..1e12f64) {
        if let Ok(unit) = Unit::parse(SPELLINGS[index].0) {
            let back = unit.from_si(unit.to_si(value));
            prop_assert!((back - value).abs() <= value.abs() * 2.0 * f64::EPSILON);
        }
    }

    /// Any product of symbols and half-integer powers: the printed text parses to the same unit.
    #[test]
    fn the_plain_text_parses_to_the_same_unit(
        index in 0..SPELLINGS.len(),
        half_powers in -6i8..=6,
    ) {
        if let Ok(unit) = Unit::parse(SPELLINGS[index].0) {
            let shown = unit.times_time(half_powers);
            let again = Unit::parse(shown.text()).unwrap();
            prop_assert_eq!(again.dimension(), shown.dimension());
            prop_assert_eq!(shown.dimension(), unit.dimension().times_time(half_powers));
            prop_assert!((again.scale() / shown.scale() - 1.0).abs() < 1e-14);
        }
    }

    /// No text makes the parser panic, and what it accepts has a positive finite factor.
    #[test]
    fn no_text_makes_the_parser_panic(text in "[a-zA-Z0-9µμ°º√²³⁻¹½^*·/(){}\\[\\].,+ \\-_ᐟ″′]{0,40}") {
        if let Ok(unit) = Unit::parse(&text) {
            prop_assert!(unit.scale() > 0.0 && unit.scale().is_finite());
            let _ = unit.times_time(1);
            let _ = unit.require(Dimension::NONE);
        }
    }
}

/// A rate per temperature in the spelling of both, without leading numbers, and its words.
#[test]
fn a_unit_per_another() {
    let per = |a: &str, b: &str| Unit::parse(a).unwrap().per(&Unit::parse(b).unwrap());
    for (a, b, text, scale) in [
        ("deg/s", "degC", "deg/s/degC", DEG),
        ("mg", "K", "mg/K", 1e-3 * G),
        ("m/s^2", "degF", "m/s^2/degF", 1.8),
        ("1/131 deg/s", "1/340 degC", "deg/s/degC", DEG),
    ] {
        let unit = per(a, b);
        assert_eq!(unit.text(), text);
        assert!((unit.scale() / scale - 1.0).abs() < 1e-15, "{text}");
        assert_eq!(Unit::parse(text).unwrap().dimension(), unit.dimension());
    }
    assert_eq!(per("deg/s", "K").dimension().name(), "an angular rate per temperature");
    assert_eq!(per("deg/s", "K").dimension().example(), "deg/s/degC");
    assert_eq!(Dimension::TEMPERATURE.example(), "degC");
}
