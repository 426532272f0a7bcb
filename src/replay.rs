//! A log through a design to a verdict (floor 4).
