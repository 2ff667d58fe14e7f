// Step 5: orthogonal matching pursuit, one atom after another.

import { $, PATTERNS, ask, askWith, errorText, live, order, percent, player } from "./program.js";
import { curves, grey, signed } from "./pictures.js";

const MOST = 100;
// The residuals after each atom, and what they belong to.
let residuals = [1];

const atoms = live("atoms", async () => {
  const part = Number($("atom-share").value) / 100, wanted = Number($("atom-range").value);
  const asked = [ask("noise", 0, 1), askWith("order_named", order()), askWith("pursue_named", $("basis").value, part, MOST)];
  residuals = Array.from((await Promise.all(asked))[2]);
  const count = Math.min(wanted, residuals.length - 1);
  const steps = Array.from({ length: residuals.length }, (_, at) => ask("atoms", at));
  const newest = count ? ask("atom", count - 1, count) : Promise.resolve(new Float64Array(PATTERNS));
  const [atom, ...images] = await Promise.all([newest, ...steps]);
  signed($("atom"), atom);
  grey($("atom-sum"), images[count]);
  const errors = images.map(image => image[PATTERNS]);
  curves($("residuals"), [{ values: residuals, name: "up" }, { values: errors, name: "down", isDashed: true }], count);
  $("atom-count").textContent = `${count} ${count === 1 ? "atom" : "atoms"}`;
  $("atom-error").textContent = errorText(errors[count]);
  $("atom-residual").textContent = percent(residuals[count], 1);
  $("atom-text").textContent = count;
  $("atom-share-text").textContent = percent(part);
  $("atom-step").disabled = count >= residuals.length - 1;
  $("atom-back").disabled = count === 0;
});

function add(more) {
  const count = Math.max(0, Math.min(residuals.length - 1, Number($("atom-range").value)) + more);
  $("atom-range").value = count;
  atoms();
  return count < residuals.length - 1;
}
const stop = player($("atom-play"), () => add(1), () => 600);
$("atom-step").onclick = () => { stop(); add(1); };
$("atom-back").onclick = () => { stop(); add(-1); };
$("atom-range").oninput = () => { stop(); atoms(); };
$("basis").onchange = $("atom-share").oninput = atoms;
