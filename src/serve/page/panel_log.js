// Log: which file, how it is read, what the check found, and which part of it counts.

import { figure } from "./plot.js";
import * as state from "./state.js";
import {
  announce,
  button,
  details,
  duration,
  el,
  field,
  fill,
  jobView,
  number,
  selectField,
  size,
  table,
  textField,
} from "./ui.js";

/** Keys of the view that say how a log is read. */
const READING = ["topic", "columns", "unit", "rate", "time", "sensor"];
const UNITS = ["deg/s", "rad/s", "mdps", "deg/h", "m/s^2", "g", "mg"];
/** More axes than this are read one after the other by a person too. */
const MOST_AXES = 12;

/** How the log is read, as requests say it; with its range, or without. @param {boolean} [whole] */
export function reading(whole = false) {
  /** @type {Record<string, any>} */
  const out = {};
  for (const key of READING) {
    const value = state.get(key);
    if (value)
      out[key] =
        key === "columns" ? value.split(",").map((name) => name.trim()) : key === "rate" ? Number(value) : value;
  }
  if (!whole && state.get("from")) out.start = `${state.get("from")}s`;
  if (!whole && state.get("to")) out.end = `${state.get("to")}s`;
  return out;
}

/** A MEMS gyro with a drift so quick that twenty minutes tell it. */
const EXAMPLE = {
  format: "kfdesign-params/1",
  quantity: "angular-rate",
  sample_rate: { value: 100, unit: "Hz" },
  axes: ["x", "y", "z"].map((name) => ({
    name,
    bias: { value: -0.3, unit: "deg/s" },
    turn_on_bias: { std_dev: { value: 0.3, unit: "deg/s" } },
    white: { density: { value: 0.02, unit: "deg/s/sqrt(Hz)" } },
    gauss_markov: [{ std_dev: { value: 0.03, unit: "deg/s" }, correlation_time: { value: 30, unit: "s" } }],
  })),
  source: { note: "Simulated example: a MEMS gyro with white noise and a drift of 30 s correlation time." },
};
const EXAMPLE_LENGTH = "20min";
const EXAMPLE_LOG = "example.csv.gz";

/** @type {import("./app.js").Panel} */
export const panel = {
  id: "log",
  title: "Log",
  show(root, ctx) {
    const { api } = ctx;
    /** @type {import("./api.js").Head | null} */
    let head = null;
    let drawn = "";
    /** @type {ReturnType<typeof figure>[]} */
    let traces = [];
    /** What is seen of the log; `null`: all. @type {[number, number] | null} */
    let view = null;

    const offer = el("section");
    const logs = selectField("Log", [], {
      onchange: (log) => ctx.open("log", { log, from: null, to: null, ...none() }),
    });
    const file = el("input", { type: "file", multiple: true, onchange: add });
    const job = jobView();
    const facts = el("p");
    const problem = el("p", { className: "error", role: "alert", hidden: true });
    const topic = selectField("Topic", [], { onchange: (value) => again({ topic: value }) });
    topic.hidden = true;
    const unit = textField("Unit of the values", {
      placeholder: "deg/s",
      onchange: (value) => again({ unit: value }),
      hint: "Units are never guessed: the header says them, or you do.",
    });
    const units = el(
      "datalist",
      { id: "units" },
      UNITS.map((value) => el("option", { value })),
    );
    unit.input.setAttribute("list", units.id);
    const rate = textField("Sample rate, Hz", {
      onchange: (value) => again({ rate: value }),
      hint: "Only without a time column.",
    });
    const columns = textField("Columns", {
      placeholder: "found by name",
      onchange: (value) => again({ columns: value }),
      hint: "Names or numbers, with commas.",
    });
    const time = textField("Time column", {
      hint: "With its unit where the header has none: time:s.",
      placeholder: "found by name",
      onchange: (value) => again({ time: value }),
    });
    const sensor = selectField(
      "Sensor",
      [
        ["", "the one there is"],
        ["gyro", "gyro"],
        ["accel", "accelerometer"],
      ],
      { onchange: (value) => again({ sensor: value }) },
    );
    const how = details("How the log is read", topic, unit, units, sensor, columns, time, rate);

    const from = textField("From, s", { placeholder: "start", size: 9, onchange: () => typed() });
    const to = textField("To, s", { placeholder: "end", size: 9, onchange: () => typed() });
    const calm = button("", () => {}, { className: "main", hidden: true });
    const zoom = button("Zoom to it", () => look(range()));
    const whole = button("Zoom out", () => look(null));
    const clear = button("Take all of it", () => setRange(null, null));
    const next = button("Identify its noise", () => ctx.open("noise", { axis: 0 }), { className: "main" });
    const findings = el("section");
    const plots = el("div");

    const chosen = el(
      "section",
      { hidden: true },
      el("h2", null, "The part that counts"),
      el("p", { className: "hint" }, "Drag over a trace, or type seconds from the start of the log."),
      el("div", { className: "row" }, from, to),
      el("div", { className: "row" }, calm, zoom, whole, clear),
      el("div", { className: "row" }, next),
    );
    fill(
      root,
      el(
        "div",
        { className: "controls" },
        offer,
        el(
          "section",
          null,
          logs,
          field("Add files", file, "Or drop them on the page. They are copied into the folder."),
          problem,
          facts,
          how,
        ),
        chosen,
        job,
      ),
      el("div", { className: "figures" }, plots, findings),
    );

    function none() {
      return Object.fromEntries(READING.map((key) => [key, null]));
    }

    /** @param {Record<string, any>} values */
    function again(values) {
      state.set(values, true);
      open();
    }

    async function add() {
      for (const one of file.files ?? []) {
        try {
          announce(`uploading ${one.name}`);
          await api.upload(one.name, one);
          await ctx.refresh();
          ctx.open("log", { log: one.name, from: null, to: null, ...none() });
        } catch (error) {
          fail(/** @type {Error} */ (error));
        }
      }
      file.value = "";
    }

    /** @param {Error} error */
    function fail(error) {
      problem.hidden = false;
      problem.textContent = error.message;
    }

    async function example() {
      try {
        await api.run(
          "simulate",
          { params: "draft:example", output: EXAMPLE_LOG, duration: EXAMPLE_LENGTH, no_truth: true },
          { drafts: { example: EXAMPLE }, onJob: job.update },
        );
        await ctx.refresh();
        ctx.open("log", { log: EXAMPLE_LOG });
      } catch (error) {
        job.fail(/** @type {Error} */ (error));
      }
    }

    function list() {
      const found = ctx.project.files.filter(({ kind }) => kind === "log");
      const log = state.get("log") || (found.length === 1 ? found[0].name : "");
      logs.set(
        [
          ["", found.length ? "choose a log" : "no log yet"],
          ...found.map((it) => /** @type {[string, string]} */ ([it.name, `${it.name} (${size(it.size)})`])),
        ],
        log,
      );
      logs.hidden = found.length === 0;
      file.disabled = ctx.project.read_only;
      const start = el(
        "div",
        { className: "row" },
        ctx.project.read_only || found.some(({ name }) => name === EXAMPLE_LOG)
          ? null
          : button("Simulate an example", example, { className: found.length ? "" : "main" }),
        button("Tour of a minute", () => ctx.tour()),
      );
      fill(
        offer,
        found.length ? null : el("h2", null, "No log in this folder yet"),
        found.length
          ? null
          : el(
              "p",
              null,
              "Add a log of your sensor at rest, or begin with a simulated one: a MEMS gyro of three " +
                "axes, 20 min at 100 Hz.",
            ),
        state.get("log") && found.length ? null : start,
      );
      if (log && !state.get("log")) state.set({ log });
    }

    /** @returns {[number, number] | null} */
    function range() {
      const [a, b] = [state.number("from"), state.number("to")];
      return head && (a !== undefined || b !== undefined) ? [a ?? 0, b ?? head.seconds] : null;
    }

    /** @param {number | null} a @param {number | null} b */
    function setRange(a, b) {
      state.set({ from: a, to: b }, true);
      showRange();
    }

    function typed() {
      /** @param {HTMLInputElement} input */
      const value = (input) => (input.value.trim() === "" ? null : Number(input.value.replace(",", ".")));
      const [a, b] = [value(from.input), value(to.input)];
      const wrong = [a, b].some((v) => v !== null && !(v >= 0)) || (a ?? 0) >= (b ?? Infinity);
      [from.input, to.input].forEach((input) => input.setAttribute("aria-invalid", `${wrong}`));
      if (wrong) return announce("expected seconds, the first before the second");
      setRange(a, b);
    }

    function showRange() {
      from.input.value = state.get("from");
      to.input.value = state.get("to");
      [from.input, to.input].forEach((input) => input.setAttribute("aria-invalid", "false"));
      const part = range();
      zoom.disabled = !part;
      clear.disabled = !part;
      whole.disabled = !view;
      traces.forEach((trace, axis) =>
        trace.set(seen[axis] ?? [], { marks: marks(axis), xRange: view ?? [0, head?.seconds ?? 1] }),
      );
    }

    /** @type {import("./plot.js").Line[][]} */
    let seen = [];

    /** @param {number} axis */
    function marks(axis) {
      if (!head) return [];
      const name = head.axes[axis];
      const found = head.check.findings.filter(
        (/** @type {any} */ f) => f.kind !== "calm" && f.first_s > 0 && (f.axis === null || f.axis === name),
      );
      /** @type {import("./plot.js").Mark[]} */
      const out = found.map((/** @type {any} */ f) => ({ x: f.first_s, text: f.message, serious: f.serious }));
      const part = range();
      if (part) out.push({ x: part[0], x2: part[1], text: `chosen: ${number(part[0])} s to ${number(part[1])} s` });
      return out;
    }

    /** @param {[number, number] | null} part */
    function look(part) {
      view = part;
      trace();
    }

    const fetched = api.latest(
      (/** @type {{log: string, whole: any, n: number, part: [number, number] | null, points: number}} */ it) =>
        Promise.all(
          Array.from({ length: it.n }, (_, axis) =>
            api.series(it.log, { axis, from: it.part?.[0], to: it.part?.[1], points: it.points, reading: it.whole }),
          ),
        ),
      (all) => {
        seen = all.map(({ x, low, high }, axis) => [
          { name: head?.axes[axis] ?? "", x, y: low, low, high, kind: "band", colour: 1 },
        ]);
        showRange();
      },
      fail,
    );

    function trace() {
      if (!head || !traces.length) return;
      fetched({
        log: state.get("log"),
        whole: reading(true),
        n: traces.length,
        part: view,
        points: Math.max(200, traces[0].width() - 70),
      });
    }

    function calmPart() {
      const found = head?.check.findings.find((/** @type {any} */ f) => f.kind === "calm");
      calm.hidden = !found;
      if (!found || !head) return;
      // the check gives its first sample and how many
      const [a, b] = [
        Math.ceil(found.first_s * 10) / 10,
        Math.floor((found.first_s + found.count / head.rate) * 10) / 10,
      ];
      const end = b >= head.seconds - 0.1 ? null : b;
      calm.textContent = `Take the calm part: ${number(a)} s to ${end === null ? "the end" : `${number(b)} s`}`;
      calm.onclick = () => setRange(a > 0 ? a : null, end);
    }

    async function open() {
      const log = state.get("log");
      const key = JSON.stringify([log, reading(true), ctx.project.files.find(({ name }) => name === log)?.modified]);
      for (const [part, name] of /** @type {[any, string][]} */ ([
        [unit, "unit"],
        [rate, "rate"],
        [columns, "columns"],
        [time, "time"],
        [sensor, "sensor"],
      ])) {
        part.input.value = state.get(name);
      }
      if (key === drawn) return showRange();
      drawn = key;
      view = null;
      head = null;
      chosen.hidden = true;
      problem.hidden = true;
      traces.forEach((one) => one.destroy());
      traces = [];
      fill(plots);
      fill(findings);
      fill(facts);
      how.hidden = !log;
      if (!log) return;
      facts.textContent = `Reading ${log} …`;
      announce(`reading ${log}`);
      topics(log);
      try {
        const read = await api.head(log, reading(true));
        if (drawn !== key) return;
        head = read;
      } catch (error) {
        if (drawn !== key) return;
        fill(facts);
        fail(/** @type {Error} */ (error));
        const missing = /** @type {import("./api.js").ApiError} */ (error).missing ?? [];
        if (missing.length) how.open = true;
        /** @type {Record<string, {input: HTMLElement}>} */
        const fields = { unit, rate, columns, time, topic, sensor };
        const first = fields[missing[0]];
        first?.input.focus();
        return;
      }
      const { check, axes, rate: hz, seconds, unit: shown } = head;
      facts.textContent =
        `${check.samples} samples, ${number(hz)} Hz, ${duration(seconds)}, ` +
        `${axes.length} ${axes.length === 1 ? "axis" : "axes"} in ${shown}`;
      announce(facts.textContent);
      chosen.hidden = false;
      traces = axes
        .slice(0, MOST_AXES)
        .map((/** @type {string} */ name, /** @type {number} */ i, /** @type {string[]} */ all) =>
          figure({
            title: name,
            x: "time from the start (s)",
            bare: i + 1 < all.length,
            y: shown,
            height: i + 1 < all.length ? 150 : 170,
            sync: "log",
            legend: false,
            onRange: (a, b) =>
              setRange(Math.max(0, Number(a.toPrecision(5))), Number(Math.min(b, seconds).toPrecision(5))),
            onReset: () => setRange(null, null),
            onSize: trace,
          }),
        );
      fill(plots, traces);
      calmPart();
      fill(
        findings,
        el("h2", null, "What the check found"),
        check.findings.length === 0
          ? el("p", null, "Nothing: no gaps, no repeated or stuck values, no outliers, at rest.")
          : table({
              caption: "findings of the check",
              visible: false,
              numeric: false,
              head: ["Kind", "Axis", "From", "What"],
              rows: check.findings.map((/** @type {any} */ f) => [
                el("span", { className: f.serious ? "bad" : "" }, f.serious ? `${f.kind}, serious` : f.kind),
                f.axis ?? "all",
                f.first_s > 0 ? `${number(f.first_s)}\u00a0s` : "",
                f.message.replace(/`(\w+)`/g, "$1"),
              ]),
            }),
      );
      trace();
    }

    /** Tables of a file with several. @param {string} log */
    async function topics(log) {
      try {
        const done = await api.run("info", { log });
        job.update(done);
        const info = await api.document_(done.id);
        const tables = info.topics.filter((/** @type {any} */ it) => it.name && it.rows > 0);
        topic.hidden = tables.length < 2;
        topic.set(
          [
            ["", "found by name"],
            ...tables.map((/** @type {any} */ it) => [
              it.name,
              `${it.name}${it.kind ? `, ${it.kind}` : ""}: ${it.rows} rows` +
                (it.rate_hz ? `, ${number(it.rate_hz)} Hz` : ""),
            ]),
          ],
          state.get("topic"),
        );
      } catch {
        // the reading itself says what is wrong with the file
        topic.hidden = true;
      }
    }

    const fresh = () => {
      list();
      open();
    };
    fresh();
    return fresh;
  },
};
