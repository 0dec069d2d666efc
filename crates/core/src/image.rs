//! Plain pixels, shared by whoever reads, draws or compares pictures.

/// A picture in memory: eight bits a channel, rows from the top.
#[derive(Clone, PartialEq, Eq)]
pub struct Image {
    width: usize,
    height: usize,
    pixels: Vec<[u8; 4]>,
}

impl Image {
    /// A picture from red, green, blue and alpha (not multiplied in), row after row from the top.
    ///
    /// # Panics
    /// If there is not one pixel for each place.
    pub fn new(width: usize, height: usize, pixels: Vec<[u8; 4]>) -> Self {
        assert_eq!(pixels.len(), width * height, "one pixel for each place");
        Self { width, height, pixels }
    }

    /// A picture of one colour.
    pub fn filled(width: usize, height: usize, color: [u8; 4]) -> Self {
        Self { width, height, pixels: vec![color; width * height] }
    }

    /// Pixels in a row.
    pub fn width(&self) -> usize {
        self.width
    }
    /// Rows.
    pub fn height(&self) -> usize {
        self.height
    }
    /// All pixels, row after row from the top.
    pub fn pixels(&self) -> &[[u8; 4]] {
        &self.pixels
    }
    /// The same, to be drawn on.
    pub fn pixels_mut(&mut self) -> &mut [[u8; 4]] {
        &mut self.pixels
    }
    /// The pixel at a place, from the upper left corner.
    ///
    /// # Panics
    /// If it lies outside.
    pub fn at(&self, x: usize, y: usize) -> [u8; 4] {
        assert!(x < self.width, "column {x} of {}", self.width);
        self.pixels[y * self.width + x]
    }
}

impl std::fmt::Debug for Image {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "Image({} x {})", self.width, self.height)
    }
}
