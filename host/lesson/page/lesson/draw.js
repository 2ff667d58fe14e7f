// Step 1: the scene, drawn or written.

import { $, PATTERNS, SIDE, askWith, changed, problem } from "./program.js";
import { grey } from "./pictures.js";

const canvas = $("drawing"), pen = canvas.getContext("2d", { willReadFrequently: true });
let brush = [SIDE / 2, SIDE / 2], last = null, box = null, sending = 0;
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

function paint(from, to) {
  const level = Math.round(255 * $("brush-level").value);
  pen.strokeStyle = `rgb(${level} ${level} ${level})`;
  pen.lineWidth = Number($("brush-size").value);
  pen.lineCap = "round";
  pen.beginPath();
  pen.moveTo(...from);
  pen.lineTo(to[0] + .01, to[1]);
  pen.stroke();
  sendSoon();
}

// Where the canvas was when the pen came down: a page that moves meanwhile does not bend the stroke.
const at = event => [(event.clientX - box.left) / box.width * SIDE, (event.clientY - box.top) / box.height * SIDE];
canvas.onpointerdown = event => {
  canvas.setPointerCapture(event.pointerId);
  box = canvas.getBoundingClientRect();
  last = at(event);
  paint(last, last);
};
canvas.onpointermove = event => {
  if (!last) return;
  const to = at(event);
  paint(last, to);
  last = to;
};
canvas.onpointerup = canvas.onpointercancel = () => { last = null; };

const STEPS = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1] };
canvas.onkeydown = event => {
  const step = STEPS[event.key];
  if (event.key !== " " && event.key !== "Enter" && !step) return;
  event.preventDefault();
  const from = brush;
  if (step) brush = brush.map((was, axis) => Math.max(0, Math.min(SIDE - 1, was + step[axis])));
  if (!step || event.shiftKey) paint(from.map(one => one + .5), brush.map(one => one + .5));
  $("drawing-says").textContent = `brush at row ${brush[1]}, column ${brush[0]}`;
};

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
