//! Contact sheets: several pictures in one image, side by side or in rows, with captions and a legend.

use glam::Vec3;
use lodsmith_core::Image;

use crate::colormap::ColorMap;
use crate::font;
use crate::linear::over;
use crate::linear::{self, Encoder};
use crate::look::Background;

/// Cap heights in pixels: of the first line of a caption, and of the others.
const TITLE_PX: f32 = 13.0;
const LINE_PX: f32 = 10.5;
/// Line heights in pixels.
const TITLE_STEP: usize = 27;
const LINE_STEP: usize = 22;
/// Margin around the sheet and between panels, in pixels.
const MARGIN_PX: usize = 12;
/// Height of a legend in pixels.
const LEGEND_HEIGHT_PX: usize = 52;
/// Half the stroke width, in heights of a capital.
const STROKE_HALF_WIDTH: f32 = 0.062;

/// A picture with a caption.
#[derive(Clone, Debug)]
pub struct Panel {
    /// The picture; the sheet shows through where it is transparent.
    pub picture: Image,
    /// Lines below it; the first is larger.
    pub caption: Vec<String>,
}

/// Legend of a heat map: its colours and the values at their ends, in the user's units.
#[derive(Clone, Debug)]
pub struct Legend {
    /// The colours.
    pub map: ColorMap,
    /// The values at the ends of the colours.
    pub range: [f32; 2],
    /// Label of the values; may be empty.
    pub title: String,
}

/// Lays out panels in rows of `columns`, on one background.
///
/// Panels may differ in size: each is centred in its cell. Text wider than its panel is truncated with dots.
pub fn sheet(panels: &[Panel], columns: usize, background: Background, legend: Option<&Legend>) -> Image {
    let columns = columns.clamp(1, panels.len().max(1));
    let rows = panels.len().div_ceil(columns);
    let widest = panels.iter().map(|p| p.picture.width()).max().unwrap_or(0);
    let highest = panels.iter().map(|p| p.picture.height()).max().unwrap_or(0);
    let lines = panels.iter().map(|p| p.caption.len()).max().unwrap_or(0);
    let caption = if lines == 0 { 0 } else { TITLE_STEP + (lines - 1) * LINE_STEP + MARGIN_PX };
    let below = if legend.is_some() { LEGEND_HEIGHT_PX } else { 0 };
    let width = columns * widest + (columns + 1) * MARGIN_PX;
    let height = rows * (highest + caption + MARGIN_PX) + MARGIN_PX + below;
    let mut canvas = Canvas::new(width, height, background);
    for (i, panel) in panels.iter().enumerate() {
        let left = MARGIN_PX + (i % columns) * (widest + MARGIN_PX);
        let top = MARGIN_PX + (i / columns) * (highest + caption + MARGIN_PX);
        let (w, h) = (panel.picture.width(), panel.picture.height());
        canvas.draw_picture(&panel.picture, left + (widest - w) / 2, top + (highest - h) / 2);
        canvas.caption(&panel.caption, left, top + highest, widest);
    }
    if let Some(legend) = legend {
        canvas.legend(legend, height - LEGEND_HEIGHT_PX - MARGIN_PX / 2);
    }
    canvas.image()
}

/// An image to draw on.
pub struct Canvas {
    width: usize,
    height: usize,
    /// Linear premultiplied colour with opacity.
    pixels: Vec<[f32; 4]>,
    ink: Vec3,
    faint: Vec3,
}

impl Canvas {
    /// Makes an empty canvas. Ink is light on dark backgrounds and dark on light ones.
    pub fn new(width: usize, height: usize, background: Background) -> Self {
        let row = |y: usize| {
            let t = (y as f32 + 0.5) / height.max(1) as f32;
            let opaque = |c: Vec3| [c.x, c.y, c.z, 1.0];
            background.edges().map_or([0.0; 4], |[a, b]| {
                opaque(linear::of_srgb([0, 1, 2].map(|k| a[k] + (b[k] - a[k]) * t)))
            })
        };
        let pixels = (0..height).flat_map(|y| std::iter::repeat_n(row(y), width)).collect();
        let [r, g, b, a] = row(height / 2);
        let (ink, faint) = match 0.21 * r + 0.72 * g + 0.07 * b {
            // Grey is visible on any background.
            _ if a == 0.0 => (0.5, 0.5),
            light if light > 0.25 => (0.12, 0.32),
            _ => (0.93, 0.72),
        };
        let grey = |s: f32| linear::of_srgb([s; 3]);
        Self { width, height, pixels, ink: grey(ink), faint: grey(faint) }
    }

    /// Draws a picture with its upper left corner at a position.
    pub fn draw_picture(&mut self, picture: &Image, left: usize, top: usize) {
        for y in 0..picture.height().min(self.height.saturating_sub(top)) {
            for x in 0..picture.width().min(self.width.saturating_sub(left)) {
                let [r, g, b, a] = picture.at(x, y);
                let a = f32::from(a) / 255.0;
                let color = [r, g, b].map(|c| linear::of_byte(c) * a);
                over([color[0], color[1], color[2], a], &mut self.pixels[(top + y) * self.width + left + x]);
            }
        }
    }

    /// Draws the lines of a caption below a picture; the first is larger.
    pub fn caption(&mut self, lines: &[String], left: usize, top: usize, width: usize) {
        let middle = left as f32 + width as f32 / 2.0;
        let mut base = top as f32;
        for (i, line) in lines.iter().enumerate() {
            let (size, step, ink) =
                if i == 0 { (TITLE_PX, TITLE_STEP, self.ink) } else { (LINE_PX, LINE_STEP, self.faint) };
            base += step as f32;
            let line = truncate(line, width as f32 / size);
            self.text(&line, middle, base - 5.0, size, ink);
        }
    }

    /// Draws a colour bar with numbers, centred on the sheet.
    fn legend(&mut self, legend: &Legend, top: usize) {
        let length = (self.width * 3 / 5).min(420).max(self.width.min(60));
        let left = (self.width - length) / 2;
        for x in 0..length {
            let color = linear::of_srgb(legend.map.color((x as f32 + 0.5) / length as f32));
            for y in top..(top + 12).min(self.height) {
                self.pixels[y * self.width + left + x] = [color.x, color.y, color.z, 1.0];
            }
        }
        let [low, high] = legend.range;
        let ticks = if length >= 240 { 5 } else { 3 };
        for i in 0..ticks {
            let t = i as f32 / (ticks - 1) as f32;
            let at = left as f32 + t * length as f32;
            self.text(&figure(low + (high - low) * t), at, top as f32 + 29.0, 10.0, self.faint);
        }
        self.text(&legend.title, self.width as f32 / 2.0, top as f32 + 46.0, 10.0, self.faint);
    }

    /// Draws text centred at `middle` on the baseline `base`, with the cap height `size`; linear ink.
    fn text(&mut self, text: &str, middle: f32, base: f32, size: f32, ink: Vec3) {
        let mut x = middle - size * font::length(text) / 2.0;
        for c in text.chars() {
            for stroke in font::glyph(c).1 {
                let points: Vec<[f32; 2]> =
                    stroke.points().into_iter().map(|p| [x + p[0] * size, base - p[1] * size]).collect();
                self.line(&points, (size * STROKE_HALF_WIDTH).max(0.55), ink);
            }
            x += font::advance(c) * size;
        }
    }

    /// Draws a polyline with round ends, `half` pixels to either side.
    fn line(&mut self, points: &[[f32; 2]], half: f32, ink: Vec3) {
        let reach = half + 1.0;
        let low = |k: usize| points.iter().fold(f32::INFINITY, |m, p| m.min(p[k])) - reach;
        let high = |k: usize| points.iter().fold(0f32, |m, p| m.max(p[k])) + reach;
        let rows = low(1).max(0.0) as usize..(high(1) as usize + 1).min(self.height);
        let columns = low(0).max(0.0) as usize..(high(0) as usize + 1).min(self.width);
        for y in rows {
            for x in columns.clone() {
                let p = [x as f32 + 0.5, y as f32 + 0.5];
                let away = points.windows(2).map(|s| to_segment(p, s[0], s[1])).fold(f32::INFINITY, f32::min);
                let c = (half + 0.5 - away).clamp(0.0, 1.0);
                if c > 0.0 {
                    over([ink.x * c, ink.y * c, ink.z * c, c], &mut self.pixels[y * self.width + x]);
                }
            }
        }
    }

    /// Converts the canvas to an image.
    pub fn image(&self) -> Image {
        let encoder = Encoder::new();
        let pixel = |&[r, g, b, a]: &[f32; 4]| {
            let color = if a > 0.0 { Vec3::new(r, g, b) / a } else { Vec3::ZERO };
            let [r, g, b] = encoder.bytes(color);
            [r, g, b, (a * 255.0).round() as u8]
        };
        Image::new(self.width, self.height, self.pixels.iter().map(pixel).collect())
    }
}

impl std::fmt::Debug for Canvas {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "Canvas({} x {})", self.width, self.height)
    }
}

/// Truncates a text to a width, in heights of a capital.
fn truncate(text: &str, longest: f32) -> String {
    if font::length(text) <= longest {
        return text.to_owned();
    }
    let mut kept: String = text.to_owned();
    while kept.pop().is_some() {
        let short = format!("{}...", kept.trim_end());
        if font::length(&short) <= longest {
            return short;
        }
    }
    String::new()
}

/// Formats a number with three significant digits; very small and large ones with an exponent.
fn figure(x: f32) -> String {
    if x == 0.0 {
        return "0".to_owned();
    }
    if !x.is_finite() || x.abs() < 1e-3 || x.abs() >= 1e6 {
        return format!("{x:.1e}");
    }
    let decimals = (2 - x.abs().log10().floor() as i32).max(0) as usize;
    let text = format!("{x:.decimals$}");
    if text.contains('.') { text.trim_end_matches('0').trim_end_matches('.').to_owned() } else { text }
}

fn to_segment(p: [f32; 2], a: [f32; 2], b: [f32; 2]) -> f32 {
    let (d, e) = ([b[0] - a[0], b[1] - a[1]], [p[0] - a[0], p[1] - a[1]]);
    let length_sq = d[0] * d[0] + d[1] * d[1];
    let t = if length_sq > 0.0 { ((d[0] * e[0] + d[1] * e[1]) / length_sq).clamp(0.0, 1.0) } else { 0.0 };
    (e[0] - t * d[0]).hypot(e[1] - t * d[1])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_have_three_significant_digits() {
        assert_eq!(
            [0.0, 0.25, 12.3456, 1234.0, 2.5e-7, 0.0312].map(figure),
            ["0", "0.25", "12.3", "1234", "2.5e-7", "0.0312"]
        );
    }

    #[test]
    fn long_texts_are_cut() {
        assert_eq!(truncate("bunny", 100.0), "bunny");
        let short = truncate("a_very_long_name_of_a_file.obj", 6.0);
        assert!(short.ends_with("...") && font::length(&short) <= 6.0, "{short}");
        assert_eq!(truncate("bunny", 0.1), "");
    }

    #[test]
    fn panels_stand_in_rows_and_have_captions() {
        let panel = |n: usize| Panel {
            picture: Image::filled(40, 30, [255, 0, 0, 255]),
            caption: vec![format!("panel {n}"); n],
        };
        let picture = sheet(&[panel(1), panel(2), panel(1)], 2, Background::Color([1.0; 3]), None);
        assert_eq!(picture.width(), 2 * 40 + 3 * MARGIN_PX);
        assert_eq!(picture.at(MARGIN_PX + 5, MARGIN_PX + 5), [255, 0, 0, 255]);
        assert_eq!(picture.at(MARGIN_PX / 2, MARGIN_PX / 2), [255; 4]);
        let is_dark = |p: &&[u8; 4]| p[0] < 100 && p[1] < 100;
        assert!(picture.pixels().iter().filter(is_dark).count() > 50, "the caption is drawn");
    }
}
