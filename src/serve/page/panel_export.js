// Numbers for other programs, a filter as source code, and the reports of what was done here.

import * as api from "./api.js";
import { filesOf } from "./panel_replay.js";
import * as state from "./state.js";
import {
  button,
  checkField,
  details,
  download,
  el,
  exportMenu,
  fill,
  jobView,
  saveAs,
  selectField,
  textField,
} from "./ui.js";

const PROGRAMS = [
  "kalibr",
  "openvins",
  "vins",
  "orbslam3",
  "gtsam",
  "px4",
  "ardupilot",
  "matlab",
  "gnss-ins-sim",
  "navego",
  "gazebo",
];
/** @type {[string, string][]} */
const CODE = [
  ["c", "C99"],
  ["rust", "Rust, no_std"],
];
/** What a file is called where the program does not say. @type {Record<string, string>} */
const ENDINGS = {
  kalibr: "yaml",
  openvins: "yaml",
  vins: "yaml",
  orbslam3: "yaml",
  gtsam: "txt",
  px4: "params",
  ardupilot: "parm",
  matlab: "m",
  "gnss-ins-sim": "py",
  navego: "m",
  gazebo: "sdf",
};
const NUMBERS = ["rate", "inflate"];

/** @type {import("./app.js").Panel} */
export const panel = {
  id: "export",
  title: "Export",
  show(root, ctx) {
    /** @param {string} key */
    const own = (key) => state.get(`export.${key}`);
    /** @param {string} kind */
    const names = (kind) => filesOf(ctx, kind);
    const to = selectField("For", [...PROGRAMS, ...CODE], {
      value: own("to"),
      onchange: (to) => {
        state.set({ "export.to": to });
        again();
      },
    });
    const from = selectField("From", [], { onchange: (from) => state.set({ "export.from": from }) });
    const accelerometer = selectField("The unit's accelerometer", []);
    const rate = textField("Rate (Hz)", {
      value: own("rate"),
      hint: "of the log that the program reads, or of its filter's steps",
    });
    const inflate = textField("Inflate by", {
      value: own("inflate"),
      hint: "every white density and drift times this",
    });
    const axis = textField("Axis", {
      value: own("axis"),
      hint: "worst, mean, or a name; of code the one axis to write",
    });
    const walk = textField("Drift as a walk", { value: own("walk"), hint: "least, short, or horizon=60s" });
    const zero = checkField("write zeros where no drift is known", own("zero") === "true");
    const name = textField("Name", { value: own("name") || "drift", hint: "of the files, types and functions" });
    const precision = selectField("Precision", ["float", "double"], { value: own("precision") || "float" });
    const form = selectField(
      "Form",
      [
        ["full", "with its covariance"],
        ["constant-gain", "constant gain"],
      ],
      { value: own("form") || "full" },
    );
    const forPrograms = [accelerometer, inflate, walk, zero];
    const forCode = [name, precision, form];
    const job = jobView();
    const start = button("Write", () => run(), { className: "main" });
    const empty = el("p", { className: "hint" });
    const files = el("div");
    const reports = el("section");
    fill(
      root,
      el(
        "div",
        { className: "controls" },
        el("h2", null, "Export"),
        to,
        from,
        empty,
        accelerometer,
        name,
        precision,
        form,
        details("Options", rate, axis, inflate, walk, zero),
        start,
        job,
      ),
      el("div", { className: "figures" }, files, reports),
    );

    const isCode = () => CODE.some(([value]) => value === to.input.value);

    function request() {
      /** @type {[string, string][]} */
      const texts = [
        ["rate", rate.input.value],
        ["axis", axis.input.value],
      ];
      if (!isCode())
        texts.push(
          ["inflate", inflate.input.value],
          ["walk", walk.input.value],
          ["accelerometer", accelerometer.input.value],
        );
      const given = texts
        .map(([key, value]) => [key, value.trim()])
        .filter(([, value]) => value)
        .map(([key, value]) => [key, NUMBERS.includes(key) ? Number(value) : value]);
      const ending = to.input.value === "c" ? "c" : "rs";
      const code = isCode()
        ? {
            output: `${name.input.value.trim()}.${ending}`,
            code: { precision: precision.input.value, form: form.input.value },
          }
        : {};
      return {
        params: from.input.value,
        to: to.input.value,
        ...Object.fromEntries(given),
        ...code,
        ...(!isCode() && zero.input.checked ? { allow_zero_walk: true } : {}),
      };
    }

    async function run() {
      const fields = { to, from, rate, inflate, axis, walk, name, precision, form };
      state.set({
        ...Object.fromEntries(Object.entries(fields).map(([key, it]) => [`export.${key}`, it.input.value.trim()])),
        "export.zero": zero.input.checked ? "true" : "",
      });
      start.disabled = true;
      job.clear();
      fill(files);
      try {
        // nothing is written by the job: what is there may be named
        const done = await api.run("export", request(), { onJob: job.update, replace: true });
        const stem = from.input.value.replace(/^.*\/|\.json$/g, "");
        /** @type {[string | null, string][]} */
        const all = await api.document_(done.id, "files");
        fill(
          files,
          all.map(([path, text]) => show(path ?? `${stem}-${to.input.value}.${ENDINGS[to.input.value]}`, text)),
        );
      } catch (error) {
        job.fail(/** @type {Error} */ (error));
      }
      start.disabled = false;
    }

    /** @param {string} path @param {string} text */
    function show(path, text) {
      const save = ctx.project.read_only
        ? null
        : saveAs("Save into the folder", path, (name, replace) => api.save({ name, text, replace }), ctx.refresh);
      return el(
        "section",
        null,
        el("h3", null, path),
        el("pre", { tabIndex: 0, "aria-label": path }, text),
        save,
        button("Download", () => download(path.replace(/^.*\//, ""), new Blob([text], { type: "text/plain" })), {
          "aria-label": `Download ${path}`,
        }),
      );
    }

    async function listReports() {
      const { jobs } = await api.project();
      const done = jobs.filter((it) => it.state === "done" && it.has.includes("page")).reverse();
      fill(
        reports,
        el("h2", null, "Reports of what was done here"),
        done.length
          ? done.map((it) =>
              el(
                "section",
                null,
                el("h3", null, it.verdict ? `${it.command}: ${it.verdict}` : it.command),
                el("p", null, el("code", null, it.shell)),
                exportMenu(it, { stem: it.command, readOnly: true }),
              ),
            )
          : el("p", { className: "hint" }, "Nothing yet."),
      );
    }

    function again() {
      const kind = isCode() ? "filter" : "params";
      from.set(names(kind), own("from") || from.input.value);
      accelerometer.set([["", "none"], ...names("params")]);
      forPrograms.forEach((part) => (part.hidden = isCode()));
      forCode.forEach((part) => (part.hidden = !isCode()));
      start.disabled = !from.input.value;
      empty.textContent = from.input.value
        ? ""
        : isCode()
          ? "No filter is in this folder yet: design one, and save it."
          : "No noise parameters are in this folder yet: identify a log, and save them.";
      listReports().catch(job.fail);
    }
    again();
    return again;
  },
};
