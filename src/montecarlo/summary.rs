//! From the sums over runs to tests.

use nalgebra::DVector;

use super::engine::{Axis, EpochPlan, Sums};
use super::{AxisOutcome, Epoch, Plan};
use crate::consistency::Test;
use crate::consistency::normalized::{MeanTest, mean_of_chi_squares};
use crate::numerics::distribution::{normal_quantile, normal_sf};
use crate::units::digits;

/// Tests of one axis, not yet adjusted.
pub(super) fn conclude(name: &str, axis: &Axis, sums: &Sums, plan: &Plan) -> (AxisOutcome, Vec<Test>) {
    let mut tests = Vec::new();
    let mut epochs = Vec::new();
    for (epoch, nees) in axis.epochs.iter().zip(&sums.nees) {
        let size = epoch.size() as f64;
        let mean = mean_of_chi_squares(*nees, plan.runs, size, plan.alpha);
        let time_s = epoch.step as f64 * axis.dt;
        let test = mean.nees(name, &format!("nees at {} s", digits(time_s)));
        tests.push(test);
        epochs.push(Epoch { time_s, anees: mean.mean / size, lower: mean.lower / size, upper: mean.upper / size });
    }
    tests.extend(mean_errors(name, axis, sums, plan));
    let innovations = plan.runs * plan.steps;
    let nis = mean_of_chi_squares(sums.nis, innovations, 1.0, plan.alpha);
    tests.push(scale(name, "nis", &nis, "the innovations have", "their predicted variance"));
    tests.push(neighbours(name, sums.neighbours, plan));
    let low = mean_of_chi_squares(sums.low_frequency, sums.blocks, 1.0, plan.alpha);
    let of = format!("averaged over {:.4} s the innovations have", axis.block as f64 * axis.dt);
    tests.push(scale(name, "low_frequency", &low, &of, "the predicted power"));
    (AxisOutcome { name: name.to_string(), epochs, nis: nis.mean }, tests)
}

/// A mean of squares whose expectation is one.
fn scale(axis: &str, name: &str, mean: &MeanTest, subject: &str, object: &str) -> Test {
    let meaning = match mean.tendency() {
        "as predicted" => format!("{subject} {object}"),
        tendency => format!("{subject} {:.4} times {object}: the filter is {tendency}", mean.mean),
    };
    Test::new(axis, name, mean.mean, [mean.lower, mean.upper], mean.p_value, meaning)
}

/// Is the error zero on average, at the first and at the last time? runs·|mean of whitened errors|² is χ²(number of components).
fn mean_errors(name: &str, axis: &Axis, sums: &Sums, plan: &Plan) -> Vec<Test> {
    let all: Vec<_> = axis.epochs.iter().zip(&sums.error).collect();
    let ends = match all.as_slice() {
        [first, .., last] => vec![*first, *last],
        few => few.to_vec(),
    };
    let test = |(epoch, error): (&EpochPlan, &DVector<f64>)| {
        let statistic = error.norm_squared() / plan.runs as f64;
        let test = mean_of_chi_squares(statistic, 1, epoch.size() as f64, plan.alpha);
        let meaning = match test.tendency() {
            "as predicted" => "the errors are zero on average",
            "optimistic" => "the errors are not zero on average: the filter starts from a wrong x0 or is driven off",
            _ => "the mean error is smaller than chance allows",
        };
        let name_at = format!("mean_error at {} s", digits(epoch.step as f64 * axis.dt));
        Test::new(name, &name_at, statistic, [test.lower, test.upper], test.p_value, meaning.to_string())
    };
    ends.into_iter().map(test).collect()
}

/// Correlation of neighbouring innovations. Σ y_k y_(k+1) of N pairs has variance N and, by the central limit theorem for
/// products of independent normals, is normal to order 1/N.
fn neighbours(name: &str, sum: f64, plan: &Plan) -> Test {
    let pairs = (plan.runs * (plan.steps - 1)) as f64;
    let z = sum / pairs.sqrt();
    let bound = normal_quantile(1.0 - plan.alpha / 2.0);
    let meaning = if z.abs() <= bound {
        "neighbouring innovations are not correlated".to_string()
    } else {
        format!("neighbouring innovations are correlated ({:.2e})", sum / pairs)
    };
    Test::new(name, "whiteness", z, [-bound, bound], (2.0 * normal_sf(z.abs())).min(1.0), meaning)
}
