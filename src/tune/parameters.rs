//! The physical parameters of a design: which there are, which are held, and the design that factors on them make.

use super::objective::ObjectiveError;
use crate::numerics::distribution::NORMAL_95;
use crate::params::{Design, Measured, Params};

/// A number of the sensor, the plant or an aid.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Parameter {
    /// Number of the axis of the sensor; `None`: of the plant or an aid, which all axes share.
    pub(super) axis: Option<usize>,
    /// `gauss_markov.std_dev`, `heading.std_dev`.
    pub(super) path: String,
    pub(super) value: Measured,
    /// Stays as it is.
    pub(super) held: bool,
}

/// The logarithm of a parameter (SI) before anything else is known: N(mean, std_dev²).
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Prior {
    pub(super) mean: f64,
    pub(super) std_dev: f64,
}

impl Parameter {
    /// The normal law of the logarithm of which the 95 % interval is the middle 95 %; `None` without an interval, or
    /// with an open or empty one.
    pub(super) fn prior(&self) -> Option<Prior> {
        let [lower, upper] = self.value.interval_si()?.map(f64::ln);
        let prior = Prior { mean: 0.5 * (lower + upper), std_dev: (upper - lower) / (2.0 * NORMAL_95) };
        (prior.mean.is_finite() && prior.std_dev > 0.0).then_some(prior)
    }

    /// ln of the value in SI.
    pub(super) fn log(&self) -> f64 {
        self.value.si().ln()
    }

    fn is_called(&self, name: &str, axes: &[String]) -> bool {
        let own =
            |name: &str| self.path == name || self.path.strip_prefix(name).is_some_and(|rest| rest.starts_with('.'));
        let of_axis = self.axis.and_then(|axis| name.strip_prefix(axes[axis].as_str())?.strip_prefix('.'));
        own(name) || of_axis.is_some_and(own)
    }
}

/// All parameters of a sensor in its plant.
#[derive(Clone, Debug)]
pub(super) struct Space {
    params: Params,
    design: Design,
    pub(super) parameters: Vec<Parameter>,
}

/// Axes whose parameters are found together, and the parameters that move.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Group {
    pub(super) axes: Vec<usize>,
    /// Numbers of the parameters.
    pub(super) free: Vec<usize>,
}

impl Space {
    /// `hold`: paths, or the beginnings of paths (`gauss_markov`), with the name of an axis before them or not. The
    /// slope of a ramp never moves: it is no noise. Errors: a name that is none of the parameters, or nothing left
    /// to move.
    pub(super) fn new(params: &Params, design: &Design, hold: &[String]) -> Result<Space, ObjectiveError> {
        let mut copy = params.clone();
        let mut shared = design.clone();
        let mut parameters = Vec::new();
        for (number, axis) in copy.axes.iter_mut().enumerate() {
            let own = axis.noise_parameters().filter(|(path, _)| !path.starts_with("rate_ramp"));
            parameters.extend(own.map(|(path, value)| (Some(number), path, value.clone())));
        }
        parameters.extend(shared.noise_parameters().map(|(path, value)| (None, path, value.clone())));
        let mut parameters: Vec<Parameter> =
            parameters.into_iter().map(|(axis, path, value)| Parameter { axis, path, value, held: false }).collect();
        let axes: Vec<String> = params.axes.iter().map(|axis| axis.name.clone()).collect();
        for name in hold {
            let mut found = false;
            for parameter in parameters.iter_mut().filter(|parameter| parameter.is_called(name, &axes)) {
                (parameter.held, found) = (true, true);
            }
            if !found {
                let mut known: Vec<String> = parameters.into_iter().map(|parameter| parameter.path).collect();
                known.sort();
                known.dedup();
                return Err(ObjectiveError::Hold { name: name.clone(), known: known.join(", ") });
            }
        }
        if parameters.iter().all(|parameter| parameter.held) {
            return Err(ObjectiveError::AllHeld);
        }
        Ok(Space { params: params.clone(), design: design.clone(), parameters })
    }

    pub(super) fn params(&self) -> &Params {
        &self.params
    }

    pub(super) fn design(&self) -> &Design {
        &self.design
    }

    /// "gauss_markov.std_dev", with the axis before it where there are several.
    pub(super) fn name(&self, number: usize) -> String {
        let parameter = &self.parameters[number];
        match parameter.axis.filter(|_| self.params.axes.len() > 1) {
            Some(axis) => format!("{}.{}", self.params.axes[axis].name, parameter.path),
            None => parameter.path.clone(),
        }
    }

    /// One axis each, or all together where a parameter that they share moves.
    pub(super) fn groups(&self) -> Vec<Group> {
        let free = |axes: &[usize]| -> Vec<usize> {
            let theirs = |p: &Parameter| p.axis.is_none_or(|axis| axes.contains(&axis));
            (0..self.parameters.len()).filter(|&i| !self.parameters[i].held && theirs(&self.parameters[i])).collect()
        };
        let all: Vec<usize> = (0..self.params.axes.len()).collect();
        let together = self.parameters.iter().any(|parameter| parameter.axis.is_none() && !parameter.held);
        let axes: Vec<Vec<usize>> = if together { vec![all] } else { all.into_iter().map(|axis| vec![axis]).collect() };
        let groups = axes.into_iter().map(|axes| Group { free: free(&axes), axes });
        groups.filter(|group| !group.free.is_empty()).collect()
    }

    /// Whether two groups have the same numbers, so that what is right for one is right for the other.
    pub(super) fn alike(&self, a: &Group, b: &Group) -> bool {
        let numbers = |group: &Group| -> Vec<_> {
            let of = |&axis: &usize| {
                let mut axis = self.params.axes[axis].clone();
                axis.name.clear();
                axis
            };
            group.axes.iter().map(of).collect()
        };
        let paths =
            |group: &Group| -> Vec<&str> { group.free.iter().map(|&i| self.parameters[i].path.as_str()).collect() };
        a.axes.len() == b.axes.len() && numbers(a) == numbers(b) && paths(a) == paths(b)
    }

    /// The documents with the logarithm of every parameter moved by its shift. What moved has no interval any more.
    pub(super) fn shifted(&self, shifts: &[f64]) -> (Params, Design) {
        let (mut params, mut design) = (self.params.clone(), self.design.clone());
        for (parameter, &shift) in self.parameters.iter().zip(shifts).filter(|(_, shift)| **shift != 0.0) {
            let set = |found: Option<(String, &mut Measured)>| {
                if let Some((_, value)) = found {
                    value.value *= shift.exp();
                    value.interval = None;
                }
            };
            match parameter.axis {
                Some(axis) => set(params.axes[axis].noise_parameters().find(|(path, _)| *path == parameter.path)),
                None => set(design.noise_parameters().find(|(path, _)| *path == parameter.path)),
            }
        }
        (params, design)
    }
}
