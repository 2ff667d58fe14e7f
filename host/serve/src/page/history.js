// The last images, to look at again. The oldest go first.

import { $, text } from "./dom.js";

const MOST = 300;
const kept = [];
let back = 0;
export const onLook = { call: () => {} };

export const isLive = () => back === 0;

// The message to show: the newest, or an earlier one.
export const looked = newest => back === 0 ? newest : kept[kept.length - 1 - back] ?? newest;

export function keep(message) {
  if (!message.image || kept.at(-1)?.state.images.shown === message.state.images.shown) return say();
  kept.push({ ...message, at: Date.now() });
  if (kept.length > MOST) kept.shift();
  // The image that is looked at stays the same while newer ones arrive.
  if (back > 0) back = Math.min(back + 1, kept.length - 1);
  say();
}

function say() {
  $("scrub").max = Math.max(kept.length - 1, 0);
  $("scrub").value = kept.length - 1 - back;
  $("live").disabled = back === 0;
  const words = back === 0 ? "live"
    : `${back} image${back === 1 ? "" : "s"} back, ${((Date.now() - kept[kept.length - 1 - back].at) / 1000).toFixed(1)} s ago`;
  text($("scrub-text"), words);
  document.body.dataset.view = back === 0 ? "live" : "earlier";
}

// No more images arrive.
export function showGone(age) {
  if (back === 0) text($("scrub-text"), age);
}

function look(wanted) {
  back = Math.max(0, Math.min(kept.length - 1, wanted));
  say();
  // Said once, and not with each image that comes.
  $("scrub").setAttribute("aria-valuetext", $("scrub-text").textContent);
  onLook.call();
}
$("scrub").oninput = () => look(kept.length - 1 - $("scrub").value);
$("live").onclick = () => look(0);
