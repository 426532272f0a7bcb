// Compare: up to six designs in the same axes.

import { FOUND, kept } from "./panel_noise.js";
import { sigmaLine } from "./panel_design.js";
import { figure } from "./plot.js";
import { reading } from "./panel_log.js";
import * as api from "./api.js";
import * as state from "./state.js";
import { announce, button, el, fill, jobView, number, selectField, table } from "./ui.js";

/** As many as there are colours and dashes. */
const MOST = 6;
const STORE = "pinned";
/** As the command line has them: the last third is foretold; states of flicker cover so many seconds. */
const HELD_OUT = 1 / 3;
const SLOWEST = 1e4;

/** @typedef {{name: string, plant: string, axes: import("./panel_design.js").AxisResult[], verdict: string,
 *   params: any, unsaved: any, view: Record<string, string>, colour?: number,
 *   against?: {log: string, verdict: string, likelihood: number}}} Pin */

/** @returns {Pin[]} */
const pins = () => kept(STORE) ?? [];

/** @param {Pin[]} all */
function store(all) {
  kept(STORE, all);
  state.set({ pins: all.map(({ name }) => name).join("|") }, true);
}

/** Pins a design; what is refused is said. @param {Pin} design @returns {string | null} */
export function pin(design) {
  const all = pins();
  const same = all.findIndex(({ name }) => name === design.name);
  if (same < 0 && all.length >= MOST) return `six are pinned: delete one in Compare first`;
  const used = new Set(all.map(({ colour }) => colour));
  const colour = same < 0 ? [1, 2, 3, 4, 5, 6].find((n) => !used.has(n)) : all[same].colour;
  if (same < 0) all.push({ ...design, colour });
  else all[same] = { ...design, colour };
  store(all);
  return null;
}

/** @type {import("./app.js").Panel} */
export const panel = {
  id: "compare",
  title: "Compare",
  show(root, ctx) {
    /** What Delete took away. @type {{pin: Pin, at: number} | null} */
    let gone = null;
    const list = el("section");
    const undo = button(
      "Undo",
      () => {
        if (!gone) return;
        const all = pins();
        all.splice(gone.at, 0, gone.pin);
        gone = null;
        store(all.slice(0, MOST));
        show();
      },
      { hidden: true },
    );
    const axis = selectField("Axis", [], {
      onchange: (value) => {
        state.set({ axis: value }, true);
        show();
      },
    });
    const which = selectField("State", [], {
      onchange: (value) => {
        state.set({ state: value }, true);
        show();
      },
    });
    const log = selectField("Log", [], { onchange: (value) => state.set({ "compare.log": value }) });
    const problem = el("p", { className: "error", role: "alert", hidden: true });
    const job = jobView();
    const against = button("Put the noise models to this log", judge);
    const judged = el(
      "section",
      null,
      el("h2", null, "Against a log"),
      log,
      el("div", { className: "row" }, against),
      job,
      problem,
    );
    const plot = figure({
      title: "Predicted standard deviation σ(t)",
      x: "time (s)",
      y: "",
      xLog: true,
      yLog: true,
      height: 380,
    });
    const tables = el("section");
    fill(
      root,
      el("div", { className: "controls" }, list, el("div", { className: "row" }, undo), axis, which, judged),
      el("div", { className: "figures" }, plot, tables),
    );

    /** @param {Pin[]} all */
    function names(all) {
      fill(
        list,
        el("h2", null, "Pinned designs"),
        all.length
          ? null
          : el(
              "p",
              null,
              "None yet. ",
              button("Make one in Design", () => ctx.open("design")),
            ),
        el(
          "ul",
          { className: "files" },
          all.map((it, at) => {
            const name = el("input", {
              type: "text",
              value: it.name,
              "aria-label": `name of ${it.name}`,
              size: 11,
              onchange: () => {
                const next = name.value.trim().replaceAll("|", " ");
                if (!next || all.some((other) => other !== it && other.name === next)) {
                  name.value = it.name;
                  return announce("a name must be there, and once only");
                }
                it.name = next;
                store(all);
                show();
              },
            });
            return el(
              "li",
              { className: "row" },
              name,
              button("Open", () => open(it), { "aria-label": `Open ${it.name} in Design` }),
              button(
                "Delete",
                () => {
                  gone = { pin: it, at };
                  all.splice(at, 1);
                  store(all);
                  announce(`deleted ${it.name}`);
                  show();
                  undo.focus();
                },
                { "aria-label": `Delete ${it.name}` },
              ),
            );
          }),
        ),
      );
      undo.hidden = !gone;
      undo.textContent = gone ? `Undo: bring ${gone.pin.name} back` : "Undo";
    }

    /** @param {Pin} it */
    function open(it) {
      if (it.unsaved) kept(FOUND, it.unsaved);
      ctx.open("design", it.view);
    }

    function show() {
      const all = pins();
      names(all);
      const any = all.length > 0;
      for (const part of [plot, axis, which, tables, judged]) part.hidden = !any;
      if (!any) return;
      const axes = [...new Set(all.flatMap((it) => it.axes.map(({ name }) => name)))];
      axis.set(
        axes.map((name, i) => /** @type {[string, string]} */ ([`${i}`, name])),
        state.get("axis", "0"),
      );
      axis.hidden = axes.length < 2;
      const at = axes[Number(axis.input.value)] ?? axes[0];
      /** @param {Pin} it */
      const own = (it) => it.axes.find(({ name }) => name === at) ?? it.axes[0];
      const states = new Map(all.flatMap((it) => own(it).states.map(({ name, unit }) => [name, unit])));
      which.set(
        [...states].map(([name, unit]) => /** @type {[string, string]} */ ([name, `${name} (${unit})`])),
        state.get("state") || [...states.keys()][0],
      );
      const name = which.input.value;
      plot.setAxis(`σ (${states.get(name) ?? ""})`);
      plot.set(
        all.flatMap((it) =>
          sigmaLine(own(it), name, { name: it.name, colour: it.colour, dash: (it.colour ?? 1) - 1, width: 2 }),
        ),
      );
      const head = ["Design", ...all.map((it) => it.name)];
      /** @param {Pin} it */
      const found = (it) => own(it).states.find((one) => one.name === name);
      const sources = [...new Set(all.flatMap((it) => found(it)?.budget.map((part) => part.name) ?? []))];
      fill(
        tables,
        table({
          caption: `${name}, axis ${at}`,
          head,
          rows: [
            ["Plant", ...all.map((it) => it.plant || "of the parameters")],
            ["σ at the start", ...all.map((it) => number(found(it)?.sigma[0]))],
            ["σ at the end", ...all.map((it) => number(found(it)?.sigma.at(-1)))],
            ["Settled after, s", ...all.map((it) => number(own(it).settling, 3))],
            ["Verdict", ...all.map((it) => it.verdict)],
            ...(all.some((it) => it.against)
              ? [
                  [
                    "Noise model against the log",
                    ...all.map((it) => (it.against ? `${it.against.verdict} (${it.against.log})` : "–")),
                  ],
                  ["ln L of the log's last third, foretold", ...all.map((it) => number(it.against?.likelihood, 9))],
                ]
              : []),
          ],
        }),
        sources.length
          ? table({
              caption: `Error budget of ${name}, steady, %`,
              head,
              rows: sources.map((source) => [
                source,
                ...all.map((it) => {
                  const part = found(it)?.budget.find((one) => one.name === source);
                  return part ? number(100 * part.share, 3) : "–";
                }),
              ]),
            })
          : null,
        table({
          caption: "σ at the end, every state",
          head: ["State", ...all.map((it) => it.name)],
          rows: [...states].map(([one, unit]) => [
            `${one} (${unit})`,
            ...all.map((it) =>
              number(
                own(it)
                  .states.find((s) => s.name === one)
                  ?.sigma.at(-1),
              ),
            ),
          ]),
        }),
      );
      log.set(
        ctx.project.files.filter(({ kind }) => kind === "log").map(({ name }) => name),
        state.get("compare.log") || state.get("log"),
      );
      against.disabled = !log.input.value;
    }

    async function judge() {
      problem.hidden = true;
      against.disabled = true;
      const all = pins();
      for (const it of all) {
        try {
          const name = log.input.value;
          const how = name === state.get("log") ? { reading: reading() } : {};
          // the log is of the sensor alone, whatever the plant is
          const drafts = { "params.json": { ...it.params, design: undefined } };
          /** @param {string} command @param {any} request */
          const told = async (command, request) =>
            api.document_((await api.run(command, { ...request, ...how }, { drafts, onJob: job.update })).id);
          const { verdict } = await told("compare", { params: "draft:params.json", log: name });
          const ranked = await told("rank", {
            files: ["draft:params.json", name],
            held_out: HELD_OUT,
            flicker_horizon: SLOWEST,
          });
          it.against = { log: name, verdict, likelihood: ranked.designs[0].held_out_log_likelihood };
        } catch (error) {
          problem.hidden = false;
          problem.textContent = `${it.name}: ${/** @type {Error} */ (error).message}`;
        }
      }
      store(all);
      announce("the noise models were put to the log");
      show();
    }

    show();
    return show;
  },
};
