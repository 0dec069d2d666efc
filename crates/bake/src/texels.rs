//! Baking of the maps of one set, band after band.

use glam::{DMat3, DVec3, Vec3, Vec4, Vec4Swizzles};
use lodsmith::{Control, Verdict};
use lodsmith_core::Image;
use lodsmith_render::linear::Encoder;
use rayon::prelude::*;

use crate::atlas::padding;
use crate::cover::{BAND_ROWS, Cover, NOTHING, SAMPLES, Texel, TexelFace, sample_offset};
use crate::curvature::Curvature;
use crate::error::BakeError;
use crate::maps::{BakedMap, Texels, dilate, fill};
use crate::occluders::Occluders;
use crate::occlusion::{Latest, Place, Rays};
use crate::options::MapKind;
use crate::search::{Found, Sample, Search};
use crate::sets::{FaceSet, MapJob, texel_steps};
use crate::source::{Footprint, SourcePoint};

/// The tangent frames of the lighter surface, and other data for the maps of all sets.
pub(crate) struct Baker<'a> {
    pub(crate) search: Search<'a>,
    /// Tangents at the corners of each face of the lighter surface, in model coordinates; empty without normal maps.
    pub(crate) tangents: &'a [[Vec4; 3]],
    pub(crate) uvs: &'a [[[f32; 2]; 3]],
    pub(crate) rays: Option<&'a (Rays, Occluders)>,
    pub(crate) curvature: Option<&'a Curvature>,
}

/// Values of a map before they are stored: sums over samples.
type Values = Vec<[f32; 4]>;

/// A finished band.
struct Band {
    /// For each map, its texels.
    values: Vec<Values>,
    is_known: Vec<bool>,
    found: Found,
}

/// Bands between two progress reports.
const BANDS_PER_REPORT: usize = 8;

impl Baker<'_> {
    /// Bakes the maps of a set. `share` converts its progress to the progress of the run.
    pub(crate) fn bake(
        &self,
        set: &FaceSet,
        control: &mut dyn Control,
        share: &dyn Fn(f64) -> f64,
    ) -> Result<(Vec<BakedMap>, Found), BakeError> {
        let faces = set.faces.iter().map(|&f| TexelFace::new(f as u32, self.uvs[f], set.size));
        let cover = Cover::new(set.size, faces);
        let mut found = Found::default();
        let mut values: Vec<Values> = vec![Vec::with_capacity(set.size * set.size); set.maps.len()];
        let mut is_known = Vec::with_capacity(set.size * set.size);
        let count = cover.band_count();
        for first in (0..count).step_by(BANDS_PER_REPORT) {
            if control.progress(share(first as f64 / count as f64)) != Verdict::Continue {
                return Err(BakeError::Cancelled);
            }
            let bands = first..(first + BANDS_PER_REPORT).min(count);
            let done: Vec<Band> = bands.into_par_iter().map(|b| self.band(set, &cover, b)).collect();
            for band in done {
                found.add(&band.found);
                is_known.extend(band.is_known);
                values.iter_mut().zip(band.values).for_each(|(all, own)| all.extend(own));
            }
        }
        let jobs: Vec<(MapJob, Values)> = set.maps.iter().copied().zip(values).collect();
        let finish = |(job, values): (MapJob, Values)| self.finish(job.kind, values, &is_known, set.size);
        Ok((jobs.into_iter().map(finish).collect(), found))
    }

    fn band(&self, set: &FaceSet, cover: &Cover, band: usize) -> Band {
        let texels = cover.band(band);
        let mut out = Band {
            values: vec![vec![[0f32; 4]; texels.len()]; set.maps.len()],
            is_known: vec![false; texels.len()],
            found: Found::default(),
        };
        let (mut crossings, mut latest) = (Vec::new(), Latest::new());
        let mut sums = vec![[0f32; 4]; set.maps.len()];
        for (i, texel) in texels.iter().enumerate().filter(|(_, t)| !t.is_empty()) {
            let (x, y) = (i % cover.size, band * BAND_ROWS + i / cover.size);
            sums.fill([0.0; 4]);
            let samples = samples_of(texel);
            for (number, &(face, offset)) in samples.list[..samples.count].iter().enumerate() {
                let texel_face = &cover.faces[face as usize];
                let weights = cover.weights(texel_face, x, y, offset);
                let sample = Sample { face: texel_face.face as usize, weights };
                let Some(at) = self.search.find(&sample, &mut crossings, &mut out.found) else { continue };
                let steps = texel_steps(self.search.light.corners(sample.face), texel_face);
                let share = 1.0 / (samples.count as f64).sqrt();
                let footprint = Footprint { across: steps[0] * share, down: steps[1] * share };
                let key = ((y * cover.size + x) * SAMPLES + number) as u64;
                for (sum, job) in sums.iter_mut().zip(&set.maps) {
                    let value = self.value(*job, &sample, &at, &footprint, (key, &mut latest));
                    (0..4).for_each(|k| sum[k] += value[k]);
                }
            }
            for (all, sum) in out.values.iter_mut().zip(&sums) {
                all[i] = sum.map(|s| s / samples.count as f32);
            }
            out.is_known[i] = true;
        }
        out
    }

    /// The value of a map at a sample. Colours are linear and premultiplied, directions are between -1 and 1.
    fn value(
        &self,
        job: MapJob,
        sample: &Sample,
        at: &SourcePoint,
        footprint: &Footprint,
        (key, latest): (u64, &mut Latest),
    ) -> [f32; 4] {
        let source = self.search.source;
        let direction = |n: Vec3| [n.x, n.y, n.z, 1.0];
        match job.kind {
            MapKind::Normal => direction(self.in_tangent_frame(sample, source.normal(at, footprint))),
            MapKind::ObjectNormal => {
                let piece = self.search.light.piece_of(sample.face);
                let normal = source.normal(at, footprint).as_dvec3();
                direction((piece.normal.inverse() * normal).normalize_or(normal).as_vec3())
            }
            MapKind::Color => premultiplied(source.color(at, footprint)),
            MapKind::VertexColor => premultiplied(source.vertex_color(at)),
            MapKind::MetallicRoughness => {
                let [metallic, roughness] = source.metallic_roughness(at, footprint);
                [1.0, roughness, metallic, 1.0]
            }
            MapKind::Emissive => {
                let [r, g, b] = source.emissive(at, footprint);
                [r, g, b, 1.0]
            }
            MapKind::Occlusion => {
                let open = match self.rays.filter(|_| !job.is_copied) {
                    Some((rays, occluders)) => {
                        let normal = source.smooth_normal(at);
                        let flat = source.face_normal(at.face);
                        let place = Place { point: source.point(at), normal, flat };
                        rays.open_share(occluders, &place, key, latest)
                    }
                    None => source.occlusion(at, footprint),
                };
                [open, open, open, 1.0]
            }
            MapKind::Height => [at.height as f32, 0.0, 0.0, 1.0],
            MapKind::Curvature => {
                let bend = self.curvature.map_or(0.0, |c| c.at(&source.flat, at));
                [bend, bend, bend, 1.0]
            }
        }
    }

    /// Returns a normal in the frame that a renderer interpolates at a sample: the exact inverse of its formula,
    /// `normalize(x * tangent + y * bitangent + z * normal)`.
    fn in_tangent_frame(&self, sample: &Sample, normal: Vec3) -> Vec3 {
        let weights = sample.weights;
        let blend = |v: [DVec3; 3]| v[0] * weights[0] + v[1] * weights[1] + v[2] * weights[2];
        let corners = self.tangents[sample.face];
        let [na, nb, nc] = self.search.light.normals[sample.face];
        let frame_normal = blend([na.as_dvec3(), nb.as_dvec3(), nc.as_dvec3()]);
        let [ta, tb, tc] = corners;
        let tangent = blend([ta.xyz().as_dvec3(), tb.xyz().as_dvec3(), tc.xyz().as_dvec3()]);
        let bitangent = frame_normal.cross(tangent) * f64::from(corners[0].w);
        let frame = DMat3::from_cols(tangent, bitangent, frame_normal);
        let inner = frame.inverse() * normal.as_dvec3();
        // A surface that faces away cannot be stored.
        let mut inner = if inner.is_finite() { inner } else { DVec3::Z };
        inner.z = inner.z.max(MIN_NORMAL_Z * inner.length());
        inner.normalize_or(DVec3::Z).as_vec3()
    }

    fn finish(&self, kind: MapKind, mut values: Values, is_known: &[bool], size: usize) -> BakedMap {
        if matches!(kind, MapKind::Normal | MapKind::ObjectNormal) {
            let unit = |v: &mut [f32; 4]| {
                let n = Vec3::new(v[0], v[1], v[2]).normalize_or(Vec3::Z);
                *v = [n.x, n.y, n.z, 1.0];
            };
            values.par_iter_mut().zip(is_known).filter(|(_, k)| **k).for_each(|(v, _)| unit(v));
        }
        let blank = stored_blank(kind);
        let mut is_known = is_known.to_vec();
        dilate(&mut values, &mut is_known, size, size, padding(size));
        fill(&mut values, &is_known, size, size, blank);
        if kind == MapKind::Height {
            let range = values.iter().map(|v| v[0].abs()).fold(0f32, f32::max).max(f32::MIN_POSITIVE);
            let word = |v: &[f32; 4]| ((0.5 + 0.5 * v[0] / range) * 65535.0 + 0.5) as u16;
            let values = values.iter().map(word).collect();
            let texels = Texels::Gray16 { width: size, height: size, values };
            return BakedMap { kind, texels, range: Some(f64::from(range)) };
        }
        let range = match kind {
            MapKind::Curvature => self.curvature.map(|c| c.range),
            MapKind::Emissive => brightest(&values).map(f64::from),
            _ => None,
        };
        if let (MapKind::Emissive, Some(white)) = (kind, range) {
            values.iter_mut().for_each(|v| *v = v.map(|x| x / white as f32));
        }
        let encoder = Encoder::new();
        let mut pixels = vec![[0u8; 4]; size * size];
        pixels.par_iter_mut().zip(&values).for_each(|(p, v)| *p = stored(kind, v, encoder));
        BakedMap { kind, texels: Texels::Rgba8(Image::new(size, size, pixels)), range }
    }
}

/// Returns the largest emitted value if a texture cannot hold it.
fn brightest(values: &[[f32; 4]]) -> Option<f32> {
    let of_texel = |v: &[f32; 4]| v[0].max(v[1]).max(v[2]);
    values.iter().map(of_texel).reduce(f32::max).filter(|x| *x > 1.0)
}

/// Smallest z of a stored normal: 87° from the frame's normal. Beyond, 8 bits are too coarse. (Guessed.)
const MIN_NORMAL_Z: f64 = 0.05;

/// The samples of a texel.
struct Samples {
    /// Faces of the cover, and places within the texel.
    list: [(u32, glam::DVec2); SAMPLES],
    count: usize,
}

/// Returns the samples of a texel: samples outside of a chart are on the extension of a face, so that the value
/// represents the whole texel. Beside a chart, one sample in the middle is enough.
fn samples_of(texel: &Texel) -> Samples {
    let centre = glam::DVec2::splat(0.5);
    if !texel.is_covered() {
        return Samples { list: [(texel.faces[0], centre); SAMPLES], count: 1 };
    }
    let owner = texel.faces.iter().copied().find(|&f| f != NOTHING).unwrap_or(NOTHING);
    let at = |s: usize| (if texel.faces[s] == NOTHING { owner } else { texel.faces[s] }, sample_offset(s));
    Samples { list: std::array::from_fn(at), count: SAMPLES }
}

fn premultiplied([r, g, b, a]: [f32; 4]) -> [f32; 4] {
    // A transparent texel keeps a trace of its colour, which filtering shows at edges.
    let a = a.clamp(1.0 / 1024.0, 1.0);
    [r * a, g * a, b * a, a]
}

/// The value of a map where nothing was baked.
fn stored_blank(kind: MapKind) -> [f32; 4] {
    let light = |b: u8| lodsmith_render::linear::of_byte(b);
    let [r, g, b, a] = kind.blank();
    match kind {
        MapKind::Color | MapKind::VertexColor | MapKind::Emissive => [light(r), light(g), light(b), 1.0],
        MapKind::Normal | MapKind::ObjectNormal => [0.0, 0.0, 1.0, 1.0],
        MapKind::Height | MapKind::Curvature => [0.0, 0.0, 0.0, 1.0],
        _ => [r, g, b, a].map(|x| f32::from(x) / 255.0),
    }
}

/// Encodes a value in eight bits.
fn stored(kind: MapKind, v: &[f32; 4], encoder: Encoder) -> [u8; 4] {
    let byte = |x: f32| (x.clamp(0.0, 1.0) * 255.0 + 0.5) as u8;
    match kind {
        MapKind::Normal | MapKind::ObjectNormal | MapKind::Curvature => {
            [byte(v[0] * 0.5 + 0.5), byte(v[1] * 0.5 + 0.5), byte(v[2] * 0.5 + 0.5), 255]
        }
        MapKind::Color | MapKind::VertexColor => {
            let alpha = v[3].max(1e-6);
            let stored_alpha = if alpha <= 2.0 / 1024.0 { 0 } else { byte(alpha) };
            let [r, g, b] = [v[0], v[1], v[2]].map(|x| encoder.byte(x / alpha));
            [r, g, b, stored_alpha]
        }
        MapKind::Emissive => [encoder.byte(v[0]), encoder.byte(v[1]), encoder.byte(v[2]), 255],
        MapKind::MetallicRoughness | MapKind::Occlusion | MapKind::Height => {
            [byte(v[0]), byte(v[1]), byte(v[2]), 255]
        }
    }
}
