// Step 1: the scene, drawn or written.

import { drawable } from "../page/brush.js";
import { $, PATTERNS, SIDE, askWith, changed, problem } from "./program.js";
import { grey } from "./pictures.js";

const canvas = $("drawing"), pen = canvas.getContext("2d", { willReadFrequently: true });
let sending = 0;
// The reflectance of each square.
export let scene = new Float64Array(PATTERNS);

function levels() {
  const { data } = pen.getImageData(0, 0, SIDE, SIDE);
  return Array.from({ length: PATTERNS }, (_, at) => data[4 * at] / 255);
}

// The scene, then its light.
function took(numbers) {
  scene = numbers.slice(0, PATTERNS);
  $("all-light").textContent = numbers[PATTERNS].toFixed(1);
  changed();
}

function sendSoon() {
  sending ||= setTimeout(() => {
    sending = 0;
    askWith("scene_drawn", levels()).then(took, problem);
  }, 60);
}

// Shows a scene by name: letter:R, word:NIR, white.
export async function show(name) {
  try {
    const levels = await askWith("scene_named", name);
    grey(canvas, levels);
    $("scene-problem").textContent = "";
    took(levels);
  } catch (error) {
    $("scene-problem").textContent = error.message;
  }
}

function fill(level) {
  pen.fillStyle = `rgb(${level} ${level} ${level})`;
  pen.fillRect(0, 0, SIDE, SIDE);
}

drawable(canvas, pen, SIDE, 1, sendSoon, words => { $("drawing-says").textContent = words; });

$("clear").onclick = () => { fill(0); sendSoon(); };
$("white").onclick = () => show("white");
$("dot").onclick = () => {
  fill(0);
  pen.fillStyle = "#fff";
  pen.fillRect(11, 9, 1, 1);
  sendSoon();
};
$("letter-form").onsubmit = event => {
  event.preventDefault();
  const word = $("letter").value.trim();
  if (word) show([...word].length === 1 ? `letter:${word}` : `word:${word}`);
};
