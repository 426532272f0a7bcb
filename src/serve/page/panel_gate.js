// Many simulated runs: does the filter's covariance tell the truth? A verdict comes when all planned runs are done, for
// looking again and again would raise the probability of a false alarm that is promised.

import * as api from "./api.js";
import * as state from "./state.js";
import {
  announce,
  button,
  checkField,
  details,
  duration,
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
import { failed, filesOf, heading, testTable } from "./panel_replay.js";
import { figure } from "./plot.js";

/** @typedef {ReturnType<typeof figure>} Figure */

/** Key, label, hint, what stands there at first. @type {[string, string, string, string][]} */
const TEXTS = [
  ["runs", "Planned runs", "", "1000"],
  ["duration", "Length of a run", "empty: as long as the filter needs", ""],
  ["seed", "Seed", "", "1"],
  ["alpha", "Probability of a false alarm", "over all tests and axes together", "0.01"],
];
const NUMBERS = ["seed", "alpha"];

/** @type {import("./app.js").Panel} */
export const panel = {
  id: "gate",
  title: "Gate",
  show(root, ctx) {
    /** @param {string} key */
    const own = (key) => state.get(`gate.${key}`);
    /** @param {string} kind */
    const names = (kind) => filesOf(ctx, kind);
    const filter = selectField("Filter", [], { onchange: (name) => state.set({ "gate.filter": name }) });
    const truth = selectField("Truth", [], {
      hint: "what is simulated",
      onchange: (name) => state.set({ "gate.truth": name }),
    });
    const fields = TEXTS.map(([key, label, hint, value]) => ({
      key,
      value,
      it: textField(label, { hint: hint || undefined, value: own(key) || value }),
    }));
    const spread = checkField("draw the parameters of every run from their intervals", own("truth_spread") === "true");
    const job = jobView({ brief: true });
    const start = button("Simulate", () => run(), { className: "main" });
    const left = el("p", { className: "hint" });
    const more = el("div");
    const results = el("div", { className: "figures" });
    const empty = el("p", { className: "hint" }, "No filter is in this folder yet: design one, and save it.");
    fill(
      root,
      el(
        "div",
        { className: "controls" },
        el("h2", null, "Gate"),
        empty,
        filter,
        fields.slice(0, 1).map(({ it }) => it),
        details(
          "Options",
          fields.slice(1).map(({ it }) => it),
          truth,
          spread,
        ),
        start,
        left,
        job,
        more,
      ),
      results,
    );

    function request() {
      const given = fields
        .map(({ key, value, it }) => [key, it.input.value.trim() || value])
        .filter(([, v]) => v)
        .map(([key, v]) => [key, NUMBERS.includes(key) ? Number(v) : v]);
      return {
        filter: filter.input.value,
        ...Object.fromEntries(given),
        ...(truth.input.value ? { truth: truth.input.value } : {}),
        ...(spread.input.checked ? { truth_spread: true } : {}),
      };
    }

    let began = 0;
    /** @param {api.Job} now */
    function progress(now) {
      job.update(now);
      if (now.state !== "running" || !now.parts) {
        left.textContent = "";
        return;
      }
      if (now.stage !== "runs") {
        left.textContent = "All runs are done; they are judged.";
        return;
      }
      began ||= Date.now();
      const planned = Number(fields[0].it.input.value);
      const runs = Math.floor((planned * now.done) / now.parts);
      const seconds = ((Date.now() - began) / 1000) * (now.parts / Math.max(now.done, 1) - 1);
      const rest = now.done ? `, ${duration(seconds)} left` : "";
      left.textContent = `${runs} of ${planned} runs are done${rest}. The verdict comes with the last one.`;
    }

    async function run() {
      const asked = request();
      state.set({
        ...Object.fromEntries(fields.map(({ key, it }) => [`gate.${key}`, it.input.value.trim()])),
        "gate.filter": filter.input.value,
        "gate.truth": truth.input.value,
        "gate.truth_spread": spread.input.checked ? "true" : "",
      });
      start.disabled = true;
      began = 0;
      job.clear();
      fill(results);
      fill(more);
      try {
        await show(await api.run("montecarlo", asked, { onJob: progress }));
      } catch (error) {
        failed(job, error);
      }
      left.textContent = "";
      start.disabled = false;
    }

    /** @type {Figure[]} */
    let drawn = [];

    /** @param {api.Job} done */
    async function show(done) {
      job.update(done);
      const result = await api.document_(done.id);
      drawn.forEach((old) => old.destroy());
      drawn = [];
      fill(more, exportMenu(done, { stem: "montecarlo", readOnly: ctx.project.read_only }));
      announce(`${result.verdict}: ${result.meaning}`);
      const rate = result.false_alarm_rate;
      const seed = result.seed;
      const detects = result.detects ?? [];
      fill(
        results,
        heading(result),
        el(
          "p",
          null,
          `Runs ${result.runs.first} to ${result.runs.end - 1}, ${duration(result.duration_s)} each, seed ${seed}.`,
          rate ? ` A true filter fails this gate with probability ${number(100 * rate.value, 3)} %.` : "",
        ),
        testTable(result.tests),
        detects.length
          ? details(
              "What this gate sees with 90 % probability",
              table({
                caption: "Smallest mistuning that is caught",
                head: ["axis", "parameter", "filter too large by", "too small by"],
                rows: detects.map((/** @type {any} */ it) => [
                  it.axis,
                  it.parameter,
                  size(it, it.too_large),
                  size(it, it.too_small),
                ]),
              }),
            )
          : null,
      );
      for (const axis of result.axes) {
        const section = el("section", { className: "pair" });
        results.append(section);
        const { time_s: all, mean, expected, lower, upper } = axis.nees;
        // a logarithmic axis has no zero
        const from = all[0] > 0 ? 0 : 1;
        const x = all.slice(from);
        add(
          section,
          figure({
            title: `${axis.name}: mean NEES of each component`,
            x: "time (s)",
            y: "NEES",
            xLog: true,
            sync: "gate",
          }),
          [
            {
              name: "where a true filter stays",
              x,
              y: x.map(() => upper),
              low: x.map(() => lower),
              high: x.map(() => upper),
              kind: "band",
              colour: 2,
            },
            { name: "mean NEES", x, y: mean.slice(from), colour: 1, width: 2 },
            { name: "expected", x, y: expected.slice(from), colour: 2, dash: 1 },
          ],
        );
        for (const error of axis.errors) {
          const [unit, factor] = shownUnit(error.unit);
          /** @param {number[]} values */
          const inUnit = (values) => values.slice(from).map((v) => v * factor);
          add(
            section,
            figure({
              title: `${axis.name}: error of ${error.name}`,
              x: "time (s)",
              y: `rms (${unit})`,
              xLog: true,
              yLog: true,
              sync: "gate",
            }),
            [
              { name: "rms of the runs", x, y: inUnit(error.rms), colour: 1, width: 2 },
              { name: "what the filter says", x, y: inUnit(error.predicted_sigma), colour: 2, dash: 1 },
            ],
          );
        }
      }
    }

    /** @param {any} it @param {any} side */
    const size = (it, side) =>
      !side
        ? "not seen"
        : it.measure === "factor"
          ? `${number(100 * Math.abs(side.size - 1), 3)} %`
          : number(side.size, 3);

    /** @param {Element} section @param {Figure} made @param {import("./plot.js").Line[]} lines */
    function add(section, made, lines) {
      section.append(made);
      made.set(lines);
      drawn.push(made);
    }

    function again() {
      filter.set(names("filter"), own("filter") || filter.input.value);
      truth.set([["", "as the filter says"], ...names("params")], own("truth") || truth.input.value);
      empty.hidden = !!filter.input.value;
      start.disabled = !filter.input.value;
    }
    again();
    // one that runs, or was done, before the page was loaded anew
    const asked = JSON.stringify(request());
    const before = [...ctx.project.jobs]
      .reverse()
      .find((it) => it.command === "montecarlo" && JSON.stringify(it.request) === asked);
    if (before?.state === "done") show(before).catch(job.fail);
    else if (before && ["waiting", "running"].includes(before.state))
      api.follow(before, progress).then(show).catch(job.fail);
    return again;
  },
};
