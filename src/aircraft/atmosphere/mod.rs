//! Standard atmosphere, Dryden turbulence, discrete gusts (floor 1).
