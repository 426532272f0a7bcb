//! No number of a flight depends on threads, on other runs or on other sensors; sensor errors have their stated size.

use serde_json::json;

use super::flights::{Table, level, quiet, runs, times};

fn gusty() -> serde_json::Value {
    let mut document = level();
    document["gusts"] = json!({ "model": "dryden", "specification": "MIL-HDBK-1797", "wind_at_20ft": "15 kt" });
    document["sensors"] = json!({
        "gyro": "../params.json",
        "attitude": "2 deg/sqrt(Hz)",
        "airspeed": { "white": "0.5 m/s", "gauss_markov": { "std_dev": "0.3 m/s", "correlation_time": "20 s" } },
        "altitude": "1 m",
        "gnss": { "position": "2 m", "velocity": "0.1 m/s", "rate": "5 Hz" },
    });
    document["autopilot"] = json!({
        "rate": "100 Hz", "delay": 1,
        "gains": { "kq": "0.2 s", "ktheta": 0.6, "kp": "0.06 s", "kphi": 0.6, "kr": "0.15 s", "washout": "1 s" }
    });
    document
}

fn bits(table: &Table) -> Vec<Vec<u64>> {
    table.columns.iter().map(|c| c.iter().map(|x| x.to_bits()).collect()).collect()
}

#[test]
fn threads_and_other_runs_change_no_number() {
    let fly = |threads: usize, count: u64| -> Vec<Vec<Vec<u64>>> {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| runs(&gusty(), times(5.0, None, None), 7, count).unwrap().iter().map(bits).collect())
    };
    let (one, four) = (fly(1, 6), fly(4, 6));
    assert!(one == four);
    assert!(fly(2, 2) == one[..2]);
    assert!(one[0] != one[1]);
}

#[test]
fn another_sensor_changes_no_gust_and_no_other_sensor() {
    let fly = |document: &serde_json::Value| runs(document, times(3.0, None, None), 7, 1).unwrap().remove(0);
    let mut document = gusty();
    document.as_object_mut().unwrap().remove("autopilot");
    let all = fly(&document);
    let sensors = document["sensors"].as_object_mut().unwrap();
    sensors.remove("attitude");
    sensors.remove("altitude");
    sensors.insert("accelerometer".into(), quiet("specific-force", "m/s^2"));
    let fewer = fly(&document);
    for name in ["gust_u", "gust_q", "gyro_x", "gyro_z", "airspeed", "gnss_north", "gnss_velocity_down", "u"] {
        let same = all.get(name).iter().zip(fewer.get(name)).all(|(a, b)| a.to_bits() == b.to_bits());
        assert!(same, "{name}");
    }
}

/// Errors are what stands in the document: standard deviations over 200 s within 5 standard errors (6 of them: a false
/// alarm in 1 of 290,000 such tests), and GNSS measures every 20th sample.
#[test]
fn measurements_have_the_errors_of_the_document() {
    let table = runs(&gusty(), times(200.0, None, None), 3, 1).unwrap().remove(0);
    let spread = |errors: &[f64]| (errors.iter().map(|e| e * e).sum::<f64>() / errors.len() as f64).sqrt();
    let check = |what: &str, errors: Vec<f64>, sigma: f64| {
        let n = errors.len() as f64;
        let z = (spread(&errors) / sigma - 1.0) * (2.0 * n).sqrt();
        assert!(z.abs() < 5.0, "{what}: {} against {sigma}, z {z}", spread(&errors));
    };
    let differences = |measured: &str, truth: &str| -> Vec<f64> {
        table.get(measured).iter().zip(table.get(truth)).map(|(m, t)| m - t).filter(|d| d.is_finite()).collect()
    };
    // 2 deg/sqrt(Hz) at 100 Hz are 20 deg
    check("attitude", differences("attitude_theta", "theta"), 20.0_f64.to_radians());
    check("gnss", differences("gnss_north", "north"), 2.0);
    assert_eq!(differences("gnss_north", "north").len(), 1001);
    let height = |down: &f64| 6_356_766.0 * -down / (6_356_766.0 - down);
    let altitude = table.get("pressure_altitude").iter().zip(table.get("down")).map(|(m, down)| m - height(down));
    check("altitude", altitude.collect(), 1.0);
    // what the gyro shows beside truth, bias and drift is white noise of 0.0562 deg/s/sqrt(Hz)
    let truth: Vec<f64> = (0..table.get("time").len())
        .map(|k| ["rate", "bias", "drift"].iter().map(|what| table.get(&format!("truth_gyro_y_{what}"))[k]).sum())
        .collect();
    let white = table.get("gyro_y").iter().zip(&truth).map(|(m, t)| m - t).collect();
    check("gyro", white, 0.562_f64.to_radians());
    // the rate relative to a flat earth at rest is the inertial one
    assert_eq!(table.get("truth_gyro_y_rate"), table.get("q"));
}
