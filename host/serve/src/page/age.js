// How old what the page shows is. A connection may go silent without ending, and a computer may sleep: the age alone says whether
// a state still holds.

// The server has two new states a second at least. With the time between two looks, no state stays longer than 2.5 s.
export const FRESH_MS = 2250;
const LOOK_MS = 250;

// A moment. One of the clocks may stand still while the computer sleeps, the other one may be set: the larger age counts.
export const moment = (agoMs = 0) => [performance.now() - agoMs, Date.now() - agoMs];
export const since = from => Math.max(...moment().map((now, at) => now - from[at]));

// Calls `look` so often that no state stays longer than FRESH_MS, and at once when the page is looked at again.
export function watch(look) {
  setInterval(look, LOOK_MS);
  document.addEventListener("visibilitychange", look);
  document.addEventListener("resume", look);
  for (const name of ["pageshow", "focus", "online", "offline"]) window.addEventListener(name, look);
}

export const words = ms => Number.isFinite(ms) ? `last seen ${Math.max(0, ms / 1000).toFixed(0)} s ago` : "not seen yet";
