//! Coplanar regions, grown over manifold edges from the largest faces on.

use glam::{DMat2, DVec2, DVec3};
use lodsmith_core::topology::EdgeKind;
use lodsmith_core::{HalfEdgeId, RegionId, Topology, VertexId};

use super::channels::Channels;
use crate::SimplifyError;
use crate::control::{Control, Verdict};

/// No region.
pub(super) const NONE: u32 = u32::MAX;
/// Faces between two progress calls.
const ASK_EVERY: usize = 4096;

/// Tolerances within a region, in the unit frame.
#[derive(Clone, Copy, Debug)]
pub(super) struct Tolerance {
    /// Distance from the plane.
    pub(super) flat: f64,
    /// Angle between a face and the plane.
    pub(super) angle_rad: f64,
    /// Largest displacement of a vertex by rounding: faces no higher than this have no reliable normal.
    pub(super) noise: f64,
}

/// Input of the region growing.
pub(super) struct RegionInput<'a> {
    pub(super) points: &'a [DVec3],
    pub(super) faces: &'a [[VertexId; 3]],
    pub(super) topology: &'a Topology,
    pub(super) channels: &'a Channels<'a>,
    /// The region of the mesh that each face belongs to, if there are several.
    pub(super) given: Option<&'a [RegionId]>,
    /// Predicate for faces that stay unchanged.
    pub(super) is_fixed: &'a dyn Fn(usize) -> bool,
    pub(super) tolerance: Tolerance,
}

/// Faces grouped by region.
#[derive(Default)]
pub(super) struct Regions {
    pub(super) of_face: Vec<u32>,
    /// Unit normal of each region's plane; zero for a face without area.
    pub(super) normals: Vec<DVec3>,
    start: Vec<usize>,
    faces: Vec<u32>,
    /// True if the caller ended the growing early, so that the last faces are regions of their own.
    pub(super) is_over: bool,
}

impl Regions {
    pub(super) fn count(&self) -> usize {
        self.normals.len()
    }
    pub(super) fn faces(&self, region: usize) -> &[u32] {
        &self.faces[self.start[region]..self.start[region + 1]]
    }
}

/// Grows regions until each face has one. If the caller finishes early, the remaining faces become regions of
/// their own.
///
/// At any time all faces of a region lie within the tolerance of its plane, and their attributes within their
/// tolerance of linear functions on it. Plane and functions are refitted whenever the region has doubled; the
/// new ones are used only if they fit all of it. Cost: O(n log n) to sort the seeds, O(n) for the rest.
pub(super) fn grow(field: &RegionInput<'_>, control: &mut dyn Control) -> Result<Regions, SimplifyError> {
    let count = field.faces.len();
    let mut seeds: Vec<(u32, u32)> = (0..count)
        .map(|f| {
            let area = field.double_area(f).length() as f32;
            // Larger faces first; the bits of positive floats sort like the numbers.
            (!area.to_bits(), f as u32)
        })
        .collect();
    seeds.sort_unstable();
    let mut regions = Regions { of_face: vec![NONE; count], start: vec![0], ..Regions::default() };
    let mut plane = Plane::new(field.channels.count());
    let mut rejected = Vec::new();
    let mut is_over = false;
    let mut asked = 0;
    for (_, seed) in seeds {
        if regions.of_face[seed as usize] != NONE {
            continue;
        }
        regions.of_face[seed as usize] = regions.count() as u32;
        regions.faces.push(seed);
        let has_plane = plane.begin(field, seed as usize);
        if has_plane && !is_over && !(field.is_fixed)(seed as usize) {
            regions.grow_last(field, &mut plane, &mut rejected);
        }
        regions.start.push(regions.faces.len());
        regions.normals.push(plane.normal);
        if !is_over && regions.faces.len() >= asked + ASK_EVERY {
            asked = regions.faces.len();
            // Region growing is about half of the run.
            match control.progress(0.5 * asked as f64 / count as f64) {
                Verdict::Continue => {}
                Verdict::Finish => is_over = true,
                Verdict::Cancel => return Err(SimplifyError::Cancelled),
            }
        }
    }
    regions.is_over = is_over;
    Ok(regions)
}

impl Regions {
    /// Grows the last region, which consists of one face, as far as its plane fits. `rejected` is scratch.
    fn grow_last(&mut self, field: &RegionInput<'_>, plane: &mut Plane, rejected: &mut Vec<u32>) {
        let (id, first) = (self.count() as u32, self.faces.len() - 1);
        rejected.clear();
        let mut next = first;
        let mut taken_anew = 1;
        loop {
            while next < self.faces.len() {
                let face = self.faces[next] as usize;
                next += 1;
                self.add_neighbours(face, id, field, plane, rejected);
                if self.faces.len() - first >= 2 * taken_anew {
                    break;
                }
            }
            let size = self.faces.len() - first;
            let is_done = next == self.faces.len();
            if is_done && (rejected.is_empty() || 4 * size < 5 * taken_anew) {
                break;
            }
            if size > taken_anew {
                taken_anew = size;
                if plane.refit(field, &self.faces[first..]) {
                    // Faces rejected by the previous plane may fit this one.
                    rejected.retain(|&other| {
                        let f = other as usize;
                        let joins = self.of_face[f] == NONE && plane.try_add(field, f);
                        if joins {
                            self.of_face[f] = id;
                            self.faces.push(other);
                        }
                        !joins && self.of_face[f] == NONE
                    });
                }
            }
            if next == self.faces.len() {
                break;
            }
        }
    }

    /// Adds those neighbours of a face that fit the plane to its region, and the others to `rejected`.
    fn add_neighbours(
        &mut self,
        face: usize,
        id: u32,
        field: &RegionInput<'_>,
        plane: &mut Plane,
        rejected: &mut Vec<u32>,
    ) {
        for k in 0..3 {
            let h = HalfEdgeId((3 * face + k) as u32);
            if field.topology.kind(h) != Some(EdgeKind::Inner) {
                continue;
            }
            let Some(twin) = field.topology.twin(h) else { continue };
            let other = twin.face().index();
            if self.of_face[other] != NONE || !field.may_join(face, other) {
                continue;
            }
            if plane.try_add(field, other) {
                self.of_face[other] = id;
                self.faces.push(other as u32);
            } else {
                rejected.push(other as u32);
            }
        }
    }
}

impl RegionInput<'_> {
    fn corners(&self, face: usize) -> [DVec3; 3] {
        self.faces[face].map(|v| self.points[v.index()])
    }
    fn double_area(&self, face: usize) -> DVec3 {
        let [a, b, c] = self.corners(face);
        (b - a).cross(c - a)
    }
    fn may_join(&self, face: usize, other: usize) -> bool {
        self.given.is_none_or(|of| of[face] == of[other]) && !(self.is_fixed)(other)
    }
}

/// Returns the height of a triangle over its longest edge.
pub(super) fn height([a, b, c]: [DVec3; 3]) -> f64 {
    let longest = (b - a).length_squared().max((c - b).length_squared()).max((a - c).length_squared());
    if longest > 0.0 { (b - a).cross(c - a).length() / longest.sqrt() } else { 0.0 }
}

/// The plane of a growing region, the height range of its vertices, and its attributes as functions of
/// position.
struct Plane {
    /// Origin of heights and positions.
    from: DVec3,
    normal: DVec3,
    low: f64,
    high: f64,
    functions: Vec<Linear>,
}

/// A linear function on a plane: a value and a gradient.
#[derive(Clone, Copy, Default)]
struct Linear {
    value: f64,
    gradient: DVec3,
}

impl Plane {
    fn new(channels: usize) -> Self {
        Self {
            from: DVec3::ZERO,
            normal: DVec3::ZERO,
            low: 0.0,
            high: 0.0,
            functions: vec![Linear::default(); channels],
        }
    }

    /// Initialises with the plane of one face; false if it has none.
    fn begin(&mut self, field: &RegionInput<'_>, seed: usize) -> bool {
        self.from = field.corners(seed)[0];
        self.normal = field.double_area(seed).normalize_or_zero();
        if self.normal == DVec3::ZERO {
            return false;
        }
        let faces = [seed as u32];
        if !self.functions.is_empty() {
            let Some(functions) = self.functions_of(field, self.normal, &faces) else { return false };
            self.functions = functions;
        }
        (self.low, self.high) = self.heights(field, self.normal, &faces);
        true
    }

    /// Refits the plane and the functions to all faces; keeps the old ones and returns false if some face
    /// exceeds the tolerance.
    fn refit(&mut self, field: &RegionInput<'_>, faces: &[u32]) -> bool {
        let sum: DVec3 = faces.iter().map(|&f| field.double_area(f as usize)).sum();
        let normal = snapped(sum.normalize_or_zero());
        if normal == DVec3::ZERO {
            return false;
        }
        let (low, high) = self.heights(field, normal, faces);
        if high - low > 2.0 * field.tolerance.flat
            || !faces.iter().all(|&f| is_along(field, normal, f as usize))
        {
            return false;
        }
        if !self.functions.is_empty() {
            let Some(functions) = self.functions_of(field, normal, faces) else { return false };
            let before = std::mem::replace(&mut self.functions, functions);
            if !faces.iter().all(|&f| self.fits_functions(field, f as usize)) {
                self.functions = before;
                return false;
            }
        }
        (self.normal, self.low, self.high) = (normal, low, high);
        true
    }

    fn heights(&self, field: &RegionInput<'_>, normal: DVec3, faces: &[u32]) -> (f64, f64) {
        let corners = faces.iter().flat_map(|&f| field.corners(f as usize));
        corners.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), p| {
            let h = normal.dot(p - self.from);
            (low.min(h), high.max(h))
        })
    }

    /// Adds a face if it is within the tolerance.
    fn try_add(&mut self, field: &RegionInput<'_>, face: usize) -> bool {
        let heights = field.corners(face).map(|p| self.normal.dot(p - self.from));
        let low = heights.into_iter().fold(self.low, f64::min);
        let high = heights.into_iter().fold(self.high, f64::max);
        let joins = high - low <= 2.0 * field.tolerance.flat
            && is_along(field, self.normal, face)
            && self.fits_functions(field, face);
        if joins {
            (self.low, self.high) = (low, high);
        }
        joins
    }

    /// True if the attributes of a face match the functions.
    fn fits_functions(&self, field: &RegionInput<'_>, face: usize) -> bool {
        let corners = field.corners(face);
        self.functions.iter().enumerate().all(|(i, f)| {
            (0..3).all(|k| {
                let wanted = f.value + f.gradient.dot(corners[k] - self.from);
                (field.channels.value(i, face, k) - wanted).abs() <= field.channels.tolerance(i)
            })
        })
    }

    /// Fits linear functions to the corners of faces, by least squares weighted by area.
    fn functions_of(&self, field: &RegionInput<'_>, normal: DVec3, faces: &[u32]) -> Option<Vec<Linear>> {
        let (u, v) = normal.any_orthonormal_pair();
        let at = |p: DVec3| DVec2::new(u.dot(p - self.from), v.dot(p - self.from));
        let channels = field.channels;
        let mut weight = 0.0;
        let mut centre = DVec2::ZERO;
        let mut means = vec![0.0; channels.count()];
        let weighted = |f: u32| (field.corners(f as usize), field.double_area(f as usize).length());
        for &f in faces {
            let (corners, w) = weighted(f);
            for (k, p) in corners.into_iter().enumerate() {
                weight += w;
                centre += at(p) * w;
                for (i, mean) in means.iter_mut().enumerate() {
                    *mean += channels.value(i, f as usize, k) * w;
                }
            }
        }
        centre /= weight;
        means.iter_mut().for_each(|m| *m /= weight);
        let mut square = DMat2::ZERO;
        let mut slopes = vec![DVec2::ZERO; channels.count()];
        for &f in faces {
            let (corners, w) = weighted(f);
            for (k, p) in corners.into_iter().enumerate() {
                let d = at(p) - centre;
                square += DMat2::from_cols(d * d.x, d * d.y) * w;
                for (i, slope) in slopes.iter_mut().enumerate() {
                    *slope += d * ((channels.value(i, f as usize, k) - means[i]) * w);
                }
            }
        }
        let size = square.col(0).x + square.col(1).y;
        // Collinear faces leave the slope across their line undetermined.
        if square.determinant() <= 1e-20 * size * size {
            return None;
        }
        let inverse = square.inverse();
        let linear = |(mean, slope): (f64, DVec2)| {
            let g = inverse * slope;
            Linear { value: mean - g.dot(centre), gradient: u * g.x + v * g.y }
        };
        Some(means.into_iter().zip(slopes).map(linear).collect())
    }
}

/// True if a face is parallel to a plane, as far as its normal is reliable.
fn is_along(field: &RegionInput<'_>, normal: DVec3, face: usize) -> bool {
    let tolerance = &field.tolerance;
    let area = field.double_area(face);
    let (along, across) = (area.dot(normal), area.cross(normal).length());
    let (sin, cos) = libm::sincos(tolerance.angle_rad);
    if along > 0.0 && across * cos <= along * sin {
        return true;
    }
    let height = height(field.corners(face));
    // Faces as low as this may have any orientation; others may be tilted by as much as rounding explains.
    height <= 2.0 * tolerance.noise
        || along > 0.0 && across <= area.length() * (sin + 2.0 * tolerance.noise / height)
}

/// Removes the rounding of axis-aligned normals, so that coordinates in the plane are exact there.
fn snapped(normal: DVec3) -> DVec3 {
    let snap = |x: f64| if x.abs() < 1e-12 { 0.0 } else { x };
    DVec3::new(snap(normal.x), snap(normal.y), snap(normal.z)).normalize_or_zero()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::NoControl;
    use lodsmith_core::{PositionsView, Surface, TriMesh, shapes};

    fn grown(mesh: &TriMesh, flat: f64, angle_deg: f64) -> Regions {
        let points: Vec<DVec3> = mesh.positions().view().iter().map(DVec3::from).collect();
        let surface = mesh.surface();
        let faces = surface.triangles();
        let places =
            Surface::with_triangles(PositionsView::F64(bytemuck::cast_slice(&points)), faces.to_vec());
        let topology = Topology::unwelded(&places.unwrap());
        let channels = Channels::default();
        let tolerance = Tolerance { flat, angle_rad: angle_deg.to_radians(), noise: 1e-9 };
        let field = RegionInput {
            points: &points,
            faces,
            topology: &topology,
            channels: &channels,
            given: None,
            is_fixed: &|_| false,
            tolerance,
        };
        grow(&field, &mut NoControl).unwrap()
    }

    #[test]
    fn a_cube_has_six_regions() {
        let mesh = shapes::cube(5);
        let regions = grown(&mesh, 1e-9, 1.0);
        assert_eq!(regions.count(), 6);
        for r in 0..6 {
            assert_eq!(regions.faces(r).len(), 50);
            assert!(regions.faces(r).iter().all(|&f| regions.of_face[f as usize] == r as u32));
        }
    }

    #[test]
    fn a_region_does_not_drift_along_a_curve() {
        // Neighbouring faces of a tube of 360 sides are within one degree of each other; the faces of a
        // region are within five degrees of its plane, so each region has about ten degrees of the tube.
        let regions = grown(&shapes::cylinder(360, 3), 1e9, 5.0);
        assert!((36..=45).contains(&regions.count()), "{} regions", regions.count());
        let regions = grown(&shapes::cylinder(360, 3), 1e-9, 5.0);
        assert_eq!(regions.count(), 360);
    }
}
