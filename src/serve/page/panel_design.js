// Design: plant, aids and sensor make a filter; what it promises follows the sliders.

import { pin } from "./panel_compare.js";
import { FOUND, kept, parameters } from "./panel_noise.js";
import { budget, figure } from "./plot.js";
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
  slider,
  table,
  textField,
} from "./ui.js";

/** Sliders go from half to eight times what was identified; a span that an interval needs is added. */
const [LEAST, MOST] = [0.5, 8];
/** A preview says nothing of them: the verification is what takes time. */
const FEWEST_RUNS = 2;
/** Rates of aids that a slider reaches about the one typed. */
const RATE_REACH = 10;
const PLANTS = [
  ["static", "static: the sensor alone"],
  ["angle", "angle: the rate, integrated"],
  ["rate", "rate: the true rate, which moves"],
  ["vertical", "vertical: roll or pitch"],
  ["attitude", "attitude: three axes"],
  ["airplane", "airplane"],
];
/** Radians are for computers. @type {Record<string, [string, number]>} */
const SHOWN = { rad: ["deg", 180 / Math.PI], "rad/s": ["deg/s", 180 / Math.PI] };

/** @param {string} unit @returns {[string, number]} its unit for a person, and the factor */
export const shownUnit = (unit) => SHOWN[unit] ?? [unit, 1];

/**
 * @typedef {{name: string, unit: string, sigma: number[], budget: {name: string, share: number}[],
 * gain: number[]}} StateResult
 * @typedef {{name: string, time: number[], states: StateResult[], settling: number | null, poles: number[][],
 * notes: string[]}} AxisResult
 */

/** What figures need of a document of `tune`. @param {any} document @returns {AxisResult[]} */
export function results(document) {
  /** @param {any} parts */
  const shares = (parts) => (parts ?? []).map((/** @type {any} */ it) => ({ name: it.source, share: it.share }));
  if (document.at_rest) {
    const rest = document.at_rest;
    /** @param {string} name @param {string} unit @param {(it: any) => number} of */
    const column = (name, unit, of) => ({
      name,
      unit: shownUnit(unit)[0],
      sigma: rest.map((/** @type {any} */ it) => of(it) * shownUnit(unit)[1]),
      budget: [],
      gain: [],
    });
    return [
      {
        name: "attitude",
        time: rest.map((/** @type {any} */ it) => it.time_s),
        settling: null,
        poles: [],
        notes: document.filter.tuning?.decisions ?? [],
        states: [
          column("inclination", "rad", (it) => it.inclination),
          column("heading", "rad", (it) => it.heading),
          ...["x", "y", "z"].map((axis, i) => column(`drift ${axis}`, "rad/s", (it) => it.drift[i])),
        ],
      },
    ];
  }
  return document.reports.map((/** @type {any} */ report, /** @type {number} */ i) => {
    const axis = document.filter.axes[i];
    const { predicted } = report;
    const plants = new Map(
      (report.plant_budgets ?? []).map((/** @type {any} */ it) => [it.state, shares(it.error_budget)]),
    );
    const states = axis.states.map((/** @type {any} */ it, /** @type {number} */ n) => {
      const [unit, factor] = shownUnit(it.unit);
      return {
        name: it.name,
        unit,
        sigma: predicted.sigma[n].map((/** @type {number} */ v) => v * factor),
        budget: plants.get(it.name) ?? [],
        gain: axis.steady_state?.gain?.[n] ?? [],
      };
    });
    const drift = axis.inputs?.[0]?.unit ?? axis.states.at(-1)?.unit ?? "";
    const [unit, factor] = shownUnit(drift);
    if (predicted.total)
      states.push({
        name: "drift in all",
        unit,
        sigma: predicted.total.map((/** @type {number} */ v) => v * factor),
        budget: shares(report.error_budget),
        gain: [],
      });
    return {
      name: report.name,
      time: predicted.time_s,
      states,
      settling: report.settling_time_s ?? null,
      poles: axis.steady_state?.poles ?? [],
      notes: [...report.observability, ...report.warnings],
    };
  });
}

/** σ(t) of one state. @param {AxisResult} axis @param {string} state
 * @param {Partial<import("./plot.js").Line>} look @returns {import("./plot.js").Line[]} */
export function sigmaLine(axis, state, look) {
  const found = axis.states.find(({ name }) => name === state);
  if (!found) return [];
  // the first instant has no place on a logarithmic axis
  const from = axis.time[0] > 0 ? 0 : 1;
  return [{ name: axis.name, x: axis.time.slice(from), y: found.sigma.slice(from), ...look }];
}

/** @typedef {{name: string, sigma: string, rate: string, drift: string}} Aid */

/** @param {Aid} aid @param {number} [factor] on its rate */
function aidText(aid, factor = 1) {
  const rate = aid.rate.match(/^([0-9.eE+-]+)\s*(\D*)$/);
  const at =
    rate && factor !== 1
      ? `${state.digits4(Number(rate[1]) * factor)} ${rate[2] || "Hz"}`
      : aid.rate && /^[0-9.]+$/.test(aid.rate)
        ? `${aid.rate} Hz`
        : aid.rate;
  return `${aid.name ? `${aid.name}: ` : ""}${aid.sigma}${at ? ` @ ${at}` : ""}${aid.drift ? `, ${aid.drift}` : ""}`;
}

/** @type {import("./app.js").Panel} */
export const panel = {
  id: "design",
  title: "Design",
  show(root, ctx) {
    const { api } = ctx;
    /** @type {any} */
    let params = null;
    /** @type {AxisResult[]} */
    let shown = [];
    /** As identified, for the dashed line behind. @type {{key: string, axes: AxisResult[]} | null} */
    let base = null;
    /** @type {import("./api.js").Job | null} */
    let verified = null;
    /** @type {any} */
    let document = null;
    let loaded = "";
    /** What the answer is to that is seen, or will be. */
    let asked = "";
    /** Factors on parameters, of every axis alike. @type {Map<string, number>} */
    let factors = new Map();
    /** @type {Aid[]} */
    let aids = [];

    const source = selectField("Sensor", [], { onchange: (value) => change({ params: value, x: null }) });
    const plant = selectField("Plant", /** @type {[string, string][]} */ (PLANTS), {
      onchange: (value) => change({ plant: value, state: null }),
    });
    const motion = textField("Motion", {
      placeholder: "20 deg/s over 0.5 s",
      onchange: (value) => change({ motion: value }),
      hint: "σ over correlation time, or a density",
    });
    const sensorNames = el("datalist", { id: "sensors" });
    const accelerometer = textField("Accelerometer", {
      hint: "Noise parameters: FILE, or FILE:AXIS",
      onchange: (value) => change({ accelerometer: value }),
    });
    accelerometer.input.setAttribute("list", sensorNames.id);
    const flight = selectField("Flight", [], { onchange: (value) => change({ flight: value }) });
    const aidRows = el("div");
    const axis = selectField("Axis", [], {
      onchange: (value) => {
        state.set({ axis: value }, true);
        sliders();
        draw();
      },
    });
    const knobs = el("div");
    const reset = button("Back to the identified numbers", () => change({ x: null }));
    const job = jobView();
    const brief = el("section");
    const wait = el("p", { className: "hint", hidden: true }, "Designing …");
    const problem = el("p", { className: "error", role: "alert", hidden: true });
    const which = selectField("State", [], {
      onchange: (value) => {
        state.set({ state: value }, true);
        draw();
      },
    });
    const plot = figure({
      title: "Predicted standard deviation σ(t)",
      x: "time (s)",
      y: "",
      xLog: true,
      yLog: true,
      height: 360,
    });
    const shares = el("div");
    const steady = el("section");
    const notes = el("section");
    const insight = el("section");
    const more = checkField("Also say what other parts would buy", false);
    const verify = button("Verify by simulated runs", () => check(), { className: "main" });
    const pinName = textField("Name of the pin", { size: 14 });
    const pinned = button("Pin for Compare", keep);
    const out = el("div");
    fill(
      root,
      el(
        "div",
        { className: "controls" },
        el("section", null, source, plant, motion, accelerometer, sensorNames, flight),
        el("section", null, el("h2", null, "Aids"), aidRows),
        el("section", null, el("h2", null, "Parameters"), axis, knobs, el("div", { className: "row" }, reset)),
        el("section", null, el("div", { className: "row" }, verify), more, job, out),
        el("section", null, el("div", { className: "row" }, pinName, pinned)),
      ),
      el("div", { className: "figures" }, problem, wait, brief, which, plot, shares, steady, insight, notes),
    );

    /** @param {Record<string, any>} values */
    function change(values) {
      state.set(values, true);
      fresh();
    }

    // ------------------------------------------------------------------------------------------------ the sensor

    function lists() {
      const files = ctx.project.files;
      const sensors = files.filter(({ kind }) => kind === "params").map(({ name }) => name);
      const found = kept(FOUND);
      const options = /** @type {[string, string][]} */ ([
        ...(found ? [["", "as identified here, not saved"]] : []),
        ...sensors.map((name) => [name, name]),
      ]);
      source.set(
        options.length ? options : [["", "no params.json yet"]],
        state.get("params") || (found ? "" : (sensors[0] ?? "")),
      );
      fill(
        sensorNames,
        sensors.map((name) => el("option", { value: name })),
      );
      accelerometer.input.value = state.get("accelerometer");
      flight.set(
        [
          ["", "choose"],
          ...files
            .filter(({ kind }) => kind === "flight")
            .map(({ name }) => /** @type {[string, string]} */ ([name, name])),
        ],
        state.get("flight"),
      );
      const designs = files
        .filter(({ kind }) => kind === "design")
        .map(({ name }) => /** @type {[string, string]} */ ([name, name]));
      const own = params?.design ? [["", "the design of the parameters"]] : [];
      plant.set(
        /** @type {[string, string][]} */ ([...own, ...PLANTS, ...designs]),
        state.get("plant", own.length ? "" : "static"),
      );
      const is = plant.input.value;
      motion.hidden = is !== "rate";
      motion.input.value = state.get("motion");
      accelerometer.hidden = !["vertical", "attitude"].includes(is);
      flight.hidden = is !== "airplane";
    }

    async function load() {
      const name = source.input.value;
      const found = kept(FOUND);
      const key = `${name}|${ctx.project.files.find((it) => it.name === name)?.modified ?? JSON.stringify(found)}`;
      if (key === loaded && params) return;
      loaded = key;
      params = name ? await api.file(name) : found;
      base = null;
      if (params)
        axis.set(
          params.axes.map((/** @type {any} */ it, /** @type {number} */ i) => [`${i}`, it.name]),
          state.get("axis", "0"),
        );
    }

    /** The parameters of an axis that a filter uses. @param {any} one */
    const physical = (one) => [
      ...parameters(one),
      ...(one.turn_on_bias
        ? [
            {
              id: "turn_on_bias.std_dev",
              term: "turn_on_bias",
              at: 0,
              field: "std_dev",
              name: "Turn-on bias σ",
              value: one.turn_on_bias.std_dev,
            },
          ]
        : []),
    ];

    function draft() {
      const out = structuredClone(params);
      for (const one of out.axes) {
        for (const it of physical(one)) {
          const factor = factors.get(it.id);
          if (!factor || factor === 1) continue;
          it.value.value *= factor;
          // the interval is that of the identified number
          delete it.value.interval;
        }
      }
      return out;
    }

    function sliders() {
      if (!params) return fill(knobs);
      const one = params.axes[Math.min(Number(state.get("axis", "0")) || 0, params.axes.length - 1)];
      const rows = physical(one).map((it) => {
        const { value, unit, interval } = it.value;
        const ends = (interval ?? []).filter((/** @type {any} */ v) => v > 0);
        return slider({
          label: it.name,
          unit,
          value: value * (factors.get(it.id) ?? 1),
          interval,
          min: Math.min(LEAST * value, ...ends),
          max: Math.max(MOST * value, ...ends),
          onInput: (v) => move(it.id, v / value),
          onChange: settle,
        });
      });
      const rates = aids.map((aid, i) => {
        const rate = aid.rate.match(/^([0-9.eE+-]+)/);
        if (!rate || !(Number(rate[1]) > 0)) return null;
        const hz = Number(rate[1]);
        return slider({
          label: `Rate of ${aid.name || "the aid"}`,
          unit: aid.rate.slice(rate[1].length).trim() || "Hz",
          value: hz * (factors.get(`aid${i}`) ?? 1),
          min: hz / RATE_REACH,
          max: hz * RATE_REACH,
          onInput: (v) => move(`aid${i}`, v / hz),
          onChange: settle,
        });
      });
      fill(
        knobs,
        el(
          "p",
          { className: "hint" },
          params.axes.length > 1 ? "A slider moves its parameter of every axis by the same factor." : "",
        ),
        rows,
        rates,
      );
      axis.hidden = params.axes.length < 2;
    }

    const words = () =>
      [...factors]
        .filter(([, f]) => f !== 1)
        .map(([id, f]) => `${id}=${state.digits4(f)}`)
        .join(";");

    const altered = () => [...factors].some(([id, f]) => f !== 1 && !/^aid\d+$/.test(id));

    /** @param {string} id @param {number} factor */
    function move(id, factor) {
      factors.set(id, factor);
      state.set({ x: words() });
      ask(true);
    }

    function settle() {
      state.set({ x: words() }, true);
      ask();
    }

    // ------------------------------------------------------------------------------------------------------ aids

    function readAids() {
      try {
        aids = JSON.parse(state.get("aids", "[]"));
      } catch {
        aids = [];
      }
    }

    function showAids() {
      const change = () => {
        state.set({ aids: aids.length ? JSON.stringify(aids) : null, x: words() }, true);
        fresh();
      };
      const add = (/** @type {Aid} */ aid) => {
        aids.push(aid);
        change();
      };
      fill(
        aidRows,
        aids.map((aid, i) => {
          /** @param {keyof Aid} key @param {string} label @param {string} placeholder */
          const part = (key, label, placeholder) =>
            textField(label, {
              value: aid[key],
              placeholder,
              size: 9,
              onchange: (value) => {
                aid[key] = value;
                change();
              },
            });
          return el(
            "fieldset",
            null,
            el("legend", null, aid.name || `aid ${i + 1}`),
            el(
              "div",
              { className: "row" },
              part("name", "Name", "heading"),
              part("sigma", "σ", "2 deg"),
              part("rate", "Rate", "1 Hz"),
              part("drift", "Drift", "1 deg over 60 s"),
              button(
                "Remove",
                () => {
                  aids.splice(i, 1);
                  factors.delete(`aid${i}`);
                  change();
                },
                { "aria-label": `Remove ${aid.name || `aid ${i + 1}`}` },
              ),
            ),
          );
        }),
        aids.length ? null : el("p", { className: "hint" }, "None."),
        el(
          "div",
          { className: "row" },
          button("Add an aid", () =>
            add(
              plant.input.value === "vertical"
                ? { name: "tilt", sigma: "1 deg", rate: "10 Hz", drift: "" }
                : { name: "heading", sigma: "2 deg", rate: "1 Hz", drift: "" },
            ),
          ),
        ),
      );
    }

    // ---------------------------------------------------------------------------------------------------- answers

    function request() {
      const is = plant.input.value;
      return {
        // a file that is as it is needs no draft, and its command can be copied
        params: source.input.value && !altered() ? source.input.value : "draft:params.json",
        plant: {
          ...(is ? { plant: is } : {}),
          ...(aids.length ? { aid: aids.map((aid, i) => aidText(aid, factors.get(`aid${i}`))) } : {}),
          ...(is === "rate" ? { motion: state.get("motion") || "20 deg/s over 0.5 s" } : {}),
          ...(accelerometer.hidden || !state.get("accelerometer") ? {} : { accelerometer: state.get("accelerometer") }),
          ...(flight.hidden || !state.get("flight") ? {} : { flight: state.get("flight") }),
        },
      };
    }

    const preview = api.latest(
      (/** @type {{request: any, draft: any, key: string, plain: boolean, quick: boolean}} */ it) =>
        api.preview("tune", { ...it.request, runs: FEWEST_RUNS }, { drafts: { "params.json": it.draft } }),
      (made, it) => {
        wait.hidden = true;
        problem.hidden = true;
        const now = results(made);
        if (it.quick) {
          shown = shown.map((old) => now.find(({ name }) => name === old.name) ?? old);
          return draw();
        }
        document = made;
        shown = now;
        if (it.plain) base = { key: it.key, axes: shown };
        if (base && base.key !== it.key) base = null;
        draw();
      },
      (error) => {
        wait.hidden = true;
        asked = "";
        // another tab asked
        if (/** @type {import("./api.js").ApiError} */ (error).status === 409) return;
        problem.hidden = false;
        problem.textContent = error.message;
      },
    );

    /** @param {boolean} [moving] while a slider moves, the axis that is seen is enough */
    function ask(moving) {
      if (!params) return;
      const now = request();
      const sent = draft();
      const all = JSON.stringify([now, sent, loaded]);
      if (all === asked && !moving) return draw();
      asked = moving ? "" : all;
      const quick = !!moving && shown.length > 1;
      if (quick) {
        sent.axes = [sent.axes[Math.min(Number(state.get("axis", "0")) || 0, sent.axes.length - 1)]];
        now.params = "draft:params.json";
      }
      const key = JSON.stringify([loaded, now.plant.plant, aids, state.get("motion"), state.get("accelerometer")]);
      const plain = words() === "";
      wait.hidden = shown.length > 0;
      preview({ request: now, draft: sent, key, plain, quick });
      if (verified) {
        // what was verified is another design
        verified = null;
        job.clear();
        [out, brief, insight].forEach((part) => fill(part));
      }
    }

    function draw() {
      if (!shown.length) return;
      const at = Math.min(Number(state.get("axis", "0")) || 0, shown.length - 1);
      const own = shown[at];
      which.set(
        own.states.map(({ name, unit }) => /** @type {[string, string]} */ ([name, `${name} (${unit})`])),
        state.get("state") || own.states[0].name,
      );
      const name = which.input.value;
      const found = own.states.find((it) => it.name === name) ?? own.states[0];
      plot.setAxis(`σ (${found.unit})`);
      const before =
        base && base.axes !== shown
          ? sigmaLine(base.axes[at], name, { name: "as identified", colour: 0, dash: 1, width: 1 })
          : [];
      plot.set([...sigmaLine(own, name, { name: `${name}, axis ${own.name}`, colour: 1, width: 2 }), ...before]);
      fill(
        shares,
        found.budget.length
          ? budget(
              `Error budget of ${name}, steady`,
              [...found.budget].sort((a, b) => b.share - a.share),
            )
          : null,
      );
      fill(
        steady,
        el("h2", null, "Steady state"),
        table({
          caption: `Axis ${own.name}${own.settling ? `, settled after ${number(own.settling, 3)} s` : ""}`,
          head: ["State", "σ at the start", "σ at the end", "Unit", ...(own.states[0].gain.length ? ["Gain"] : [])],
          rows: own.states.map((it) => [
            it.name,
            number(it.sigma[0]),
            number(it.sigma.at(-1)),
            it.unit,
            ...(own.states[0].gain.length ? [it.gain.map((g) => number(g)).join(", ")] : []),
          ]),
        }),
        own.poles.length
          ? details(
              "Poles of the steady filter",
              table({
                caption: "z plane, per update",
                head: ["Pole", "Real", "Imaginary"],
                rows: own.poles.map(([re, im], i) => [`${i + 1}`, number(re, 6), number(im, 6)]),
              }),
            )
          : null,
      );
      fill(
        notes,
        own.notes.length
          ? [
              el("h2", null, "What is to be known"),
              el(
                "ul",
                { className: "notes" },
                own.notes.map((text) => el("li", null, text)),
              ),
            ]
          : null,
      );
    }

    async function check() {
      if (!params) return;
      [out, brief, insight].forEach((part) => fill(part));
      verified = null;
      try {
        const done = await api.run(
          "tune",
          { ...request(), ...(more.input.checked ? { insight: true } : {}) },
          { drafts: { "params.json": draft() }, onJob: job.update },
        );
        document = await api.document_(done.id);
        verified = done;
        shown = results(document);
        draw();
        fill(
          brief,
          el("h2", null, done.verdict ? `Verified: ${done.verdict}` : "The design"),
          el("pre", { tabIndex: 0 }, done.brief ?? ""),
        );
        fill(
          out,
          exportMenu(done, {
            stem: "filter",
            file: "filter.json",
            onSave: () => ctx.refresh(),
            readOnly: ctx.project.read_only,
          }),
        );
        if (document.insight) showInsight(document.insight);
      } catch (error) {
        job.fail(/** @type {Error} */ (error));
      }
    }

    /** σ of every output were a part so many times better or worse. @param {any[]} axes */
    function showInsight(axes) {
      const at = Math.min(Number(state.get("axis", "0")) || 0, axes.length - 1);
      fill(
        insight,
        el("h2", null, "What other parts buy"),
        axes[at].outputs.map((/** @type {any} */ output) => {
          const [unit, factor] = shownUnit(output.unit);
          const { factors } = output.worth[0];
          return table({
            caption:
              `σ of ${output.name} (${unit}) if a parameter were so many times as large; ` +
              `now ${number(output.sigma * factor)}`,
            head: ["Parameter", ...factors.map((/** @type {number} */ f) => `×${number(f, 3)}`)],
            rows: output.worth.map((/** @type {any} */ it) => [
              it.parameter,
              ...it.sigma.map((/** @type {number | null} */ v) => number(v && v * factor, 3)),
            ]),
          });
        }),
      );
    }

    function keep() {
      if (!document || !params) return announce("nothing to pin yet");
      const name =
        pinName.input.value.trim() || `${plant.input.value || "design"} ${words() || "as identified"}`.slice(0, 40);
      const failed = pin({
        name,
        plant: plant.input.value,
        axes: shown,
        verdict: verified ? document.verification?.verdict : "not verified",
        params: draft(),
        // of a file that is not there, what the sliders began with
        unsaved: source.input.value ? null : params,
        view: Object.fromEntries(
          ["params", "plant", "aids", "motion", "accelerometer", "x"].map((key) => [key, state.get(key)]),
        ),
      });
      announce(failed ?? `pinned: ${name}`);
      pinned.textContent = failed ?? "Pinned";
      setTimeout(() => (pinned.textContent = "Pin for Compare"), 2000);
    }

    async function fresh() {
      factors = new Map(
        state
          .get("x")
          .split(";")
          .filter(Boolean)
          .map((text) => {
            const cut = text.lastIndexOf("=");
            return /** @type {[string, number]} */ ([text.slice(0, cut), Number(text.slice(cut + 1))]);
          }),
      );
      readAids();
      lists();
      try {
        await load();
      } catch (error) {
        problem.hidden = false;
        problem.textContent = /** @type {Error} */ (error).message;
        return;
      }
      lists();
      showAids();
      sliders();
      if (!params) {
        problem.hidden = false;
        fill(
          problem,
          "There are no noise parameters yet. ",
          button("Identify them", () => ctx.open("noise")),
        );
        return;
      }
      ask();
    }
    fresh();
    return fresh;
  },
};
