//! Trajectories against a second implementation, identities of motion, order of convergence, commands and their delays.

use serde_json::json;

use super::flights::{
    ANGLES, PLACE, RATES, Table, VELOCITY, aerosonde, level, near, one, over_wgs84, quiet, runs, thrown, times, trim,
};

/// The sheet's trajectory over the flat earth, to 1e-6 m and 1e-8 m/s.
#[test]
fn the_trajectory_over_the_flat_earth() {
    let table = one(&thrown(), times(10.0, Some(1.0), None));
    let expected = [
        (
            1.0,
            [
                20.832142534,
                13.911590883,
                -100.449369260,
                25.032993307,
                0.353616141,
                1.360343049,
                0.286131701,
                0.070285570,
                0.638325683,
                0.055218672,
                0.022805478,
                0.084315817,
            ],
        ),
        (
            2.0,
            [
                40.123548412,
                29.956258655,
                -100.655435567,
                25.126351013,
                0.290447136,
                1.349758391,
                0.385843803,
                0.053884688,
                0.767593893,
                0.090188051,
                0.033749093,
                0.132354634,
            ],
        ),
        (
            5.0,
            [
                79.501427889,
                94.822952029,
                -96.805895871,
                26.580519859,
                0.452905741,
                1.312458722,
                0.707471922,
                -0.067354960,
                1.362568597,
                0.123137751,
                0.121429278,
                0.229809827,
            ],
        ),
        (
            10.0,
            [
                11.261993600,
                199.803546906,
                -57.247114905,
                33.208990721,
                0.488380295,
                1.400433547,
                1.073612198,
                -0.373232230,
                3.103720366,
                0.186977542,
                0.336426174,
                0.234943178,
            ],
        ),
    ];
    for (time, row) in expected {
        near(&table.at(time, &PLACE), &row[..3], 1e-6);
        near(&table.at(time, &VELOCITY), &row[3..6], 1e-8);
        near(&table.at(time, &ANGLES), &row[6..9], 1e-8);
        near(&table.at(time, &RATES), &row[9..], 1e-8);
    }
    assert_eq!(*table.get("time").last().unwrap(), 10.0);
}

/// The sheet's trajectory over the rotating earth; what the gyro sees is inertial.
#[test]
fn the_trajectory_over_the_rotating_earth() {
    let mut document = over_wgs84(thrown());
    document["sensors"] = json!({ "gyro": quiet("angular-rate", "rad/s") });
    let table = one(&document, times(10.0, Some(1.0), None));
    let expected = [
        (
            0.0,
            [
                48.7,
                21.25,
                100.0,
                25.0,
                1.0,
                1.5,
                0.174532925,
                0.087266463,
                30.0_f64.to_radians(),
                0.200046296,
                -0.100032544,
                0.099954011,
            ],
        ),
        (
            1.0,
            [
                48.7001873237,
                21.2501890016,
                100.4488745,
                25.033101605,
                0.353768491,
                1.360358109,
                0.286136085,
                0.070248320,
                0.638421972,
                0.055287857,
                0.022752928,
                0.084371184,
            ],
        ),
        (
            5.0,
            [
                48.7007146529,
                21.2512884654,
                96.7978920,
                26.582489309,
                0.453083196,
                1.312418104,
                0.707525499,
                -0.067415093,
                1.363160248,
                0.123174518,
                0.121471045,
                0.229880205,
            ],
        ),
        (
            10.0,
            [
                48.7001001539,
                21.2527137404,
                57.2342687,
                33.211579004,
                0.488540862,
                1.400481375,
                1.073654710,
                -0.373260045,
                3.104933823,
                0.186943609,
                0.336469396,
                0.234998640,
            ],
        ),
    ];
    for (time, row) in expected {
        // 1e-10 deg are 1.1e-5 m, the last digit of the sheet
        near(&table.at(time, &["latitude", "longitude"]), &row[..2], 1.1e-10);
        near(&table.at(time, &["height"]), &row[2..3], 1e-6);
        near(&table.at(time, &VELOCITY), &row[3..6], 1e-8);
        near(&table.at(time, &ANGLES), &row[6..9], 1e-8);
        near(&table.at(time, &["gyro_x", "gyro_y", "gyro_z"]), &row[9..], 1e-8);
        near(&table.at(time, &["truth_gyro_x_rate"]), &row[9..10], 1e-8);
    }
    // p, q, r are relative to the earth
    near(&table.at(0.0, &RATES), &[0.2, -0.1, 0.1], 1e-12);
    near(&ecef(&table, 10.0), &[3930750.552475, 1528799.623544, 4768655.805949], 2e-6);
}

/// Earth-fixed place of a row, by the definition of geodetic coordinates.
fn ecef(table: &Table, time: f64) -> [f64; 3] {
    let row = table.at(time, &["latitude", "longitude", "height"]);
    let place = kfdesign::aircraft::flight::earth::Geodetic {
        latitude: row[0].to_radians(),
        longitude: row[1].to_radians(),
        height: row[2],
    };
    place.to_ecef()
}

#[test]
fn gravity_and_coordinates_of_the_ellipsoid() {
    use kfdesign::aircraft::flight::earth::{EARTH_RATE, Geodetic, gravitation};
    let place = Geodetic { latitude: 48.7_f64.to_radians(), longitude: 21.25_f64.to_radians(), height: 100.0 };
    let r = place.to_ecef();
    near(&r, &[3930857.062405, 1528626.709523, 4768680.583478], 1e-6);
    let g = gravitation(r);
    near(&g, &[-6.0548278707, -2.3545937839, -7.3693719234], 1e-10);
    // with the centrifugal part, down and north
    let apparent = [g[0] + EARTH_RATE.powi(2) * r[0], g[1] + EARTH_RATE.powi(2) * r[1], g[2]];
    let (s, c) = place.latitude.sin_cos();
    let across = apparent[0] * place.longitude.cos() + apparent[1] * place.longitude.sin();
    near(&[-across * c - apparent[2] * s, -across * s + apparent[2] * c], &[9.809271111, -0.0000278], 5e-8);
    // there and back from pole to pole, up to 20 km
    for degrees in [-90.0_f64, -89.999, -45.0, -1e-9, 0.0, 30.0, 89.9999, 90.0] {
        for height in [-500.0, 0.0, 20_000.0] {
            let place = Geodetic { latitude: degrees.to_radians(), longitude: -2.0, height };
            let back = Geodetic::from_ecef(place.to_ecef());
            assert!(
                (back.latitude - place.latitude).abs() < 1e-15 * 10.0 && (back.height - height).abs() < 4e-9,
                "{degrees}"
            );
        }
    }
}

/// Halving the step divides the error by 2⁴: the classical Runge–Kutta method with the forces of every stage.
#[test]
fn the_integration_is_of_order_four() {
    let fine = one(&thrown(), times(4.0, Some(4.0), Some(2e-4)));
    let error = |step: f64| {
        let table = one(&thrown(), times(4.0, Some(4.0), Some(step)));
        let names = [PLACE, VELOCITY].concat();
        let differences = table.last(&names).into_iter().zip(fine.last(&names)).map(|(a, b)| (a - b).abs());
        differences.fold(0.0, f64::max)
    };
    let errors: Vec<f64> = [0.04, 0.02, 0.01].map(error).into();
    for pair in errors.windows(2) {
        assert!((3.6..4.6).contains(&(pair[0] / pair[1]).log2()), "{errors:?}");
    }
}

/// The sheet's flights from trim: elevator and aileron one degree from it.
#[test]
fn steps_from_trim_are_those_of_a_second_implementation() {
    let degree = 1.0_f64.to_radians();
    let c = trim().controls;
    let step = |key: &str, at: f64| {
        let mut document = level();
        document["controls"] = json!({ key: format!("{:e} rad", at + degree) });
        one(&document, times(10.0, Some(1.0), None))
    };
    let names = [PLACE, VELOCITY, ANGLES, RATES].concat();
    let elevator = step("elevator", c.elevator);
    near(
        &elevator.at(2.0, &names),
        &[
            50.212077166,
            0.003781276,
            -99.096189323,
            25.285533659,
            0.003814768,
            1.220047583,
            0.000824706,
            0.013260719,
            0.000127551,
            0.001938600,
            -0.013619790,
            0.000346948,
        ],
        2e-8,
    );
    near(
        &elevator.at(10.0, &names),
        &[
            257.657649195,
            4.371310226,
            -91.906113647,
            25.908428171,
            0.052693066,
            1.230315425,
            0.057067985,
            0.031349711,
            0.070472814,
            0.008156834,
            0.002729693,
            0.020389779,
        ],
        5e-8,
    );
    near(
        &step("aileron", c.aileron).at(5.0, &names),
        &[
            124.153691814,
            12.444450769,
            -98.851767642,
            25.301741147,
            0.475437705,
            1.317997325,
            0.392670940,
            0.018811124,
            0.319846595,
            0.087972218,
            0.033752158,
            0.137432742,
        ],
        2e-8,
    );
}

#[test]
fn a_trimmed_airplane_stays_in_trim() {
    let mut document = level();
    document["trim"]["turn_rate"] = json!("0.1 rad/s");
    for document in [level(), document] {
        let table = one(&document, times(10.0, Some(1.0), None));
        let names = [VELOCITY.as_slice(), &RATES, &ANGLES[..2]].concat();
        // the standard atmosphere thins out by less than 1e-9 over what the height changes
        near(&table.last(&names), &table.at(0.0, &names), 1e-9);
        near(&table.last(&["down"]), &[-100.0], 1e-7);
    }
}

/// Over the flat earth wind adds its way and nothing else (Galileo), also in a turn with all axes moving.
#[test]
fn wind_carries_the_airplane_along() {
    let wind = [3.0, -7.0, 0.0];
    let mut blown = level();
    blown["trim"]["bank"] = json!("20 deg");
    let calm = one(&blown, times(20.0, Some(5.0), None));
    blown["wind"] = json!({ "north": "3 m/s", "east": "-7 m/s" });
    let blown = one(&blown, times(20.0, Some(5.0), None));
    for time in [5.0, 20.0] {
        let moved: Vec<f64> = calm.at(time, &PLACE).iter().zip(wind).map(|(place, wind)| place + wind * time).collect();
        near(&blown.at(time, &PLACE), &moved, 1e-8);
        near(&blown.at(time, &[ANGLES, RATES].concat()), &calm.at(time, &[ANGLES, RATES].concat()), 1e-11);
    }
    // u, v, w are relative to the ground
    let speed = |table: &Table| table.at(0.0, &VELOCITY).iter().map(|v| v * v).sum::<f64>();
    assert!((speed(&calm) - 625.0).abs() < 1e-9 && (speed(&blown) - speed(&calm)).abs() > 1.0);
}

/// An accelerometer beside the centre of gravity shows ω̇×r + ω×(ω×r) more; ω̇ by differences of the rows.
#[test]
fn an_accelerometer_feels_its_lever_arm() {
    let arm = [0.5, 0.2, -0.1];
    let mut document = thrown();
    document["sensors"] = json!({
        "rate": "400 Hz",
        "gyro": quiet("angular-rate", "rad/s"),
        "accelerometer": quiet("specific-force", "m/s^2"),
    });
    document["airplane"] = aerosonde();
    let inside = one(&document, times(1.0, None, None));
    document["airplane"]["positions"] = json!({ "accelerometer": ["0.5 m", "0.2 m", "-0.1 m"] });
    let outside = one(&document, times(1.0, None, None));
    let (gyro, accel) = (["gyro_x", "gyro_y", "gyro_z"], ["accel_x", "accel_y", "accel_z"]);
    let cross =
        |a: [f64; 3], b: [f64; 3]| [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
    let h = 1.0 / 400.0;
    for k in [4, 40, 200, 396_usize] {
        let rate = |k: usize| gyro.map(|name| inside.get(name)[k]);
        let turning: [f64; 3] = std::array::from_fn(|i| {
            let w = |k: usize| rate(k)[i];
            (8.0 * (w(k + 1) - w(k - 1)) - (w(k + 2) - w(k - 2))) / (12.0 * h)
        });
        let (a, b) = (cross(turning, arm), cross(rate(k), cross(rate(k), arm)));
        for i in 0..3 {
            let more = outside.get(accel[i])[k] - inside.get(accel[i])[k];
            assert!((more - a[i] - b[i]).abs() < 1e-5, "{k} {i}: {more} against {}", a[i] + b[i]);
        }
    }
    // at rest in trim it shows the forces over the mass: the sheet's, 9 digits
    let mut document = level();
    document["sensors"] = json!({ "accelerometer": quiet("specific-force", "m/s^2") });
    near(&one(&document, times(0.1, None, None)).last(&accel), &[0.528067687, 0.005195466, -9.792420628], 1e-8);
}

/// A tube at the wing tip of an airplane that yaws is faster or slower by r times its arm.
#[test]
fn an_airspeed_sensor_feels_its_lever_arm() {
    let at = |arm: &str| {
        let mut document = level();
        document["airplane"] = aerosonde();
        document["airplane"]["positions"] = json!({ "airspeed": ["0 m", arm, "0 m"] });
        document["trim"]["bank"] = json!("30 deg");
        document["sensors"] = json!({ "airspeed": "1e-30 m/s" });
        one(&document, times(0.1, None, None)).at(0.0, &["airspeed", "u", "v", "w", "p", "r"])
    };
    let [speed, u, v, w, p, r] = at("-1 m")[..] else { panic!() };
    // (p, q, r) × (0, −1, 0) = (r, 0, −p)
    assert!((speed - ((u + r).powi(2) + v * v + (w - p).powi(2)).sqrt()).abs() < 1e-12);
    assert!((at("0 m")[0] - 25.0).abs() < 1e-9 && (speed - 25.0).abs() > 0.15);
}

/// With one sample of delay the servo receives the command of sample k from sample k + 1 on.
#[test]
fn a_command_comes_as_late_as_the_document_says() {
    for delay in [0, 1, 3_usize] {
        let mut document = level();
        document["autopilot"] = json!({
            "rate": "100 Hz", "delay": format!("{delay} samples"), "pitch": "8 deg",
            "gains": { "kq": "0.2 s", "ktheta": 0.6, "kp": "0.06 s", "kphi": 0.6, "kr": "0.15 s" }
        });
        let table = one(&document, times(0.1, None, None));
        let elevator = table.get("elevator");
        assert!(elevator[..=delay].iter().all(|e| (e - elevator[0]).abs() < 1e-12), "{delay}: {elevator:?}");
        // nose up: trailing edge up
        assert!(elevator[delay + 1] < elevator[0] - 1e-4, "{delay}: {elevator:?}");
    }
}

/// Rows of a file between two steps cut the step: the length of the steps changes nothing.
#[test]
fn commands_of_a_file_arrive_when_they_are_given() {
    let c = trim().controls;
    let bench = crate::support::Bench::new();
    let e = c.elevator.to_degrees();
    let file = bench
        .file("commands.csv", format!("time (s),elevator (deg)\n0,{e:e}\n0.10371,{:e}\n0.7,{e:e}\n3,{e:e}\n", e + 2.0));
    let mut document = level();
    document["controls"] = json!({ "file": file });
    let fly = |step: f64| one(&document, times(2.0, Some(1.0), Some(step)));
    let (coarse, fine) = (fly(2.5e-3), fly(5e-4));
    for names in [PLACE, VELOCITY, ANGLES, RATES] {
        near(&coarse.last(&names), &fine.last(&names), 2e-8);
    }
    let moved = one(&level(), times(2.0, Some(1.0), None)).last(&["theta"])[0] - fine.last(&["theta"])[0];
    assert!(moved.abs() > 1e-3);
    let short = runs(&document, times(4.0, Some(1.0), None), 1, 1).err().unwrap();
    assert!(short.contains("commands.csv: ends at 3 s, before the 4 s"), "{short}");
}
