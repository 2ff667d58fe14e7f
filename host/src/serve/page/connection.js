// The connection to the camera's program: here, to the server `nirspi serve`. In the page that needs no server, the file
// host/web/page/connection.js takes the place of this one.

// What the page says while the program does not answer.
export const GONE = { line: "nirspi serve does not answer; trying again", leds: "no answer from nirspi serve" };

// Sends a command. Returns whether the program has executed the command, and the text of the answer.
export async function send(path, body, { signal, priority } = {}) {
  const got = await fetch(path, { method: "POST", body, signal, priority, keepalive: priority === "high" });
  return { ok: got.ok, text: await got.text() };
}

// Calls `show` with each message, and `gone` with a line of text when no more messages come.
export function listen(show, gone) {
  let source = null, again = 0;
  // A hidden page closes its connection: browsers keep few connections to one address open.
  const look = () => {
    clearTimeout(again);
    source?.close();
    source = null;
    if (document.hidden) return;
    source = new EventSource("/events");
    source.onmessage = event => show(JSON.parse(event.data));
    source.onerror = () => { gone(GONE.line); source.close(); again = setTimeout(look, 1000); explain(gone); };
  };
  document.addEventListener("visibilitychange", look);
  look();
}

// Why there is no stream, if the server answers: it may want another token, or have too many pages.
async function explain(gone) {
  try {
    const answer = await fetch("/api/state");
    gone(answer.ok ? "the stream of images has ended, or too many pages are open; trying again" : (await answer.text()).trim());
  } catch {
    // Nobody answers: the page says so already.
  }
}
