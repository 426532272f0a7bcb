import { fill } from "./ui.js";

/** @type {import("./app.js").Panel} */
export const panel = { id: "log", title: "Log", show(root) { fill(root, "in work"); } };
