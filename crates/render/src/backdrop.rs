//! Background, environment and ground plane of a picture.

use std::sync::Arc;

use glam::{DVec3, Vec3};

use crate::camera::{Camera, Lens, length};
use crate::environment::Environment;
use crate::linear::over;
use crate::linear::{self, Encoder};
use crate::look::Background;
use crate::projection::Projection;
use crate::raster::nearness;
use crate::subject::Subject;
use crate::view::{RenderError, View};

/// Pixels along a side of the shadow map.
const SHADOW_MAP_SIZE: usize = 192;
/// Half the side of the area that the shadow map covers, in radii of the model.
const SHADOW_MAP_RADII: f64 = 1.7;
/// Height in radii at which a face casts about a third of the full shadow. (By eye.)
const SHADOW_HEIGHT: f32 = 0.30;
/// Darkness of the floor at contact. (By eye.)
const SHADOW_STRENGTH: f32 = 0.62;
/// Approximate number of grid lines per radius.
const GRID_LINES_PER_RADIUS: f64 = 4.0;
/// Half the height of the part of the environment that a parallel view shows, at a distance of one. (By eye.)
const PARALLEL_SKY_HALF_HEIGHT: f32 = 0.31;
/// Extent of the grid, in radii.
const GRID_RADII: f64 = 6.0;

pub(crate) struct Backdrop {
    /// Linear background colour of each row; `None` if transparent.
    rows: Option<Vec<Vec3>>,
    /// `rows` as bytes, for pixels that show only the background.
    plain: Vec<[u8; 4]>,
    floor: Option<GroundPlane>,
    sky: Option<Sky>,
}

/// The environment as a background.
struct Sky {
    environment: Arc<Environment>,
    is_blurred: bool,
    /// Right, up and back.
    axes: [Vec3; 3],
    /// Half the picture's size at a distance of one.
    half: [f32; 2],
    size: [f32; 2],
}

struct GroundPlane {
    projection: Projection,
    camera: Camera,
    height: f64,
    centre: DVec3,
    radius: f64,
    /// Spacing of the grid lines.
    step: Option<f64>,
    shadow: Option<(Projection, Vec<f32>)>,
    line: Vec3,
}

impl Backdrop {
    pub(crate) fn new(subject: &Subject, view: &View) -> Result<Self, RenderError> {
        let height = view.height;
        let sky = Sky::new(view);
        let rows = view.background.edges().map(|[upper, lower]| -> Vec<Vec3> {
            let row = |y: usize| {
                let t = (y as f32 + 0.5) / height as f32;
                linear::of_srgb([0, 1, 2].map(|k| upper[k] + (lower[k] - upper[k]) * t))
            };
            (0..height).map(row).collect()
        });
        let brightness = rows.as_ref().map_or(0.2, |r| r[height - 1].dot(Vec3::new(0.21, 0.72, 0.07)));
        let line = Vec3::splat(if brightness > 0.18 { 0.05 } else { 0.55 });
        let mut floor = None;
        if (view.ground.grid || view.ground.shadow)
            && let Some(b) = subject.bounds()
        {
            let [min, max] = [DVec3::from(b.min), DVec3::from(b.max)];
            let radius = length(0.5 * max - 0.5 * min);
            let centre = (0.5 * min + 0.5 * max).with_y(min.y);
            let is_above = view.camera.eye.y > min.y;
            if is_above && radius > 0.0 && radius.is_finite() {
                floor = Some(GroundPlane {
                    projection: Projection::new(&view.camera, view.width, height)?,
                    camera: view.camera,
                    height: min.y,
                    centre,
                    radius,
                    step: view.ground.grid.then(|| round_step(radius / GRID_LINES_PER_RADIUS)),
                    shadow: if view.ground.shadow { Some(shadow(subject, centre, radius)?) } else { None },
                    line,
                });
            }
        }
        let encoder = Encoder::new();
        let plain = match &rows {
            None => vec![[0; 4]; height],
            Some(rows) => {
                let opaque = |[r, g, b]: [u8; 3]| [r, g, b, 255];
                rows.iter().map(|&row| opaque(encoder.bytes(row))).collect()
            }
        };
        Ok(Self { rows, plain, floor, sky })
    }

    /// Composes a pixel: what was drawn, over the background.
    #[inline(always)]
    pub(crate) fn over(&self, color: [f32; 4], x: usize, y: usize, encoder: Encoder) -> [u8; 4] {
        if color[3] >= 1.0 {
            let [r, g, b] = encoder.bytes(Vec3::new(color[0], color[1], color[2]));
            return [r, g, b, 255];
        }
        if color[3] == 0.0 && self.floor.is_none() && self.sky.is_none() {
            return self.plain[y];
        }
        let of_light = |Vec3 { x, y, z }| [x, y, z, 1.0];
        let mut behind = match (&self.sky, &self.rows) {
            (Some(sky), _) => of_light(sky.light(x, y)),
            (None, Some(rows)) => of_light(rows[y]),
            (None, None) => [0.0; 4],
        };
        if let Some(floor) = &self.floor {
            floor.draw(x, y, &mut behind);
        }
        over(color, &mut behind);
        let [r, g, b, a] = behind;
        if a >= 1.0 - 1e-4 {
            let [r, g, b] = encoder.bytes(Vec3::new(r, g, b));
            return [r, g, b, 255];
        }
        if a <= 0.0 {
            return [0; 4];
        }
        let [r, g, b] = encoder.bytes(Vec3::new(r, g, b) / a);
        [r, g, b, (a * 255.0).round() as u8]
    }
}

impl Sky {
    fn new(view: &View) -> Option<Self> {
        let (Background::Environment { blurred: is_blurred }, Some(environment)) =
            (view.background, view.environment.clone())
        else {
            return None;
        };
        let size = [view.width, view.height].map(|x| x as f32);
        let half_height = match view.camera.lens {
            Lens::Perspective { fov_y_rad } => (0.5 * fov_y_rad).tan() as f32,
            // Parallel rays would all see the same colour.
            Lens::Parallel { .. } => PARALLEL_SKY_HALF_HEIGHT,
        };
        let axes = view.camera.axes().map(|a| a.as_vec3());
        let half = [half_height * size[0] / size[1], half_height];
        Some(Self { environment, is_blurred, axes, half, size })
    }

    fn light(&self, x: usize, y: usize) -> Vec3 {
        let [right, up, back] = self.axes;
        let across = (2.0 * (x as f32 + 0.5) / self.size[0] - 1.0) * self.half[0];
        let along = (1.0 - 2.0 * (y as f32 + 0.5) / self.size[1]) * self.half[1];
        let light = self
            .environment
            .seen((right * across + up * along - back).normalize_or(Vec3::Y), self.is_blurred);
        light.min(Vec3::ONE)
    }
}

impl GroundPlane {
    fn draw(&self, x: usize, y: usize, behind: &mut [f32; 4]) {
        let (x, y) = (x as f64 + 0.5, y as f64 + 0.5);
        let Some(at) = self.hit(x, y) else { return };
        let away = length(at - self.centre) / self.radius;
        if away > GRID_RADII {
            return;
        }
        if let Some((projection, map)) = &self.shadow
            && let Some([u, v, _]) = projection.screen(projection.place(at))
        {
            let dark = SHADOW_STRENGTH * between(map, u as f32 - 0.5, v as f32 - 0.5);
            over([0.0, 0.0, 0.0, dark], behind);
        }
        if let Some(step) = self.step {
            let (Some(right), Some(below)) = (self.hit(x + 1.0, y), self.hit(x, y + 1.0)) else { return };
            let fade = (1.0 - away / GRID_RADII).powi(2) as f32;
            let mut cover = 0f32;
            for k in [0, 2] {
                let place = (at[k] - self.centre[k]) / step;
                let pixel = ((right[k] - at[k]).abs() + (below[k] - at[k]).abs()) / step;
                let nearest = (place - place.round()).abs() / pixel.max(1e-9);
                // Far away there are more lines than pixels.
                let dense = (1.0 - 2.0 * pixel).clamp(0.0, 1.0);
                cover = cover.max(((1.0 - nearest).clamp(0.0, 1.0) * dense) as f32);
            }
            let c = 0.35 * cover * fade;
            over([self.line.x * c, self.line.y * c, self.line.z * c, c], behind);
        }
    }

    /// Returns the point where the ray through a point of the picture meets the floor.
    fn hit(&self, x: f64, y: f64) -> Option<DVec3> {
        let [origin, along] = self.projection.ray(x, y);
        let [right, up, back] = self.camera.axes();
        let turned = |v: DVec3| right * v.x + up * v.y + back * v.z;
        let from = self.camera.eye + turned(origin) * self.projection.unit;
        let along = turned(along);
        let t = (self.height - from.y) / along.y;
        (t > 0.0 && t.is_finite()).then(|| from + along * t)
    }
}

/// Rounds to 1, 2 or 5 times a power of ten.
fn round_step(x: f64) -> f64 {
    let power = 10f64.powf(x.log10().floor());
    let digit = x / power;
    power
        * if digit < 1.5 {
            1.0
        } else if digit < 3.5 {
            2.0
        } else if digit < 7.5 {
            5.0
        } else {
            10.0
        }
}

/// Computes the shadow map as seen from below: the closer a face is to the floor, the darker.
fn shadow(subject: &Subject, centre: DVec3, radius: f64) -> Result<(Projection, Vec<f32>), RenderError> {
    let camera = Camera {
        eye: centre - DVec3::Y * radius,
        target: centre,
        up: DVec3::Z,
        lens: Lens::Parallel { height: 2.0 * SHADOW_MAP_RADII * radius },
    };
    let projection = Projection::new(&camera, SHADOW_MAP_SIZE, SHADOW_MAP_SIZE)?;
    let near = nearness(subject, projection.clone(), SHADOW_MAP_SIZE, SHADOW_MAP_SIZE);
    let dark = |near: &f32| if near.is_finite() { (near.min(0.0) / SHADOW_HEIGHT).exp() } else { 0.0 };
    let mut map: Vec<f32> = near.iter().map(dark).collect();
    for reach in [7, 5, 3] {
        map = blurred(&map, SHADOW_MAP_SIZE, reach);
    }
    Ok((projection, map))
}

/// Box blur, first along rows, then along columns.
fn blurred(map: &[f32], width: usize, reach: usize) -> Vec<f32> {
    let height = map.len() / width;
    let mean = |from: &[f32], n: usize, at: &dyn Fn(usize, usize) -> usize, lines: usize| {
        let mut to = vec![0f32; from.len()];
        for line in 0..lines {
            for i in 0..n {
                let (low, high) = (i.saturating_sub(reach), (i + reach).min(n - 1));
                let sum: f32 = (low..=high).map(|j| from[at(line, j)]).sum();
                to[at(line, i)] = sum / (2 * reach + 1) as f32;
            }
        }
        to
    };
    let rows = mean(map, width, &|line, i| line * width + i, height);
    mean(&rows, height, &|line, i| i * width + line, width)
}

/// Bilinear lookup in the shadow map; zero outside.
fn between(map: &[f32], x: f32, y: f32) -> f32 {
    let at = |x: f32, y: f32| {
        let is_in = x >= 0.0 && y >= 0.0 && x < SHADOW_MAP_SIZE as f32 && y < SHADOW_MAP_SIZE as f32;
        if is_in { map[y as usize * SHADOW_MAP_SIZE + x as usize] } else { 0.0 }
    };
    let (x0, y0) = (x.floor(), y.floor());
    let upper = at(x0, y0) + (at(x0 + 1.0, y0) - at(x0, y0)) * (x - x0);
    let lower = at(x0, y0 + 1.0) + (at(x0 + 1.0, y0 + 1.0) - at(x0, y0 + 1.0)) * (x - x0);
    upper + (lower - upper) * (y - y0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn steps_are_round() {
        assert_eq!([0.012, 1.2, 1.6, 4.0, 90.0].map(round_step), [0.01, 1.0, 2.0, 5.0, 100.0]);
    }

    #[test]
    fn a_blur_spreads_and_keeps_the_sum() {
        let mut map = vec![0f32; 81];
        map[40] = 1.0;
        let soft = blurred(&map, 9, 1);
        assert!((soft.iter().sum::<f32>() - 1.0).abs() < 1e-6 && (soft[30] - 1.0 / 9.0).abs() < 1e-6);
    }
}
