import { fill } from "./ui.js";

/** @type {import("./app.js").Panel} */
export const panel = { id: "compare", title: "Compare", show(root) { fill(root, "in work"); } };
