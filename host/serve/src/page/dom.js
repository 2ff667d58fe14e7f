// Finds elements of the page, and writes text and numbers into them.

import { MEANINGS } from "./words.js";

export const $ = id => document.getElementById(id);

export const whole = n => n.toLocaleString("en-US").replaceAll(",", "\u202f");
export const rate = n => n >= 100 ? whole(Math.round(n)) : n.toFixed(1);
// A number that is not finite comes as null.
export const fixed = (n, digits) => n === null || n === undefined ? "–" : n.toFixed(digits);
export const frames = n => `${whole(n)} frame${n === 1 ? "" : "s"}`;

// Text of a camera or a file. Control characters and characters that turn the direction of text are shown by their
// numbers, so that no name can imitate other text of the page.
export const foreign = text => String(text).replace(
  /[\u0000-\u001f\u007f-\u009f\u061c\u200b-\u200f\u2028-\u202e\u2060-\u2069\ufeff]/g,
  sign => `\\u{${sign.codePointAt(0).toString(16)}}`);

// Text stays text; it is never read as HTML.
export function text(element, value) {
  if (element.textContent !== value) element.textContent = value;
}

// A text with an explanation, which the keyboard reaches.
export function explained(element, meaning = "") {
  if (element.title === meaning) return;
  element.title = meaning;
  element.tabIndex = meaning ? 0 : -1;
}

// Rows of a definition list: name, value, whether the value is bad news. Names of the glossary get its sentence.
export function list(element, rows) {
  while (element.children.length > 2 * rows.length) element.lastChild.remove();
  while (element.children.length < 2 * rows.length)
    element.append(document.createElement(element.children.length % 2 ? "dd" : "dt"));
  rows.forEach(([name, value, bad], at) => {
    text(element.children[2 * at], name);
    explained(element.children[2 * at], MEANINGS[name]);
    text(element.children[2 * at + 1], value);
    element.children[2 * at + 1].className = bad ? "loss" : "";
  });
}

// The name of a camera, or that of the bench whose feed this is.
export const nameOf = ({ identity, feed, address }) => identity ? `${identity.board} ${identity.serial}` : feed?.name ?? address;

// A number of any size: a unit may be volts or counts.
export const amount = (value, digits) => value !== 0 && Math.abs(value) < 1 ? value.toPrecision(3) : value.toFixed(digits);
