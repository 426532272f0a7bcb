//! The page, compiled in.

/// A file of the page: its name, what it is, and its bytes.
macro_rules! files {
    ($($name:literal),* $(,)?) => { [$(($name, kind($name), include_bytes!(concat!("page/", $name)) as &[u8])),*] };
}

const fn kind(name: &str) -> &'static str {
    // the last letter but one tells them apart
    match name.as_bytes()[name.len() - 2] {
        b'm' => "text/html; charset=utf-8",
        b's' => "text/css; charset=utf-8",
        b'j' => "text/javascript; charset=utf-8",
        _ => "text/plain; charset=utf-8",
    }
}

static FILES: [(&str, &str, &[u8]); 17] = files![
    "index.html",
    "app.css",
    "app.js",
    "api.js",
    "ui.js",
    "plot.js",
    "state.js",
    "panel_log.js",
    "panel_noise.js",
    "panel_design.js",
    "panel_compare.js",
    "panel_replay.js",
    "panel_gate.js",
    "panel_export.js",
    "panel_loop.js",
    "uPlot.iife.min.js",
    "uPlot.min.css",
];

/// A file of the page with its type; the page itself has no name.
pub(super) fn file(name: &str) -> Option<(&'static str, &'static [u8])> {
    let name = if name.is_empty() { "index.html" } else { name };
    FILES.iter().find(|(own, ..)| *own == name).map(|(_, kind, bytes)| (*kind, *bytes))
}
