//! Coverage of texels by faces, in bands of rows.

use glam::DVec2;

/// Samples of a texel in each direction.
pub(crate) const GRID: usize = 2;
/// Samples of a texel.
pub(crate) const SAMPLES: usize = GRID * GRID;
/// Marks a sample or texel without a face.
pub(crate) const NOTHING: u32 = u32::MAX;
/// Width in texels of the ring around a chart that is baked too: filtering reads the next texel, and its neighbour at
/// corners.
const RING: f64 = 1.6;

/// A face in texels: columns to the right, rows downwards from the top of the map.
#[derive(Clone, Copy, Debug)]
pub(crate) struct TexelFace {
    /// Index of the face in the flat surface.
    pub(crate) face: u32,
    pub(crate) corners: [DVec2; 3],
}

impl TexelFace {
    /// Returns a face from its texture coordinates, in a map of this size. A whole number of tiles is subtracted, so
    /// that the face begins in the map.
    pub(crate) fn new(face: u32, uvs: [[f32; 2]; 3], size: usize) -> Self {
        let size = size as f64;
        let least = |k: usize| uvs.iter().map(|uv| f64::from(uv[k])).fold(f64::INFINITY, f64::min).floor();
        // A face that lies on the lower edge exactly belongs to the tile below it.
        let shift = [least(0), least(1)];
        let corners = uvs.map(|[u, v]| {
            let (u, v) = (f64::from(u) - shift[0], f64::from(v) - shift[1]);
            DVec2::new(u * size, (1.0 - v) * size)
        });
        Self { face, corners }
    }

    /// Twice the signed area, in texels.
    pub(crate) fn double_area(&self) -> f64 {
        let [a, b, c] = self.corners;
        (b - a).perp_dot(c - a)
    }

    /// Barycentric weights of a point; negative beyond an edge.
    pub(crate) fn weights(&self, p: DVec2) -> [f64; 3] {
        let [a, b, c] = self.corners;
        let inverse = 1.0 / self.double_area();
        let (v, w) = ((p - a).perp_dot(c - a) * inverse, (b - a).perp_dot(p - a) * inverse);
        [1.0 - v - w, v, w]
    }

    /// Smallest and largest corner, with a margin.
    fn span(&self, margin: f64) -> [DVec2; 2] {
        let [a, b, c] = self.corners;
        [a.min(b).min(c) - margin, a.max(b).max(c) + margin]
    }

    fn distance_sq(&self, p: DVec2) -> f64 {
        let to_edge = |k: usize| {
            let (a, b) = (self.corners[k], self.corners[(k + 1) % 3]);
            let along = b - a;
            let t = ((p - a).dot(along) / along.length_squared().max(f64::MIN_POSITIVE)).clamp(0.0, 1.0);
            (a + along * t).distance_squared(p)
        };
        to_edge(0).min(to_edge(1)).min(to_edge(2))
    }
}

/// A texel that a face covers or comes near to.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Texel {
    /// For each sample an index into the faces, or [`NOTHING`]. Beside a chart all samples have the nearest
    /// face.
    pub(crate) faces: [u32; SAMPLES],
    /// Squared distance of the nearest face; -1 if a sample is covered.
    distance_sq: f32,
}

impl Texel {
    const EMPTY: Self = Self { faces: [NOTHING; SAMPLES], distance_sq: f32::INFINITY };

    /// True if a face covers at least one sample.
    pub(crate) fn is_covered(&self) -> bool {
        self.distance_sq < 0.0
    }
    /// True if there is nothing to bake.
    pub(crate) fn is_empty(&self) -> bool {
        self.distance_sq == f32::INFINITY
    }
}

/// The position of a sample within its texel: a rotated grid.
pub(crate) fn sample_offset(sample: usize) -> DVec2 {
    const OFFSETS: [[f64; 2]; SAMPLES] = [[0.375, 0.125], [0.875, 0.375], [0.125, 0.625], [0.625, 0.875]];
    DVec2::from(OFFSETS[sample])
}

/// Faces of a map, and the rows that they touch.
pub(crate) struct Cover {
    pub(crate) size: usize,
    pub(crate) faces: Vec<TexelFace>,
    /// For each band, the faces that touch it, ascending.
    bands: Vec<Vec<u32>>,
}

/// Rows in a band.
pub(crate) const BAND_ROWS: usize = 8;

impl Cover {
    /// Sorts faces into bands. Faces without area in the map, with non-finite coordinates, or that cover more than a
    /// few tiles are left out.
    pub(crate) fn new(size: usize, faces: impl Iterator<Item = TexelFace>) -> Self {
        let faces: Vec<TexelFace> = faces.filter(|f| is_usable(f, size)).collect();
        let mut bands = vec![Vec::new(); size.div_ceil(BAND_ROWS)];
        for (i, face) in faces.iter().enumerate() {
            let [low, high] = face.span(RING);
            let mut last = usize::MAX;
            for row in low.y.floor() as i64..=high.y.floor() as i64 {
                let band = row.rem_euclid(size as i64) as usize / BAND_ROWS;
                if band != last && bands[band].last() != Some(&(i as u32)) {
                    bands[band].push(i as u32);
                }
                last = band;
            }
        }
        Self { size, faces, bands }
    }

    pub(crate) fn band_count(&self) -> usize {
        self.bands.len()
    }

    /// Returns the texels of a band, row after row. Where faces overlap, the first one counts.
    pub(crate) fn band(&self, band: usize) -> Vec<Texel> {
        let (first, size) = (band * BAND_ROWS, self.size as i64);
        let rows = BAND_ROWS.min(self.size - first);
        let mut texels = vec![Texel::EMPTY; rows * self.size];
        for &i in &self.bands[band] {
            let face = &self.faces[i as usize];
            let [low, high] = face.span(RING);
            for y in low.y.floor() as i64..=high.y.floor() as i64 {
                let row = y.rem_euclid(size) as usize;
                if !(first..first + rows).contains(&row) {
                    continue;
                }
                for x in low.x.floor() as i64..=high.x.floor() as i64 {
                    let at = (row - first) * self.size + x.rem_euclid(size) as usize;
                    mark(&mut texels[at], i, face, DVec2::new(x as f64, y as f64));
                }
            }
        }
        texels
    }

    /// Returns the barycentric weights of a sample on its face, for the copy of the map whose texel is
    /// nearest to the face.
    pub(crate) fn weights(&self, face: &TexelFace, x: usize, y: usize, offset: DVec2) -> [f64; 3] {
        let size = self.size as f64;
        let first = face.weights(DVec2::new(x as f64, y as f64) + offset);
        let outside = |w: &[f64; 3]| w.iter().map(|x| (-x).max(0.0)).sum::<f64>();
        if outside(&first) == 0.0 {
            return first;
        }
        let [low, high] = face.span(0.0);
        let centre = (low + high) * 0.5;
        let p = DVec2::new(x as f64, y as f64) + offset;
        let tile = ((centre - p) / size).round();
        // A face that crosses the edge of the map may be nearer by one tile.
        let candidates = [tile, tile + DVec2::X, tile - DVec2::X, tile + DVec2::Y, tile - DVec2::Y];
        let at = |tile: DVec2| face.weights(p + tile * size);
        let first = at(tile);
        if outside(&first) == 0.0 || (high - low).max_element() < 0.25 * size {
            return first;
        }
        candidates.into_iter().map(at).min_by(|a, b| outside(a).total_cmp(&outside(b))).unwrap_or(first)
    }

    /// Returns the share of the covered texels in which different faces overlap: at the same sample, by more than a
    /// rounding error.
    pub(crate) fn overlap(&self) -> f64 {
        let (mut covered, mut twice) = (0usize, 0usize);
        let mut count = vec![0u8; self.size * self.size];
        for face in &self.faces {
            let [low, high] = face.span(0.0);
            for y in low.y.floor() as i64..=high.y.floor() as i64 {
                for x in low.x.floor() as i64..=high.x.floor() as i64 {
                    let weights = face.weights(DVec2::new(x as f64 + 0.5, y as f64 + 0.5));
                    if weights.iter().all(|&w| w > 1e-6) {
                        let [x, y] = [x, y].map(|i| i.rem_euclid(self.size as i64) as usize);
                        let n = &mut count[y * self.size + x];
                        *n = n.saturating_add(1);
                    }
                }
            }
        }
        for n in count {
            covered += usize::from(n > 0);
            twice += usize::from(n > 1);
        }
        if covered == 0 { 0.0 } else { twice as f64 / covered as f64 }
    }
}

fn is_usable(face: &TexelFace, size: usize) -> bool {
    let [low, high] = face.span(0.0);
    let area = face.double_area();
    low.is_finite()
        && high.is_finite()
        && area != 0.0
        && area.is_finite()
        && (high - low).max_element() <= MAX_TILES * size as f64
}

/// A face that covers more tiles than this repeats its texture, and nothing can be baked for it.
pub(crate) const MAX_TILES: f64 = 2.0;

fn mark(texel: &mut Texel, i: u32, face: &TexelFace, corner: DVec2) {
    let mut is_covered = texel.is_covered();
    let before = if is_covered { texel.faces } else { [NOTHING; SAMPLES] };
    let mut covered = before;
    for (s, owner) in covered.iter_mut().enumerate() {
        if *owner == NOTHING && face.weights(corner + sample_offset(s)).iter().all(|&w| w >= 0.0) {
            *owner = i;
            is_covered = true;
        }
    }
    if is_covered {
        *texel = Texel { faces: covered, distance_sq: -1.0 };
        return;
    }
    let distance_sq = face.distance_sq(corner + 0.5) as f32;
    if f64::from(distance_sq) <= RING * RING && distance_sq < texel.distance_sq {
        *texel = Texel { faces: [i; SAMPLES], distance_sq };
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn square(size: usize, [u, v]: [f32; 2], side: f32) -> Vec<TexelFace> {
        let at = |x: f32, y: f32| [u + side * x, v + side * y];
        let halves = [[at(0.0, 0.0), at(1.0, 0.0), at(1.0, 1.0)], [at(0.0, 0.0), at(1.0, 1.0), at(0.0, 1.0)]];
        halves.into_iter().enumerate().map(|(f, uvs)| TexelFace::new(f as u32, uvs, size)).collect()
    }

    #[test]
    fn a_square_covers_its_texels_and_a_ring() {
        let size = 32;
        let cover = Cover::new(size, square(size, [0.25, 0.25], 0.5).into_iter());
        let (mut covered, mut ring) = (0, 0);
        for band in 0..cover.band_count() {
            for (i, texel) in cover.band(band).iter().enumerate() {
                let (x, y) = (i % size, band * BAND_ROWS + i / size);
                let is_inside = (8..24).contains(&x) && (8..24).contains(&y);
                assert_eq!(texel.is_covered(), is_inside, "{x} {y}");
                covered += usize::from(texel.is_covered());
                ring += usize::from(!texel.is_covered() && !texel.is_empty());
            }
        }
        assert_eq!(covered, 16 * 16);
        assert_eq!(ring, 20 * 20 - 4 - 16 * 16, "two texels wide, without corners");
        assert_eq!(cover.overlap(), 0.0);
    }

    #[test]
    fn coordinates_wrap_around_and_overlaps_are_seen() {
        let size = 32;
        // Across the right edge of the map.
        let cover = Cover::new(size, square(size, [3.75, -2.0], 0.5).into_iter());
        let count = |cover: &Cover| {
            (0..cover.band_count()).flat_map(|b| cover.band(b)).filter(Texel::is_covered).count()
        };
        assert_eq!(count(&cover), 16 * 16);
        let mut two = square(size, [0.0, 0.0], 0.5);
        two.extend(square(size, [7.25, 0.0], 0.5));
        let overlap = Cover::new(size, two.into_iter()).overlap();
        // Texels on the diagonals may go either way.
        assert!((overlap - 1.0 / 3.0).abs() < 0.04, "{overlap}");
    }
}
