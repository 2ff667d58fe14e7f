// The page's tooltips. From docs/glossary.md by `NIRSPI_BLESS=1 cargo test -p nirspi --test glossary`.

export const MEANINGS = {
  "blur": "Standard deviation of the blur that the networks remove, estimated from the image, in pixels of the 64 x 64 image.",
  "corrupt": "Frames that arrived damaged; their checksums did not match.",
  "inconsistency": "Distance between the readings and those that the enhanced image would give, over their noise. Near 1 or below, the readings support the image; far above, the network has invented something.",
  "late": "Frames that arrived after a later frame and were left out of the image.",
  "lost": "Frames that the camera made and that never arrived.",
  "noise": "Standard deviation of the noise of a pixel, estimated from the image, as a share of white.",
  "order": "Which rows of the Hadamard matrix are shown, and in which sequence.",
  "patterns": "Which of the 1024 LEDs are lit at one time: a row of the Hadamard matrix.",
  "received": "Frames that arrived intact and in sequence.",
  "sampling": "Share of all 1024 patterns that is shown.",
  "settling": "How the light of a pattern rises and falls in time, measured once against a white sheet; with it, the leak from pattern to pattern is undone.",
  "sweep": "All patterns of the order shown once, each followed by its complement in a differential measurement.",
  "white": "The reading that counts as 1 in an image: the mean of the brightest 2 x 2 pixels, or what a white sheet gives.",
};
