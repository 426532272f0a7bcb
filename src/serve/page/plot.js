// Figures: uPlot draws axes and lines, this file what it has not: intervals, bands, marks, handles, and a table.

import { button, details, download, el, fill, number, table } from "./ui.js";

/** @type {any} */
const UPlot = /** @type {any} */ (window).uPlot;

/**
 * @typedef {{name: string, x: ArrayLike<number>, y: ArrayLike<number | null>, low?: ArrayLike<number | null>,
 *   high?: ArrayLike<number | null>, kind?: "line" | "points" | "band" | "steps", colour?: number, dash?: number,
 *   width?: number, faint?: boolean}} Line
 * `low`/`high`: 95 % bars of points, the border of a band, or least and greatest value per pixel.
 * `colour` 0 is the text's, 1 to 6 the palette; `dash` 0 to 5.
 * @typedef {{x: number, x2?: number, text: string, serious?: boolean}} Mark
 * @typedef {{name: string, x: number, y: number, unit: string, text?: string, sideways?: boolean,
 *   onMove: (to: {x: number, y: number}) => void, onDone?: () => void}} Handle
 * @typedef {{title: string, x: string, y: string, xLog?: boolean, yLog?: boolean, height?: number, sync?: string,
 *   xRange?: [number, number] | null, yRange?: [number, number] | null, onRange?: (from: number, to: number) => void,
 *   onReset?: () => void, onSize?: (pixels: number) => void, legend?: boolean, bare?: boolean}} Keys
 * `bare`: the axis below has no words, for one more figure stands under it
 */

/** A logarithmic axis has at least 1, 2 and 5 of some decade. */
const ENOUGH = 5;
/** Beside colours, so that a line is known without them. */
export const DASHES = [[], [8, 4], [2, 3], [10, 3, 2, 3], [14, 4], [5, 2, 1, 2, 1, 2]];

/** @param {number} n @param {number} [alpha] */
const colour = (n, alpha = 1) => {
  const style = getComputedStyle(document.documentElement);
  const plain = style.getPropertyValue(n ? `--line-${((n - 1) % 6) + 1}` : "--text").trim();
  return alpha === 1
    ? plain
    : plain +
        Math.round(255 * alpha)
          .toString(16)
          .padStart(2, "0");
};
const ruled = () => getComputedStyle(document.documentElement).getPropertyValue("--rule").trim();

const SVG = "http://www.w3.org/2000/svg";
/** A line as the figure draws it. @param {Line} line */
function sample(line) {
  const svg = document.createElementNS(SVG, "svg");
  for (const [key, value] of Object.entries({ width: "28", height: "10", "aria-hidden": "true", class: "sample" }))
    svg.setAttribute(key, value);
  const stroke = document.createElementNS(SVG, "path");
  const dots = line.kind === "points";
  stroke.setAttribute("d", dots ? "M14 2v6" : "M0 5h28");
  stroke.setAttribute("class", line.colour ? `line-${((line.colour - 1) % 6) + 1}` : "line-0");
  stroke.setAttribute("stroke-width", dots ? "4" : `${line.kind === "band" ? 8 : (line.width ?? 1.5)}`);
  if (line.kind === "band") stroke.setAttribute("opacity", "0.35");
  stroke.setAttribute("stroke-dasharray", (DASHES[line.dash ?? 0] ?? []).join(" "));
  svg.append(stroke);
  return svg;
}

/** Labels of a logarithmic axis: whole decades, and 2 and 5 where there are few. @param {any} u
 * @param {number[]} splits */
function decades(u, splits) {
  // the ends of an axis are splits too, and seldom round
  const first = splits.map((v) => Number((v / 10 ** Math.floor(Math.log10(v) + 1e-9)).toPrecision(6)));
  const few = first.filter((digit) => digit === 1).length < 2;
  return splits.map((v, i) => (first[i] === 1 || (few && (first[i] === 2 || first[i] === 5)) ? short(v) : null));
}
/** @param {number} v */
const short = (v) => number(v, 6);

/** @param {Line[]} lines */
function joined(lines) {
  const same = lines.every((line) => line.x === lines[0].x);
  if (same) return [lines[0].x, ...lines.map((line) => line.y)];
  return UPlot.join(
    lines.map((line) => [line.x, line.y]),
    lines.map(() => lines.map(() => 0)),
  );
}

/** @param {Keys} keys */
export function figure(keys) {
  const place = el("div", { className: "plot", role: "group", "aria-label": keys.title });
  const legend = el("ul", { className: "legend" });
  const marksList = el("ul", { className: "hidden" });
  const rows = details("Table");
  const root = el(
    "figure",
    { className: "empty" },
    el("figcaption", null, keys.title),
    legend,
    el("div", { className: "frame" }, place),
    marksList,
    rows,
  );
  /** @type {Line[]} */
  let lines = [];
  /** @type {Mark[]} */
  let marks = [];
  /** @type {(Handle & {node: HTMLElement})[]} */
  let handles = [];
  /** @type {any} */
  let u = null;
  /** @type {HTMLElement[]} */
  let readings = [];
  let shape = "";
  let yLog = false;

  /** @param {any} u @param {number} v @param {"x" | "y"} scale */
  const pos = (u, v, scale) => u.valToPos(v, scale, true);

  /** Bars, bands and marks, below the lines. @param {any} u */
  function below(u) {
    const c = u.ctx;
    c.save();
    c.beginPath();
    c.rect(u.bbox.left, u.bbox.top, u.bbox.width, u.bbox.height);
    c.clip();
    for (const mark of marks) {
      const [from, to] = [pos(u, mark.x, "x"), pos(u, mark.x2 ?? mark.x, "x")];
      c.fillStyle = colour(mark.serious ? 2 : 3, mark.x2 === undefined ? 0.9 : 0.16);
      c.fillRect(from, u.bbox.top, Math.max(to - from, 2 * devicePixelRatio), u.bbox.height);
    }
    for (const line of lines) {
      const { low, high } = line;
      if (!low || !high) continue;
      c.strokeStyle = colour(line.colour ?? 0, line.kind === "band" ? 0.75 : 1);
      c.fillStyle = colour(line.colour ?? 0, 0.2);
      c.lineWidth = devicePixelRatio;
      if (line.kind === "points") bars(u, c, line, low, high);
      else band(u, c, line, low, high);
    }
    c.restore();
  }

  /** @param {any} u @param {CanvasRenderingContext2D} c @param {Line} line @param {any} low @param {any} high */
  function bars(u, c, line, low, high) {
    const cap = 3 * devicePixelRatio;
    c.beginPath();
    for (let i = 0; i < line.x.length; i++) {
      if (low[i] === null || high[i] === null) continue;
      const x = pos(u, line.x[i], "x");
      const [a, b] = [pos(u, low[i], "y"), pos(u, high[i], "y")];
      c.moveTo(x, a);
      c.lineTo(x, b);
      c.moveTo(x - cap, a);
      c.lineTo(x + cap, a);
      c.moveTo(x - cap, b);
      c.lineTo(x + cap, b);
    }
    c.stroke();
  }

  /** @param {any} u @param {CanvasRenderingContext2D} c @param {Line} line @param {any} low @param {any} high */
  function band(u, c, line, low, high) {
    const n = line.x.length;
    c.beginPath();
    for (let i = 0; i < n; i++) c.lineTo(pos(u, line.x[i], "x"), pos(u, high[i], "y"));
    for (let i = n - 1; i >= 0; i--) c.lineTo(pos(u, line.x[i], "x"), pos(u, low[i], "y"));
    c.closePath();
    c.fill();
    c.stroke();
  }

  /** A range with air above and below; of a logarithm, of the logarithm. @param {number | null} min
   * @param {number | null} max @param {boolean} log */
  function span(min, max, log) {
    if (min === null || max === null || !Number.isFinite(min) || !Number.isFinite(max)) return log ? [0.1, 10] : [0, 1];
    if (log) {
      const air = Math.max(Math.log10(max / min) * 0.06, 0.05);
      return [min / 10 ** air, max * 10 ** air];
    }
    const air = (max - min || Math.abs(max) || 1) * 0.06;
    return [min - air, max + air];
  }

  function yRange() {
    if (keys.yRange) return keys.yRange;
    let [min, max] = [Infinity, -Infinity];
    const [from, to] = keys.xRange ?? [-Infinity, Infinity];
    for (const line of lines) {
      if (line.faint) continue;
      for (let i = 0; i < line.x.length; i++) {
        if (line.x[i] < from || line.x[i] > to) continue;
        for (const v of [line.y[i], line.low?.[i], line.high?.[i]]) {
          if (v === null || v === undefined || Number.isNaN(v) || (yLog && v <= 0)) continue;
          min = Math.min(min, v);
          max = Math.max(max, v);
        }
      }
    }
    return min > max ? span(null, null, yLog) : span(min, max, yLog);
  }

  /** Whether heights differ enough for a logarithm: within less, no round number stands at its axis. */
  function wide() {
    let [least, most] = [Infinity, 0];
    for (const line of lines) {
      for (let i = 0; i < line.x.length && !line.faint; i++) {
        const v = line.y[i] ?? 0;
        if (v <= 0) continue;
        least = Math.min(least, v);
        most = Math.max(most, v);
      }
    }
    return most >= ENOUGH * least;
  }

  function xRange() {
    if (keys.xRange) return keys.xRange;
    let [min, max] = [Infinity, -Infinity];
    for (const line of lines) {
      for (const v of [line.x[0], line.x[line.x.length - 1]]) {
        if (v === undefined || (keys.xLog && v <= 0)) continue;
        min = Math.min(min, v);
        max = Math.max(max, v);
      }
    }
    if (min > max) return span(null, null, !!keys.xLog);
    return keys.xLog ? span(min, max, true) : min === max ? [min - 1, max + 1] : [min, max];
  }

  // a figure without lines has no width of its own
  const width = () => Math.max(240, Math.floor(place.clientWidth || (root.parentElement?.clientWidth ?? 0)));
  const height = () => keys.height ?? 320;

  function build() {
    const held = document.activeElement;
    u?.destroy();
    const font = `12px ${getComputedStyle(document.body).fontFamily}`;
    /** @param {string | undefined} label @param {boolean} log @param {boolean} upright */
    const axis = (label, log, upright) => ({
      label,
      font,
      labelFont: font,
      stroke: () => colour(0),
      size: upright ? 58 : 30,
      labelSize: 20,
      labelGap: 0,
      ...(upright ? { space: 24 } : {}),
      grid: { stroke: ruled, width: 1 },
      ticks: { stroke: ruled, width: 1, size: 4 },
      values: log ? decades : (/** @type {any} */ _u, /** @type {number[]} */ v) => v.map(short),
      ...(log ? { filter: (/** @type {any} */ _u, /** @type {any} */ s) => s } : {}),
    });
    u = new UPlot(
      {
        width: width(),
        height: height(),
        legend: { show: false },
        scales: {
          x: { time: false, distr: keys.xLog ? 3 : 1, range: () => xRange() },
          y: { distr: yLog ? 3 : 1, range: () => yRange() },
        },
        axes: [axis(keys.bare ? undefined : keys.x, !!keys.xLog, false), axis(keys.y, yLog, true)],
        cursor: {
          drag: { x: !!keys.onRange, y: false, setScale: false },
          sync: keys.sync ? { key: keys.sync } : undefined,
          points: { size: 6 },
        },
        series: [
          {},
          ...lines.map((line) => ({
            label: line.name,
            spanGaps: true,
            width: line.kind === "points" || line.kind === "band" ? 0 : (line.width ?? 1.5),
            stroke: () => colour(line.colour ?? 0),
            dash: DASHES[line.dash ?? 0],
            points: { show: line.kind === "points", size: 5, fill: () => colour(line.colour ?? 0) },
            ...(line.kind === "points" || line.kind === "band" ? { paths: () => null } : {}),
            ...(line.kind === "steps" ? { paths: UPlot.paths.stepped({ align: 1 }) } : {}),
          })),
        ],
        hooks: {
          drawAxes: [below],
          draw: [settle],
          setCursor: [read],
          setSelect: [
            (/** @type {any} */ u) => {
              const [a, b] = [u.posToVal(u.select.left, "x"), u.posToVal(u.select.left + u.select.width, "x")];
              if (u.select.width > 4) keys.onRange?.(a, b);
              u.setSelect({ left: 0, top: 0, width: 0, height: 0 }, false);
            },
          ],
        },
      },
      joined(lines),
      place,
    );
    u.over.addEventListener("dblclick", () => keys.onReset?.());
    handles.forEach((handle) => u.over.append(handle.node));
    settle();
    if (held instanceof HTMLElement && held !== document.activeElement && root.contains(held)) held.focus();
  }

  /** What the cursor stands on. @param {any} u */
  function read(u) {
    readings.forEach((place, i) => {
      const at = u.cursor.idx;
      const line = lines[i];
      if (!line || at === null || at === undefined) {
        place.textContent = "";
        return;
      }
      const x = u.data[0][at];
      let near = 0;
      while (near + 1 < line.x.length && Math.abs(line.x[near + 1] - x) <= Math.abs(line.x[near] - x)) near++;
      place.textContent = line.x.length
        ? number(line.kind === "band" && line.high ? line.high[near] : line.y[near])
        : "";
    });
  }

  /** Handles to where their values are. */
  function settle() {
    if (!u) return;
    for (const { node, x, y } of handles) {
      const [left, top] = [u.valToPos(x, "x"), u.valToPos(y, "y")];
      node.hidden = !(left >= -1 && top >= -1 && left <= u.over.clientWidth + 1 && top <= u.over.clientHeight + 1);
      node.style.left = `${left}px`;
      node.style.top = `${top}px`;
    }
  }

  /** @param {HTMLElement} node @param {Handle} handle */
  function describe(node, handle) {
    node.setAttribute("aria-label", handle.name);
    node.setAttribute("aria-valuenow", `${Number(handle.y.toPrecision(4))}`);
    node.setAttribute("aria-valuetext", handle.text ?? `${number(handle.y)} ${handle.unit}`);
    node.title = `${handle.name}: ${handle.text ?? `${number(handle.y)} ${handle.unit}`}`;
  }

  /** @param {Handle} given */
  function grip(given) {
    const node = el("div", {
      className: given.sideways ? "handle both" : "handle",
      role: "slider",
      tabIndex: 0,
      "aria-orientation": "vertical",
    });
    const handle = Object.assign({}, given, { node });
    describe(node, given);
    let moved = false;
    /** @param {{x: number, y: number}} to */
    const move = (to) => {
      moved = true;
      Object.assign(handle, to);
      settle();
      handle.onMove(to);
    };
    const done = () => {
      if (moved) handle.onDone?.();
      moved = false;
    };
    node.addEventListener("pointerdown", (e) => {
      e.preventDefault();
      e.stopPropagation();
      node.setPointerCapture(e.pointerId);
      node.focus();
    });
    node.addEventListener("mousedown", (e) => e.stopPropagation());
    node.addEventListener("pointermove", (e) => {
      if (!node.hasPointerCapture(e.pointerId)) return;
      const box = u.over.getBoundingClientRect();
      const x = handle.sideways ? u.posToVal(Math.min(Math.max(e.clientX - box.left, 0), box.width), "x") : handle.x;
      const y = u.posToVal(Math.min(Math.max(e.clientY - box.top, 0), box.height), "y");
      move({ x, y });
    });
    node.addEventListener("lostpointercapture", done);
    node.addEventListener("keydown", (e) => {
      // a step is 2 %, with Shift 20 %
      const step = e.shiftKey ? 1.2 : 1.02;
      /** @type {Record<string, [number, number]>} */
      const ways = {
        ArrowUp: [1, step],
        ArrowDown: [1, 1 / step],
        PageUp: [1, 1.2],
        PageDown: [1, 1 / 1.2],
        ArrowRight: handle.sideways ? [step, 1] : [1, step],
        ArrowLeft: handle.sideways ? [1 / step, 1] : [1, 1 / step],
      };
      const way = ways[e.key];
      if (!way) return;
      e.preventDefault();
      move({ x: handle.x * way[0], y: handle.y * way[1] });
    });
    node.addEventListener("keyup", (e) => {
      if (e.key.startsWith("Arrow") || e.key.startsWith("Page")) done();
    });
    node.addEventListener("blur", done);
    return handle;
  }

  function drawLegend() {
    readings = lines.map(() => el("span", { className: "value" }));
    if (keys.legend === false) return;
    fill(
      legend,
      lines.map((line, i) =>
        line.faint && line.colour === undefined
          ? null
          : el("li", null, /** @type {any} */ (sample(line)), line.name, readings[i]),
      ),
    );
  }

  // filled when it is opened: a table of ten thousand rows that nobody reads costs time
  rows.addEventListener("toggle", () => rows.open && fillRows());
  let later = 0;
  function fillRows() {
    const most = 2000;
    const parts = lines.map((line) => {
      const cells = Array.from({ length: Math.min(line.x.length, most) }, (_, i) => [
        number(line.x[i], 6),
        ...(line.kind === "band" ? [] : [number(line.y[i], 6)]),
        ...(line.low && line.high ? [number(line.low[i], 6), number(line.high[i], 6)] : []),
      ]);
      const ends = line.kind === "points" ? ["lower (95 %)", "upper (95 %)"] : ["least", "greatest"];
      const head = [keys.x, ...(line.kind === "band" ? [] : [keys.y]), ...(line.low && line.high ? ends : [])];
      return table({ caption: `${keys.title}: ${line.name}`, head, rows: cells });
    });
    const csv = button("Download CSV", () => {
      const text = lines
        .map((line) =>
          [
            `# ${line.name}`,
            ...Array.from(line.x, (x, i) =>
              [x, line.y[i], line.low?.[i], line.high?.[i]].filter((v) => v !== undefined).join(","),
            ),
          ].join("\n"),
        )
        .join("\n");
      download(`${keys.title.replace(/[^A-Za-z0-9]+/g, "-")}.csv`, new Blob([text + "\n"], { type: "text/csv" }));
    });
    rows.replaceChildren(
      /** @type {Element} */ (rows.firstElementChild),
      csv,
      el("div", { className: "columns" }, parts),
    );
  }

  const resized = new ResizeObserver(() => {
    if (!u || !place.clientWidth || u.width === width()) return;
    u.setSize({ width: width(), height: height() });
    keys.onSize?.(width());
  });
  resized.observe(place);
  const repaint = () => u && place.isConnected && build();
  const media = ["(prefers-color-scheme: dark)", "print"].map((query) => matchMedia(query));
  media.forEach((query) => query.addEventListener("change", repaint));

  return Object.assign(root, {
    /** What is drawn. Lines that look as before keep the plot and are drawn at once.
     * @param {Line[]} next
     * @param {{marks?: Mark[], xRange?: [number, number] | null, yRange?: [number, number] | null}} [more] */
    set(next, more = {}) {
      lines = next.filter((line) => line.x.length);
      if (more.marks) {
        marks = more.marks;
        fill(
          marksList,
          marks.map((mark) => el("li", null, mark.text)),
        );
      }
      if ("xRange" in more) keys.xRange = more.xRange;
      if ("yRange" in more) keys.yRange = more.yRange;
      yLog = !!keys.yLog && wide();
      const looks = lines.map(({ name, kind, colour, dash, width, faint }) => [name, kind, colour, dash, width, faint]);
      const now = JSON.stringify([yLog, looks]);
      root.classList.toggle("empty", lines.length === 0);
      if (lines.length === 0) {
        u?.destroy();
        u = null;
        shape = "";
        fill(legend);
        return;
      }
      if (now !== shape) drawLegend();
      if (u && now === shape && place.isConnected) u.setData(joined(lines));
      else if (place.isConnected && place.clientWidth) build();
      else
        requestAnimationFrame(() => {
          if (place.isConnected) build();
        });
      shape = now;
      clearTimeout(later);
      if (rows.open) later = window.setTimeout(fillRows, 300);
    },
    /** Handles on lines; those of the same names keep focus and pointer. @param {Handle[]} next */
    setHandles(next) {
      const known = new Map(handles.map((handle) => [handle.name, handle]));
      handles.filter((old) => !next.some((it) => it.name === old.name)).forEach((old) => old.node.remove());
      handles = next.map((given) => {
        const old = known.get(given.name);
        if (!old) {
          const made = grip(given);
          u?.over.append(made.node);
          return made;
        }
        Object.assign(old, given);
        describe(old.node, given);
        return old;
      });
      settle();
    },
    width,
    /** What stands at the upright axis. @param {string} label */
    setAxis(label) {
      if (keys.y === label) return;
      keys.y = label;
      if (u && place.isConnected) build();
    },
    destroy() {
      resized.disconnect();
      media.forEach((query) => query.removeEventListener("change", repaint));
      u?.destroy();
      u = null;
    },
  });
}

/** Shares of a whole as bars with numbers. @param {string} title @param {{name: string, share: number}[]} parts */
export function budget(title, parts) {
  return el(
    "figure",
    { className: "budget" },
    el("figcaption", null, title),
    el(
      "table",
      { className: "numeric" },
      el(
        "tbody",
        null,
        parts.map(({ name, share }) => {
          const bar = el("span", { className: "bar" });
          bar.style.width = `${100 * share}%`;
          return el(
            "tr",
            null,
            el("th", { scope: "row" }, name),
            el("td", null, `${number(100 * share, 3)} %`),
            el("td", { className: "bars", "aria-hidden": "true" }, bar),
          );
        }),
      ),
    ),
  );
}
