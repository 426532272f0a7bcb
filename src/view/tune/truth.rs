//! The design under another truth.

use super::{Design, Group, axes, states};
use crate::report::Section;
use crate::tune::UnderTruth;
use crate::units::digits;
use crate::view::alike;

/// One per group of axes of the same numbers; none without a truth.
pub(super) fn sections<'a>(of: &Design<'a>) -> Vec<Section<'a>> {
    let Some((name, results)) = of.truth else { return Vec::new() };
    let all = results.iter().zip(axes(of)).map(|(result, (name, axis))| (name, (result, axis)));
    let same = |(a, of_a): &(&UnderTruth, Group<'_>), (b, of_b): &(&UnderTruth, Group<'_>)| {
        let named = UnderTruth { name: a.name.clone(), ..(*b).clone() };
        of_a.unit == of_b.unit && **a == named && of_a.design.model.states == of_b.design.model.states
    };
    alike(all, same)
        .into_iter()
        .map(|(names, (result, axis))| section(name, result, &Group { names, ..axis }))
        .collect()
}

fn section<'a>(truth: &str, result: &UnderTruth, group: &Group<'_>) -> Section<'a> {
    // states with columns of their own
    let single: Vec<usize> = states::single(&group.design.model).filter(|&i| i < result.states.len()).collect();
    let of_states = single.iter().flat_map(|&i| [result.states[i].name.clone(), "claimed".into()]);
    let whole = [format!("whole drift ({})", group.unit), "claimed".into(), "NEES".into()];
    let header: Vec<String> = ["time (s)".to_string()].into_iter().chain(of_states).chain(whole).collect();
    let row = |(k, &time): (usize, &f64)| {
        let of_states = single.iter().flat_map(|&i| {
            let (error, scale) = (&result.states[i], group.of_state(i).0);
            [error.real[k] / scale, error.claimed[k] / scale]
        });
        let drift = [result.drift.real[k], result.drift.claimed[k]].map(|sigma| group.unit.from_si(sigma));
        let numbers = std::iter::once(time).chain(of_states).chain(drift).map(Some).chain([result.nees[k]]);
        numbers.map(crate::view::or_dash).collect::<Vec<_>>()
    };
    let per = if result.states.is_empty() { "of the whole drift (the truth has other states)" } else { "per state" };
    let expected = format!(
        "Expected NEES {per}; expected NIS {} over {} s: both would be 1 if all were as claimed.",
        digits(result.nis),
        digits(result.time_s.last().copied().unwrap_or(0.0))
    );
    Section::new(format!("Under the truth {truth}: {}", group.title()))
        .table(
            "Root mean square error beside the sigma that the filter claims, exact, no simulation",
            &header,
            result.time_s.iter().enumerate().map(row),
        )
        .paragraphs(vec![expected, result.meaning.clone()])
        .findings("note", result.notes.clone())
}
