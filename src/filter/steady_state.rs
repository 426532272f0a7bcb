//! Steady state of a design.
