//! Standard atmosphere and discrete gusts against tables.

use kfdesign::aircraft::atmosphere::discrete::{DiscreteGust, Form};
use kfdesign::aircraft::atmosphere::standard::{DensityNear, at, at_geopotential, geopotential};

fn close(found: f64, expected: f64, relative: f64) {
    assert!((found - expected).abs() <= relative * expected.abs(), "{found} against {expected}");
}

/// ISO 2533 by its equations; the figures of a second implementation, nine digits.
#[test]
fn the_standard_atmosphere_is_that_of_the_tables() {
    let table = [
        (0.0, 288.15, 101_325.0, 1.225_000_018, 340.293_988),
        (1_000.0, 281.65, 89_874.562_916, 1.111_642_500, 336.433_971),
        (5_000.0, 255.65, 54_019.888_188, 0.736_115_547, 320.529_394),
        (11_000.0, 216.65, 22_632.040_095, 0.363_917_648, 295.069_494),
        (20_000.0, 216.65, 5_474.877_424, 0.088_034_685, 295.069_494),
    ];
    for (height, temperature, pressure, density, sound) in table {
        let air = at_geopotential(height).unwrap();
        close(air.temperature, temperature, 1e-12);
        close(air.pressure, pressure, 1e-10);
        close(air.density, density, 1e-8);
        close(air.sound_speed, sound, 3e-9);
    }
    // geometric heights
    for (height, temperature, pressure, density) in
        [(100.0, 287.500_010, 100_129.456_456, 1.213_282_967), (5_000.0, 255.675_543, 54_048.262_238, 0.736_428_613)]
    {
        let air = at(height).unwrap();
        close(air.temperature, temperature, 3e-9);
        close(air.pressure, pressure, 1e-10);
        close(air.density, density, 1e-8);
    }
    assert!((geopotential(5_000.0) - 4_996.07).abs() < 0.01);
}

#[test]
fn both_layers_meet_and_what_is_outside_is_refused() {
    let (below, above) = (at_geopotential(11_000.0 - 1e-6).unwrap(), at_geopotential(11_000.0 + 1e-6).unwrap());
    close(above.pressure, below.pressure, 1e-9);
    // hydrostatic balance, dp/dH = −ρ g, in both layers
    for height in [-1_500.0, 3_000.0, 15_000.0] {
        let p = |h: f64| at_geopotential(h).unwrap().pressure;
        close((p(height + 1.0) - p(height - 1.0)) / 2.0, -9.80665 * at_geopotential(height).unwrap().density, 1e-8);
    }
    for height in [-2_001.0, 20_001.0, f64::NAN] {
        let message = at_geopotential(height).unwrap_err().to_string();
        assert!(message.contains("-2000 m to 20000 m"), "{message}");
    }
    assert!(at(20_060.0).is_ok() && at(20_100.0).is_err());
}

/// Over its reach the series is the density to rounding, and it ends where the layers meet.
#[test]
fn the_density_near_a_height_is_the_density() {
    for height in [-1500.0, 0.0, 100.0, 5000.0, 10_000.0, 12_000.0, 19_000.0] {
        let near = DensityNear::new(height).unwrap();
        for away in [-DensityNear::REACH, -0.3, 0.0, 0.5, DensityNear::REACH] {
            close(near.at(height + away), at(height + away).unwrap().density, 1e-12);
            assert!(near.reaches(height + away) && !near.reaches(height + away.signum() * 1.01));
        }
    }
    // 11 km of geopotential height
    let bend = 11_019.067_9;
    let below = DensityNear::new(bend - 0.1).unwrap();
    assert!(below.reaches(bend - 0.2) && !below.reaches(bend + 0.1));
    assert!(DensityNear::new(21_000.0).is_err() && DensityNear::new(f64::NAN).is_err());
}

#[test]
fn discrete_gusts_have_both_forms() {
    let gust = |form| DiscreteGust { form, velocity: [0.0, 0.0, -3.0], length: 12.5, start: 0.0 };
    let (hold, back) = (gust(Form::Hold), gust(Form::Return));
    for (x, of_hold, of_return) in [
        (-1.0, 0.0, 0.0),
        (0.0, 0.0, 0.0),
        (6.25, 0.5, 0.5),
        (12.5, 1.0, 1.0),
        (18.75, 1.0, 0.5),
        (25.0, 1.0, 0.0),
        (90.0, 1.0, 0.0),
    ] {
        assert!((hold.part(x) - of_hold).abs() < 1e-15 && (back.part(x) - of_return).abs() < 1e-15, "{x}");
        assert_eq!(hold.at(x).velocity[2], -3.0 * hold.part(x));
    }
}
