// Connects to the server, and hands each state to the parts of the page.

import * as controls from "./controls.js";
import * as display from "./display.js";
import { $, foreign, text } from "./dom.js";
import * as facts from "./facts.js";
import * as light from "./light.js";
import { onGone } from "./requests.js";
import { download, sheet } from "./save.js";

let newest = null;

function show(message) {
  newest = message;
  const { camera } = message.state;
  document.body.dataset.phase = camera.phase;
  text($("line"), foreign(camera.line));
  text($("camera"), foreign(`${camera.identity.board} ${camera.identity.serial}`));
  document.title = `nirspi ${foreign(camera.identity.serial)}`;
  text($("wavelength"), String(camera.identity.wavelength_nm));
  $("simulated").hidden = !camera.simulated;
  $("fault").hidden = camera.phase !== "fault";
  $("uncalibrated").hidden = camera.phase !== "uncalibrated";
  light.show(message.state);
  display.show(message);
  facts.show(message.state, display.rates.drawn);
  controls.show(message.state);
}

$("save").onclick = () => {
  if (newest?.image) sheet(newest).toBlob(blob => download(blob, "png"));
};

function gone() {
  document.body.dataset.phase = "unserved";
  text($("line"), "nirspi serve does not answer; trying again");
  light.showGone();
}
onGone.call = gone;

// A hidden page closes its connection: browsers keep few connections to one address open.
let source = null, again = 0;
function look() {
  clearTimeout(again);
  source?.close();
  source = null;
  if (document.hidden) return;
  source = new EventSource("/events");
  source.onmessage = event => show(JSON.parse(event.data));
  source.onerror = () => { gone(); source.close(); again = setTimeout(look, 1000); };
}
document.addEventListener("visibilitychange", look);
look();
