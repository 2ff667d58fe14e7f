//! A picture to draw on.

/// A picture of three 8-bit colours: red, green, blue.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Canvas {
    width: u32,
    height: u32,
    pixels: Vec<[u8; 3]>,
}

impl Canvas {
    /// A picture of one colour.
    #[must_use]
    pub fn new(width: u32, height: u32, colour: [u8; 3]) -> Self {
        Self { width, height, pixels: vec![colour; width as usize * height as usize] }
    }

    /// Columns.
    #[must_use]
    pub fn width(&self) -> u32 {
        self.width
    }

    /// Rows.
    #[must_use]
    pub fn height(&self) -> u32 {
        self.height
    }

    /// All pixels, row-major.
    #[must_use]
    pub fn pixels(&self) -> &[[u8; 3]] {
        &self.pixels
    }

    /// All pixels, row-major.
    pub fn pixels_mut(&mut self) -> &mut [[u8; 3]] {
        &mut self.pixels
    }

    /// One pixel; `None` outside of the picture.
    #[must_use]
    pub fn pixel(&self, x: u32, y: u32) -> Option<&[u8; 3]> {
        (x < self.width).then(|| self.pixels.get(self.place(x, y)))?
    }

    /// One pixel to draw on; `None` outside of the picture.
    pub fn pixel_mut(&mut self, x: u32, y: u32) -> Option<&mut [u8; 3]> {
        let place = self.place(x, y);
        (x < self.width).then(|| self.pixels.get_mut(place))?
    }

    /// A part of the picture, which must lie inside of it.
    ///
    /// # Panics
    /// If the part does not lie inside of the picture.
    #[must_use]
    pub fn part(&self, (left, top): (u32, u32), (width, height): (u32, u32)) -> Self {
        assert!(left + width <= self.width, "a part of {} columns", self.width);
        let row = |y| &self.pixels[self.place(left, y)..][..width as usize];
        let pixels = (top..top + height).flat_map(row).copied().collect();
        Self { width, height, pixels }
    }

    fn place(&self, x: u32, y: u32) -> usize {
        y as usize * self.width as usize + x as usize
    }
}
