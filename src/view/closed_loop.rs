//! The filter in the control loop.

mod figures;
mod varied;

pub use self::figures::curves;
use crate::aircraft::closed_loop::Judged;
use crate::aircraft::closed_loop::curves::Drawn;
use crate::aircraft::closed_loop::document::{HalfDocument, LoopDocument, MarginDocument};
use crate::aircraft::closed_loop::verdict::{Judgement, shown};
use crate::report::{Conclusion, Level, Report, Section};
use crate::units::digits;

/// Sentences on failed feeds in the short answer: of two lines each, beside a table of four feeds.
const MOST_SENTENCES: usize = 2;

/// The verdict, a table of each half, and what is to be said of it; `drawn`: what figures alone show.
pub fn closed_loop<'a>(judged: &'a Judged, drawn: &'a Drawn) -> Report<'a> {
    let document = &judged.document;
    let flight = &document.flight;
    let wind =
        flight.wind_at_20ft_kt.map_or_else(|| "still air".into(), |kt| format!("wind at 20 ft {} kt", digits(kt)));
    let failed: Vec<&Judgement> = document.criteria.iter().filter(|criterion| !criterion.pass).collect();
    let mut sections = vec![
        Section::new("")
            .table("", &SUMMARY, document.feeds.iter().map(|feed| summary(feed, &document.criteria)))
            .findings("warning", document.warnings.clone()),
    ];
    sections.push(pitch(document));
    sections.push(roll_yaw(document));
    sections.push(
        Section::of_page("Criteria")
            .at(Level::Full)
            .list(failed.iter().map(|criterion| format!("{}.", criterion.meaning)).collect())
            .at(Level::Page)
            .table("", &CRITERIA, document.criteria.iter().map(criterion)),
    );
    sections.push(
        Section::of_page("What each filter changes")
            .list(document.notes.clone())
            .at(Level::Page)
            .table(
                "Answer to a commanded angle, and to a 1 - cos gust",
                &ANSWERS,
                document.feeds.iter().flat_map(answers),
            )
            .table("What a filter knows of a gyro's drift", &KNOWN, document.feeds.iter().flat_map(known))
            .table("Levels by the motions of the closed loop, phase B", &LEVELS, document.feeds.iter().flat_map(levels))
            .paragraph(format!("Caution: {}.", document.caution))
            .paragraph(
                "A filter changes nothing of how the surfaces reach the airplane: its error is not reached by the \
                 command at all. What it can lower is margin and damping; what it can raise is how well bias and gusts \
                 are seen, and accuracy.",
            )
            .table("The airplane's own motions", &REACH, reach(document)),
    );
    sections.extend(document.sweep.as_ref().map(varied::sweep));
    sections.extend(document.spread.as_ref().map(varied::spread));
    sections.extend(document.optimized.as_ref().map(varied::optimized));
    sections.extend(document.flights.as_ref().map(|flown| varied::flights(flown, &document.paired)));
    sections.extend(figures::sections(judged, drawn));
    let (kept, all) = (document.criteria.len() - failed.len(), document.criteria.len());
    let verdict = (document.verdict != "none").then(|| Conclusion {
        word: document.verdict.into(),
        sentence: format!("{kept} of {all} criteria are kept by {} feeds", document.feeds.len()),
        brief: match &document.best {
            Some(best) => format!("{kept} of {all} criteria are kept; {best} keeps all, with the least surface rate"),
            None => format!("{kept} of {all} criteria are kept; no feed keeps all"),
        },
    });
    Report {
        title: format!("Control loop of {}", document.airplane),
        subtitle: format!(
            "{} m/s at {} m, {wind}; autopilot {} Hz, {} ms from measurement to servo",
            digits(flight.airspeed),
            digits(flight.altitude),
            digits(flight.rate_hz),
            digits(1e3 * flight.delay_s)
        ),
        verdict,
        answer: answer(document, &failed, format!("{}, {wind}", document.airplane)),
        provenance: super::provenance([]),
        sections,
        ..Report::default()
    }
}

const SUMMARY: [&str; 3] = ["feed", "result", "not kept"];
const ANSWER: [&str; 6] = ["feed", "disk margin", "damping", "surfaces (deg/s)", "offset (deg)", "result"];
const PITCH: [&str; 8] = [
    "feed",
    "least damped (rad/s, damping)",
    "disk margin",
    "gain (dB)",
    "rms q (deg/s)",
    "rms theta (deg)",
    "elevator rate: all (gust, gyro)",
    "offset (deg)",
];
const ROLL_YAW: [&str; 10] = [
    "feed",
    "least damped (rad/s, damping)",
    "disk margin: aileron, rudder; both",
    "gain (dB)",
    "rms p (deg/s)",
    "rms r (deg/s)",
    "rms phi (deg)",
    "aileron rate: all (gust, gyro)",
    "rudder rate: all (gust, gyro)",
    "offset (deg)",
];
const CRITERIA: [&str; 6] = ["feed", "criterion", "of", "value", "limit", "result"];
const ANSWERS: [&str; 8] = [
    "feed",
    "of",
    "rise (s)",
    "overshoot (%)",
    "settled (s)",
    "gust: angle (deg)",
    "gust: rate (deg/s)",
    "offset gone (s)",
];
const KNOWN: [&str; 4] = ["feed", "gyro", "after 10 s (deg/s)", "after 100 s (deg/s)"];
const LEVELS: [&str; 4] = ["feed", "criterion", "value", "level"];
const REACH: [&str; 4] = ["motion", "by", "PBH, velocities over V", "modal measures"];

/// The least of what is judged of each feed, and what speaks most against those that fail.
fn answer<'a>(document: &LoopDocument, failed: &[&Judgement], about: String) -> Section<'a> {
    let rows = document.feeds.iter().map(|feed| {
        let halves = [&feed.pitch, &feed.roll_yaw];
        let stable = halves.iter().all(|half| half.stable);
        let shown = |value: f64| if stable { three(value) } else { "-".into() };
        let disk = halves.iter().flat_map(|half| &half.margins).map(|margin| margin.disk).fold(f64::INFINITY, f64::min);
        let damping = halves.iter().filter_map(|half| half.least_damped.as_ref()).map(|mode| mode.damping);
        let rates = halves.iter().flat_map(|half| &half.rms).filter(|(name, _)| name.ends_with("_rate"));
        let rate = rates.map(|(_, rms)| rms.all * rms.all).sum::<f64>().sqrt();
        let offset =
            ["theta", "phi"].iter().zip(halves).filter_map(|(name, half)| half.offset.get(*name)).map(|x| x.abs());
        let own = || document.criteria.iter().filter(|criterion| criterion.feed == feed.name);
        let result = match (own().count(), own().filter(|criterion| !criterion.pass).count()) {
            _ if !stable => "unstable".into(),
            (0, _) => "not judged".into(),
            (_, 0) => "pass".into(),
            (all, bad) => format!("FAIL: {bad} of {all}"),
        };
        [
            feed.name.clone(),
            shown(disk),
            shown(damping.fold(1.0, f64::min)),
            shown(rate),
            shown(offset.fold(0.0, f64::max)),
            result,
        ]
    });
    let mut worst: Vec<String> = Vec::new();
    for feed in &document.feeds {
        let own = failed.iter().filter(|criterion| criterion.feed == feed.name);
        let most = own.max_by(|a, b| excess(a).total_cmp(&excess(b)));
        worst.extend(most.map(|criterion| format!("{}.", criterion.meaning)));
    }
    worst.truncate(MOST_SENTENCES);
    Section::new(about)
        .table("", &ANSWER, rows)
        .paragraphs(worst)
        .paragraphs(varied::briefly(document))
        .findings("warning", super::answer::warnings(document.warnings.clone()))
}

/// How far a value lies beyond its limit, as a share of the limit.
fn excess(judgement: &Judgement) -> f64 {
    judgement.value.map_or(f64::INFINITY, |value| ((value - judgement.limit) / judgement.limit).abs())
}

fn summary(feed: &Feed, criteria: &[Judgement]) -> [String; 3] {
    let own = || criteria.iter().filter(|criterion| criterion.feed == feed.name);
    let failed = own().filter(|criterion| !criterion.pass);
    let mut names: Vec<String> =
        failed.map(|c| format!("{} of {}", c.name.replace('_', " "), c.surface.replace('_', " and "))).collect();
    names.dedup();
    let result = match (own().count(), names.is_empty()) {
        (0, _) => "-",
        (_, true) => "pass",
        (_, false) => "FAIL",
    };
    let names = if names.is_empty() { "-".into() } else { names.join(", ") };
    [feed.name.clone(), result.into(), names]
}

fn three(x: f64) -> String {
    format!("{x:.3}")
}

fn least(half: &HalfDocument) -> String {
    match &half.least_damped {
        Some(mode) => format!("{:.2}, {:.3}", mode.frequency, mode.damping),
        None => "none".into(),
    }
}

fn all(half: &HalfDocument, name: &str) -> String {
    half.rms.get(name).map_or_else(|| "-".into(), |rms| three(rms.all))
}

fn parts(half: &HalfDocument, name: &str) -> String {
    let parts = |rms: &crate::aircraft::closed_loop::document::RmsDocument| {
        format!("{:.3} ({:.3}, {:.3})", rms.all, rms.gust, rms.gyro_white)
    };
    half.rms.get(name).map_or_else(|| "-".into(), parts)
}

fn gains(half: &HalfDocument) -> String {
    let one = |margin: &MarginDocument| margin.gain_db.map_or("none".into(), |db| format!("{db:.2}"));
    half.margins.iter().map(one).collect::<Vec<_>>().join(", ")
}

fn offset(half: &HalfDocument, name: &str) -> String {
    half.offset.get(name).map_or_else(|| "-".into(), |x| format!("{:.2}", x.abs()))
}

fn pitch(document: &LoopDocument) -> Section<'_> {
    let rows = document.feeds.iter().map(|feed| {
        let half = &feed.pitch;
        let disk = half.margins.first().map_or_else(|| "unstable".into(), |margin| three(margin.disk));
        [
            feed.name.clone(),
            least(half),
            disk,
            gains(half),
            all(half, "q"),
            all(half, "theta"),
            parts(half, "elevator_rate"),
            offset(half, "theta"),
        ]
    });
    Section::of_page("Pitch").table("Pitch", &PITCH, rows).minor(&["gain (dB)", "rms q (deg/s)"])
}

fn roll_yaw(document: &LoopDocument) -> Section<'_> {
    let rows = document.feeds.iter().map(|feed| {
        let half = &feed.roll_yaw;
        let disks: Vec<String> = half.margins.iter().map(|margin| three(margin.disk)).collect();
        let both =
            half.multiloop.as_ref().map_or("unstable".into(), |m| format!("{}; {:.3}", disks.join(", "), m.disk));
        [
            feed.name.clone(),
            least(half),
            both,
            gains(half),
            all(half, "p"),
            all(half, "r"),
            all(half, "phi"),
            parts(half, "aileron_rate"),
            parts(half, "rudder_rate"),
            offset(half, "phi"),
        ]
    });
    Section::of_page("Roll and yaw").table("Roll and yaw", &ROLL_YAW, rows).minor(&[
        "gain (dB)",
        "rms p (deg/s)",
        "rms r (deg/s)",
    ])
}

fn criterion(judgement: &Judgement) -> [String; 6] {
    let value = judgement.value.map_or_else(|| "-".into(), |x| shown(x, judgement.unit));
    [
        judgement.feed.clone(),
        format!("{} {}", judgement.name.replace('_', " "), judgement.kind.replace('_', " ")),
        judgement.surface.replace('_', " and "),
        value,
        shown(judgement.limit, judgement.unit),
        if judgement.pass { "pass" } else { "FAIL" }.into(),
    ]
}

type Feed = crate::aircraft::closed_loop::document::FeedDocument;

fn halves(feed: &Feed) -> [(&'static str, &HalfDocument, [&'static str; 2]); 2] {
    [("pitch", &feed.pitch, ["theta", "q"]), ("roll and yaw", &feed.roll_yaw, ["phi", "p"])]
}

fn answers(feed: &Feed) -> Vec<[String; 8]> {
    let number = |x: Option<f64>| x.map_or_else(|| "-".into(), digits);
    let row = |(of, half, [angle, rate]): (&str, &HalfDocument, [&str; 2])| {
        let step = half.step.as_ref()?;
        let peak = |name: &str| number(half.gust_peaks.get(name).copied());
        Some([
            feed.name.clone(),
            of.into(),
            number(step.rise_s),
            format!("{:.1}", 100.0 * step.overshoot),
            number(step.settling_s),
            peak(angle),
            peak(rate),
            number(half.offset_removed_s),
        ])
    };
    halves(feed).into_iter().filter_map(row).collect()
}

fn known(feed: &Feed) -> Vec<[String; 4]> {
    let each = halves(feed).into_iter().flat_map(|(_, half, _)| &half.known);
    each.map(|k| [feed.name.clone(), k.gyro.into(), digits(k.after_10_s), digits(k.after_100_s)]).collect()
}

fn levels(feed: &Feed) -> Vec<[String; 4]> {
    let each = halves(feed).into_iter().flat_map(|(_, half, _)| &half.handling);
    let level =
        |level: Option<u8>| level.map_or_else(|| "-".into(), |l| if l > 3 { "beyond 3".into() } else { l.to_string() });
    each.map(|h| {
        let unit = if h.unit == "1" { "" } else { h.unit };
        let value = h.value.map_or_else(|| "-".into(), |x| shown(x, unit));
        [feed.name.clone(), h.name.replace('_', " "), value, level(h.level)]
    })
    .collect()
}

fn reach(document: &LoopDocument) -> Vec<[String; 4]> {
    let each = document.controllability.iter().chain(&document.observability);
    each.map(|reach| {
        let cosines: Vec<String> = reach.cosines_scaled.iter().map(|c| format!("{c:.4}")).collect();
        [reach.mode.replace('_', " "), reach.by.join(", "), format!("{:.4}", reach.pbh_scaled), cosines.join(", ")]
    })
    .collect()
}
