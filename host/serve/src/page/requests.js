// Sends commands to the server. A refusal is kept, and shown with the notes.

import { send } from "./connection.js";

export const answer = { refused: "" };

// The server is gone: set by main.js.
export const onGone = { call: () => {} };

export async function post(path, body) {
  try {
    const got = await send(path, body === undefined ? undefined : JSON.stringify(body));
    answer.refused = got.ok ? "" : got.text;
    return got.ok ? JSON.parse(got.text) : null;
  } catch {
    onGone.call();
    return null;
  }
}

// A control that was touched is not set back by a message that was under way.
let touched = -Infinity;
export const isTouched = () => performance.now() - touched < 1000;

export function change(wish) {
  touched = performance.now();
  return post("/api/settings", wish);
}
