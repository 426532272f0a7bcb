//! Yaml files of continuous densities: Kalibr's imu.yaml, OpenVINS' kalibr_imu_chain.yaml, EuRoC's sensor.yaml
//! (`rate_hz`), ORB-SLAM3's settings.
//!
//! Sources: ethz-asl/kalibr, kalibr_common/ConfigReader.py (white noise over √dt there, walks as they are, all four
//! above zero); rpng/open_vins, ov_msckf/src/state/Propagator.cpp (N²/dt, K² dt); UZ-SLAMLab/ORB_SLAM3,
//! src/ImuTypes.cc (N √f, K/√f). So N and K are as written.

use super::yaml::Entry;
use super::{Imported, Problem, density_unit, sensor_name, three_alike, walk_unit, white_and_walk};
use crate::params::Params;
use crate::units::Quantity;

/// Names of the numbers in one family of files.
struct Family {
    origin: &'static str,
    /// White noise and walk of either sensor.
    keys: [(Quantity, &'static str, &'static str); 2],
    /// The first is the usual one.
    rate: &'static [&'static str],
}

const FAMILIES: [Family; 2] = [
    Family {
        origin: "Kalibr imu.yaml",
        keys: [
            (Quantity::AngularRate, "gyroscope_noise_density", "gyroscope_random_walk"),
            (Quantity::SpecificForce, "accelerometer_noise_density", "accelerometer_random_walk"),
        ],
        rate: &["update_rate", "rate_hz"],
    },
    Family {
        origin: "ORB-SLAM3 settings",
        keys: [
            (Quantity::AngularRate, "IMU.NoiseGyro", "IMU.GyroWalk"),
            (Quantity::SpecificForce, "IMU.NoiseAcc", "IMU.AccWalk"),
        ],
        rate: &["IMU.Frequency"],
    },
];

fn family(entries: &[Entry]) -> Option<&'static Family> {
    let has = |key: &str| entries.iter().any(|e| e.key == key);
    FAMILIES.iter().find(|family| family.keys.iter().any(|(_, white, walk)| has(white) || has(walk)))
}

pub(super) fn knows(entries: &[Entry]) -> bool {
    family(entries).is_some()
}

pub(super) fn parse(entries: &[Entry], rate_hz: Option<f64>) -> Result<Imported, Problem> {
    let Some(family) = family(entries) else { return Err(Problem::whole("no noise density is in the file")) };
    let mut warnings = Vec::new();
    // the numbers of one unit: at the top, or below imu0
    let named = |e: &&Entry| family.keys.iter().any(|(_, white, walk)| e.key == *white || e.key == *walk);
    let mut groups: Vec<&[String]> = entries.iter().filter(named).map(|e| e.above.as_slice()).collect();
    groups.dedup();
    let (first, others) = groups.split_first().ok_or_else(|| Problem::whole("no noise density is in the file"))?;
    if !others.is_empty() {
        let names: Vec<String> = groups.iter().map(|above| above.join(".")).collect();
        warnings.push(format!("several sensors ({}): the first is read", names.join(", ")));
    }
    let find = |key: &str| entries.iter().find(|e| e.key == key && e.above == *first);
    let in_file =
        family.rate.iter().find_map(|key| find(key)).map(|e| e.number().map(|hertz| (e, hertz))).transpose()?;
    let sample_rate_hz = match (rate_hz, in_file) {
        (Some(given), _) => given,
        (None, Some((_, hertz))) if hertz > 0.0 => hertz,
        (None, Some((entry, _))) => return Err(entry.problem("found 0, expected the sample rate in Hz")),
        (None, None) => super::rate(None, &format!("the file has no {}", family.rate[0]))?,
    };
    if let (Some(given), Some((entry, hertz))) = (rate_hz, in_file)
        && given != hertz
    {
        warnings.push(format!("{} is {hertz}, `rate` {given} stands before it", entry.key));
    }
    let (mut sensors, mut rules) = (Vec::new(), Vec::new());
    for (quantity, white_key, walk_key) in &family.keys {
        let (Some(white), walk) = (find(white_key), find(walk_key)) else {
            match find(walk_key) {
                Some(walk) => return Err(walk.problem(format!("stands without {white_key}"))),
                None => continue,
            }
        };
        let density = white.number()?;
        if density == 0.0 {
            return Err(white.problem("found 0, but every sensor has white noise"));
        }
        let drift = walk.map(Entry::number).transpose()?.unwrap_or(0.0);
        if drift == 0.0 {
            warnings.push(format!(
                "{walk_key} is {}: the {} has no drift in params.json",
                if walk.is_some() { "0" } else { "not there" },
                sensor_name(*quantity)
            ));
        }
        rules.push(format!(
            "{white_key} is N in {}, {walk_key} is K in {}, both continuous: taken as they are, for three axes alike",
            density_unit(*quantity),
            walk_unit(*quantity)
        ));
        let axes = three_alike(&white_and_walk(*quantity, density, drift)?);
        sensors.push(Params { quantity: *quantity, sample_rate_hz, axes, design: None, source: None });
    }
    Ok(Imported { origin: family.origin, sensors, rules, warnings })
}
