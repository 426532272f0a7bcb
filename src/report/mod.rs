//! SVG figures and one-page HTML reports (floor 6): views of result records, with no computation of their own.

pub mod allan;
pub mod figure;
pub mod page;
