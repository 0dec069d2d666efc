//! How far normals, texture coordinates and colours of two meshes lie apart.

use glam::DVec3;

use crate::geometry::triangle::weights_at;
use crate::ids::WedgeId;
use crate::mesh::TriMesh;
use crate::sampling::Sampler;
use crate::spatial::{Bvh, Hint};

use super::{CompareOptions, MeasureError, TwoWay, chunks, one_way};

/// The errors of one attribute at nearest points.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[non_exhaustive]
pub struct AttributeError {
    /// Mean over the area.
    pub mean: TwoWay,
    /// Root of the mean square over the area.
    pub rms: TwoWay,
    /// What 95 % of the area stay below.
    pub p95: TwoWay,
}

/// The errors of the attributes that both meshes have.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[non_exhaustive]
pub struct AttributeErrors {
    /// Angles between normals, in degrees.
    pub normals_deg: Option<AttributeError>,
    /// Distances of texture coordinates, 1 being the edge of the image.
    pub uvs: Option<AttributeError>,
    /// Distances of colours, 1 being the range of a channel.
    pub colors: Option<AttributeError>,
}

/// Compares attributes at the samples of each mesh with those at the nearest points of the other.
///
/// A point on a seam has two values, and its nearest point may be given on either side: along seams the error is then that
/// between the sides, for the part of the samples that lie there. Read the 95 % figure beside the mean.
/// Cost: as [`super::compare`] without vertices.
///
/// # Errors
/// [`MeasureError::Empty`] if either mesh has no face with finite corners.
pub fn compare_attributes(
    reference: &TriMesh,
    candidate: &TriMesh,
    options: &CompareOptions,
) -> Result<AttributeErrors, MeasureError> {
    let of = |mesh, which| Side::new(mesh).ok_or(MeasureError::Empty { which });
    let (a, b) = (of(reference, "reference")?, of(candidate, "candidate")?);
    let samples = options.samples.max(1);
    let (forward, backward) =
        (a.differences(&b, samples, options.seed), b.differences(&a, samples, options.seed));
    let has = [
        reference.normals().is_some() && candidate.normals().is_some(),
        reference.uvs().is_some() && candidate.uvs().is_some(),
        reference.colors().is_some() && candidate.colors().is_some(),
    ];
    let [normals_deg, uvs, colors] =
        [0, 1, 2].map(|k| has[k].then(|| AttributeError::of(&forward[k], &backward[k])));
    Ok(AttributeErrors { normals_deg, uvs, colors })
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
            rms: figure(rms, |a, b| a.hypot(b) * std::f64::consts::FRAC_1_SQRT_2),
            p95: figure(|x| one_way::quantile(&mut x.to_vec(), 0.95), f64::max),
        }
    }
}

/// A mesh that is measured against another.
struct Side<'a> {
    mesh: &'a TriMesh,
    tree: Bvh,
    sampler: Sampler,
}

/// Values at a point: normal, texture coordinates, colour.
struct Values {
    normal: Option<DVec3>,
    uv: Option<[f64; 2]>,
    color: Option<[f64; 4]>,
}

impl<'a> Side<'a> {
    fn new(mesh: &'a TriMesh) -> Option<Self> {
        let surface = mesh.surface();
        Some(Self { mesh, tree: Bvh::new(&surface), sampler: Sampler::new(&surface)? })
    }

    fn corners(&self, face: usize) -> [DVec3; 3] {
        let positions = self.mesh.positions().view();
        self.mesh.triangles()[face].map(|w| DVec3::from(positions.get(self.mesh.vertex_of(w))))
    }

    fn values(&self, face: usize, weights: [f64; 3]) -> Values {
        let wedges = self.mesh.triangles()[face];
        fn blend<const N: usize>(all: &[[f32; N]], wedges: [WedgeId; 3], weights: [f64; 3]) -> [f64; N] {
            std::array::from_fn(|k| {
                wedges.iter().zip(weights).map(|(w, weight)| f64::from(all[w.index()][k]) * weight).sum()
            })
        }
        Values {
            normal: self.mesh.normals().map(|n| DVec3::from(blend(n, wedges, weights))),
            uv: self.mesh.uvs().map(|t| blend(t, wedges, weights)),
            color: self.mesh.colors().map(|c| blend(c, wedges, weights)),
        }
    }

    /// Differences of normals, texture coordinates and colours at the samples of this mesh.
    fn differences(&self, to: &Side<'_>, samples: usize, seed: u64) -> [Vec<f64>; 3] {
        let parts = chunks::map(samples, |range| {
            let mut part = [Vec::new(), Vec::new(), Vec::new()];
            let mut hint = Hint::default();
            for sample in self.sampler.samples(range, samples, seed) {
                let corners = self.corners(sample.face.index());
                let Some(hit) = to.tree.closest_from(sample.point(corners).into(), &mut hint) else {
                    continue;
                };
                let here = self.values(sample.face.index(), sample.weights);
                let face = hit.face.index();
                let there = to.values(face, weights_at(DVec3::from(hit.point), to.corners(face)));
                if let (Some(a), Some(b)) = (here.normal, there.normal)
                    && a != DVec3::ZERO
                    && b != DVec3::ZERO
                {
                    part[0].push(a.cross(b).length().atan2(a.dot(b)).to_degrees());
                }
                let distance = |a: &[f64], b: &[f64]| {
                    a.iter().zip(b).map(|(a, b)| (a - b) * (a - b)).sum::<f64>().sqrt()
                };
                if let (Some(a), Some(b)) = (here.uv, there.uv) {
                    part[1].push(distance(&a, &b));
                }
                if let (Some(a), Some(b)) = (here.color, there.color) {
                    part[2].push(distance(&a, &b));
                }
            }
            part
        });
        let mut all = [Vec::new(), Vec::new(), Vec::new()];
        for part in parts {
            for (all, mut part) in all.iter_mut().zip(part) {
                all.append(&mut part);
            }
        }
        all
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::Positions;
    use crate::{VertexId, shapes};

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
        assert!(got.normals_deg.is_none() && got.colors.is_none());
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
}
