// The scene of the virtual camera: a letter, a drawing, a picture; distance and weather.

import { drawable } from "./brush.js";
import { $, foreign, text } from "./dom.js";
import { post } from "./requests.js";
import { answer, say } from "./speech.js";

const SIDE = 64;
const canvas = $("drawing"), pen = canvas.getContext("2d", { willReadFrequently: true });
canvas.width = canvas.height = SIDE;
let sending = 0;
// The scene that is drawn, unless a person has drawn since; commands under way; when the last one was answered.
let drawn = null, asked = 0, answered = -Infinity;

function clear() {
  drawn = null;
  pen.fillStyle = "#000";
  pen.fillRect(0, 0, SIDE, SIDE);
}
clear();

function levels() {
  const { data } = pen.getImageData(0, 0, SIDE, SIDE);
  const bytes = Array.from({ length: SIDE * SIDE }, (_, at) => (data[4 * at] + data[4 * at + 1] + data[4 * at + 2]) / 3);
  return btoa(bytes.map(level => String.fromCharCode(Math.round(level))).join(""));
}

// Why the last picture could not be read.
let unread = "";
async function apply(wish) {
  unread = "";
  asked++;
  await post("/api/scene", wish);
  asked--;
  answered = performance.now();
}
function drawing() {
  sending = 0;
  return apply({ scene: { side: SIDE, levels: levels() } });
}
function soon() {
  clearTimeout(sending);
  sending = setTimeout(drawing, 300);
}

const isDrawing = drawable(canvas, pen, SIDE, 2, () => { drawn = null; soon(); }, words => {
  text($("drawing-says"), words);
  answer(words);
});

$("clear").onclick = () => { clear(); soon(); };
$("letter-form").onsubmit = event => {
  event.preventDefault();
  const word = $("letter").value;
  if (word) apply({ scene: [...word].length === 1 ? `letter:${word}` : `word:${word}` });
};
$("white").onclick = () => apply({ scene: "white" });
$("distance").onchange = () => apply({ distance_m: Number($("distance").value) });
$("weather").onchange = () => apply({ weather: $("weather").value || "none" });
$("picture").onchange = async () => {
  const [file] = $("picture").files;
  if (!file) return;
  try {
    const picture = await createImageBitmap(file), side = Math.max(picture.width, picture.height);
    clear();
    const [width, height] = [picture.width, picture.height].map(length => SIDE * length / side);
    pen.drawImage(picture, (SIDE - width) / 2, (SIDE - height) / 2, width, height);
    drawing();
  } catch {
    unread = `${foreign(file.name)} is not a picture that this browser can read`;
    text($("scene-problem"), unread);
  }
  $("picture").value = "";
};

// Draws the scene that is before the camera, unless a person draws or has asked for another one.
function draw(scene, levels, moment) {
  if (!levels || levels === drawn || scene.changing || isDrawing() || sending || asked || moment[0] < answered) return;
  drawn = levels;
  const pixels = new ImageData(SIDE, SIDE), bytes = atob(levels);
  for (let at = 0; at < SIDE * SIDE; at++) pixels.data.set([...Array(3).fill(bytes.charCodeAt(at)), 255], 4 * at);
  pen.putImageData(pixels, 0, 0);
}

export function show({ state: { scene }, drawing }, moment) {
  $("scene").hidden = !scene;
  if (!scene) return;
  text($("scene-name"), foreign(`${scene.name}, ${scene.distance_m} m, ${scene.weather}`));
  text($("scene-problem"), unread || foreign(scene.problem ?? ""));
  say("scene", $("scene-problem").textContent);
  draw(scene, drawing, moment);
  const isFree = id => document.activeElement !== $(id);
  if (isFree("distance")) $("distance").value = scene.distance_m;
  if (isFree("weather")) $("weather").value = scene.weather;
}
