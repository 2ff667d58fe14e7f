// What a screen reader says of its own accord. The page changes many times a second: each part is said when it has changed, and once
// in 5 s at most. What answers a key is said at once.

import { text } from "./dom.js";

const EVERY_MS = 5000;

// A reader speaks of elements that were there before their text.
function region(how) {
  const element = document.createElement("p");
  element.className = "heard";
  element.setAttribute("aria-live", how);
  document.body.append(element);
  return { element, wanted: "", timer: 0 };
}
const regions = {
  leds: region("assertive"), alarm: region("assertive"), camera: region("polite"), notes: region("polite"), scene: region("polite"),
  answer: region("polite"),
};

function speak(part) {
  part.timer = 0;
  if (part.element.textContent === part.wanted) return;
  text(part.element, part.wanted);
  part.timer = setTimeout(() => speak(part), EVERY_MS);
}

export function say(name, words) {
  regions[name].wanted = words;
  if (!regions[name].timer) speak(regions[name]);
}

export const answer = words => text(regions.answer.element, words);
