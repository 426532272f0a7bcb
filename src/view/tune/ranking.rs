//! Designs ranked on logs.

use crate::compare::designs::Ranking;
use crate::filter::FilterDesign;
use crate::report::{Report, Section};
use crate::units::{Unit, digits};

/// `design`: whose unit is shown.
pub fn ranking<'a>(ranking: &Ranking, design: &FilterDesign) -> Report<'a> {
    let unit = design.axes.first().map(|axis| axis.noise.display_unit(design.quantity)).unwrap_or_else(Unit::one);
    let rows = ranking.designs.iter().enumerate().map(|(i, d)| {
        let verdicts: Vec<&str> = d.verdicts.iter().map(|verdict| verdict.word()).collect();
        let sigmas: Vec<String> = d.steady.iter().map(|axis| digits(unit.from_si(axis.sigma))).collect();
        [
            d.design.clone(),
            d.objective.clone().unwrap_or_else(|| "-".into()),
            format!("{:.2}", d.held_out_log_likelihood),
            if i == 0 { "-".into() } else { format!("{:.2} ± {:.2}", d.behind, d.behind_std_dev) },
            verdicts.join(", "),
            sigmas.join(", "),
        ]
    });
    let sigma = format!("steady sigma ({unit})");
    let (share, logs) = (100.0 * ranking.held_out, ranking.logs.join(", "));
    let section = Section::new("")
        .table(
            format!("Designs by the likelihood of the last {share:.1} % of {logs}"),
            &["design", "objective", "held-out ln L", "behind", "verdict", &sigma],
            rows,
        )
        .paragraph(ranking.meaning.clone());
    Report { title: "Designs ranked".into(), sections: vec![section], ..Report::default() }
}
