// The switch of the LEDs: always in reach, by button and by key.

import { GONE, send } from "./connection.js";
import { $, text } from "./dom.js";

// A stop that does not arrive is sent again until it arrives. Only a person's start ends that.
const PATIENCE_MS = 2500, AGAIN_MS = 500;
let wanted = 0;

async function command(path) {
  const abort = new AbortController(), late = setTimeout(() => abort.abort(), PATIENCE_MS);
  try {
    return (await send(path, undefined, { signal: abort.signal, priority: "high" })).ok;
  } catch {
    return false;
  } finally {
    clearTimeout(late);
  }
}

export async function stop() {
  const mine = ++wanted;
  text($("leds"), "stopping");
  while (mine === wanted && !await command("/api/stop")) {
    if (mine === wanted) $("alarm").hidden = false;
    await new Promise(done => setTimeout(done, AGAIN_MS));
  }
  if (mine === wanted) $("alarm").hidden = true;
}

export async function start() {
  wanted++;
  $("alarm").hidden = true;
  await command("/api/start");
}

const OWN_SPACE = "input, select, textarea, button, a, summary, [contenteditable], [data-keys]";

function pressed(event) {
  if (event.repeat || event.ctrlKey || event.metaKey || event.altKey) return;
  const own = event.key === " " && event.target.closest?.(OWN_SPACE);
  if (event.key !== "Escape" && (event.key !== " " || own)) return;
  event.preventDefault();
  stop();
}

document.addEventListener("keydown", pressed, { capture: true });
// After a click by pointer, the space bar must not press the same button again: it stops.
document.addEventListener("click", event => {
  if (event.detail > 0) event.target.closest?.("button, input[type=checkbox], input[type=radio]")?.blur();
});
$("stop").onclick = stop;
$("start").onclick = $("resume").onclick = $("try-again").onclick = start;

export function show({ camera, light }) {
  const { leds, phase } = camera;
  document.body.dataset.leds = leds;
  const words = {
    on: light.allowed ? "LEDs on" : "stopping",
    off: light.allowed ? "LEDs off" : "LEDs off, stopped",
    unknown: "LEDs unknown: no link to the camera",
  };
  text($("leds"), words[leds] ?? leds);
  // A fault and a missing calibration have buttons of their own.
  $("start").hidden = light.allowed || phase === "fault" || phase === "uncalibrated";
}

// The server does not answer.
export function showGone() {
  document.body.dataset.leds = "unknown";
  text($("leds"), `LEDs unknown: ${GONE.leds}`);
  $("start").hidden = true;
}
