//! Frame uniforms of all shaders: camera, look and lights, in the order of `globals.wgsl`.

use glam::{DMat4, DVec3, Mat4, Vec3};
use lodsmith_core::Bounds;
use lodsmith_render::{Background, Camera, Lens, LightKind, Lighting, Look};

/// Maximum number of lights in the shaders.
pub(super) const MAX_LIGHTS: usize = 8;
/// Maximum number of colour map stops in the shaders.
const MAX_COLOR_STOPS: usize = 16;
/// Near plane distance, as a fraction of the distance from the eye to the target. Depth is stored as its
/// inverse in floating point, whose relative precision is uniform, so this may be small.
const NEAR_DISTANCE: f64 = 1e-4;

/// View transform of the GPU: camera coordinates divided by the distance from the camera to its target.
#[derive(Clone, Copy, Debug)]
pub(super) struct ViewTransform {
    pub(super) view_from_world: DMat4,
    pub(super) clip_from_view: Mat4,
    /// Half-width and half-height of the picture: at distance 1 in a perspective view, at any distance in a
    /// parallel one.
    pub(super) half: [f64; 2],
    pub(super) perspective: bool,
    unit: f64,
}

impl ViewTransform {
    /// Returns the view of a camera; `reach` is the largest distance from the eye that a parallel view must
    /// cover.
    pub(super) fn new(camera: &Camera, aspect: f64, reach: f64) -> Self {
        let distance = camera.distance();
        let unit = if distance > 0.0 && distance.is_finite() { distance } else { 1.0 };
        let view_from_world = DMat4::from_scale(DVec3::splat(unit.recip())) * camera.view_from_world();
        let (half, clip_from_view, perspective) = match camera.lens {
            Lens::Perspective { fov_y_rad } => {
                let half_height = (0.5 * fov_y_rad).tan();
                let half = [half_height * aspect, half_height];
                let [x, y] = half.map(f64::recip);
                let m = DMat4::from_cols_array_2d(&[
                    [x, 0.0, 0.0, 0.0],
                    [0.0, y, 0.0, 0.0],
                    [0.0, 0.0, 0.0, -1.0],
                    [0.0, 0.0, NEAR_DISTANCE, 0.0],
                ]);
                (half, m, true)
            }
            Lens::Parallel { height } => {
                let half_height = 0.5 * height / unit;
                let half = [half_height * aspect, half_height];
                let [x, y] = half.map(f64::recip);
                let z = 0.5 / (reach / unit).max(1.0);
                let m = DMat4::from_cols_array_2d(&[
                    [x, 0.0, 0.0, 0.0],
                    [0.0, y, 0.0, 0.0],
                    [0.0, 0.0, z, 0.0],
                    [0.0, 0.0, 0.5, 1.0],
                ]);
                (half, m, false)
            }
        };
        Self { view_from_world, clip_from_view: clip_from_view.as_mat4(), half, perspective, unit }
    }

    /// Returns this view cropped to a single pixel: `x` and `y` are pixels from the upper left corner of a
    /// picture of the given size.
    pub(super) fn of_pixel(&self, [x, y]: [f32; 2], [width, height]: [u32; 2]) -> Self {
        let (w, h) = (width as f32, height as f32);
        let centre = Vec3::new(2.0 * x / w - 1.0, 1.0 - 2.0 * y / h, 0.0);
        let crop = Mat4::from_scale(Vec3::new(w, h, 1.0)) * Mat4::from_translation(-centre);
        Self { clip_from_view: crop * self.clip_from_view, ..*self }
    }

    /// Returns true if a sphere in view coordinates may be visible.
    pub(super) fn sees(&self, centre: DVec3, radius: f64) -> bool {
        if !(centre.is_finite() && radius.is_finite()) {
            return true;
        }
        let beside = |along: f64, half: f64| {
            if self.perspective {
                // Distance beyond the frustum plane.
                (along.abs() + centre.z * half) / (1.0 + half * half).sqrt() > radius
            } else {
                along.abs() - half > radius
            }
        };
        let behind = self.perspective && centre.z - radius > 0.0;
        !(behind || beside(centre.x, self.half[0]) || beside(centre.y, self.half[1]))
    }

    /// Converts a length from world to view coordinates.
    pub(super) fn length(&self, world: f64) -> f64 {
        world / self.unit
    }
}

/// Tint colours to tell models apart, in sRGB. See [`PlacedModel::tint`](super::PlacedModel::tint).
pub const TINTS: [[f32; 3]; 12] = {
    const fn rgb(hex: u32) -> [f32; 3] {
        [(hex >> 16) as f32 / 255.0, (hex >> 8 & 0xff) as f32 / 255.0, (hex & 0xff) as f32 / 255.0]
    }
    [
        rgb(0xf2f2f2),
        rgb(0xff5d5d),
        rgb(0xff9a3c),
        rgb(0xffd23f),
        rgb(0xa9d93f),
        rgb(0x3fbf63),
        rgb(0x24bcae),
        rgb(0x3aa0ff),
        rgb(0x5b6cff),
        rgb(0x9a5bff),
        rgb(0xd65bd6),
        rgb(0x8a8f96),
    ]
};

#[repr(C)]
#[derive(Clone, Copy, bytemuck::Pod, bytemuck::Zeroable)]
struct GpuLight {
    place: [f32; 4],
    toward: [f32; 4],
    color: [f32; 4],
}

/// The uniform of a frame; the same order as in `globals.wgsl`.
#[repr(C)]
#[derive(Clone, Copy, bytemuck::Pod, bytemuck::Zeroable)]
pub(super) struct Globals {
    clip_from_view: [[f32; 4]; 4],
    /// Directions of the world's axes in view coordinates.
    view_from_world_axes: [[f32; 4]; 3],
    /// Width and height in pixels; 1 for a perspective view, else 0; number of lights.
    picture: [f32; 4],
    ambient_above: [f32; 4],
    ambient_below: [f32; 4],
    surface: [f32; 4],
    wire: [f32; 4],
    /// Width of wireframe lines and of borders in pixels; 1 with backface culling; squared radius of the lit
    /// scene.
    widths: [f32; 4],
    /// Value at the lower end of the colour map; 1 / range; number of stops; 1 with a custom matcap.
    heat: [f32; 4],
    /// Values of the heat map that have their colour: from, to.
    brush: [f32; 4],
    background: [[f32; 4]; 2],
    /// Centre of the ground in view coordinates, and its grid spacing.
    ground: [f32; 4],
    /// 1 if borders are shown; 1 if defects are shown; 1 with an environment; background: 1 the environment,
    /// 2 the environment blurred.
    marks: [f32; 4],
    /// In the order of [`super::marks::COLORS`].
    mark_colors: [[f32; 4]; 4],
    tints: [[f32; 4]; TINTS.len()],
    stops: [[f32; 4]; MAX_COLOR_STOPS],
    lights: [GpuLight; MAX_LIGHTS],
}

/// Input of [`Globals::new`].
pub(super) struct GlobalsInput<'a> {
    pub(super) view: &'a ViewTransform,
    pub(super) size: [u32; 2],
    pub(super) bounds: &'a Bounds,
    pub(super) look: &'a Look,
    pub(super) lighting: &'a Lighting,
    pub(super) background: Background,
    pub(super) heat_range: [f32; 2],
    pub(super) has_matcap: bool,
    pub(super) has_environment: bool,
    /// True if borders and defects are drawn in double width.
    pub(super) marks_stand_out: bool,
    /// Pixels of the picture per pixel of the screen.
    pub(super) scale: f32,
}

impl Globals {
    pub(super) fn new(seen: &GlobalsInput<'_>) -> Self {
        let GlobalsInput { view, bounds, look, lighting, .. } = *seen;
        let axes = [DVec3::X, DVec3::Y, DVec3::Z]
            .map(|axis| view.view_from_world.transform_vector3(axis).normalize_or_zero());
        let (centre, radius) = bounding_sphere(bounds);
        let centre = view.view_from_world.transform_point3(centre);
        let radius = view.length(radius);
        let lights = &lighting.lights[..lighting.lights.len().min(MAX_LIGHTS)];
        let mut gpu_lights = [GpuLight { place: [0.0; 4], toward: [0.0; 4], color: [0.0; 4] }; MAX_LIGHTS];
        for (gpu, light) in gpu_lights.iter_mut().zip(lights) {
            let turned = |v: Vec3| {
                let v = v.as_dvec3();
                if light.in_world { axes[0] * v.x + axes[1] * v.y + axes[2] * v.z } else { v }
            };
            let place = |at: Vec3| centre + radius * turned(at);
            let [r, g, b] = light.color;
            *gpu = match light.kind {
                LightKind::Directional { to_light } => GpuLight {
                    place: vec4_of(turned(to_light).normalize_or_zero(), 0.0),
                    toward: [0.0; 4],
                    color: [r, g, b, 0.0],
                },
                LightKind::Point { at } => {
                    GpuLight { place: vec4_of(place(at), 1.0), toward: [0.0; 4], color: [r, g, b, 0.0] }
                }
                LightKind::Spot { at, toward, half_angle_rad } => GpuLight {
                    place: vec4_of(place(at), 2.0),
                    toward: vec4_of(turned(toward - at).normalize_or_zero(), f64::from(half_angle_rad.cos())),
                    // The outer fifth of the cone fades out.
                    color: [r, g, b, (0.8 * half_angle_rad).cos()],
                },
            };
        }
        let map = look.color_map.stops();
        let mut stops = [[0.0; 4]; MAX_COLOR_STOPS];
        for (gpu, [r, g, b]) in stops.iter_mut().zip(map) {
            *gpu = [*r, *g, *b, 1.0];
        }
        let [least, most] = seen.heat_range;
        let range = if most > least { (most - least).recip() } else { 0.0 };
        let behind = match seen.background {
            Background::Environment { blurred } if seen.has_environment => 1.0 + f32::from(u8::from(blurred)),
            _ => 0.0,
        };
        let background = seen.background.edges().map_or([[0.0; 4]; 2], |edges| edges.map(opaque));
        let [w, h] = seen.size.map(|x| x as f32);
        let below = DVec3::new(
            0.5 * (bounds.min[0] + bounds.max[0]),
            bounds.min[1],
            0.5 * (bounds.min[2] + bounds.max[2]),
        );
        let below = view.view_from_world.transform_point3(below);
        Self {
            clip_from_view: view.clip_from_view.to_cols_array_2d(),
            view_from_world_axes: axes.map(|a| vec4_of(a, 0.0)),
            picture: [w, h, f32::from(u8::from(view.perspective)), lights.len() as f32],
            ambient_above: opaque(lighting.ambient.above),
            ambient_below: opaque(lighting.ambient.below),
            surface: opaque(look.surface.map(linear_from_srgb)),
            wire: look.wire,
            widths: [
                if look.wireframe { look.wire_width_px * seen.scale } else { 0.0 },
                (MARK_WIDTH_PX * if seen.marks_stand_out { 2.0 } else { 1.0 } + look.wire_width_px - 1.0)
                    .clamp(1.0, 64.0)
                    * seen.scale,
                f32::from(u8::from(look.cull_back)),
                (radius * radius) as f32,
            ],
            heat: [least, range, map.len() as f32, f32::from(u8::from(seen.has_matcap))],
            brush: {
                let [from, to] = look.heat_brush.unwrap_or([f32::MIN, f32::MAX]);
                [from, to, 0.0, 0.0]
            },
            background,
            ground: vec4_of(below, view.length(grid_step(bounding_sphere(bounds).1))),
            marks: {
                let [a, b, c] =
                    [look.borders, look.defects, seen.has_environment].map(|x| f32::from(u8::from(x)));
                [a, b, c, behind]
            },
            mark_colors: super::marks::COLORS.map(opaque),
            tints: TINTS.map(|c| opaque(c.map(linear_from_srgb))),
            stops,
            lights: gpu_lights,
        }
    }
}

/// Width of borders and marked edges for wireframe lines 1 pixel wide; as in `lodsmith_render`.
const MARK_WIDTH_PX: f32 = 2.2;

/// Returns the grid spacing for a scene of this radius: 1, 2 or 5 times a power of ten, about a quarter of
/// the radius.
fn grid_step(radius: f64) -> f64 {
    let size = radius / 4.0;
    let power = 10f64.powf(size.log10().floor());
    let digit = size / power;
    let step = power
        * if digit < 1.5 {
            1.0
        } else if digit < 3.5 {
            2.0
        } else if digit < 7.5 {
            5.0
        } else {
            10.0
        };
    if step.is_finite() && step > 0.0 { step } else { 1.0 }
}

/// Returns the centre of a box and half its diagonal (1 if that is zero).
pub(super) fn bounding_sphere(bounds: &Bounds) -> (DVec3, f64) {
    let [min, max] = [bounds.min, bounds.max].map(DVec3::from);
    let half = 0.5 * bounds.diagonal();
    (0.5 * min + 0.5 * max, if half > 0.0 { half } else { 1.0 })
}

fn vec4_of(v: DVec3, w: f64) -> [f32; 4] {
    [v.x as f32, v.y as f32, v.z as f32, w as f32]
}

fn opaque([r, g, b]: [f32; 3]) -> [f32; 4] {
    [r, g, b, 1.0]
}

pub(super) fn linear_from_srgb(x: f32) -> f32 {
    if x <= 0.04045 { x / 12.92 } else { ((x + 0.055) / 1.055).powf(2.4) }
}

pub(super) fn srgb_from_linear(x: f32) -> f32 {
    if x <= 0.003_130_8 { 12.92 * x } else { 1.055 * x.powf(1.0 / 2.4) - 0.055 }
}
