// The server's routes. Paths are relative: the page lives under the token.

/**
 * @typedef {{name: string, kind: string, size: number, modified: number}} Entry
 * @typedef {{version: string, folder: string, read_only: boolean, files: Entry[], jobs: Job[]}} Project
 * @typedef {{id: number, command: string, request: any, shell: string, state: string, stage: string, done: number,
 *   parts: number, notes: string[], warnings: string[], error: string | null, brief: string | null,
 *   verdict: string | null, has: string[]}} Job
 * @typedef {{axes: string[], unit: string, rate: number, samples: number, seconds: number, start: number,
 *   check: any}} Head
 * @typedef {{drafts?: Record<string, any>, replace?: boolean, onJob?: (job: Job) => void,
 * signal?: AbortSignal}} Options
 */

/** What the server refuses, in its own line. */
export class ApiError extends Error {
  /** @param {string} message @param {number} status @param {string[]} [missing] */
  constructor(message, status, missing) {
    super(message);
    this.status = status;
    /** Options of reading that the log needs: `unit`, `rate` … */
    this.missing = missing ?? [];
  }
}

const GONE = "The server does not answer. Start kfdesign serve again, or try again if it still runs.";
/** Failed reconnects before a job's stream is given up; a laptop that wakes up needs one or two. */
const PATIENCE = 5;
const STATES = ["waiting", "running", "done", "failed", "stopped"];

/** Told `true` when the server answers, `false` when it does not. @type {Set<(there: boolean) => void>} */
export const onServer = new Set();

/** @param {boolean} there */
const tell = (there) => onServer.forEach((listener) => listener(there));

/** @param {string} path @param {RequestInit} [init] */
async function ask(path, init) {
  let answer;
  try {
    answer = await fetch(path, init);
  } catch (error) {
    if (error instanceof DOMException && error.name === "AbortError") throw error;
    tell(false);
    throw new ApiError(GONE, 0);
  }
  tell(true);
  if (answer.ok) return answer;
  const said = await answer.json().catch(() => ({}));
  throw new ApiError(said.error ?? `The server refused: ${answer.status}`, answer.status, said.missing);
}

/** @param {string} path @param {any} body @param {AbortSignal} [signal] */
const post = (path, body, signal) =>
  ask(path, { method: "POST", headers: { "content-type": "application/json" }, body: JSON.stringify(body), signal });

/** @param {Record<string, any>} keys */
const query = (keys) =>
  new URLSearchParams(Object.entries(keys).flatMap(([k, v]) => (v === undefined || v === null ? [] : [[k, `${v}`]])));

/** @returns {Promise<Project>} */
export const project = async () => (await ask("api/project")).json();

/** A document of the folder. @param {string} name */
export const file = async (name) => (await ask(`api/document?${query({ name })}`)).json();

/** Address of a part of a result: document, file, page, figures, full, junit, files, curves.
 * @param {number} id @param {string} what */
export const href = (id, what) => `api/jobs/${id}/${what}`;
/** @param {number} id @param {string} [what] */
export const document_ = async (id, what = "document") => (await ask(href(id, what))).json();
/** @param {number} id @param {string} what */
export const text = async (id, what) => (await ask(href(id, what))).text();

/** @param {string} command @param {any} request @param {Options} [options] @returns {Promise<Job>} */
export async function start(command, request, options = {}) {
  const { drafts, replace, signal } = options;
  return (await post("api/jobs", { command, request, drafts, replace }, signal)).json();
}

/** @param {number} id @returns {Promise<Job>} */
export const stop = async (id) => (await ask(`api/jobs/${id}`, { method: "DELETE" })).json();

/** Follows a job to its end: resolves when done, rejects with its error line.
 * @param {Job} job @param {(job: Job) => void} [onJob] @returns {Promise<Job>} */
export function follow(job, onJob) {
  return new Promise((resolve, reject) => {
    const stream = new EventSource(href(job.id, "events"));
    let failures = 0;
    /** @param {Event} event */
    const hear = (event) => {
      failures = 0;
      /** @type {Job} */
      const now = JSON.parse(/** @type {MessageEvent} */ (event).data);
      onJob?.(now);
      if (!["done", "failed", "stopped"].includes(now.state)) return;
      stream.close();
      if (now.state === "done") resolve(now);
      else reject(new ApiError(now.error ?? "stopped", now.state === "stopped" ? 499 : 422));
    };
    STATES.forEach((state) => stream.addEventListener(state, hear));
    stream.onerror = () => {
      if (++failures < PATIENCE && stream.readyState !== EventSource.CLOSED) return;
      stream.close();
      tell(false);
      reject(new ApiError(GONE, 0));
    };
  });
}

/** Starts a job and follows it. @param {string} command @param {any} request @param {Options} [options]
 * @returns {Promise<Job>} */
export async function run(command, request, options = {}) {
  const job = await start(command, request, options);
  options.onJob?.(job);
  return follow(job, options.onJob);
}

/** The document of a quick command; a newer one takes its place on the server.
 * @param {string} command @param {any} request @param {Options} [options] */
export async function preview(command, request, options = {}) {
  return (await post("api/preview", { command, request, drafts: options.drafts }, options.signal)).json();
}

/** @param {{params: any, axis: string, times?: number[], frequencies?: number[]}} asked
 * @returns {Promise<{unit: string, times: number[], deviation: number[], frequencies: number[], density: number[],
 *   terms: {name: string, deviation: number[], density: number[]}[]}>} */
export const curve = async (asked) => (await post("api/curve", asked)).json();

/** What a log is. @param {string} log @param {any} [reading] @param {AbortSignal} [signal] @returns {Promise<Head>} */
export const head = async (log, reading, signal) =>
  (await ask(`api/series?${query({ log, reading: reading && JSON.stringify(reading) })}`, { signal })).json();

/** Time, least and greatest value of every pixel.
 * @param {string} log @param {{axis: number, from?: number, to?: number, points?: number, reading?: any}} what
 * @param {AbortSignal} [signal] */
export async function series(log, what, signal) {
  const { reading, ...keys } = what;
  const path = `api/series?${query({ log, ...keys, reading: reading && JSON.stringify(reading) })}`;
  const view = new DataView(await (await ask(path, { signal })).arrayBuffer());
  const [x, low, high] = [0, 8, 16].map((offset) =>
    Array.from({ length: view.byteLength / 24 }, (_, i) => view.getFloat64(24 * i + offset, true)),
  );
  return { x, low, high };
}

/** @param {string} name @param {Blob} content */
export const upload = (name, content) =>
  ask(`api/upload/${encodeURIComponent(name)}`, { method: "PUT", body: content });

/** @param {{name: string, document?: any, text?: string, replace?: boolean}} what @returns {Promise<{name: string}>} */
export const save = async (what) => (await post("api/save", what)).json();
/** @param {number} id @param {{what: string, name: string, replace?: boolean}} what
 * @returns {Promise<{name: string}>} */
export const saveOf = async (id, what) => (await post(`${href(id, "save")}`, what)).json();

/** One request at a time and always the newest: while one is under way, only the last of those asked for is kept.
 * @template A, R
 * @param {(asked: A) => Promise<R>} work @param {(result: R, asked: A) => void} show
 * @param {(error: Error) => void} fail @returns {(asked: A) => void} */
export function latest(work, show, fail) {
  /** @type {{asked: A} | null} */
  let next = null;
  let busy = false;
  return async (asked) => {
    next = { asked };
    if (busy) return;
    busy = true;
    while (next) {
      const { asked: now } = /** @type {{asked: A}} */ (next);
      next = null;
      try {
        const result = await work(now);
        show(result, now);
      } catch (error) {
        // a newer one will say how things are
        if (!next) fail(/** @type {Error} */ (error));
      }
    }
    busy = false;
  };
}
