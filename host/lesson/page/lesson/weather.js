// Step 6: distance, rain, drops on the window; the networks of the live page on demand.

import { $, PATTERNS, askWith, errorText, live, percent } from "./program.js";
import { scene } from "./draw.js";
import { grey } from "./pictures.js";

const distance_m = () => Number($("distance").value) / 100;
// As the program reads it. Drops of one size are computed fast.
function weather() {
  const rain = Number($("rain").value), window = Number($("window").value) / 100;
  return [rain && `rain:${rain},mono:1`, window && `window:${window}`].filter(Boolean).join("+") || "none";
}

const again = live("weather", async () => {
  $("distance-text").textContent = `${distance_m().toFixed(2)} m`;
  $("rain-text").textContent = Number($("rain").value) ? `${$("rain").value} mm an hour` : "none";
  $("window-text").textContent = Number($("window").value) ? percent($("window").value / 100) : "none";
  const seen = await askWith("weather_named", weather(), 1000 * distance_m(), 1);
  grey($("weather-seen"), seen);
  $("weather-error").textContent = errorText(seen[PATTERNS]);
  wish();
});
for (const id of ["distance", "rain", "window"]) $(id).oninput = again;

// The live page's program, in a worker of its own.
let camera = null, commands = 0, left = 0, wished = "";
// So many images come after a change, then the camera rests.
const IMAGES = 30;

function send(path, body) { camera.postMessage({ id: ++commands, path, body: JSON.stringify(body) }); }

function wish() {
  if (!camera?.isReady) return;
  const levels = btoa(Array.from(scene, level => String.fromCharCode(Math.round(255 * level))).join(""));
  const body = { scene: { side: 32, levels }, distance_m: distance_m(), weather: weather() };
  if (JSON.stringify(body) === wished) return;
  wished = JSON.stringify(body);
  left = IMAGES;
  send("/api/scene", body);
  camera.postMessage({ paused: false });
}

function told({ data }) {
  if (data.stopped) { $("deblurred-says").textContent = data.stopped; camera = null; $("deblur").disabled = false; }
  else if (data.loading) $("deblurred-says").textContent = data.loading;
  else if (data.message) {
    const { enhanced } = JSON.parse(data.message);
    if (!camera.isReady) { camera.isReady = true; wish(); }
    if (enhanced) {
      const bytes = Uint8Array.from(atob(enhanced), sign => sign.charCodeAt(0));
      grey($("deblurred"), new Float32Array(bytes.buffer), 64);
      $("deblurred-says").textContent = left > 1 ? "measuring" : "";
    }
    if (--left === 0) camera.postMessage({ paused: true });
  } else if (!data.ok) $("deblurred-says").textContent = data.text;
}

$("deblur").onclick = () => {
  $("deblur").disabled = true;
  camera = new Worker(new URL("../page/worker.js", import.meta.url), { type: "module" });
  camera.onmessage = told;
  camera.onerror = event => told({ data: { stopped: `The live camera is not in this folder: ${event.message ?? "page/worker.js cannot be read"}` } });
};
