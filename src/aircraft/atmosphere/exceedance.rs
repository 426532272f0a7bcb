//! How strong turbulence is above 1750 ft: the chart of MIL-F-8785C (1980), figure 7.
//!
//! Its curves join heights at which the standard deviation of u, v and w is exceeded with one probability. The numbers
//! are those that JSBSim and others read off it; one transcription, not checked against the print.

use super::AirError;
use super::dryden::FOOT;

/// Of the curves; 1e-2, 1e-3 and 1e-5 are light, moderate and severe turbulence.
pub const PROBABILITIES: [f64; 7] = [0.2, 0.1, 1e-2, 1e-3, 1e-4, 1e-5, 1e-6];

/// Heights, ft.
const HEIGHTS: [f64; 11] = [1750.0, 3750.0, 7500.0, 15e3, 25e3, 35e3, 45e3, 55e3, 65e3, 75e3, 80e3];

/// ft/s at the heights, a row for each probability.
const STD_DEVS: [[f64; 11]; 7] = [
    [2.2, 1.5, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0],
    [3.6, 3.3, 1.6, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0],
    [6.9, 7.4, 6.7, 4.6, 2.7, 0.4, 0.0, 0.0, 0.0, 0.0, 0.0],
    [9.6, 10.6, 10.1, 8.0, 6.6, 5.0, 4.2, 2.7, 0.0, 0.0, 0.0],
    [13.0, 16.0, 15.1, 11.6, 9.7, 8.1, 8.2, 7.9, 4.9, 3.2, 2.1],
    [17.6, 23.0, 23.6, 22.1, 20.0, 16.0, 15.1, 12.1, 7.9, 6.2, 5.1],
    [21.5, 28.4, 30.2, 30.7, 31.0, 25.2, 23.1, 17.5, 10.7, 8.4, 7.2],
];

/// Standard deviation of u, v and w (m/s) that is exceeded with a probability at a height above ground (m), straight
/// between the heights of the chart; below 2000 ft, where lengths and intensities go over to those near the ground,
/// that at 2000 ft. Errors: a probability without a curve, above the chart, or no turbulence there.
pub fn std_dev(probability: f64, height: f64) -> Result<f64, AirError> {
    // as written: 1e-3 and 0.001 are one number
    let Some(curve) = PROBABILITIES.iter().position(|p| *p == probability) else {
        let known = PROBABILITIES.map(|p| p.to_string()).join(", ");
        return Err(AirError(format!(
            "exceedance {probability}: the chart of MIL-F-8785C has curves for {known}; give one of these, or std_dev"
        )));
    };
    let feet = (height / FOOT).max(2000.0);
    let above = HEIGHTS.partition_point(|h| *h <= feet);
    if above == HEIGHTS.len() || feet.is_nan() {
        return Err(AirError(format!(
            "height {height} m: the chart of MIL-F-8785C ends at 80000 ft (24384 m); give std_dev"
        )));
    }
    let [low, high] = [above - 1, above].map(|i| (HEIGHTS[i], STD_DEVS[curve][i]));
    let value = low.1 + (high.1 - low.1) * (feet - low.0) / (high.0 - low.0);
    if value > 0.0 {
        return Ok(value * FOOT);
    }
    Err(AirError(format!(
        "at a height of {height} m ({feet:.0} ft) there is no turbulence that is exceeded with a probability of \
         {probability}; give a smaller exceedance, or leave the gusts out"
    )))
}
