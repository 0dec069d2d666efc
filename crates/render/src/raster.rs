//! Rasterizer: the face that each sample of the picture sees.
//!
//! Vertices are projected, faces are binned into bands of rows, and each band keeps the nearest face of every
//! sample. Bands and work pieces have fixed sizes and faces keep their order, so the result is the same with
//! any number of threads.

mod band;

use std::collections::HashSet;

use glam::DVec3;
use lodsmith_core::{Positions, VertexId};
use rayon::prelude::*;
use wide::{f32x4, i32x4};

use crate::projection::{Projection, ToView};
use crate::subject::{PlacedMesh, PreparedMesh, Subject};

pub(crate) use band::{Band, Corner, NO_FACE, SAMPLES, transpose_corners};
use band::{PixelRect, TileDepths, TriangleQuad, doubled_areas, extent, pixels_between, range};

/// Rows per band: its samples fit into the L2 cache at usual widths. Even, for fine pictures.
pub(crate) const BAND_ROWS: usize = 16;
/// Faces, or vertices, per work piece.
const PIECE_LENGTH: usize = 1 << 15;
/// Maximum distance in pixels between two computations of the same corner.
const SNAP_DISTANCE_PX: f32 = 0.01;
/// Number of times that faces may cover the pixels of a band before they are sorted, so that the hidden ones are left out.
/// (Guessed: far more than a scan does, far less than a file that is made to take long.)
const BUSY_LAYERS: usize = 64;
/// Number of faces that are looked at to estimate how often all of them cover the pixels.
const LOOKS: usize = 16;
/// Number of sorted faces that are drawn before the next ones are tested.
const SORTED_LENGTH: usize = 256;
/// Marks indices into the list of clipped faces.
const CLIPPED_BIT: u32 = 1 << 31;

/// A mesh projected to the screen.
pub(crate) struct ProjectedMesh<'a> {
    pub(crate) drawn: &'a PreparedMesh,
    pub(crate) to_view: ToView,
    pub(crate) is_mirrored: bool,
    pub(crate) first_face: u32,
    /// Position in pixels and nearness of each vertex; the first component is NaN if its faces must be
    /// clipped.
    pub(crate) corners: Vec<Corner>,
}

impl<'a> ProjectedMesh<'a> {
    fn new(subject: &'a Subject, part: &PlacedMesh, projection: &Projection) -> Self {
        let drawn = &subject.meshes[part.mesh];
        let to_view = projection.to_view(&part.world_from_mesh);
        let mut corners = vec![[0f32; 4]; drawn.mesh.vertex_count()];
        let exact = |p: DVec3| {
            let [x, y, near] = projection.on_screen(to_view.of(p)).map(|x| x as f32);
            [x, y, near, 0.0]
        };
        let pieces = corners.par_chunks_mut(PIECE_LENGTH);
        match drawn.mesh.positions() {
            Positions::F32(all) => match projection.to_screen(&to_view) {
                Some(to_screen) => pieces.zip(all.par_chunks(PIECE_LENGTH)).for_each(|(to, from)| {
                    to.chunks_mut(4).zip(from.chunks(4)).for_each(|(to, from)| {
                        let four = std::array::from_fn(|i| from[i.min(from.len() - 1)]);
                        to.copy_from_slice(&to_screen.of_four(four)[..to.len()]);
                    });
                }),
                None => pieces.zip(all.par_chunks(PIECE_LENGTH)).for_each(|(to, from)| {
                    to.iter_mut().zip(from).for_each(|(c, p)| *c = exact(DVec3::from(p.map(f64::from))));
                }),
            },
            Positions::F64(all) => pieces.zip(all.par_chunks(PIECE_LENGTH)).for_each(|(to, from)| {
                to.iter_mut().zip(from).for_each(|(c, p)| *c = exact(DVec3::from(*p)));
            }),
        }
        Self { drawn, is_mirrored: to_view.is_mirrored(), to_view, first_face: part.first_face, corners }
    }

    /// The vertices of a face of the mesh.
    #[inline(always)]
    pub(crate) fn vertices(&self, face: usize) -> [VertexId; 3] {
        self.drawn.mesh.triangles()[face].map(|w| self.drawn.mesh.vertex_of(w))
    }
    /// The corners of a face on the screen.
    #[inline(always)]
    pub(crate) fn on_screen(&self, face: usize) -> [Corner; 3] {
        self.vertices(face).map(|v| self.corners[v.index()])
    }
    /// The corners of a face in view coordinates, in double precision.
    pub(crate) fn in_view(&self, face: usize) -> [DVec3; 3] {
        let positions = self.drawn.mesh.positions().view();
        self.vertices(face).map(|v| self.to_view.of(DVec3::from(positions.get(v))))
    }
    /// True if a face needs clipping.
    #[inline(always)]
    pub(crate) fn is_cut(corners: &[Corner; 3]) -> bool {
        (corners[0][0] + corners[1][0] + corners[2][0]).is_nan()
    }
}

/// Visibility class of a face.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum FaceKind {
    /// Opaque.
    Solid,
    /// Opaque, back face culled.
    Front,
    /// Alpha-tested by its texture.
    Masked,
    /// Alpha-tested, back face culled.
    MaskedFront,
    /// Blended.
    Blended,
    /// Blended, back face culled.
    BlendedFront,
}

impl FaceKind {
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

/// Kinds of the faces of each mesh; by the region of a face if they differ.
pub(crate) type FaceKinds = Vec<Vec<FaceKind>>;

/// A piece of a clipped face.
struct ClippedTriangle {
    face: u32,
    corners: [Corner; 3],
}

/// A back face, with the data needed for the occlusion test.
struct BackFace {
    face: u32,
    near: f32,
    pixels: PixelRect,
}

/// Some faces of one part, binned by the bands that they touch.
struct BinnedFaces {
    part: usize,
    bands: Vec<Vec<u32>>,
    /// Back faces, drawn after the front faces, which hide most of them.
    backs: Vec<Vec<BackFace>>,
    cuts: Vec<ClippedTriangle>,
    /// Blended faces with their distance.
    blended: Vec<(f32, u32)>,
}

/// Bounds of four triangles before they are drawn; the first three are bit masks.
struct TriangleBounds {
    /// May cover samples.
    seen: u32,
    /// Must be clipped first.
    cut: u32,
    clockwise: u32,
    /// The nearest corners.
    near: [f32; 4],
    /// First column, end of columns, first row, end of rows.
    pixels: [[i32; 4]; 4],
}

impl TriangleBounds {
    #[inline(always)]
    fn pixels(&self, which: usize) -> PixelRect {
        let [x0, x1, y0, y1] = self.pixels.each_ref().map(|all| all[which] as u16);
        PixelRect { x: [x0, x1], y: [y0, y1] }
    }
}

/// All projected meshes with their faces, binned.
pub(crate) struct Screen<'a> {
    pub(crate) projection: Projection,
    pub(crate) width: usize,
    pub(crate) height: usize,
    pub(crate) placed: Vec<ProjectedMesh<'a>>,
    kinds: FaceKinds,
    pieces: Vec<BinnedFaces>,
    /// Blended faces of each band, nearest first.
    blended: Vec<Vec<u32>>,
}

impl<'a> Screen<'a> {
    pub(crate) fn new(
        subject: &'a Subject,
        projection: Projection,
        width: usize,
        height: usize,
        kinds: FaceKinds,
    ) -> Self {
        let placed: Vec<ProjectedMesh<'_>> =
            subject.parts.par_iter().map(|part| ProjectedMesh::new(subject, part, &projection)).collect();
        let mut screen =
            Self { projection, width, height, placed, kinds, pieces: Vec::new(), blended: Vec::new() };
        let jobs: Vec<(usize, usize)> = (0..screen.placed.len())
            .flat_map(|part| {
                let faces = screen.placed[part].drawn.mesh.face_count();
                (0..faces).step_by(PIECE_LENGTH).map(move |first| (part, first))
            })
            .collect();
        screen.pieces = jobs.into_par_iter().map(|(part, first)| screen.piece(part, first)).collect();
        screen.sort_blended();
        screen
    }

    fn band_count(&self) -> usize {
        self.height.div_ceil(BAND_ROWS)
    }

    /// Returns the kind of a face.
    #[inline(always)]
    fn kind(&self, placed: &ProjectedMesh<'_>, kinds: &[FaceKind], face: usize) -> FaceKind {
        match kinds {
            [one] => *one,
            all => {
                let region = placed.drawn.mesh.regions().map_or(0, |r| r[face].index());
                all.get(region).copied().unwrap_or(FaceKind::Solid)
            }
        }
    }

    fn piece(&self, part: usize, first: usize) -> BinnedFaces {
        let placed = &self.placed[part];
        let end = (first + PIECE_LENGTH).min(placed.drawn.mesh.face_count());
        let lists = self.band_count();
        let mut piece = BinnedFaces {
            part,
            bands: vec![Vec::new(); lists],
            backs: (0..lists).map(|_| Vec::new()).collect(),
            cuts: Vec::new(),
            blended: Vec::new(),
        };
        for face in (first..end).step_by(4) {
            let count = (end - face).min(4);
            let vertex = |i: usize| placed.vertices(face + i.min(count - 1));
            let four = [vertex(0), vertex(1), vertex(2), vertex(3)];
            let outline = self.outline(|i, k| placed.corners[four[i][k].index()]);
            let mut open = (outline.seen | outline.cut) & ((1 << count) - 1);
            while open != 0 {
                let which = open.trailing_zeros() as usize;
                open &= open - 1;
                if outline.cut >> which & 1 == 0 {
                    self.bin_triangle(&mut piece, face + which, None, &outline, which);
                    continue;
                }
                for corners in self.clip_face(placed, face + which) {
                    let outline = self.outline(|_, k| corners[k]);
                    if outline.seen != 0 {
                        self.bin_triangle(&mut piece, face + which, Some(corners), &outline, 0);
                    }
                }
            }
        }
        piece
    }

    /// Adds a triangle of a face to the bands that it touches.
    #[inline(always)]
    fn bin_triangle(
        &self,
        piece: &mut BinnedFaces,
        face: usize,
        cut: Option<[Corner; 3]>,
        outline: &TriangleBounds,
        which: usize,
    ) {
        let placed = &self.placed[piece.part];
        let kind = self.kind(placed, &self.kinds[piece.part], face);
        let is_back = (outline.clockwise >> which & 1 == 1) != placed.is_mirrored;
        if kind.hides_back() && is_back {
            return;
        }
        let mut entry = face as u32;
        if kind.is_blended() {
            let corners = cut.unwrap_or_else(|| placed.on_screen(face));
            let far = corners.iter().map(|c| self.projection.distance(c[2])).sum();
            // Its pieces are consecutive: one entry is enough.
            if piece.blended.last().is_none_or(|b| b.1 != entry) {
                piece.blended.push((far, entry));
            }
            return;
        }
        let pixels = outline.pixels(which);
        let last = self.band_count() - 1;
        let rows =
            usize::from(pixels.y[0]) / BAND_ROWS..=((usize::from(pixels.y[1]) - 1) / BAND_ROWS).min(last);
        if is_back && cut.is_none() {
            for band in rows {
                piece.backs[band].push(BackFace { face: entry, near: outline.near[which], pixels });
            }
            return;
        }
        if let Some(corners) = cut {
            entry = CLIPPED_BIT | piece.cuts.len() as u32;
            piece.cuts.push(ClippedTriangle { face: face as u32, corners });
        }
        for band in rows {
            piece.bands[band].push(entry);
        }
    }

    /// Computes the bounds of four triangles.
    #[inline(always)]
    fn outline(&self, of: impl Fn(usize, usize) -> Corner) -> TriangleBounds {
        let corners = transpose_corners(of);
        let [a, b, c] = corners;
        let doubled = doubled_areas(&corners);
        let zero = f32x4::splat(0.0);
        let size = [self.width as f32, self.height as f32];
        let mut seen = doubled.simd_ne(zero);
        let [[x0, x1], [y0, y1]] = [0, 1].map(|k| {
            let [low, high] = range([a[k], b[k], c[k]]);
            // Samples lie in columns and rows of a quarter pixel: the triangle must span one.
            let last = (high * 4.0 + 0.5).fast_trunc_int().round_float();
            seen &= high.simd_ge(zero) & low.simd_le(f32x4::splat(size[k])) & last.simd_ge(low * 4.0 + 0.5);
            let [first, end] = pixels_between(low, high);
            let most = i32x4::splat(size[k] as i32);
            [first, end.min(most)]
        });
        // Checked again, as rounding may leave no pixel.
        let seen = bytemuck::cast::<_, i32x4>(seen) & x0.simd_lt(x1) & y0.simd_lt(y1);
        let [_, near] = range([a[2], b[2], c[2]]);
        TriangleBounds {
            seen: seen.to_bitmask(),
            cut: (a[0] + b[0] + c[0]).is_nan().to_bitmask(),
            clockwise: doubled.simd_gt(zero).to_bitmask(),
            near: near.to_array(),
            pixels: [x0, x1, y0, y1].map(i32x4::to_array),
        }
    }

    /// Returns the clipped pieces of a face.
    fn clip_face(&self, placed: &ProjectedMesh<'_>, face: usize) -> Vec<[Corner; 3]> {
        let polygon = self.projection.clipped(placed.in_view(face));
        let own = placed.on_screen(face);
        let at = |i: usize| {
            let [x, y, near] = polygon[i].map(|x| x as f32);
            // Snaps to the unclipped corners that its neighbours use, so that edges match to the last bit.
            let is_same =
                |c: &&Corner| (c[0] - x).abs() < SNAP_DISTANCE_PX && (c[1] - y).abs() < SNAP_DISTANCE_PX;
            own.iter().find(is_same).copied().unwrap_or([x, y, near, 0.0])
        };
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
            let pieces = if ProjectedMesh::is_cut(&corners) {
                self.clip_face(placed, face as usize)
            } else {
                vec![corners]
            };
            let rows = |corners: &[Corner; 3]| {
                let outline = self.outline(|_, k| corners[k]);
                let [first, end] = outline.pixels(0).y.map(usize::from);
                if outline.seen == 0 { 0..0 } else { first / BAND_ROWS..end.div_ceil(BAND_ROWS) }
            };
            let mut rows: Vec<usize> = pieces.iter().flat_map(rows).collect();
            rows.sort_unstable();
            rows.dedup();
            rows.into_iter().for_each(|band| bands[band].push(whole));
        }
        self.blended = bands;
    }

    /// Returns the part that contains a face of the whole picture.
    #[inline(always)]
    pub(crate) fn part_of(&self, face: u32) -> &ProjectedMesh<'a> {
        let after = self.placed.partition_point(|p| p.first_face <= face);
        &self.placed[after - 1]
    }

    /// Draws all solid faces of a band. `is_there` returns true if a masked face is opaque at a point.
    pub(crate) fn draw(&self, index: usize, band: &mut Band, is_there: &dyn Fn(u32, f32, f32) -> bool) {
        band.clear(index * BAND_ROWS, self.width, (self.height - index * BAND_ROWS).min(BAND_ROWS));
        if self.is_busy(index, band) {
            self.draw_nearest_first(index, band, is_there);
        } else {
            self.draw_in_order(index, band, is_there);
        }
    }

    fn draw_in_order(&self, index: usize, band: &mut Band, is_there: &dyn Fn(u32, f32, f32) -> bool) {
        for piece in &self.pieces {
            self.draw_some(piece, &piece.bands[index], band, is_there);
        }
        if self.pieces.iter().all(|piece| piece.backs[index].is_empty()) {
            return;
        }
        let depths = TileDepths::of(band);
        let mut left = Vec::new();
        for piece in &self.pieces {
            let is_seen = |back: &&BackFace| !depths.hide(back.near, &back.pixels);
            left.clear();
            left.extend(piece.backs[index].iter().filter(is_seen).map(|back| back.face));
            self.draw_some(piece, &left, band, is_there);
        }
    }

    /// True if the faces of a band cover its pixels very many times, by an estimate from a few of them.
    fn is_busy(&self, index: usize, band: &Band) -> bool {
        let columns = |[x0, x1]: [f32; 2]| (x1.min(self.width as f32) - x0.max(0.0)).max(1.0);
        let covered = |piece: &BinnedFaces| {
            let (fronts, backs) = (&piece.bands[index], &piece.backs[index]);
            let all = fronts.len() + backs.len();
            let looks = (0..all).step_by(all.div_ceil(LOOKS).max(1));
            let count = looks.len().max(1);
            let widths = looks.map(|i| match fronts.get(i) {
                Some(&entry) => columns(extent(&self.corners_of(piece, entry), 0)),
                None => columns(backs[i - fronts.len()].pixels.x.map(f32::from)),
            });
            widths.sum::<f32>() / count as f32 * (all * band.rows) as f32
        };
        let all: f32 = self.pieces.iter().map(covered).sum();
        all > (BUSY_LAYERS * band.width * band.rows) as f32
    }

    /// Draws all solid faces of a band, the nearest first, without those that are hidden by then. Returns how many it
    /// draws.
    fn draw_nearest_first(
        &self,
        index: usize,
        band: &mut Band,
        is_there: &dyn Fn(u32, f32, f32) -> bool,
    ) -> usize {
        let mut entries: Vec<(f32, usize, u32)> = Vec::new();
        for (at, piece) in self.pieces.iter().enumerate() {
            let near = |entry: u32| extent(&self.corners_of(piece, entry), 2)[1];
            entries.extend(piece.bands[index].iter().map(|&entry| (near(entry), at, entry)));
        }
        for (at, piece) in self.pieces.iter().enumerate() {
            entries.extend(piece.backs[index].iter().map(|back| (back.near, at, back.face)));
        }
        // Of faces with the same corners only the first is seen, unless its texture has holes.
        let mut known = HashSet::new();
        let is_masked = self.kinds.iter().flatten().any(|kind| kind.is_masked());
        entries.retain(|&(_, at, entry)| {
            let bits = |c: Corner| [c[0], c[1], c[2]].map(f32::to_bits);
            is_masked || known.insert(self.corners_of(&self.pieces[at], entry).map(bits))
        });
        // Stable: of faces that are equally near the first is seen, as without sorting.
        entries.sort_by(|a, b| b.0.total_cmp(&a.0));
        let mut count = 0;
        for entries in entries.chunks(SORTED_LENGTH) {
            let depths = TileDepths::of(band);
            let is_seen = |&&(near, at, entry): &&(f32, usize, u32)| {
                !depths.hide_triangle(near, &self.corners_of(&self.pieces[at], entry))
            };
            let seen: Vec<_> = entries.iter().filter(is_seen).collect();
            for run in seen.chunk_by(|a, b| a.1 == b.1) {
                let entries: Vec<u32> = run.iter().map(|seen| seen.2).collect();
                self.draw_some(&self.pieces[run[0].1], &entries, band, is_there);
            }
            count += seen.len();
        }
        count
    }

    /// The corners of an entry of a band on the screen.
    fn corners_of(&self, piece: &BinnedFaces, entry: u32) -> [Corner; 3] {
        match entry & CLIPPED_BIT {
            0 => self.placed[piece.part].on_screen(entry as usize),
            _ => piece.cuts[(entry & !CLIPPED_BIT) as usize].corners,
        }
    }

    fn draw_some(
        &self,
        piece: &BinnedFaces,
        entries: &[u32],
        band: &mut Band,
        is_there: &dyn Fn(u32, f32, f32) -> bool,
    ) {
        let placed = &self.placed[piece.part];
        let kinds = &self.kinds[piece.part];
        let has_masks = kinds.iter().any(|k| k.is_masked());
        for entries in entries.chunks(4) {
            let vertex = |i: usize| match entries[i.min(entries.len() - 1)] {
                cut if cut & CLIPPED_BIT != 0 => [VertexId(0); 3],
                face => placed.vertices(face as usize),
            };
            let vertices = [vertex(0), vertex(1), vertex(2), vertex(3)];
            let is_cut = entries.iter().any(|e| e & CLIPPED_BIT != 0);
            let four = if is_cut {
                TriangleQuad::new(|i, k| match entries[i.min(entries.len() - 1)] {
                    cut if cut & CLIPPED_BIT != 0 => piece.cuts[(cut & !CLIPPED_BIT) as usize].corners[k],
                    _ => placed.corners[vertices[i][k].index()],
                })
            } else {
                TriangleQuad::new(|i, k| placed.corners[vertices[i][k].index()])
            };
            for (which, &entry) in entries.iter().enumerate() {
                let is_cut = entry & CLIPPED_BIT != 0;
                let face = if is_cut { piece.cuts[(entry & !CLIPPED_BIT) as usize].face } else { entry };
                let whole = placed.first_face + face;
                if has_masks && self.kind(placed, kinds, face as usize).is_masked() {
                    band.draw(&four, which, whole, |x, y, mask| {
                        let is_on = |k: usize| {
                            mask >> k & 1 == 1 && is_there(whole, x + SAMPLES[k][0], y + SAMPLES[k][1])
                        };
                        (0..4).fold(0, |m, k| m | u32::from(is_on(k)) << k)
                    });
                } else {
                    band.draw_solid(&four, which, whole);
                }
            }
        }
    }

    /// True if a band has blended faces.
    pub(crate) fn has_blended(&self, index: usize) -> bool {
        !self.blended[index].is_empty()
    }

    /// Visits the blended faces of a band, nearest first, with the face, the pixel, and a mask of the samples
    /// that see it.
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
            let pieces =
                if ProjectedMesh::is_cut(&corners) { self.clip_face(placed, face) } else { vec![corners] };
            for corners in &pieces {
                band.walk(&TriangleQuad::new(|_, k| corners[k]), 0, |cell, x, y, mask, near| {
                    let mask = (mask & near.simd_gt(band.cells[cell].near)).to_bitmask();
                    if mask != 0 {
                        seen(whole, x, y, mask);
                    }
                });
            }
        }
    }
}

/// Computes the largest nearness of each pixel of a small picture; nothing is shaded.
pub(crate) fn nearness(subject: &Subject, projection: Projection, width: usize, height: usize) -> Vec<f32> {
    let kinds = subject.parts.iter().map(|_| vec![FaceKind::Solid]).collect();
    let screen = Screen::new(subject, projection, width, height, kinds);
    let mut near = vec![f32::NEG_INFINITY; width * height];
    near.par_chunks_mut(width * BAND_ROWS).enumerate().for_each_init(Band::default, |band, (index, near)| {
        screen.draw(index, band, &|_, _, _| true);
        for (near, cell) in near.iter_mut().zip(&band.cells) {
            *near = cell.near.to_array().into_iter().fold(f32::NEG_INFINITY, f32::max);
        }
    });
    near
}

#[cfg(test)]
mod tests {
    use lodsmith_core::TriMesh;

    use super::*;
    use crate::camera::{Camera, Lens};

    /// Calls `with` for the bands of a picture of 40 × 40 pixels, from above.
    fn each_band(mesh: TriMesh, mut with: impl FnMut(&Screen<'_>, usize, [Band; 2])) {
        let subject = Subject::of_mesh(mesh).expect("a model");
        let camera = Camera {
            eye: DVec3::new(0.0, 0.0, 5.0),
            target: DVec3::ZERO,
            up: DVec3::Y,
            lens: Lens::Parallel { height: 2.0 },
        };
        let projection = Projection::new(&camera, 40, 40).expect("a camera");
        let kinds = subject.parts.iter().map(|_| vec![FaceKind::Solid]).collect();
        let screen = Screen::new(&subject, projection, 40, 40, kinds);
        for index in 0..screen.band_count() {
            let bands = [(); 2].map(|()| {
                let mut band = Band::default();
                band.clear(index * BAND_ROWS, 40, (40 - index * BAND_ROWS).min(BAND_ROWS));
                band
            });
            with(&screen, index, bands);
        }
    }

    #[test]
    fn sorted_faces_give_the_same_picture() {
        let mixed = |i: u32| (i ^ i >> 15).wrapping_mul(2_246_822_519);
        let random = |i: u32| f64::from(mixed(mixed(i + 1)) >> 8) / f64::from(1u32 << 23) - 1.0;
        let points: Vec<[f32; 3]> = (0..900)
            .map(|i| [0, 1, 2].map(|k| random(3 * i + k) as f32 * [1.2, 1.2, 0.5][k as usize]))
            .collect();
        let indices: Vec<u32> = (0..900).collect();
        let mesh = TriMesh::from_indexed(&points, &indices).expect("triangles");
        each_band(mesh, |screen, index, [mut plain, mut sorted]| {
            screen.draw_in_order(index, &mut plain, &|_, _, _| true);
            let drawn = screen.draw_nearest_first(index, &mut sorted, &|_, _, _| true);
            assert!(screen.is_busy(index, &plain) && drawn < 300);
            for (a, b) in plain.cells.iter().zip(&sorted.cells) {
                assert_eq!((a.near.to_array(), a.face.to_array()), (b.near.to_array(), b.face.to_array()));
            }
        });
    }

    /// Each face was drawn over all pixels: a million at the same place took 19 seconds at 64 × 64 pixels.
    #[test]
    fn few_of_many_faces_at_the_same_place_are_drawn() {
        let points = [[-1.0, -1.0, 0.0], [1.0, -1.0, 0.0], [0.0, 1.0, 0.0f32]];
        let mesh = TriMesh::from_indexed(&points, &[0, 1, 2].repeat(20_000)).expect("triangles");
        each_band(mesh, |screen, index, [mut band, _]| {
            assert!(screen.is_busy(index, &band));
            assert!(screen.draw_nearest_first(index, &mut band, &|_, _, _| true) == 1);
        });
    }
}
