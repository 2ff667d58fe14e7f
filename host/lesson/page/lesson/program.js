// Questions to the lesson's program, and what the sections of the page share.

const worker = new Worker(new URL("worker.js", import.meta.url), { type: "module" });
const waiting = new Map();
let questions = 0;

export const $ = id => document.getElementById(id);
export const SIDE = 32, PATTERNS = SIDE * SIDE;

worker.onmessage = ({ data: { id, numbers, problem } }) => {
  const { done, failed } = waiting.get(id);
  waiting.delete(id);
  if (problem === undefined) done(numbers); else failed(new Error(problem));
};
worker.onerror = event => problem(new Error(event.message ?? "worker.js cannot be read"));

// Asks the program. Questions are answered in their order: questions that belong together are asked without waiting in between.
const asked = (name, given, rest) => new Promise((done, failed) => {
  waiting.set(++questions, { done, failed });
  worker.postMessage({ id: questions, name, given, rest });
});
export const ask = (name, ...rest) => asked(name, null, rest);
export const askWith = (name, given, ...rest) => asked(name, given, rest);

export function problem(error) {
  $("dead").hidden = false;
  $("dead").textContent = `The program of this page cannot go on: ${error.message}`;
}

const listeners = [];
// Tells every section that the scene, or the order, is another one.
export function changed() { for (const listener of listeners) listener(); }

// Keeps a section up to date while the section is on the screen: `refresh` asks the program and draws. Returns a function that
// asks for a refresh. Refreshes do not overlap: what changes meanwhile is seen by one more.
export function live(id, refresh) {
  let isSeen = false, isOld = true, isBusy = false;
  async function go() {
    if (isBusy) return;
    isBusy = true;
    try {
      while (isSeen && isOld) {
        isOld = false;
        await refresh();
      }
    } catch (error) {
      problem(error);
    }
    isBusy = false;
  }
  const again = () => { isOld = true; go(); };
  new IntersectionObserver(([{ isIntersecting }]) => { isSeen = isIntersecting; go(); }, { rootMargin: "200px" }).observe($(id));
  listeners.push(again);
  return again;
}

// One order for the whole page.
const ORDERS = { "cake-cutting": "few blocks first", "zig-zag": "zig-zag", "russian-dolls": "Russian dolls", natural: "natural",
  "random:1": "shuffled" };
let current = "cake-cutting";
export const order = () => current;
for (const select of document.querySelectorAll("[data-order]")) {
  for (const [name, text] of Object.entries(ORDERS)) select.append(new Option(text, name));
  select.onchange = () => {
    current = select.value;
    for (const other of document.querySelectorAll("[data-order]")) other.value = current;
    changed();
  };
}

export const percent = (share, digits = 0) => `${(100 * share).toFixed(digits)} %`;
export const errorText = error => `error ${percent(error, 1)} of white`;

// Presses a button at a pace until it is pressed again, or `step` answers that there is no more.
export function player(button, step, wait_ms) {
  let timer = 0;
  const stop = () => {
    clearTimeout(timer);
    timer = 0;
    button.setAttribute("aria-pressed", "false");
    button.textContent = "Play";
  };
  const go = () => { timer = setTimeout(go, wait_ms()); if (!step()) stop(); };
  button.onclick = () => {
    if (timer) return stop();
    button.setAttribute("aria-pressed", "true");
    button.textContent = "Pause";
    go();
  };
  return stop;
}
