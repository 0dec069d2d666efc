//! Projection from model coordinates to the screen.

use glam::{DMat3, DMat4, DVec3, Vec3};
use wide::f32x4;

use crate::camera::{Camera, Lens, length};
use crate::view::RenderError;

/// Near plane, as a fraction of the distance from the eye to the target. (Guessed: depths are reciprocal, so
/// it costs no precision.)
const NEAR_PLANE: f64 = 1e-4;
/// Points beyond this many pixels are clipped: edge functions of triangles are exact enough up to there.
const GUARD_BAND_PX: f64 = 16384.0;

/// A camera with a picture size. *View* coordinates are camera coordinates in units of the distance to the
/// target: there single precision is enough, wherever in the world the model lies.
#[derive(Clone, Debug)]
pub(crate) struct Projection {
    target: DVec3,
    /// Rows: right, up, back.
    axes: DMat3,
    /// Length of one view unit, in model units.
    pub(crate) unit: f64,
    /// Half the picture at distance 1, in view units.
    pub(crate) half: [f64; 2],
    pub(crate) size: [f64; 2],
    /// Pixels per view unit at distance 1.
    per_unit: [f64; 2],
    pub(crate) is_perspective: bool,
}

/// Transform from a mesh to view coordinates: rotated and scaled, then translated.
#[derive(Clone, Copy, Debug)]
pub(crate) struct ToView {
    pub(crate) linear: DMat3,
    pub(crate) shift: DVec3,
}

impl ToView {
    #[inline(always)]
    pub(crate) fn of(&self, p: DVec3) -> DVec3 {
        self.linear * p + self.shift
    }
    /// Returns the transform of normals, which does not normalize.
    pub(crate) fn of_normals(&self) -> glam::Mat3 {
        // Adjugate, not inverse, which does not exist for a flattening scale. Divided first to avoid
        // overflow.
        let largest = self.linear.to_cols_array().iter().fold(0f64, |m, x| m.max(x.abs()));
        let m = if largest > 0.0 { self.linear * (1.0 / largest) } else { DMat3::IDENTITY };
        let [a, b, c] = [m.x_axis, m.y_axis, m.z_axis];
        let turned = DMat3::from_cols(b.cross(c), c.cross(a), a.cross(b));
        let sign = if self.is_mirrored() { -1.0 } else { 1.0 };
        (turned * sign).as_mat3()
    }
    /// True if the transform mirrors.
    pub(crate) fn is_mirrored(&self) -> bool {
        let m = self.linear;
        let largest = m.to_cols_array().iter().fold(0f64, |m, x| m.max(x.abs()));
        largest > 0.0 && (m * (1.0 / largest)).determinant() < 0.0
    }
}

/// Transform from mesh positions in single precision to the screen.
pub(crate) struct ToScreen {
    origin: [f32; 3],
    rows: [[f32; 3]; 3],
    shift: [f32; 3],
    per_unit: [f32; 2],
    middle: [f32; 2],
    is_perspective: bool,
}

impl ToScreen {
    /// As [`Projection::on_screen`], with an unused fourth component.
    #[inline(always)]
    pub(crate) fn of_four(&self, places: [[f32; 3]; 4]) -> [[f32; 4]; 4] {
        let p = [0, 1, 2].map(|k| f32x4::from(places.map(|p| p[k])) - self.origin[k]);
        let view = |row: usize| {
            let [a, b, c] = self.rows[row];
            p[0] * a + p[1] * b + p[2] * c + self.shift[row]
        };
        let (vx, vy, vz) = (view(0), view(1), view(2));
        let one = f32x4::splat(1.0);
        let per_distance = if self.is_perspective { -one / vz } else { one };
        let near = if self.is_perspective { per_distance } else { one + vz };
        let x = vx * per_distance * self.per_unit[0] + self.middle[0];
        let y = -vy * per_distance * self.per_unit[1] + self.middle[1];
        let farthest = f32x4::splat(GUARD_BAND_PX as f32);
        let is_seen = (-vz).simd_gt(f32x4::splat(NEAR_PLANE as f32))
            & x.abs().simd_lt(farthest)
            & y.abs().simd_lt(farthest);
        let x = is_seen.select(x, f32x4::splat(f32::NAN));
        f32x4::transpose([x, y, near, one]).map(f32x4::to_array)
    }
}

impl Projection {
    pub(crate) fn new(camera: &Camera, width: usize, height: usize) -> Result<Self, RenderError> {
        let numbers = [camera.eye, camera.target, camera.up];
        let unit = length(camera.eye - camera.target);
        if numbers.iter().any(|v| !v.is_finite()) || !(unit > 0.0 && unit.is_finite()) {
            return Err(RenderError::Camera { what: "its eye and target coincide or are not finite" });
        }
        let aspect = width as f64 / height as f64;
        let (half_height, is_perspective) = match camera.lens {
            Lens::Perspective { fov_y_rad } if fov_y_rad > 0.0 && fov_y_rad < 3.1 => {
                ((0.5 * fov_y_rad).tan(), true)
            }
            Lens::Parallel { height } if height > 0.0 && height.is_finite() => (0.5 * height / unit, false),
            _ => {
                return Err(RenderError::Camera {
                    what: "its lens has an angle of view or a height out of range",
                });
            }
        };
        let [right, up, back] = camera.axes();
        let half = [half_height * aspect, half_height];
        let size = [width as f64, height as f64];
        Ok(Self {
            target: camera.target,
            axes: DMat3::from_cols(right, up, back).transpose(),
            unit,
            half,
            size,
            per_unit: [0, 1].map(|k| 0.5 * size[k] / half[k]),
            is_perspective,
        })
    }

    pub(crate) fn to_view(&self, world_from_mesh: &DMat4) -> ToView {
        let linear = DMat3::from_mat4(*world_from_mesh);
        // The target is subtracted first: far from the origin this keeps the remaining digits.
        let origin = (world_from_mesh.w_axis.truncate() - self.target) / self.unit;
        let shift = self.axes * origin - DVec3::Z;
        ToView { linear: self.axes * (linear * (1.0 / self.unit)), shift }
    }

    /// Transforms a direction from the world to the view.
    pub(crate) fn direction(&self, world: DVec3) -> Vec3 {
        (self.axes * world).as_vec3()
    }
    /// Transforms a direction from the view to the world.
    pub(crate) fn direction_to_world(&self, view: Vec3) -> Vec3 {
        (self.axes.transpose() * view.as_dvec3()).as_vec3()
    }
    /// Transforms a point from the world to the view.
    pub(crate) fn place(&self, world: DVec3) -> DVec3 {
        self.axes * ((world - self.target) / self.unit) - DVec3::Z
    }

    /// Divisor of the projection: the distance for a perspective, else 1.
    #[inline(always)]
    fn divisor(&self, view: DVec3) -> f64 {
        if self.is_perspective { -view.z } else { 1.0 }
    }

    /// Projects a view point to the screen, with its nearness: larger is nearer, and linear on the screen.
    /// `None` if it is behind the eye, too far outside, or not finite.
    pub(crate) fn screen(&self, view: DVec3) -> Option<[f64; 3]> {
        let at = self.on_screen(view);
        (!at[0].is_nan()).then_some(at)
    }

    /// Like [`Projection::screen`], but the first component is NaN if there is no such point.
    #[inline(always)]
    pub(crate) fn on_screen(&self, view: DVec3) -> [f64; 3] {
        let per_distance = 1.0 / self.divisor(view);
        let near = if self.is_perspective { per_distance } else { 1.0 + view.z };
        let x = view.x * per_distance * self.per_unit[0] + 0.5 * self.size[0];
        let y = 0.5 * self.size[1] - view.y * per_distance * self.per_unit[1];
        let is_seen = (-view.z > NEAR_PLANE) & (x.abs() < GUARD_BAND_PX) & (y.abs() < GUARD_BAND_PX);
        [if is_seen { x } else { f64::NAN }, y, near]
    }

    /// Returns the single-precision transform from a mesh to the screen; `None` if it needs double precision.
    pub(crate) fn to_screen(&self, to_view: &ToView) -> Option<ToScreen> {
        let linear = to_view.linear;
        // The target in mesh coordinates: it is subtracted first, so that points near it keep their single
        // precision.
        let inverse = linear.inverse();
        let origin = inverse * (DVec3::NEG_Z - to_view.shift);
        let size = |m: DMat3| m.to_cols_array().iter().fold(0f64, |s, x| s.max(x.abs()));
        let is_plain = size(linear) * size(inverse) < 1e4 && (1e-30..1e30).contains(&size(linear));
        let origin = origin.as_vec3();
        let shift = linear * origin.as_dvec3() + to_view.shift;
        if !is_plain || !shift.is_finite() || length(shift) > 4.0 {
            return None;
        }
        Some(ToScreen {
            origin: origin.to_array(),
            rows: [0, 1, 2].map(|k| linear.row(k).as_vec3().to_array()),
            shift: shift.as_vec3().to_array(),
            per_unit: self.per_unit.map(|x| x as f32),
            middle: self.size.map(|x| 0.5 * x as f32),
            is_perspective: self.is_perspective,
        })
    }

    /// Returns the ray through a point of the screen at distance 1: origin and direction.
    pub(crate) fn ray(&self, x: f64, y: f64) -> [DVec3; 2] {
        let sx = (2.0 * x / self.size[0] - 1.0) * self.half[0];
        let sy = (1.0 - 2.0 * y / self.size[1]) * self.half[1];
        if self.is_perspective {
            [DVec3::ZERO, DVec3::new(sx, sy, -1.0)]
        } else {
            [DVec3::new(sx, sy, 0.0), DVec3::NEG_Z]
        }
    }

    /// Converts nearness to the distance from the eye along the view.
    #[inline(always)]
    pub(crate) fn distance(&self, near: f32) -> f32 {
        if self.is_perspective { 1.0 / near } else { 1.0 - near }
    }

    /// Returns the barycentric coordinates of the point where the ray through a point of the screen meets the
    /// plane of a triangle in the view.
    pub(crate) fn barycentrics(&self, corners: [DVec3; 3], x: f64, y: f64) -> [f64; 3] {
        let [origin, along] = self.ray(x, y);
        // Each is the volume spanned by the ray and a side; with a parallel lens all rays meet at infinity.
        let v = corners.map(|c| if self.is_perspective { c } else { DVec3::new(c.x, c.y, -1.0) });
        let d = if self.is_perspective { along } else { DVec3::new(origin.x, origin.y, -1.0) };
        let all = [v[1].cross(v[2]).dot(d), v[2].cross(v[0]).dot(d), v[0].cross(v[1]).dot(d)];
        let sum = all[0] + all[1] + all[2];
        if sum != 0.0 && sum.is_finite() { all.map(|b| b / sum) } else { [1.0 / 3.0; 3] }
    }

    /// Clips a triangle to the part before the eye and not too far outside, as a polygon on the screen.
    pub(crate) fn clipped(&self, corners: [DVec3; 3]) -> Vec<[f64; 3]> {
        if corners.iter().any(|c| !c.is_finite()) {
            return Vec::new();
        }
        let mut polygon = corners.to_vec();
        let aside = [0, 1].map(|k| 0.9 * GUARD_BAND_PX / self.size[k] * 2.0 * self.half[k]);
        let inside = |plane: usize, p: DVec3| {
            let w = self.divisor(p);
            match plane {
                0 => -p.z - 2.0 * NEAR_PLANE,
                1 => aside[0] * w - p.x,
                2 => aside[0] * w + p.x,
                3 => aside[1] * w - p.y,
                _ => aside[1] * w + p.y,
            }
        };
        for plane in 0..5 {
            let mut kept = Vec::with_capacity(polygon.len() + 1);
            for (i, &p) in polygon.iter().enumerate() {
                let q = polygon[(i + 1) % polygon.len()];
                let [a, b] = [inside(plane, p), inside(plane, q)];
                if a >= 0.0 {
                    kept.push(p);
                }
                if (a >= 0.0) != (b >= 0.0) {
                    // Always from the inner end, so that neighbours compute the same point.
                    let (from, to, a, b) = if a >= 0.0 { (p, q, a, b) } else { (q, p, b, a) };
                    kept.push(from + (to - from) * (a / (a - b)));
                }
            }
            polygon = kept;
        }
        polygon.into_iter().filter_map(|p| self.screen(p)).collect()
    }
}
