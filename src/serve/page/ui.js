// Parts that panels are made of. Texts of files and of the server reach the page as text alone.

import * as api from "./api.js";

/** @typedef {Node | string | number | null | undefined | false} Child */

/** An element: `class`, `aria-…`, `data-…` and other attributes; `on…` functions; other keys are properties.
 * @template {keyof HTMLElementTagNameMap} K @param {K} tag @param {Record<string, any> | null} [keys]
 * @param {...(Child | Child[])} children @returns {HTMLElementTagNameMap[K]} */
export function el(tag, keys, ...children) {
  const out = document.createElement(tag);
  for (const [key, value] of Object.entries(keys ?? {})) {
    if (value === undefined || value === null || value === false) continue;
    if (key.startsWith("on")) out.addEventListener(key.slice(2), value);
    else if (key in out && !key.includes("-") && key !== "list" && key !== "form")
      /** @type {any} */ (out)[key] = value;
    else out.setAttribute(key === "className" ? "class" : key, value === true ? "" : `${value}`);
  }
  fill(out, ...children);
  return out;
}

/** Replaces what is in `root`. @param {Element} root @param {...(Child | Child[])} children */
export function fill(root, ...children) {
  const nodes = children.flat().filter((child) => child !== null && child !== undefined && child !== false);
  root.replaceChildren(...nodes.map((child) => (child instanceof Node ? child : `${child}`)));
}

let ids = 0;
/** @param {string} word */
export const unique = (word) => `${word}-${++ids}`;

/** Four digits, as a person reads them. @param {number | null | undefined} value @param {number} [digits] */
export function number(value, digits = 4) {
  if (value === null || value === undefined || Number.isNaN(value)) return "–";
  if (!Number.isFinite(value)) return value > 0 ? "∞" : "−∞";
  const size = Math.abs(value);
  const text =
    size !== 0 && (size < 1e-4 || size >= 1e6)
      ? value
          .toExponential(Math.max(digits - 1, 0))
          .replace(/\.?0+e/, "e")
          .replace("e+", "e")
      : `${Number(value.toPrecision(digits))}`;
  return text.replace("-", "−");
}

/** @param {number} seconds */
export function duration(seconds) {
  if (seconds < 120) return `${number(seconds, 3)} s`;
  if (seconds < 7200) return `${number(seconds / 60, 3)} min`;
  return seconds < 172800 ? `${number(seconds / 3600, 3)} h` : `${number(seconds / 86400, 3)} d`;
}

/** @param {number} bytes */
export const size = (bytes) =>
  bytes < 1e3 ? `${bytes} B` : bytes < 1e6 ? `${number(bytes / 1e3, 3)} kB` : `${number(bytes / 1e6, 3)} MB`;

/** A unit as it is printed: √Hz, m/s². @param {string} text */
export const unitText = (text) => text.replace(/sqrt\((\w+)\)/g, "√$1").replace("^2", "²");

/** A value with its unit, as documents hold it. @param {any} measured @param {number} [digits] */
export const measured = (measured, digits) =>
  measured ? `${number(measured.value, digits)} ${unitText(measured.unit)}` : "–";

// ---------------------------------------------------------------------------------------------- what is announced

let said = 0;
let pending = 0;
/** Tells a screen reader, at most once a second. @param {string} words */
export function announce(words) {
  const place = document.getElementById("status");
  if (!place || place.textContent === words) return;
  clearTimeout(pending);
  pending = window.setTimeout(
    () => {
      said = Date.now();
      place.textContent = words;
    },
    Math.max(0, 1000 - (Date.now() - said)),
  );
}

// ---------------------------------------------------------------------------------------------------------- fields

/** A control under its label. @param {string} label @param {HTMLElement} control @param {string} [hint] */
export function field(label, control, hint) {
  control.id ||= unique("field");
  const below = hint ? el("span", { className: "hint", id: unique("hint") }, hint) : null;
  if (below) control.setAttribute("aria-describedby", below.id);
  return el("div", { className: "field" }, el("label", { htmlFor: control.id }, label), control, below);
}

/** @param {string} label @param {{value?: string, hint?: string, placeholder?: string, type?: string, size?: number,
 *   onchange?: (value: string) => void}} [keys] */
export function textField(label, keys = {}) {
  const { hint, onchange, ...rest } = keys;
  const input = el("input", { type: "text", autocomplete: "off", spellcheck: false, ...rest });
  input.addEventListener("change", () => onchange?.(input.value.trim()));
  return Object.assign(field(label, input, hint), { input });
}

/** @param {string} label @param {(string | [string, string])[]} options value, or value and text
 * @param {{value?: string, hint?: string, onchange?: (value: string) => void}} [keys] */
export function selectField(label, options, keys = {}) {
  const input = el("select", { onchange: () => keys.onchange?.(input.value) });
  const root = field(label, input, keys.hint);
  /** @param {(string | [string, string])[]} options @param {string} [value] */
  const set = (options, value = input.value) => {
    fill(
      input,
      options.map((it) => (typeof it === "string" ? [it, it] : it)).map(([v, t]) => el("option", { value: v }, t)),
    );
    if (options.some((it) => (typeof it === "string" ? it : it[0]) === value)) input.value = value;
  };
  set(options, keys.value);
  return Object.assign(root, { input, set });
}

/** @param {string} label @param {boolean} checked @param {(checked: boolean) => void} [onchange] */
export function checkField(label, checked, onchange) {
  const input = el("input", {
    type: "checkbox",
    checked,
    id: unique("check"),
    onchange: () => onchange?.(input.checked),
  });
  return Object.assign(el("div", { className: "check" }, input, el("label", { htmlFor: input.id }, label)), { input });
}

/** @param {string} text @param {() => void} onclick @param {Record<string, any>} [keys] */
export const button = (text, onclick, keys) => el("button", { type: "button", onclick, ...keys }, text);

/** @param {string} summary @param {...(Child | Child[])} children */
export const details = (summary, ...children) => el("details", null, el("summary", null, summary), ...children);

/** Steps of a slider over its whole span. */
const STEPS = 1000;

/** A parameter: number, slider on a logarithmic scale with its interval drawn on it, and, where wanted, a lock.
 * @param {{label: string, unit: string, value: number, min: number, max: number, interval?: [number | null,
 * number | null],
 *   locked?: boolean, onInput?: (value: number) => void, onChange?: (value: number) => void,
 *   onLock?: (locked: boolean) => void}} keys */
export function slider(keys) {
  const { label, interval } = keys;
  const unit = unitText(keys.unit);
  let { value, min, max } = keys;
  const log = min > 0;
  /** @param {number} v */
  const share = (v) => (log ? Math.log(v / min) / Math.log(max / min) : (v - min) / (max - min));
  /** @param {number} s */
  const at = (s) => (log ? min * (max / min) ** s : min + s * (max - min));
  const name = unique("slider");
  const box = el("input", {
    type: "text",
    inputmode: "decimal",
    className: "number",
    "aria-label": `${label}, ${unit}`,
  });
  const range = el("input", { type: "range", min: "0", max: `${STEPS}`, step: "1", "aria-labelledby": name });
  const band = el("span", { className: "interval" });
  const note = el("span", { className: "outside" });
  const [low, high] = interval ?? [null, null];
  /** @param {number} v */
  const outside = (v) => (low !== null && v < low) || (high !== null && v > high);
  const words = () => `${number(value)} ${unit}${interval && outside(value) ? ", outside the 95 % interval" : ""}`;
  const draw = () => {
    box.value = number(value).replace("−", "-");
    box.removeAttribute("aria-invalid");
    range.value = `${Math.round(STEPS * Math.min(1, Math.max(0, share(value))))}`;
    range.setAttribute("aria-valuetext", words());
    note.textContent = interval && outside(value) ? "outside the 95 % interval" : "";
  };
  const drawBand = () => {
    band.hidden = !interval;
    if (!interval) return;
    const from = Math.max(0, low === null ? 0 : share(low));
    const to = Math.min(1, high === null ? 1 : share(high));
    // the thumb's middle goes from half its width to as much before the end
    band.style.left = `calc(8px + ${from} * (100% - 16px))`;
    band.style.width = `calc(2px + ${Math.max(0, to - from)} * (100% - 16px))`;
    const ends = [low, high].map((v) => (v === null ? "open" : number(v)));
    band.title = `95 % interval: ${ends.join(" to ")} ${unit}`;
  };
  range.addEventListener("input", () => {
    value = at(Number(range.value) / STEPS);
    draw();
    keys.onInput?.(value);
  });
  range.addEventListener("change", () => keys.onChange?.(value));
  box.addEventListener("change", () => {
    const typed = Number(box.value.replace("−", "-").replace(",", "."));
    if (!Number.isFinite(typed) || (log && typed <= 0)) {
      box.setAttribute("aria-invalid", "true");
      announce(`${label}: expected a ${log ? "positive " : ""}number`);
      return;
    }
    value = typed;
    draw();
    keys.onInput?.(value);
    keys.onChange?.(value);
  });
  /** @type {HTMLInputElement | null} */
  const lock = keys.onLock
    ? el("input", {
        type: "checkbox",
        checked: !!keys.locked,
        "aria-label": `hold ${label}`,
        onchange: (/** @type {Event} */ e) => keys.onLock?.(/** @type {HTMLInputElement} */ (e.target).checked),
      })
    : null;
  drawBand();
  draw();
  const root = el(
    "div",
    { className: "slider" },
    el("span", { className: "name", id: name }, label),
    el("span", { className: "amount" }, box, el("span", { className: "unit" }, unit)),
    el("span", { className: "track" }, band, range),
    lock && el("label", { className: "lock" }, lock, "hold"),
    note,
  );
  return Object.assign(root, {
    range,
    box,
    lock,
    get: () => value,
    /** Without telling anyone. @param {number} v */
    put(v) {
      value = v;
      draw();
    },
  });
}

// --------------------------------------------------------------------------------------------------------- tables

/** @param {{caption: string, head: Child[], rows: (Child | Child[])[][], visible?: boolean, numeric?: boolean}} keys
 * numbers are aligned by `numeric` (default); the first cell of a row names it */
export function table({ caption, head, rows, visible, numeric = true }) {
  return el(
    "div",
    { className: "scroll", tabIndex: 0, role: "region", "aria-label": caption },
    el(
      "table",
      { className: numeric ? "numeric" : "" },
      el("caption", { className: visible === false ? "hidden" : "" }, caption),
      el(
        "thead",
        null,
        el(
          "tr",
          null,
          head.map((cell) => el("th", { scope: "col" }, cell)),
        ),
      ),
      el(
        "tbody",
        null,
        rows.map(([first, ...rest]) =>
          el(
            "tr",
            null,
            el("th", { scope: "row" }, first),
            rest.map((cell) => el("td", null, cell)),
          ),
        ),
      ),
    ),
  );
}

// ------------------------------------------------------------------------------------------- commands, jobs, files

/** The command that does this, to copy. */
export function commandLine() {
  const code = el("code", { tabIndex: 0 });
  const copy = button(
    "Copy",
    async () => {
      try {
        await navigator.clipboard.writeText(code.textContent ?? "");
        announce("copied");
        copy.textContent = "Copied";
      } catch {
        getSelection()?.selectAllChildren(code);
        copy.textContent = "Press Ctrl-C";
      }
      setTimeout(() => (copy.textContent = "Copy"), 2000);
    },
    { "aria-label": "Copy the command" },
  );
  const root = el(
    "div",
    { className: "command", hidden: true },
    el("span", { className: "hint" }, "The same on the command line"),
    code,
    copy,
  );
  return Object.assign(root, {
    /** @param {string} line */
    set(line) {
      root.hidden = !line;
      code.textContent = line;
    },
  });
}

/** How a job stands: progress, stop, notes, error, its short answer and its command.
 * @param {{brief?: boolean}} [keys] whether the terminal's short answer is shown */
export function jobView(keys = {}) {
  const bar = el("progress", { "aria-label": "progress" });
  const words = el("span");
  /** @type {api.Job | null} */
  let job = null;
  const halt = button("Stop", () => job && api.stop(job.id).catch((error) => view.fail(error)));
  const running = el("div", { className: "running", hidden: true }, bar, words, halt);
  const error = el("p", { className: "error", role: "alert", hidden: true });
  const notes = el("ul", { className: "notes", hidden: true });
  const brief = el("pre", { className: "brief", tabIndex: 0, hidden: true });
  const command = commandLine();
  const root = el("div", { className: "job" }, running, error, notes, keys.brief ? brief : null, command);
  const view = Object.assign(root, {
    /** @param {api.Job} now */
    update(now) {
      job = now;
      const going = now.state === "waiting" || now.state === "running";
      running.hidden = !going;
      if (going && now.parts) {
        bar.max = now.parts;
        bar.value = now.done;
      } else bar.removeAttribute("value");
      words.textContent =
        now.state === "waiting"
          ? "waiting for another job"
          : `${now.stage || now.command}${now.parts ? ` ${Math.floor((100 * now.done) / now.parts)} %` : ""}`;
      if (going) announce(words.textContent);
      else announce(`${now.command}: ${now.state}${now.verdict ? `, ${now.verdict}` : ""}`);
      error.hidden = !now.error;
      error.textContent = now.error ?? "";
      if (now.state === "stopped") {
        error.hidden = false;
        error.textContent = "Stopped.";
      }
      const all = [...now.warnings.map((text) => ["warning", text]), ...now.notes.map((text) => ["note", text])];
      notes.hidden = all.length === 0;
      fill(
        notes,
        all.map(([kind, text]) => el("li", { className: kind }, text)),
      );
      brief.hidden = !now.brief;
      brief.textContent = now.brief ?? "";
      command.set(now.shell);
    },
    /** @param {Error | string} failed */
    fail(failed) {
      running.hidden = true;
      error.hidden = false;
      error.textContent = typeof failed === "string" ? failed : failed.message;
    },
    clear() {
      job = null;
      for (const part of [running, error, notes, brief]) part.hidden = true;
      command.set("");
    },
  });
  return view;
}

/** Hands a text to the browser's downloads. @param {string} name @param {Blob} content */
export function download(name, content) {
  const link = el("a", { href: URL.createObjectURL(content), download: name });
  link.click();
  setTimeout(() => URL.revokeObjectURL(link.href), 1000);
}

/** Saves into the folder and asks before it replaces a file.
 * @param {string} label @param {string} name @param {(name: string, replace: boolean) => Promise<any>} work
 * @param {() => void} [done] */
export function saveAs(label, name, work, done) {
  const input = el("input", { type: "text", value: name, id: unique("save"), size: 18, spellcheck: false });
  const answer = el("span", { className: "answer", role: "status" });
  const replace = button("Replace it", () => go(true), { hidden: true });
  /** @param {boolean} over */
  async function go(over) {
    replace.hidden = true;
    try {
      await work(input.value.trim(), over);
      answer.textContent = `Saved ${input.value.trim()}`;
      done?.();
    } catch (error) {
      answer.textContent = /** @type {Error} */ (error).message;
      replace.hidden = over || /** @type {api.ApiError} */ (error).status !== 409;
    }
  }
  return Object.assign(
    el(
      "form",
      {
        className: "save",
        onsubmit: (/** @type {Event} */ e) => {
          e.preventDefault();
          go(false);
        },
      },
      el("label", { htmlFor: input.id }, label),
      input,
      el("button", { type: "submit" }, "Save"),
      replace,
      answer,
    ),
    { input },
  );
}

/** What may be taken from a job: into the folder or as a download.
 * @type {Record<string, [string, string]>} what → its name for a person and its ending */
const PARTS = {
  document: ["Document", ".json"],
  page: ["Report", ".html"],
  figures: ["Figures", ".svg"],
  full: ["All tables", ".txt"],
  junit: ["JUnit", ".xml"],
};

/** @param {api.Job} job @param {{stem: string, file?: string, onSave?: () => void, readOnly?: boolean}} keys
 * `file`: the name under which its file (params.json, filter.json) is offered */
export function exportMenu(job, keys) {
  const save =
    keys.file && job.has.includes("file") && !keys.readOnly
      ? saveAs("Save", keys.file, (name, replace) => api.saveOf(job.id, { what: "file", name, replace }), keys.onSave)
      : null;
  const links = Object.entries(PARTS)
    .filter(([what]) => job.has.includes(what))
    .map(([what, [name, ending]]) =>
      el(
        "li",
        null,
        el("a", { href: api.href(job.id, what), download: `${keys.stem}${ending}` }, `${name} (${ending.slice(1)})`),
      ),
    );
  const open = job.has.includes("page")
    ? el("li", null, el("a", { href: api.href(job.id, "page"), target: "_blank", rel: "noopener" }, "Open the report"))
    : null;
  return el("div", { className: "export" }, save, details("Export", el("ul", null, open, links)));
}
