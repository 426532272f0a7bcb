//! Linear algebra, matrix equations, roots and minima, distributions, random streams and ordered sums (floor 0).

pub mod distribution;
pub mod exact_sum;
pub mod largest_normal;
pub mod linalg;
pub mod normals;
pub mod optimize;
pub mod quadratic_form;
pub mod random;
pub mod reduce;
pub mod riccati;
pub mod van_loan;
