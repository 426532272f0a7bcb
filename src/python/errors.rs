//! What the house says as Python exceptions, of `kfdesign.errors`.

use std::any::Any;

use kfdesign::cli::in_one_line;
use kfdesign::filter::FilterError;
use kfdesign::import::ImportError;
use kfdesign::input::InputError;
use kfdesign::params::ParamsError;
use kfdesign::tune::TuneError;
use pyo3::exceptions::PyRuntimeError;
use pyo3::prelude::*;

/// One line, as the command says it; options that were missing are said as the keywords that would answer.
pub(crate) fn raised(error: &anyhow::Error) -> PyErr {
    let mut line = in_one_line(error);
    let input = error.chain().find_map(|cause| cause.downcast_ref::<InputError>());
    if let Some(missing) = input.map(|error| &error.missing).filter(|missing| !missing.is_empty()) {
        let answers: Vec<String> = missing.iter().map(|(option, value)| format!("{option}={value:?}")).collect();
        line += &format!("; for example: {}", answers.join(", "));
    }
    let is = |kind: fn(&(dyn std::error::Error + 'static)) -> bool| error.chain().any(kind);
    let class = if input.is_some() {
        "LogError"
    } else if is(|cause| cause.is::<ParamsError>() || cause.is::<ImportError>()) {
        "ParamsError"
    } else if is(|cause| cause.is::<FilterError>() || cause.is::<TuneError>()) {
        "DesignError"
    } else {
        "KfdesignError"
    };
    Python::attach(|py| {
        let class = py.import("kfdesign.errors").and_then(|errors| errors.getattr(class));
        match class.and_then(|class| class.call1((line.as_str(),))) {
            Ok(error) => PyErr::from_value(error),
            Err(error) => error,
        }
    })
}

/// A panic: a defect of the program, which is said as one.
pub(crate) fn defect(why: &(dyn Any + Send)) -> PyErr {
    let said = why.downcast_ref::<&str>().copied().or_else(|| why.downcast_ref::<String>().map(String::as_str));
    let text = said.unwrap_or("no reason was given");
    PyRuntimeError::new_err(format!("a defect of kfdesign, please report it: {text}"))
}
