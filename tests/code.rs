//! Filters as C and Rust: they compile without a warning, their self-tests pass, and they are our replay on measured
//! logs.

mod drive;

use kfdesign::filter::{FilterDesign, Form};
use kfdesign::input::{ExtraColumn, LogOptions};
use kfdesign::params::Params;
use kfdesign::tune::{TuneOptions, tune};
use kfdesign::units::{Quantity, Unit};
use serde_json::{Value, json};

use crate::support::{Bench, data, measured};
use drive::{Case, Limits, Toolchain, compare, replayed};

/// A gyro like that of the measured log: a turn-on bias fifty times the noise of one sample. The axes y and z have
/// the same numbers, x has a line.
const GYRO: &str = r#"{"format": "kfdesign-params/1", "quantity": "angular-rate", "sample_rate": "99.4 Hz", "axes": [
    {"name": "x", "turn_on_bias": {"std_dev": "5 deg/s"}, "white": {"density": "0.012 deg/s/sqrt(Hz)"},
     "gauss_markov": {"std_dev": "0.005 deg/s", "correlation_time": "100 s"},
     "oscillation": {"std_dev": "0.05 deg/s", "frequency": "20 Hz", "correlation_time": "1 s"}},
    {"name": "y", "turn_on_bias": {"std_dev": "5 deg/s"}, "white": {"density": "0.012 deg/s/sqrt(Hz)"}, "gauss_markov": {"std_dev": "0.005 deg/s", "correlation_time": "100 s"}},
    {"name": "z", "turn_on_bias": {"std_dev": "5 deg/s"}, "white": {"density": "0.012 deg/s/sqrt(Hz)"}, "gauss_markov": {"std_dev": "0.005 deg/s", "correlation_time": "100 s"}}]}"#;
const LOG: &str = "static/sunsided_sensor-fusion/derived/set-2_unmoved-with-x-pointing-forward.csv.gz";

/// The sensor with a `design` section.
fn design(section: Value) -> FilterDesign {
    let mut params: Value = serde_json::from_str(GYRO).unwrap();
    if !section.is_null() {
        params["design"] = section;
    }
    let params = Params::from_json(&params.to_string(), "params.json").unwrap();
    tune(&params, &TuneOptions::default()).unwrap().design
}

fn section(name: &str) -> Value {
    serde_json::from_str(&std::fs::read_to_string(data(&format!("design/{name}.json"))).unwrap()).unwrap()
}

/// One of every plant: sensors at rest, integrated, aided at a lower rate, of several measurements.
fn plants() -> Vec<(&'static str, FilterDesign)> {
    let angle = json!({"plant": "angle", "aids": [{"name": "heading", "std_dev": "2 deg", "rate": "9.94 Hz",
        "gauss_markov": {"std_dev": "3 deg", "correlation_time": "60 s"}}]});
    let rate = json!({"plant": "rate", "motion": {"gauss_markov": {"std_dev": "20 deg/s", "correlation_time": "0.5 s"}},
        "aids": [{"name": "wheels", "std_dev": "1 deg/s"}]});
    let mut odd = design(Value::Null);
    // names that would end a comment, be no name, or be one twice
    for (axis, name) in odd.axes.iter_mut().zip(["x*/ \\", "é\u{202e}/*", "Update"]) {
        axis.name = name.into();
    }
    odd.axes[0].model.states[0].name = "gauss.markov".into();
    vec![
        ("still", design(Value::Null)),
        ("angle", design(angle)),
        ("rate", design(rate)),
        ("vertical", design(section("vertical"))),
        ("pendulum", design(section("pendulum"))),
        ("odd", odd),
    ]
}

const CHOICES: [(&str, &str, Form); 4] = [
    ("float", "full", Form::Joseph),
    ("double", "full", Form::Joseph),
    ("float", "constant-gain", Form::ConstantGain),
    ("double", "constant-gain", Form::ConstantGain),
];

fn export(bench: &Bench, language: &str, name: &str, filter: &str, precision: &str, form: &str) {
    let extension = if language == "c" { "c" } else { "rs" };
    bench.ok(&format!("export {filter} --to {language} --precision {precision} --form {form} -o {name}.{extension}"));
}

/// The line that the command prints builds and runs the self-test, and a program in C++ links with the files as C
/// and finds the self-test in the header: without `extern "C"` its names are others. Each language is skipped, with
/// a line, where its compiler is not.
#[test]
fn the_printed_line_runs_the_self_test_and_cpp_links() {
    let bench = Bench::new();
    bench.file("still.json", design(Value::Null).to_json());
    let told = bench.ok("export still.json --to c -o still.c");
    let line = told.lines().find_map(|line| line.split_once("self-test, in that folder: ")).unwrap().1.to_owned();
    let test = bench.read("still_test.c");
    assert!(test.contains(&line), "{line}: {test}");
    let tools = Toolchain::new(&bench);
    if let Some(told) = tools.shell("cc", &line) {
        assert!(told.status.success(), "{line}: {}", String::from_utf8_lossy(&told.stderr));
    }
    bench.file(
        "main.cpp",
        "#include \"still.h\"\nint main()\n{\n    still_x_t filter;\n    still_x_init(&filter);\n    still_x_predict(&filter);\n    \
         return still_x_update(&filter, 0U, 0.0F, 0.0F).accepted ? still_self_test() : 100;\n}\n",
    );
    let build = "cc -std=c99 -c still.c still_test.c && g++ -Wall -Wextra -pedantic -Werror main.cpp still.o still_test.o -o both && ./both";
    if let Some(told) = tools.shell("g++", build) {
        assert!(told.status.success(), "{}", String::from_utf8_lossy(&told.stderr));
    }
}

/// Both precisions and forms of every plant, in both languages, with all warnings as errors; every self-test passes.
#[test]
fn every_plant_compiles_without_a_warning_and_passes_its_self_test() {
    let bench = Bench::new();
    let mut names = Vec::new();
    for (plant, design) in plants() {
        bench.file(&format!("{plant}.json"), design.to_json());
        for (precision, form, _) in CHOICES {
            let name = format!("{plant}_{}_{}", &precision[..1], &form[..1]);
            export(&bench, "c", &name, &format!("{plant}.json"), precision, form);
            export(&bench, "rust", &name, &format!("{plant}.json"), precision, form);
            names.push(name);
        }
    }
    let tools = Toolchain::new(&bench);
    let modules: String = names.iter().map(|name| format!("pub mod {name};\n")).collect();
    let checks: String =
        names.iter().map(|name| format!("    assert!(generated::{name}::self_test(), \"{name}\");\n")).collect();
    tools.rust(&modules, &format!("fn main() {{\n{checks}}}\n"));
    let told = tools.run("rust", "", &[]);
    assert!(told.status.success(), "{}", String::from_utf8_lossy(&told.stderr));
    let declared: String = names.iter().map(|name| format!("#include \"{name}.h\"\n")).collect();
    let checks: String = names
        .iter()
        .map(|name| format!("    if ({name}_self_test() != 0) {{ puts(\"{name}\"); bad = 1; }}\n"))
        .collect();
    let main =
        format!("#include <stdio.h>\n{declared}int main(void)\n{{\n    int bad = 0;\n{checks}    return bad;\n}}\n");
    let sources: Vec<String> = names.iter().flat_map(|name| [format!("{name}.c"), format!("{name}_test.c")]).collect();
    // also with fused multiplications, where the processor has them
    for flags in [&["-O2"][..], &["-O2", "-march=native", "-ffp-contract=fast"]] {
        if !tools.c(&sources, &main, flags) {
            return;
        }
        let told = tools.run("c", "", &[]);
        assert!(told.status.success(), "{flags:?}: {}", String::from_utf8_lossy(&told.stdout));
    }
}

/// The self-test sees a wrong number: one entry of F, H or Q changed by 1 %.
#[test]
fn the_self_test_fails_when_a_number_is_wrong() {
    let bench = Bench::new();
    bench.file("still.json", design(Value::Null).to_json());
    export(&bench, "rust", "still", "still.json", "double", "full");
    let text = bench.read("still.rs");
    let tools = Toolchain::new(&bench);
    let mut modules = Vec::new();
    for (table, name) in [("static F: ", "f"), ("static H: ", "h"), ("static Q: ", "q"), ("static P0: ", "p")] {
        let at = text.find(table).unwrap();
        let line = at + text[at..].find("    entry(").unwrap();
        let number = line + text[line..].rfind_in_line(", ") + 2;
        let end = number + text[number..].find(')').unwrap();
        let value: f64 = text[number..end].parse().unwrap();
        bench.file(&format!("{name}.rs"), format!("{}{:?}{}", &text[..number], 1.01 * value, &text[end..]));
        modules.push(name);
    }
    let checks: String =
        modules.iter().map(|name| format!("    assert!(!generated::{name}::self_test(), \"{name}\");\n")).collect();
    let modules: String = modules.iter().map(|name| format!("pub mod {name};\n")).collect();
    tools.rust(&modules, &format!("fn main() {{\n{checks}}}\n"));
    let told = tools.run("rust", "", &[]);
    assert!(told.status.success(), "{}", String::from_utf8_lossy(&told.stderr));
}

trait InLine {
    fn rfind_in_line(&self, what: &str) -> usize;
}

impl InLine for str {
    /// The last place of `what` in the first line.
    fn rfind_in_line(&self, what: &str) -> usize {
        self.lines().next().unwrap().rfind(what).unwrap()
    }
}

/// Generated code against replay: a measured log with rows that are missing and values that are no numbers, through
/// a sensor at rest and through a plant with an input and an aid.
#[test]
fn generated_code_is_replay_on_measured_logs() {
    let Some(path) = measured(LOG) else { return };
    let bench = Bench::new();
    let accelerometer = ExtraColumn {
        column: "acc_y_g".into(),
        unit: Unit::parse("g").ok(),
        dimension: Quantity::SpecificForce.dimension(),
        flag: "--aid".into(),
    };
    let own = LogOptions { rate_hz: Some(99.4), ..LogOptions::default() };
    let still = design(Value::Null);
    let mut vertical = design(section("vertical"));
    vertical.axes.truncate(1);
    // an integrated rate tells no bias to constant gains: it is that of the log's mean
    let model = &mut vertical.axes[0].model;
    let bias = model.states.iter().position(|state| state.name == "bias").unwrap();
    model.x0[bias] = 4.5316_f64.to_radians();
    let aided = LogOptions { extra: vec![accelerometer], columns: Some(vec!["gyr_x_dps".into()]), ..own.clone() };
    let tools = Toolchain::new(&bench);
    let mut cases = Vec::new();
    for (plant, design, options) in [("still", &still, &own), ("vertical", &vertical, &aided)] {
        bench.file(&format!("{plant}.json"), design.to_json());
        for (precision, form, running) in CHOICES {
            let name = format!("{plant}_{}_{}", &precision[..1], &form[..1]);
            export(&bench, "c", &name, &format!("{plant}.json"), precision, form);
            export(&bench, "rust", &name, &format!("{plant}.json"), precision, form);
            for (axis, rows) in replayed(design, &path, options, running).into_iter().enumerate() {
                // x is a kind of its own, y and z are one
                let kind = if plant == "vertical" { "" } else { ["_x", "_y", "_y"][axis] };
                let (prefix, what) = (format!("{name}{kind}"), format!("{plant} {precision} {form}, axis {axis}"));
                let (float, full) = (precision == "float", form == "full");
                cases.push(Case { what, name: name.clone(), prefix, float, full, rows });
            }
        }
    }
    let check = |language: &str, found: Vec<Vec<f64>>| {
        for (case, found) in cases.iter().zip(found) {
            let limits = if case.float { &Limits::SINGLE } else { &Limits::DOUBLE };
            compare(language, case, &found, limits);
        }
    };
    check("Rust", tools.drive_rust(&cases));
    if let Some(found) = tools.drive_c(&cases) {
        check("C", found);
    }
}

/// `start` is the update of x0, P0 by the mean of n samples: P0 hᵀ (mean − h x0)/(h P0 hᵀ + R/n), in both languages
/// to rounding.
#[test]
fn constant_gains_start_from_a_mean() {
    let bench = Bench::new();
    let design = design(Value::Null);
    bench.file("still.json", design.to_json());
    export(&bench, "c", "begun", "still.json --axis z", "double", "constant-gain");
    export(&bench, "rust", "begun", "still.json --axis z", "double", "constant-gain");
    let (mean, n) = (0.0785, 500.0);
    let model = &design.axes[2].model;
    let h = model.h.row(0);
    let share = (mean - (h * &model.x0)[0]) / ((h * &model.p0 * h.transpose())[0] + model.r[(0, 0)] / n);
    let expected = &model.x0 + &model.p0 * h.transpose() * share;
    // nearly all of the mean goes to the bias, whose P0 is a million times that of the drift
    assert!((expected[0] / mean - 1.0).abs() < 1e-4);
    let check = |language: &str, told: &std::process::Output| {
        let text = String::from_utf8_lossy(&told.stdout);
        let found: Vec<f64> = text.lines().map(|line| line.parse().unwrap()).collect();
        assert_eq!(found.len(), expected.len(), "{language}: {text}");
        // a few roundings of the largest term
        let close = |(a, b): (&f64, &f64)| (a - b).abs() <= 1e-15 * mean;
        assert!(found.iter().zip(expected.iter()).all(close), "{language}: {found:?} {expected}");
    };
    let tools = Toolchain::new(&bench);
    tools.rust(
        "pub mod begun;\n",
        &format!(
            "fn main() {{\n    let mut filter = generated::begun::Filter::new();\n    filter.start(0, f64::NAN, {n:?});\n    \
             filter.start(0, {mean:?}, {n:?});\n    filter.x.iter().for_each(|x| println!(\"{{x:e}}\"));\n}}\n"
        ),
    );
    check("Rust", &tools.run("rust", "", &[]));
    let main = format!(
        "#include <stdio.h>\n#include \"begun.h\"\nint main(void)\n{{\n    begun_t filter;\n    begun_init(&filter);\n    \
         begun_start(&filter, BEGUN_MEASURE_ANGULAR_RATE, {mean:?}, {n:?});\n    \
         for (uint32_t i = 0U; i < BEGUN_STATES; i++) {{ printf(\"%.17g\\n\", filter.x[i]); }}\n    return 0;\n}}\n"
    );
    if tools.c(&["begun.c".to_owned()], &main, &["-O2"]) {
        check("C", &tools.run("c", "", &[]));
    }
}
