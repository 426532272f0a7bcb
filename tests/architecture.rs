//! The house keeps its floors: rooms use only lower ones, files stay readable, only the command line prints and exits.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

/// The one table of rooms: floor, room, and the rooms of its own floor it may use besides every lower floor.
/// `docs/architecture.md` shows the same table.
const HOUSE: [(u8, &str, &[&str]); 28] = [
    (0, "units", &[]),
    (0, "numerics", &[]),
    (1, "signal", &[]),
    (1, "noise", &[]),
    (1, "params", &["noise"]),
    (1, "aircraft/atmosphere", &[]),
    (2, "input", &[]),
    (2, "allan", &[]),
    (2, "import", &[]),
    (2, "model", &[]),
    (2, "aircraft/airframe", &[]),
    (3, "filter", &[]),
    (3, "simulate", &[]),
    (3, "consistency", &["filter"]),
    (3, "aircraft/control", &[]),
    (4, "identify", &[]),
    (4, "tune", &[]),
    (4, "replay", &["identify"]),
    (4, "aircraft/flight", &[]),
    (5, "compare", &[]),
    (5, "montecarlo", &[]),
    (5, "aircraft/closed_loop", &[]),
    (6, "export", &[]),
    (6, "report", &[]),
    (7, "view", &[]),
    (8, "ops", &[]),
    // two doors: a command starts the server, which does what commands do
    (9, "serve", &["cli"]),
    (9, "cli", &["serve"]),
];

/// The wings: folders of rooms that stand on floors of their own.
const WINGS: [&str; 1] = ["aircraft"];

const LONGEST_FILE: usize = 600;

/// Packages of which two versions would mean two incompatible matrix, random-number or distribution types.
const ONLY_ONCE: [&str; 7] = ["faer", "nalgebra", "rand", "rand_core", "rand_distr", "realfft", "statrs"];

fn root() -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR"))
}

/// Every Rust file under src with its path relative to src, sorted. `src/python` is another crate, with rules of its
/// own.
fn sources() -> Vec<(String, String)> {
    fn walk(dir: &Path, out: &mut Vec<PathBuf>) {
        for entry in std::fs::read_dir(dir).unwrap() {
            let path = entry.unwrap().path();
            if path.join("Cargo.toml").exists() {
                continue;
            }
            if path.is_dir() {
                walk(&path, out);
            } else if path.extension().is_some_and(|e| e == "rs") {
                out.push(path);
            }
        }
    }
    let src = root().join("src");
    let mut files = vec![];
    walk(&src, &mut files);
    files.sort();
    let name = |path: &Path| path.strip_prefix(&src).unwrap().to_string_lossy().replace('\\', "/");
    files.iter().map(|path| (name(path), std::fs::read_to_string(path).unwrap())).collect()
}

/// Identifiers and punctuation without comments, strings and character literals; `::` is one token.
fn tokens(source: &str) -> Vec<String> {
    let chars: Vec<char> = source.chars().collect();
    let at = |i: usize| chars.get(i).copied().unwrap_or('\0');
    let word = |c: char| c.is_alphanumeric() || c == '_';
    let mut out = vec![];
    let mut i = 0;
    while i < chars.len() {
        match at(i) {
            '/' if at(i + 1) == '/' => {
                while i < chars.len() && at(i) != '\n' {
                    i += 1;
                }
            }
            '/' if at(i + 1) == '*' => {
                let mut depth = 0;
                loop {
                    match (at(i), at(i + 1)) {
                        ('/', '*') => (depth, i) = (depth + 1, i + 2),
                        ('*', '/') => (depth, i) = (depth - 1, i + 2),
                        _ => i += 1,
                    }
                    if depth == 0 || i >= chars.len() {
                        break;
                    }
                }
            }
            '"' => {
                i += 1;
                while i < chars.len() && at(i) != '"' {
                    i += if at(i) == '\\' { 2 } else { 1 };
                }
                i += 1;
            }
            // 'x' and '\n' are characters, 'a in a type is a lifetime
            '\'' if at(i + 1) == '\\' => {
                i += 3;
                while i < chars.len() && at(i) != '\'' {
                    i += 1;
                }
                i += 1;
            }
            '\'' if at(i + 2) == '\'' => i += 3,
            c if word(c) => {
                let start = i;
                while word(at(i)) {
                    i += 1;
                }
                let text: String = chars[start..i].iter().collect();
                let raw = matches!(text.as_str(), "r" | "br" | "cr") && matches!(at(i), '"' | '#');
                let hashes = (i..).take_while(|&k| at(k) == '#').count();
                if raw && at(i + hashes) == '"' {
                    i += hashes + 1;
                    while i < chars.len() && !(at(i) == '"' && (1..=hashes).all(|k| at(i + k) == '#')) {
                        i += 1;
                    }
                    i += 1 + hashes;
                } else {
                    out.push(text);
                }
            }
            ':' if at(i + 1) == ':' => {
                out.push("::".into());
                i += 2;
            }
            c => {
                if !c.is_whitespace() {
                    out.push(c.into());
                }
                i += 1;
            }
        }
    }
    out
}

/// All paths written from `tokens[at]` on, which is behind a `::`: one, or several for a `{…}` group.
fn path_tails(tokens: &[String], at: usize) -> Vec<Vec<String>> {
    let token = |i: usize| tokens.get(i).map_or("", String::as_str);
    if token(at) == "{" {
        let mut out = vec![];
        let (mut depth, mut i, mut fresh) = (1, at + 1, true);
        while depth > 0 && i < tokens.len() {
            match token(i) {
                "{" => depth += 1,
                "}" => depth -= 1,
                "," if depth == 1 => fresh = true,
                _ if depth == 1 && fresh => {
                    out.extend(path_tails(tokens, i));
                    fresh = false;
                }
                _ => {}
            }
            i += 1;
        }
        return out;
    }
    let mut path = vec![token(at).to_owned()];
    let mut i = at + 1;
    while token(i) == "::" {
        if token(i + 1) == "{" {
            let heads = path_tails(tokens, i + 1);
            return heads.into_iter().map(|tail| [path.clone(), tail].concat()).collect();
        }
        path.push(token(i + 1).to_owned());
        i += 2;
    }
    vec![path]
}

/// The room of a path below src, by its steps; `None` for a wing's own file, which only lists its rooms.
fn room_of<S: AsRef<str>>(steps: &[S]) -> Option<String> {
    let first = steps.first()?.as_ref();
    if WINGS.contains(&first) { Some(format!("{first}/{}", steps.get(1)?.as_ref())) } else { Some(first.to_owned()) }
}

/// The room of a file below src; `None` as in [`room_of`].
fn home_of(file: &str) -> Option<String> {
    let steps: Vec<&str> = file.trim_end_matches(".rs").split('/').filter(|step| *step != "mod").collect();
    room_of(&steps)
}

/// The steps from src to the module that a file is.
fn module_of(file: &str) -> Vec<String> {
    let mut steps: Vec<String> = file.trim_end_matches(".rs").split('/').map(String::from).collect();
    if steps.last().is_some_and(|last| matches!(last.as_str(), "mod" | "lib" | "main")) {
        steps.pop();
    }
    steps
}

/// What a file names by a path.
struct Named {
    path: Vec<String>,
    /// In a `use`.
    import: bool,
    /// In a module of tests.
    test: bool,
}

/// All that a file names by `crate::…`, by `super::…`, by one of its own modules, or (main.rs) by the name of the
/// crate.
fn named(file: &str, source: &str) -> Vec<Named> {
    let home = module_of(file);
    let tokens = tokens(source);
    let token = |i: usize| tokens.get(i).map_or("", String::as_str);
    let below: BTreeSet<&str> =
        (2..tokens.len()).filter(|&i| token(i) == ";" && token(i - 2) == "mod").map(|i| token(i - 1)).collect();
    // inline modules around the place: depth of braces at which each ends
    let (mut depth, mut inner) = (0, Vec::<(usize, String)>::new());
    let mut out = vec![];
    for i in 0..tokens.len() {
        let starts = token(i + 1) == "::" && (i == 0 || token(i - 1) != "::");
        match token(i) {
            "{" => depth += 1,
            "}" => {
                depth -= 1;
                inner.retain(|(end, _)| *end < depth + 1);
            }
            "mod" if token(i + 2) == "{" => inner.push((depth + 1, token(i + 1).to_owned())),
            first if starts && (matches!(first, "crate" | "super" | "self" | "kfdesign") || below.contains(first)) => {
                let mut place = home.clone();
                place.extend(inner.iter().map(|(_, name)| name.clone()));
                for steps in path_tails(&tokens, i) {
                    let mut path = place.clone();
                    for step in steps {
                        match step.as_str() {
                            "crate" | "kfdesign" => path.clear(),
                            "self" => {}
                            "super" => {
                                path.pop();
                            }
                            name => path.push(name.to_owned()),
                        }
                    }
                    let import = i > 0 && token(i - 1) == "use";
                    let test = inner.iter().any(|(_, name)| name == "tests");
                    out.push(Named { path, import, test });
                }
            }
            _ => {}
        }
    }
    out
}

/// The rooms that a file names.
fn rooms_used(file: &str, source: &str) -> BTreeSet<String> {
    named(file, source).iter().filter_map(|named| room_of(&named.path)).collect()
}

type Steps = Vec<String>;

/// Where a path leads: a name that a module hands on, or imports for the modules in it, is one of the module where it
/// is defined.
fn defined(all: &BTreeMap<Steps, Vec<Named>>, path: &[String], hops: usize) -> Steps {
    let length = (0..=path.len()).rev().find(|&n| all.contains_key(&path[..n])).unwrap_or(0);
    let (module, rest) = path.split_at(length);
    let import = |named: &&Named| named.import && !named.test && named.path.last() == rest.first();
    match all.get(module).and_then(|named| named.iter().find(import)) {
        Some(found) if !rest.is_empty() && hops > 0 && found.path != path => {
            defined(all, &[&found.path[..], &rest[1..]].concat(), hops - 1)
        }
        _ => module.to_vec(),
    }
}

/// Files that use each other, over whatever is between. A module may use what is in it, and that its module.
fn circles(files: &[(String, String)]) -> Vec<String> {
    let all: BTreeMap<Steps, Vec<Named>> =
        files.iter().map(|(file, source)| (module_of(file), named(file, source))).collect();
    let mut uses: BTreeMap<&Steps, BTreeSet<Steps>> = BTreeMap::new();
    for (module, named) in &all {
        let own = named.iter().filter(|named| !named.test);
        let used = own.map(|named| defined(&all, &named.path, 8)).filter(|used| !used.starts_with(module));
        uses.insert(module, used.collect());
    }
    let reached = |from: &Steps| {
        let (mut seen, mut next) = (BTreeSet::new(), vec![from]);
        while let Some(module) = next.pop() {
            next.extend(uses[module].iter().filter(|used| seen.insert((*used).clone())));
        }
        seen
    };
    let reach: BTreeMap<&Steps, BTreeSet<Steps>> = uses.keys().map(|module| (*module, reached(module))).collect();
    let pairs = uses.iter().flat_map(|(from, used)| used.iter().map(move |to| (*from, to)));
    let back = pairs.filter(|(from, to)| reach[to].contains(*from));
    back.map(|(from, to)| format!("{} uses {}", from.join("/"), to.join("/"))).collect()
}

/// What is wrong with one file; empty when nothing is.
fn complaints(file: &str, source: &str) -> Vec<String> {
    let mut out = vec![];
    let lines = source.lines().count();
    if lines > LONGEST_FILE {
        out.push(format!("src/{file} has {lines} lines, at most {LONGEST_FILE}: divide it"));
    }
    let home = home_of(file);
    let room = home.as_deref().unwrap_or_default();
    let row = |name: &str| HOUSE.iter().find(|r| r.1 == name);
    if !matches!(room, "" | "lib" | "main") {
        let Some(&(floor, _, neighbours)) = row(room) else {
            out.push(format!("src/{file}: room {room} stands on no floor: add it to the table"));
            return out;
        };
        for used in rooms_used(file, source) {
            let Some(&(other, name, _)) = row(&used) else { continue };
            if name != room && other >= floor && !neighbours.contains(&name) {
                out.push(format!("src/{file}: {room} (floor {floor}) uses {name} (floor {other})"));
            }
        }
    }
    let tokens = tokens(source);
    let has = |words: &[&str]| tokens.windows(words.len()).any(|w| w.iter().zip(words).all(|(a, b)| a == b));
    // these panic when the stream is closed or full
    for name in ["print", "println", "eprint", "eprintln", "dbg"] {
        if has(&[name, "!"]) {
            out.push(format!("src/{file}: {name}!: what is said goes through src/cli/output.rs"));
        }
    }
    if !matches!(room, "cli" | "ops") && has(&["anyhow"]) {
        out.push(format!("src/{file}: anyhow outside src/ops and src/cli: give the room its own error type"));
    }
    if room != "cli" && room != "main" && names_a_flag(source) {
        out.push(format!("src/{file}: names a --flag: write `name` of the option, which src/cli/output.rs translates"));
    }
    if !matches!(room, "cli" | "ops") && has(&["clap"]) {
        out.push(format!("src/{file}: clap outside src/ops and src/cli: requests and flags are described there alone"));
    }
    if room == "view" && (has(&["fs", "::"]) || has(&["File", "::"])) {
        out.push(format!("src/{file}: a view reads and writes no files: it makes a report of a result"));
    }
    if file != "cli/output.rs" {
        for stream in ["stdout", "stderr"] {
            if has(&[stream, "("]) {
                out.push(format!("src/{file}: {stream}() outside src/cli/output.rs"));
            }
        }
    }
    if file != "main.rs" && (has(&["process", "::", "exit"]) || has(&["exit", "("])) {
        out.push(format!("src/{file}: exit outside main.rs: return a status instead"));
    }
    out
}

/// A line of code, not of comment, in which two hyphens stand before a word and behind none.
fn names_a_flag(source: &str) -> bool {
    let code = source.lines().filter(|line| !line.trim_start().starts_with("//"));
    code.flat_map(|line| line.match_indices("--").map(move |(at, _)| (line, at))).any(|(line, at)| {
        let before = line[..at].chars().next_back();
        let after = line[at + 2..].chars().next();
        after.is_some_and(|c| c.is_ascii_lowercase()) && before.is_none_or(|c| !c.is_alphanumeric() && c != '-')
    })
}

#[test]
fn every_file_keeps_to_its_floor() {
    let all: Vec<String> = sources().iter().flat_map(|(file, source)| complaints(file, source)).collect();
    assert!(all.is_empty(), "\n{}", all.join("\n"));
}

/// The binding stays a binding: no code that is unsafe, nothing printed, and no more than a page of each.
#[test]
fn the_python_crate_is_a_door() {
    let folder = root().join("src/python");
    let paths = std::fs::read_dir(&folder).unwrap().map(|entry| entry.unwrap().path());
    let files: Vec<String> = paths
        .filter(|path| path.extension().is_some_and(|e| e == "rs"))
        .map(|path| std::fs::read_to_string(path).unwrap())
        .collect();
    let lines: usize = files.iter().map(|text| text.lines().count()).sum();
    assert!(lines <= LONGEST_FILE, "src/python has {lines} lines of Rust, at most {LONGEST_FILE}");
    for text in &files {
        let tokens = tokens(text);
        for name in ["unsafe", "print", "println", "eprint", "eprintln", "unwrap", "exit"] {
            assert!(!tokens.iter().any(|token| token == name), "src/python: {name}");
        }
    }
    assert!(std::fs::read_to_string(folder.join("Cargo.toml")).unwrap().contains("unsafe_code = \"forbid\""));
}

/// A file that needs what needs it cannot be read, tested or changed alone.
#[test]
fn no_circle_of_imports() {
    let found = circles(&sources());
    assert!(found.is_empty(), "in circles:\n{}", found.join("\n"));
}

#[test]
fn every_room_is_in_the_table_and_every_row_is_a_room() {
    let rooms: BTreeSet<String> = sources()
        .iter()
        .filter_map(|(file, _)| home_of(file))
        .filter(|room| !matches!(room.as_str(), "lib" | "main"))
        .collect();
    let table: BTreeSet<String> = HOUSE.iter().map(|row| row.1.to_owned()).collect();
    assert_eq!(rooms, table);
}

/// Rows `| floor | room | what it holds | neighbours |` of docs/architecture.md.
#[test]
fn the_documentation_shows_the_same_table() {
    let page = std::fs::read_to_string(root().join("docs/architecture.md")).unwrap();
    let shown: Vec<(u8, String, Vec<String>)> = page
        .lines()
        .filter_map(|line| {
            let cells: Vec<&str> = line.trim().trim_matches('|').split('|').map(str::trim).collect();
            let &[floor, room, _, neighbours] = cells.as_slice() else { return None };
            let neighbours = neighbours.split(',').map(|n| n.trim().trim_matches('`').to_owned());
            Some((floor.parse().ok()?, room.trim_matches('`').into(), neighbours.filter(|n| n != "–").collect()))
        })
        .collect();
    let table: Vec<(u8, String, Vec<String>)> = HOUSE
        .iter()
        .map(|(floor, room, n)| (*floor, (*room).into(), n.iter().map(|n| (*n).into()).collect()))
        .collect();
    assert_eq!(shown, table, "docs/architecture.md and the table of this test differ");
}

#[test]
fn one_version_of_the_mathematical_packages() {
    let lock = std::fs::read_to_string(root().join("Cargo.lock")).unwrap();
    let mut versions: BTreeMap<String, Vec<String>> = BTreeMap::new();
    let value = |line: &str| line.split('"').nth(1).unwrap_or_default().to_owned();
    for package in lock.split("[[package]]").skip(1) {
        let field = |key: &str| package.lines().find(|l| l.starts_with(key)).map(value).unwrap_or_default();
        versions.entry(field("name = ")).or_default().push(field("version = "));
    }
    for name in ONLY_ONCE {
        let found = versions.get(name).cloned().unwrap_or_default();
        assert_eq!(found.len(), 1, "{name} must be in Cargo.lock once, found {found:?}: `cargo tree -d` says who asks");
    }
}

/// The checks above would pass on an empty house; here each sees what it is for.
#[test]
fn each_rule_bites() {
    let bites = |file: &str, source: &str| !complaints(file, source).is_empty();
    // upwards, in every way of writing it
    for source in [
        "use crate::filter::Kalman;",
        "pub(crate) use crate::{units::Unit, filter::{self, Kalman}};",
        "fn f() -> crate::cli::Status { todo() }",
        "use super::super::filter::Kalman;",
        "mod tests { use super::super::super::replay::Replayer; }",
        "use crate::signal::Recording;",
        "use crate::params::Params;",
    ] {
        assert!(bites("noise/white.rs", source), "{source}");
    }
    // downwards, sideways where the table allows it, inside the room, and in words only
    for (file, source) in [
        ("noise/white.rs", "use crate::numerics::random; use super::Term; use crate::noise::Term;"),
        ("noise/white.rs", "/// as in [`crate::filter`]\nconst S: &str = \"crate::filter\"; // crate::filter"),
        ("noise/white.rs", "const S: &str = r#\"a \" crate::filter\"#; /* crate::filter /* */ crate::cli */"),
        ("noise/white.rs", "fn f<'a>(c: &'a char) -> bool { *c == '\"' || *c == '\\'' }"),
        ("noise/white.rs", "mod tests { use super::super::Term; use super::*; }"),
        ("params.rs", "use crate::noise::Term;"),
        ("consistency/whiteness.rs", "use crate::filter::Kalman;"),
        ("cli/output.rs", "fn f() -> anyhow::Result<()> { std::io::stdout(); crate::view::plan::plan; }"),
        ("main.rs", "fn main() { kfdesign::cli::run(args, stop); std::process::exit(1) }"),
    ] {
        assert_eq!(complaints(file, source), Vec::<String>::new(), "{source}");
    }
    assert!(bites("filter/kalman.rs", "use crate::consistency::Test;"));
    assert!(bites("units.rs", "use crate::numerics::linalg;"));
    assert!(bites("kitchen.rs", ""));
    assert!(bites("tune/mod.rs", &"\n".repeat(LONGEST_FILE + 1)));
    assert!(!bites("tune/mod.rs", &"\n".repeat(LONGEST_FILE)));
    assert!(bites("tune/mod.rs", "fn f() -> &'static str { \"give --log LOG\" }"));
    assert!(!bites("tune/mod.rs", "// as --log LOG\nfn f() -> &'static str { \"3--x, a---b, `log`\" }"));
    for source in [
        "fn f() { println!(\"x\") }",
        "fn f() { eprint!() }",
        "use anyhow::Context;",
        "fn f() { std::io::stdout().lock(); }",
    ] {
        assert!(bites("tune/mod.rs", source), "{source}");
    }
    // a view shows what it is given
    for source in [
        "fn f() { println!(\"x\") }",
        "fn f() { std::io::stdout().lock(); }",
        "#[derive(clap::Args)] struct Flags;",
        "fn f() { std::fs::read(\"x\"); }",
        "use std::fs::File; fn f() { File::open(\"x\"); }",
        "use crate::cli::output;",
    ] {
        assert!(bites("view/plan.rs", source), "{source}");
    }
    for source in
        ["fn f() { std::process::exit(2) }", "use std::process; fn f() { process::exit(2) }", "fn f() { exit(2) }"]
    {
        assert!(bites("cli/mod.rs", source), "{source}");
    }
}

#[test]
fn the_rule_of_circles_bites() {
    let circles = |files: &[(&str, &str)]| {
        let files: Vec<(String, String)> = files.iter().map(|(f, s)| ((*f).into(), (*s).into())).collect();
        circles(&files)
    };
    let both = ["a/b uses a/c", "a/c uses a/b"];
    let b = ("a/b.rs", "use super::c::C;");
    // in every way of writing it, over a name that is handed on, and with a file between
    for (parent, c) in [
        ("", "use crate::a::b::B;"),
        ("", "fn f() { super::b::g() }"),
        ("mod b; mod c; pub use b::B;", "use super::B;"),
        ("mod b; mod c; use b::B;", "use super::B;"),
        ("pub(super) use self::b::{A, B};", "use crate::a::B;"),
    ] {
        assert_eq!(circles(&[("a/mod.rs", parent), b, ("a/c.rs", c)]), both, "{parent} {c}");
    }
    assert_eq!(circles(&[b, ("a/c.rs", "use super::d;"), ("a/d.rs", "use super::b;")]).len(), 3);
    // what is beside a circle is not blamed for it
    assert_eq!(circles(&[b, ("a/c.rs", "use super::b;"), ("d.rs", "use crate::a::b;"), ("e.rs", "")]), both);
    // one way, a module and what is in it, a facade, tests, and words
    assert!(circles(&[("a/mod.rs", "mod b; use b::B; fn f() { b::g() }"), ("a/b.rs", "use super::A;")]).is_empty());
    for c in ["", "mod tests { use super::super::b::B; }", "/// [`super::b`]\nconst S: &str = \"super::b\";"] {
        let parent = ("a/mod.rs", "mod b; mod c; pub use b::B; pub use c::C;");
        assert_eq!(circles(&[parent, b, ("a/c.rs", c)]), Vec::<String>::new(), "{c}");
    }
}
