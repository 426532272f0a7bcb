import { fill } from "./ui.js";

/** @type {import("./app.js").Panel} */
export const panel = { id: "noise", title: "Noise", show(root) { fill(root, "in work"); } };
