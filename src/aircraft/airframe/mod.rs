//! The `airplane.json` document, aerodynamics, propulsion, trim, linear models, modes and criteria (floor 2).
