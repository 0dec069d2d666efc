//! Which face each sample of the picture sees.
//!
//! Vertices go to the screen, faces into bands of rows, and each band keeps the nearest face of every sample. Bands and
//! pieces of work have fixed sizes and faces come in their order, so the answer is the same with any number of threads.

use rayon::prelude::*;
use wide::{f32x4, u32x4};

use glam::DVec3;
use lodsmith_core::{Positions, VertexId};

use crate::projection::{Projection, ToView};
use crate::subject::{Drawn, Part, Subject};

/// Rows of a band: its samples fit into the second cache at usual widths. Even, for fine pictures.
pub(crate) const BAND: usize = 16;
/// Faces, or vertices, of one piece of work.
const PIECE: usize = 1 << 15;
/// No face.
pub(crate) const NONE: u32 = u32::MAX;
/// Marks places in the list of clipped faces.
const CLIPPED: u32 = 1 << 31;

/// Where in a pixel its four samples lie, from its middle: each in a column and a row of its own.
pub(crate) const SAMPLES: [[f32; 2]; 4] =
    [[-0.125, -0.375], [0.375, -0.125], [-0.375, 0.125], [0.125, 0.375]];

/// A mesh on the screen.
pub(crate) struct Placed<'a> {
    pub(crate) drawn: &'a Drawn,
    pub(crate) to_view: ToView,
    pub(crate) first_face: u32,
    /// Of each vertex, its place in pixels and how near it is; the first is no number where faces must be clipped.
    pub(crate) corners: Vec<[f32; 3]>,
}

impl<'a> Placed<'a> {
    fn new(subject: &'a Subject, part: &Part, projection: &Projection) -> Self {
        let drawn = &subject.meshes[part.mesh];
        let to_view = projection.to_view(&part.world_from_mesh);
        let on_screen = |p: DVec3| projection.on_screen(to_view.of(p)).map(|x| x as f32);
        let mut corners = vec![[0f32; 3]; drawn.mesh.vertex_count()];
        match drawn.mesh.positions() {
            Positions::F32(all) => {
                corners.par_chunks_mut(PIECE).zip(all.par_chunks(PIECE)).for_each(|(to, from)| {
                    to.iter_mut().zip(from).for_each(|(c, p)| *c = on_screen(DVec3::from(p.map(f64::from))));
                })
            }
            Positions::F64(all) => {
                corners.par_chunks_mut(PIECE).zip(all.par_chunks(PIECE)).for_each(|(to, from)| {
                    to.iter_mut().zip(from).for_each(|(c, p)| *c = on_screen(DVec3::from(*p)));
                })
            }
        }
        Self { drawn, to_view, first_face: part.first_face, corners }
    }

    /// The vertices of a face of the mesh.
    #[inline(always)]
    pub(crate) fn vertices(&self, face: usize) -> [VertexId; 3] {
        self.drawn.mesh.triangles()[face].map(|w| self.drawn.mesh.vertex_of(w))
    }
    /// The corners of a face on the screen.
    #[inline(always)]
    pub(crate) fn on_screen(&self, face: usize) -> [[f32; 3]; 3] {
        self.vertices(face).map(|v| self.corners[v.index()])
    }
    /// The corners of a face in the view, as exact as they come.
    pub(crate) fn in_view(&self, face: usize) -> [DVec3; 3] {
        let positions = self.drawn.mesh.positions().view();
        self.vertices(face).map(|v| self.to_view.of(DVec3::from(positions.get(v))))
    }
    /// Whether a face needs clipping.
    #[inline(always)]
    pub(crate) fn is_cut(corners: &[[f32; 3]; 3]) -> bool {
        (corners[0][0] + corners[1][0] + corners[2][0]).is_nan()
    }
}

/// What a face asks of the one who draws it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Kind {
    /// It hides what lies behind.
    Solid,
    /// Its back is not seen.
    Front,
    /// It has holes where its image says so.
    Masked,
    /// The same, and its back is not seen.
    MaskedFront,
    /// One sees through it.
    Blended,
    /// The same, and its back is not seen.
    BlendedFront,
}

impl Kind {
    fn hides_back(self) -> bool {
        matches!(self, Self::Front | Self::MaskedFront | Self::BlendedFront)
    }
    fn is_masked(self) -> bool {
        matches!(self, Self::Masked | Self::MaskedFront)
    }
    fn is_blended(self) -> bool {
        matches!(self, Self::Blended | Self::BlendedFront)
    }
}

/// What a mesh's faces are; by the region of a face where they differ.
pub(crate) type Kinds = Vec<Vec<Kind>>;

/// A piece of a face that had to be clipped.
struct Cut {
    face: u32,
    corners: [[f32; 3]; 3],
}

/// Some faces of one part, by the bands that they touch.
struct Piece {
    part: usize,
    bands: Vec<Vec<u32>>,
    cuts: Vec<Cut>,
    /// Faces that one sees through, and how far they are.
    blended: Vec<(f32, u32)>,
}

/// Everything on the screen.
pub(crate) struct Screen<'a> {
    pub(crate) projection: Projection,
    pub(crate) width: usize,
    pub(crate) height: usize,
    pub(crate) placed: Vec<Placed<'a>>,
    kinds: Kinds,
    pieces: Vec<Piece>,
    /// Of each band, the faces that one sees through, from the nearest on.
    blended: Vec<Vec<u32>>,
}

impl<'a> Screen<'a> {
    pub(crate) fn new(
        subject: &'a Subject,
        projection: Projection,
        width: usize,
        height: usize,
        kinds: Kinds,
    ) -> Self {
        let placed: Vec<Placed<'_>> =
            subject.parts.par_iter().map(|part| Placed::new(subject, part, &projection)).collect();
        let mut screen =
            Self { projection, width, height, placed, kinds, pieces: Vec::new(), blended: Vec::new() };
        let jobs: Vec<(usize, usize)> = (0..screen.placed.len())
            .flat_map(|part| {
                let faces = screen.placed[part].drawn.mesh.face_count();
                (0..faces).step_by(PIECE).map(move |first| (part, first))
            })
            .collect();
        screen.pieces = jobs.into_par_iter().map(|(part, first)| screen.piece(part, first)).collect();
        screen.sort_blended();
        screen
    }

    fn band_count(&self) -> usize {
        self.height.div_ceil(BAND)
    }

    /// What kind of face this is.
    #[inline(always)]
    fn kind(&self, placed: &Placed<'_>, kinds: &[Kind], face: usize) -> Kind {
        match kinds {
            [one] => *one,
            all => {
                let region = placed.drawn.mesh.regions().map_or(0, |r| r[face].index());
                all.get(region).copied().unwrap_or(Kind::Solid)
            }
        }
    }

    fn piece(&self, part: usize, first: usize) -> Piece {
        let placed = &self.placed[part];
        let end = (first + PIECE).min(placed.drawn.mesh.face_count());
        let kinds = &self.kinds[part];
        let is_mirrored = placed.to_view.is_mirrored();
        let mut piece =
            Piece { part, bands: vec![Vec::new(); self.band_count()], cuts: Vec::new(), blended: Vec::new() };
        let list = |face: usize, corners: &[[f32; 3]; 3], is_cut: bool, piece: &mut Piece| {
            let Some(rows) = self.rows(corners) else { return };
            let kind = self.kind(placed, kinds, face);
            if kind.hides_back() && (doubled_area(corners) > 0.0) != is_mirrored {
                return;
            }
            let mut entry = face as u32;
            if kind.is_blended() {
                let far = corners.iter().map(|c| self.projection.distance(c[2])).sum();
                // Its pieces come together: one entry is enough.
                if piece.blended.last().is_none_or(|b| b.1 != entry) {
                    piece.blended.push((far, entry));
                }
                return;
            }
            if is_cut {
                entry = CLIPPED | piece.cuts.len() as u32;
                piece.cuts.push(Cut { face: face as u32, corners: *corners });
            }
            for band in rows {
                piece.bands[band].push(entry);
            }
        };
        for face in first..end {
            let corners = placed.on_screen(face);
            if Placed::is_cut(&corners) {
                for corners in self.cut(placed, face) {
                    list(face, &corners, true, &mut piece);
                }
            } else {
                list(face, &corners, false, &mut piece);
            }
        }
        piece
    }

    /// The bands that a triangle may be seen in; `None` if it hits no sample for sure.
    #[inline(always)]
    fn rows(&self, corners: &[[f32; 3]; 3]) -> Option<std::ops::RangeInclusive<usize>> {
        let [a, b, c] = *corners;
        let low = [0, 1].map(|k| a[k].min(b[k]).min(c[k]));
        let high = [0, 1].map(|k| a[k].max(b[k]).max(c[k]));
        // Samples stand in columns and rows of a quarter of a pixel.
        let hits = |k: usize| least_above(low[k] * 4.0 + 0.5) <= (high[k] * 4.0 + 0.5) as i32;
        let is_off =
            high[0] < 0.0 || high[1] < 0.0 || low[0] > self.width as f32 || low[1] > self.height as f32;
        if is_off || !hits(0) || !hits(1) {
            return None;
        }
        let last = self.band_count() - 1;
        let band = |y: f32| ((y.max(0.0) as i32) as usize / BAND).min(last);
        Some(band(low[1])..=band(high[1]))
    }

    /// The pieces of a face that are before the eye.
    fn cut(&self, placed: &Placed<'_>, face: usize) -> Vec<[[f32; 3]; 3]> {
        let polygon = self.projection.clipped(placed.in_view(face));
        let at = |i: usize| polygon[i].map(|x| x as f32);
        (2..polygon.len()).map(|i| [at(0), at(i - 1), at(i)]).collect()
    }

    fn sort_blended(&mut self) {
        let mut all: Vec<(f32, u32, usize, u32)> = Vec::new();
        for piece in &self.pieces {
            let first = self.placed[piece.part].first_face;
            all.extend(piece.blended.iter().map(|&(far, face)| (far, first + face, piece.part, face)));
        }
        all.sort_unstable_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        let mut bands = vec![Vec::new(); self.band_count()];
        for (_, whole, part, face) in all {
            let placed = &self.placed[part];
            let corners = placed.on_screen(face as usize);
            let pieces =
                if Placed::is_cut(&corners) { self.cut(placed, face as usize) } else { vec![corners] };
            let mut rows: Vec<usize> = pieces.iter().filter_map(|c| self.rows(c)).flatten().collect();
            rows.sort_unstable();
            rows.dedup();
            rows.into_iter().for_each(|band| bands[band].push(whole));
        }
        self.blended = bands;
    }

    /// The part that a face of the whole belongs to.
    #[inline(always)]
    pub(crate) fn part_of(&self, face: u32) -> &Placed<'a> {
        let after = self.placed.partition_point(|p| p.first_face <= face);
        &self.placed[after - 1]
    }

    /// Draws all solid faces of a band. `is_there` says of a masked face whether it is there at a place.
    pub(crate) fn draw(&self, index: usize, band: &mut Band, is_there: &dyn Fn(u32, f32, f32) -> bool) {
        band.clear(index * BAND, self.width, (self.height - index * BAND).min(BAND));
        for piece in &self.pieces {
            let placed = &self.placed[piece.part];
            let kinds = &self.kinds[piece.part];
            let has_masks = kinds.iter().any(|k| k.is_masked());
            for &entry in &piece.bands[index] {
                let (face, corners) = if entry & CLIPPED == 0 {
                    (entry, placed.on_screen(entry as usize))
                } else {
                    let cut = &piece.cuts[(entry & !CLIPPED) as usize];
                    (cut.face, cut.corners)
                };
                let whole = placed.first_face + face;
                if has_masks && self.kind(placed, kinds, face as usize).is_masked() {
                    band.draw(&corners, whole, |x, y, mask| {
                        let is_on = |k: usize| {
                            mask >> k & 1 == 1 && is_there(whole, x + SAMPLES[k][0], y + SAMPLES[k][1])
                        };
                        (0..4).fold(0, |m, k| m | u32::from(is_on(k)) << k)
                    });
                } else {
                    band.draw_solid(&corners, whole);
                }
            }
        }
    }

    /// Whether a band has faces that one sees through.
    pub(crate) fn has_blended(&self, index: usize) -> bool {
        !self.blended[index].is_empty()
    }

    /// Walks the faces of a band that one sees through, from the nearest on: the face, the pixel, and which samples see it.
    pub(crate) fn walk_blended(
        &self,
        index: usize,
        band: &Band,
        mut seen: impl FnMut(u32, usize, usize, u32),
    ) {
        for &whole in &self.blended[index] {
            let placed = self.part_of(whole);
            let face = (whole - placed.first_face) as usize;
            let corners = placed.on_screen(face);
            let pieces = if Placed::is_cut(&corners) { self.cut(placed, face) } else { vec![corners] };
            for corners in &pieces {
                band.walk(corners, |cell, x, y, mask, near| {
                    let mask = mask & near.simd_gt(band.cells[cell].near).to_bitmask();
                    if mask != 0 {
                        seen(whole, x, y, mask);
                    }
                });
            }
        }
    }
}

/// Twice the area on the screen, whose rows count downwards: positive if the corners go round clockwise.
#[inline(always)]
pub(crate) fn doubled_area([a, b, c]: &[[f32; 3]; 3]) -> f32 {
    (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])
}

/// The least whole number that is not below, or 0: most processors round so only by a call.
#[inline(always)]
fn least_above(x: f32) -> i32 {
    let below = x.max(0.0) as i32;
    below + i32::from((below as f32) < x)
}

/// The four samples of a pixel.
#[derive(Clone, Copy)]
pub(crate) struct Cell {
    /// How near what each sees is.
    pub(crate) near: f32x4,
    /// The face that each sees.
    pub(crate) face: u32x4,
}

/// Some rows of the picture.
#[derive(Default)]
pub(crate) struct Band {
    pub(crate) first_row: usize,
    pub(crate) width: usize,
    pub(crate) rows: usize,
    pub(crate) cells: Vec<Cell>,
}

/// One side of a triangle: positive inside.
#[derive(Clone, Copy)]
struct Side {
    a: f32,
    b: f32,
    x: f32,
    y: f32,
    /// What counts as inside: one of two neighbours has the samples on the line.
    least: f32,
}

impl Side {
    /// Both neighbours measure from the same end, so that they get the same number but for its sign: no sample is lost
    /// between them, none is taken twice.
    #[inline(always)]
    fn new(p: [f32; 3], q: [f32; 3]) -> Self {
        let (a, b) = (p[1] - q[1], q[0] - p[0]);
        let is_first = (p[1], p[0]) < (q[1], q[0]);
        let (from, least) = if is_first { (p, 0.0) } else { (q, f32::MIN_POSITIVE) };
        Self { a, b, x: from[0], y: from[1], least }
    }
}

impl Band {
    fn clear(&mut self, first_row: usize, width: usize, rows: usize) {
        (self.first_row, self.width, self.rows) = (first_row, width, rows);
        let empty = Cell { near: f32x4::splat(f32::NEG_INFINITY), face: u32x4::splat(NONE) };
        self.cells.clear();
        self.cells.resize(width * rows, empty);
    }

    #[inline(always)]
    fn draw_solid(&mut self, corners: &[[f32; 3]; 3], face: u32) {
        let mut cells = std::mem::take(&mut self.cells);
        self.walk_masks(corners, |at, _, _, mask, near| {
            let cell = &mut cells[at];
            let mask = mask & near.simd_gt(cell.near);
            cell.near = mask.select(near, cell.near);
            let mask: u32x4 = bytemuck::cast(mask);
            cell.face = mask.select(u32x4::splat(face), cell.face);
        });
        self.cells = cells;
    }

    /// Draws a triangle where `keeps` leaves samples of those that it covers.
    fn draw(&mut self, corners: &[[f32; 3]; 3], face: u32, keeps: impl Fn(f32, f32, u32) -> u32) {
        let mut cells = std::mem::take(&mut self.cells);
        self.walk(corners, |at, x, y, mask, near| {
            let cell = &mut cells[at];
            let mask = mask & near.simd_gt(cell.near).to_bitmask();
            let kept = if mask == 0 { 0 } else { keeps(x as f32 + 0.5, y as f32 + 0.5, mask) };
            let lanes: [u32; 4] = std::array::from_fn(|k| 0u32.wrapping_sub(kept >> k & 1));
            let mask = u32x4::from(lanes);
            cell.face = mask.select(u32x4::splat(face), cell.face);
            let mask: f32x4 = bytemuck::cast(mask);
            cell.near = mask.select(near, cell.near);
        });
        self.cells = cells;
    }

    #[inline(always)]
    fn walk(&self, corners: &[[f32; 3]; 3], mut seen: impl FnMut(usize, usize, usize, u32, f32x4)) {
        self.walk_masks(corners, |at, x, y, mask, near| seen(at, x, y, mask.to_bitmask(), near));
    }

    /// Walks the pixels of which a triangle covers samples: the cell, column and row of each, the samples, how near they are.
    #[inline(always)]
    fn walk_masks(&self, corners: &[[f32; 3]; 3], mut seen: impl FnMut(usize, usize, usize, f32x4, f32x4)) {
        let doubled = doubled_area(corners);
        let [a, mut b, mut c] = *corners;
        if doubled < 0.0 {
            std::mem::swap(&mut b, &mut c);
        }
        let doubled = doubled.abs();
        // Also what is no number.
        if !(doubled > 0.0 && doubled < f32::INFINITY) {
            return;
        }
        // The outermost samples stand 3/8 from the middle of a pixel.
        let first = |low: f32| least_above(low - 0.875) as usize;
        let end = |high: f32, most: usize| ((high + 0.875).max(0.0) as i32 as usize).min(most);
        let x0 = first(a[0].min(b[0]).min(c[0]));
        let x1 = end(a[0].max(b[0]).max(c[0]), self.width);
        let y0 = first(a[1].min(b[1]).min(c[1])).max(self.first_row);
        let y1 = end(a[1].max(b[1]).max(c[1]), self.first_row + self.rows);
        if x0 >= x1 || y0 >= y1 {
            return;
        }
        let sides = [Side::new(b, c), Side::new(c, a), Side::new(a, b)];
        let per_area = 1.0 / doubled;
        let (nb, nc) = (b[2] - a[2], c[2] - a[2]);
        let slope_x = (sides[1].a * nb + sides[2].a * nc) * per_area;
        let slope_y = (sides[1].b * nb + sides[2].b * nc) * per_area;
        let (least, most) = (a[2].min(b[2]).min(c[2]), a[2].max(b[2]).max(c[2]));
        let (least, most) = (f32x4::splat(least), f32x4::splat(most));
        let dx = f32x4::from(SAMPLES.map(|s| s[0] + 0.5));
        let dy = f32x4::from(SAMPLES.map(|s| s[1] + 0.5));
        for y in y0..y1 {
            let py = dy + y as f32;
            let row = sides.map(|s| (py - s.y) * s.b);
            let near_row = (py - a[1]) * slope_y + a[2];
            let start = (y - self.first_row) * self.width;
            for x in x0..x1 {
                let px = dx + x as f32;
                let inside = |k: usize| {
                    ((px - sides[k].x) * sides[k].a + row[k]).simd_ge(f32x4::splat(sides[k].least))
                };
                let mask = inside(0) & inside(1) & inside(2);
                if mask.to_bitmask() == 0 {
                    continue;
                }
                let near = ((px - a[0]) * slope_x + near_row).fast_max(least).fast_min(most);
                seen(start + x, x, y, mask, near);
            }
        }
    }
}
