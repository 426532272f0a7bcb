// The filter in the control loop of an airplane: what every feed costs in margin, damping and surface activity, while
// gains, corners, airspeed and noise are moved.

import * as api from "./api.js";
import * as state from "./state.js";
import {
  announce,
  button,
  details,
  el,
  exportMenu,
  fill,
  jobView,
  number,
  saveAs,
  selectField,
  slider,
  table,
} from "./ui.js";
import { filesOf } from "./panel_replay.js";
import { figure } from "./plot.js";

/**
 * @typedef {{value: number, unit: string}} Amount
 * @typedef {{key: string, label: string, at: Amount, min: number, max: number,
 *   put: (flight: any, amount: Amount) => void}} Knob
 * @typedef {{name: string, eigenvalue: [number, number], frequency: number, damping: number}} Mode
 */

/** @type {[string, string][]} */
const HALVES = [
  ["pitch", "Pitch"],
  ["roll_yaw", "Roll and yaw"],
];
/** @type {[string, string][]} */
const GAINS = [
  ["kq", "pitch rate"],
  ["ktheta", "pitch angle"],
  ["kp", "roll rate"],
  ["kphi", "bank angle"],
  ["kr", "yaw rate"],
];
/** rad/s beyond which a pole is filter or servo and would squeeze those of the airplane. */
const FARTHEST = 60;
const SOURCES = ["all", "gust", "gyro_white", "drift", "reference"];

/** "10 Hz", 0.9 or {value, unit}. @param {any} it @returns {Amount} */
function amount(it) {
  if (typeof it === "object") return it;
  const [, value, unit] = /^\s*([-+.\deE]+)\s*(.*)$/.exec(`${it}`) ?? [];
  return { value: Number(value), unit: unit ?? "" };
}
/** @param {Amount} it */
const written = ({ value, unit }) => (unit ? `${state.digits4(value)} ${unit}` : Number(state.digits4(value)));

/** What is nothing but rounding is zero. @param {number | undefined} value */
const settled = (value) => (value !== undefined && Math.abs(value) < 1e-9 ? 0 : value);

/** A path that a file names, from the folder. @param {string} file @param {string} path */
function resolved(file, path) {
  const parts = file.split("/").slice(0, -1);
  for (const part of path.split("/")) {
    if (part === "..") parts.pop();
    else if (part !== ".") parts.push(part);
  }
  return parts.join("/");
}

/** The flight with the documents that it names in it, so that it means the same wherever it is saved.
 * @param {string} name */
async function whole(name) {
  const flight = await api.file(name);
  /** @param {any} of @param {string} key */
  const take = async (of, key) => {
    if (typeof of?.[key] === "string") of[key] = await api.file(resolved(name, of[key]));
  };
  await take(flight, "airplane");
  await take(flight.sensors, "gyro");
  await take(flight.sensors, "accelerometer");
  for (const feed of flight.feeds ?? []) {
    await take(feed, "gyro");
    if (feed.filter) feed.filter = resolved(name, feed.filter);
  }
  return flight;
}

/** What may be moved. @param {any} flight @returns {Knob[]} */
function knobs(flight) {
  /** @type {Knob[]} */
  const out = [];
  const rate = amount(flight.autopilot?.rate ?? "100 Hz").value;
  (flight.feeds ?? []).forEach((/** @type {any} */ feed, /** @type {number} */ i) => {
    const inner = feed.type === "lowpass" ? feed : feed.lowpass;
    if (!inner?.corner) return;
    const at = amount(inner.corner);
    out.push({
      key: `corner${i}`,
      label: `Corner of the low-pass${feed.name ? `, ${feed.name}` : feed.type === "lowpass" ? "" : `, ${feed.type}`}`,
      at,
      // a corner lies below half the rate
      min: at.value / 8,
      max: Math.min(at.value * 8, at.unit === "Hz" ? 0.45 * rate : Infinity),
      put: (next, it) => {
        const to = next.feeds[i];
        (to.type === "lowpass" ? to : to.lowpass).corner = written(it);
      },
    });
  });
  for (const [key, label] of GAINS) {
    const gain = flight.autopilot?.gains?.[key];
    if (gain === undefined) continue;
    const at = amount(gain);
    out.push({
      key,
      label: `Gain ${key}, ${label}`,
      at,
      min: at.value / 4,
      max: at.value * 4,
      put: (next, it) => {
        next.autopilot.gains[key] = written(it);
      },
    });
  }
  if (flight.trim?.airspeed) {
    const at = amount(flight.trim.airspeed);
    out.push({
      key: "airspeed",
      label: "Airspeed",
      at,
      min: 0.6 * at.value,
      max: 1.8 * at.value,
      put: (next, it) => {
        next.trim.airspeed = written(it);
      },
    });
  }
  if (typeof flight.sensors?.gyro === "object") {
    out.push({
      key: "noise",
      label: "Gyro's white noise, times",
      at: { value: 1, unit: "×" },
      min: 0.1,
      max: 20,
      put: (next, it) => louder(next.sensors.gyro, it.value),
    });
  }
  return out;
}

/** As `inflate` does it: every wideband density times a factor. @param {any} params @param {number} factor */
function louder(params, factor) {
  for (const axis of params.axes) {
    for (const kind of ["white", "moving_average", "band_limit"]) {
      for (const term of [axis[kind] ?? []].flat()) {
        const { value, unit } = amount(term.density);
        term.density = { value: value * factor, unit };
      }
    }
  }
}

const SVG = "http://www.w3.org/2000/svg";
/** @param {string} tag @param {Record<string, string | number>} keys @param {string} [text] */
function svg(tag, keys, text) {
  const node = document.createElementNS(SVG, tag);
  for (const [key, value] of Object.entries(keys)) node.setAttribute(key, `${value}`);
  if (text !== undefined) node.textContent = text;
  return node;
}
/** Shapes beside colours. @type {((x: number, y: number) => string)[]} */
const SHAPES = [
  (x, y) => `M${x - 4} ${y - 4}l8 8m0 -8l-8 8`,
  (x, y) => `M${x - 4} ${y - 4}h8v8h-8z`,
  (x, y) => `M${x} ${y - 5}l5 9h-10z`,
  (x, y) => `M${x} ${y - 5}l5 5l-5 5l-5 -5z`,
  (x, y) => `M${x - 5} ${y}h10m-5 -5v10`,
  (x, y) => `M${x} ${y + 5}l5 -9h-10z`,
];
/** @param {number} i */
const colour = (i) => `var(--line-${(i % 6) + 1})`;

/** Round numbers. @param {number} from @param {number} to @param {number} count */
function ticks(from, to, count) {
  const raw = (to - from) / count;
  const power = 10 ** Math.floor(Math.log10(raw));
  const step = power * ([1, 2, 5].find((it) => it * power >= raw) ?? 10);
  return Array.from(
    { length: Math.floor(to / step) - Math.ceil(from / step) + 1 },
    (_, i) => (Math.ceil(from / step) + i) * step,
  );
}

/** Poles of every feed, upper half plane. @param {string} title @param {{name: string, modes: Mode[]}[]} feeds */
function poleMap(title, feeds) {
  const near = feeds.map(({ name, modes }) => ({
    name,
    modes: modes.filter((mode) => mode.frequency < FARTHEST && mode.eigenvalue[1] >= 0),
  }));
  const place = el("div");
  const rows = near.flatMap(({ name, modes }) =>
    modes.map((mode) => [
      name,
      mode.name.replaceAll("_", " "),
      number(mode.eigenvalue[0]),
      number(mode.eigenvalue[1]),
      number(mode.frequency),
      number(mode.damping, 3),
    ]),
  );
  const legend = el(
    "ul",
    { className: "legend" },
    near.map(({ name }, i) => {
      const sample = svg("svg", { width: 14, height: 14, "aria-hidden": "true" });
      sample.append(mark(7, 7, i));
      return el("li", null, /** @type {any} */ (sample), name);
    }),
  );
  /** @param {number} x @param {number} y @param {number} i */
  function mark(x, y, i) {
    const node = svg("path", { d: SHAPES[i % SHAPES.length](x, y), fill: "none", "stroke-width": 1.8 });
    /** @type {SVGElement} */ (node).style.stroke = colour(i);
    return node;
  }
  function draw() {
    const [width, height, left, bottom] = [Math.max(place.clientWidth, 260), 300, 46, 40];
    const points = near.flatMap(({ modes }) => modes.map(({ eigenvalue }) => eigenvalue));
    const low = Math.min(-1, ...points.map(([re]) => re)) * 1.08;
    const high = Math.max(1, ...points.map(([re]) => re)) * 1.08;
    const top = Math.max(1, ...points.map(([, im]) => im)) * 1.08;
    const x = (/** @type {number} */ re) => left + ((re - low) / (high - low)) * (width - left - 12);
    const y = (/** @type {number} */ im) => 10 + (1 - im / top) * (height - bottom - 10);
    const root = svg("svg", {
      width,
      height,
      role: "img",
      "aria-label": `${title}: poles of the closed loop; the table has the numbers`,
    });
    /** @param {number} x1 @param {number} y1 @param {number} x2 @param {number} y2 @param {string} paint
     * @param {string} [dash] */
    const line = (x1, y1, x2, y2, paint, dash = "") => {
      const node = svg("line", { x1, y1, x2, y2, "stroke-dasharray": dash });
      /** @type {SVGElement} */ (node).style.stroke = `var(--${paint})`;
      root.append(node);
    };
    /** @param {number} at @param {number} up @param {string} words @param {string} anchor */
    const text = (at, up, words, anchor) => {
      const node = svg("text", { x: at, y: up, "text-anchor": anchor, "font-size": 12 }, words);
      /** @type {SVGElement} */ (node).style.fill = "var(--text)";
      root.append(node);
    };
    for (const re of ticks(low, high, width > 500 ? 8 : 4)) {
      line(x(re), 10, x(re), y(0), "rule");
      text(x(re), y(0) + 15, number(re), "middle");
    }
    for (const im of ticks(0, top, 5)) {
      line(left, y(im), width - 12, y(im), "rule");
      text(left - 5, y(im) + 4, number(im), "end");
    }
    // rays of equal damping
    for (const damping of [0.3, 0.5, 0.7]) {
      const slope = damping / Math.sqrt(1 - damping ** 2);
      const im = Math.min(top, -low / slope);
      line(x(0), y(0), x(-im * slope), y(im), "edge", "2 4");
      text(x(-im * slope) + 4, y(im) + 12, `ζ ${damping}`, "start");
    }
    line(x(0), 10, x(0), y(0), "text");
    text((left + width) / 2, height - 8, "real part (1/s)", "middle");
    near.forEach(({ modes }, i) => modes.forEach(({ eigenvalue: [re, im] }) => root.append(mark(x(re), y(im), i))));
    place.replaceChildren(root);
  }
  const resized = new ResizeObserver(draw);
  resized.observe(place);
  return el(
    "figure",
    null,
    el("figcaption", null, `${title}: poles; imaginary part (1/s) upwards`),
    legend,
    place,
    details(
      "Table",
      table({
        caption: `${title}: motions`,
        head: ["feed", "motion", "real", "imaginary", "frequency (rad/s)", "damping"],
        rows,
        visible: false,
      }),
    ),
  );
}

/** @type {import("./app.js").Panel} */
export const panel = {
  id: "loop",
  title: "Loop",
  show(root, ctx) {
    /** @param {string} key */
    const own = (key) => state.get(`loop.${key}`);
    const names = () => filesOf(ctx, "flight");
    const chosen = selectField("Flight", [], {
      onchange: (name) => {
        state.set({ "loop.flight": name, ...Object.fromEntries(moved.map(({ key }) => [`loop.${key}`, null])) }, true);
        load(name);
      },
    });
    const sliders = el("div");
    const job = jobView();
    const more = el("div");
    const keep = el("div");
    const empty = el(
      "p",
      { className: "hint" },
      "No flight is in this folder: a flight.json with an airplane, its air and sensors, gains, feeds and criteria.",
    );
    const verdict = el("h2");
    const tables = el("div");
    const maps = el("div", { className: "pair" });
    const curves = el("div", { className: "pair" });
    fill(
      root,
      el("div", { className: "controls" }, el("h2", null, "Loop"), empty, chosen, sliders, keep, job, more),
      el("div", { className: "figures" }, verdict, tables, maps, curves),
    );

    /** @type {any} */
    let flight = null;
    /** @type {(Knob & {node: ReturnType<typeof slider>})[]} */
    let moved = [];

    const isMoved = () => moved.some(({ node, at }) => node.get() !== at.value);

    /** What is asked: the file, or what became of it. */
    function asked() {
      if (!isMoved()) return { request: { flight: chosen.input.value } };
      return { request: { flight: "draft:flight" }, drafts: { flight: draft() } };
    }
    function draft() {
      const next = structuredClone(flight);
      moved.forEach(({ node, at, put }) => {
        if (node.get() !== at.value) put(next, { value: node.get(), unit: at.unit });
      });
      return next;
    }

    const preview = api.latest(
      (/** @type {ReturnType<typeof asked>} */ it) => api.preview("loop", it.request, it),
      show,
      (error) => job.fail(error),
    );
    /** Curves, report and command, when a slider is let go. */
    const full = api.latest(
      async (/** @type {ReturnType<typeof asked>} */ it) => {
        // a draft has no command line until it is saved
        const onJob = (/** @type {api.Job} */ now) => job.update(it.drafts ? { ...now, shell: "" } : now);
        const done = await api.run("loop", it.request, { drafts: it.drafts, onJob });
        const [result, lines] = await Promise.all([api.document_(done.id), api.document_(done.id, "curves")]);
        return { done, result, lines };
      },
      ({ done, result, lines }) => {
        show(result);
        fill(more, exportMenu(done, { stem: "loop", readOnly: ctx.project.read_only }));
        drawCurves(lines);
        announce(`${result.verdict}, best is ${result.best}`);
      },
      (error) => job.fail(error),
    );

    /** @param {string} name */
    async function load(name) {
      loaded = name;
      job.clear();
      fill(sliders);
      fill(keep);
      moved = [];
      if (!name) return;
      try {
        flight = await whole(name);
      } catch (error) {
        return job.fail(/** @type {Error} */ (error));
      }
      moved = knobs(flight).map((knob) => ({
        ...knob,
        node: slider({
          label: knob.label,
          unit: knob.at.unit,
          value: state.number(`loop.${knob.key}`) ?? knob.at.value,
          min: knob.min,
          max: knob.max,
          onInput: (value) => {
            state.set({ [`loop.${knob.key}`]: state.digits4(value) });
            preview(asked());
          },
          onChange: () => full(asked()),
        }),
      }));
      fill(
        sliders,
        moved.map(({ node }) => node),
        moved.length ? button("Back to the file", reset) : null,
      );
      if (!ctx.project.read_only) fill(keep, saveAs("Save the flight as", "flight.json", save));
      full(asked());
    }

    function reset() {
      state.set(Object.fromEntries(moved.map(({ key }) => [`loop.${key}`, null])), true);
      moved.forEach(({ node, at }) => node.put(at.value));
      full(asked());
    }

    /** @param {string} name @param {boolean} replace */
    async function save(name, replace) {
      await api.save({ name, document: draft(), replace });
      await ctx.refresh();
      state.set({ "loop.flight": name, ...Object.fromEntries(moved.map(({ key }) => [`loop.${key}`, null])) }, true);
      again();
    }

    /** @param {any} result */
    function show(result) {
      const kept = result.criteria.filter((/** @type {any} */ it) => it.pass).length;
      const good = result.verdict === "pass";
      fill(
        verdict,
        el("span", { className: good ? "good" : "bad" }, good ? "pass" : "FAIL"),
        `: ${kept} of ${result.criteria.length} criteria are kept`,
        result.best ? `; best is ${result.best}` : "",
      );
      const feeds = /** @type {any[]} */ (result.feeds);
      /** @param {string} name */
      const failed = (name) => result.criteria.filter((/** @type {any} */ it) => it.feed === name && !it.pass).length;
      const overview = table({
        caption: "Feeds",
        head: [
          "feed",
          "least disk margin",
          "damping of pitch",
          "of roll and yaw",
          "pitch offset (deg)",
          "bank offset (deg)",
          "criteria",
        ],
        rows: feeds.map((feed) => [
          feed.name,
          ...(HALVES.every(([half]) => feed[half].stable)
            ? [
                number(
                  Math.min(...HALVES.flatMap(([half]) => feed[half].margins.map((/** @type {any} */ it) => it.disk))),
                  3,
                ),
                ...HALVES.map(([half]) => number(feed[half].least_damped?.damping, 3)),
                number(settled(feed.pitch.offset?.theta), 3),
                number(settled(feed.roll_yaw.offset?.phi), 3),
              ]
            : ["unstable", "–", "–", "–", "–"]),
          failed(feed.name) ? el("span", { className: "bad" }, `FAIL: ${failed(feed.name)}`) : "pass",
        ]),
      });
      const margins = table({
        caption: "Margins at every surface, the other loops closed",
        head: ["feed, surface", "gain up (dB)", "gain down (dB)", "phase (deg)", "delay (s)", "disk", "peak of |S|"],
        rows: feeds.flatMap((feed) =>
          HALVES.flatMap(([half]) =>
            (feed[half].margins ?? []).map((/** @type {any} */ it) => [
              `${feed.name}, ${it.surface}`,
              number(it.gain_db, 3),
              number(it.gain_reduction_db, 3),
              number(it.phase_deg, 3),
              number(it.delay_s, 3),
              number(it.disk, 3),
              number(it.sensitivity_peak, 3),
            ]),
          ),
        ),
      });
      const criteria = [...result.criteria]
        .sort((a, b) => Number(a.pass) - Number(b.pass))
        .map((it) => [it.meaning, it.pass ? "pass" : el("span", { className: "bad" }, "FAIL")]);
      const rms = table({
        caption: "Rms by source (deg, deg/s)",
        head: ["feed, what", "all", "gusts", "gyro's white noise", "its drift", "attitude reference"],
        rows: feeds.flatMap((feed) =>
          HALVES.flatMap(([half]) =>
            Object.entries(feed[half].rms ?? {}).map(([what, by]) => [
              `${feed.name}, ${what.replaceAll("_", " ")}`,
              ...SOURCES.map((source) => number(/** @type {any} */ (by)[source], 3)),
            ]),
          ),
        ),
      });
      const open = new Set(
        [...tables.querySelectorAll("details")].filter((it) => it.open).map((it) => it.firstElementChild?.textContent),
      );
      fill(
        tables,
        overview,
        result.warnings?.length
          ? el(
              "ul",
              { className: "notes" },
              result.warnings.map((/** @type {string} */ it) => el("li", { className: "warning" }, it)),
            )
          : null,
        margins,
        details(
          "Criteria",
          table({ caption: "Criteria", head: ["what", "result"], rows: criteria, visible: false, numeric: false }),
        ),
        details("Surfaces, rates and angles by source", rms),
      );
      for (const it of tables.querySelectorAll("details")) it.open = open.has(it.firstElementChild?.textContent);
      const known = new Set([...maps.querySelectorAll("details")].flatMap((it, i) => (it.open ? [i] : [])));
      fill(
        maps,
        HALVES.map(([half, title]) =>
          poleMap(
            title,
            feeds.map((feed) => ({ name: feed.name, modes: feed[half].modes ?? [] })),
          ),
        ),
      );
      [...maps.querySelectorAll("details")].forEach((it, i) => {
        it.open = known.has(i);
      });
    }

    /** @type {ReturnType<typeof figure>[]} */
    let drawn = [];
    /** @param {any} lines */
    function drawCurves(lines) {
      drawn.forEach((old) => old.destroy());
      fill(curves);
      /** @type {[ReturnType<typeof figure>, import("./plot.js").Line[]][]} */
      const all = [
        ...lines.gust.map((/** @type {any} */ it) => [
          figure({ title: `${title(it.half)}: answer to a gust`, x: "time (s)", y: `${it.angle} (deg)`, height: 240 }),
          it.feeds.map((/** @type {any} */ feed, /** @type {number} */ i) => ({
            name: feed.name,
            x: feed.time_s,
            y: feed.deg,
            colour: i + 1,
            dash: i,
          })),
        ]),
        ...lines.gain.map((/** @type {any} */ it) => [
          figure({
            title: `How much a disturbance of the ${it.surface} is amplified`,
            x: "frequency (rad/s)",
            y: "|S|",
            xLog: true,
            height: 240,
          }),
          it.feeds.map((/** @type {any} */ feed, /** @type {number} */ i) => ({
            name: feed.name,
            x: feed.frequency,
            y: feed.sensitivity,
            colour: i + 1,
            dash: i,
          })),
        ]),
      ];
      drawn = all.map(([made, them]) => {
        curves.append(made);
        made.set(them);
        return made;
      });
    }
    /** @param {string} half */
    const title = (half) => HALVES.find(([key]) => key === half)?.[1] ?? half;

    let loaded = "";
    function again() {
      chosen.set(names(), own("flight") || chosen.input.value);
      const name = chosen.input.value;
      empty.hidden = !!name;
      chosen.hidden = !name;
      if (name !== loaded) {
        load(name);
        return;
      }
      // the back button may have moved a slider
      const before = moved.map(({ node }) => node.get()).join();
      moved.forEach(({ key, node, at }) => node.put(state.number(`loop.${key}`) ?? at.value));
      if (before !== moved.map(({ node }) => node.get()).join()) full(asked());
    }
    again();
    return again;
  },
};
