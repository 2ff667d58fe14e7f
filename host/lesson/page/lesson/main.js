// The lesson: starts the program and shows the first scene.

import { $, changed } from "./program.js";
import { show } from "./draw.js";
import "./steps.js";
import "./atoms.js";
import "./weather.js";

await show("letter:R");
$("dead").hidden = !$("scene-problem").textContent;
// Plots have as many pixels as the screen.
addEventListener("resize", changed);
matchMedia("(prefers-color-scheme: dark)").addEventListener("change", changed);
