// The connection to the camera's program: here, to the server `nirspi serve`. In the page that needs no server, the file
// host/web/page/connection.js takes the place of this one.
//
// The page asks for one state after the other. An answer comes after its question and says how old it is, so the age of what
// the page shows is known whatever lies between: a stream would go on with old states. No question lasts, so no window keeps a
// connection from another one's stop.

import { moment } from "./age.js";
import { isFirst, isHushed, onHush } from "./windows.js";

// What the page says while the program does not answer.
export const GONE = { line: "nirspi serve does not answer; trying again", leds: "no answer from nirspi serve" };

// A question to which nothing comes for so long is asked again, over another connection.
const SILENT_MS = 2500, AGAIN_MS = 1000, SECOND_WINDOW_MS = 450, LOOK_MS = 30;
const page = Math.floor(Math.random() * 2 ** 48);
const pause = ms => new Promise(done => setTimeout(done, ms));

// Sends a command. Returns whether the program has executed the command, and the text of the answer.
export async function send(path, body, { signal, priority } = {}) {
  const got = await fetch(`.${path}`, { method: "POST", body, signal, priority, keepalive: priority === "high" });
  return { ok: got.ok, text: refusal(got, await got.text()) };
}

// The program refuses in one plain line. A proxy or another server has pages of its own.
const refusal = (got, text) => got.ok || got.headers.get("Content-Type")?.startsWith("text/plain") ? text
  : `HTTP status ${got.status}, and not from nirspi serve: a server between this page and nirspi serve has answered`;

// Calls `show` with each message and the moment at which it was true at the latest, and `gone` with a line of text when no more come.
export async function listen(show, gone) {
  let seen = "", asking = null;
  onHush.call = () => asking?.abort();
  document.addEventListener("visibilitychange", () => { if (document.hidden) asking?.abort(); });
  while (true) {
    // A hidden page does not ask.
    while (document.hidden || isHushed()) await pause(LOOK_MS);
    const abort = asking = new AbortController(), asked = moment();
    let message = null, age = 0;
    try {
      [message, age] = await answer(`./api/next?seen=${seen}&page=${page}`, abort);
    } catch (error) {
      // Given up by this page itself.
      if (error.name === "AbortError" && !abort.isLate) continue;
      gone(error.refusal ?? GONE.line);
      await pause(AGAIN_MS);
      continue;
    }
    seen = message.state.number;
    show(message, asked.map(time => time - age));
    if (!isFirst()) await pause(SECOND_WINDOW_MS);
  }
}

// Bytes that come slowly are an answer too.
async function answer(address, abort) {
  let late = 0;
  const alive = () => {
    clearTimeout(late);
    late = setTimeout(() => { abort.isLate = true; abort.abort(); }, SILENT_MS);
  };
  alive();
  try {
    const got = await fetch(address, { signal: abort.signal, cache: "no-store" }), parts = [];
    for (const reader = got.body.getReader(); ;) {
      const { done, value } = await reader.read();
      if (done) break;
      alive();
      parts.push(value);
    }
    const text = await new Blob(parts).text();
    if (!got.ok) throw Object.assign(new Error(), { refusal: refusal(got, text).trim() });
    return [JSON.parse(text), Number(got.headers.get("State-Age-Ms"))];
  } finally {
    clearTimeout(late);
  }
}
