//! The sample model drawn on the CPU: at falling counts of faces for the README, and by each method at one count.
//!
//! A small rasteriser with a depth buffer, flat shading and lines along the edges: the same picture everywhere, no
//! driver needed. It will move to a render crate of its own when there is one; nothing else should come to lean on it
//! here.

mod palette;

use anyhow::{Context, Result, bail};
use lodsmith::core::{Positions, TriMesh, VertexId};
use lodsmith::{Measure, Method, NoControl, SimplifyOptions, Stop};

use crate::{root, sample};

/// The picture, from the root of the repository.
const PATH: &str = "docs/pictures/finial.png";
/// The folder of the pictures of methods, from the root.
const METHODS: &str = "docs/pictures/methods";
/// Faces of each of them: few enough to see each, many enough for the shape.
const METHOD_COUNT: usize = 1500;
/// Colours of each: with 64 the wall shows steps. (By eye.)
const METHOD_COLOURS: usize = 128;
/// Faces of the panels after the first, which is the whole model.
const COUNTS: [usize; 6] = [5000, 2500, 1500, 750, 300, 100];

/// Pixels of a panel: the width, the part with the model, and the part with the caption.
const PANEL: usize = 208;
const MODEL: usize = 378;
const CAPTION: usize = 78;
/// Pixels left free at either end of the row.
const MARGIN: usize = 16;
/// Samples along each side of a pixel.
const FINE: usize = 4;

type V = [f64; 3];

fn dot(a: V, b: V) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}
fn sub(a: V, b: V) -> V {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}
fn cross(a: V, b: V) -> V {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}
/// Unit length; a vector without length stays as it is.
fn unit(a: V) -> V {
    let length = dot(a, a).sqrt();
    if length > 0.0 { a.map(|x| x / length) } else { a }
}
fn mix(a: V, b: V, t: f64) -> V {
    [0, 1, 2].map(|k| a[k] + (b[k] - a[k]) * t)
}

/// Draws what is named: nothing for all, `finial`, `methods`, or single methods.
pub(crate) fn run(names: &[String]) -> Result<()> {
    let sample = sample::finial();
    let triangles = sample.triangles.iter().map(|t| t.map(|v| VertexId(v.into()))).collect();
    let whole = TriMesh::new(Positions::F32(sample.positions), triangles)?;
    let is_named = |name: &str| names.is_empty() || names.iter().any(|n| n == name);
    let known = |name: &&String| ["finial", "methods"].contains(&name.as_str()) || method(name).is_some();
    if let Some(name) = names.iter().find(|n| !known(n)) {
        bail!("no picture {name}: finial, methods, or the name of a method");
    }
    if is_named("finial") {
        finial(&whole)?;
    }
    let all = is_named("methods");
    for method in Method::ALL.into_iter().filter(|m| all || is_named(m.name())) {
        of_method(&whole, method)?;
    }
    Ok(())
}

fn method(name: &str) -> Option<Method> {
    Method::ALL.into_iter().find(|m| m.name() == name)
}

/// The picture of the README.
fn finial(whole: &TriMesh) -> Result<()> {
    let mut picture = Picture::new(2 * MARGIN + PANEL * (1 + COUNTS.len()), MODEL + CAPTION);
    let mut lines = Vec::new();
    for panel in 0..=COUNTS.len() {
        let left = MARGIN + panel * PANEL;
        let line = match panel.checked_sub(1) {
            None => captioned(&mut picture, left, whole, "original"),
            Some(i) => {
                let (mesh, below) = simplified(whole, Method::default(), COUNTS[i])?;
                captioned(&mut picture, left, &mesh, &below)
            }
        };
        lines.push(line);
    }
    picture.write(PATH, None)?;
    lines.iter().for_each(|line| println!("{line}"));
    Ok(())
}

/// The picture of a method.
fn of_method(whole: &TriMesh, method: Method) -> Result<()> {
    let (mesh, below) = simplified(whole, method, METHOD_COUNT).with_context(|| method.name())?;
    let mut picture = Picture::new(PANEL, MODEL + CAPTION);
    let line = captioned(&mut picture, 0, &mesh, &below);
    picture.write(&format!("{METHODS}/{}.png", method.name()), Some(METHOD_COLOURS))?;
    println!("{line}");
    Ok(())
}

/// A lighter mesh, and the largest distance of it in words.
fn simplified(whole: &TriMesh, method: Method, faces: usize) -> Result<(TriMesh, String)> {
    let mut options = SimplifyOptions::new(Stop::faces(faces));
    options.method = method;
    options.measure = Measure::Always;
    let done = lodsmith::simplify(whole, &options, &mut NoControl)?;
    let error = &done.report.error;
    let measured = error.measured.as_ref().context("the result was not measured")?;
    let below = format!("max {} %", figure(100.0 * measured.hausdorff.symmetric / error.diagonal));
    Ok((done.mesh, below))
}

/// Draws a mesh with its count and a line below; says both.
fn captioned(picture: &mut Picture, left: usize, mesh: &TriMesh, below: &str) -> String {
    draw(picture, left, mesh);
    let faces = grouped(mesh.face_count());
    let middle = left as f64 + PANEL as f64 / 2.0;
    picture.text(&format!("{faces} faces"), middle, MODEL as f64 + 22.0, 17.0, INK);
    picture.text(below, middle, MODEL as f64 + 48.0, 13.5, FAINT_INK);
    format!("{faces:>7} faces  {below}")
}

fn grouped(n: usize) -> String {
    if n < 1000 { n.to_string() } else { format!("{},{:03}", n / 1000, n % 1000) }
}

/// Two digits that say something.
fn figure(x: f64) -> String {
    let places = if x >= 1.0 {
        1
    } else if x >= 0.1 {
        2
    } else {
        3
    };
    format!("{x:.places$}")
}

/// Colours in linear light. Ink, brass and slate were chosen by eye.
const INK: V = [0.82, 0.84, 0.86];
const FAINT_INK: V = [0.36, 0.41, 0.47];
const BRASS: V = [0.60, 0.335, 0.125];
const ABOVE: V = [0.016, 0.022, 0.031];
const BELOW: V = [0.060, 0.075, 0.095];

/// How far the camera stands from the axis of the model, in its units; it looks down by some degrees.
const DISTANCE: f64 = 11.0;
const DOWN_DEG: f64 = 16.0;
/// Height that the camera looks at, and pixels for one unit there.
const LOOK_AT: f64 = 1.31;
const PIXELS: f64 = 115.0;

/// Draws one mesh into a panel.
fn draw(picture: &mut Picture, left: usize, mesh: &TriMesh) {
    let (sin, cos) = DOWN_DEG.to_radians().sin_cos();
    // From the model to the camera: x right, y up, z towards the eye.
    let view = |p: V| {
        let y = p[1] - LOOK_AT;
        [p[0], y * cos - p[2] * sin, y * sin + p[2] * cos]
    };
    let scale = PIXELS * FINE as f64;
    let (width, height) = (PANEL * FINE, MODEL * FINE);
    let project = |p: V| {
        let near = DISTANCE / (DISTANCE - p[2]);
        [width as f64 / 2.0 + p[0] * near * scale, height as f64 * 0.512 - p[1] * near * scale, near]
    };
    shadow(picture, left, &|p| project(view(p)));

    let mut depth = vec![0f64; width * height];
    let mut color = vec![[0f64; 3]; width * height];
    let surface = mesh.surface();
    let seen: Vec<V> = surface.positions().iter().map(view).collect();
    for triangle in surface.triangles() {
        let corners = triangle.map(|v| seen[v.index()]);
        let normal = unit(cross(sub(corners[1], corners[0]), sub(corners[2], corners[0])));
        let [a, b, c] = corners.map(project);
        let area = (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]);
        // The screen's y points down, so a face that looks at the eye turns the other way.
        if area >= 0.0 {
            continue;
        }
        let middle = [0, 1, 2].map(|k| (corners[0][k] + corners[1][k] + corners[2][k]) / 3.0);
        let shade = shade(normal, unit(sub([0.0, 0.0, DISTANCE], middle)));
        // Height of the triangle over each side, in samples.
        let side = |p: V, q: V| (p[0] - q[0]).hypot(p[1] - q[1]).max(1e-9);
        let over = [side(b, c), side(c, a), side(a, b)].map(|s| -area / s);
        // Lines fade where they would cover all.
        let least = over.iter().fold(f64::INFINITY, |m, &h| m.min(h)) / FINE as f64;
        let strength = 0.62 * ((least - 0.6) / 9.0).clamp(0.06, 1.0);
        let line = mix(shade, [0.012, 0.008, 0.006], strength);
        let range = |k: usize, end: usize| {
            let all = [a[k], b[k], c[k]];
            let low = all.iter().fold(f64::INFINITY, |m, &x| m.min(x)).floor().max(0.0) as usize;
            let high = all.iter().fold(0f64, |m, &x| m.max(x)).ceil().max(0.0) as usize;
            low..high.min(end)
        };
        for y in range(1, height) {
            for x in range(0, width) {
                let p = [x as f64 + 0.5, y as f64 + 0.5];
                let part =
                    |q: V, r: V| ((r[0] - q[0]) * (p[1] - q[1]) - (r[1] - q[1]) * (p[0] - q[0])) / area;
                let w = [part(b, c), part(c, a), part(a, b)];
                if w.iter().any(|&w| w < 0.0) {
                    continue;
                }
                // `near` is one over the distance, so it is linear on the screen.
                let near = w[0] * a[2] + w[1] * b[2] + w[2] * c[2];
                let at = y * width + x;
                if near > depth[at] {
                    depth[at] = near;
                    let to_edge = (0..3).map(|k| w[k] * over[k]).fold(f64::INFINITY, f64::min);
                    // Each side of an edge draws its half of the line.
                    color[at] = if to_edge < 0.55 * FINE as f64 { line } else { shade };
                }
            }
        }
    }
    for y in 0..MODEL {
        for x in 0..PANEL {
            let (mut sum, mut hits) = ([0f64; 3], 0usize);
            for at in (0..FINE * FINE).map(|i| (y * FINE + i / FINE) * width + x * FINE + i % FINE) {
                if depth[at] > 0.0 {
                    hits += 1;
                    (0..3).for_each(|k| sum[k] += color[at][k]);
                }
            }
            if hits > 0 {
                picture.blend(left + x, y, sum.map(|s| s / hits as f64), hits as f64 / (FINE * FINE) as f64);
            }
        }
    }
}

/// Light on a face: sky and ground, a warm lamp from the upper left, a cool one from behind on the right, a soft gleam.
fn shade(normal: V, to_eye: V) -> V {
    let sky = mix([0.10, 0.085, 0.075], [0.26, 0.31, 0.38], 0.5 + 0.5 * normal[1]);
    let key = unit([-0.55, 0.62, 0.62]);
    let rim = unit([0.85, 0.25, -0.30]);
    let lit = (0.85 * dot(normal, key) + 0.15).max(0.0);
    let behind = dot(normal, rim).max(0.0);
    let half = unit([0, 1, 2].map(|k| key[k] + to_eye[k]));
    let gleam = 0.16 * dot(normal, half).max(0.0).powi(20);
    [0, 1, 2].map(|k| {
        let light = sky[k] + [1.12, 1.02, 0.90][k] * lit + [0.20, 0.30, 0.42][k] * behind;
        BRASS[k] * light + gleam
    })
}

/// A soft dark spot on the ground under the foot.
fn shadow(picture: &mut Picture, left: usize, project: &dyn Fn(V) -> V) {
    let on_screen = |p: V| project(p).map(|x| x / FINE as f64);
    let (centre, side, front) =
        (on_screen([0.06, 0.0, 0.0]), on_screen([0.94, 0.0, 0.0]), on_screen([0.06, 0.0, 0.92]));
    let (rx, ry) = (side[0] - centre[0], front[1] - centre[1]);
    for y in 0..MODEL {
        for x in 0..PANEL {
            let d = ((x as f64 + 0.5 - centre[0]) / rx).hypot((y as f64 + 0.5 - centre[1]) / ry);
            let t = ((1.0 - d) / 0.42).clamp(0.0, 1.0);
            picture.blend(left + x, y, [0.010, 0.013, 0.018], 0.72 * t * t * (3.0 - 2.0 * t));
        }
    }
}

/// Pixels in linear light.
struct Picture {
    width: usize,
    height: usize,
    pixels: Vec<V>,
}

impl Picture {
    /// An empty sheet: a quiet wall above, lighter towards the ground.
    fn new(width: usize, height: usize) -> Self {
        let row = |y: usize| {
            let t = y as f64 / height as f64;
            mix(ABOVE, BELOW, t * t * (3.0 - 2.0 * t))
        };
        let pixels = (0..height).flat_map(|y| std::iter::repeat_n(row(y), width)).collect();
        Self { width, height, pixels }
    }

    fn blend(&mut self, x: usize, y: usize, color: V, share: f64) {
        if x < self.width && y < self.height {
            let pixel = &mut self.pixels[y * self.width + x];
            *pixel = mix(*pixel, color, share);
        }
    }

    /// One line of text about `middle`, its capitals `size` pixels high, its foot on `base`.
    fn text(&mut self, text: &str, middle: f64, base: f64, size: f64, color: V) {
        let width = |c: char| glyph(c).0 + GAP;
        let mut x = middle - size * (text.chars().map(width).sum::<f64>() - GAP) / 2.0;
        for c in text.chars() {
            for line in glyph(c).1 {
                let points: Vec<[f64; 2]> =
                    line.points().into_iter().map(|p| [x + p[0] * size, base - p[1] * size]).collect();
                self.line(&points, size * 0.056, color);
            }
            x += width(c) * size;
        }
    }

    /// A line with round ends, `half` pixels to either side.
    fn line(&mut self, points: &[[f64; 2]], half: f64, color: V) {
        let reach = half + 1.0;
        let low = |k: usize| points.iter().fold(f64::INFINITY, |m, p| m.min(p[k])) - reach;
        let high = |k: usize| points.iter().fold(0f64, |m, p| m.max(p[k])) + reach;
        for y in low(1).max(0.0) as usize..=high(1) as usize {
            for x in low(0).max(0.0) as usize..=high(0) as usize {
                let p = [x as f64 + 0.5, y as f64 + 0.5];
                let distance =
                    points.windows(2).map(|s| to_segment(p, s[0], s[1])).fold(f64::INFINITY, f64::min);
                self.blend(x, y, color, (half + 0.5 - distance).clamp(0.0, 1.0));
            }
        }
    }

    /// Writes the picture to a path from the root, in full or at most so many colours, and says so.
    fn write(&self, path: &str, colours: Option<usize>) -> Result<()> {
        let bytes = self.png(colours)?;
        let place = root().join(path);
        std::fs::create_dir_all(place.parent().context("the picture lies in a folder")?)?;
        std::fs::write(&place, &bytes).with_context(|| format!("writing {path}"))?;
        println!("{path}: {} × {} pixels, {} bytes", self.width, self.height, bytes.len());
        Ok(())
    }

    /// The picture as a PNG.
    fn png(&self, colours: Option<usize>) -> Result<Vec<u8>> {
        let byte = |x: f64| {
            let x = x.clamp(0.0, 1.0);
            let s = if x <= 0.003_130_8 { 12.92 * x } else { 1.055 * x.powf(1.0 / 2.4) - 0.055 };
            // Even numbers alone: a sixth smaller, and nobody sees it.
            (s * 127.0).round() as u8 * 2
        };
        let pixels: Vec<[u8; 3]> = self.pixels.iter().map(|p| p.map(byte)).collect();
        let mut file = Vec::new();
        let mut encoder = png::Encoder::new(&mut file, self.width as u32, self.height as u32);
        encoder.set_depth(png::BitDepth::Eight);
        encoder.set_compression(png::Compression::High);
        // Flat colours repeat: differences of neighbours would hide that.
        encoder.set_filter(png::Filter::NoFilter);
        match colours {
            None => {
                encoder.set_color(png::ColorType::Rgb);
                encoder.write_header()?.write_image_data(pixels.as_flattened())?;
            }
            Some(most) => {
                let (palette, index) = palette::indexed(&pixels, most);
                encoder.set_color(png::ColorType::Indexed);
                encoder.set_palette(palette.as_flattened().to_vec());
                encoder.write_header()?.write_image_data(&index)?;
            }
        }
        Ok(file)
    }
}

fn to_segment(p: [f64; 2], a: [f64; 2], b: [f64; 2]) -> f64 {
    let (d, e) = ([b[0] - a[0], b[1] - a[1]], [p[0] - a[0], p[1] - a[1]]);
    let length_sq = d[0] * d[0] + d[1] * d[1];
    let t = if length_sq > 0.0 { ((d[0] * e[0] + d[1] * e[1]) / length_sq).clamp(0.0, 1.0) } else { 0.0 };
    (e[0] - t * d[0]).hypot(e[1] - t * d[1])
}

/// Between two letters, in heights of a capital.
const GAP: f64 = 0.22;

/// A stroke of a letter; capitals are 1 high and stand on 0.
enum Stroke {
    /// From point to point.
    Through(&'static [[f64; 2]]),
    /// Part of an ellipse: its centre, its half axes, and from which angle to which, in degrees.
    Arc([f64; 2], [f64; 2], [f64; 2]),
}

impl Stroke {
    fn points(&self) -> Vec<[f64; 2]> {
        match self {
            Self::Through(points) => points.to_vec(),
            Self::Arc(centre, half, [from, to]) => (0..=24)
                .map(|i| {
                    let (sin, cos) = (from + (to - from) * f64::from(i) / 24.0).to_radians().sin_cos();
                    [centre[0] + half[0] * cos, centre[1] + half[1] * sin]
                })
                .collect(),
        }
    }
}

/// Width and strokes of a letter; only those that captions use.
fn glyph(c: char) -> (f64, Vec<Stroke>) {
    use Stroke::{Arc, Through};
    const ROUND: [f64; 2] = [0.0, 360.0];
    match c {
        '0' => (0.56, vec![Arc([0.28, 0.5], [0.28, 0.5], ROUND)]),
        '1' => (0.40, vec![Through(&[[0.04, 0.80], [0.28, 1.0], [0.28, 0.0]])]),
        '2' => (
            0.54,
            vec![
                Arc([0.27, 0.73], [0.26, 0.27], [170.0, -38.0]),
                Through(&[[0.475, 0.564], [0.01, 0.0], [0.54, 0.0]]),
            ],
        ),
        '3' => (
            0.54,
            vec![
                Arc([0.25, 0.765], [0.24, 0.235], [155.0, -90.0]),
                Arc([0.25, 0.265], [0.28, 0.265], [90.0, -155.0]),
            ],
        ),
        '4' => (0.58, vec![Through(&[[0.43, 0.0], [0.43, 1.0], [0.0, 0.27], [0.58, 0.27]])]),
        '5' => (
            0.54,
            vec![
                Through(&[[0.49, 1.0], [0.10, 1.0], [0.06, 0.54]]),
                Arc([0.26, 0.32], [0.28, 0.32], [136.0, -152.0]),
            ],
        ),
        '6' => (
            0.56,
            vec![Arc([0.28, 0.31], [0.28, 0.31], ROUND), Arc([0.60, 0.31], [0.60, 0.69], [180.0, 108.0])],
        ),
        '7' => (0.54, vec![Through(&[[0.0, 1.0], [0.54, 1.0], [0.18, 0.0]])]),
        '8' => {
            (0.56, vec![Arc([0.28, 0.765], [0.23, 0.235], ROUND), Arc([0.28, 0.265], [0.28, 0.265], ROUND)])
        }
        '9' => (
            0.56,
            vec![Arc([0.28, 0.69], [0.28, 0.31], ROUND), Arc([-0.04, 0.69], [0.60, 0.69], [0.0, -72.0])],
        ),
        ',' => (0.10, vec![Through(&[[0.07, 0.02], [0.0, -0.15]])]),
        '.' => (0.06, vec![Through(&[[0.03, 0.01], [0.03, 0.0]])]),
        '%' => (
            0.80,
            vec![
                Arc([0.15, 0.78], [0.15, 0.21], ROUND),
                Arc([0.65, 0.22], [0.15, 0.21], ROUND),
                Through(&[[0.62, 1.0], [0.18, 0.0]]),
            ],
        ),
        'a' => (0.48, vec![Arc([0.23, 0.33], [0.23, 0.33], ROUND), Through(&[[0.46, 0.66], [0.46, 0.0]])]),
        'c' => (0.42, vec![Arc([0.24, 0.33], [0.24, 0.33], [48.0, 312.0])]),
        'e' => (
            0.48,
            vec![Through(&[[0.01, 0.35], [0.48, 0.35]]), Arc([0.245, 0.33], [0.24, 0.33], [4.0, 318.0])],
        ),
        'f' => (
            0.32,
            vec![
                Arc([0.31, 0.78], [0.19, 0.24], [75.0, 180.0]),
                Through(&[[0.12, 0.78], [0.12, 0.0]]),
                Through(&[[0.0, 0.65], [0.30, 0.65]]),
            ],
        ),
        'g' => (
            0.48,
            vec![
                Arc([0.23, 0.33], [0.23, 0.33], ROUND),
                Through(&[[0.46, 0.66], [0.46, -0.06]]),
                Arc([0.23, -0.06], [0.23, 0.24], [0.0, -150.0]),
            ],
        ),
        'i' => (0.06, vec![Through(&[[0.03, 0.66], [0.03, 0.0]]), Through(&[[0.03, 0.92], [0.03, 0.93]])]),
        'l' => (0.06, vec![Through(&[[0.03, 1.0], [0.03, 0.0]])]),
        'm' => (
            0.72,
            vec![
                Through(&[[0.02, 0.66], [0.02, 0.0]]),
                Arc([0.19, 0.43], [0.17, 0.23], [180.0, 0.0]),
                Through(&[[0.36, 0.43], [0.36, 0.0]]),
                Arc([0.53, 0.43], [0.17, 0.23], [180.0, 0.0]),
                Through(&[[0.70, 0.43], [0.70, 0.0]]),
            ],
        ),
        'n' => (
            0.44,
            vec![
                Through(&[[0.02, 0.66], [0.02, 0.0]]),
                Arc([0.22, 0.43], [0.20, 0.23], [180.0, 0.0]),
                Through(&[[0.42, 0.43], [0.42, 0.0]]),
            ],
        ),
        'o' => (0.48, vec![Arc([0.24, 0.33], [0.24, 0.33], ROUND)]),
        'r' => (
            0.28,
            vec![Through(&[[0.02, 0.66], [0.02, 0.0]]), Arc([0.24, 0.40], [0.22, 0.26], [180.0, 82.0])],
        ),
        's' => (
            0.40,
            vec![
                Arc([0.20, 0.495], [0.18, 0.165], [35.0, 270.0]),
                Arc([0.20, 0.165], [0.20, 0.165], [90.0, -145.0]),
            ],
        ),
        'x' => (0.44, vec![Through(&[[0.02, 0.66], [0.42, 0.0]]), Through(&[[0.42, 0.66], [0.02, 0.0]])]),
        _ => (0.14, Vec::new()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn captions_have_all_their_letters() {
        for c in "0123456789,.% faces max original".chars().filter(|c| *c != ' ') {
            assert!(!glyph(c).1.is_empty(), "{c}");
        }
    }

    #[test]
    fn only_what_is_known_is_drawn() {
        let error = run(&["magic".to_owned()]).unwrap_err().to_string();
        assert!(error.contains("no picture magic"), "{error}");
        assert_eq!(method("remesh"), Some(Method::Remesh));
    }

    #[test]
    fn figures_have_two_digits_that_say_something() {
        assert_eq!([0.0312, 0.312, 3.12].map(figure), ["0.031", "0.31", "3.1"]);
        assert_eq!([100, 16_192].map(grouped), ["100", "16,192"]);
    }
}
