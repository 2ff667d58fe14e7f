// Draws the images: colour map, range, value under the cursor, warnings.

import { gradient, table } from "./colours.js";
import { $, amount, explained, fixed, foreign, frames, text } from "./dom.js";
import { answer } from "./speech.js";

export const rates = { drawn: 0 };
let shown = null, lastShown = -1, drawn = 0, since = performance.now();

// An image of a message: 32-bit floating-point numbers, little-endian, in base64.
export function values(base64) {
  if (!base64) return null;
  const bytes = Uint8Array.from(atob(base64), sign => sign.charCodeAt(0)), view = new DataView(bytes.buffer);
  return Float32Array.from({ length: bytes.length / 4 }, (_, at) => view.getFloat32(4 * at, true));
}

// What each image shows: its unit, the value that counts as white, and a number in words.
const PANELS = {
  readings: { side: 32, of: "readings", white: null, even: true, scale: 1, unit: "ADC counts", digits: 2 },
  image: { side: 32, of: "image", white: picture => picture.white_counts, scale: 1, unit: "ADC counts", digits: 1 },
  enhanced: { side: 64, of: "enhanced", white: () => 1, scale: 100, unit: "% of white", digits: 1 },
  interval: { side: 64, of: "interval", fixed: [0, .5], scale: 100, unit: "% of white", digits: 1 },
  depth: { side: 32, of: "depth", white: null, scale: 1, unit: "m", digits: 3 },
};
for (const [id, panel] of Object.entries(PANELS)) Object.assign(panel, { id, width: panel.side, height: panel.side, values: null, cell: null });

function percentile(sorted, share) { return sorted[Math.round(share * (sorted.length - 1))]; }

// The range of values from black to white.
function range(panel, picture) {
  if (panel.fixed) return panel.fixed;
  const white = panel.white?.(picture);
  // Readings are as often below 0 as above: 0 is in the middle. The first ones are far larger than the others.
  if (panel.even) {
    const most = percentile(panel.values.filter(Number.isFinite).map(Math.abs).sort(), .95);
    return [-most, most];
  }
  if (white === undefined || $("range").value === "auto") {
    const sorted = Float32Array.from(panel.values).sort();
    const tail = panel.white ? .005 : 0;
    return [percentile(sorted, tail), percentile(sorted, 1 - tail)];
  }
  if ($("range").value === "white") return [0, white];
  return [$("low").value / 100 * white, $("high").value / 100 * white];
}

// A pattern that was not shown has no reading.
const inWords = (panel, value) => Number.isNaN(value) ? "not measured"
  : `${panel.isAny ? amount(value, panel.digits) : (panel.scale * value).toFixed(panel.digits)} ${panel.unit}`;

function draw(panel, picture) {
  const canvas = $(panel.id), pen = canvas.getContext("2d"), bar = $(`${panel.id}-bar`);
  [canvas.width, canvas.height] = [panel.width, panel.height];
  canvas.style.aspectRatio = `${panel.width} / ${panel.height}`;
  bar.hidden = !panel.values;
  if (!panel.values) return;
  const [low, high] = range(panel, picture), map = $("colours").value, colours = table(map);
  const pixels = new ImageData(panel.width, panel.height), step = 255 / Math.max(high - low, 1e-12);
  panel.values.forEach((value, at) => {
    const level = Math.max(0, Math.min(255, Math.round((value - low) * step)));
    for (let part = 0; part < 3; part++) pixels.data[4 * at + part] = colours[3 * level + part];
    pixels.data[4 * at + 3] = Number.isNaN(value) ? 0 : 255;
  });
  pen.putImageData(pixels, 0, 0);
  bar.firstElementChild.style.background = gradient(map);
  text(bar.children[1], inWords(panel, low));
  text(bar.children[2], inWords(panel, high));
}

// The value under the cursor.
function point(panel) {
  const cell = $(`${panel.id}-cell`), says = $(`${panel.id}-value`);
  // The next image may be smaller.
  const is = panel.cell?.[0] < panel.width && panel.cell[1] < panel.height && panel.values !== null;
  cell.hidden = !is;
  if (!is) return text(says, "");
  const [x, y] = panel.cell, value = panel.values[y * panel.width + x];
  const across = 100 / panel.width, down = 100 / panel.height;
  Object.assign(cell.style, { left: `${x * across}%`, top: `${y * down}%`, width: `${across}%`, height: `${down}%` });
  const white = panel.id === "image" && shown.state.picture.white_counts;
  const where = panel.id === "readings" ? `pattern ${y * panel.width + x}` : `row ${y}, column ${x}`;
  text(says, `${where}: ${inWords(panel, value)}${white ? `, ${(100 * value / white).toFixed(0)} % of white` : ""}`);
}

function move(panel, x, y) {
  const inside = (at, most) => Math.max(0, Math.min(most - 1, at));
  panel.cell = [inside(x, panel.width), inside(y, panel.height)];
  point(panel);
}

for (const panel of Object.values(PANELS)) {
  const canvas = $(panel.id);
  const at = event => {
    const box = canvas.getBoundingClientRect(), cell = (offset, size, cells) => Math.floor(offset / size * cells);
    move(panel, cell(event.clientX - box.left, box.width, panel.width), cell(event.clientY - box.top, box.height, panel.height));
  };
  canvas.onpointermove = canvas.onpointerdown = at;
  canvas.onpointerleave = canvas.onblur = () => { panel.cell = null; point(panel); };
  canvas.onfocus = () => { if (!panel.cell) move(panel, panel.width >> 1, panel.height >> 1); };
  const STEPS = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1] };
  canvas.onkeydown = event => {
    const step = STEPS[event.key];
    if (!step || !panel.cell) return;
    event.preventDefault();
    move(panel, panel.cell[0] + step[0], panel.cell[1] + step[1]);
    answer($(`${panel.id}-value`).textContent);
  };
}

function redraw() {
  if (!shown) return;
  for (const panel of Object.values(PANELS)) { draw(panel, shown.state.picture); point(panel); }
}
for (const name of ["colours", "range", "low", "high"]) $(name).addEventListener("input", () => {
  $("limits").hidden = $("range").value !== "fixed";
  redraw();
});

// The images of a message: the newest one, or an earlier one.
export function show(message) {
  const { state } = message, { images, picture, settings } = state;
  const isNew = shown?.state.images.shown !== images.shown || shown?.enhanced !== message.enhanced;
  shown = message;
  if (isNew) {
    // A feed has its own size and unit.
    const { height, width } = picture ?? { height: 32, width: 32 };
    const own = { height, width, unit: foreign(picture?.unit ?? ""), isAny: picture?.unit !== "ADC counts" };
    for (const id of ["readings", "image"]) Object.assign(PANELS[id], own);
    $("about-image").previousSibling.textContent = `reconstructed, ${height} × ${width} `;
    for (const panel of Object.values(PANELS)) panel.values = values(message[panel.of]);
    redraw();
  }
  $("no-image").hidden = message.image !== null;
  $("no-enhanced").hidden = message.enhanced !== null;
  text($("no-enhanced"), !settings.enhance ? "switched off"
    : ![32, 64].includes(picture?.n ?? 32) ? "off: the networks take 32 × 32 and 64 × 64"
    : state.overload.enhancement_off ? "off: this computer is too slow" : "no image yet");
  $("no-readings").hidden = message.readings !== null;
  // Patterns of a bench's own have no place in a table of Hadamard rows, and no networks.
  const isOwn = picture !== null && picture.n === undefined;
  $("readings-panel").hidden = $("enhanced-panel").hidden = isOwn;
  $("depth-panel").hidden = message.depth === null;
  $("interval-panel").hidden = !message.interval;
  const found = picture?.enhancement;
  text($("about-image"), picture
    ? `${picture.method}${picture.past === null ? "" : ", recursive"}, ${frames(picture.frames)}, ${fixed(picture.reconstruct_ms, 1)} ms` : "");
  explained($("about-image"), picture?.past ?? "");
  text($("about-enhanced"), found
    ? `${found.model}, ${fixed(found.enhance_ms, 1)} ms${found.depth ? "" : ", no depth yet"}` : "");
  warn("doubt", picture?.short_warnings ?? []);
  warn("alert", picture?.frame_warnings ?? []);
}

function warn(id, words) {
  text($(id), words.join("; "));
  $(id).hidden = words.length === 0;
}

// Counts the images that arrive, for their rate.
export function count({ state, image }) {
  if (image && state.images.shown !== lastShown) drawn++;
  lastShown = state.images.shown;
  const now = performance.now();
  if (now - since < 1000) return;
  rates.drawn = 1000 * drawn / (now - since);
  [drawn, since] = [0, now];
}

export const onScreen = () => shown;
