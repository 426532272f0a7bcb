// Noise: Allan deviations, the model that was found, and what a person makes of it.

import { reading } from "./panel_log.js";
import { figure } from "./plot.js";
import * as state from "./state.js";
import {
  button,
  details,
  el,
  exportMenu,
  fill,
  jobView,
  measured,
  number,
  selectField,
  slider,
  table,
  textField,
  unitText,
} from "./ui.js";

/** What terms are called, and by which letter. @type {Record<string, string>} */
const TERMS = {
  quantization: "Quantisation Q",
  white: "White noise N",
  moving_average: "Moving average N",
  band_limit: "Band limit N",
  oscillation: "Oscillation",
  bias_instability: "Flicker B",
  gauss_markov: "Gauss-Markov",
  rate_random_walk: "Random walk K",
  rate_ramp: "Ramp R",
};
/** @type {Record<string, string>} */
const FIELDS = { density: "", coefficient: "", slope: "", std_dev: "σ", correlation_time: "Tc", frequency: "f" };
/** The amount of a term: what moves its line up and down. */
const AMOUNTS = ["density", "coefficient", "slope", "std_dev"];
/** A slider goes so far about the value that was found. */
const REACH = 8;
const METHODS = [
  ["likelihood", "maximum likelihood"],
  ["allan", "fit of the Allan curve"],
  ["gmwm", "wavelet moments (GMWM)"],
  ["graphical", "graphical"],
];
const DEVIATION_POINTS = 160;
/** A term that has so much of the deviation is as good as alone. */
const NEARLY = 0.98;
/** Between the last key and a refit, ms: longer than the repetition of a key that is held down. */
const KEYS_PAUSE = 350;

/** @typedef {{id: string, term: string, at: number, field: string, name: string, value: any}} Parameter
 * `id` as `hold` names it, `value` the document's own `{value, unit, interval}` */

/** The parameters of an axis of params.json. @param {any} axis @returns {Parameter[]} */
export function parameters(axis) {
  return Object.keys(TERMS)
    .filter((term) => axis[term])
    .flatMap((term) =>
      [axis[term]].flat().flatMap((one, at, all) =>
        Object.keys(FIELDS)
          .filter((field) => one[field])
          .map((field) => ({
            id: `${term}${at ? `[${at}]` : ""}.${field}`,
            term,
            at,
            field,
            value: one[field],
            name: `${TERMS[term]}${all.length > 1 ? ` ${at + 1}` : ""} ${FIELDS[field]}`.trim(),
          })),
      ),
    );
}

/** @param {string} key @param {any} [value] kept in this tab, over a reload */
export function kept(key, value) {
  try {
    if (value !== undefined) sessionStorage.setItem(key, JSON.stringify(value));
    return JSON.parse(sessionStorage.getItem(key) ?? "null");
  } catch {
    return null;
  }
}

/** The parameters that were found last, which need not be saved. */
export const FOUND = "identified";

/** @type {import("./app.js").Panel} */
export const panel = {
  id: "noise",
  title: "Noise",
  show(root, ctx) {
    const { api } = ctx;
    /** @type {any} */
    let result = null;
    /** @type {any} */
    let draft = null;
    /** @type {import("./api.js").Job | null} */
    let finished = null;
    let asked = "";
    /** Log and range. */
    let about = "";
    /** Under way. */
    let running = 0;
    let pause = 0;
    /** What a person holds, by axis and parameter, with its unit. @type {Map<string, string>} */
    let held = new Map();

    const method = selectField("Method", /** @type {[string, string][]} */ (METHODS), {
      value: state.get("method", "likelihood"),
      onchange: (value) => again({ method: value }),
    });
    const model = textField("Model", {
      value: state.get("model"),
      placeholder: "auto",
      onchange: (value) => again({ model: value }),
      hint: "auto, or terms: white+gm+rrw",
    });
    const outliers = el("input", {
      type: "checkbox",
      id: "without-outliers",
      checked: !!state.get("outliers"),
      onchange: () => again({ outliers: outliers.checked ? 1 : null }),
    });
    const axis = selectField("Axis", [], {
      onchange: (value) => {
        state.set({ axis: value }, true);
        showAxis();
      },
    });
    const job = jobView();
    const what = el("p");
    const sliders = el("div");
    const free = button(
      "Let all go",
      () => {
        held.clear();
        refit();
      },
      { hidden: true },
    );
    const cost = el("p", { role: "status" });
    const out = el("div");
    const design = button("Design a filter with it", () => ctx.open("design", { params: "" }), {
      className: "main",
      hidden: true,
    });
    const views = el(
      "div",
      { className: "row", role: "radiogroup", "aria-label": "What is drawn" },
      [
        ["allan", "Allan deviation"],
        ["spectrum", "Spectrum of the model"],
      ].map(([value, text]) => {
        const input = el("input", {
          type: "radio",
          name: "noise-view",
          id: `noise-${value}`,
          value,
          checked: state.get("view", "allan") === value,
          onchange: () => {
            state.set({ view: value === "allan" ? null : value }, true);
            pick();
          },
        });
        return el("span", { className: "check" }, input, el("label", { htmlFor: input.id }, text));
      }),
    );
    const plot = figure({
      title: "Allan deviation",
      x: "averaging time τ (s)",
      y: "",
      xLog: true,
      yLog: true,
      height: 420,
    });
    const spectrum = figure({
      title: "Root of the two-sided spectral density of the model",
      x: "frequency (Hz)",
      y: "",
      xLog: true,
      yLog: true,
      height: 420,
    });
    const candidates = el("section");
    const numbers = el("section");
    const axisRow = el("div", null, axis);
    fill(
      root,
      el(
        "div",
        { className: "controls" },
        what,
        el(
          "section",
          null,
          method,
          model,
          el("div", { className: "check" }, outliers, el("label", { htmlFor: outliers.id }, "Leave outliers out")),
          job,
        ),
        el("section", null, axisRow, sliders, cost, el("div", { className: "row" }, free)),
        el("section", null, design, out),
      ),
      el("div", { className: "figures" }, views, plot, spectrum, candidates, numbers),
    );

    const pick = () => {
      const other = state.get("view") === "spectrum";
      plot.hidden = other;
      spectrum.hidden = !other;
      if (result) ask();
    };

    /** @param {Record<string, any>} values */
    function again(values) {
      state.set(values, true);
      identify();
    }

    function request() {
      const hold = [...held].map(([id, value]) => `${id}=${value}`);
      return {
        logs: [state.get("log")],
        reading: reading(),
        method: state.get("method", "likelihood"),
        model: state.get("model", "auto"),
        ...(hold.length ? { hold } : {}),
        ...(state.get("outliers") ? { without_outliers: true } : {}),
      };
    }

    async function identify() {
      const log = state.get("log");
      method.input.value = state.get("method", "likelihood");
      model.input.value = state.get("model");
      fill(
        what,
        log
          ? ["Log ", el("strong", null, log), range()]
          : ["No log is chosen. ", button("Choose one", () => ctx.open("log"))],
      );
      if (!log) return;
      const now = request();
      const subject = JSON.stringify([log, now.reading]);
      if (result && subject !== about) {
        // of another log
        result = finished = null;
        [plot, spectrum].forEach((one) => one.set([]));
        plot.setHandles([]);
        [sliders, candidates, numbers, cost, out].forEach((part) => fill(part));
        design.hidden = true;
      }
      about = subject;
      const key = JSON.stringify([now, ctx.project.files.find(({ name }) => name === log)?.modified]);
      if (key === asked) return;
      asked = key;
      try {
        // nobody waits for the one before
        if (running) api.stop(running).catch(() => {});
        const done = await api.run("identify", now, {
          onJob: (it) => {
            if (asked === key) {
              running = it.id;
              job.update(it);
            }
          },
        });
        const document = await api.document_(done.id);
        if (asked !== key) return;
        running = 0;
        [finished, result] = [done, document];
        kept(FOUND, result.params);
        showResult();
      } catch (error) {
        if (asked !== key) return;
        running = 0;
        job.fail(/** @type {Error} */ (error));
      }
    }

    function range() {
      const [a, b] = [state.get("from"), state.get("to")];
      return a || b ? `, ${a || "0"} s to ${b ? `${b} s` : "the end"}` : "";
    }

    const name = () => result.params.axes[at()].name;
    const at = () => Math.min(Number(state.get("axis", "0")) || 0, result.params.axes.length - 1);

    function showResult() {
      axisRow.hidden = result.params.axes.length < 2;
      axis.set(
        result.params.axes.map((/** @type {any} */ it, /** @type {number} */ i) => [`${i}`, it.name]),
        `${at()}`,
      );
      draft = structuredClone(result.params);
      design.hidden = false;
      if (finished)
        fill(
          out,
          exportMenu(finished, {
            stem: "params",
            file: "params.json",
            onSave: () => ctx.refresh(),
            readOnly: ctx.project.read_only,
          }),
        );
      showAxis();
    }

    function showAxis() {
      if (!result) return;
      axis.input.value = `${at()}`;
      const own = draft.axes[at()];
      const found = result.axes[at()];
      const focus = [...rows].flatMap(([id, row]) =>
        /** @type {const} */ (["range", "box", "lock"])
          .filter((part) => row[part] === document.activeElement)
          .map((part) => ({ id, part })),
      )[0];
      rows.clear();
      const all = parameters(own);
      const holds = found?.hold?.parameters ?? [];
      fill(
        sliders,
        all.map((it) => {
          const id = `${name()}.${it.id}`;
          const told = holds.find((/** @type {any} */ h) => h.parameter === it.id || h.parameter === id);
          // a held parameter has its interval from the free fit
          const interval = it.value.interval ?? told?.interval;
          const middle = told?.free ?? it.value.value;
          const row = slider({
            label: it.name,
            unit: it.value.unit,
            value: it.value.value,
            interval,
            min: Math.min(middle, it.value.value) / REACH,
            max: Math.max(middle, it.value.value) * REACH,
            locked: held.has(id),
            onInput: (value) => {
              it.value.value = value;
              moved(it);
            },
            onChange: () => hold(it),
            onLock: (locked) => {
              if (locked) hold(it);
              else {
                held.delete(id);
                refit();
              }
            },
          });
          rows.set(it.id, row);
          return row;
        }),
      );
      if (!all.length) fill(sliders, el("p", { className: "hint" }, "Nothing of this axis was identified."));
      if (focus) rows.get(focus.id)?.[focus.part]?.focus();
      free.hidden = held.size === 0;
      showCost(found);
      showCandidates(found);
      showNumbers(own, found);
      pick();
    }

    /** @type {Map<string, ReturnType<typeof slider>>} */
    const rows = new Map();

    /** While it is moved. @param {Parameter} it */
    function moved(it) {
      const row = rows.get(it.id);
      if (row?.lock) row.lock.checked = true;
      // what is under way knows nothing of this
      asked = "";
      clearTimeout(pause);
      ask();
    }

    /** On release. @param {Parameter} it */
    function hold(it) {
      held.set(`${name()}.${it.id}`, `${state.digits4(it.value.value)}${it.value.unit}`);
      refit();
    }

    function refit() {
      // keys come one by one, and each is a change
      clearTimeout(pause);
      pause = window.setTimeout(() => {
        state.set({ hold: [...held].map(([id, value]) => `${id}=${value}`).join(";") }, true);
        identify();
      }, KEYS_PAUSE);
    }

    /** @param {any} found */
    function showCost(found) {
      const told = found?.hold;
      if (!told) return fill(cost);
      const outside = told.parameters.filter((/** @type {any} */ h) => !h.inside);
      fill(
        cost,
        el(
          "span",
          { className: outside.length ? "bad" : "" },
          `Held by you: Δ ln L ${number(told.log_likelihood, 3)} against the free fit, p ${number(told.p_value, 2)}. `,
          outside.length
            ? `Outside the 95 % interval: ${outside.map((/** @type {any} */ h) => h.parameter).join(", ")}.`
            : "Inside the 95 % interval.",
        ),
      );
    }

    /** @param {any} found */
    function showCandidates(found) {
      const list = found?.candidates ?? [];
      if (!list.length) return fill(candidates);
      fill(
        candidates,
        el("h2", null, "Candidates"),
        table({
          caption: "The lowest score wins; held-out is ln L of the last third under the parameters of the first two.",
          head: ["Model", "Parameters", "Score above the best", "ln L", "Held-out", "Every parameter known", "Choice"],
          rows: list.map((/** @type {any} */ it) => [
            it.chosen ? el("strong", null, it.model) : it.model,
            it.parameters,
            number(it.score - list[0].score, 4),
            number(it.log_likelihood, 9),
            number(it.held_out, 8),
            it.identified ? "yes" : "no",
            it.chosen
              ? "chosen"
              : button(
                  "Use",
                  () => {
                    held.clear();
                    again({ model: it.model, hold: null });
                  },
                  { "aria-label": `Use ${it.model}` },
                ),
          ]),
        }),
      );
    }

    /** @param {any} own @param {any} found */
    function showNumbers(own, found) {
      const precise = new Map((found?.precision ?? []).map((/** @type {any} */ it) => [it.parameter, it]));
      /** @param {any} v */
      const ends = (v) => (v.interval ? `${number(v.interval[0])} to ${number(v.interval[1])}` : "held");
      const temperature = own.temperature;
      fill(
        numbers,
        el("h2", null, "Parameters"),
        table({
          caption: `Axis ${own.name}`,
          visible: false,
          head: ["Parameter", "Value", "Unit", "95 % interval", "±", "Cramér-Rao bound"],
          rows: [
            ...(own.bias ? [["Bias", number(own.bias.value), own.bias.unit, ends(own.bias), "", ""]] : []),
            ...parameters(result.params.axes[at()]).map((it) => {
              const p = precise.get(it.id);
              return [
                it.name,
                number(it.value.value),
                unitText(it.value.unit),
                ends(it.value),
                p?.std_dev_percent ? `${number(p.std_dev_percent, 3)} %` : "–",
                p?.cramer_rao_percent ? `${number(p.cramer_rao_percent, 3)} %` : "–",
              ];
            }),
          ],
        }),
        el(
          "p",
          null,
          found?.fit_p_value === undefined || found.fit_p_value === null
            ? null
            : `Fit: p ${number(found.fit_p_value, 2)}. `,
        ),
        temperature
          ? el(
              "p",
              null,
              `Temperature: ${measured(temperature.coefficient)}, over ${measured(temperature.span)} ` +
                `about ${measured(temperature.reference)}. `,
            )
          : null,
        (own.not_identified ?? []).length
          ? el(
              "ul",
              { className: "notes" },
              own.not_identified.map((/** @type {any} */ it) =>
                el(
                  "li",
                  null,
                  `${TERMS[it.term] ?? it.term}: ${it.reason}` +
                    (it.needed_log ? `; a log of ${measured(it.needed_log, 3)} would tell` : ""),
                ),
              ),
            )
          : null,
        (found?.warnings ?? []).length
          ? el(
              "ul",
              { className: "notes" },
              found.warnings.map((/** @type {string} */ text) => el("li", { className: "warning" }, text)),
            )
          : null,
        found?.steps?.length
          ? details(
              "Steps",
              el(
                "ul",
                { className: "notes" },
                found.steps.map((/** @type {any} */ it) =>
                  el("li", null, typeof it === "string" ? it : JSON.stringify(it)),
                ),
              ),
            )
          : null,
      );
    }

    /** Where handles take their lines: the place on each term is kept while it is dragged.
     * @type {Map<string, number>} */
    const places = new Map();

    const curve = api.latest(
      api.curve,
      (it) => {
        const points = result.axes[at()]?.allan;
        if (!points) return;
        /** The model and its terms, thin. @param {number[]} x @param {"deviation" | "density"} key */
        const lines = (x, key) => [
          { name: "model", x, y: it[key], colour: 1, width: 2 },
          ...it.terms.map((term, i) => ({
            name: TERMS[term.name] ?? term.name,
            x,
            y: term[key],
            colour: 2 + (i % 5),
            dash: 1 + (i % 5),
            width: 1,
            faint: true,
          })),
        ];
        plot.set([
          {
            name: "log, 95 % bars",
            x: points.tau_s,
            y: points.deviation,
            low: points.lower,
            high: points.upper,
            kind: "points",
          },
          ...lines(it.times, "deviation"),
        ]);
        spectrum.set(lines(it.frequencies, "density"));
        handles(it, points);
      },
      (error) => job.fail(error),
    );

    function ask() {
      const points = result.axes[at()]?.allan;
      if (!points) return;
      const [least, most] = [points.tau_s[0], points.tau_s[points.tau_s.length - 1] * 3];
      curve({
        // a document whose number lies outside its own interval is none
        params: JSON.parse(JSON.stringify(draft, (key, value) => (key === "interval" ? undefined : value))),
        axis: name(),
        times: Array.from(
          { length: DEVIATION_POINTS },
          (_, i) => least * (most / least) ** (i / (DEVIATION_POINTS - 1)),
        ),
      });
    }

    /** The middle of where values are so near to the largest. @param {number[]} values @param {number} near */
    function top(values, near) {
      const least = near * Math.max(...values);
      const [first, ...more] = values.flatMap((v, i) => (v >= least ? [i] : []));
      return Math.floor((first + (more.at(-1) ?? first)) / 2);
    }

    /** A handle stands where its term says most; that of a hump on its top.
     * @param {Awaited<ReturnType<typeof api.curve>>} it @param {any} points */
    function handles(it, points) {
      plot.setAxis(`σ (${it.unit})`);
      spectrum.setAxis(`${it.unit}/√Hz`);
      const own = parameters(draft.axes[at()]);
      const last = it.times.findIndex((t) => t > points.tau_s[points.tau_s.length - 1]);
      const inside = it.times.slice(0, last < 0 ? undefined : last).length;
      /** @type {Map<string, number>} */
      const nth = new Map();
      const next = it.terms.flatMap((term) => {
        const at = nth.get(term.name) ?? 0;
        nth.set(term.name, at + 1);
        const amount = own.find((p) => p.term === term.name && p.at === at && AMOUNTS.includes(p.field));
        const time = own.find((p) => p.term === term.name && p.at === at && p.field === "correlation_time");
        if (!amount) return [];
        const hump = term.name === "gauss_markov";
        const stays = dragged === amount.id ? places.get(amount.id) : undefined;
        const line = term.deviation.slice(0, inside);
        const shares = line.map((v, n) => v / it.deviation[n]);
        /** @type {number} */
        const i = hump ? top(line, 1) : (stays ?? top(shares, NEARLY));
        places.set(amount.id, i);
        const here = { x: it.times[i], y: term.deviation[i] };
        return [
          {
            name: TERMS[term.name] + (nth.get(term.name) === 1 ? "" : ` ${at + 1}`),
            ...here,
            unit: it.unit,
            sideways: hump && !!time,
            text: [amount, ...(hump && time ? [time] : [])]
              .map(
                (p) =>
                  `${number(p.value.value)} ${unitText(p.value.unit)}${beyond(p) ? ", outside the 95 % interval" : ""}`,
              )
              .join(", "),
            onMove: (/** @type {{x: number, y: number}} */ to) => {
              dragged = amount.id;
              // the curve answers later: the next move starts from this one
              const pairs = /** @type {[Parameter, number][]} */ ([
                [amount, to.y / here.y],
                ...(hump && time ? [[time, to.x / here.x]] : []),
              ]);
              for (const [p, factor] of pairs) {
                if (factor === 1) continue;
                p.value.value *= factor;
                changed.add(p);
                rows.get(p.id)?.put(p.value.value);
                moved(p);
              }
              Object.assign(here, to);
            },
            onDone: () => {
              dragged = "";
              const all = [...changed];
              changed.clear();
              all.forEach((p) => held.set(`${name()}.${p.id}`, `${state.digits4(p.value.value)}${p.value.unit}`));
              if (all.length) refit();
            },
          },
        ];
      });
      plot.setHandles(next);
    }
    let dragged = "";
    /** @type {Set<Parameter>} */
    const changed = new Set();

    /** @param {Parameter} p */
    function beyond(p) {
      const [low, high] = (result.params.axes[at()] &&
        parameters(result.params.axes[at()]).find((it) => it.id === p.id)?.value.interval) || [null, null];
      return (low !== null && p.value.value < low) || (high !== null && p.value.value > high);
    }

    const fresh = () => {
      held = new Map(
        state
          .get("hold")
          .split(";")
          .filter(Boolean)
          .map((text) => {
            const cut = text.indexOf("=");
            return /** @type {[string, string]} */ ([text.slice(0, cut), text.slice(cut + 1)]);
          }),
      );
      outliers.checked = !!state.get("outliers");
      identify();
      showAxis();
    };
    fresh();
    return fresh;
  },
};
