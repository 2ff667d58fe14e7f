// The connection to the camera's program, which runs in this page: in a worker, as WebAssembly.

import { moment } from "./age.js";
import { $, text } from "./dom.js";
import { choose, isAsked, isOffered } from "./usb.js";

// What the page says while the program does not answer.
export const GONE = { line: "the program in this page does not answer", leds: "no answer from the program in this page" };

const isReal = isAsked(location.href);
const worker = new Worker(new URL(`worker.js${location.search}`, import.meta.url), { type: "module" });
const waiting = new Map();
let commands = 0, stopped = false;

// Sends a command. Returns whether the program has executed the command, and the text of the answer.
export function send(path, body) {
  // The simulated LEDs of a program that has stopped are gone with it; those of a real camera go out when it misses its host.
  if (stopped) return Promise.resolve({ ok: path === "/api/stop" && !isReal, isDark: !isReal, text: "the program in this page has stopped; reload the page" });
  return new Promise(answered => {
    waiting.set(++commands, answered);
    worker.postMessage({ id: commands, path, body: body ?? "" });
  });
}

// Calls `show` with each message and the moment at which it was true, and `gone` with a line of text when no more messages come.
export function listen(show, gone) {
  const stop = why => {
    stopped = true;
    worker.terminate();
    for (const answered of waiting.values()) answered({ ok: false, text: why });
    waiting.clear();
    gone(`${why}. Reload the page to start again.`);
  };
  worker.onmessage = ({ data }) => {
    if (data.stopped) stop(data.stopped);
    else if (data.loading) text($("line"), data.loading);
    else if (data.message) show(JSON.parse(data.message), moment());
    else { waiting.get(data.id)?.(data); waiting.delete(data.id); }
  };
  worker.onerror = event => stop(`The program of this page did not start: ${event.message ?? "worker.js cannot be read"}`);
  // A hidden page does not compute.
  const look = () => worker.postMessage({ paused: document.hidden });
  document.addEventListener("visibilitychange", look);
  look();
}

// The scene comes first here.
$("scene").open = true;
document.querySelector("main").prepend($("scene"));

// The lesson lies in the same folder.
const lesson = document.createElement("a");
lesson.href = "./lesson.html";
lesson.textContent = "lesson";
$("camera").after(lesson);

// From the virtual camera to one on USB and back, by loading the page again.
if (isReal || isOffered()) {
  const button = document.createElement("button"), answer = document.createElement("span");
  button.id = "other-camera";
  button.textContent = isReal ? "Use the virtual camera" : "Use a camera on USB";
  answer.setAttribute("role", "status");
  button.onclick = async () => {
    try {
      if (!isReal) await choose();
      location.search = isReal ? "" : "?camera=usb";
    } catch (error) {
      text(answer, `no camera was chosen: ${error.message}`);
    }
  };
  $("camera").after(button, answer);
}
text($("no-record"), "recordings: with nirspi serve");
