// The frame: tabs, the folder's files, and which panel is seen.

import * as api from "./api.js";
import * as state from "./state.js";
import { announce, button, el, fill } from "./ui.js";
import { panel as log } from "./panel_log.js";
import { panel as noise } from "./panel_noise.js";
import { panel as design } from "./panel_design.js";
import { panel as compare } from "./panel_compare.js";
import { panel as replay } from "./panel_replay.js";
import { panel as gate } from "./panel_gate.js";
import { panel as exporting } from "./panel_export.js";
import { panel as loop } from "./panel_loop.js";

/**
 * @typedef {{api: typeof api, state: typeof state, project: api.Project, open: (panel: string,
 * values?: Record<string, any>) => void,
 *   refresh: () => Promise<void>, tour: () => void}} Context
 * @typedef {{id: string, title: string, show: (root: HTMLElement, ctx: Context) => void | (() => void)}} Panel
 */

/** @type {Panel[]} */
const panels = [log, noise, design, compare, replay, gate, exporting, loop];
/** @param {string} id */
const place = (id) => /** @type {HTMLElement} */ (document.getElementById(id));
/** @type {Map<string, {root: HTMLElement, again: void | (() => void)}>} */
const shown = new Map();

/** @type {Context} */
const ctx = {
  api,
  state,
  open,
  refresh,
  tour,
  project: { version: "", folder: "", read_only: false, files: [], jobs: [] },
};

/** @param {string} id @param {Record<string, any>} [values] */
function open(id, values = {}) {
  state.set({ ...values, panel: id }, true);
  show();
  window.scrollTo(0, 0);
}

/** Looks at the folder again; a panel that is seen hears of it. */
async function refresh() {
  const before = JSON.stringify(ctx.project.files);
  ctx.project = await api.project();
  place("folder").textContent = ctx.project.folder + (ctx.project.read_only ? " (read-only)" : "");
  document.title = `kfdesign – ${ctx.project.folder.split(/[\\/]/).pop()}`;
  if (before !== JSON.stringify(ctx.project.files)) shown.get(state.get("panel", log.id))?.again?.();
}

function show() {
  const id = panels.some((panel) => panel.id === state.get("panel")) ? state.get("panel") : log.id;
  for (const panel of panels) {
    const tab = place(`tab-${panel.id}`);
    const here = panel.id === id;
    tab.setAttribute("aria-selected", `${here}`);
    tab.tabIndex = here ? 0 : -1;
    const known = shown.get(panel.id);
    if (known) known.root.hidden = !here;
    if (!here) continue;
    if (known) {
      known.again?.();
      continue;
    }
    const root = el("div", { id: `panel-${id}`, role: "tabpanel", "aria-labelledby": tab.id, className: "panel" });
    place("main").append(root);
    const kept = { root, again: /** @type {void | (() => void)} */ (undefined) };
    shown.set(id, kept);
    kept.again = panel.show(root, ctx);
  }
}

function tabs() {
  fill(
    place("tabs"),
    panels.map(({ id, title }) =>
      el("button", { type: "button", role: "tab", id: `tab-${id}`, tabIndex: -1, onclick: () => open(id) }, title),
    ),
  );
  place("tabs").addEventListener("keydown", (e) => {
    const at = panels.findIndex(({ id }) => document.activeElement?.id === `tab-${id}`);
    const n = panels.length;
    /** @type {Record<string, number>} */
    const to = { ArrowRight: (at + 1) % n, ArrowLeft: (at + n - 1) % n, Home: 0, End: n - 1 };
    const next = at < 0 ? undefined : to[e.key];
    if (next === undefined) return;
    e.preventDefault();
    open(panels[next].id);
    place(`tab-${panels[next].id}`).focus();
  });
}

// ------------------------------------------------------------------------------------------------- the first minute

/** @type {[string, string][]} */
const STEPS = [
  [
    "log",
    "Log: pick a log of the sensor at rest. What the check finds is marked in the trace. Drag over the " +
      "calm part, or take the one that is offered.",
  ],
  [
    "noise",
    "Noise: Allan deviations with 95 % bars, the fitted model and each of its terms. Move a term by its " +
      "handle or its slider; let go with others unlocked and they are found anew.",
  ],
  [
    "design",
    "Design: choose plant and aids. The sliders stand on the identified numbers, the interval is drawn " +
      "above each. σ(t) and the error budget follow; Verify simulates runs.",
  ],
  ["compare", "Compare: pin up to six designs and see them in the same axes."],
  ["replay", "Replay: a recorded log through the filter, with tests of its innovations."],
  [
    "gate",
    "Gate: many simulated runs. Does the covariance tell the truth? The verdict comes when all planned runs are done.",
  ],
  [
    "export",
    "Export: the numbers for other programs, or the filter as C or Rust. Each panel shows the command " +
      "that does the same.",
  ],
];

/** @param {number} [at] */
function tour(at = 0) {
  const step = STEPS[at];
  const end = () => {
    fill(place("tour"));
    place(`tab-${state.get("panel", log.id)}`).focus();
  };
  if (!step) return end();
  open(step[0]);
  const next = button(at + 1 < STEPS.length ? "Next" : "Done", () => tour(at + 1), { className: "main" });
  fill(
    place("tour"),
    el(
      "section",
      { "aria-label": "Tour", onkeydown: (/** @type {KeyboardEvent} */ e) => e.key === "Escape" && end() },
      el("p", null, step[1]),
      el(
        "div",
        { className: "row" },
        next,
        button("End the tour", end),
        el("span", { className: "hint" }, `${at + 1} of ${STEPS.length}`),
      ),
    ),
  );
  next.focus();
}

// --------------------------------------------------------------------------------------------------- files dropped

/** @param {Event} event */
const carries = (event) => /** @type {DragEvent} */ (event).dataTransfer?.types.includes("Files");
addEventListener("dragover", (e) => {
  if (carries(e)) {
    e.preventDefault();
    document.body.classList.add("drop");
  }
});
addEventListener("dragleave", (e) => {
  if (!e.relatedTarget) document.body.classList.remove("drop");
});
addEventListener("drop", async (e) => {
  document.body.classList.remove("drop");
  if (!carries(e)) return;
  e.preventDefault();
  for (const file of e.dataTransfer?.files ?? []) {
    try {
      announce(`uploading ${file.name}`);
      await api.upload(file.name, file);
      await refresh();
      const kind = ctx.project.files.find(({ name }) => name === file.name)?.kind;
      if (kind === "log") open("log", { log: file.name, from: null, to: null });
      announce(`${file.name} is in the folder`);
    } catch (error) {
      fill(
        place("alert"),
        /** @type {Error} */ (error).message,
        " ",
        button("Close", () => fill(place("alert"))),
      );
    }
  }
});

let there = true;
api.onServer.add((now) => {
  if (now === there) return;
  there = now;
  if (now) return fill(place("alert"));
  fill(
    place("alert"),
    "The server does not answer. What you set here is kept. Start kfdesign serve again, or ",
    button("try again", () => refresh().catch(() => announce("still no answer"))),
  );
});

tabs();
state.onChange(show);
addEventListener("focus", () => refresh().catch(() => {}));
refresh()
  .catch(() => {})
  .then(show);
