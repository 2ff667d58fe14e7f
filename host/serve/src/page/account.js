// The account of all frames, since the program began or since a person has set the counters to 0. Only this page counts anew.

import { $, list, text, whole } from "./dom.js";

let newest = null, zero = null;
export const onReset = { call: () => {} };

const less = (now, then) => Object.fromEntries(Object.entries(now).map(([name, n]) => [name, n - (then?.[name] ?? 0)]));

export function show({ frames, images }) {
  newest = { frames, images };
  // A program that was started again counts from 0.
  if (zero && frames.received < zero.frames.received) zero = null;
  const counted = less(frames, zero?.frames), made = less(images, zero?.images);
  text($("since"), zero ? `since ${zero.at}` : "of all runs");
  list($("account"), [
    ["received", whole(counted.received)],
    ["lost", whole(counted.lost), counted.lost > 0],
    ["corrupt", whole(counted.corrupt), counted.corrupt > 0],
    ["late", whole(counted.late), counted.late > 0],
    ["shown", `${whole(made.shown)} of ${whole(counted.received)}`],
    ...(made.failed > 0 ? [["frames without an image", whole(made.failed), true]] : []),
  ]);
}

$("reset").onclick = () => {
  if (!newest) return;
  zero = { ...newest, at: new Date().toLocaleTimeString("en-GB") };
  show(newest);
  onReset.call();
};
