//! Documentation cannot rot: every `sh` block of README.md and docs/*.md is run, and where a `text` block follows,
//! it must be what the commands print on stdout.
//!
//! Blocks of one page run in order in one scratch directory that holds a copy of `data/`. `cargo run --release --
//! ARGS` runs the binary under test; other `cargo` and `git` lines are set-up and are not run. A line may end in `#
//! exit 1`. A picture `![words](figures/NAME.svg "REPORT.html, TITLE")` is the figure TITLE of a report or of a
//! sheet of figures (FIGURES.svg) that the commands of the page wrote. `KFDESIGN_UPDATE_DOCS=1 cargo test --release
//! docs` rewrites the `text` blocks from what was printed, and the pictures.

use std::path::{Path, PathBuf};

use kfdesign::report::figure::sheet;

use crate::support::{Bench, figure};

/// A page cut into lines with the fenced blocks found in it.
struct Page {
    path: PathBuf,
    lines: Vec<String>,
}

/// Lines `start..end` between the fences of a block in language `language`.
struct Fence {
    language: String,
    start: usize,
    end: usize,
}

impl Page {
    fn read(path: PathBuf) -> Page {
        let text = std::fs::read_to_string(&path).unwrap();
        Page { path, lines: text.lines().map(str::to_string).collect() }
    }
    fn fences(&self) -> Vec<Fence> {
        let mut fences = Vec::new();
        let mut open: Option<(String, usize)> = None;
        for (i, line) in self.lines.iter().enumerate() {
            if let Some(tag) = line.strip_prefix("```") {
                match open.take() {
                    None => open = Some((tag.trim().to_string(), i + 1)),
                    Some((language, start)) => fences.push(Fence { language, start, end: i }),
                }
            }
        }
        assert!(open.is_none(), "{}: a fenced block is not closed", self.path.display());
        fences
    }
}

fn pages() -> Vec<Page> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let mut paths: Vec<PathBuf> = std::fs::read_dir(root.join("docs"))
        .unwrap()
        .map(|e| e.unwrap().path())
        .filter(|p| p.extension().is_some_and(|e| e == "md"))
        .chain(["README.md", "CONTRIBUTING.md", "data/README.md"].map(|f| root.join(f)))
        .collect();
    paths.sort();
    paths.into_iter().map(Page::read).collect()
}

fn copy_dir(from: &Path, to: &Path) {
    std::fs::create_dir_all(to).unwrap();
    for entry in std::fs::read_dir(from).unwrap() {
        let entry = entry.unwrap();
        let target = to.join(entry.file_name());
        if entry.file_type().unwrap().is_dir() {
            copy_dir(&entry.path(), &target);
        } else {
            std::fs::copy(entry.path(), target).unwrap();
        }
    }
}

/// File, report and title of every picture on a page.
fn pictures(page: &Page) -> Vec<(PathBuf, String, String)> {
    let folder = page.path.parent().unwrap();
    let mut found = Vec::new();
    for rest in page.lines.iter().flat_map(|line| line.split("](figures/").skip(1)) {
        let picture = rest.split_once(" \"").and_then(|(name, rest)| {
            let (report, title) = rest.split_once("\")")?.0.split_once(", ")?;
            Some((folder.join("figures").join(name), report.to_string(), title.to_string()))
        });
        found.push(picture.unwrap_or_else(|| panic!("{}: picture without a report: {rest}", page.path.display())));
    }
    found
}

/// Split a command line at spaces, keeping "double quoted" and 'single quoted' words whole.
fn words(line: &str) -> Vec<String> {
    let mut words = Vec::new();
    let mut word = String::new();
    let mut quote: Option<char> = None;
    let mut started = false;
    for c in line.chars() {
        match (quote, c) {
            (Some(q), c) if c == q => quote = None,
            (None, '"' | '\'') => (quote, started) = (Some(c), true),
            (None, c) if c.is_whitespace() => {
                if started {
                    words.push(std::mem::take(&mut word));
                    started = false;
                }
            }
            (_, c) => {
                word.push(c);
                started = true;
            }
        }
    }
    if started {
        words.push(word);
    }
    words
}

/// Stdout of the commands of one block, in order.
fn run_block(bench: &Bench, page: &Page, block: &Fence) -> String {
    let mut printed = String::new();
    let mut joined = String::new();
    for line in &page.lines[block.start..block.end] {
        joined.push_str(line.trim_end_matches('\\'));
        if line.ends_with('\\') {
            continue;
        }
        let line = std::mem::take(&mut joined);
        let (command, status) = match line.split_once("# exit ") {
            Some((command, status)) => (command.trim().to_string(), status.trim().parse().unwrap()),
            None => (line.split(" # ").next().unwrap_or("").trim().to_string(), 0),
        };
        let arguments = match words(&command) {
            w if w.is_empty() || command.starts_with('#') => continue,
            w if w[0] == "kfdesign" => w[1..].to_vec(),
            w if w.starts_with(&["cargo", "run", "--release", "--"].map(String::from)) => w[4..].to_vec(),
            w if w[0] == "cargo" || w[0] == "git" || w[0] == "bash" => continue,
            _ => panic!("{}: do not know how to run '{command}'", page.path.display()),
        };
        let out = bench.as_typed(&arguments.iter().map(String::as_str).collect::<Vec<_>>());
        assert_eq!(
            out.status,
            status,
            "{}: '{command}' ended with {}\nstdout: {}\nstderr: {}",
            page.path.display(),
            out.status,
            out.stdout,
            out.stderr
        );
        printed.push_str(&out.stdout);
    }
    printed
}

/// Runs the blocks of a page in order and compares what they print and draw with what it shows.
fn is_true(file: &str) {
    let update = std::env::var_os("KFDESIGN_UPDATE_DOCS").is_some();
    let mut stale = Vec::new();
    let mut page = Page::read(Path::new(env!("CARGO_MANIFEST_DIR")).join(file));
    let fences = page.fences();
    let bench = Bench::new();
    copy_dir(&Path::new(env!("CARGO_MANIFEST_DIR")).join("data"), &bench.path("data"));
    let mut replacements = Vec::new();
    for (i, fence) in fences.iter().enumerate().filter(|(_, f)| f.language == "sh") {
        let printed = run_block(&bench, &page, fence);
        let Some(shown) = fences.get(i + 1).filter(|f| {
            f.language == "text" && page.lines[fence.end + 1..f.start - 1].iter().all(|l| l.trim().is_empty())
        }) else {
            continue;
        };
        let printed: Vec<String> = printed.trim_end().lines().map(|l| l.trim_end().to_string()).collect();
        if printed != page.lines[shown.start..shown.end] {
            stale.push(format!("{}:{}", page.path.display(), shown.start + 1));
            replacements.push((shown.start, shown.end, printed));
        }
    }
    for (file, report, title) in pictures(&page) {
        let text = bench.read(&report);
        let drawn = figure(&text, &title);
        // a figure of a sheet has its place there
        let place = drawn.strip_prefix("<svg y=\"").and_then(|rest| rest.split_once("\" "));
        let drawn = place.map_or(drawn.to_string(), |(_, rest)| format!("<svg {rest}"));
        let svg = sheet(&title, &[drawn]);
        if std::fs::read_to_string(&file).ok().as_deref() != Some(&svg) {
            stale.push(file.display().to_string());
            if update {
                std::fs::create_dir_all(file.parent().unwrap()).unwrap();
                std::fs::write(&file, svg).unwrap();
            }
        }
    }
    if update && !replacements.is_empty() {
        for (start, end, printed) in replacements.into_iter().rev() {
            page.lines.splice(start..end, printed);
        }
        std::fs::write(&page.path, page.lines.join("\n") + "\n").unwrap();
    }
    assert!(
        update || stale.is_empty(),
        "these do not show what the commands print and draw (KFDESIGN_UPDATE_DOCS=1 rewrites them): {stale:?}"
    );
}

/// One test per page, so that pages run side by side.
macro_rules! true_pages {
    ($($name:ident: $file:literal,)*) => {
        const TRUE_PAGES: &[&str] = &[$($file),*];
        $(
            #[test]
            fn $name() {
                is_true($file);
            }
        )*
    };
}

true_pages! {
    airplane: "docs/airplane.md",
    code: "docs/code.md",
    consistency: "docs/consistency.md",
    design_guide: "docs/design-guide.md",
    export: "docs/export.md",
    flight: "docs/flight.md",
    formats: "docs/formats.md",
    goodness_of_fit: "docs/goodness-of-fit.md",
    import: "docs/import.md",
    control_loop: "docs/loop.md",
    low_pass: "docs/low-pass.md",
    noise_models: "docs/noise-models.md",
    plants: "docs/plants.md",
    quickstart: "docs/quickstart.md",
    seed_paper: "docs/seed-paper.md",
    tour: "docs/tour.md",
    tuning: "docs/tuning.md",
    ulog_to_ekf2: "docs/ulog-to-ekf2.md",
    readme: "README.md",
    data_readme: "data/README.md",
}

#[test]
fn every_page_with_commands_is_run() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let with_commands: Vec<String> = pages()
        .into_iter()
        .filter(|page| page.fences().iter().any(|fence| fence.language == "sh"))
        .map(|page| page.path.strip_prefix(root).unwrap().to_str().unwrap().replace('\\', "/"))
        .collect();
    let run: std::collections::BTreeSet<&str> = TRUE_PAGES.iter().copied().collect();
    let found: std::collections::BTreeSet<&str> = with_commands.iter().map(String::as_str).collect();
    assert_eq!(run, found, "true_pages! lists the pages that have commands");
}

#[test]
fn relative_links_point_to_files_that_exist() {
    for page in pages() {
        let folder = page.path.parent().unwrap().to_path_buf();
        for line in &page.lines {
            for target in line.split("](").skip(1).filter_map(|rest| rest.split(')').next()) {
                let file = target.split(['#', ' ']).next().unwrap_or("");
                if file.is_empty() || file.contains("://") {
                    continue;
                }
                assert!(folder.join(file).exists(), "{}: link to {target} leads nowhere", page.path.display());
            }
        }
    }
}
