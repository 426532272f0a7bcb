//! The command line that asks for the same as a request.

use clap::{Arg, ArgAction, CommandFactory};
use serde_json::Value;

use super::Cli;

/// The words after `kfdesign`, from a request of the command of this name: its keys are flags and arguments. Errors:
/// the command or a key is not known.
pub fn words(name: &str, request: &Value) -> Result<Vec<String>, String> {
    let (command, hidden) = if name == "rank" { ("tune", Some(("files", "rank"))) } else { (name, None) };
    let mut all = Cli::command();
    // only then its arguments know their places
    all.build();
    let known = all.find_subcommand(command).ok_or_else(|| format!("no command {name}"))?;
    let mut places: Vec<(usize, String)> = Vec::new();
    let mut options = Vec::new();
    let mut given = Vec::new();
    flatten(request, &mut given)?;
    for (key, value) in given {
        let key = hidden.filter(|(field, _)| *field == key).map_or(key, |(_, flag)| flag);
        let argument = known.get_arguments().find(|argument| argument.get_id() == key);
        let argument = argument.ok_or_else(|| format!("{key}: {name} has no such key"))?;
        let values = texts(argument, value)?;
        match (argument.get_long(), argument.get_index()) {
            (_, Some(at)) => places.extend(values.into_iter().map(|value| (at, value))),
            (Some(long), None) if takes_none(argument) => {
                options.extend((value == &Value::Bool(true)).then(|| format!("--{long}")));
            }
            // a value that begins with a hyphen is one all the same
            (Some(long), None) => options.extend(values.into_iter().flat_map(|value| match value.starts_with('-') {
                true => vec![format!("--{long}={value}")],
                false => vec![format!("--{long}"), value],
            })),
            (None, None) => return Err(format!("{key}: {name} has no flag of this name")),
        }
    }
    places.sort_by_key(|(at, _)| *at);
    let places = places.into_iter().map(|(_, value)| value);
    Ok(std::iter::once(command.to_string()).chain(places).chain(options).collect())
}

/// A line to copy into a shell.
pub fn line(words: &[String]) -> String {
    let all = std::iter::once("kfdesign").chain(words.iter().map(String::as_str));
    all.map(quoted).collect::<Vec<_>>().join(" ")
}

/// A word as a shell takes it.
pub(super) fn quoted(word: &str) -> String {
    let plain = |c: char| c.is_alphanumeric() || "_./,:=+-^".contains(c);
    if !word.is_empty() && word.chars().all(plain) {
        word.to_owned()
    } else {
        format!("'{}'", word.replace('\'', "'\\''"))
    }
}

/// Keys with their values; what stands in groups, too.
fn flatten<'a>(request: &'a Value, into: &mut Vec<(&'a str, &'a Value)>) -> Result<(), String> {
    let keys = request.as_object().ok_or("a request is a JSON object")?;
    for (key, value) in keys {
        match value {
            Value::Object(_) => flatten(value, into)?,
            Value::Null => {}
            value => into.push((key, value)),
        }
    }
    Ok(())
}

fn takes_none(argument: &Arg) -> bool {
    matches!(argument.get_action(), ArgAction::SetTrue | ArgAction::SetFalse | ArgAction::Count)
}

fn texts(argument: &Arg, value: &Value) -> Result<Vec<String>, String> {
    let one = |value: &Value| match value {
        Value::String(text) => Ok(text.clone()),
        Value::Number(_) | Value::Bool(_) => Ok(value.to_string()),
        _ => Err(format!("{}: expected a text, a number or a list of them", argument.get_id())),
    };
    let all = match value {
        Value::Array(values) => values.iter().map(one).collect::<Result<Vec<_>, _>>()?,
        value => vec![one(value)?],
    };
    Ok(match argument.get_value_delimiter() {
        Some(mark) if !all.is_empty() => vec![all.join(&mark.to_string())],
        _ => all,
    })
}
