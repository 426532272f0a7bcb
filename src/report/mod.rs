//! SVG figures and one-page HTML reports (floor 6).
