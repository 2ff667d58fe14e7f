// The settings of the images, of the measurement and of recordings.

import { $, explained, frames, text } from "./dom.js";
import { change, isTouched } from "./requests.js";
import { MEANINGS } from "./words.js";

// A label's own control has the focus for it.
for (const word of document.querySelectorAll("[data-word]")) {
  if (word.tagName === "LABEL") word.title = MEANINGS[word.dataset.word]; else explained(word, MEANINGS[word.dataset.word]);
}

function methods({ methods, about }) {
  const box = $("methods");
  if (box.dataset.of === methods.join()) return;
  box.dataset.of = methods.join();
  box.querySelectorAll("label").forEach(label => label.remove());
  for (const [at, method] of methods.entries()) {
    const label = document.createElement("label"), input = document.createElement("input");
    Object.assign(input, { type: "radio", name: "method", value: method });
    label.title = about[at];
    input.onchange = () => change({ method });
    label.append(input, method);
    box.append(label);
  }
}

// The options of a choice: names, each with what it is.
function options(select, names, about = []) {
  if (select.dataset.of === names.join()) return;
  select.dataset.of = names.join();
  select.replaceChildren(...names.map((name, at) => {
    const option = new Option(name, name);
    option.title = about[at] ?? "";
    return option;
  }));
}

// A field that a person edits is not set.
function put(id, value) {
  if (document.activeElement !== $(id)) $(id).value = value;
}

function sum(count) {
  text($("frames-text"), frames(count));
  $("frames").setAttribute("aria-valuetext", frames(count));
}

export function show({ settings, offered }) {
  methods(offered);
  options($("model"), offered.models);
  const orders = offered.orders.map(order => order.name), isOther = !orders.includes(settings.order);
  options($("order"), isOther ? [settings.order, ...orders] : orders,
    [...isOther ? ["the order of the command line"] : [], ...offered.orders.map(order => order.about)]);
  for (const word of ["order", "sampling", "sweep"]) {
    document.querySelector(`label[data-word=${word}]`).hidden = offered.fixed;
  }
  for (const label of document.querySelectorAll("[data-networks]")) label.hidden = offered.models.length === 0;
  document.querySelector("label[data-word=recursive]").hidden = offered.with_warm_start.length === 0;
  $("record").hidden = !offered.records;
  $("no-record").hidden = offered.records;
  if (isTouched()) return;
  for (const input of $("methods").querySelectorAll("input")) input.checked = input.value === settings.method;
  $("strength").disabled = !offered.with_strength.includes(settings.method);
  put("strength", settings.strength ?? "");
  $("warm-start").disabled = !offered.with_warm_start.includes(settings.method);
  $("warm-start").checked = settings.warm_start;
  $("enhance").checked = settings.enhance;
  $("model").disabled = !settings.enhance;
  put("model", settings.model);
  put("frames", Math.round(Math.log2(settings.frames)));
  sum(settings.frames);
  put("order", settings.order);
  $("order").title = offered.orders.find(order => order.name === settings.order)?.about ?? "";
  put("sampling", +(100 * settings.sampling).toFixed(2));
  put("sweeps", settings.sweeps);
  $("record").setAttribute("aria-pressed", settings.record);
  text($("record"), settings.record ? "End the recording" : "Record");
}

// A number from a field; a text that is no number goes to the server, which says what is expected.
const number = id => Number.isNaN($(id).valueAsNumber) ? $(id).value : $(id).valueAsNumber;

$("warm-start").onchange = () => change({ warm_start: $("warm-start").checked });
$("enhance").onchange = () => change({ enhance: $("enhance").checked });
$("model").onchange = () => change({ model: $("model").value });
$("strength").onchange = () => change({ strength: $("strength").value === "" ? "auto" : number("strength") });
$("order").onchange = () => change({ order: $("order").value });
$("sampling").onchange = () => change({ sampling: number("sampling") / 100 });
$("sweeps").onchange = () => change({ sweeps: number("sweeps") });
$("record").onclick = () => change({ record: $("record").getAttribute("aria-pressed") !== "true" });
$("frames").oninput = () => {
  const wanted = 2 ** $("frames").value;
  sum(wanted);
  change({ frames: wanted });
};
