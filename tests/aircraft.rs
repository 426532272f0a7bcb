//! The airplane: its air, its motion, what it measures. Numbers named "the sheet's" come from a second implementation
//! of the same equations.

mod airplane;
mod atmosphere;
mod command;
mod documents;
mod flights;
mod fly;
mod linear;
mod second;
mod servo;
mod steady;
mod streams;
mod turbulence;
