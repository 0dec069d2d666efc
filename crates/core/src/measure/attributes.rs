//! Differences of normals, texture coordinates and colours between two meshes.

mod at_wedges;

use glam::DVec3;

use crate::geometry::triangle::{self, double_area_normal, weights_at};
use crate::ids::WedgeId;
use crate::mesh::TriMesh;
use crate::mesh::weld::weld;
use crate::sampling::SurfaceSampler;
use crate::spatial::{Bvh, Hint};

use super::{CompareOptions, MeasureError, TwoWay, chunks, one_way};

pub use at_wedges::{ComparedAttribute, wedge_differences};

/// The errors of one attribute at nearest points.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[non_exhaustive]
pub struct AttributeError {
    /// Mean over the area.
    pub mean: TwoWay,
    /// Root of the mean square over the area.
    pub rms: TwoWay,
    /// Error not exceeded on 95 % of the area.
    pub p95: TwoWay,
}

/// The errors of the attributes that both meshes have.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[non_exhaustive]
pub struct AttributeErrors {
    /// Angles between normals, in degrees.
    pub normals_deg: Option<AttributeError>,
    /// Distances of texture coordinates; 1 is the width or height of the image.
    pub uvs: Option<AttributeError>,
    /// Distances of texture coordinates in texels of the reference's images, over the area that has an image;
    /// only from [`compare_textured`].
    pub uvs_texels: Option<AttributeError>,
    /// Distances of colours; 1 is the range of a channel.
    pub colors: Option<AttributeError>,
}

/// Compares attributes at the samples of each mesh with the attributes at the nearest points of the other.
///
/// If the nearest point lies on another texture chart, or on a sheet that faces the other way, a point on the
/// right one is used instead if it is farther away by no more than 0.2 % of the reference's diagonal: a seam
/// that has moved by so little is not a texture error. Only the nearest point of each chart counts, and of
/// these points the one whose texture coordinates agree best. A seam that has moved farther is an error over
/// the whole area between. Cost: as [`super::compare`] without vertices.
///
/// # Errors
/// [`MeasureError::Empty`] if either mesh has no face with finite corners.
pub fn compare_attributes(
    reference: &TriMesh,
    candidate: &TriMesh,
    options: &CompareOptions,
) -> Result<AttributeErrors, MeasureError> {
    compare_textured(reference, candidate, &[], options)
}

/// Compares attributes like [`compare_attributes`], and texture coordinates in texels too.
///
/// `image_sizes` are the width and height in texels of the image on each region of the reference, indexed by
/// region; a mesh without regions uses the first. Each difference is measured in texels of the image at its
/// point on the reference. Regions without an image, and those beyond the list, are not measured in texels.
///
/// # Errors
/// As [`compare_attributes`].
pub fn compare_textured(
    reference: &TriMesh,
    candidate: &TriMesh,
    image_sizes: &[Option<[u32; 2]>],
    options: &CompareOptions,
) -> Result<AttributeErrors, MeasureError> {
    let of =
        |mesh, image_sizes, which| MeasuredMesh::new(mesh, image_sizes).ok_or(MeasureError::Empty { which });
    let (a, b) = (of(reference, image_sizes, "reference")?, of(candidate, &[], "candidate")?);
    let samples = options.samples.max(1);
    let tolerance = SEAM_TOLERANCE * a.tree.bounds().map_or(0.0, |b| b.diagonal());
    let (forward, backward) = (
        a.differences(&b, samples, options.seed, tolerance),
        b.differences(&a, samples, options.seed, tolerance),
    );
    let has_uvs = reference.uvs().is_some() && candidate.uvs().is_some();
    let has = [
        reference.normals().is_some() && candidate.normals().is_some(),
        has_uvs,
        reference.colors().is_some() && candidate.colors().is_some(),
        has_uvs && !forward[3].is_empty() && !backward[3].is_empty(),
    ];
    let [normals_deg, uvs, colors, uvs_texels] =
        [0, 1, 2, 3].map(|k| has[k].then(|| AttributeError::of(&forward[k], &backward[k])));
    Ok(AttributeErrors { normals_deg, uvs, uvs_texels, colors })
}

impl AttributeError {
    fn of(forward: &[f64], backward: &[f64]) -> Self {
        let figure = |f: fn(&[f64]) -> f64, both: fn(f64, f64) -> f64| {
            let (forward, backward) = (f(forward), f(backward));
            TwoWay { forward, backward, symmetric: both(forward, backward) }
        };
        let rms = |x: &[f64]| chunks::mean(&x.iter().map(|d| d * d).collect::<Vec<_>>()).sqrt();
        Self {
            mean: figure(chunks::mean, |a, b| a * 0.5 + b * 0.5),
            rms: figure(rms, |a, b| libm::hypot(a, b) * std::f64::consts::FRAC_1_SQRT_2),
            p95: figure(|x| one_way::quantile(&mut x.to_vec(), 0.95), f64::max),
        }
    }
}

/// Maximum extra distance of the right side of a seam over the nearest point, as a share of the diagonal.
/// (Chosen on three textured models at 50 to 5 %: seams of good results move by less.)
const SEAM_TOLERANCE: f64 = 2e-3;
/// Texture coordinates that differ by less belong to the same chart, and no other chart is searched for.
/// (Guessed: ten texels of 1,024.)
const SAME_CHART_UV: f64 = 0.01;
/// Maximum number of faces examined in the search for another chart. (Guessed: a surface within `SEAM_TOLERANCE` has
/// some hundred at ten million faces; only a point far from everything is as near to more.)
const MAX_SEARCH_FACES: usize = 1000;

/// A mesh prepared for measuring against another.
struct MeasuredMesh<'a> {
    mesh: &'a TriMesh,
    tree: Bvh,
    sampler: SurfaceSampler,
    /// The chart of each face; empty without texture coordinates.
    charts: Vec<u32>,
    /// Width and height of the image of each region, if it has one.
    image_sizes: &'a [Option<[u32; 2]>],
}

/// The nearest point of a chart, on sheets that face one way.
#[derive(Clone, Copy)]
struct ChartPoint {
    slot: u32,
    chart: u32,
    is_back: bool,
    distance_sq: f64,
    uv_off: f64,
}

/// Values at a point: normal, texture coordinates, colour, and the size of the image.
struct AttributeValues {
    normal: Option<DVec3>,
    uv: Option<[f64; 2]>,
    color: Option<[f64; 4]>,
    image_size: Option<[u32; 2]>,
}

impl<'a> MeasuredMesh<'a> {
    fn new(mesh: &'a TriMesh, image_sizes: &'a [Option<[u32; 2]>]) -> Option<Self> {
        let surface = mesh.surface();
        let charts = charts(mesh);
        Some(Self {
            mesh,
            tree: Bvh::new(&surface),
            sampler: SurfaceSampler::new(&surface)?,
            charts,
            image_sizes,
        })
    }

    fn corners(&self, face: usize) -> [DVec3; 3] {
        let positions = self.mesh.positions().view();
        self.mesh.triangles()[face].map(|w| DVec3::from(positions.get(self.mesh.vertex_of(w))))
    }

    fn values(&self, face: usize, weights: [f64; 3]) -> AttributeValues {
        let wedges = self.mesh.triangles()[face];
        fn blend<const N: usize>(all: &[[f32; N]], wedges: [WedgeId; 3], weights: [f64; 3]) -> [f64; N] {
            std::array::from_fn(|k| {
                wedges.iter().zip(weights).map(|(w, weight)| f64::from(all[w.index()][k]) * weight).sum()
            })
        }
        let region = self.mesh.regions().map_or(0, |regions| regions[face].index());
        AttributeValues {
            image_size: self.image_sizes.get(region).copied().flatten(),
            normal: self.mesh.normals().map(|n| DVec3::from(blend(n, wedges, weights))),
            uv: self.mesh.uvs().map(|t| blend(t, wedges, weights)),
            color: self.mesh.colors().map(|c| blend(c, wedges, weights)),
        }
    }

    /// Returns the values at the point that corresponds to a point of the other mesh, whose face has `normal`
    /// and whose values are `here`.
    fn counterpart(
        &self,
        point: DVec3,
        normal: DVec3,
        here: &AttributeValues,
        tolerance: f64,
        hint: &mut Hint,
    ) -> Option<AttributeValues> {
        let p = self.tree.frame().unit_from_user(point.into());
        let nearest = self.tree.closest_slot(p, f64::INFINITY, hint)?;
        let first = self.choice(nearest.slot, p, normal, here);
        let mut chosen = first;
        if first.is_back || first.uv_off > SAME_CHART_UV {
            let reach = nearest.distance_sq.sqrt() + self.tree.frame().unit_length(tolerance);
            let mut choices = vec![first];
            let mut looked_at = 0;
            self.tree.visit(p, reach * reach, |slot| {
                looked_at += 1;
                if looked_at > MAX_SEARCH_FACES {
                    return Some(0.0);
                }
                let choice = self.choice(slot, p, normal, here);
                if choice.distance_sq > reach * reach {
                    return None;
                }
                let same = |c: &&mut ChartPoint| (c.chart, c.is_back) == (choice.chart, choice.is_back);
                match choices.iter_mut().find(same) {
                    Some(known) if choice.distance_sq < known.distance_sq => *known = choice,
                    Some(_) => {}
                    None => choices.push(choice),
                }
                None
            });
            for c in choices {
                let is_better =
                    if c.is_back == chosen.is_back { c.uv_off < chosen.uv_off } else { chosen.is_back };
                if is_better {
                    chosen = c;
                }
            }
        }
        let corners = self.tree.slot_corners(chosen.slot);
        let weights = weights_at(triangle::nearest(p, corners).point, corners);
        Some(self.values(self.tree.slot_face(chosen.slot).index(), weights))
    }

    fn choice(&self, slot: u32, p: DVec3, normal: DVec3, here: &AttributeValues) -> ChartPoint {
        let corners = self.tree.slot_corners(slot);
        let nearest = triangle::nearest(p, corners);
        let face = self.tree.slot_face(slot).index();
        let is_back = normal.dot(double_area_normal(corners)) < 0.0;
        let uv_off = match (here.uv, self.mesh.uvs()) {
            (Some(a), Some(_)) => {
                let there = self.values(face, weights_at(nearest.point, corners));
                there.uv.map_or(0.0, |b| distance(&a, &b))
            }
            _ => 0.0,
        };
        let chart = self.charts.get(face).copied().unwrap_or(0);
        ChartPoint { slot, chart, is_back, distance_sq: nearest.distance_sq, uv_off }
    }

    /// Returns the differences of normals, texture coordinates, colours, and texture coordinates in texels at
    /// the samples of this mesh.
    fn differences(&self, to: &MeasuredMesh<'_>, samples: usize, seed: u64, tolerance: f64) -> [Vec<f64>; 4] {
        let parts = chunks::map(samples, |range| {
            let mut part = [const { Vec::new() }; 4];
            let mut hint = Hint::default();
            for sample in self.sampler.samples(range, samples, seed) {
                let corners = self.corners(sample.face.index());
                let here = self.values(sample.face.index(), sample.weights);
                let normal = double_area_normal(corners);
                let Some(there) = to.counterpart(sample.point(corners), normal, &here, tolerance, &mut hint)
                else {
                    continue;
                };
                if let (Some(a), Some(b)) = (here.normal, there.normal)
                    && a != DVec3::ZERO
                    && b != DVec3::ZERO
                {
                    part[0].push(libm::atan2(a.cross(b).length(), a.dot(b)).to_degrees());
                }
                if let (Some(a), Some(b)) = (here.uv, there.uv) {
                    part[1].push(distance(&a, &b));
                    if let Some(size) = here.image_size.or(there.image_size) {
                        let texels = |uv: [f64; 2]| [0, 1].map(|k| uv[k] * f64::from(size[k]));
                        part[3].push(distance(&texels(a), &texels(b)));
                    }
                }
                if let (Some(a), Some(b)) = (here.color, there.color) {
                    part[2].push(distance(&a, &b));
                }
            }
            part
        });
        let mut all = [const { Vec::new() }; 4];
        for part in parts {
            for (all, mut part) in all.iter_mut().zip(part) {
                all.append(&mut part);
            }
        }
        all
    }
}

fn distance(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| (a - b) * (a - b)).sum::<f64>().sqrt()
}

/// Returns the chart of each face: faces that share a position with equal texture coordinates belong to one
/// chart. Empty without texture coordinates.
fn charts(mesh: &TriMesh) -> Vec<u32> {
    let Some(uvs) = mesh.uvs() else { return Vec::new() };
    let places = weld(mesh.positions().view());
    let key = |w: WedgeId| (places.of(mesh.vertex_of(w)), uvs[w.index()].map(f32::to_bits));
    let mut corners: Vec<_> =
        (0u32..).zip(mesh.triangles()).flat_map(|(f, wedges)| wedges.map(|w| (key(w), f))).collect();
    corners.sort_unstable();
    // Union-find: each face points to a lower one of its chart, or to itself.
    let mut lower: Vec<u32> = (0..mesh.face_count() as u32).collect();
    let root = |lower: &mut Vec<u32>, mut f: u32| {
        while lower[f as usize] != f {
            let next = lower[lower[f as usize] as usize];
            lower[f as usize] = next;
            f = next;
        }
        f
    };
    for pair in corners.windows(2).filter(|pair| pair[0].0 == pair[1].0) {
        let (a, b) = (root(&mut lower, pair[0].1), root(&mut lower, pair[1].1));
        lower[a.max(b) as usize] = a.min(b);
    }
    (0..mesh.face_count() as u32).map(|f| root(&mut lower, f)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::Positions;
    use crate::{RegionId, VertexId, shapes};

    #[test]
    fn a_shifted_texture_is_off_by_the_shift() {
        let mut a = shapes::grid(8);
        let uvs: Vec<[f32; 2]> = a.positions().view().iter().map(|p| [p[0] as f32, p[1] as f32]).collect();
        a.set_uvs(Some(uvs.clone())).unwrap();
        let mut b = a.clone();
        b.set_uvs(Some(uvs.iter().map(|t| [t[0] + 0.03, t[1] - 0.04]).collect())).unwrap();
        let got = compare_attributes(&a, &b, &CompareOptions { samples: 5000, seed: 1 }).unwrap();
        let uvs = got.uvs.unwrap();
        assert!((uvs.mean.symmetric - 0.05).abs() < 1e-6 && (uvs.p95.forward - 0.05).abs() < 1e-6);
        assert!(got.normals_deg.is_none() && got.colors.is_none() && got.uvs_texels.is_none());
    }

    #[test]
    fn texels_are_those_of_the_image_at_the_point() {
        let mut a = shapes::grid(8);
        let uvs: Vec<[f32; 2]> = a.positions().view().iter().map(|p| [p[0] as f32, p[1] as f32]).collect();
        a.set_uvs(Some(uvs.clone())).unwrap();
        let mut b = a.clone();
        b.set_uvs(Some(uvs.iter().map(|t| [t[0] + 0.03, t[1] - 0.04]).collect())).unwrap();
        let options = CompareOptions { samples: 20_000, seed: 1 };
        let compared = |a: &TriMesh, sizes: &[_]| compare_textured(a, &b, sizes, &options).unwrap();
        let texels = compared(&a, &[Some([100, 200])]).uvs_texels.unwrap();
        let wanted = 3f64.hypot(8.0);
        assert!((texels.mean.symmetric - wanted).abs() < 1e-4 && (texels.p95.backward - wanted).abs() < 1e-4);
        assert_eq!(compared(&a, &[None]).uvs_texels, None);
        assert!(compared(&a, &[None]).uvs.is_some());

        // Half of the faces show a larger image, a quarter none; all faces have the same area.
        let count = a.face_count();
        let region = |f: usize| {
            RegionId(if f < count / 2 {
                0
            } else if f < count * 3 / 4 {
                1
            } else {
                2
            })
        };
        a.set_regions(Some((0..count).map(region).collect())).unwrap();
        let texels = compared(&a, &[Some([100, 100]), Some([400, 400])]).uvs_texels.unwrap();
        let wanted = (2.0 * 5.0 + 20.0) / 3.0;
        assert!((texels.mean.forward - wanted).abs() < 0.01 * wanted, "{texels:?}");
        assert!((texels.mean.backward - wanted).abs() < 0.01 * wanted, "{texels:?}");
    }

    #[test]
    fn normals_are_compared_by_angle() {
        let p = Positions::F32(vec![[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]);
        let mut a = TriMesh::new(p, vec![[0, 1, 2].map(VertexId)]).unwrap();
        let mut b = a.clone();
        a.set_normals(Some(vec![[0.0, 0.0, 1.0]; 3])).unwrap();
        b.set_normals(Some(vec![[0.0, 1.0, 1.0]; 3])).unwrap();
        let got = compare_attributes(&a, &b, &CompareOptions::default()).unwrap();
        assert!((got.normals_deg.unwrap().rms.symmetric - 45.0).abs() < 1e-6);
    }

    /// Two adjacent squares whose texture coordinates are far apart; the seam runs along x = `middle`.
    fn two_charts(middle: f64) -> TriMesh {
        let positions: Vec<[f64; 3]> =
            [0.0, middle, middle, 2.0].into_iter().flat_map(|x| [[x, 0.0, 0.0], [x, 1.0, 0.0]]).collect();
        let uv = |i: usize, p: &[f64; 3]| [p[0] as f32 + if i >= 4 { 10.0 } else { 0.0 }, p[1] as f32];
        let uvs = positions.iter().enumerate().map(|(i, p)| uv(i, p)).collect();
        let triangles = [[0, 2, 1], [1, 2, 3], [4, 6, 5], [5, 6, 7]].map(|t| t.map(VertexId)).to_vec();
        let mut mesh = TriMesh::new(Positions::F64(positions), triangles).unwrap();
        mesh.set_uvs(Some(uvs)).unwrap();
        mesh
    }

    #[test]
    fn a_seam_may_move_by_a_hair_and_no_farther() {
        let options = CompareOptions { samples: 20_000, seed: 1 };
        let mean = |middle| {
            let got = compare_attributes(&two_charts(1.0), &two_charts(middle), &options).unwrap();
            got.uvs.unwrap().mean.symmetric
        };
        // The diagonal is 2.24, so `SEAM_TOLERANCE` is 0.0045.
        assert!(mean(1.004) < 1e-4, "{}", mean(1.004));
        // Of the samples in the strip of 0.1 all but those within `SEAM_TOLERANCE` of the seam see the other chart.
        let wanted = 10.0 * (0.1 - 0.0045) / 2.0;
        assert!((mean(1.1) - wanted).abs() < 0.05 * wanted, "{}", mean(1.1));
    }

    #[test]
    fn charts_are_separate_and_soups_are_joined() {
        assert_eq!(charts(&two_charts(1.0)), [0, 0, 2, 2]);
        let mut plain = two_charts(1.0);
        plain.set_uvs(None).unwrap();
        assert!(charts(&plain).is_empty());
    }
}
