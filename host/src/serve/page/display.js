// Draws the images.

import { $, fixed, frames, text } from "./dom.js";

let lastShown = -1, drawn = 0, since = performance.now();
export const rates = { drawn: 0 };

function draw(canvas, levels) {
  const bytes = atob(levels), side = Math.sqrt(bytes.length);
  const pixels = new ImageData(side, side);
  for (let at = 0; at < bytes.length; at++) {
    pixels.data.fill(bytes.charCodeAt(at), 4 * at, 4 * at + 3);
    pixels.data[4 * at + 3] = 255;
  }
  canvas.width = canvas.height = side;
  canvas.getContext("2d").putImageData(pixels, 0, 0);
}

export function show({ state, image, enhanced }) {
  const { images, picture, settings } = state;
  $("no-image").hidden = image !== null;
  $("no-enhanced").hidden = enhanced !== null;
  text($("no-enhanced"), settings.enhance ? "no image yet" : "switched off");
  if (images.shown !== lastShown) {
    lastShown = images.shown;
    if (image) { draw($("image"), image); drawn++; }
    if (enhanced) draw($("enhanced"), enhanced);
    else $("enhanced").getContext("2d").clearRect(0, 0, 64, 64);
  }
  const now = performance.now();
  if (now - since >= 1000) {
    rates.drawn = 1000 * drawn / (now - since);
    [drawn, since] = [0, now];
  }
  const found = picture?.enhancement;
  text($("about-image"), picture
    ? `${picture.method}, ${frames(picture.frames)}, ${fixed(picture.reconstruct_ms, 1)} ms` : "");
  text($("about-enhanced"), found ? `${fixed(found.enhance_ms, 1)} ms${found.depth ? "" : ", no depth yet"}` : "");
  const doubts = picture?.short_warnings ?? [];
  text($("doubt"), doubts.join("; "));
  $("doubt").hidden = doubts.length === 0;
}
