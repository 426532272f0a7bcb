//! The test report that CI servers read.

use quick_junit::{NonSuccessKind, Property, Report, TestCase, TestCaseStatus, TestSuite};

use crate::aircraft::closed_loop::document::LoopDocument;
use crate::aircraft::closed_loop::verdict::Judgement;
use crate::consistency::Test;
use crate::montecarlo::Outcome;

/// The report could not be written as XML.
#[derive(Debug, thiserror::Error)]
#[error("JUnit report: {message}")]
pub struct JunitError {
    message: String,
}

/// One test suite per axis, one test case per test; the same outcome gives the same bytes.
pub fn report(outcome: &Outcome) -> Result<String, JunitError> {
    let mut report = Report::new("kfdesign montecarlo");
    for axis in &outcome.axes {
        let mut suite = TestSuite::new(format!("axis {}", axis.name));
        for (name, value) in [
            ("verdict", outcome.verdict.word().to_string()),
            ("runs", format!("{}..{}", outcome.runs.first, outcome.runs.end)),
            ("duration_s", outcome.duration_s.to_string()),
            ("seed", outcome.seed.to_string()),
            ("alpha", outcome.alpha.to_string()),
        ] {
            suite.add_property(Property::new(name, value));
        }
        suite.add_test_cases(outcome.tests.iter().filter(|t| t.axis == axis.name).map(case));
        report.add_test_suite(suite);
    }
    report.to_string().map_err(|e| JunitError { message: e.to_string() })
}

fn case(test: &Test) -> TestCase {
    let detail = format!(
        "{}: statistic {}, expected {} to {}, p {}, family-wise p {}",
        test.meaning, test.statistic, test.lower, test.upper, test.p_value, test.adjusted_p_value
    );
    let status = if test.pass() {
        TestCaseStatus::success()
    } else {
        let mut status = TestCaseStatus::non_success(NonSuccessKind::Failure);
        status.set_type("inconsistent").set_message(test.meaning.clone()).set_description(detail.clone());
        status
    };
    let mut case = TestCase::new(test.name.clone(), status);
    case.set_classname(format!("kfdesign.montecarlo.{}", test.axis)).set_system_out(detail);
    case
}

/// One test suite per feed, one test case per limit and surface or axis.
pub fn of_loop(document: &LoopDocument) -> Result<String, JunitError> {
    let mut report = Report::new("kfdesign loop");
    for feed in &document.feeds {
        let mut suite = TestSuite::new(format!("feed {}", feed.name));
        let flight = &document.flight;
        for (name, value) in [
            ("verdict", document.verdict.to_string()),
            ("airplane", document.airplane.clone()),
            ("airspeed_m_s", flight.airspeed.to_string()),
            ("altitude_m", flight.altitude.to_string()),
        ] {
            suite.add_property(Property::new(name, value));
        }
        suite.add_test_cases(document.criteria.iter().filter(|c| c.feed == feed.name).map(limit));
        report.add_test_suite(suite);
    }
    report.to_string().map_err(|e| JunitError { message: e.to_string() })
}

fn limit(judgement: &Judgement) -> TestCase {
    let status = if judgement.pass {
        TestCaseStatus::success()
    } else {
        let mut status = TestCaseStatus::non_success(NonSuccessKind::Failure);
        status.set_type("not kept").set_message(judgement.meaning.clone()).set_description(judgement.meaning.clone());
        status
    };
    let name = format!("{} {} of {}", judgement.name, judgement.kind.replace('_', " "), judgement.surface);
    let mut case = TestCase::new(name, status);
    case.set_classname(format!("kfdesign.loop.{}", judgement.feed)).set_system_out(judgement.meaning.clone());
    case
}
