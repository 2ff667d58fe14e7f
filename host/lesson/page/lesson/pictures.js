// Draws pictures and plots.

const colour = name => getComputedStyle(document.documentElement).getPropertyValue(`--${name}`).trim();

function put(canvas, side, paint) {
  if (canvas.width !== side) canvas.width = canvas.height = side;
  const pixels = new ImageData(side, side);
  for (let at = 0; at < side * side; at++) pixels.data.set([...paint(at), 255], 4 * at);
  canvas.getContext("2d").putImageData(pixels, 0, 0);
}

const byte = share => Math.round(255 * Math.max(0, Math.min(1, share)));

// A picture of light: 0 is black, 1 is white.
export const grey = (canvas, values, side = 32) => put(canvas, side, at => Array(3).fill(byte(values[at])));

// A picture of light that is added (orange) or taken away (blue): the colours of ColorBrewer's PuOr and RdBu, which people who are
// blind to some colours tell apart.
const MORE = [179, 88, 6], LESS = [33, 102, 172];
export function signed(canvas, values) {
  const most = values.slice(0, 1024).reduce((most, v) => Math.max(most, Math.abs(v)), 1e-9);
  put(canvas, 32, at => {
    const share = values[at] / most, end = share > 0 ? MORE : LESS;
    return end.map(part => Math.round(245 + (part - 245) * Math.abs(share)));
  });
}

// A canvas with as many pixels as the screen has, in CSS pixels.
function pen(canvas) {
  const { width, height } = canvas.getBoundingClientRect(), scale = devicePixelRatio;
  [canvas.width, canvas.height] = [Math.round(width * scale), Math.round(height * scale)];
  const pen = canvas.getContext("2d");
  pen.scale(scale, scale);
  return { pen, width, height };
}

// Numbers as bars from a line in the middle. Bars of numbers that are far larger than the others are cut.
export function bars(canvas, numbers) {
  const { pen: ink, width, height } = pen(canvas), middle = height / 2;
  const sizes = Array.from(numbers, Math.abs).sort((a, b) => a - b);
  const most = Math.max(1e-9, sizes[Math.max(0, Math.floor(.97 * sizes.length) - 1)] ?? 1);
  const step = width / Math.max(numbers.length, 32);
  const colours = { up: colour("up"), down: colour("down") };
  numbers.forEach((number, at) => {
    const length = Math.min(1, Math.abs(number) / most) * (middle - 4);
    ink.fillStyle = number > 0 ? colours.up : colours.down;
    ink.fillRect(at * step, number > 0 ? middle - length : middle, Math.max(step - (step > 3 ? 1 : 0), .5), length);
  });
  ink.fillStyle = colour("soft");
  ink.fillRect(0, middle - .5, width, 1);
}

// Curves from 0 to 1 over steps, each up to its own length, with a mark at one step.
export function curves(canvas, lines, at) {
  const { pen: ink, width, height } = pen(canvas), steps = Math.max(1, lines[0].values.length - 1);
  const left = 56, x = step => left + step / steps * (width - left - 10), y = value => 8 + (1 - Math.min(value, 1)) * (height - 16);
  ink.font = "13px system-ui, sans-serif";
  ink.textAlign = "right";
  ink.textBaseline = "middle";
  for (const [value, text] of [[0, "0"], [.5, "50 %"], [1, "100 %"]]) {
    ink.fillStyle = colour("soft");
    ink.fillText(text, left - 6, y(value));
    ink.fillStyle = colour("line");
    ink.fillRect(left, y(value), width - left, 1);
  }
  for (const { values, name, isDashed } of lines) {
    ink.strokeStyle = colour(name);
    ink.lineWidth = 2.5;
    ink.setLineDash(isDashed ? [3, 4] : []);
    ink.beginPath();
    values.forEach((value, step) => ink.lineTo(x(step), y(value)));
    ink.stroke();
  }
  ink.setLineDash([]);
  ink.fillStyle = colour("ink");
  ink.beginPath();
  ink.arc(x(at), y(lines[0].values[at] ?? 0), 5, 0, 7);
  ink.fill();
}
