//! Every report page in a real browser: nothing is wider than its box on a phone or on a desk, light and dark.
//!
//! Needs chromium (`apt-get install chromium`), or the program that `CHROMIUM` names; without one the test prints that
//! it skipped, and with CI=true it fails. `KFDESIGN_GALLERY=DIR` keeps the pages there.

use std::path::{Path, PathBuf};
use std::process::Command;

use serde_json::{Value, json};

use crate::support::Bench;

/// Of the window, px: a phone, a laptop, a desk.
const WIDTHS: [u32; 3] = [390, 1280, 1920];

fn browser() -> Option<PathBuf> {
    let named = std::env::var_os("CHROMIUM").map(PathBuf::from);
    let folders = std::env::var_os("PATH").unwrap_or_default();
    let found = ["chromium", "chromium-browser", "google-chrome"]
        .into_iter()
        .find_map(|name| std::env::split_paths(&folders).map(|folder| folder.join(name)).find(|path| path.is_file()));
    let browser = named.or(found);
    if browser.is_none() {
        assert!(std::env::var("CI").as_deref() != Ok("true"), "chromium not found: apt-get install chromium");
        println!("skipped: chromium not found");
    }
    browser
}

/// What is looked for in a page of some width: boxes whose content is wider than they are, and facts of the page.
const MEASURE: &str = r#"
function measured(page, width) {
  const root = page.documentElement;
  const name = e => e.tagName.toLowerCase() + (e.className ? "." + e.className : "") + ": " +
    ((e.querySelector("caption, th") || e).textContent || "").trim().slice(0, 60);
  const wide = [...page.querySelectorAll("main, section, .scroll, figure, table, p, pre, dl, nav, details")]
    .filter(e => e.offsetParent !== null && e.scrollWidth > e.clientWidth + 1)
    .map(e => name(e) + " is " + e.scrollWidth + " px in " + e.clientWidth);
  if (root.scrollWidth > width) wide.push("the page is " + root.scrollWidth + " px");
  const cells = [...page.querySelectorAll("td")];
  const shown = cells.filter(e => e.offsetParent !== null && !e.closest("details:not([open])"));
  const fails = e => e.textContent.startsWith("FAIL");
  return {
    wide,
    dark: page.defaultView.matchMedia("(prefers-color-scheme: dark)").matches,
    paper: page.defaultView.getComputedStyle(page.body).backgroundColor,
    failures: shown.filter(fails).length,
    all_failures: cells.filter(fails).length,
    cards: shown.filter(e => page.defaultView.getComputedStyle(e).display === "flex").length,
    links: [...page.querySelectorAll("nav a")].filter(a => page.getElementById(a.hash.slice(1))).length,
    all_links: page.querySelectorAll("nav a").length,
  };
}
function run() {
  const found = [...document.querySelectorAll("iframe")].map(f =>
    ({ page: f.title, width: f.clientWidth, ...measured(f.contentDocument, f.clientWidth) }));
  const out = document.createElement("pre");
  out.id = "found";
  out.textContent = JSON.stringify(found);
  document.body.append(out);
}
addEventListener("load", run);
"#;

/// The pages at every width in one window.
fn look(browser: &Path, bench: &Bench, pages: &[(String, String)], dark: bool) -> Vec<Value> {
    let escaped = |html: &str| html.replace('&', "&amp;").replace('"', "&quot;");
    let frames = pages.iter().flat_map(|(name, html)| {
        WIDTHS.map(|width| {
            format!(
                "<iframe title=\"{name}\" style=\"border:0;width:{width}px;height:900px\" srcdoc=\"{}\"></iframe>",
                escaped(html)
            )
        })
    });
    let frames: String = frames.collect();
    let page = bench.file("all.html", format!("<!doctype html><body><script>{MEASURE}</script>{frames}</body>"));
    let profile = bench.path(if dark { "dark" } else { "light" });
    let out = Command::new(browser)
        .args(["--headless", "--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run", "--disable-sync"])
        .args(["--disable-background-networking", "--disable-component-update", "--disable-dev-shm-usage"])
        .arg(format!("--blink-settings=preferredColorScheme={}", u8::from(!dark)))
        .arg(format!("--user-data-dir={}", profile.display()))
        .args(["--virtual-time-budget=20000", "--window-size=2000,1200", "--dump-dom"])
        .arg(format!("file://{}", page.display()))
        .output()
        .unwrap();
    let dom = String::from_utf8_lossy(&out.stdout);
    let found = dom.split_once("<pre id=\"found\">").and_then(|(_, rest)| rest.split_once("</pre>"));
    let (found, _) = found.unwrap_or_else(|| panic!("nothing measured: {}", String::from_utf8_lossy(&out.stderr)));
    let found = found.replace("&lt;", "<").replace("&gt;", ">").replace("&nbsp;", "\u{a0}").replace("&amp;", "&");
    serde_json::from_str(&found).unwrap()
}

/// A page of every command that makes one, and of every kind of verdict.
fn pages(bench: &Bench) -> Vec<(String, String)> {
    let data = concat!(env!("CARGO_MANIFEST_DIR"), "/data");
    let run = |args: &str| {
        let out = bench.run(args);
        assert!(out.status < 2, "{args}: {}", out.stderr);
    };
    run(&format!("simulate {data}/params.json -o log.npy --duration 30min --seed 1"));
    run("identify log.npy -o params.json --report identify.html");
    run("identify log.npy --columns gyro_x --method graphical --report graphical.html");
    run(&format!("tune {data}/params.json -o filter.json --report tune.html"));
    run("replay filter.json log.npy --report replay.html --allow-inconclusive");
    run("compare params.json log.npy --report compare.html");
    run("montecarlo filter.json --runs 100 --report montecarlo.html");
    run(&format!("tune {data}/wrong/sigma_x2.24.json -o wrong.json"));
    run("replay wrong.json log.npy --report replay-wrong.html");
    run(&format!("montecarlo wrong.json --truth {data}/wrong/truth.json --runs 100 --report montecarlo-wrong.html"));
    bench.run_args(&[
        "tune",
        &format!("{data}/params.json"),
        "--plant",
        "angle",
        "--aid",
        "heading: 2 deg @ 1 Hz, 3 deg over 60 s",
        "--insight",
        "-o",
        "angle.json",
        "--report",
        "angle.html",
    ]);
    run("montecarlo angle.json --runs 50 --report montecarlo-angle.html");
    bench.run_args(&[
        "trim",
        &format!("{data}/airplanes/aerosonde.json"),
        "--speed",
        "25 m/s",
        "--altitude",
        "100 m",
        "--report",
        "trim.html",
    ]);
    let names = bench.files().into_iter().filter(|name| name.ends_with(".html"));
    let pages: Vec<(String, String)> = names.map(|name| (name.clone(), bench.read(&name))).collect();
    if let Some(dir) = std::env::var_os("KFDESIGN_GALLERY") {
        pages.iter().for_each(|(name, html)| std::fs::write(Path::new(&dir).join(name), html).unwrap());
    }
    pages
}

#[test]
fn no_page_is_wider_than_its_window() {
    let Some(browser) = browser() else { return };
    let bench = Bench::new();
    let pages = pages(&bench);
    assert_eq!(pages.len(), 11, "{:?}", pages.iter().map(|p| &p.0).collect::<Vec<_>>());
    let mut faults = Vec::new();
    for dark in [false, true] {
        let found = look(&browser, &bench, &pages, dark);
        assert_eq!(found.len(), pages.len() * WIDTHS.len());
        for view in found {
            let place = format!("{} at {} px", view["page"], view["width"]);
            assert_eq!(view["dark"], json!(dark), "{place}: the browser was asked for another setting");
            let paper = if dark { "rgb(20, 24, 29)" } else { "rgb(255, 255, 255)" };
            assert_eq!(view["paper"], paper, "{place}");
            faults.extend(view["wide"].as_array().unwrap().iter().map(|fault| format!("{place}: {fault}")));
            if view["failures"] != view["all_failures"] {
                faults.push(format!("{place}: {} of {} failures are seen", view["failures"], view["all_failures"]));
            }
            if view["links"] != view["all_links"] {
                faults.push(format!("{place}: a link of the contents leads nowhere"));
            }
            if view["width"] == 390 && view["cards"].as_u64() < Some(10) {
                faults.push(format!("{place}: {} cells are on cards", view["cards"]));
            }
        }
    }
    assert!(faults.is_empty(), "{}", faults.join("\n"));
}
