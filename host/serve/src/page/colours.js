// Colour maps: shares of 0 to 1 to colours.

const anchors = hex => hex.match(/.{6}/g).map(one => [0, 2, 4].map(at => parseInt(one.slice(at, at + 2), 16)));

// Colours at equal steps. viridis and inferno are those of matplotlib (N. Smith and S. van der Walt, CC0).
export const MAPS = {
  grey: anchors("000000ffffff"),
  viridis: anchors("44015448287839568c2a788e22a88443bf7085d54afde725"),
  inferno: anchors("00000431095d721a6eb63655ed6925fbb61afcffa4"),
};

// A table of 256 colours.
export function table(name) {
  const stops = MAPS[name] ?? MAPS.grey, colours = new Uint8ClampedArray(3 * 256);
  for (let level = 0; level < 256; level++) {
    const at = level / 255 * (stops.length - 1), low = Math.min(Math.floor(at), stops.length - 2), share = at - low;
    for (let part = 0; part < 3; part++)
      colours[3 * level + part] = stops[low][part] * (1 - share) + stops[low + 1][part] * share;
  }
  return colours;
}

export const gradient = name =>
  `linear-gradient(to right, ${MAPS[name].map(([r, g, b]) => `rgb(${r} ${g} ${b})`).join(", ")})`;
