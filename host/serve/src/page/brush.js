// Draws on a canvas by mouse, finger, pen or keys, with the level and width that the page's two sliders say.

const STEPS = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1] };
const slider = id => Number(document.getElementById(id).value);

// Lets people draw on a canvas of `side` x `side` squares. An arrow key moves the keys' brush by `step` squares and with shift
// draws; space and enter draw in place. `drew` is called after each stroke, `says` with where the keys' brush is. Returns a
// function that says whether a stroke is being drawn.
export function drawable(canvas, pen, side, step, drew, says) {
  // Where the canvas was when the pen came down: a page that moves meanwhile does not bend the stroke.
  let box = null, last = null, brush = [side / 2, side / 2];
  const stroke = (from, to) => {
    const level = Math.round(255 * slider("brush-level"));
    pen.strokeStyle = `rgb(${level} ${level} ${level})`;
    pen.lineWidth = slider("brush-size");
    pen.lineCap = "round";
    pen.beginPath();
    pen.moveTo(...from);
    pen.lineTo(to[0] + .01, to[1]);
    pen.stroke();
    drew();
  };
  const at = event => [(event.clientX - box.left) / box.width * side, (event.clientY - box.top) / box.height * side];
  canvas.onpointerdown = event => {
    canvas.setPointerCapture(event.pointerId);
    box = canvas.getBoundingClientRect();
    last = at(event);
    stroke(last, last);
  };
  canvas.onpointermove = event => {
    if (last === null) return;
    const to = at(event);
    stroke(last, to);
    last = to;
  };
  canvas.onpointerup = canvas.onpointercancel = () => { last = null; };
  canvas.onkeydown = event => {
    const by = STEPS[event.key];
    if (event.key !== " " && event.key !== "Enter" && !by) return;
    event.preventDefault();
    const from = brush;
    if (by) brush = brush.map((was, axis) => Math.max(0, Math.min(side - 1, was + step * by[axis])));
    if (!by || event.shiftKey) stroke(from.map(one => one + .5), brush.map(one => one + .5));
    says(`brush at row ${brush[1]}, column ${brush[0]}`);
  };
  return () => last !== null;
}
