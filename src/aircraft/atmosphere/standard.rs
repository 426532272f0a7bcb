//! The international standard atmosphere (ISO 2533:1975), troposphere and lower stratosphere.
//!
//! T = T0 − L H and p = p0 (T/T0)^(g0/(L R)) to 11 km of geopotential height H, above T constant and p = p11 e^(−g0 (H
//! − 11 km)/(R T)); ρ = p/(R T), a = √(γ R T).

use super::AirError;

/// Standard gravity, m/s².
pub const GRAVITY: f64 = 9.80665;
/// Specific gas constant of air, J/(kg K).
pub const GAS_CONSTANT: f64 = 287.05287;
/// Nominal radius of the earth for the geopotential height, m.
const EARTH_RADIUS: f64 = 6_356_766.0;
const RATIO_OF_HEATS: f64 = 1.4;
const SEA_LEVEL_TEMPERATURE: f64 = 288.15;
const SEA_LEVEL_PRESSURE: f64 = 101_325.0;
/// K per metre.
const LAPSE: f64 = 0.0065;
const TROPOPAUSE: f64 = 11_000.0;
const STRATOSPHERE_TEMPERATURE: f64 = SEA_LEVEL_TEMPERATURE - LAPSE * TROPOPAUSE;
const PRESSURE_EXPONENT: f64 = GRAVITY / (LAPSE * GAS_CONSTANT);

/// Geopotential heights of the tables of ISO 2533 that these two layers cover, m.
pub const LOWEST: f64 = -2_000.0;
pub const HIGHEST: f64 = 20_000.0;

/// The air at rest at a height, SI.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Air {
    pub temperature: f64,
    pub pressure: f64,
    pub density: f64,
    pub sound_speed: f64,
}

/// Geopotential of a geometric height, H = r h/(r + h), m.
pub fn geopotential(height: f64) -> f64 {
    EARTH_RADIUS * height / (EARTH_RADIUS + height)
}

/// Air at a geopotential height, m. Errors: outside −2 to 20 km.
pub fn at_geopotential(height: f64) -> Result<Air, AirError> {
    if !(LOWEST..=HIGHEST).contains(&height) {
        return Err(AirError(format!(
            "altitude {height:.1} m (geopotential) is outside the standard atmosphere, which is known here from \
             {LOWEST} m to {HIGHEST} m"
        )));
    }
    Ok(layers(height))
}

/// Air at a geometric height, m. Errors: outside −2 to 20 km of geopotential height.
///
/// ```
/// let air = kfdesign::aircraft::atmosphere::standard::at(0.0)?;
/// assert!((air.density - 1.225).abs() < 1e-6);
/// # Ok::<(), kfdesign::aircraft::atmosphere::AirError>(())
/// ```
pub fn at(height: f64) -> Result<Air, AirError> {
    at_geopotential(geopotential(height))
}

/// The density about a geometric height, for a while of flight: its Taylor series to order two.
/// With H the geopotential height, d = g0/R and L the lapse of the layer (0 above the tropopause), dρ/dH = −ρ (d − L)/T
/// and d²ρ/dH² = ρ (d − L)(d − 2L)/T²; dH/dh = (r/(r + h))². Over x metres the next term is below (1.2e-4 x)³/6 of the
/// density.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DensityNear {
    /// Geometric, m.
    height: f64,
    coefficients: [f64; 3],
}

impl DensityNear {
    /// How far from its height the series is used, m: to 3e-13 of the density.
    pub const REACH: f64 = 1.0;

    /// Errors: outside −2 to 20 km of geopotential height.
    pub fn new(height: f64) -> Result<DensityNear, AirError> {
        let air = at(height)?;
        let lapse = if geopotential(height) < TROPOPAUSE { LAPSE } else { 0.0 };
        let (gradient, slope) = (GRAVITY / GAS_CONSTANT, (EARTH_RADIUS / (EARTH_RADIUS + height)).powi(2));
        let first = -air.density * (gradient - lapse) / air.temperature * slope;
        let second =
            -0.5 * first * (gradient - 2.0 * lapse) / air.temperature * slope - first / (EARTH_RADIUS + height);
        Ok(DensityNear { height, coefficients: [air.density, first, second] })
    }

    /// Whether a geometric height is within [`DensityNear::REACH`] and in the same layer.
    pub fn reaches(&self, height: f64) -> bool {
        const BEND: f64 = TROPOPAUSE * EARTH_RADIUS / (EARTH_RADIUS - TROPOPAUSE);
        (height - self.height).abs() <= DensityNear::REACH && (height < BEND) == (self.height < BEND)
    }

    /// kg/m³ at a geometric height near by, m.
    #[inline(always)]
    pub fn at(&self, height: f64) -> f64 {
        let x = height - self.height;
        let [zero, first, second] = self.coefficients;
        zero + x * (first + x * second)
    }
}

fn layers(height: f64) -> Air {
    let temperature = SEA_LEVEL_TEMPERATURE - LAPSE * height.min(TROPOPAUSE);
    let mut pressure = SEA_LEVEL_PRESSURE * (temperature / SEA_LEVEL_TEMPERATURE).powf(PRESSURE_EXPONENT);
    if height > TROPOPAUSE {
        pressure *= (-GRAVITY * (height - TROPOPAUSE) / (GAS_CONSTANT * STRATOSPHERE_TEMPERATURE)).exp();
    }
    Air {
        temperature,
        pressure,
        density: pressure / (GAS_CONSTANT * temperature),
        sound_speed: (RATIO_OF_HEATS * GAS_CONSTANT * temperature).sqrt(),
    }
}
