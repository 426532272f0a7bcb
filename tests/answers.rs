//! The answer first: what a person sees without asking for more.

use kfdesign::params::Params;

use crate::support::{Bench, Outcome, data, measured};

/// Lines and columns of an answer: half a small terminal.
const MOST_LINES: usize = 15;
const WIDEST: usize = 80;

fn typed(bench: &Bench, command: &str) -> Outcome {
    bench.as_typed(&command.split_whitespace().collect::<Vec<_>>())
}

/// Stdout of a command that ends with `status`, short enough.
fn answer(bench: &Bench, command: &str, status: i32) -> String {
    let out = typed(bench, command);
    assert_eq!(out.status, status, "{command}: {}{}", out.stdout, out.stderr);
    let lines = out.stdout.lines().count();
    assert!((1..=MOST_LINES).contains(&lines), "{command}: {lines} lines\n{}", out.stdout);
    for line in out.stdout.lines().chain(out.stderr.lines()) {
        // a name of a file or a command to copy is not broken
        let longest_word = line.split_whitespace().map(|word| word.chars().count()).max().unwrap_or(0);
        assert!(line.chars().count() <= WIDEST.max(longest_word), "{command}: {line}");
    }
    out.stdout
}

/// The first three lines.
fn first(text: &str) -> String {
    text.lines().take(3).collect::<Vec<_>>().join("\n")
}

fn chain(bench: &Bench, log: &str, flags: &str, verdict: i32) {
    let read = answer(bench, &format!("identify {log} {flags} -o params.json"), 0);
    assert!(first(&read).contains("at rest") && first(&read).contains("N, deg/s/√Hz"), "{read}");
    assert!(read.contains("params.json written") && read.contains("next: kfdesign tune params.json"), "{read}");
    let curve = answer(bench, &format!("allan {log} {flags}"), 0);
    assert!(first(&curve).contains("at 1 s"), "{curve}");
    let tuned = answer(bench, "tune params.json -o filter.json", 0);
    assert!(tuned.starts_with("CONSISTENT: ") && tuned.contains("filter.json written"), "{tuned}");
    // params.json remembers how the log was read
    let replayed = answer(bench, &format!("replay filter.json {log}"), verdict);
    let word = if verdict == 0 { "CONSISTENT: " } else { "INCON" };
    assert!(replayed.starts_with(word), "{replayed}");
    let compared = typed(bench, &format!("compare params.json {log}"));
    assert!(compared.status < 2, "{}", compared.stderr);
    answer(bench, &format!("compare params.json {log}"), compared.status);
    let runs = answer(bench, "montecarlo filter.json --runs 20 --duration 60s --allow-inconclusive", 0);
    assert!(first(&runs).to_lowercase().contains("consistent") || first(&runs).contains("INCONCLUSIVE"), "{runs}");
    let plan = answer(bench, "plan params.json --parameter white.density --precision 1%", 0);
    assert!(first(&plan).contains("white.density"), "{plan}");
    for command in [format!("replay filter.json {log} -q --allow-inconclusive"), "tune params.json -q".into()] {
        let said = typed(bench, &command).stdout;
        assert!(said.trim_end().lines().count() == 1, "{command}: {said}");
        assert!(said.contains("CONSISTENT: ") || said.contains("INCONCLUSIVE: "), "{command}: {said}");
    }
}

/// An hour of a simulated sensor at 20 Hz, then a wrong filter on it.
#[test]
fn answers_are_short_and_first() {
    let bench = Bench::new();
    let text = String::from_utf8(std::fs::read(data("params.json")).unwrap()).unwrap();
    bench.file("slow.json", text.replace("\"value\": 100.0, \"unit\": \"Hz\"", "\"value\": 20.0, \"unit\": \"Hz\""));
    answer(&bench, "simulate slow.json -o log.csv --duration 2h --seed 1", 0);
    chain(&bench, "log.csv", "", 0);
    // N stands at one second, between the points of the grid; drift and 2 h of white noise change it by 1 % at most
    let curve = answer(&bench, "allan log.csv --taus octave", 0);
    for row in curve.lines().filter(|line| line.starts_with("gyro_")) {
        let value: f64 = row.split_whitespace().nth(1).unwrap().parse().unwrap();
        assert!((value / 0.0562 - 1.0).abs() < 0.05, "{row}");
    }
    let mut wrong = Params::read(&bench.path("slow.json")).unwrap();
    for (_, value) in wrong
        .axes
        .iter_mut()
        .flat_map(|axis| axis.noise_parameters())
        .filter(|(name, _)| name == "gauss_markov.std_dev")
    {
        value.value *= 4.0;
    }
    bench.file("wrong.json", wrong.to_json());
    answer(&bench, "tune wrong.json -o wrong_filter.json", 0);
    let said = answer(&bench, "replay wrong_filter.json log.csv", 1);
    assert!(said.starts_with("INCONSISTENT (exit 1): "), "{said}");
    let all = said.split_whitespace().collect::<Vec<_>>().join(" ");
    assert!(all.contains("tests fail; above all") && all.contains("pessimistic about slow drift"), "{said}");
    assert!(said.contains("FAIL: "), "{said}");
}

/// A column that runs like a clock is offered in the place of a rate that would be invented.
#[test]
fn a_clock_without_a_name_is_offered() {
    let bench = Bench::new();
    let rows: String = (0..200).map(|i| format!("{},{},0.5\n", 1000 + 10 * i, f64::from(i * 7919 % 101))).collect();
    bench.file("log.csv", format!("first,gyro_x (deg/s),other\n{rows}"));
    let said = typed(&bench, "allan log.csv").stderr;
    assert!(said.contains("column 'first' runs like a clock in ms; for example: kfdesign allan log.csv"), "{said}");
    let command = said.trim_end().split("kfdesign ").last().unwrap();
    assert_eq!(typed(&bench, command).status, 0, "{command}");
    assert!(command.ends_with("--time first:ms"), "{command}");
}

/// What a page begins with is what the terminal shows.
#[test]
fn a_page_begins_with_the_answer() {
    let bench = Bench::new();
    bench.ok(&format!("simulate {} -o log.npy --duration 10min --seed 4", data("params.json").display()));
    let said = typed(&bench, "identify log.npy --report page.html").stdout;
    let page = bench.read("page.html");
    let head = page.split("</header>").next().unwrap();
    assert!(said.contains("Angle random walk") && head.contains("Angle random walk"), "{said}");
    assert!(head.contains(">N, deg") && head.matches("<tr>").count() == 4, "{head}");
}

/// Three sensors of others, each of which needs other words to be read.
#[test]
fn answers_on_measured_logs_are_short_and_first() {
    for (log, flags) in [
        ("sunsided_sensor-fusion/derived/set-2_unmoved-with-x-pointing-forward-10min.csv.gz", "--sensor gyro"),
        (
            "sunsided_sensor-fusion/set-2_unmoved-with-x-pointing-forward/mpu6050_gyroscope.mat",
            "--columns 2,3,4 --unit deg/s --time gyroBuffer_1:s",
        ),
        ("SMAC-Group_imudata/adis16405_recording1.csv.gz", "--rate 100 --sensor gyro --end 10min"),
    ] {
        let Some(path) = measured(&format!("static/{log}")) else { return };
        let (bench, path) = (Bench::new(), path.display());
        let read = typed(&bench, &format!("identify {path} {flags} -o params.json"));
        let read = answer(&bench, &format!("identify {path} {flags} -o params.json"), read.status);
        assert!(first(&read).contains("at rest") || first(&read).contains("CHECK FAILED (exit 1)"), "{read}");
        answer(&bench, "tune params.json -o filter.json", 0);
        // read as the log before was: only the end is not remembered, which is another log's own
        let end = if flags.contains("--end") { "--end 10min" } else { "" };
        for command in [format!("replay filter.json {path} {end}"), format!("compare params.json {path} {end}")] {
            let status = typed(&bench, &command).status;
            assert!(status < 2, "{command}");
            answer(&bench, &command, status);
        }
    }
}

/// Into a pipe there is no colour unless it is asked for, and never with NO_COLOR.
#[test]
fn verdicts_have_colour_where_it_is_wanted() {
    let bench = Bench::new();
    let coloured = |variables: &[(&str, &str)]| {
        let mut command = std::process::Command::new(env!("CARGO_BIN_EXE_kfdesign"));
        command.args(["tune", "-q"]).arg(data("params.json")).envs(variables.iter().copied());
        let out = command.current_dir(bench.path("")).output().unwrap();
        String::from_utf8(out.stdout).unwrap().contains("\u{1b}[")
    };
    assert!(!coloured(&[]));
    assert!(coloured(&[("CLICOLOR_FORCE", "1")]));
    assert!(!coloured(&[("CLICOLOR_FORCE", "1"), ("NO_COLOR", "1")]));
}

#[test]
fn quiet_and_verbose_contradict_each_other() {
    let out = typed(&Bench::new(), "plan a.json -q -v --parameter a --precision 1%");
    assert_eq!((out.status, out.stderr.lines().count()), (2, 1), "{}", out.stderr);
    assert!(out.stderr.contains("--quiet and --verbose contradict each other"), "{}", out.stderr);
}

#[test]
fn nothing_typed_is_answered_with_the_commands() {
    let out = Bench::new().as_typed(&[]);
    assert_eq!(out.status, 2);
    assert!(out.stdout.contains("identify") && out.stdout.contains("montecarlo"), "{}", out.stdout);
}

#[test]
fn slips_of_the_hand_are_understood() {
    for (command, meant) in [
        ("idnetify log.csv", "'identify'"),
        ("identify log.csv --uint deg/s", "'--unit'"),
        ("export params.json --to calibr", "'kalibr'"),
        ("schema parms", "'params'"),
    ] {
        let out = typed(&Bench::new(), command);
        assert!(out.status == 2 && out.stderr.lines().count() == 1, "{command}: {}", out.stderr);
        assert!(out.stderr.contains("similar") && out.stderr.contains(meant), "{command}: {}", out.stderr);
    }
}

#[test]
fn the_short_help_has_what_is_needed_first() {
    for command in ["identify", "tune", "replay", "montecarlo"] {
        let out = typed(&Bench::new(), &format!("{command} -h"));
        let options = out.stdout.lines().filter(|line| line.trim_start().starts_with('-')).count();
        // six, and -v, -q, -h
        assert!((4..=9).contains(&options), "{command}: {options}\n{}", out.stdout);
        let all = typed(&Bench::new(), &format!("{command} --help")).stdout;
        assert!(all.lines().count() > out.stdout.lines().count() && all.contains("kfdesign"), "{command}");
    }
}

/// All that is missing in one line, with a command that works; and the next log of that kind needs none of it.
#[test]
fn what_a_log_does_not_say_is_asked_for_once() {
    let bench = Bench::new();
    bench.ok(&format!("simulate {} -o log.npy --duration 20min --rate 20 --no-truth", data("params.json").display()));
    let rows: Vec<String> = {
        bench.ok(&format!(
            "simulate {} -o log.csv --duration 20min --rate 20 --no-truth",
            data("params.json").display()
        ));
        bench.read("log.csv").lines().skip(1).map(String::from).collect()
    };
    bench.file("bare.csv", rows.join("\n") + "\n");
    let out = typed(&bench, "identify bare.csv -o params.json");
    assert_eq!((out.status, out.stderr.lines().count()), (2, 1), "{}", out.stderr);
    let (_, example) = out.stderr.trim_end().split_once("for example: kfdesign ").unwrap();
    assert_eq!(example, "identify bare.csv -o params.json --columns 2,3,4 --unit deg/s --time 1:s");
    assert_eq!(typed(&bench, example).status, 0);
    assert_eq!(Params::read(&bench.path("params.json")).unwrap().source.unwrap().reading.unwrap().columns.len(), 3);
    for command in ["tune params.json -o filter.json", "replay filter.json bare.csv", "compare params.json bare.csv"] {
        let out = bench.run(command);
        assert!(out.status < 2, "{command}: {}", out.stderr);
        let noted = out.stderr.contains("read with --columns 2,3,4 --unit deg/s --time 1:s, as the log behind");
        assert_eq!(noted, !command.starts_with("tune"), "{command}: {}", out.stderr);
    }
}

#[test]
fn swapped_files_are_seen() {
    let bench = Bench::new();
    bench.file("params.json", std::fs::read(data("params.json")).unwrap());
    bench.ok("simulate params.json -o s.csv --duration 1min");
    bench.ok("tune params.json -o filter.json");
    for (command, order) in [
        ("replay s.csv filter.json", "FILTER LOG"),
        ("compare s.csv params.json", "PARAMS LOG"),
        ("inflate s.csv params.json", "PARAMS LOG"),
    ] {
        let out = typed(&bench, command);
        assert_eq!((out.status, out.stderr.lines().count()), (2, 1), "{command}: {}", out.stderr);
        assert!(out.stderr.contains(&format!("swapped? The order is {order}")), "{command}: {}", out.stderr);
    }
    let out = typed(&bench, "tune s.csv");
    assert!(out.stderr.contains("s.csv: expected params.json, found no JSON document"), "{}", out.stderr);
}
