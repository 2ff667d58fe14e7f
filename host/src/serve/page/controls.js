// The settings of the images.

import { $, frames, text } from "./dom.js";
import { change, isTouched } from "./requests.js";

export function show({ settings, offered }) {
  const box = $("methods");
  if (box.dataset.of !== offered.methods.join()) {
    box.dataset.of = offered.methods.join();
    box.querySelectorAll("label").forEach(label => label.remove());
    for (const [at, method] of offered.methods.entries()) {
      const label = document.createElement("label"), input = document.createElement("input");
      Object.assign(input, { type: "radio", name: "method", value: method });
      label.title = offered.about[at];
      input.onchange = () => change({ method });
      label.append(input, method);
      box.append(label);
    }
  }
  if (isTouched()) return;
  for (const input of box.querySelectorAll("input")) input.checked = input.value === settings.method;
  $("enhance").checked = settings.enhance;
  $("frames").value = Math.round(Math.log2(settings.frames));
  text($("frames-text"), frames(settings.frames));
}

$("enhance").onchange = () => change({ enhance: $("enhance").checked });
$("frames").oninput = () => {
  const wanted = 2 ** $("frames").value;
  text($("frames-text"), frames(wanted));
  change({ frames: wanted });
};
