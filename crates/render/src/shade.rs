//! Shading of a face at a point of the screen.

mod material;
mod simd;

use std::sync::Arc;

use glam::{DVec3, Mat3, Vec3};
use lodsmith_core::model::VertexColors;
use lodsmith_core::{Image, WedgeId};

use crate::environment::Environment;
use crate::light::LightKind;
use crate::linear;
use crate::look::Shading;
use crate::projection::Projection;
use crate::raster::{Corner, ProjectedMesh, Screen};
use crate::subject::{ShapeNormals, Subject};
use crate::view::View;

pub(crate) use simd::Batch;

/// Height of a triangle in pixels from which its lines have full strength; on smaller ones they would cover
/// everything. (By eye.)
const WIRE_FULL_PX: f32 = 8.0;
/// Minimum strength of lines, for vanishing triangles.
const WIRE_MIN_STRENGTH: f32 = 0.04;

/// A light in view coordinates.
struct ViewLight {
    color: Vec3,
    place: LightPosition,
}

enum LightPosition {
    Far { to_light: Vec3 },
    Near { at: Vec3, cone: Option<(Vec3, f32, f32)> },
}

/// All data needed for shading.
pub(crate) struct Shader<'a> {
    screen: &'a Screen<'a>,
    projection: &'a Projection,
    subject: &'a Subject,
    shading: Shading,
    /// Half the picture at distance 1 and the size of one pixel there, in view units: horizontal, then
    /// vertical.
    per_pixel: [f32; 4],
    meshes: Vec<PartShading<'a>>,
    lights: Vec<ViewLight>,
    above: Vec3,
    below: Vec3,
    /// World up in view coordinates.
    up: Vec3,
    /// Radius of the model in view units.
    radius: f32,
    surface: Vec3,
    wire: Option<(Vec3, f32, f32)>,
    matcap: Option<Arc<Image>>,
    environment: Option<Arc<Environment>>,
    heat: HeatColors,
}

/// The colours of a heat map.
struct HeatColors {
    map: crate::ColorMap,
    low: f32,
    high: f32,
    brush: Option<[f32; 2]>,
}

/// Linear grey of values outside [`Look::heat_brush`](crate::Look::heat_brush). (By eye.)
const UNBRUSHED: f32 = 0.13;
/// Brightness of a heat map where the surface is seen edge-on, relative to where it faces the eye: dark
/// enough to show the shape, bright enough to read the colour. (By eye.)
const HEAT_EDGE_LIGHT: f32 = 0.35;

/// Per-part shading data.
struct PartShading<'a> {
    normals: Normals<'a>,
    to_view: Mat3,
    is_mirrored: bool,
}

#[derive(Clone, Copy)]
enum Normals<'a> {
    None,
    OfWedges(&'a [[f32; 3]]),
    OfVertices(&'a [[f32; 3]]),
    /// Normals at the corners of each face.
    OfCorners(&'a [[[f32; 3]; 3]]),
}

/// A point on a face.
struct SurfacePoint<'a> {
    part: usize,
    placed: &'a ProjectedMesh<'a>,
    face: usize,
    wedges: [WedgeId; 3],
    at: [f32; 2],
    corners: [Corner; 3],
    /// Barycentric coordinates on the screen, and the nearness; invalid for clipped faces.
    l: [f32; 3],
    near: f32,
    /// Barycentric coordinates on the face in space.
    b: [f32; 3],
    /// True if the front face (counter-clockwise) is seen.
    is_front: bool,
}

impl<'a> Shader<'a> {
    pub(crate) fn new(screen: &'a Screen<'a>, subject: &'a Subject, view: &View) -> Self {
        let look = &view.look;
        let projection = &screen.projection;
        let needs_normals = look.shading != Shading::Flat;
        let crease_deg = if needs_normals { subject.crease_deg() } else { None };
        let shaded = |placed: &'a ProjectedMesh<'a>| PartShading {
            normals: match placed.drawn.mesh.normals() {
                _ if !needs_normals => Normals::None,
                Some(own) => Normals::OfWedges(own),
                None => match placed.drawn.shape_normals(crease_deg) {
                    ShapeNormals::OfVertices(all) => Normals::OfVertices(all),
                    ShapeNormals::OfCorners(all) => Normals::OfCorners(all),
                },
            },
            to_view: placed.to_view.of_normals(),
            is_mirrored: placed.to_view.is_mirrored(),
        };
        let [radius, centre] = extent(subject, projection);
        let place = |p: Vec3, in_world: bool| {
            let turned = if in_world { projection.direction(p.as_dvec3()) } else { p };
            centre + turned * radius.x
        };
        let turned = |d: Vec3, in_world: bool| {
            let d = if in_world { projection.direction(d.as_dvec3()) } else { d };
            d.normalize_or(Vec3::Z)
        };
        let lights = view.lighting.lights.iter().map(|light| {
            let place = match light.kind {
                LightKind::Directional { to_light } => {
                    LightPosition::Far { to_light: turned(to_light, light.in_world) }
                }
                LightKind::Point { at } => LightPosition::Near { at: place(at, light.in_world), cone: None },
                LightKind::Spot { at, toward, half_angle_rad } => {
                    let at_view = place(at, light.in_world);
                    let along = (place(toward, light.in_world) - at_view).normalize_or(Vec3::NEG_Z);
                    let (inner, outer) = ((0.8 * half_angle_rad).cos(), half_angle_rad.cos());
                    LightPosition::Near { at: at_view, cone: Some((along, inner, outer)) }
                }
            };
            ViewLight { color: Vec3::from(light.color), place }
        });
        let ([half_x, half_y], [across, down]) = (projection.half, projection.size);
        let factor = if view.fine { 2.0 } else { 1.0 };
        let [r, g, b, opacity] = look.wire;
        let width = look.wire_width_px * factor;
        let is_wired = look.wireframe && opacity > 0.0 && width > 0.0;
        let needs_range = look.shading == Shading::Heat;
        let [low, high] = if needs_range { subject.heat_range(look.heat_range) } else { [0.0; 2] };
        Self {
            screen,
            projection,
            subject,
            shading: look.shading,
            per_pixel: [half_x, 2.0 * half_x / across, half_y, 2.0 * half_y / down].map(|x| x as f32),
            meshes: screen.placed.iter().map(shaded).collect(),
            lights: lights.collect(),
            above: Vec3::from(view.lighting.ambient.above),
            below: Vec3::from(view.lighting.ambient.below),
            up: projection.direction(DVec3::Y),
            radius: radius.x,
            surface: linear::of_srgb(look.surface),
            wire: is_wired.then(|| (linear::of_srgb([r, g, b]), opacity.min(1.0), width)),
            matcap: view.matcap.clone().filter(|m| !m.pixels().is_empty()),
            environment: view.environment.clone(),
            heat: HeatColors { map: look.color_map, low, high, brush: look.heat_brush },
        }
    }

    /// Returns linear colour and opacity of a face at a point of the screen, from its material.
    pub(crate) fn color(&self, whole: u32, x: f32, y: f32) -> [f32; 4] {
        let hit = self.hit(whole, x, y);
        let (color, alpha) = self.textured(&hit);
        self.wired(color, alpha, || hit)
    }

    /// Draws the wireframe of a face over its colour.
    #[inline(always)]
    fn wired<'h>(&self, mut color: Vec3, alpha: f32, hit: impl FnOnce() -> SurfacePoint<'h>) -> [f32; 4] {
        let Some((wire, opacity, width)) = self.wire else { return [color.x, color.y, color.z, alpha] };
        let (distance, strength) = self.to_side(&hit());
        let cover = (0.5 * width + 0.5 - distance).clamp(0.0, 1.0) * opacity * strength;
        color += (wire - color) * cover;
        [color.x, color.y, color.z, alpha + (1.0 - alpha) * cover]
    }

    /// Returns the index of the part that contains a face of the whole picture.
    #[inline(always)]
    fn part_of(&self, whole: u32) -> usize {
        let placed = &self.screen.placed;
        if placed.len() == 1 { 0 } else { placed.partition_point(|p| p.first_face <= whole) - 1 }
    }

    #[inline(always)]
    fn hit(&self, whole: u32, x: f32, y: f32) -> SurfacePoint<'_> {
        let part = self.part_of(whole);
        let placed = &self.screen.placed[part];
        let face = (whole - placed.first_face) as usize;
        let wedges = placed.drawn.mesh.triangles()[face];
        let corners = wedges.map(|w| placed.corners[placed.drawn.mesh.vertex_of(w).index()]);
        let mut hit = SurfacePoint {
            part,
            placed,
            face,
            wedges,
            at: [x, y],
            corners,
            l: on_screen(&corners, x, y),
            near: 0.0,
            b: [0.0; 3],
            is_front: true,
        };
        let products = [0, 1, 2].map(|k| hit.l[k] * corners[k][2]);
        hit.near = products[0] + products[1] + products[2];
        hit.b = if ProjectedMesh::is_cut(&corners) || hit.near <= 0.0 {
            self.barycentrics(&hit, x, y)
        } else if self.projection.is_perspective {
            let per_near = 1.0 / hit.near;
            products.map(|p| p * per_near)
        } else {
            hit.l
        };
        let is_clockwise = if ProjectedMesh::is_cut(&corners) {
            let [a, b, c] = placed.in_view(face);
            let along = if self.projection.is_perspective { a } else { DVec3::NEG_Z };
            (b - a).cross(c - a).dot(along) > 0.0
        } else {
            doubled_area(&corners) > 0.0
        };
        hit.is_front = is_clockwise == self.meshes[part].is_mirrored;
        hit
    }

    /// Returns barycentric coordinates on the face in space for a point of the screen, which may lie outside
    /// the face.
    #[inline(always)]
    fn barycentrics(&self, hit: &SurfacePoint<'_>, x: f32, y: f32) -> [f32; 3] {
        if ProjectedMesh::is_cut(&hit.corners) {
            let corners = hit.placed.in_view(hit.face);
            return self.projection.barycentrics(corners, f64::from(x), f64::from(y)).map(|b| b as f32);
        }
        let on_screen = on_screen(&hit.corners, x, y);
        if !self.projection.is_perspective {
            return on_screen;
        }
        let b = [0, 1, 2].map(|k| on_screen[k] * hit.corners[k][2]);
        let sum = b[0] + b[1] + b[2];
        if sum > 0.0 { b.map(|b| b / sum) } else { on_screen }
    }

    /// Returns the distance to the nearest side of the face in pixels, and the strength of its lines.
    fn to_side(&self, hit: &SurfacePoint<'_>) -> (f32, f32) {
        let strength = |height: f32| ((height - 0.7) / WIRE_FULL_PX).clamp(WIRE_MIN_STRENGTH, 1.0);
        let [x, y] = hit.at;
        if ProjectedMesh::is_cut(&hit.corners) {
            // From the change of the barycentric coordinates per pixel.
            let (right, below) = (self.barycentrics(hit, x + 1.0, y), self.barycentrics(hit, x, y + 1.0));
            let distance = |k: usize| {
                let slope = (right[k] - hit.b[k]).hypot(below[k] - hit.b[k]);
                if slope > 0.0 { hit.b[k].abs() / slope } else { f32::INFINITY }
            };
            return (distance(0).min(distance(1)).min(distance(2)), 1.0);
        }
        let [a, b, c] = hit.corners;
        let doubled = doubled_area(&hit.corners).abs();
        let height = |p: Corner, q: Corner| doubled / (p[0] - q[0]).hypot(p[1] - q[1]).max(1e-6);
        let heights = [height(b, c), height(c, a), height(a, b)];
        let distance = |k: usize| hit.l[k].max(0.0) * heights[k];
        let least = heights[0].min(heights[1]).min(heights[2]);
        (distance(0).min(distance(1)).min(distance(2)), strength(least))
    }

    /// Returns the point in view coordinates.
    #[inline(always)]
    fn place(&self, hit: &SurfacePoint<'_>) -> Vec3 {
        let distance = if ProjectedMesh::is_cut(&hit.corners) {
            let [a, b, c] = hit.placed.in_view(hit.face).map(|p| p.z as f32);
            -(hit.b[0] * a + hit.b[1] * b + hit.b[2] * c)
        } else {
            self.projection.distance(hit.near)
        };
        let [half_x, per_x, half_y, per_y] = self.per_pixel;
        let (sx, sy) = (hit.at[0] * per_x - half_x, half_y - hit.at[1] * per_y);
        if self.projection.is_perspective {
            Vec3::new(sx, sy, -1.0) * distance
        } else {
            Vec3::new(sx, sy, -distance)
        }
    }

    /// Returns the face normal, towards the eye.
    #[inline(always)]
    fn face_normal(&self, hit: &SurfacePoint<'_>) -> Vec3 {
        let n = self.outer_face_normal(hit);
        if hit.is_front { n } else { -n }
    }

    /// Returns the face normal, towards the side that is counter-clockwise.
    #[inline(always)]
    fn outer_face_normal(&self, hit: &SurfacePoint<'_>) -> Vec3 {
        let [a, b, c] =
            hit.placed.vertices(hit.face).map(|v| hit.placed.drawn.mesh.positions().view().get(v));
        let [p, q] = [b, c].map(|e| DVec3::from(e) - DVec3::from(a));
        // Divided first to avoid overflow.
        let largest = p.abs().max(q.abs()).max_element();
        if !(largest > 0.0 && largest.is_finite()) {
            return Vec3::Z;
        }
        let n = (p / largest).cross(q / largest).normalize_or(DVec3::Z).as_vec3();
        (self.meshes[hit.part].to_view * n).normalize_or(Vec3::Z)
    }

    /// Returns the interpolated normal as given.
    #[inline(always)]
    fn own_normal(&self, hit: &SurfacePoint<'_>) -> Vec3 {
        let shaded = &self.meshes[hit.part];
        let [a, b, c] = match shaded.normals {
            Normals::None => return self.outer_face_normal(hit),
            Normals::OfWedges(all) => hit.wedges.map(|w| Vec3::from(all[w.index()])),
            Normals::OfVertices(all) => {
                hit.wedges.map(|w| Vec3::from(all[hit.placed.drawn.mesh.vertex_of(w).index()]))
            }
            Normals::OfCorners(all) => all[hit.face].map(Vec3::from),
        };
        let n = shaded.to_view * (a * hit.b[0] + b * hit.b[1] + c * hit.b[2]);
        let length_sq = n.length_squared();
        if length_sq > 1e-12 { n * (1.0 / length_sq.sqrt()) } else { self.outer_face_normal(hit) }
    }

    /// Returns the interpolated normal, on the visible side of the face.
    #[inline(always)]
    fn normal(&self, hit: &SurfacePoint<'_>) -> Vec3 {
        let n = self.own_normal(hit);
        match self.meshes[hit.part].normals {
            // Normals from a file may point to either side of a face.
            Normals::OfWedges(_) => {
                if n.dot(self.face_normal(hit)) < 0.0 {
                    -n
                } else {
                    n
                }
            }
            _ => {
                if hit.is_front {
                    n
                } else {
                    -n
                }
            }
        }
    }

    /// Returns the linear vertex colour and opacity; the look's colour if the mesh has none.
    fn vertex_color(&self, placed: &ProjectedMesh<'_>, wedges: [WedgeId; 3], l: [f32; 3]) -> (Vec3, f32) {
        let Some(colors) = placed.drawn.mesh.colors() else { return (self.surface, 1.0) };
        let [a, b, c] = wedges.map(|w| colors[w.index()]);
        let mixed = [0, 1, 2, 3].map(|k| l[0] * a[k] + l[1] * b[k] + l[2] * c[k]);
        let rgb = [mixed[0], mixed[1], mixed[2]];
        let rgb = match self.subject.vertex_colors {
            VertexColors::Linear => Vec3::from(rgb),
            VertexColors::Srgb => linear::of_srgb(rgb),
        };
        (rgb.clamp(Vec3::ZERO, Vec3::ONE), mixed[3].clamp(0.0, 1.0))
    }

    #[inline(always)]
    fn to_eye(&self, place: Vec3) -> Vec3 {
        if self.projection.is_perspective { (-place).normalize_or(Vec3::Z) } else { Vec3::Z }
    }

    /// Returns the hemispherical ambient light.
    #[inline(always)]
    fn ambient(&self, n: Vec3) -> Vec3 {
        self.below + (self.above - self.below) * (0.5 + 0.5 * n.dot(self.up))
    }

    /// Calls `with` for each light at a point, with its direction and intensity.
    #[inline(always)]
    fn each_light(&self, place: Vec3, mut with: impl FnMut(Vec3, Vec3)) {
        for light in &self.lights {
            let (to_light, color) = self.light_at(light, place);
            with(to_light, color);
        }
    }

    #[inline(always)]
    fn light_at(&self, light: &ViewLight, place: Vec3) -> (Vec3, Vec3) {
        match &light.place {
            LightPosition::Far { to_light } => (*to_light, light.color),
            LightPosition::Near { at, cone } => {
                let to = *at - place;
                let distance_sq = (to.length_squared() / (self.radius * self.radius)).max(1e-6);
                let to_light = to.normalize_or(Vec3::Z);
                let share = cone.map_or(1.0, |(along, inner, outer)| {
                    let t = ((-to_light.dot(along) - outer) / (inner - outer).max(1e-4)).clamp(0.0, 1.0);
                    t * t * (3.0 - 2.0 * t)
                });
                (to_light, light.color * (share / distance_sq))
            }
        }
    }

    fn matcap(&self, n: Vec3) -> Vec3 {
        let Some(image) = &self.matcap else { return clay(n) };
        // The rim of the sphere is not used: images of spheres are seldom cropped exactly.
        let (w, h) = (image.width(), image.height());
        let x = (0.5 + 0.49 * n.x) * w as f32 - 0.5;
        let y = (0.5 - 0.49 * n.y) * h as f32 - 0.5;
        let pixel = |i: f32, j: f32| {
            let at = |v: f32, n: usize| (v.max(0.0) as usize).min(n - 1);
            let [r, g, b, _] = image.at(at(i, w), at(j, h));
            Vec3::new(linear::of_byte(r), linear::of_byte(g), linear::of_byte(b))
        };
        let (x0, y0) = (x.floor(), y.floor());
        let upper = pixel(x0, y0).lerp(pixel(x0 + 1.0, y0), x - x0);
        let lower = pixel(x0, y0 + 1.0).lerp(pixel(x0 + 1.0, y0 + 1.0), x - x0);
        upper.lerp(lower, y - y0)
    }

    fn heat(&self, placed: &ProjectedMesh<'_>, wedges: [WedgeId; 3], l: [f32; 3]) -> Vec3 {
        let HeatColors { map, low, high, brush } = self.heat;
        let Some(values) = &placed.drawn.values else { return self.surface };
        let [a, b, c] = wedges.map(|w| values[placed.drawn.mesh.vertex_of(w).index()]);
        let value = l[0] * a + l[1] * b + l[2] * c;
        if brush.is_some_and(|[from, to]| value < from || value > to) {
            return Vec3::splat(UNBRUSHED);
        }
        let span = high - low;
        let t = if span > 0.0 { (value - low) / span } else { value * 0.0 };
        linear::of_srgb(map.color(t))
    }
}

/// Returns the radius and the centre of the subject in view coordinates.
fn extent(subject: &Subject, projection: &Projection) -> [Vec3; 2] {
    match subject.bounds() {
        None => [Vec3::ONE, Vec3::NEG_Z],
        Some(b) => {
            let [min, max] = [b.min, b.max].map(|p| projection.place(DVec3::from(p)));
            let radius = (0.5 * max - 0.5 * min).length().max(1e-12) as f32;
            [Vec3::splat(radius), (0.5 * min + 0.5 * max).as_vec3()]
        }
    }
}

/// Returns twice the signed area on the screen, where y points down: positive if the corners are clockwise.
#[inline(always)]
fn doubled_area([a, b, c]: &[Corner; 3]) -> f32 {
    (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])
}

/// Returns barycentric coordinates on the screen.
#[inline(always)]
fn on_screen(corners: &[Corner; 3], x: f32, y: f32) -> [f32; 3] {
    let [a, b, c] = corners;
    let doubled = doubled_area(corners);
    if doubled == 0.0 {
        return [1.0 / 3.0; 3];
    }
    let per_area = 1.0 / doubled;
    let l1 = ((c[1] - a[1]) * (x - a[0]) - (c[0] - a[0]) * (y - a[1])) * per_area;
    let l2 = ((b[0] - a[0]) * (y - a[1]) - (b[1] - a[1]) * (x - a[0])) * per_area;
    [1.0 - l1 - l2, l1, l2]
}

/// A procedural clay sphere lit by a window; chosen by eye.
fn clay(n: Vec3) -> Vec3 {
    let key = n.dot(Vec3::new(-0.42, 0.62, 0.66)).max(0.0);
    let fill = n.dot(Vec3::new(0.80, -0.15, 0.58)).max(0.0);
    let rim = (1.0 - n.z.clamp(0.0, 1.0)).powi(3);
    let specular = n.dot(Vec3::new(-0.26, 0.38, 0.886)).max(0.0).powi(40);
    let shade = Vec3::new(0.050, 0.030, 0.027);
    shade
        + Vec3::new(0.62, 0.31, 0.19) * key * key.sqrt()
        + Vec3::new(0.05, 0.07, 0.12) * fill
        + Vec3::new(0.13, 0.12, 0.14) * rim
        + Vec3::splat(0.16) * specular
}
