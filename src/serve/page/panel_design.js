import { fill } from "./ui.js";

/** @type {import("./app.js").Panel} */
export const panel = { id: "design", title: "Design", show(root) { fill(root, "in work"); } };
