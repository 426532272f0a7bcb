//! Sweeps, spreads and flights of a control loop.

use super::super::answer::three;
use crate::aircraft::closed_loop::document::LoopDocument;
use crate::aircraft::closed_loop::flown::{Flown, Paired};
use crate::aircraft::closed_loop::varied::{FeedPoint, Moved, Optimized, Spread, Sweep};
use crate::aircraft::flight::RateGains;
use crate::report::figure::{self, Curve, Found, FoundPoint, OverLog};
use crate::report::{Level, Section};
use crate::units::digits;

const SWEEP: [&str; 7] = ["value", "feed", "disk margin", "damping", "surface rates (deg/s)", "angles (deg)", "result"];
const SPREAD: [&str; 5] = ["feed", "criterion", "kept (%)", "95 % from", "to"];

/// What was asked for beside the verdict, in a sentence each.
pub(super) fn briefly(document: &LoopDocument) -> Vec<String> {
    let nobody = || "no feed keeps every criterion".to_string();
    let sweep = document.sweep.as_ref().map(|sweep| {
        let throughout = || match sweep.points.iter().find_map(|point| point.best.as_ref()) {
            Some(best) => format!("{best} is best throughout"),
            None => nobody(),
        };
        let said = if sweep.changes.is_empty() { throughout() } else { sweep.changes.join("; ") };
        format!("Over the {}: {said}.", sweep.variable)
    });
    let spread = document.spread.as_ref().map(|spread| {
        let all = spread.kept.iter().filter(|kept| kept.criterion == "all criteria");
        let shares: Vec<String> = all.map(|kept| format!("{} {:.0} %", kept.feed, 100.0 * kept.share)).collect();
        format!("Of {} drawn airplanes so many keep every criterion: {}.", spread.cases, shares.join(", "))
    });
    let optimized = document.optimized.as_ref().map(|found| {
        let of = |name: &String| found.feeds.iter().find(|feed| feed.feed == *name);
        match found.best.as_ref().and_then(of).zip(found.gains.as_ref()) {
            Some((best, gains)) => {
                let [from, to] = [best.cost.from, best.cost.to].map(three);
                format!("Optimised, {} costs least: {from} -> {to}, \"gains\": {gains}", best.feed)
            }
            None => format!("Optimised, {}.", nobody()),
        }
    });
    let flights = document.flights.as_ref().map(|flown| {
        let inside = flown.linear.iter().filter(|row| row.inside).count();
        format!(
            "{} flights: {inside} of {} exact rms lie in the 95 % intervals of those flown; {} flights know every rms \
             to 1 %.",
            flown.runs,
            flown.linear.len(),
            flown.needed_for_one_percent
        )
    });
    [sweep, spread, optimized, flights].into_iter().flatten().collect()
}

pub(super) fn sweep(sweep: &Sweep) -> Section<'_> {
    let caption = format!("Sweep of {}: {}", sweep.variable, sweep.meaning);
    let rows = sweep.points.iter().flat_map(|point| {
        let value = format!("{} {}", digits(point.value), sweep.unit).trim_end().to_string();
        let none = point.none.iter().map({
            let value = value.clone();
            move |why| [value.clone(), why.clone(), "-".into(), "-".into(), "-".into(), "-".into(), "-".into()]
        });
        let feeds = point.feeds.iter().map(move |feed| row(value.clone(), feed, point.best.as_deref()));
        none.chain(feeds).collect::<Vec<_>>()
    });
    Section::new("")
        .table(caption, &SWEEP, rows)
        .list(sweep.changes.clone())
        .figure("", || {
            curves(sweep, "Surface rate", "root of the sum of squares of the rms rates", |feed| feed.activity)
        })
        .figure("", || curves(sweep, "Least disk margin", "disk margin", least_disk))
}

fn least_disk(feed: &FeedPoint) -> Option<f64> {
    feed.disk.values().copied().min_by(f64::total_cmp)
}

fn row(value: String, feed: &FeedPoint, best: Option<&str>) -> [String; 7] {
    let list = |values: Vec<f64>| values.iter().map(|x| format!("{x:.3}")).collect::<Vec<_>>().join(", ");
    let result = match (feed.stable, feed.passes, best == Some(feed.name.as_str())) {
        (false, _, _) => "unstable",
        (true, true, true) => "best",
        (true, true, false) => "pass",
        (true, false, _) => "FAIL",
    };
    [
        value,
        feed.name.clone(),
        list(feed.disk.values().copied().collect()),
        list(feed.damping.values().copied().collect()),
        list(feed.surface_rate.values().copied().collect()),
        list(feed.angle.values().copied().collect()),
        result.into(),
    ]
}

fn curves(sweep: &Sweep, title: &str, quantity: &str, of: impl Fn(&FeedPoint) -> Option<f64>) -> String {
    let mut curves: Vec<Curve> = Vec::new();
    for point in &sweep.points {
        for feed in &point.feeds {
            let Some(y) = of(feed) else { continue };
            match curves.iter_mut().find(|curve| curve.label == feed.name) {
                Some(curve) => curve.points.push((point.value, y)),
                None => curves.push(Curve { label: feed.name.clone(), points: vec![(point.value, y)] }),
            }
        }
    }
    let unit = if title.starts_with("Surface") { "deg/s" } else { "" };
    figure::over_log(&OverLog {
        title: format!("{title} over {}", sweep.variable),
        description: format!("{title} of every feed over the {}.", sweep.meaning),
        x: (sweep.variable.into(), sweep.unit.into()),
        y: (quantity.into(), unit.into()),
        curves,
        ..OverLog::default()
    })
}

pub(super) fn spread(spread: &Spread) -> Section<'_> {
    let percent = |x: f64| format!("{:.1}", 100.0 * x);
    let rows = spread.kept.iter().map(|kept| {
        [kept.feed.clone(), kept.criterion.clone(), percent(kept.share), percent(kept.lower), percent(kept.upper)]
    });
    let trim = match spread.without_trim {
        0 => String::new(),
        count => format!("; {count} of them do not fly steadily there and are left out"),
    };
    Section::new("").at(Level::Full).table(
        format!(
            "{} drawn airplanes (one standard deviation: {}), seed {}{trim}",
            spread.cases,
            spread.drawn.join(", "),
            spread.seed
        ),
        &SPREAD,
        rows,
    )
}

const OPTIMIZED: [&str; 9] = [
    "feed",
    "cost",
    "corner (Hz)",
    "kq, ktheta, kp, kphi, kr",
    "disk margin",
    "damping",
    "surfaces (deg/s)",
    "cost in another wind",
    "result",
];

pub(super) fn optimized(found: &Optimized) -> Section<'_> {
    let moved = |moved: &Moved| format!("{} -> {}", three(moved.from), three(moved.to));
    let rows = found.feeds.iter().map(|feed| {
        let gains: Vec<String> =
            RateGains::NAMES.iter().filter_map(|name| feed.gains.get(name)).map(|g| three(g.to)).collect();
        let held_out = feed.held_out.as_ref().map_or_else(
            || "-".into(),
            |held| format!("{}, {}", moved(&held.cost), if held.passes { "kept" } else { "not kept" }),
        );
        [
            feed.feed.clone(),
            moved(&feed.cost),
            feed.corner.as_ref().map_or_else(|| "-".into(), moved),
            gains.join(", "),
            moved(&feed.disk),
            moved(&feed.damping),
            moved(&feed.surface_rate),
            held_out,
            if feed.passes { "pass" } else { "FAIL" }.into(),
        ]
    });
    let mut section = Section::new("Optimised")
        .paragraph(format!("Least {}; kept: {}.", found.cost, found.kept))
        .table("", &OPTIMIZED, rows);
    if let (Some(best), Some(gains)) = (&found.best, &found.gains) {
        section = section.paragraph(format!("Best: {best}. \"gains\": {gains}"));
    }
    match found.flights.is_empty() {
        true => section,
        false => {
            section.table("Flown from another seed, in the same gusts and noise", &PAIRED, differences(&found.flights))
        }
    }
}

const LINEAR: [&str; 7] = ["feed", "rms of", "exact", "flown", "95 % from", "to", "result"];
const PAIRED: [&str; 7] = ["feed", "rms of", "against", "difference", "95 % from", "to", "result"];
const FILTERS: [&str; 6] = ["feed", "of", "NIS", "95 %", "NEES", "95 %"];

fn ratios(flown: &Flown) -> String {
    let mut groups: Vec<(String, Vec<FoundPoint>)> = Vec::new();
    for row in &flown.linear {
        let point = (row.linear, row.simulated / row.linear, [row.lower, row.upper].map(|x| x / row.linear));
        match groups.iter_mut().find(|(name, _)| *name == row.feed) {
            Some((_, points)) => points.push(point),
            None => groups.push((row.feed.clone(), vec![point])),
        }
    }
    let x = ("exact rms".into(), "deg, deg/s".into());
    figure::found(&Found { title: "Nonlinear flights".into(), x, groups, label: "95 %".into() })
}

fn differences(paired: &[Paired]) -> impl Iterator<Item = Vec<String>> {
    paired.iter().map(|row| {
        let result = match (row.better, row.not_worse) {
            (true, _) => "better",
            (false, true) => "not worse",
            (false, false) => "not shown",
        };
        let words = [row.feed.clone(), row.quantity.replace('_', " "), row.against.clone()];
        words.into_iter().chain([row.difference, row.lower, row.upper].map(digits)).chain([result.into()]).collect()
    })
}

pub(super) fn flights<'a>(flown: &'a Flown, paired: &[Paired]) -> Section<'a> {
    let exact = flown.linear.iter().map(|row| {
        let numbers = [row.linear, row.simulated, row.lower, row.upper].map(digits);
        let result = if row.inside { "inside" } else { "outside" };
        [row.feed.clone(), row.quantity.replace('_', " ")].into_iter().chain(numbers).chain([result.into()])
    });
    let filters = flown.consistency.iter().map(|row| {
        let both = |values: Option<[f64; 3]>| {
            values.map_or_else(
                || ["-".to_string(), "-".to_string()],
                |[mean, lower, upper]| [digits(mean), format!("{} to {}", digits(lower), digits(upper))],
            )
        };
        let [nis, nees] = [both(row.nis), both(row.nees)];
        [row.feed.clone(), row.half.replace('_', " and ")].into_iter().chain(nis).chain(nees)
    });
    Section::new("")
        .table(
            format!(
                "{} flights of {} s, seed {} (deg, deg/s); {} flights of this length know every rms to 1 %",
                flown.runs,
                digits(flown.duration_s),
                flown.seed,
                flown.needed_for_one_percent
            ),
            &LINEAR,
            exact,
        )
        .table(
            format!(
                "In the same gusts and noise; not worse: by less than {} % (one-sided, 2.5 %); better: a test of its \
                 own",
                digits(100.0 * flown.margin)
            ),
            &PAIRED,
            differences(paired),
        )
        .table("Kalman filters in the loop, 1 when they know their errors", &FILTERS, filters)
        .figure("Root mean squares of nonlinear flights over those that the loop has exactly.", || ratios(flown))
}
