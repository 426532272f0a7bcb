//! Figures and pages. `KFDESIGN_GALLERY=DIR cargo test report::` writes them to DIR, to be looked at.

mod montecarlo;
mod paper;
mod records;
mod terminal;

use kfdesign::consistency::Verdict;
use kfdesign::report::figure::*;
use kfdesign::report::{Conclusion, Level, Report, Section, html};

/// Reproducible standard normal numbers: only something to draw.
struct Normals(u64);

impl Normals {
    fn uniform(&mut self) -> f64 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        ((self.0 >> 11) as f64 + 0.5) / (1u64 << 53) as f64
    }
    fn next(&mut self) -> f64 {
        (-2.0 * self.uniform().ln()).sqrt() * (std::f64::consts::TAU * self.uniform()).cos()
    }
    fn take(&mut self, n: usize) -> Vec<f64> {
        (0..n).map(|_| self.next()).collect()
    }
}

/// White noise and one Gauss-Markov process, continuous form.
fn components(tau: f64) -> (f64, f64) {
    let (n, s, tc) = (0.0562_f64, 0.02806_f64, 193.93_f64);
    let x = tau / tc;
    let drift = s * s * (2.0 * x - 3.0 + 4.0 * (-x).exp() - (-2.0 * x).exp()) / (x * x);
    (n / tau.sqrt(), drift.max(0.0).sqrt())
}

fn allan_data(axis: &str, seed: u64) -> Allan {
    let mut noise = Normals(seed);
    let taus: Vec<f64> = (0..38).map(|i| 0.01 * 10f64.powf(f64::from(i) * 0.14)).collect();
    let points = taus.iter().map(|&tau| {
        let (white, drift) = components(tau);
        let truth = white.hypot(drift);
        let relative = (0.6 * tau / 7200.0).sqrt() * 1.4;
        let deviation = truth * (1.0 + 0.5 * relative * noise.next());
        AllanPoint {
            tau_s: tau,
            deviation,
            lower: deviation / (1.0 + 1.2 * relative),
            upper: deviation * (1.0 + 2.2 * relative),
            noise: if tau < 20.0 {
                "white"
            } else if tau < 70.0 {
                "flicker"
            } else {
                "random walk"
            }
            .into(),
        }
    });
    let curve = |label: &str, f: &dyn Fn(f64) -> f64| Curve {
        label: label.into(),
        points: taus.iter().map(|&t| (t, f(t))).collect(),
    };
    Allan {
        title: format!("{axis}: overlapping Allan deviation"),
        quantity: "Allan deviation".into(),
        unit: "deg/s".into(),
        points: points.collect(),
        band_label: None,
        total: Some(curve("fitted sum", &|t| components(t).0.hypot(components(t).1))),
        components: vec![
            curve("white noise", &|t| components(t).0),
            curve("Gauss-Markov, 194 s", &|t| components(t).1),
        ],
        marks: vec![AllanMark { tau_s: 1.0, deviation: components(1.0).0, word: "N".into(), component: Some(0) }],
    }
}

fn sigma_data() -> Sigma {
    let time_s: Vec<f64> = (0..120).map(|i| 0.01 * 10f64.powf(f64::from(i) / 22.0)).collect();
    let fall =
        |start: f64, end: f64| time_s.iter().map(|t| (end * end + start * start / (1.0 + 30.0 * t)).sqrt()).collect();
    Sigma {
        title: "gyro_x: predicted standard deviation".into(),
        unit: "deg/s".into(),
        states: vec![
            SigmaState { name: "bias".into(), sigma: fall(0.5, 0.0041), steady: None },
            SigmaState { name: "gauss_markov".into(), sigma: fall(0.028, 0.0087), steady: Some(0.0087) },
            SigmaState { name: "gauss_markov.2".into(), sigma: fall(0.011, 0.0052), steady: Some(0.0052) },
        ],
        settling_time_s: Some(19.6),
        time_s,
    }
}

fn budget_data() -> Vec<BudgetItem> {
    [
        ("white noise", 0.503, "0.00617 deg/s"),
        ("Gauss-Markov drift (Tc = 193.9 s)", 0.4961, "0.00612 deg/s"),
        ("turn-on bias", 0.0004, "0.00017 deg/s"),
    ]
    .map(|(source, share, value)| BudgetItem { source: source.into(), share, value: value.into() })
    .to_vec()
}

fn estimate_data() -> Estimate {
    let mut noise = Normals(5);
    let (mut truth, mut error) = (0.1, 0.05);
    let mut data = Estimate {
        title: "gyro_x: bias estimate".into(),
        quantity: "bias".into(),
        unit: "deg/s".into(),
        truth: Some(Curve { label: "truth".into(), points: vec![] }),
        ..Estimate::default()
    };
    for i in 0..900 {
        let t = f64::from(i) * 8.0;
        truth = 0.1 + (truth - 0.1) * 0.96 + 0.008 * noise.next();
        error = error * 0.7 + 0.005 * noise.next();
        data.time_s.push(t);
        data.estimate.push(truth + error);
        data.sigma.push((0.007_f64.powi(2) + 0.25 / (1.0 + 200.0 * t)).sqrt());
        data.truth.as_mut().unwrap().points.push((t, truth));
    }
    data
}

fn innovation_data() -> Innovations {
    let mut noise = Normals(6);
    let extremes = |noise: &mut Normals| {
        noise.take(400).into_iter().fold((0.0_f64, 0.0_f64), |(low, high), v| (low.min(v), high.max(v)))
    };
    let mut data = Innovations { title: "gyro_x: normalised innovations".into(), ..Innovations::default() };
    for i in 0..600 {
        let (low, high) = extremes(&mut noise);
        data.time_s.push(f64::from(i) * 12.0);
        data.lower.push(low);
        data.upper.push(high);
    }
    data
}

fn correlation_data() -> Autocorrelation {
    let mut noise = Normals(7);
    Autocorrelation {
        title: "gyro_x: autocorrelation of innovations".into(),
        points: (1..=40)
            .map(|lag| (f64::from(lag), 0.0023 * noise.next() + 0.012 * (-f64::from(lag) / 2.0).exp()))
            .collect(),
        bound: 0.0046,
        bound_label: "95 % for white".into(),
    }
}

fn histogram_data() -> Histogram {
    let edges: Vec<f64> = (0..=24).map(|i| f64::from(i) * 0.75).collect();
    let expected: Vec<f64> = edges.windows(2).map(|e| 0.62 * (-0.5 * e[0]).exp() / (1.0 + 0.4 * e[0])).collect();
    let observed = expected.iter().enumerate().map(|(i, p)| p * (1.0 + 0.02 * i as f64)).collect();
    Histogram {
        title: "gyro_x: normalised innovation squared".into(), edges, observed, expected, law: "χ²(1)".into()
    }
}

fn periodogram_data() -> Periodogram {
    let mut noise = Normals(8);
    let powers: Vec<f64> = (0..300).map(|_| noise.next().powi(2) + noise.next().powi(2)).collect();
    let total: f64 = powers.iter().sum();
    let mut sum = 0.0;
    let points = powers.iter().enumerate().map(|(i, p)| {
        sum += p / total;
        ((i + 1) as f64 * 0.000_2, sum)
    });
    Periodogram {
        title: "gyro_x: low-frequency cumulative periodogram".into(),
        points: points.collect(),
        half_width: 1.358 / 300f64.sqrt(),
        band_label: "95 % band".into(),
    }
}

fn nees_data() -> Nees {
    let mut noise = Normals(9);
    let mut level = 0.0;
    let nees = (0..500).map(|_| {
        level = 0.95 * level + 0.08 * noise.next();
        2.0 + level
    });
    Nees {
        title: "gyro_x: NEES over 50 runs".into(),
        nees: nees.collect(),
        time_s: (0..500).map(|i| f64::from(i) * 1.2).collect(),
        lower: vec![1.484; 500],
        upper: vec![2.591; 500],
        expected: 2.0,
        under_truth: None,
        band_label: "95 % at one time".into(),
    }
}

fn nees_at_five_times() -> Nees {
    Nees {
        title: "gyro_x: NEES over 100 runs".into(),
        time_s: vec![0.0, 0.6, 18.0, 180.0, 600.0],
        nees: vec![1.04, 0.93, 1.11, 0.97, 1.02],
        lower: vec![0.74; 5],
        upper: vec![1.29; 5],
        expected: 1.0,
        under_truth: None,
        band_label: "95 % at one time".into(),
    }
}

fn error_data() -> Errors {
    let mut noise = Normals(10);
    let path = |noise: &mut Normals| {
        let mut error = 0.0;
        let step = |i: u32| {
            error = 0.9 * error + 0.003 * noise.next();
            (f64::from(i), error)
        };
        Curve { label: String::new(), points: (0..600).map(step).collect() }
    };
    Errors {
        title: "gyro_x: error of bias".into(),
        quantity: "error of bias".into(),
        unit: "deg/s".into(),
        sigma: (0..600).map(|i| (f64::from(i), 0.007 + 0.5 / (1.0 + 9.0 * f64::from(i)))).collect(),
        runs: (0..4).map(|_| path(&mut noise)).collect(),
        label: "runs 0 to 3".into(),
    }
}

fn rms_data() -> Rms {
    let claims = sigma_data();
    let component = |(k, state): (usize, &SigmaState)| Component {
        name: state.name.clone(),
        rms: state.sigma.iter().map(|s| s * (1.1 - 0.2 * k as f64)).collect(),
        claimed: state.sigma.clone(),
    };
    Rms {
        title: "gyro_x: errors and claims".into(),
        band: Some(([0.86, 1.14], "95 % at one time".into())),
        components: claims.states.iter().enumerate().map(component).collect(),
        time_s: claims.time_s,
    }
}

fn course_data() -> Course {
    let mut noise = Normals(11);
    let points: Vec<(f64, f64)> = (0..6000).map(|i| (0.01 * f64::from(i), -0.6 + 0.56 * noise.next())).collect();
    let average = points.iter().map(|p| (p.0, -0.6 + 0.03 * (0.2 * p.0).sin())).collect();
    Course {
        title: "gyro_x: rest.csv".into(),
        quantity: "gyro_x".into(),
        unit: "deg/s".into(),
        points,
        average: Curve { label: "mean of 101 samples, 1.01 s".into(), points: average },
        findings: vec![(12.3, "gap at 12.3 s".into()), (40.0, "outlier at 40 s, first of 3".into())],
    }
}

fn overlay() -> String {
    let curves = [1, 2, 3].map(|k| (format!("gyro_{k}"), allan_data("", k).points));
    allan_overlay("rest.csv: overlapping Allan deviation", "deg/s", &curves)
}

fn gallery() -> Vec<(&'static str, String)> {
    vec![
        ("allan", allan(&allan_data("gyro_x", 1))),
        ("sigma", sigma(&sigma_data())),
        ("budget", error_budget("gyro_x: error budget of the bias estimate", &budget_data())),
        ("estimate", estimate(&estimate_data())),
        ("innovations", innovations(&innovation_data())),
        ("autocorrelation", autocorrelation(&correlation_data())),
        ("nis", nis_histogram(&histogram_data())),
        ("periodogram", cumulative_periodogram(&periodogram_data())),
        ("nees", nees(&nees_data())),
        ("nees5", nees(&nees_at_five_times())),
        ("errors", errors(&error_data())),
        ("rms", rms(&rms_data())),
        ("course", course(&course_data())),
        ("overlay", overlay()),
    ]
}

fn report() -> Report<'static> {
    let figures = |section: Section<'static>, names: &[&str]| {
        let wanted = gallery().into_iter().filter(|figure| names.contains(&figure.0));
        wanted.fold(section, |section, (name, svg)| section.figure(format!("What {name} says."), move || svg.clone()))
    };
    let row = |axis| {
        [
            axis,
            "nis",
            "1.0002",
            "0.9967",
            "1.0033",
            "0.887",
            "1.000",
            "Mean NIS is what the filter predicts, so R is right.",
        ]
    };
    let sha256 = "9f86d081884c7d659a2feaa0c55ad015a3bf4f1b2b0b822cd15d6c15b0f00a08";
    Report {
        title: "Replay of rest.csv".into(),
        subtitle: "Filter design skydog.json, three gyro axes at 100 Hz".into(),
        verdict: Some(Conclusion::new(
            Verdict::Consistent,
            "No test rejects at the family-wise level 0.01 (Holm, 9 tests).",
        )),
        provenance: vec![
            ("log".into(), format!("rest.csv, 720 000 samples, 7200 s, sha256 {sha256}")),
            ("version".into(), "0.1.0".into()),
        ],
        sections: vec![
            Section::new("Verdict per axis")
                .paragraph("The innovations of a true filter are white with the predicted variance.")
                .table(
                    "Tests",
                    &["axis", "test", "statistic", "lower", "upper", "p", "adjusted p", "meaning"],
                    ["gyro_x", "gyro_y", "gyro_z"].map(row),
                )
                .findings("warning", vec!["A gap of 2.4 s at 1312 s was propagated over.".into()]),
            figures(Section::new("gyro_x"), &["estimate", "innovations", "autocorrelation", "nis", "periodogram"]),
            figures(Section::new("Design"), &["allan", "sigma", "budget", "nees", "nees5", "errors", "rms"])
                .list(vec!["One sentence.".into(), "Another sentence.".into()]),
        ],
        ..Report::default()
    }
}

fn save(name: &str, content: &str) {
    if let Some(dir) = std::env::var_os("KFDESIGN_GALLERY") {
        std::fs::write(std::path::Path::new(&dir).join(name), content).unwrap();
    }
}

/// Opening and closing tags match, attributes are quoted, no stray special character.
fn assert_well_formed(svg: &str, name: &str) {
    let mut open: Vec<&str> = vec![];
    let mut rest = svg;
    while let Some(start) = rest.find('<') {
        assert!(
            !rest[..start].contains('>') || open.last() == Some(&"style"),
            "{name}: stray > in {:?}",
            &rest[..start]
        );
        let end = rest[start..].find('>').unwrap() + start;
        let tag = &rest[start + 1..end];
        match tag.strip_prefix('/') {
            Some(closing) => assert_eq!(open.pop(), Some(closing), "{name}"),
            None => {
                assert_eq!(tag.matches('"').count() % 2, 0, "{name}: {tag}");
                if !tag.ends_with('/') {
                    open.push(tag.split_whitespace().next().unwrap());
                }
            }
        }
        rest = &rest[end + 1..];
    }
    assert!(open.is_empty(), "{name}: {open:?}");
    let raw_ampersand = svg
        .split('&')
        .skip(1)
        .any(|after| !after.split(';').next().unwrap_or("").chars().all(|c| c.is_ascii_alphanumeric() || c == '#'));
    assert!(!raw_ampersand, "{name}");
}

/// Every number in geometric attributes, with the size of the figure in the same units.
fn assert_inside(svg: &str, name: &str) {
    let view = svg.split("viewBox=\"0 0 ").nth(1).unwrap().split('"').next().unwrap();
    let (width, height) = view.split_once(' ').unwrap();
    let (width, height): (f64, f64) = (width.parse().unwrap(), height.parse().unwrap());
    let body = svg.split("</style>").nth(1).unwrap();
    for (keys, most) in [([" x", " x1", " x2", " cx"], width), ([" y", " y1", " y2", " cy"], height)] {
        for key in keys {
            for value in body.split(&format!("{key}=\"")).skip(1) {
                let value: f64 = value.split('"').next().unwrap().parse().unwrap();
                assert!((0.0..=most).contains(&value), "{name}: {key}={value}");
            }
        }
    }
    for points in body.split(" points=\"").skip(1) {
        for pair in points.split('"').next().unwrap().split_whitespace() {
            let (x, y) = pair.split_once(',').unwrap();
            let (x, y): (f64, f64) = (x.parse().unwrap(), y.parse().unwrap());
            assert!((0.0..=width).contains(&x) && (0.0..=height).contains(&y), "{name}: {pair}");
        }
    }
}

#[test]
fn figures_are_self_contained_and_accessible() {
    for (name, svg) in gallery() {
        save(&format!("{name}.svg"), &svg);
        assert!(svg.starts_with("<svg xmlns=\"http://www.w3.org/2000/svg\""), "{name}");
        assert!(svg.contains("role=\"img\"") && svg.contains("<title>") && svg.contains("<desc>"), "{name}");
        assert!(svg.contains("prefers-color-scheme:dark"), "{name}");
        // no colour and no type outside the style sheet, nothing fetched
        let (_, body) = svg.split_once("</style>").unwrap();
        for alien in ["#", "font-family", "opacity=", "href", "url(", "NaN", "inf"] {
            assert!(!body.contains(alien), "{name}: {alien}");
        }
        assert_well_formed(&svg, name);
        assert_inside(&svg, name);
    }
    assert_eq!(gallery(), gallery());
}

#[test]
fn sheet_stacks_figures_under_one_style() {
    let one = allan(&allan_data("gyro_x", 1));
    let svg = sheet("rest.csv", &[one.clone(), allan(&allan_data("gyro_y", 2))]);
    save("sheet.svg", &svg);
    assert_well_formed(&svg, "sheet");
    assert_eq!(svg.matches("<style>").count(), 1);
    let height =
        |svg: &str| -> i32 { svg.split(" height=\"").nth(1).unwrap().split('"').next().unwrap().parse().unwrap() };
    assert_eq!(height(&svg), 2 * height(&one));
    assert!(svg.contains(&format!("<svg y=\"{}\"", height(&one))));
}

/// The dot of a known value stands over, or beside, the tick label of that value.
#[test]
fn dots_stand_where_their_values_say() {
    let points: Vec<AllanPoint> = [(0.1, 1e-4), (1.0, 3e-5), (10.0, 1e-5), (100.0, 2e-5)]
        .map(|(tau_s, deviation)| AllanPoint {
            tau_s,
            deviation,
            lower: deviation,
            upper: deviation,
            noise: String::new(),
        })
        .to_vec();
    let svg = allan(&Allan { unit: "rad/s".into(), points, ..Allan::default() });
    let attribute = |line: &str, key: &str| -> f64 {
        line.split(&format!(" {key}=\"")).nth(1).unwrap().split('"').next().unwrap().parse().unwrap()
    };
    let dots: Vec<(f64, f64)> =
        svg.lines().filter(|l| l.contains("<circle")).map(|l| (attribute(l, "cx"), attribute(l, "cy"))).collect();
    // the first is the sample in the legend or the last one: four belong to the data
    let dots = &dots[dots.len() - 4..];
    let lines: Vec<&str> = svg.lines().collect();
    let label = |words: &str| -> (f64, f64) {
        let at = lines.iter().position(|l| *l == words).unwrap_or_else(|| panic!("no label {words}"));
        (attribute(lines[at - 1], "x"), attribute(lines[at - 1], "y"))
    };
    for (dot, words) in dots.iter().zip(["0.1", "1", "10", "100"]) {
        assert!((dot.0 - label(words).0).abs() <= 1.0, "{words}");
    }
    assert!((dots[0].1 - label("10⁻⁴").1).abs() <= 1.0);
    assert!((dots[2].1 - label("10⁻⁵").1).abs() <= 1.0);
    // equal ratios are equal distances, upwards is larger
    let down = |i: usize, j: usize| dots[j].1 - dots[i].1;
    assert!((down(1, 2) / down(0, 2) - 3f64.log10()).abs() < 2e-3);
    assert!(down(3, 2) > 0.0);
}

#[test]
fn hostile_values_make_a_figure_all_the_same() {
    let odd = [f64::NAN, f64::INFINITY, f64::NEG_INFINITY, 0.0, -1.0, 1e300, 1e-300, 5.0, 5.0];
    let cases: Vec<Vec<f64>> = vec![vec![], vec![1.0], vec![0.0; 3], vec![f64::NAN; 4], odd.to_vec(), {
        let mut reversed = odd.to_vec();
        reversed.reverse();
        reversed
    }];
    for values in &cases {
        let pairs: Vec<(f64, f64)> = values.iter().copied().zip(values.iter().rev().copied()).collect();
        let curve = Curve { label: "any".into(), points: pairs.clone() };
        let points = pairs.iter().map(|&(tau_s, deviation)| AllanPoint {
            tau_s,
            deviation,
            lower: -deviation,
            upper: deviation * 2.0,
            noise: "white".into(),
        });
        let figures = [
            allan(&Allan {
                points: points.collect(),
                total: Some(curve.clone()),
                components: vec![curve.clone(); 8],
                ..Allan::default()
            }),
            sigma(&Sigma {
                time_s: values.clone(),
                states: values
                    .iter()
                    .map(|&v| SigmaState { name: "s".into(), sigma: values.clone(), steady: Some(v) })
                    .collect(),
                settling_time_s: values.first().copied(),
                ..Sigma::default()
            }),
            error_budget(
                "budget",
                &values
                    .iter()
                    .map(|&share| BudgetItem { source: "s".into(), share, value: String::new() })
                    .collect::<Vec<_>>(),
            ),
            estimate(&Estimate {
                time_s: values.clone(),
                estimate: values.clone(),
                sigma: values.clone(),
                truth: Some(curve.clone()),
                measured: Some(curve.clone()),
                ..Estimate::default()
            }),
            innovations(&Innovations {
                time_s: values.clone(),
                lower: values.clone(),
                upper: values.clone(),
                ..Innovations::default()
            }),
            autocorrelation(&Autocorrelation {
                points: pairs.clone(),
                bound: values.first().copied().unwrap_or(0.0),
                ..Autocorrelation::default()
            }),
            nis_histogram(&Histogram {
                edges: values.clone(),
                observed: values.clone(),
                expected: values.clone(),
                ..Histogram::default()
            }),
            cumulative_periodogram(&Periodogram {
                points: pairs.clone(),
                half_width: values.first().copied().unwrap_or(0.1),
                ..Periodogram::default()
            }),
            nees(&Nees {
                time_s: values.clone(),
                nees: values.clone(),
                lower: values.clone(),
                upper: values.clone(),
                expected: values.first().copied().unwrap_or(1.0),
                under_truth: Some(curve.clone()),
                ..Nees::default()
            }),
            errors(&Errors { sigma: pairs.clone(), runs: vec![curve.clone(); 3], ..Errors::default() }),
            rms(&Rms {
                time_s: values.clone(),
                components: vec![Component { name: "s".into(), rms: values.clone(), claimed: values.clone() }],
                ..Rms::default()
            }),
            course(&Course {
                points: pairs.clone(),
                average: curve.clone(),
                findings: values.iter().map(|v| (*v, "something".into())).collect(),
                ..Course::default()
            }),
            allan_overlay("", "", &[]),
        ];
        for (number, svg) in figures.iter().enumerate() {
            let name = format!("figure {number} of {values:?}");
            assert_well_formed(svg, &name);
            assert_inside(svg, &name);
        }
    }
}

#[test]
fn a_million_points_stay_a_small_file() {
    let n = 1_000_000;
    let time_s: Vec<f64> = (0..n).map(|i| f64::from(i) * 0.01).collect();
    let value = Normals(4).take(n as usize);
    let svg = estimate(&Estimate { sigma: vec![1.0; n as usize], estimate: value, time_s, ..Estimate::default() });
    assert!(svg.len() < 200_000, "{} bytes", svg.len());
}

#[test]
fn words_from_a_log_cannot_become_markup() {
    let evil = "<script>alert('1')</script>&\"\u{1}";
    let mut data = allan_data(evil, 1);
    data.unit = evil.into();
    data.components[0].label = evil.into();
    let svg = allan(&data);
    assert!(!svg.contains("<script") && !svg.contains('\u{1}'));
    assert_well_formed(&svg, "evil");
    let drawn = svg.clone();
    let report = Report {
        title: evil.into(),
        subtitle: evil.into(),
        verdict: Some(Conclusion::new(Verdict::Inconclusive, evil)),
        provenance: vec![(evil.into(), evil.into())],
        sections: vec![
            Section::new(evil)
                .paragraph(evil)
                .findings("warning", vec![evil.into()])
                .list(vec![evil.into()])
                .command(evil, evil)
                // a caption that is the heading again is not shown
                .table(format!("{evil}."), &[evil, evil], [[evil, evil]])
                .figure(evil, move || drawn.clone()),
        ],
        ..Report::default()
    };
    let html = html::page(&report).unwrap();
    assert!(!html.contains("<script"));
    // title and h1, subtitle, verdict, term and value, heading, paragraph, finding, item, command and its purpose, the
    // table's label and caption, two headers, two cells with their labels, caption
    let count = |text: &str| text.matches("&lt;script&gt;").count();
    assert_eq!(count(&html) - count(&svg), 21);
}

#[test]
fn page_is_self_contained() {
    let html = html::page(&report()).unwrap();
    save("page.html", &html);
    for alien in ["<script", "<link", "@import", "url(", "src=", "href="] {
        assert!(!html.contains(alien), "{alien}");
    }
    assert_eq!(html.matches("<svg ").count(), 12);
    // one style sheet for all figures
    assert_eq!(html.matches("<style>").count(), 1);
    for (verdict, word) in [
        (Verdict::Consistent, "consistent"),
        (Verdict::Inconsistent, "inconsistent"),
        (Verdict::Inconclusive, "inconclusive"),
    ] {
        let report = Report { verdict: Some(Conclusion::new(verdict, "why")), ..Report::default() };
        assert!(html::page(&report).unwrap().contains(&format!("<b>{word}</b><span>why</span>")), "{word}");
    }
}

#[test]
fn a_page_has_every_level_and_a_sheet_the_figures_above_the_page() {
    let svg = |name: &str| gallery().into_iter().find(|figure| figure.0 == name).unwrap().1;
    let section = Section::of_page("Heading")
        .paragraph("the answer")
        .at(Level::Page)
        .paragraph("the rest")
        .figure("", || svg("budget"))
        .at(Level::Full)
        .figure("", || svg("sigma"));
    let report = Report { sections: vec![section], ..Report::default() };
    let html = html::page(&report).unwrap();
    assert!(html.contains(">Heading</h2>") && html.contains("the answer") && html.contains("the rest"));
    assert_eq!(html.matches("<svg ").count(), 2);
    let sheet = report.sheet("All");
    assert!(sheet.matches("<svg y=").count() == 1 && !sheet.contains("error budget"), "{sheet}");
}
