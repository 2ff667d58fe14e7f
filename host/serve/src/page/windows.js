// The windows of this page in one browser share its few connections to a server: six in most browsers. One window, the one that
// was looked at last, asks for every image; the others ask twice a second. While a stop is under way, no window asks.

const HUSH_MS = 1000, ANNOUNCE_MS = 1000, GONE_MS = 2500;
const me = Math.random();
const channel = "BroadcastChannel" in window ? new BroadcastChannel("nirspi") : null;
let first = null, heard = performance.now(), hushedUntil = -Infinity;

// Called when no window may ask any more.
export const onHush = { call: () => {} };

function hushFor(ms) {
  hushedUntil = performance.now() + ms;
  if (ms > 0) onHush.call();
}

// No window asks for a second, or until `unhush`.
export function hush() {
  channel?.postMessage({ hush: HUSH_MS });
  hushFor(HUSH_MS);
}
export function unhush() {
  channel?.postMessage({ hush: 0 });
  hushFor(0);
}
export const isHushed = () => performance.now() < hushedUntil;

export const isFirst = () => !channel || first === me;

function claim(isLookedAt) {
  first = me;
  channel?.postMessage({ first: me, isLookedAt });
}

channel?.addEventListener("message", ({ data }) => {
  if ("hush" in data) return hushFor(data.hush);
  heard = performance.now();
  // Of two windows that take themselves for the first one, one goes on.
  if (data.isLookedAt || first !== me || data.first > me) first = data.first;
});
window.addEventListener("focus", () => claim(true));
setInterval(() => {
  if (document.hidden) { if (first === me) first = null; return; }
  if (first === me || performance.now() - heard > GONE_MS) claim(false);
}, ANNOUNCE_MS);
if (document.hasFocus()) claim(true);
