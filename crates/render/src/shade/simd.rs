//! Shading of four points at a time with SIMD.

use glam::{Mat3, Vec3};
use lodsmith_core::{Positions, WedgeId};
use wide::f32x4;

use super::{HEAT_EDGE_LIGHT, LightPosition, Normals, Shader, SurfacePoint};
use crate::look::Shading;
use crate::raster::{ProjectedMesh, transpose_corners};

/// Specular strength of a plain surface, and exponent of the highlight as a power of two. (By eye.)
const SPECULAR_STRENGTH: f32 = 0.10;
const SPECULAR_SQUARINGS: u32 = 3;

/// A point to be shaded.
#[derive(Clone, Copy)]
struct ShadeRequest {
    face: u32,
    at: [f32; 2],
    /// The pixel, and the weight of this point in it.
    pixel: u32,
    share: f32,
}

/// Points collected until there are four.
#[derive(Default)]
pub(crate) struct Batch {
    waiting: Vec<ShadeRequest>,
}

impl Batch {
    /// Adds a point of a face, which contributes a share of a pixel.
    #[inline(always)]
    pub(crate) fn add(
        &mut self,
        shader: &Shader<'_>,
        face: u32,
        at: [f32; 2],
        (pixel, share): (usize, f32),
        colors: &mut [[f32; 4]],
    ) {
        self.waiting.push(ShadeRequest { face, at, pixel: pixel as u32, share });
        if let Some(four) = self.waiting.first_chunk() {
            shader.four(four, 4, colors);
            self.waiting.clear();
        }
    }

    /// Shades the remaining points.
    pub(crate) fn finish(&mut self, shader: &Shader<'_>, colors: &mut [[f32; 4]]) {
        if let Some(&last) = self.waiting.last() {
            let count = self.waiting.len();
            let four = std::array::from_fn(|i| self.waiting.get(i).copied().unwrap_or(last));
            shader.four(&four, count, colors);
            self.waiting.clear();
        }
    }
}

/// Four vectors.
#[derive(Clone, Copy)]
struct Vec3Lanes([f32x4; 3]);

impl Vec3Lanes {
    fn splat(v: Vec3) -> Self {
        Self(v.to_array().map(f32x4::splat))
    }
    #[inline(always)]
    fn of(four: [Vec3; 4]) -> Self {
        Self([0, 1, 2].map(|k| f32x4::from(four.map(|v| v[k]))))
    }
    #[inline(always)]
    fn dot(self, [x, y, z]: [f32x4; 3]) -> f32x4 {
        self.0[0] * x + self.0[1] * y + self.0[2] * z
    }
    #[inline(always)]
    fn times(self, factor: f32x4) -> Self {
        Self(self.0.map(|x| x * factor))
    }
    #[inline(always)]
    fn plus(self, other: Self) -> Self {
        Self([0, 1, 2].map(|k| self.0[k] + other.0[k]))
    }
    #[inline(always)]
    fn cross(self, Self([x, y, z]): Self) -> Self {
        let [a, b, c] = self.0;
        Self([b * z - c * y, c * x - a * z, a * y - b * x])
    }
    #[inline(always)]
    fn turned(self, m: &Mat3) -> Self {
        Self([0, 1, 2].map(|k| self.dot(m.row(k).to_array().map(f32x4::splat))))
    }
    /// Negates where `is_other` is set.
    #[inline(always)]
    fn flipped(self, is_other: f32x4) -> Self {
        Self(self.0.map(|x| is_other.select(-x, x)))
    }
    #[inline(always)]
    fn one(self, which: usize) -> Vec3 {
        Vec3::from(self.0.map(|x| x.as_array()[which]))
    }
    fn set(&mut self, which: usize, v: Vec3) {
        for k in 0..3 {
            self.0[k].as_mut_array()[which] = v[k];
        }
    }
}

/// Four points on faces of one part.
struct PointLanes {
    wedges: [[WedgeId; 3]; 4],
    /// Barycentric coordinates on the face in space.
    b: [f32x4; 3],
    /// Position in view coordinates.
    at: Vec3Lanes,
    normal: Vec3Lanes,
}

impl Shader<'_> {
    #[inline(always)]
    fn four(&self, wanted: &[ShadeRequest; 4], count: usize, colors: &mut [[f32; 4]]) {
        let mut done = [[0f32; 4]; 4];
        if self.shading == Shading::Textured {
            for (done, w) in done.iter_mut().zip(&wanted[..count]) {
                *done = self.color(w.face, w.at[0], w.at[1]);
            }
        } else {
            let parts = wanted.each_ref().map(|w| self.part_of(w.face));
            if parts == [parts[0]; 4] {
                done = self.plain(parts[0], wanted);
            } else {
                for i in 0..count {
                    done[i] = self.plain(parts[i], &[wanted[i]; 4])[0];
                }
            }
        }
        for (w, [r, g, b, _]) in wanted.iter().zip(done).take(count) {
            let color = &mut colors[w.pixel as usize];
            let share = w.share;
            *color = [color[0] + r * share, color[1] + g * share, color[2] + b * share, color[3] + share];
        }
    }

    /// Shades without materials.
    #[inline(always)]
    fn plain(&self, part: usize, wanted: &[ShadeRequest; 4]) -> [[f32; 4]; 4] {
        let placed = &self.screen.placed[part];
        let places = self.places(part, wanted);
        let each = |of: &dyn Fn(usize, [f32; 3]) -> Vec3| {
            Vec3Lanes::of(std::array::from_fn(|i| of(i, places.b.map(|b| b.as_array()[i]))))
        };
        let colors = match self.shading {
            Shading::VertexColors => {
                let own = each(&|i, b| self.vertex_color(placed, places.wedges[i], b).0);
                self.lit(own, places.normal, places.at)
            }
            Shading::Normals => each(&|i, _| {
                let n = self.projection.direction_to_world(places.normal.one(i)) * 0.5 + 0.5;
                crate::linear::of_srgb(n.to_array())
            }),
            Shading::Matcap => each(&|i, _| self.matcap(places.normal.one(i))),
            Shading::Heat => {
                let own = each(&|i, b| self.heat(placed, places.wedges[i], b));
                let facing = places.normal.dot(self.to_eyes(places.at).0).fast_max(f32x4::splat(0.0));
                own.times(facing * (1.0 - HEAT_EDGE_LIGHT) + HEAT_EDGE_LIGHT)
            }
            Shading::Smooth | Shading::Flat | Shading::Textured => {
                self.lit(Vec3Lanes::splat(self.surface), places.normal, places.at)
            }
        };
        let done = f32x4::transpose([colors.0[0], colors.0[1], colors.0[2], f32x4::splat(1.0)]);
        let done = done.map(f32x4::to_array);
        if self.wire.is_none() {
            return done;
        }
        std::array::from_fn(|i| {
            let (w, [r, g, b, _]) = (&wanted[i], done[i]);
            self.wired(Vec3::new(r, g, b), 1.0, || self.hit(w.face, w.at[0], w.at[1]))
        })
    }

    #[inline(always)]
    fn places(&self, part: usize, wanted: &[ShadeRequest; 4]) -> PointLanes {
        let placed = &self.screen.placed[part];
        let shaded = &self.meshes[part];
        let mesh = &placed.drawn.mesh;
        let faces = wanted.each_ref().map(|w| (w.face - placed.first_face) as usize);
        let wedges = faces.map(|face| mesh.triangles()[face]);
        let vertices = wedges.map(|of_face| of_face.map(|w| mesh.vertex_of(w).index()));
        let corners = transpose_corners(|i, k| placed.corners[vertices[i][k]]);
        let [a, b, c] = corners;
        let [x, y] = [0, 1].map(|k| f32x4::from(wanted.each_ref().map(|w| w.at[k])));
        let one = f32x4::splat(1.0);
        let (bx, by, cx, cy) = (b[0] - a[0], b[1] - a[1], c[0] - a[0], c[1] - a[1]);
        let doubled = bx * cy - by * cx;
        let per_area = one / doubled;
        let l1 = (cy * (x - a[0]) - cx * (y - a[1])) * per_area;
        let l2 = (bx * (y - a[1]) - by * (x - a[0])) * per_area;
        let l = [one - l1 - l2, l1, l2];
        let products = [0, 1, 2].map(|k| l[k] * corners[k][2]);
        let near = products[0] + products[1] + products[2];
        let [half_x, per_x, half_y, per_y] = self.per_pixel;
        let (sx, sy) = (x * per_x - half_x, f32x4::splat(half_y) - y * per_y);
        let (b, at) = if self.projection.is_perspective {
            let distance = one / near;
            (products.map(|p| p * distance), Vec3Lanes([sx * distance, sy * distance, -distance]))
        } else {
            (l, Vec3Lanes([sx, sy, near - 1.0]))
        };
        let is_front = doubled.simd_gt(f32x4::splat(0.0));
        let is_front = if shaded.is_mirrored { is_front } else { !is_front };
        let mut places = PointLanes { wedges, b, at, normal: Vec3Lanes::splat(Vec3::Z) };
        let mut is_odd = !(near.simd_gt(f32x4::splat(0.0)) & (near * 0.0).simd_eq(f32x4::splat(0.0)));
        let blended = |of: [[[f32; 3]; 3]; 4]| {
            let corner = |k: usize| Vec3Lanes::of(of.map(|of_face| Vec3::from(of_face[k]))).times(b[k]);
            corner(0).plus(corner(1)).plus(corner(2)).turned(&shaded.to_view)
        };
        let (normal, other) = match shaded.normals {
            Normals::None => (outer_normals(placed, vertices).turned(&shaded.to_view), !is_front),
            Normals::OfVertices(all) => (blended(vertices.map(|of_face| of_face.map(|v| all[v]))), !is_front),
            Normals::OfCorners(all) => (blended(faces.map(|face| all[face])), !is_front),
            Normals::OfWedges(all) => {
                let own = blended(wedges.map(|of_face| of_face.map(|w| all[w.index()])));
                // Normals from a file may point to either side of a face.
                let outer = outer_normals(placed, vertices).turned(&shaded.to_view);
                let is_inner = own.dot(outer.0).simd_lt(f32x4::splat(0.0));
                (own, is_inner ^ !is_front)
            }
        };
        let length_sq = normal.dot(normal.0);
        is_odd |= !length_sq.simd_gt(f32x4::splat(1e-12));
        let normal = normal.times(one / length_sq.sqrt());
        places.normal = if self.shading == Shading::Normals { normal } else { normal.flipped(other) };
        let mut odd = is_odd.to_bitmask();
        while odd != 0 {
            let i = odd.trailing_zeros() as usize;
            odd &= odd - 1;
            let hit = self.hit(wanted[i].face, wanted[i].at[0], wanted[i].at[1]);
            self.one_by_one(&hit, i, &mut places);
        }
        places
    }

    /// Shades one point on a clipped face, or on one without a valid normal.
    #[cold]
    fn one_by_one(&self, hit: &SurfacePoint<'_>, i: usize, places: &mut PointLanes) {
        for k in 0..3 {
            places.b[k].as_mut_array()[i] = hit.b[k];
        }
        places.at.set(i, self.place(hit));
        places.normal.set(
            i,
            match self.shading {
                Shading::Flat => self.face_normal(hit),
                Shading::Normals => self.own_normal(hit),
                _ => self.normal(hit),
            },
        );
    }

    /// Returns the directions to the eye, of unit length.
    #[inline(always)]
    fn to_eyes(&self, at: Vec3Lanes) -> Vec3Lanes {
        if self.projection.is_perspective {
            at.times(f32x4::splat(-1.0) / at.dot(at.0).sqrt())
        } else {
            Vec3Lanes::splat(Vec3::Z)
        }
    }

    /// Shades a plain surface under the lights.
    #[inline(always)]
    fn lit(&self, albedo: Vec3Lanes, n: Vec3Lanes, at: Vec3Lanes) -> Vec3Lanes {
        let (zero, one) = (f32x4::splat(0.0), f32x4::splat(1.0));
        let to_eye = self.to_eyes(at);
        let twice = n.dot(to_eye.0) * 2.0;
        let mirrored = n.times(twice).plus(to_eye.times(-one));
        let above = n.dot(self.up.to_array().map(f32x4::splat)) * 0.5 + 0.5;
        let mut diffuse = [0, 1, 2].map(|k| above * (self.above[k] - self.below[k]) + self.below[k]);
        let mut specular = [zero; 3];
        for light in &self.lights {
            let (to_light, color) = match light.place {
                LightPosition::Far { to_light } => {
                    (Vec3Lanes::splat(to_light), Vec3Lanes::splat(light.color))
                }
                LightPosition::Near { .. } => {
                    let all: [(Vec3, Vec3); 4] = std::array::from_fn(|i| self.light_at(light, at.one(i)));
                    (Vec3Lanes::of(all.map(|l| l.0)), Vec3Lanes::of(all.map(|l| l.1)))
                }
            };
            let along = n.dot(to_light.0);
            let is_lit = along.simd_gt(zero);
            let along = is_lit & along;
            let mut g = is_lit & mirrored.dot(to_light.0).fast_max(zero);
            (0..SPECULAR_SQUARINGS).for_each(|_| g = g * g);
            for k in 0..3 {
                diffuse[k] += color.0[k] * along;
                specular[k] += color.0[k] * g;
            }
        }
        Vec3Lanes([0, 1, 2].map(|k| albedo.0[k] * diffuse[k] + specular[k] * SPECULAR_STRENGTH))
    }

    /// Shades a plain surface at one point.
    pub(super) fn lit_one(&self, albedo: Vec3, n: Vec3, hit: &SurfacePoint<'_>) -> Vec3 {
        self.lit(Vec3Lanes::splat(albedo), Vec3Lanes::splat(n), Vec3Lanes::splat(self.place(hit))).one(0)
    }
}

/// Returns face normals towards the counter-clockwise side, in mesh coordinates; not normalized, but never
/// long.
#[inline(always)]
fn outer_normals(placed: &ProjectedMesh<'_>, vertices: [[usize; 3]; 4]) -> Vec3Lanes {
    let (p, q) = match placed.drawn.mesh.positions() {
        Positions::F32(all) => {
            // Halved first: a difference may overflow.
            let corner =
                |k: usize| Vec3Lanes::of(vertices.map(|v| Vec3::from(all[v[k]]))).times(f32x4::splat(0.5));
            let [a, b, c] = [corner(0), corner(1), corner(2)];
            let from = a.times(f32x4::splat(-1.0));
            (b.plus(from), c.plus(from))
        }
        Positions::F64(all) => {
            let along = |k: usize| {
                Vec3Lanes::of(vertices.map(|v| {
                    let [a, b, c] = [0, 1, 2].map(|k| glam::DVec3::from(all[v[k]]));
                    let largest = (b - a).abs().max((c - a).abs()).max_element();
                    (([b, c][k] - a) / largest).as_vec3()
                }))
            };
            (along(0), along(1))
        }
    };
    let size = |v: Vec3Lanes| v.0[0].abs().fast_max(v.0[1].abs()).fast_max(v.0[2].abs());
    let per_size = f32x4::splat(1.0) / size(p).fast_max(size(q));
    p.times(per_size).cross(q.times(per_size))
}
