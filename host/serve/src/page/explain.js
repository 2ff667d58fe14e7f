// Shows what a word or a control means, at the lower edge of the page: by keyboard for what has the focus, by touch for what was
// touched. A mouse sees the same words as the browser's own tooltip.

import { $, text } from "./dom.js";

// The explanations of an element and of what it is in.
function words(element) {
  const found = [];
  for (let at = element.closest("[title]"); at; at = at.parentElement.closest("[title]")) found.push(at.title.replace(/\s+/g, " "));
  return found.filter(Boolean).join(" ");
}

function explain(element) {
  text($("explains"), words(element));
  $("explains").hidden = $("explains").textContent === "";
}

document.addEventListener("focusin", ({ target }) => {
  if (!target.matches(":focus-visible")) return;
  explain(target);
  if (!target.hasAttribute("aria-describedby")) target.setAttribute("aria-describedby", "explains");
});
document.addEventListener("focusout", ({ target }) => {
  explain(document.body);
  if (target.getAttribute("aria-describedby") === "explains") target.removeAttribute("aria-describedby");
});
document.addEventListener("click", ({ target, pointerType }) => { if (pointerType !== "mouse") explain(target); });
