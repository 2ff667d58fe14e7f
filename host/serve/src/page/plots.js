// Small plots of the last two minutes: rates, delay, losses, signal, signal-to-noise ratio.

import { $, amount, rate, text } from "./dom.js";

const EVERY_MS = 500, KEPT = 240;

const PLOTS = [
  { id: "frames-plot", name: "frames a second", words: rate, value: state => state.rates.camera_frames_per_s },
  { id: "images-plot", name: "images a second", words: rate, value: state => state.rates.images_per_s },
  { id: "delay-plot", name: "delay, p99, ms", words: n => n.toFixed(n < 10 ? 1 : 0), value: ({ delays }) =>
    (delays.sent ?? delays.enhanced ?? delays.reconstructed)?.p99_ms },
  { id: "losses-plot", name: "frames not received", words: rate, bars: true, value: lossesSinceLast },
  { id: "signal-plot", name: "signal", words: n => amount(n, 1), value: state => state.picture?.white_counts },
  { id: "snr-plot", name: "signal to noise", words: n => n.toFixed(1), value: ({ picture }) =>
    picture?.enhancement?.noise > 0 ? 1 / picture.enhancement.noise : undefined },
];
for (const plot of PLOTS) {
  plot.points = [];
  const figure = document.createElement("figure"), title = document.createElement("figcaption");
  plot.canvas = document.createElement("canvas");
  plot.canvas.id = plot.id;
  plot.canvas.setAttribute("role", "img");
  plot.now = document.createElement("b");
  title.append(plot.name, plot.now);
  figure.append(title, plot.canvas);
  $("plots").append(figure);
}

// The value at the top of a plot. It fits nearly all values where the largest are far above them, so that one bad second does not
// flatten two minutes.
const USUAL = .95, FAR_ABOVE = 3;
function top(known) {
  const sorted = [...known].sort((a, b) => a - b), last = sorted.length - 1;
  const usual = sorted[Math.round(USUAL * last)], largest = sorted[last];
  return usual > 0 && largest > FAR_ABOVE * usual ? usual : largest;
}

// A person counts from 0.
export function forgetLosses() {
  for (const plot of PLOTS) if (plot.bars) plot.points.fill(NaN);
}

let before = null;
function lossesSinceLast({ frames }) {
  const total = frames.lost + frames.corrupt + frames.late, more = before === null ? 0 : Math.max(0, total - before);
  before = total;
  return more;
}

function draw(plot, style) {
  const { canvas, points } = plot, known = points.filter(Number.isFinite);
  const scale = window.devicePixelRatio || 1, width = canvas.clientWidth, height = canvas.clientHeight;
  canvas.width = width * scale;
  canvas.height = height * scale;
  const pen = canvas.getContext("2d"), largest = Math.max(...known), most = Math.max(top(known) ?? 0, 1e-9), limit = most * 1.1;
  pen.scale(scale, scale);
  const x = at => width - (points.length - 1 - at) * width / (KEPT - 1), y = value => height - 1 - Math.min(value / limit, 1) * (height - 12);
  pen.strokeStyle = style.getPropertyValue("--line");
  pen.strokeRect(.5, .5, width - 1, height - 1);
  pen.strokeStyle = pen.fillStyle = style.getPropertyValue(plot.bars ? "--bad" : "--accent");
  pen.lineWidth = 1.5;
  pen.beginPath();
  let isDown = false;
  points.forEach((value, at) => {
    if (!Number.isFinite(value)) { isDown = false; return; }
    if (plot.bars) { if (value > 0) pen.fillRect(x(at) - 1, y(value), 2, height - y(value)); return; }
    pen[isDown ? "lineTo" : "moveTo"](x(at), y(value));
    isDown = true;
  });
  pen.stroke();
  pen.fillStyle = style.getPropertyValue("--soft");
  pen.font = "10px system-ui, sans-serif";
  if (known.length) pen.fillText(plot.words(most) + (largest > limit ? `, at most ${plot.words(largest)}` : ""), 4, 11);
  const last = points.at(-1), says = Number.isFinite(last) ? plot.words(last) : "–";
  text(plot.now, says);
  canvas.setAttribute("aria-label", known.length
    ? `${plot.name}: now ${says}, between ${plot.words(Math.min(...known))} and ${plot.words(largest)} in the last `
      + `${Math.round(points.length * EVERY_MS / 1000)} s` : `${plot.name}: nothing yet`);
}

let sampled = -Infinity;
export function show(state) {
  const now = performance.now();
  if (now - sampled < EVERY_MS) return;
  sampled = now;
  const style = getComputedStyle(document.documentElement);
  for (const plot of PLOTS) {
    plot.points.push(state.camera.phase === "measuring" || plot.bars ? plot.value(state) ?? NaN : NaN);
    if (plot.points.length > KEPT) plot.points.shift();
    draw(plot, style);
  }
}
