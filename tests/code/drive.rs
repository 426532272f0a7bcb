//! Generated code as a program of its own, and replay beside it.

use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};

use kfdesign::filter::{FilterDesign, Form};
use kfdesign::input::{Block, LogOptions, LogReader};
use kfdesign::replay::{Estimates, LogShape, Options, Replayer};

use crate::support::Bench;

/// One axis of a log with what replay made of it.
pub(super) struct Rows {
    inputs: usize,
    measurements: usize,
    states: usize,
    /// Inputs and measurements of every sample; NaN: not there.
    rows: Vec<Vec<f64>>,
    /// Of every sample: per measurement ν and S, then x, then σ².
    expected: Vec<Option<Vec<f64>>>,
}

/// Samples that are taken out of the log, and some that become NaN.
const MISSING: [(usize, u64); 2] = [(100, 7), (5000, 40)];
const UNUSABLE: [usize; 3] = [57, 58, 3000];

/// The log through the filter, row by row.
pub(super) fn replayed(design: &FilterDesign, path: &Path, options: &LogOptions, form: Form) -> Vec<Rows> {
    let mut reader = LogReader::open(path, options).unwrap();
    let shape = LogShape {
        axes: reader.axes().iter().map(|a| a.name.clone()).collect(),
        quantity: reader.quantity(),
        sample_rate_hz: reader.check().sample_rate_hz,
        aids: options.extra.len(),
    };
    let mut replayer = Replayer::new(design, &shape, Options { form, ..Options::default() }).unwrap();
    let mut all: Vec<Rows> = design
        .axes
        .iter()
        .map(|axis| Rows {
            inputs: axis.model.inputs.len(),
            measurements: axis.model.measurements.len(),
            states: axis.model.states.len(),
            rows: Vec::new(),
            expected: Vec::new(),
        })
        .collect();
    let (mut block, mut estimates, mut at) = (Block::default(), Estimates::default(), 0);
    while reader.next_block(&mut block).unwrap() {
        let count = block.time_s.len();
        for (row, missing) in MISSING {
            if (at..at + count).contains(&row) {
                block.missing[row - at] = missing;
            }
        }
        for row in UNUSABLE {
            if (at..at + count).contains(&row) {
                block.values.iter_mut().for_each(|values| values[row - at] = f64::NAN);
            }
        }
        replayer.push(&block, Some(&mut estimates));
        for (axis, (rows, found)) in all.iter_mut().zip(&estimates.axes).enumerate() {
            for i in 0..count {
                for _ in 0..block.missing[i] {
                    rows.rows.push(vec![f64::NAN; rows.inputs + rows.measurements]);
                    rows.expected.push(None);
                }
                let mut row = vec![block.values[axis][i]];
                row.extend(block.extra.iter().map(|aid| aid[i]));
                let mut expected = Vec::new();
                for update in &found.updates {
                    expected.extend([update.innovation[i], update.innovation_sigma[i].powi(2)]);
                }
                expected.extend(found.states.iter().map(|state| state[i]));
                expected.extend(found.sigmas.iter().map(|sigma| sigma[i].powi(2)));
                rows.rows.push(row);
                rows.expected.push(Some(expected));
            }
        }
        at += count;
    }
    all
}

/// Largest differences that are allowed.
pub(super) struct Limits {
    /// Of an innovation, relative to the measurement and its sigma.
    innovation: f64,
    /// Of S.
    variance: f64,
    /// Of a state, relative to the state and its sigma.
    state: f64,
    /// Of its variance.
    spread: f64,
}

impl Limits {
    pub(super) const SINGLE: Limits = Limits { innovation: 1e-6, variance: 1e-6, state: 1e-5, spread: 1e-5 };
    pub(super) const DOUBLE: Limits = Limits { innovation: 1e-12, variance: 1e-12, state: 1e-12, spread: 1e-12 };
}

pub(super) fn compare(language: &str, case: &Case, found: &[f64], limits: &Limits) {
    let rows = &case.rows;
    let what = format!("{}, {language}", case.what);
    let width = 2 * rows.measurements + 2 * rows.states;
    assert_eq!(found.len(), width * rows.rows.len(), "{what}");
    let mut worst = [0.0_f64; 4];
    let mut taken = 0;
    for ((row, expected), found) in rows.rows.iter().zip(&rows.expected).zip(found.chunks(width)) {
        let Some(expected) = expected else { continue };
        for m in 0..rows.measurements {
            let (v, s) = (expected[2 * m], expected[2 * m + 1]);
            assert_eq!(v.is_nan(), found[2 * m].is_nan(), "{what}");
            if v.is_nan() {
                continue;
            }
            taken += 1;
            let z = row[rows.inputs + m];
            worst[0] = worst[0].max((found[2 * m] - v).abs() / (z.abs() + s.sqrt()));
            worst[1] = worst[1].max((found[2 * m + 1] / s - 1.0).abs());
        }
        let (x, p) = (2 * rows.measurements, 2 * rows.measurements + rows.states);
        for i in 0..rows.states {
            let sigma = expected[p + i].sqrt();
            worst[2] = worst[2].max((found[x + i] - expected[x + i]).abs() / (expected[x + i].abs() + sigma));
            // the constant form carries none
            if found[p + i].is_finite() && sigma > 0.0 {
                worst[3] = worst[3].max((found[p + i] / expected[p + i] - 1.0).abs());
            }
        }
    }
    println!(
        "{what}: {taken} updates, innovation, S, state and its variance differ by {}",
        worst.map(|w| format!("{w:.1e}")).join(", ")
    );
    assert!(taken > 10_000, "{what}: {taken} updates");
    let allowed = [limits.innovation, limits.variance, limits.state, limits.spread];
    assert!(worst.iter().zip(allowed).all(|(worst, allowed)| *worst <= allowed), "{what}: {worst:?}");
}

/// The compilers, in the folder of a bench.
pub(super) struct Toolchain {
    folder: PathBuf,
}

const WARNINGS: [&str; 7] = ["-std=c99", "-Wall", "-Wextra", "-Wconversion", "-pedantic", "-Wshadow", "-Werror"];

impl Toolchain {
    pub(super) fn new(bench: &Bench) -> Toolchain {
        Toolchain { folder: bench.path("") }
    }

    fn command(&self, program: &str, args: &[String]) -> std::io::Result<Output> {
        Command::new(program).args(args).current_dir(&self.folder).output()
    }

    /// Compiles to the program `c`; false, with a printed line, where there is no gcc.
    pub(super) fn c(&self, sources: &[String], main: &str, flags: &[&str]) -> bool {
        std::fs::write(self.folder.join("main.c"), main).unwrap();
        let mut args: Vec<String> = WARNINGS.iter().chain(flags).map(|flag| (*flag).to_owned()).collect();
        args.extend(sources.iter().cloned());
        args.extend(["main.c", "-o", "c"].map(String::from));
        match self.command("gcc", &args) {
            Ok(told) => {
                assert!(told.status.success(), "gcc {args:?}: {}", String::from_utf8_lossy(&told.stderr));
                true
            }
            Err(error) => {
                println!("skipped: no gcc here ({error}); the generated C is not compiled");
                false
            }
        }
    }

    /// A line of shell in the folder; `None`, with a printed line, where there is no `compiler`.
    pub(super) fn shell(&self, compiler: &str, line: &str) -> Option<Output> {
        if let Err(error) = self.command(compiler, &["--version".to_owned()]) {
            println!("skipped: no {compiler} here ({error}): {line}");
            return None;
        }
        Some(self.command("sh", &["-c".to_owned(), line.to_owned()]).unwrap())
    }

    /// Compiles the modules as a `no_std` library that denies warnings, and a program `rust` with it; rustc is where
    /// cargo is.
    pub(super) fn rust(&self, modules: &str, main: &str) {
        let library = format!("#![no_std]\n#![deny(warnings)]\n#![forbid(unsafe_code)]\n{modules}");
        std::fs::write(self.folder.join("generated.rs"), library).unwrap();
        std::fs::write(self.folder.join("main.rs"), main).unwrap();
        let rustc = std::env::var("RUSTC").unwrap_or_else(|_| "rustc".into());
        for words in [
            "--edition 2021 --crate-type rlib -C opt-level=1 generated.rs -o libgenerated.rlib",
            "--edition 2021 main.rs --extern generated=libgenerated.rlib -o rust",
        ] {
            let args: Vec<String> = words.split(' ').map(String::from).collect();
            let told = self.command(&rustc, &args).unwrap_or_else(|error| panic!("{rustc}: {error}"));
            assert!(told.status.success(), "rustc {words}: {}", String::from_utf8_lossy(&told.stderr));
        }
    }

    /// Runs a program with this word, on these numbers.
    pub(super) fn run(&self, program: &str, word: &str, numbers: &[f64]) -> Output {
        let mut child = Command::new(self.folder.join(program))
            .arg(word)
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            .spawn()
            .unwrap();
        let mut input = child.stdin.take().unwrap();
        let bytes: Vec<u8> = numbers.iter().flat_map(|n| n.to_le_bytes()).collect();
        let writer = std::thread::spawn(move || input.write_all(&bytes));
        let output = child.wait_with_output().unwrap();
        writer.join().unwrap().unwrap();
        output
    }

    fn numbers(&self, program: &str, case: &Case) -> Vec<f64> {
        let told = self.run(program, &case.prefix, &case.rows.rows.concat());
        assert!(told.status.success(), "{}", String::from_utf8_lossy(&told.stderr));
        told.stdout.as_chunks::<8>().0.iter().map(|bytes| f64::from_le_bytes(*bytes)).collect()
    }

    /// What each case gives, per row: ν and S of each measurement (NaN: not taken), x, and P_ii (NaN in the constant
    /// form). `None`: no gcc.
    pub(super) fn drive_c(&self, cases: &[Case]) -> Option<Vec<Vec<f64>>> {
        let mut names: Vec<&str> = cases.iter().map(|case| case.name.as_str()).collect();
        names.dedup();
        let includes: String = names.iter().map(|name| format!("#include \"{name}.h\"\n")).collect();
        let mut prefixes: Vec<&str> = Vec::new();
        let mut functions = String::new();
        let mut calls = String::new();
        for case in cases {
            if prefixes.contains(&case.prefix.as_str()) {
                continue;
            }
            prefixes.push(&case.prefix);
            functions.push_str(&case.c());
            calls.push_str(&format!("    if (strcmp(words[1], \"{0}\") == 0) {{ run_{0}(); }}\n", case.prefix));
        }
        let main = format!(
            "#include <math.h>\n#include <stdio.h>\n#include <string.h>\n{includes}{functions}\
             int main(int count, char **words)\n{{\n    (void)count;\n{calls}    return 0;\n}}\n"
        );
        let sources: Vec<String> = names.iter().map(|name| format!("{name}.c")).collect();
        self.c(&sources, &main, &["-O2"]).then(|| cases.iter().map(|case| self.numbers("c", case)).collect())
    }

    /// The same.
    pub(super) fn drive_rust(&self, cases: &[Case]) -> Vec<Vec<f64>> {
        let mut names: Vec<&str> = cases.iter().map(|case| case.name.as_str()).collect();
        names.dedup();
        let modules: String = names.iter().map(|name| format!("pub mod {name};\n")).collect();
        let arms: String =
            cases.iter().map(|case| format!("        \"{}\" => {}\n", case.prefix, case.rust())).collect();
        let main = format!(
            "#![allow(unreachable_patterns)]\nuse std::io::{{Read, Write}};\nfn main() {{\n    let mut bytes = Vec::new();\n    \
             std::io::stdin().read_to_end(&mut bytes).unwrap();\n    let numbers: Vec<f64> =\n        \
             bytes.chunks(8).map(|b| f64::from_le_bytes(b.try_into().unwrap())).collect();\n    \
             let mut out: Vec<f64> = Vec::new();\n    match std::env::args().nth(1).unwrap().as_str() {{\n{arms}        \
             _ => panic!(),\n    }}\n    let bytes: Vec<u8> = out.iter().flat_map(|n| n.to_le_bytes()).collect();\n    \
             std::io::stdout().write_all(&bytes).unwrap();\n}}\n"
        );
        self.rust(&modules, &main);
        cases.iter().map(|case| self.numbers("rust", case)).collect()
    }
}

/// One axis through one piece of generated code.
pub(super) struct Case {
    pub(super) what: String,
    /// Of the files, and of the functions.
    pub(super) name: String,
    pub(super) prefix: String,
    pub(super) float: bool,
    pub(super) full: bool,
    pub(super) rows: Rows,
}

impl Case {
    fn c(&self) -> String {
        let Case { name, prefix, rows, .. } = self;
        let Rows { inputs, measurements, states, .. } = rows;
        let columns = inputs + measurements;
        let variance = if self.full { "(double)filter.p[i][i]" } else { "(double)NAN" };
        let input = if *inputs > 0 { ", input" } else { "" };
        format!(
            r#"static void run_{prefix}(void)
{{
    double row[{columns}];
    {name}_real_t input[1] = {{ 0 }};
    {prefix}_t filter;
    bool started = false;
    {prefix}_init(&filter);
    (void)input;
    while (fread(row, sizeof row, 1, stdin) == 1)
    {{
        if (started) {{ {prefix}_predict(&filter{input}); }}
        started = true;
        for (uint32_t m = 0; m < {measurements}; m++)
        {{
            double out[2] = {{ NAN, NAN }};
            if (row[{inputs} + m] == row[{inputs} + m])
            {{
                const {name}_update_t update = {prefix}_update(&filter, m, ({name}_real_t)row[{inputs} + m], 0);
                out[0] = (double)update.innovation;
                out[1] = (double)update.variance;
            }}
            fwrite(out, sizeof out, 1, stdout);
        }}
        for (uint32_t i = 0; i < {states}; i++) {{ const double x = (double)filter.x[i]; fwrite(&x, sizeof x, 1, stdout); }}
        for (uint32_t i = 0; i < {states}; i++) {{ const double p = {variance}; fwrite(&p, sizeof p, 1, stdout); }}
        if ({inputs} > 0) {{ input[0] = ({name}_real_t)row[0]; }}
    }}
}}
"#
        )
    }

    fn rust(&self) -> String {
        let Case { name, prefix, rows, .. } = self;
        let Rows { inputs, measurements, .. } = rows;
        let columns = inputs + measurements;
        let path = if prefix == name { format!("generated::{name}") } else { format!("generated::{name}::{prefix}") };
        let real = if self.float { "f32" } else { "f64" };
        let variance = if self.full { "f64::from(filter.p[i][i])" } else { "f64::NAN" };
        let input = if *inputs > 0 { "&input" } else { "" };
        format!(
            r#"{{
            let mut filter = {path}::Filter::new();
            #[allow(unused_mut, unused_variables)]
            let mut input = [0.0 as {real}; 1];
            for (step, row) in numbers.chunks({columns}).enumerate() {{
                if step > 0 {{ filter.predict({input}); }}
                for (m, z) in row[{inputs}..].iter().enumerate() {{
                    if z.is_nan() {{ out.extend([f64::NAN; 2]); continue; }}
                    let update = filter.update(m, *z as {real}, None);
                    out.extend([f64::from(update.innovation), f64::from(update.variance)]);
                }}
                out.extend(filter.x.iter().map(|x| f64::from(*x)));
                #[allow(unused_variables)]
                out.extend((0..{path}::STATES).map(|i| {variance}));
                input[0] = row[0] as {real};
            }}
        }}"#
        )
    }
}
