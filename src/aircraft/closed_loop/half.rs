//! The two halves of the motion about a steady flight, each with its surfaces, gyros and gusts.

/// Pitch, and roll with yaw. States are those of `airframe::linear`: u w q θ and v p r φ.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Half {
    Pitch,
    RollYaw,
}

/// States of the airframe in a half, as many as are measured or true of each.
pub const AIRFRAME: usize = 4;
/// Number of the angle among them, θ or φ.
pub const ANGLE: usize = 3;

impl Half {
    pub const BOTH: [Half; 2] = [Half::Pitch, Half::RollYaw];

    /// As in documents.
    pub fn name(self) -> &'static str {
        match self {
            Half::Pitch => "pitch",
            Half::RollYaw => "roll_yaw",
        }
    }

    /// As in sentences.
    pub fn title(self) -> &'static str {
        match self {
            Half::Pitch => "pitch",
            Half::RollYaw => "roll and yaw",
        }
    }

    /// Names of the surfaces that close the loop.
    pub fn surfaces(self) -> &'static [&'static str] {
        match self {
            Half::Pitch => &["elevator"],
            Half::RollYaw => &["aileron", "rudder"],
        }
    }

    /// Their numbers among elevator, aileron, rudder.
    pub fn actuators(self) -> &'static [usize] {
        match self {
            Half::Pitch => &[0],
            Half::RollYaw => &[1, 2],
        }
    }

    /// Which of the states are rates that a gyro measures.
    pub fn rates(self) -> &'static [usize] {
        match self {
            Half::Pitch => &[2],
            Half::RollYaw => &[1, 2],
        }
    }

    /// Names of those rates.
    pub fn rate_names(self) -> &'static [&'static str] {
        match self {
            Half::Pitch => &["q"],
            Half::RollYaw => &["p", "r"],
        }
    }

    pub fn angle_name(self) -> &'static str {
        match self {
            Half::Pitch => "theta",
            Half::RollYaw => "phi",
        }
    }

    /// The gyro axes (x, y, z) that measure them.
    pub fn gyros(self) -> &'static [usize] {
        match self {
            Half::Pitch => &[1],
            Half::RollYaw => &[0, 2],
        }
    }

    /// Which state the angle is the integral of.
    pub fn integrated(self) -> usize {
        self.rates()[0]
    }
}
