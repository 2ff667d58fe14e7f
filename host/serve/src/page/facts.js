// The losses of the run, the rates, the estimates, the camera and the events, in words.

import { $, amount, fixed, foreign, list, rate, text, whole } from "./dom.js";
import * as account from "./account.js";
import { answer } from "./requests.js";
import { say } from "./speech.js";

export function show(state, drawnPerSecond) {
  const { camera, run_frames: run, picture } = state, found = picture?.enhancement;
  text($("losses"), `this run: ${whole(run.received)} received, ${whole(run.lost)} lost, ${whole(run.corrupt)} corrupt, `
    + `${whole(run.late)} late`);
  $("losses").className = run.lost + run.corrupt + run.late > 0 ? "loss" : "";
  account.show(state);
  list($("rates"), [
    ["frames from the camera", rate(state.rates.camera_frames_per_s)],
    ["images reconstructed", rate(state.rates.images_per_s)],
    ["images on this page", rate(drawnPerSecond)],
    ["open pages", whole(state.viewers)],
  ]);
  const { delays, overload } = state, share = n => `${Math.round(100 * n)} %`;
  list($("delays"), [
    [state.settings.record ? "recorded" : "counted", delay(delays.counted)],
    ["reconstructed", delay(delays.reconstructed)],
    ["enhanced", delay(delays.enhanced)],
    ...(delays.sent ? [["sent", delay(delays.sent)]] : []),
    ["load", share(overload.camera_thread), overload.line !== null],
    ...(state.settings.record ? [["recording queue", share(overload.recording_queue)]] : []),
  ]);
  text($("overload"), overload.line ?? "");
  $("overload").hidden = overload.line === null;
  // Networks do not know patterns of a bench's own.
  const isKnown = !picture || picture.n !== undefined;
  list($("estimates"), [
    ...(isKnown ? [
      ["blur", found ? `${fixed(found.blur_px, 2)} of 64 px` : "–"],
      ["noise", found ? `${fixed(found.noise, 3)} of white` : "–"],
      ["inconsistency", found ? fixed(found.inconsistency, 2) : "–"],
    ] : []),
    ["white", picture ? `${amount(picture.white_counts, 1)} ${picture.unit}` : "–"],
  ]);
  const { identity, measurement, feed } = camera;
  list($("identity"), [
    ["address", foreign(camera.address)],
    ...camera.versions.map(part => [part.name, foreign(
      part.advice ? `${part.camera}, expected ${part.expected}` : part.camera), part.advice]),
    ...(identity ? [
      ["LEDs", `${identity.wavelength_nm} nm`],
      ["ADC", `${identity.adc_hz / 1e6} MS/s, ${identity.adc_bits} bit`],
    ] : []),
    ...(feed ? [
      ["patterns", `${whole(feed.patterns)}, ${feed.height} × ${feed.width}`],
      ["order", foreign(feed.order)],
      ["readings", feed.readings],
      ["numbers refused", whole(feed.account.refused), feed.account.refused > 0],
      ["readings not read", whole(feed.account.not_read), feed.account.not_read > 0],
    ] : []),
    ...(measurement ? [
      ["patterns", `${whole(measurement.patterns)} of ${whole(1024)}`],
      ["order", measurement.order],
      ["light for one frame", `${fixed(measurement.frame_us, 1)} µs`],
      ["settling", measurement.calibrated ? "corrected" : "not measured"],
    ] : []),
  ]);
  const advice = camera.versions.map(part => part.advice);
  const notes = [answer.refused, state.problem, ...(picture?.warnings ?? []), ...advice];
  text($("notes"), foreign(notes.filter(Boolean).map(note => note.trim()).join("; ")));
  say("notes", [$("overload").textContent, $("notes").textContent].filter(Boolean).join("; "));
  events(state.events);
}

// What holds for the moment alone is not known when there is no state.
export function showGone() {
  for (const id of ["rates", "delays"]) for (const value of $(id).querySelectorAll("dd")) text(value, "–");
}

// p50 and p99 in milliseconds.
const ms = n => n < 10 ? n.toFixed(1) : whole(Math.round(n));
const delay = of => of ? `${ms(of.p50_ms)}, ${ms(of.p99_ms)} ms` : "–";

let told = "";
function events(all) {
  const last = all.at(-1), key = last ? `${all.length} ${last.unix_ms} ${last.text}` : "";
  if (key === told) return;
  told = key;
  $("events").replaceChildren(...all.slice().reverse().map(event => {
    const item = document.createElement("li"), time = document.createElement("time"), span = document.createElement("span");
    time.textContent = new Date(event.unix_ms).toLocaleTimeString("en-GB");
    span.textContent = foreign(event.text);
    item.append(time, span);
    return item;
  }));
}
