// The line between firmware and host, which a person can shake: bytes are flipped or lost, and the counters count frames.

import { $, text, whole } from "./dom.js";
import { post } from "./requests.js";

// Shares of bytes to damage.
const STEPS = [0, 1e-5, 1e-4, 1e-3], HELD = 1e-3;
const words = share => share === 0 ? "steady" : `1 byte in ${whole(Math.round(1 / share))} is damaged`;
const chosen = () => STEPS[$("damage").value];
let isHeld = false;

const wish = damage => post("/api/line", { damage });
$("damage").oninput = () => wish(chosen());

function hold(now) {
  if (now === isHeld) return;
  isHeld = now;
  $("shake").setAttribute("aria-pressed", now);
  wish(now ? HELD : chosen());
}
$("shake").onpointerdown = event => { $("shake").setPointerCapture(event.pointerId); hold(true); };
$("shake").onkeydown = event => { if ([" ", "Enter"].includes(event.key)) { event.preventDefault(); hold(true); } };
$("shake").onpointerup = $("shake").onpointercancel = $("shake").onkeyup = $("shake").onblur = () => hold(false);

export function show({ line }) {
  $("shaking").hidden = !line;
  if (!line) return;
  text($("damage-text"), words(line.damage));
  $("damage").setAttribute("aria-valuetext", words(line.damage));
  text($("line-bytes"), `${whole(line.bytes)} bytes passed, ${whole(line.flipped)} flipped, ${whole(line.dropped)} lost`);
}
