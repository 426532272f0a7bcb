//! What one design costs where a schedule would have several.

use std::path::Path;

use super::LoopError;
use super::analysis::of_feed;
use super::feed::{Feed, feed};
use super::judged::Judged;
use super::verdict::feed_points;
use crate::aircraft::flight::document::FeedEntry;
use crate::params::Measured;
use crate::units::digits;

/// One sentence for every scheduled feed: the least disk margin over its airspeeds by the design of the flight's own
/// airspeed alone, and by the schedule. Errors: the airplane does not fly at one of them.
pub fn price(judged: &Judged, entries: &[FeedEntry], folder: &Path) -> Result<Vec<String>, LoopError> {
    let scheduled = entries.iter().filter_map(|entry| match entry {
        FeedEntry::Airframe { schedule, .. } if !schedule.is_empty() => Some((entry, schedule)),
        _ => None,
    });
    scheduled.map(|(entry, speeds)| of_one(judged, entry, speeds, folder)).collect()
}

fn of_one(judged: &Judged, entry: &FeedEntry, speeds: &[Measured], folder: &Path) -> Result<String, LoopError> {
    let setting = &judged.setting;
    let mut alone = entry.clone();
    if let FeedEntry::Airframe { schedule, .. } = &mut alone {
        schedule.clear();
    }
    let mut least = [(f64::INFINITY, 0.0); 2];
    for speed in speeds.iter().map(Measured::si) {
        let truth = judged.truth.designed_for(Some(speed), None)?;
        let margin = |feed: Feed| -> Result<f64, LoopError> {
            let result = of_feed(setting, &truth, &feed)?;
            let disks = feed_points(&[result], &[]).remove(0).disk;
            // an unstable half has none
            Ok(if disks.len() < 3 { 0.0 } else { disks.values().copied().fold(f64::INFINITY, f64::min) })
        };
        let found = [margin(feed(setting, &alone, folder, speed)?)?, margin(feed(setting, entry, folder, speed)?)?];
        for (least, found) in least.iter_mut().zip(found) {
            if found < least.0 {
                *least = (found, speed);
            }
        }
    }
    let said = |(margin, speed): (f64, f64)| match margin {
        0.0 => format!("unstable at {} m/s", digits(speed)),
        margin => format!("{margin:.3} at {} m/s", digits(speed)),
    };
    Ok(format!(
        "{}: from {} to {} m/s the least disk margin of one design, for {} m/s, is {}; with the schedule {}",
        entry.name(),
        digits(speeds[0].si()),
        digits(speeds[speeds.len() - 1].si()),
        digits(setting.trim.airspeed()),
        said(least[0]),
        said(least[1])
    ))
}
