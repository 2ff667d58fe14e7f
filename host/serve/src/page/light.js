// The switch of the LEDs: always in reach, by button and by key.

import { FRESH_MS, words as lastSeen } from "./age.js";
import { GONE, send } from "./connection.js";
import { $, foreign, text } from "./dom.js";
import { say } from "./speech.js";
import { hush, unhush } from "./windows.js";

// A stop is sent again until the camera has confirmed that its LEDs are off. Only a person's start ends that.
const ALARM_MS = 1000, AGAIN_MS = 1000, PATIENCE_MS = 3000;
const ALARMS = {
  sent: "The command to switch the LEDs off has not arrived, and is sent again. Cover the lens or unplug the camera: while nirspi "
    + "serve runs, the LEDs may stay on.",
  arrived: "The camera has not confirmed that its LEDs are off, and is asked again. Cover the lens or unplug the camera: the LEDs "
    + "may still be on.",
};
// The stop that is under way.
let stopping = null;
const pause = ms => new Promise(done => setTimeout(done, ms));

async function command(path) {
  const abort = new AbortController(), late = setTimeout(() => abort.abort(), PATIENCE_MS);
  try {
    return await send(path, undefined, { signal: abort.signal, priority: "high" });
  } catch {
    return { ok: false };
  } finally {
    clearTimeout(late);
  }
}

export async function stop() {
  const mine = stopping = { command: null, isDone: false };
  text($("leds"), "stopping");
  hush();
  while (mine === stopping && !mine.isDone) {
    // An answer that is late does not keep the next command.
    command("/api/stop").then(({ ok, text, isDark }) => {
      if (!ok || mine !== stopping) return;
      unhush();
      if (isDark) finish(mine); else mine.command ??= JSON.parse(text).command;
    });
    setTimeout(() => alarm(mine), ALARM_MS);
    await pause(AGAIN_MS);
  }
}

function alarm(mine) {
  if (mine !== stopping || mine.isDone) return;
  warn(ALARMS[mine.command === null ? "sent" : "arrived"]);
}

function warn(words) {
  text($("alarm"), words);
  $("alarm").hidden = words === "";
  say("alarm", words);
}

function finish(mine) {
  mine.isDone = true;
  warn("");
}

export async function start() {
  stopping = null;
  warn("");
  await command("/api/start");
}

const OWN_SPACE = "input, select, textarea, button, a, summary, [contenteditable], [data-keys]";

function pressed(event) {
  if (document.body.dataset.leds === "none") return;
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

// How old the camera's word that its LEDs are off was in the newest state; null while the state says anything else.
let offAge = null;

export function show({ camera, light }) {
  const { leds, phase } = camera;
  offAge = leds === "off" ? camera.leds_age_ms : null;
  document.body.dataset.leds = leds;
  // A feed: this program switches no LEDs.
  if (leds === "none") return;
  const isStopping = leds === "on" && !light.allowed, known = isStopping ? "stopping" : leds === "off" && !light.allowed
    ? "LEDs off, stopped" : `LEDs ${foreign(leds)}`;
  if (leds === "unknown") unknown(lastSeen(camera.leds_age_ms), "no answer from the camera");
  else text($("leds"), known);
  // What follows a stop is said at once: the LEDs are off, or the alarm.
  if (leds !== "unknown" && !isStopping) say("leds", known);
  // A fault and a missing calibration have buttons of their own.
  $("start").hidden = light.allowed || phase === "fault" || phase === "uncalibrated";
  // A state from before the command confirms nothing.
  const isAfter = stopping?.command && light.commands >= stopping.command;
  if (isAfter && leds === "off" && !light.allowed) finish(stopping);
}

function unknown(age, why) {
  text($("leds"), `LEDs unknown, ${age}: ${why}`);
  say("leds", `LEDs unknown: ${why}`);
}

// The newest state is so old. The camera's word that the state brought is older, and other hosts may have the camera since.
export function age(stateAge) {
  if (offAge === null || offAge + stateAge <= FRESH_MS) return;
  document.body.dataset.leds = "unknown";
  unknown(lastSeen(offAge + stateAge), "no answer from the camera");
}

// There is no state of the last seconds.
export function showGone(age) {
  if (document.body.dataset.leds === "none") return;
  document.body.dataset.leds = "unknown";
  unknown(age, GONE.leds);
  $("start").hidden = true;
}
