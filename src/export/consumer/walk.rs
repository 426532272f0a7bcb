//! The drift of a sensor as the consumer's field takes it: a walk with its price, or one process; and what is done
//! where no drift is known.

use super::numbers::{GaussMarkov, Numbers, SLOWEST, Sensor, Walk};
use super::page::Page;
use super::{Choice, Export, clamped, device, exponent, walk_unit};
use crate::tune::{WalkPrice, shared_walk};
use crate::units::{Quantity, digits};

/// Above it the price is said on the screen: the variance is 1.7 times the least, what most of a second sensor would
/// be needed for.
const DEAR: f64 = 1.3;

/// The place of a walk in a file.
pub(super) struct Field<'a> {
    pub(super) quantity: Quantity,
    pub(super) name: &'a str,
    /// Value for K = 1.
    pub(super) scale: f64,
    pub(super) range: Option<[f64; 2]>,
    /// The consumer has a default: without a drift the line is left out.
    pub(super) default: bool,
}

impl Export {
    /// The value of the field with one number for all axes, inflated and within its range; its price goes to the
    /// page. `None`: leave the line out. Errors: no drift is known, nor a limit of one, and the consumer needs a
    /// number.
    pub(super) fn walk(&self, page: &mut Page, field: &Field<'_>) -> Result<Option<f64>, String> {
        let Some(sensor) = self.sensor(field.quantity) else { return Ok(None) };
        let put = |k: f64, page: &mut Page| {
            let value = k * self.inflation * field.scale;
            match field.range {
                Some([low, high]) => clamped(field.name, value, low, high, &mut page.warnings),
                None => value,
            }
        };
        let one = match (&self.choice, self.walk) {
            (Choice::Worst, Walk::Least) => self.least_for_all(sensor),
            _ => sensor.one(&self.choice, |n| n.walk.map(|k| k.value))?,
        };
        if let Some(k) = one {
            let value = put(k, page);
            self.price(page, sensor, value / field.scale);
            let without: Vec<&str> = sensor.axes.iter().filter(|n| n.walk.is_none()).map(|n| n.name.as_str()).collect();
            if !without.is_empty() {
                page.details.push(format!("{}: no drift is known, K is that of the other axes", without.join(", ")));
            }
            return Ok(Some(value));
        }
        if self.allow_zero_walk {
            page.warnings.push(format!("{} is 0: no drift is known, and `allow_zero_walk` was given", field.name));
            return Ok(Some(0.0));
        }
        if field.default {
            let words = format!("{}: no drift is known; left out, so that the default stays", field.name);
            page.remark(&words);
            page.warnings.push(words);
            return Ok(None);
        }
        let limit = self.limit(sensor)?;
        let words = self.limit_words(field.name, field.quantity, limit);
        page.remark(&words);
        page.warnings.push(words);
        Ok(Some(put(limit, page)))
    }

    /// One walk for several axes, before inflation: its price on the axis where it is dearest is least.
    fn least_for_all(&self, sensor: &Sensor) -> Option<f64> {
        let (mut trials, mut least) = (Vec::new(), Vec::new());
        for axis in &sensor.axes {
            if let Some((trial, (k, _))) = axis.trial.as_ref().zip(axis.least) {
                trials.push(trial);
                least.push(k);
            }
        }
        (!trials.is_empty()).then(|| shared_walk(&trials, &least) / self.inflation)
    }

    fn limit_words(&self, name: &str, quantity: Quantity, limit: f64) -> String {
        let limit = exponent(limit);
        format!("{name}: no drift was found; {limit} {} is its 95 % upper limit, not an estimate", walk_unit(quantity))
    }

    /// The largest walk that would not have shown, before inflation. Errors: there is none for one of the axes.
    fn limit(&self, sensor: &Sensor) -> Result<f64, String> {
        let chosen = |n: &Numbers| n.walk_limit.unwrap_or(f64::INFINITY);
        match sensor.one(&self.choice, |n| Some(chosen(n)))?.filter(|k| k.is_finite()) {
            Some(limit) => Ok(limit),
            None => Err(no_drift(sensor.quantity)),
        }
    }

    /// What the walk `k` costs on every axis.
    fn price(&self, page: &mut Page, sensor: &Sensor, k: f64) {
        let Some(aiding) = self.target.aiding(sensor.quantity) else { return };
        let mut dearest: Option<(&str, WalkPrice, f64)> = None;
        for axis in &sensor.axes {
            let Some((price, (least_k, least))) = axis.trial.as_ref().and_then(|trial| trial.price(k)).zip(axis.least)
            else {
                continue;
            };
            page.details.push(format!(
                "{}: with this walk the error of the estimated drift is {} times the least possible (NEES {}), in the \
                 first minute at most {} times; \
                 no walk costs less than {}, K = {} {}",
                axis.name,
                digits(price.settled),
                digits(price.nees),
                digits(price.first_minute),
                digits(least.worst()),
                exponent(least_k / self.inflation),
                walk_unit(sensor.quantity)
            ));
            if dearest.is_none_or(|(_, other, _)| price.worst() > other.worst()) {
                dearest = Some((&axis.name, price, least.worst()));
            }
        }
        let Some((name, price, least)) = dearest else { return };
        if page.price.is_empty() {
            page.price.push(format!("{}; step {} s", self.walk.words(), digits(self.step())));
        }
        let words = format!(
            "{}: price {} settled, {} in the first minute (error of the drift over the least possible error; {name}), \
             least possible {}; aid: {}",
            device(sensor.quantity),
            digits(price.settled),
            digits(price.first_minute),
            digits(least),
            aiding.words
        );
        page.price.push(words);
        if price.worst() > DEAR {
            page.warnings.push(format!(
                "the walk of the {} costs: with it the error of the estimated drift of {name} is {} times the least \
                 possible; no walk costs less than {}{}",
                device(sensor.quantity),
                digits(price.worst()),
                digits(least),
                if self.walk == Walk::Least { "" } else { " (`walk` least)" }
            ));
        }
    }

    /// The one process of a simulator for each axis, inflated, and the walk beside it where it has `walks`. Without
    /// a drift the upper limit of a walk; a simulator without walks gets it as a process that is a walk up to
    /// [`SLOWEST`]. With `default` there is nothing for such an axis. Errors: no drift is known, nor a limit of one.
    pub(super) fn processes(
        &self,
        page: &mut Page,
        sensor: &Sensor,
        walks: bool,
        default: bool,
    ) -> Result<Vec<(Option<GaussMarkov>, f64)>, String> {
        let factor = self.inflation;
        let mut found = Vec::with_capacity(sensor.axes.len());
        let mut worst: f64 = 1.0;
        for axis in &sensor.axes {
            let single = axis.single_process(walks);
            let walk = if walks { axis.rate_random_walk * factor } else { 0.0 };
            let process = single.map(|(process, _)| GaussMarkov { std_dev: process.std_dev * factor, ..process });
            if let Some((_, ratio)) = single {
                worst = worst.max(ratio);
            }
            if !axis.drift.is_empty() || self.allow_zero_walk || default {
                found.push((process, walk));
                continue;
            }
            let limit = axis.walk_limit.ok_or_else(|| no_drift(sensor.quantity))?;
            let words = self.limit_words(&axis.name, sensor.quantity, limit);
            page.remark(&words);
            page.warnings.push(words);
            let as_process =
                GaussMarkov { std_dev: limit * factor * (0.5 * SLOWEST).sqrt(), correlation_time: SLOWEST };
            found.push(if walks { (None, limit * factor) } else { (Some(as_process), 0.0) });
        }
        if worst > 1.0 {
            page.price.push(format!(
                "{}: the one Gauss-Markov process whose Allan deviation is nearest the sensor's: within a factor of {} \
                 over {} to {} s",
                device(sensor.quantity),
                digits(worst),
                digits(self.step()),
                digits(SLOWEST)
            ));
        }
        if worst > DEAR {
            page.warnings.push(format!(
                "one Gauss-Markov process stands for the drift of the {}: its Allan deviation is off by a factor of up \
                 to {}",
                device(sensor.quantity),
                digits(worst)
            ));
        }
        Ok(found)
    }
}

fn no_drift(quantity: Quantity) -> String {
    format!(
        "the parameters of the {} have no drift and no upper limit of one, and the file needs a number: identify a log \
         at rest of some hours, give \
         rate_random_walk.density, or write zeros with `allow_zero_walk`",
        device(quantity)
    )
}
