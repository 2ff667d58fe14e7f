// Saves what the page shows.

import { $, fixed, foreign, frames } from "./dom.js";

export function sheet({ state, enhanced }) {
  const side = 512, gap = 16, foot = 84;
  const panels = enhanced ? [$("image"), $("enhanced")] : [$("image")];
  const sheet = document.createElement("canvas"), pen = sheet.getContext("2d");
  sheet.width = gap + panels.length * (side + gap);
  sheet.height = gap + side + foot;
  pen.fillStyle = "#fff";
  pen.fillRect(0, 0, sheet.width, sheet.height);
  pen.imageSmoothingEnabled = false;
  panels.forEach((panel, at) => pen.drawImage(panel, gap + at * (side + gap), gap, side, side));
  pen.fillStyle = "#222";
  pen.font = "15px system-ui, sans-serif";
  const { camera, frames: account, picture } = state, found = picture.enhancement;
  const lines = [
    `${camera.simulated ? "simulated; " : ""}${foreign(camera.identity.board)} ${foreign(camera.identity.serial)}, `
      + new Date().toISOString(),
    `${picture.method}, ${frames(picture.frames)}, white ${fixed(picture.white_counts, 1)} ADC counts` + (found
      ? `; enlarged and deblurred: blur ${fixed(found.blur_px, 2)} px, noise ${fixed(found.noise, 3)} of white` : ""),
    `${account.received} received, ${account.lost} lost, ${account.corrupt} corrupt, ${account.late} late`,
  ];
  lines.forEach((line, at) => pen.fillText(line, gap, gap + side + 24 + 22 * at, sheet.width - 2 * gap));
  return sheet;
}

// A NumPy file, format 1.0, of a square image of 32-bit floating-point numbers.
export function npy(values, side) {
  const words = `{'descr': '<f4', 'fortran_order': False, 'shape': (${side}, ${side}), }`;
  const head = words.padEnd(117) + "\n", bytes = new DataView(new ArrayBuffer(10 + head.length + 4 * values.length));
  [0x93, ..."NUMPY"].forEach((sign, at) => bytes.setUint8(at, at ? sign.charCodeAt(0) : sign));
  bytes.setUint8(6, 1);
  bytes.setUint16(8, head.length, true);
  [...head].forEach((sign, at) => bytes.setUint8(10 + at, sign.charCodeAt(0)));
  values.forEach((value, at) => bytes.setFloat32(10 + head.length + 4 * at, value, true));
  return new Blob([bytes.buffer], { type: "application/octet-stream" });
}

export function download(blob, ending) {
  const link = document.createElement("a");
  link.href = URL.createObjectURL(blob);
  link.download = `nirspi-${new Date().toISOString().replaceAll(":", "").slice(0, 17)}.${ending}`;
  link.click();
  setTimeout(() => URL.revokeObjectURL(link.href), 10000);
}
