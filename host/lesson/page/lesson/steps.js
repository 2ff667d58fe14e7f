// Step 2: one pattern at a time. Step 3: part of the patterns. Step 4: noise.

import { $, PATTERNS, ask, askWith, errorText, live, order, percent, player } from "./program.js";
import { bars, grey } from "./pictures.js";

const number = (value, sign = "") => `${value > 0 ? sign : ""}${Math.abs(value) < .05 ? "0.0" : value.toFixed(1)}`.replace("-", "−");

const patterns = live("pattern", async () => {
  const shown = Number($("shown").value), place = Math.max(0, shown - 1);
  const [, , readings, pattern, light, sum] = await Promise.all([ask("noise", 0, 1), askWith("order_named", order()), ask("readings"),
    ask("pattern", place), ask("light", place), ask("sum", shown)]);
  const differences = Array.from({ length: shown }, (_, at) => readings[3 * at + 2]);
  const dark = new Float64Array(PATTERNS);
  grey($("pattern-picture"), shown ? pattern : dark);
  grey($("pattern-light"), shown ? light : dark);
  grey($("pattern-sum"), sum);
  bars($("numbers"), differences);
  const [on, off, difference] = shown ? readings.slice(3 * place, 3 * place + 3) : [0, 0, 0];
  $("reading-pattern").textContent = number(on);
  $("reading-negative").textContent = number(off);
  $("reading-number").textContent = number(difference, "+");
  $("reading").querySelector(".number").classList.toggle("below", difference < 0);
  $("pattern-place").textContent = shown ? `${shown} of ${PATTERNS}` : "none yet";
  $("pattern-error").textContent = errorText(sum[PATTERNS]);
  $("shown-text").textContent = shown;
  $("back").disabled = shown === 0;
  $("step").disabled = shown === PATTERNS;
});

function show(count) {
  $("shown").value = count;
  patterns();
  return Number($("shown").value) < PATTERNS;
}
const shown = () => Number($("shown").value);
// Patterns a second, and how many come at once at a screen's pace.
const pace = () => 2 ** Number($("speed").value);
const together = () => Math.max(1, Math.round(pace() / 20));
const stop = player($("play"), () => show(shown() + together()), () => 1000 * together() / pace());
$("shown").oninput = () => { stop(); patterns(); };
$("step").onclick = () => { stop(); show(shown() + 1); };
$("back").onclick = () => { stop(); show(shown() - 1); };
$("restart").onclick = () => { stop(); show(0); };
const tellSpeed = () => { $("speed-text").textContent = pace(); };
$("speed").oninput = tellSpeed;
tellSpeed();

const share = live("share", async () => {
  const part = Number($("share-range").value) / 100, count = Math.round(part * PATTERNS);
  const [, grid, rows, sum] = await Promise.all([ask("noise", 0, 1), askWith("order_named", "walsh-2d"),
    askWith("order_named", order()), ask("sum", count)]);
  // Where each row is in the grid of coarse and fine.
  const isShown = new Set(rows.slice(0, count));
  grey($("share-map"), grid.map(row => isShown.has(row) ? .95 : .15));
  grey($("share-sum"), sum);
  $("share-error").textContent = errorText(sum[PATTERNS]);
  $("share-text").textContent = `${percent(part)}: ${count}`;
});
$("share-range").oninput = share;

let seed = 1;
const noise = live("noise", async () => {
  const size = Number($("noise-range").value) / 100, part = Number($("noise-share").value) / 100;
  const [, , sum, calm] = await Promise.all([ask("noise", size, seed), askWith("order_named", order()),
    askWith("image_named", "hadamard", part), askWith("image_named", "tikhonov", part)]);
  grey($("noise-sum"), sum);
  grey($("noise-calm"), calm);
  $("noise-sum-error").textContent = errorText(sum[PATTERNS]);
  $("noise-calm-error").textContent = errorText(calm[PATTERNS]);
  $("noise-text").textContent = `${percent(size)} of white`;
  $("noise-share-text").textContent = percent(part);
});
$("noise-range").oninput = $("noise-share").oninput = noise;
$("noise-again").onclick = () => { seed++; noise(); };
