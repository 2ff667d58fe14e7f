// Saves what the page shows.

import { $, amount, fixed, foreign, frames, nameOf } from "./dom.js";

const measured = ({ order, patterns, n }) => n === undefined ? `${patterns} patterns of the bench's own`
  : `${foreign(order)} order, ${patterns} of ${n ** 2} patterns`;

// What a picture is, for whoever finds it later: the picture's own time, measurement, losses and warnings, not those of the moment
// at which it is saved.
function about({ camera, picture, scene }) {
  const { run_frames: run, enhancement: found } = picture;
  const is = camera.simulated ? "simulated; " : "", at = new Date(picture.arrived_unix_ms).toISOString();
  const before = scene ? `, scene ${foreign(scene.name)}, ${fixed(scene.distance_m, 2)} m, ${foreign(scene.weather)}` : "";
  const recursive = picture.past === null ? "" : ", recursive";
  return [
    `${is}${foreign(nameOf(camera))}, ${at}${before}`,
    `${measured(picture)}, sweeps in a frame: ${picture.sweeps}, ${frames(picture.frames)}`,
    `${picture.method}${recursive}, white ${amount(picture.white_counts, 1)} ${foreign(picture.unit)}` + (found
      ? `; enlarged and deblurred: blur ${fixed(found.blur_px, 2)} px, noise ${fixed(found.noise, 3)} of white` : ""),
    `this run: ${run.received} received, ${run.lost} lost, ${run.corrupt} corrupt, ${run.late} late`,
    ...picture.warnings.map(warning => `warning: ${foreign(warning)}`),
  ];
}

// The line in parts that fit.
function wrapped(pen, line, width) {
  const parts = [];
  for (const word of line.split(" ")) {
    const longer = parts.length ? `${parts.at(-1)} ${word}` : word;
    if (parts.length && pen.measureText(longer).width <= width) parts[parts.length - 1] = longer;
    else parts.push(word);
  }
  return parts;
}

export function sheet({ state, enhanced }) {
  const side = 512, gap = 16, step = 22, font = "15px system-ui, sans-serif";
  const { height, width } = state.picture, tall = Math.round(side * height / width);
  const panels = enhanced ? [$("image"), $("enhanced")] : [$("image")];
  const sheet = document.createElement("canvas"), pen = sheet.getContext("2d");
  sheet.width = gap + panels.length * (side + gap);
  pen.font = font;
  const lines = about(state).flatMap(line => wrapped(pen, line, sheet.width - 2 * gap));
  // A canvas of another size begins anew.
  sheet.height = gap + tall + gap + step * lines.length + gap;
  pen.fillStyle = "#fff";
  pen.fillRect(0, 0, sheet.width, sheet.height);
  pen.imageSmoothingEnabled = false;
  panels.forEach((panel, at) => pen.drawImage(panel, gap + at * (side + gap), gap, side, tall));
  pen.fillStyle = "#222";
  pen.font = font;
  lines.forEach((line, at) => pen.fillText(line, gap, gap + tall + 24 + step * at, sheet.width - 2 * gap));
  return sheet;
}

// A NumPy file, format 1.0, of an image of 32-bit floating-point numbers.
export function npy(values, height, width) {
  const words = `{'descr': '<f4', 'fortran_order': False, 'shape': (${height}, ${width}), }`;
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
