//! Images of plain pixels, shared by readers, rendering and comparison.

/// An image in memory: eight bits per channel, rows from the top.
#[derive(Clone, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Image {
    width: usize,
    height: usize,
    #[cfg_attr(feature = "serde", serde(with = "crate::wire::plain"))]
    pixels: Vec<[u8; 4]>,
}

impl Image {
    /// Makes an image from red, green, blue and straight (not premultiplied) alpha, row after row from the
    /// top.
    ///
    /// # Panics
    /// If there are not `width * height` pixels.
    pub fn new(width: usize, height: usize, pixels: Vec<[u8; 4]>) -> Self {
        assert_eq!(pixels.len(), width * height, "an image of {width} by {height} needs as many pixels");
        Self { width, height, pixels }
    }

    /// Makes an image of one colour.
    pub fn filled(width: usize, height: usize, color: [u8; 4]) -> Self {
        Self { width, height, pixels: vec![color; width * height] }
    }

    /// Number of pixels in a row.
    pub fn width(&self) -> usize {
        self.width
    }
    /// Number of rows.
    pub fn height(&self) -> usize {
        self.height
    }
    /// All pixels, row after row from the top.
    pub fn pixels(&self) -> &[[u8; 4]] {
        &self.pixels
    }
    /// All pixels for writing, row after row from the top.
    pub fn pixels_mut(&mut self) -> &mut [[u8; 4]] {
        &mut self.pixels
    }
    /// The pixel at column `x` and row `y`, counted from the upper left corner.
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
