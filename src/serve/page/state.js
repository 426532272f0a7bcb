// What is looked at, in the fragment of the address: reload, bookmark and the back button find it again.

/** @typedef {Record<string, string>} View */

/** @returns {View} */
const read = () => Object.fromEntries(new URLSearchParams(location.hash.slice(1)));

let now = read();
/** @type {Set<(view: View) => void>} */
const listeners = new Set();
let timer = 0;

/** Browsers limit how often an address may change; a drag changes it with every pixel. */
const PAUSE = 250;

function write() {
  timer = 0;
  history.replaceState(null, "", `#${new URLSearchParams(now)}`);
}

/** @param {string} key @param {string} [otherwise] */
export const get = (key, otherwise = "") => now[key] ?? otherwise;

/** @param {string} key */
export const number = (key) => (now[key] === undefined || now[key] === "" ? undefined : Number(now[key]));

/** A slider's value as the address keeps it. @param {number} value */
export const digits4 = (value) => `${Number(value.toPrecision(4))}`;

/** Sets keys; `undefined`, `null` and "" take one away. A step that the back button should undo is `push`ed.
 * @param {Record<string, string | number | null | undefined>} values @param {boolean} [push] */
export function set(values, push = false) {
  const next = { ...now };
  for (const [key, value] of Object.entries(values)) {
    if (value === undefined || value === null || value === "") delete next[key];
    else next[key] = `${value}`;
  }
  if (`${new URLSearchParams(next)}` === `${new URLSearchParams(now)}`) return;
  if (push && timer) {
    clearTimeout(timer);
    write();
  }
  now = next;
  if (push) history.pushState(null, "", `#${new URLSearchParams(now)}`);
  else timer ||= window.setTimeout(write, PAUSE);
}

/** Told when the address changed by the back button or by hand. @param {(view: View) => void} listener */
export const onChange = (listener) => listeners.add(listener);

addEventListener("popstate", () => {
  clearTimeout(timer);
  timer = 0;
  now = read();
  listeners.forEach((listener) => listener(now));
});
addEventListener("pagehide", () => timer && write());
