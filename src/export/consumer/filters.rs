//! How the filters of the consumers run: their step, and what aids them. A walk is priced in this filter.
//!
//! Each line is one filter of one sensor; its numbers are the consumer's own defaults, named with it.

use super::Target;
use crate::units::Quantity;

/// What measures the integral of a sensor.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Aiding {
    /// 1: an angle or a velocity; 2: a position.
    pub integrals: usize,
    /// SI.
    pub std_dev: f64,
    pub rate_hz: f64,
    /// For comments, with the source of the numbers.
    pub words: &'static str,
}

/// A camera at 20 Hz that sees 150 points, each to a pixel, with 460 pixels of focal length: the configurations for
/// EuRoC of VINS-Fusion (max_cnt 150, FOCAL_LENGTH 460) and OpenVINS (up_msckf_sigma_px 1). rad, the mean of all
/// points.
const CAMERA: f64 = 1.0 / (460.0 * 12.247_448_713_915_89);
/// s of EKF2_PREDICT_US and EKF_TARGET_DT as shipped.
const EKF2_STEP: f64 = 0.01;
const EKF3_STEP: f64 = 0.012;

impl Target {
    /// s from one step of the consumer's filter to the next; `None`: that of the log.
    pub(super) fn own_step(self) -> Option<f64> {
        match self {
            Target::Px4 => Some(EKF2_STEP),
            Target::ArduPilot => Some(EKF3_STEP),
            _ => None,
        }
    }

    /// `None`: a simulator, which has no filter.
    pub(super) fn aiding(self, quantity: Quantity) -> Option<Aiding> {
        use Quantity::{AngularRate, SpecificForce};
        let of = |integrals, std_dev, rate_hz, words| Some(Aiding { integrals, std_dev, rate_hz, words });
        match (self, quantity) {
            (Target::Matlab | Target::GnssInsSim | Target::NaveGo | Target::Gazebo, _) => None,
            (Target::Px4, AngularRate) => {
                of(1, 0.3, 15.0, "a magnetic heading of 0.3 rad at 15 Hz (EKF2_HEAD_NOISE, SENS_MAG_RATE)")
            }
            (Target::Px4, SpecificForce) => of(1, 0.3, 5.0, "a GNSS velocity of 0.3 m/s at 5 Hz (EKF2_GPS_V_NOISE)"),
            (Target::ArduPilot, AngularRate) => {
                of(1, 0.5, 10.0, "a magnetic heading of 0.5 rad at 10 Hz (EK3_YAW_M_NSE)")
            }
            (Target::ArduPilot, SpecificForce) => {
                of(1, 0.5, 5.0, "a GNSS velocity of 0.5 m/s at 5 Hz (EK3_VELNE_M_NSE, GPS_RATE_MS)")
            }
            (_, AngularRate) => of(
                1,
                CAMERA,
                20.0,
                "a camera's attitude of 0.18 mrad at 20 Hz (150 points of 1 pixel, focal length 460)",
            ),
            (_, SpecificForce) => {
                of(2, 5.0 * CAMERA, 20.0, "a camera's position of 0.9 mm at 20 Hz (the points at 5 m)")
            }
        }
    }
}

impl Aiding {
    /// Spread of a bias nobody described: EKF2_GBIAS_INIT and EKF2_ABIAS_INIT as shipped.
    pub(super) fn any_bias(quantity: Quantity) -> f64 {
        match quantity {
            Quantity::AngularRate => 0.1,
            Quantity::SpecificForce => 0.2,
        }
    }
}
