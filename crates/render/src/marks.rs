//! Line overlays: open borders and defects.

use lodsmith_core::mesh::defects::{duplicates, is_zero_area};
use lodsmith_core::topology::EdgeKind;
use lodsmith_core::{Topology, VertexId};

use crate::linear;
use crate::linear::over;
use crate::projection::Projection;
use crate::raster::{BAND_ROWS, Band, Screen};
use crate::subject::Subject;
use crate::view::View;

/// Open borders. Colours are in sRGB, chosen to be distinguishable on any surface.
pub const BORDER_COLOR: [f32; 3] = [1.0, 0.27, 0.16];
/// Edges with more than two faces.
pub const NON_MANIFOLD_COLOR: [f32; 3] = [0.85, 0.10, 0.95];
/// Faces without area.
pub const ZERO_AREA_COLOR: [f32; 3] = [1.0, 0.85, 0.10];
/// Duplicate faces.
pub const DUPLICATE_COLOR: [f32; 3] = [0.10, 0.80, 0.95];

/// Line width in pixels, in addition to the width of wireframe lines.
const WIDTH_PX: f32 = 2.2;
/// Relative depth tolerance for lines on a surface. (Guessed.)
const DEPTH_TOLERANCE: f32 = 3e-3;

struct Line {
    ends: [[f32; 3]; 2],
    color: [f32; 3],
}

/// All lines, binned by the bands that they touch.
pub(crate) struct Marks {
    lines: Vec<Line>,
    bands: Vec<Vec<u32>>,
    half: f32,
}

impl Marks {
    pub(crate) fn new(subject: &Subject, screen: &Screen<'_>, view: &View) -> Self {
        let factor = if view.fine { 2.0 } else { 1.0 };
        let half = 0.5 * (WIDTH_PX + view.look.wire_width_px - 1.0).clamp(1.0, 64.0) * factor;
        let mut marks =
            Self { lines: Vec::new(), bands: vec![Vec::new(); screen.height.div_ceil(BAND_ROWS)], half };
        let look = &view.look;
        if !(look.borders || look.defects) {
            return marks;
        }
        let edges: Vec<Vec<([VertexId; 2], [f32; 3])>> =
            subject.meshes.iter().map(|drawn| marked(&drawn.mesh, look.borders, look.defects)).collect();
        for (part, placed) in subject.parts.iter().zip(&screen.placed) {
            let positions = placed.drawn.mesh.positions().view();
            for (ends, color) in &edges[part.mesh] {
                let ends = ends.map(|v| screen.projection.screen(placed.to_view.of(positions.get(v).into())));
                // Lines with an end behind the eye are left out.
                if let [Some(a), Some(b)] = ends {
                    marks.add([a, b].map(|p| p.map(|x| x as f32)), *color, screen);
                }
            }
        }
        marks
    }

    fn add(&mut self, ends: [[f32; 3]; 2], color: [f32; 3], screen: &Screen<'_>) {
        let reach = self.half + 1.0;
        let [low, high] = [ends[0][1].min(ends[1][1]) - reach, ends[0][1].max(ends[1][1]) + reach];
        if high < 0.0 || low >= screen.height as f32 {
            return;
        }
        let row = |y: f32| (y.max(0.0) as usize / BAND_ROWS).min(self.bands.len() - 1);
        for band in row(low)..=row(high) {
            self.bands[band].push(self.lines.len() as u32);
        }
        self.lines.push(Line { ends, color: linear::of_srgb(color).to_array() });
    }

    /// Draws the visible parts of the lines of a band over its colours.
    pub(crate) fn draw(&self, index: usize, band: &Band, projection: &Projection, colors: &mut [[f32; 4]]) {
        let reach = self.half + 1.0;
        for &line in &self.bands[index] {
            let Line { ends: [a, b], color } = &self.lines[line as usize];
            let (dx, dy) = (b[0] - a[0], b[1] - a[1]);
            let length_sq = dx * dx + dy * dy;
            let share_at = |x: f32, y: f32| {
                let t = (x - a[0]) * dx + (y - a[1]) * dy;
                if length_sq > 0.0 { (t / length_sq).clamp(0.0, 1.0) } else { 0.0 }
            };
            let clamp = |y: f32| y.clamp(band.first_row as f32, (band.first_row + band.rows) as f32) as usize;
            for y in clamp(a[1].min(b[1]) - reach)..clamp(a[1].max(b[1]) + reach + 1.0) {
                // The part of the line near this row.
                let py = y as f32 + 0.5;
                let at = |row: f32| {
                    let t = if dy.abs() > 1e-6 { ((row - a[1]) / dy).clamp(0.0, 1.0) } else { 0.0 };
                    a[0] + dx * t
                };
                let [p, q] = if dy.abs() > 1e-6 { [at(py - reach), at(py + reach)] } else { [a[0], b[0]] };
                let first = (p.min(q) - reach).clamp(0.0, band.width as f32) as usize;
                let end = (p.max(q) + reach + 1.0).clamp(0.0, band.width as f32) as usize;
                for x in first..end {
                    let px = x as f32 + 0.5;
                    let t = share_at(px, py);
                    let away = (a[0] + dx * t - px).hypot(a[1] + dy * t - py);
                    let cover = (self.half + 0.5 - away).clamp(0.0, 1.0);
                    if cover <= 0.0 {
                        continue;
                    }
                    let distance = projection.distance(a[2] + (b[2] - a[2]) * t);
                    let at = (y - band.first_row) * band.width + x;
                    let near = band.cells[at].near.to_array();
                    let is_seen = |n: &&f32| {
                        **n == f32::NEG_INFINITY
                            || distance <= projection.distance(**n) * (1.0 + DEPTH_TOLERANCE)
                    };
                    let seen = near.iter().filter(is_seen).count() as f32 * 0.25;
                    let c = cover * seen;
                    over([color[0] * c, color[1] * c, color[2] * c, c], &mut colors[at]);
                }
            }
        }
    }
}

/// Returns the edges to be marked, with their colours; the most important come last.
fn marked(mesh: &lodsmith_core::TriMesh, borders: bool, defects: bool) -> Vec<([VertexId; 2], [f32; 3])> {
    let surface = mesh.surface();
    let topology = Topology::new(&surface);
    let mut lines = Vec::new();
    let mut of_kind = |kind: EdgeKind, color: [f32; 3]| {
        let edges = topology.edges().filter(|&h| topology.kind(h) == Some(kind));
        lines.extend(edges.map(|h| ([topology.origin(h), topology.target(h)], color)));
    };
    if borders {
        of_kind(EdgeKind::Border, BORDER_COLOR);
    }
    if !defects {
        return lines;
    }
    of_kind(EdgeKind::NonManifold, NON_MANIFOLD_COLOR);
    let positions = surface.positions();
    let faces: Vec<[VertexId; 3]> =
        (0..topology.face_count()).map(|f| topology.triangle(lodsmith_core::FaceId(f as u32))).collect();
    let round = |t: [VertexId; 3], color| [[t[0], t[1]], [t[1], t[2]], [t[2], t[0]]].map(|e| (e, color));
    let is_plain = |t: &[VertexId; 3]| t[0] != t[1] && t[1] != t[2] && t[2] != t[0];
    let plain: Vec<[VertexId; 3]> = faces.iter().copied().filter(is_plain).collect();
    let twice = duplicates(&plain, positions.len());
    for face in twice.same_winding.iter().chain(&twice.opposite) {
        lines.extend(round(plain[face.index()], DUPLICATE_COLOR));
    }
    for t in &faces {
        if is_zero_area(t.map(|v| positions.get(v))) {
            lines.extend(round(*t, ZERO_AREA_COLOR));
        }
    }
    lines
}
