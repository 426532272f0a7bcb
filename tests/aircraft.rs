//! The airplane: its air, its motion, what it measures. Numbers named "the sheet's" come from a second implementation
//! of the same equations.

mod airframe_filter;
mod airplane;
mod atmosphere;
mod closed_loop;
mod command;
mod documents;
mod flights;
mod fly;
mod linear;
mod loop_command;
mod loop_design;
mod loop_flights;
mod margins;
mod second;
mod servo;
mod steady;
mod streams;
mod turbulence;
