//! The triangle of a star that is nearest to a sample: eight triangles at a time.

use glam::Vec3A;
use lodsmith_core::VertexId;
use wide::{f32x4, f32x8};

use super::faces::FourFaces;
use crate::collapse::order::NONE;
use crate::collapse::ring::Corner;
use crate::collapse::store::Store;
use crate::cost::lanes::{Four, min, splat};
use crate::cost::metric::VertexMemory;

/// Least cosine between the normals of a sample and its triangle.
pub(super) const MIN_FACING_COS: f32 = 0.3;

/// Up to eight triangles of a vertex's star in SIMD lanes, each starting at that vertex: unit normal,
/// gradients of the barycentric coordinates of the two corners after it, heights over the three edges.
#[derive(Clone, Copy)]
pub(super) struct Fan {
    pub(super) normal: [f32x8; 3],
    pub(super) second: [f32x8; 3],
    pub(super) third: [f32x8; 3],
    pub(super) high: [f32x8; 3],
    pub(super) corner: [Corner; 8],
}

impl Fan {
    /// No triangle: comparisons with NaN are false, so it is never nearer.
    pub(super) const NONE: Self = {
        let (zero, none) = ([f32x8::ZERO; 3], [f32x8::splat(f32::NAN); 3]);
        Self { normal: none, second: zero, third: zero, high: zero, corner: [Corner::new(0, 0); 8] }
    };

    /// Fills it with the triangles at one to eight corners of `u`.
    #[inline(always)]
    pub(super) fn make<Q: VertexMemory>(&mut self, store: &Store<Q>, u: VertexId, corners: &[Corner]) {
        let at = splat(store.p(u));
        // Unused lanes repeat the last triangle: of equal distances the first is taken.
        let corner: [Corner; 8] = std::array::from_fn(|i| corners[i.min(corners.len() - 1)]);
        let four = |few: [Corner; 4]| {
            let others = few.map(|c| store.others_at(c));
            FourFaces::new([at, store.four(others.map(|o| o.0)), store.four(others.map(|o| o.1))])
        };
        let [a, b, c, d, e, f, g, h] = corner;
        let (low, high) = (four([a, b, c, d]), four([e, f, g, h]));
        let join = |low: Four, high: Four| [0, 1, 2].map(|i| bytemuck::cast([low[i], high[i]]));
        self.normal = join(low.normal, high.normal);
        self.second = join(low.second, high.second);
        self.third = join(low.third, high.third);
        self.high = join(low.high_sq.map(f32x4::sqrt), high.high_sq.map(f32x4::sqrt));
        self.corner = corner;
    }

    /// Returns the triangle nearest to a point `q` (relative to the vertex) by squared distances as mapped by
    /// `judged`, if it is nearer than `within`.
    #[inline(always)]
    pub(super) fn nearest(&self, q: Vec3A, judged: impl Fn(f32x8) -> f32x8, within: f32) -> Option<Nearest> {
        let (n, s, t, zero) = (&self.normal, &self.second, &self.third, f32x8::ZERO);
        let h = n[0] * q.x + n[1] * q.y + n[2] * q.z;
        let v = s[0] * q.x + s[1] * q.y + s[2] * q.z;
        let w = t[0] * q.x + t[1] * q.y + t[2] * q.z;
        let beside = ((v + w - f32x8::ONE) * self.high[0]).fast_max((zero - v) * self.high[1]);
        let beside = beside.fast_max((zero - w) * self.high[2]).fast_max(zero);
        let d2 = judged(h * h + beside * beside);
        let [low, high] = bytemuck::cast::<f32x8, [f32x4; 2]>(d2);
        let d = low.fast_min(high).to_array();
        let least = min(min(d[0], d[2]), min(d[1], d[3]));
        (least < within).then(|| {
            let i = d2.simd_eq(f32x8::splat(least)).to_bitmask().trailing_zeros() as usize & 7;
            Nearest {
                distance_sq: least,
                lateral: beside.to_array()[i],
                height: h.to_array()[i],
                second: v.to_array()[i],
                third: w.to_array()[i],
                corner: self.corner[i],
            }
        })
    }
}

/// The nearest triangle of a star.
#[derive(Clone, Copy)]
pub(super) struct Nearest {
    pub(super) distance_sq: f32,
    pub(super) lateral: f32,
    pub(super) height: f32,
    /// Barycentric coordinates of the two corners after `corner`.
    pub(super) second: f32,
    pub(super) third: f32,
    pub(super) corner: Corner,
}

/// A cached star: its first eight triangles, and the others.
#[derive(Clone)]
pub(super) struct CachedStar {
    pub(super) of: VertexId,
    pub(super) first: Fan,
    pub(super) other_fans: Vec<Fan>,
}

impl CachedStar {
    pub(super) const NONE: Self = Self { of: NONE, first: Fan::NONE, other_fans: Vec::new() };

    #[inline(never)]
    pub(super) fn make<Q: VertexMemory>(&mut self, store: &Store<Q>, u: VertexId) {
        self.of = u;
        self.other_fans.clear();
        let mut few = store.listed(u).chunks(8);
        match few.next() {
            Some(corners) => self.first.make(store, u, corners),
            None => self.first = Fan::NONE,
        }
        for corners in few {
            let mut fan = Fan::NONE;
            fan.make(store, u, corners);
            self.other_fans.push(fan);
        }
    }

    /// Returns the triangle nearest to a point `q` (relative to the vertex), if it is nearer than `within`,
    /// squared.
    #[inline(always)]
    pub(super) fn nearest(&self, q: Vec3A, within: f32) -> Option<Nearest> {
        let mut found = self.first.nearest(q, |d2| d2, within);
        for fan in &self.other_fans {
            found = fan.nearest(q, |d2| d2, found.map_or(within, |found| found.distance_sq)).or(found);
        }
        found
    }

    /// Returns the nearest triangle with a similar orientation to a sample, whose normal has this length.
    #[cold]
    #[inline(never)]
    pub(super) fn nearest_facing(
        &self,
        q: Vec3A,
        (normal, length): (Vec3A, f32),
        within: f32,
    ) -> Option<Nearest> {
        let mut found: Option<Nearest> = None;
        for fan in std::iter::once(&self.first).chain(&self.other_fans) {
            let [x, y, z] = fan.normal;
            let faces =
                (x * normal.x + y * normal.y + z * normal.z).simd_gt(f32x8::splat(MIN_FACING_COS * length));
            let judged = |d2| faces.bitselect(d2, f32x8::splat(f32::INFINITY));
            found = fan.nearest(q, judged, found.map_or(within, |found| found.distance_sq)).or(found);
        }
        found
    }
}
