// A recorded log through a filter: estimates, innovations, and the tests that judge them.

import * as api from "./api.js";
import * as state from "./state.js";
import {
  announce,
  button,
  checkField,
  details,
  el,
  exportMenu,
  fill,
  jobView,
  number,
  selectField,
  table,
  textField,
} from "./ui.js";
import { shownUnit } from "./panel_design.js";
import { reading as logReading } from "./panel_log.js";
import { figure } from "./plot.js";

/**
 * @typedef {{axis: string, name: string, statistic: number, lower: number, upper: number, adjusted_p_value: number,
 *   pass: boolean, meaning: string}} Test
 * @typedef {{name: string, unit: string, samples_per_point: number, autocorrelation: number[],
 *   autocorrelation_bound: number, cumulative_periodogram: [number, number][], periodogram_bound: number,
 *   trace: Record<"time_s" | "measured" | "estimate" | "sigma" | "innovation" | "lowest" | "highest", number[]>,
 *   nis_histogram: {edges: number[], observed: number[], expected: number[]}}} Curves
 */

/** Fields that every request may have: key, label, hint. @type {[string, string, string][]} */
const TEXTS = [
  ["aid", "Columns of aids", "heading=yaw:deg; several with spaces between"],
  ["alpha", "Probability of a false alarm", "0.01 over all tests together"],
  ["gate", "Reject beyond (sigma)", "empty: nothing is rejected"],
  ["follow", "Follow the noise over", "20min: for a sensor at rest"],
];
/** Of these the log may say nothing. @type {[string, string, string][]} */
const READING = [
  ["columns", "Columns", "names or numbers, with commas between"],
  ["unit", "Unit", "deg/s, mdps, 1/131 deg/s …"],
  ["rate", "Sample rate (Hz)", "where there is no time column"],
  ["topic", "Topic", ""],
  ["start", "From", "10min, from the start of the log"],
  ["end", "To", ""],
];
/** Innovations over their sigma leave ±3 once in 370 samples. */
const BOUND = 3;

/** Files of these kinds, those of the folder itself first. @param {import("./app.js").Context} ctx
 * @param {...string} kinds */
export function filesOf(ctx, ...kinds) {
  const all = ctx.project.files.filter(({ kind }) => kinds.includes(kind)).map(({ name }) => name);
  return all.sort((a, b) => a.split("/").length - b.split("/").length);
}

/** What the job itself has not said. @param {{fail: (error: Error) => void}} job @param {any} error */
export function failed(job, error) {
  if (error.status !== 499) job.fail(error);
}

/** A verdict with what it means. @param {{verdict: string, meaning: string}} it */
export const heading = ({ verdict, meaning }) => [
  el("h2", { className: verdict === "consistent" ? "good" : "bad" }, verdict),
  el("p", null, meaning),
];

/** Failed ones first. @param {Test[]} tests @param {(test: Test) => void} [where] shows what a failed one is about */
export function testTable(tests, where) {
  const rows = [...tests]
    .sort((a, b) => Number(a.pass) - Number(b.pass))
    .map((it) => {
      const what = `${it.axis}: ${it.meaning}`;
      const show = where && button("Where", () => where(it), { "aria-label": `Where: ${what}` });
      const result = it.pass ? "pass" : el("span", { className: "bad" }, "FAIL ", show);
      const expected = `${number(it.lower)} to ${number(it.upper)}`;
      return [what, number(it.statistic), expected, number(it.adjusted_p_value, 3), result];
    });
  const head = ["test", "statistic", "expected", "p", "result"];
  return rows.length ? table({ caption: "Tests; p over all tests together", head, rows }) : el("p", null, "No test.");
}

/** @type {import("./app.js").Panel} */
export const panel = {
  id: "replay",
  title: "Replay",
  show(root, ctx) {
    /** @param {string} key */
    const own = (key) => state.get(`replay.${key}`);
    /** @param {...string} kinds */
    const names = (...kinds) => filesOf(ctx, ...kinds);
    const filter = selectField("Filter", [], { onchange: (name) => state.set({ "replay.filter": name }) });
    const log = selectField("Log", [], { onchange: (name) => state.set({ "replay.log": name }) });
    const form = selectField(
      "Covariance",
      [
        ["joseph", "Joseph"],
        ["square-root", "square root"],
        ["constant-gain", "constant gain"],
      ],
      { value: own("form") || "joseph" },
    );
    /** What the Log panel knows of the same log. @type {Record<string, any>} */
    const known = !own("log") || own("log") === state.get("log") ? logReading(true) : {};
    /** @param {[string, string, string][]} all */
    const texts = (all) =>
      all.map(([key, label, hint]) => ({
        key,
        it: textField(label, {
          hint,
          value: own(key) || `${known[key] ?? ""}`,
        }),
      }));
    const options = texts(TEXTS);
    const reading = texts(READING);
    const clip = checkField("count outliers beyond the gate as at the gate", own("clip") === "true");
    const job = jobView({ brief: true });
    const start = button("Replay", () => run(), { className: "main" });
    const more = el("div");
    const verdict = el("div", { "aria-live": "polite" });
    const tests = el("div");
    const axes = selectField("Axis", []);
    const charts = el("div", { className: "pair" });
    const shown = el("p", { className: "hint" });
    const figures = el(
      "div",
      { className: "figures" },
      verdict,
      tests,
      el("div", { className: "row" }, axes),
      shown,
      charts,
    );
    const empty = el("p", { className: "hint" }, "No filter is in this folder yet: design one, and save it.");
    fill(
      root,
      el(
        "div",
        { className: "controls" },
        el("h2", null, "Replay"),
        empty,
        filter,
        log,
        details(
          "Options",
          options.map(({ it }) => it),
          clip,
          form,
        ),
        details(
          "How the log is read",
          reading.map(({ it }) => it),
        ),
        start,
        job,
        more,
      ),
      figures,
    );

    function request() {
      const number_ = ["alpha", "gate", "rate"];
      /** @param {{key: string, it: {input: HTMLInputElement}}[]} all */
      const given = (all) =>
        Object.fromEntries(
          all
            .map(({ key, it }) => [key, it.input.value.trim()])
            .filter(([, v]) => v)
            .map(([key, v]) => [
              key,
              number_.includes(key)
                ? Number(v)
                : key === "columns"
                  ? v.split(",").map((c) => c.trim())
                  : key === "aid"
                    ? v.split(/\s+/)
                    : v,
            ]),
        );
      const { gate, ...rest } = given(options);
      const limit = gate === undefined ? {} : clip.input.checked ? { clip: gate } : { gate };
      const read = given(reading);
      return {
        filter: filter.input.value,
        log: log.input.value,
        ...rest,
        ...limit,
        ...(form.input.value === "joseph" ? {} : { form: form.input.value }),
        ...(Object.keys(read).length ? { reading: read } : {}),
      };
    }

    function remember() {
      const all = Object.fromEntries(
        [...options, ...reading].map(({ key, it }) => [`replay.${key}`, it.input.value.trim()]),
      );
      state.set({
        ...all,
        "replay.filter": filter.input.value,
        "replay.log": log.input.value,
        "replay.form": form.input.value,
        "replay.clip": clip.input.checked ? "true" : "",
      });
    }

    async function run() {
      remember();
      start.disabled = true;
      job.clear();
      try {
        await show(await api.run("replay", request(), { onJob: job.update }));
      } catch (error) {
        failed(job, error);
      }
      start.disabled = false;
    }

    /** @type {Curves[]} */
    let curves = [];
    /** @type {ReturnType<typeof figure>[]} */
    let drawn = [];
    /** @type {[number, number] | null} */
    let range = null;

    /** @param {api.Job} done */
    async function show(done) {
      job.update(done);
      const result = await api.document_(done.id);
      fill(more, exportMenu(done, { stem: "replay", readOnly: ctx.project.read_only }));
      fill(verdict, heading(result));
      curves = done.has.includes("curves") ? (await api.document_(done.id, "curves")).axes : [];
      fill(tests, testTable(result.tests ?? [], curves.length ? where : undefined));
      axes.hidden = curves.length < 2;
      axes.set(
        curves.map(({ name }) => name),
        own("axis"),
      );
      const [from, to] = [state.number("replay.from"), state.number("replay.to")];
      range = from === undefined || to === undefined ? null : [from, to];
      draw();
    }

    /** To the stretch that says most against the filter: the start, or where averaged innovations are largest.
     * @param {Test} test */
    function where(test) {
      const axis = curves.find(({ name }) => name === test.axis) ?? curves[0];
      const { time_s, innovation } = axis.trace;
      let worst = 0;
      if (test.name !== "start")
        innovation.forEach((v, i) => {
          if (Math.abs(v) > Math.abs(innovation[worst])) worst = i;
        });
      const span = time_s[time_s.length - 1] - time_s[0];
      const half = Math.max(span / 20, 3 * (time_s[1] - time_s[0]));
      axes.input.value = axis.name;
      zoom([Math.max(time_s[0], time_s[worst] - half), Math.min(time_s[time_s.length - 1], time_s[worst] + half)]);
      announce(`${axis.name}, ${number(time_s[worst])} s: ${number(innovation[worst], 3)} sigma`);
      charts.scrollIntoView({ block: "nearest" });
    }

    /** @param {[number, number] | null} to */
    function zoom(to) {
      range = to;
      state.set({
        "replay.from": to && state.digits4(to[0]),
        "replay.to": to && state.digits4(to[1]),
        "replay.axis": axes.input.value,
      });
      draw();
    }

    function draw() {
      drawn.forEach((old) => old.destroy());
      drawn = [];
      fill(charts);
      const axis = curves.find(({ name }) => name === axes.input.value) ?? curves[0];
      fill(
        shown,
        axis && range ? [`${number(range[0])} to ${number(range[1])} s `, button("Whole log", () => zoom(null))] : null,
      );
      if (!axis) return;
      const { trace } = axis;
      const x = trace.time_s;
      const [unit, factor] = shownUnit(axis.unit);
      /** @param {number[]} values */
      const inUnit = (values) => values.map((v) => v * factor);
      const [estimate, sigma, measured] = [trace.estimate, trace.sigma, trace.measured].map(inUnit);
      /** @param {string} title @param {string} y @param {import("./plot.js").Line[]} lines */
      const inTime = (title, y, lines) => {
        const made = figure({
          title,
          x: "time (s)",
          y,
          sync: "replay",
          xRange: range,
          onRange: (a, b) => zoom([a, b]),
          onReset: () => zoom(null),
        });
        add(made, lines);
      };
      /** @param {ReturnType<typeof figure>} made @param {import("./plot.js").Line[]} lines */
      const add = (made, lines) => {
        charts.append(made);
        made.set(lines);
        drawn.push(made);
      };
      const many = axis.samples_per_point > 1;
      inTime(`${axis.name}: estimate`, unit, [
        {
          name: many ? `log, mean of ${axis.samples_per_point} samples` : "log",
          x,
          y: measured,
          faint: true,
          colour: 3,
          dash: 2,
        },
        {
          name: "± 3 sigma",
          x,
          y: estimate,
          low: estimate.map((v, i) => v - BOUND * sigma[i]),
          high: estimate.map((v, i) => v + BOUND * sigma[i]),
          kind: "band",
          colour: 1,
        },
        { name: "estimate", x, y: estimate, colour: 1, width: 2 },
      ]);
      /** @param {number[]} at @param {number} half @param {string} name @returns {import("./plot.js").Line} */
      const between = (at, half, name) => {
        const ends = [at[0], at[at.length - 1]];
        const [low, high] = [
          [-half, -half],
          [half, half],
        ];
        return { name, x: ends, y: high, low, high, kind: "band", colour: 2 };
      };
      const bounds = between(x, BOUND, "within 3 sigma");
      inTime(`${axis.name}: innovations over their sigma`, "sigma", [
        {
          name: "least and greatest",
          x,
          y: trace.highest,
          low: trace.lowest,
          high: trace.highest,
          kind: "band",
          colour: 1,
        },
        bounds,
      ]);
      if (many) {
        inTime(
          `${axis.name}: means of ${axis.samples_per_point} innovations, times the root of ${axis.samples_per_point}`,
          "sigma",
          [{ name: "averaged innovation", x, y: trace.innovation, colour: 1 }, bounds],
        );
      }
      const lags = axis.autocorrelation.map((_, i) => i + 1);
      if (lags.length) {
        add(
          figure({
            title: `${axis.name}: autocorrelation of the innovations`,
            x: "lag (samples)",
            y: "correlation",
            height: 220,
          }),
          [
            { name: "autocorrelation", x: lags, y: axis.autocorrelation, colour: 1 },
            between(lags, axis.autocorrelation_bound, "bound of one lag"),
          ],
        );
      }
      const spectrum = axis.cumulative_periodogram;
      if (spectrum.length) {
        const f = spectrum.map(([frequency]) => frequency);
        const white = f.map((v) => v / f[f.length - 1]);
        add(
          figure({
            title: `${axis.name}: cumulative periodogram of slow innovations`,
            x: "frequency (Hz)",
            y: "share of power",
            height: 220,
          }),
          [
            {
              name: "band of white innovations",
              x: f,
              y: white,
              low: white.map((v) => v - axis.periodogram_bound),
              high: white.map((v) => v + axis.periodogram_bound),
              kind: "band",
              colour: 2,
            },
            { name: "innovations", x: f, y: spectrum.map(([, share]) => share), colour: 1 },
          ],
        );
      }
      const { edges, observed, expected } = axis.nis_histogram;
      const left = edges.slice(0, observed.length);
      if (left.length) {
        add(
          figure({ title: `${axis.name}: NIS`, x: "innovation squared over its variance", y: "share", height: 220 }),
          [
            { name: "observed", x: left, y: observed, kind: "steps", colour: 1 },
            { name: "expected", x: left, y: expected, kind: "steps", colour: 2, dash: 1 },
          ],
        );
      }
    }
    axes.input.addEventListener("change", () => zoom(range));

    function again() {
      filter.set(names("filter", "attitude"), own("filter") || filter.input.value);
      log.set(names("log"), own("log") || log.input.value || state.get("log"));
      const ready = !!filter.input.value && !!log.input.value;
      empty.hidden = ready;
      empty.textContent = filter.input.value
        ? "No log is in this folder: drop one on the page."
        : "No filter is in this folder yet: design one, and save it.";
      start.disabled = !ready;
    }
    again();
    // what was replayed before the page was loaded anew is still there
    const asked = JSON.stringify(request());
    const before = [...ctx.project.jobs]
      .reverse()
      .find((it) => it.command === "replay" && it.state === "done" && JSON.stringify(it.request) === asked);
    if (before) show(before).catch(job.fail);
    return again;
  },
};
