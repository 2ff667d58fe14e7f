// Connects to the camera's program, and hands each state to the parts of the page.

import { onReset } from "./account.js";
import { FRESH_MS, since, watch, words } from "./age.js";
import { GONE, listen } from "./connection.js";
import * as controls from "./controls.js";
import * as display from "./display.js";
import "./explain.js";
import { $, foreign, nameOf, text } from "./dom.js";
import * as facts from "./facts.js";
import * as light from "./light.js";
import * as history from "./history.js";
import * as line from "./line.js";
import * as plots from "./plots.js";
import { onGone } from "./requests.js";
import { download, npy, sheet } from "./save.js";
import * as scene from "./scene.js";
import { say } from "./speech.js";

// The newest message, and the moment at which it was true. `why`: what is wrong with the connection.
let newest = null, at = null, why = "";

// Images may be earlier ones; everything else on the page is of the newest message.
function showImages() {
  if (newest) display.show(history.looked(newest));
}
history.onLook.call = showImages;

function show(message, moment) {
  [newest, at, why] = [message, moment, ""];
  history.keep(message);
  display.count(message);
  const { camera } = message.state;
  document.body.dataset.phase = camera.phase;
  says(foreign(camera.line));
  text($("camera"), foreign(nameOf(camera)));
  document.title = `nirspi ${foreign(camera.identity?.serial ?? nameOf(camera))}`;
  text($("wavelength"), String(camera.identity?.wavelength_nm ?? ""));
  $("simulated").hidden = !camera.simulated;
  $("fault").hidden = camera.phase !== "fault";
  $("uncalibrated").hidden = camera.phase !== "uncalibrated";
  light.show(message.state);
  showImages();
  facts.show(message.state, display.rates.drawn);
  controls.show(message.state);
  scene.show(message, moment);
  line.show(message.state);
  plots.show(message.state);
  // An answer may come too late.
  look();
}

// What is on the screen is saved, the newest image or an earlier one.
$("save").onclick = () => {
  const shown = display.onScreen();
  if (shown?.image) sheet(shown).toBlob(blob => download(blob, "png"));
};
$("save-npy").onclick = () => {
  const shown = display.onScreen();
  if (!shown?.image) return;
  const { height, width } = shown.state.picture;
  download(npy(display.values(shown.image), height, width), "image.npy");
  if (shown.enhanced) download(npy(display.values(shown.enhanced), 64, 64), "enhanced.npy");
};

function says(words) {
  text($("line"), words);
  say("camera", words);
}

const age = () => at === null ? Infinity : since(at);

// Says that what the page shows is old. A command that was answered is no state.
function look() {
  if (!why && age() <= FRESH_MS) return light.age(age());
  document.body.dataset.phase = "unserved";
  says(foreign(why || GONE.line));
  light.showGone(words(age()));
  facts.showGone();
  history.showGone(words(age()));
}
function gone(line = GONE.line) {
  why = line;
  look();
}
onGone.call = gone;
onReset.call = plots.forgetLosses;
watch(() => { if (at !== null) look(); });
// Every part of the script has loaded: what says that it did not goes, and the controls come.
for (const words of document.querySelectorAll(".dead")) words.remove();
for (const part of document.querySelectorAll("[data-live]")) part.hidden = false;
$("stop").disabled = false;
listen(show, gone);
