//! Settings of a document: open files, options, appearance. Commands change them and sessions store them.

pub mod bake;
pub mod playback;
pub mod session;
pub mod simplification;
pub mod up_axis;

use std::path::{Path, PathBuf};

use glam::{DQuat, DVec3, Vec3};
use lodsmith_core::mesh::creases::Creases;
use lodsmith_render::{
    Ambient, Background, Camera, ColorMap, Lens, Light, LightKind, Lighting, Look, Shading,
};
use serde::{Deserialize, Serialize};

use crate::settings::bake::BakeSettings;
use crate::settings::playback::Playback;
use crate::settings::simplification::Simplification;
use crate::settings::up_axis::UpAxis;
use crate::stage::Stage;

/// All settings of a document.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct Settings {
    /// Open files.
    pub files: Vec<PathBuf>,
    /// Index of the shown file.
    pub shown: usize,
    /// Method, options and target.
    pub simplify: Simplification,
    /// Maps that are baked for the result.
    pub bake: BakeSettings,
    /// Appearance of surfaces.
    pub look: Appearance,
    /// Layout of the two sides.
    pub layout: Layout,
    /// Axis of the model that points up.
    pub up: UpAxis,
    /// Rotation of the model, after its axis points up.
    pub turn: Turn,
    /// Saved cameras.
    pub cameras: [Option<Pose>; 4],
    /// Automatic levels by distance of the camera.
    pub auto_lod: AutoLod,
    /// Stage with copies of the model.
    pub stage: Stage,
    /// Playback of the animation.
    pub playback: Playback,
}

impl Settings {
    /// Returns the shown file.
    pub fn file(&self) -> Option<&Path> {
        self.files.get(self.shown).map(PathBuf::as_path)
    }

    /// Returns all paths: of the open files and of the appearance.
    pub(crate) fn all_files_mut(&mut self) -> impl Iterator<Item = &mut PathBuf> {
        let look = &mut self.look;
        let around = match &mut look.around {
            EnvironmentChoice::File(path) => Some(path),
            EnvironmentChoice::Auto | EnvironmentChoice::Plain | EnvironmentChoice::Studio => None,
        };
        self.files.iter_mut().chain(&mut look.matcap).chain(&mut look.shader).chain(around)
    }
}

/// Rotation of the model, as a quaternion (x, y, z, w).
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Turn(pub [f64; 4]);

impl Default for Turn {
    fn default() -> Self {
        Self(DQuat::IDENTITY.to_array())
    }
}

impl Turn {
    /// Returns the rotation; the identity if the numbers are not valid.
    pub fn rotation(self) -> DQuat {
        let q = DQuat::from_array(self.0);
        if q.is_finite() && q.length_squared() > 1e-12 { q.normalize() } else { DQuat::IDENTITY }
    }
}

/// Automatic levels by distance.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct AutoLod {
    /// True if they are used.
    pub is_on: bool,
    /// Error that a level may have on the screen, in pixels.
    pub pixels: f64,
}

impl Default for AutoLod {
    fn default() -> Self {
        Self { is_on: false, pixels: 1.0 }
    }
}

/// Layout of the two sides.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct Layout {
    /// Shown sides and their arrangement.
    pub sides: Sides,
    /// True if both sides share one camera.
    pub linked: bool,
    /// Position of the wipe divider, from 0 to 1.
    pub wipe: f32,
}

impl Default for Layout {
    fn default() -> Self {
        Self { sides: Sides::default(), linked: true, wipe: 0.5 }
    }
}

/// Shown sides and their arrangement.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub enum Sides {
    /// Original left, result right.
    #[default]
    Both,
    /// One over the other, with a movable divider.
    Wipe,
    /// The original alone.
    Original,
    /// The result alone.
    Result,
    /// The perceived difference of the two pictures.
    Difference,
}

impl Sides {
    /// All arrangements with their names.
    pub const ALL: [(Self, &'static str); 5] = [
        (Self::Both, "Side by side"),
        (Self::Wipe, "Wipe"),
        (Self::Original, "Original"),
        (Self::Result, "Result"),
        (Self::Difference, "Difference"),
    ];
}

/// Appearance of surfaces and background.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct Appearance {
    /// Shading, wireframe, marks.
    #[serde(with = "LookInFile")]
    pub look: Look,
    /// Background.
    pub backdrop: Backdrop,
    /// True if a grid is drawn below the model.
    pub ground: bool,
    /// Lights.
    pub rig: Rig,
    /// The first of the lights, if it was changed.
    pub lamp: Option<Lamp>,
    /// Brightness factor of the lights.
    pub brightness: f32,
    /// Environment for reflections.
    pub around: EnvironmentChoice,
    /// The user's own matcap image.
    pub matcap: Option<PathBuf>,
    /// The user's own shader.
    pub shader: Option<PathBuf>,
    /// Quantity of the heat map.
    pub heat_of: HeatOf,
    /// Which edges are sharp if the file has no normals.
    pub creases: Creases,
}

impl Default for Appearance {
    fn default() -> Self {
        Self {
            look: Look::default(),
            backdrop: Backdrop::default(),
            ground: false,
            rig: Rig::default(),
            lamp: None,
            brightness: 1.0,
            around: EnvironmentChoice::default(),
            matcap: None,
            shader: None,
            heat_of: HeatOf::default(),
            creases: Creases::default(),
        }
    }
}

/// Quantity of the heat map: how the two sides differ.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum HeatOf {
    /// Distances, in the units of the file.
    #[default]
    Distance,
    /// Angles between normals, in degrees.
    Normals,
    /// Distances of texture coordinates; 1 is the width or height of the image.
    Uvs,
    /// Distances of vertex colours; 1 is the range of a channel.
    Colors,
}

impl HeatOf {
    /// All quantities with their names.
    pub const ALL: [(Self, &'static str); 4] = [
        (Self::Distance, "Distance"),
        (Self::Normals, "Normals"),
        (Self::Uvs, "UVs"),
        (Self::Colors, "Vertex colours"),
    ];

    /// Returns the name.
    pub fn name(self) -> &'static str {
        Self::ALL[self as usize].1
    }
}

/// Environment that materials reflect and are lit by, besides the lights.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub enum EnvironmentChoice {
    /// Studio if the model has metal, which reflects little but its environment, or if the background shows
    /// the environment; else plain.
    #[default]
    Auto,
    /// Ambient light from above and below.
    Plain,
    /// A studio room with soft lights.
    Studio,
    /// An environment image.
    File(PathBuf),
}

impl EnvironmentChoice {
    /// Returns the next environment that is not a file: automatic, plain, studio.
    pub fn next(&self) -> Self {
        match self {
            Self::Auto => Self::Plain,
            Self::Plain => Self::Studio,
            Self::Studio | Self::File(_) => Self::Auto,
        }
    }

    /// Returns the file.
    pub fn file(&self) -> Option<&PathBuf> {
        match self {
            Self::File(path) => Some(path),
            Self::Auto | Self::Plain | Self::Studio => None,
        }
    }
}

impl Appearance {
    /// Returns the first light: the changed one, or that of the rig.
    pub fn lamp(&self) -> Lamp {
        self.lamp.unwrap_or_else(|| self.rig.lamp())
    }

    /// Returns the lighting for the renderer.
    pub fn lighting(&self) -> Lighting {
        let mut lighting = self.rig.lighting(self.brightness);
        if let (Some(lamp), Some(light)) = (self.lamp, lighting.lights.first_mut()) {
            lamp.apply_to(light);
        }
        lighting
    }

    /// Resolves the automatic environment for a model.
    pub fn surroundings(&self, has_metal: bool) -> EnvironmentChoice {
        let is_behind = matches!(self.backdrop, Backdrop::Surroundings | Backdrop::Blurred);
        match &self.around {
            EnvironmentChoice::Auto if has_metal || is_behind => EnvironmentChoice::Studio,
            EnvironmentChoice::Auto => EnvironmentChoice::Plain,
            chosen => chosen.clone(),
        }
    }

    /// Returns the user's own files.
    pub fn files(&self) -> impl Iterator<Item = &PathBuf> {
        self.matcap.iter().chain(&self.shader).chain(self.around.file())
    }
}

/// Background of the picture.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub enum Backdrop {
    /// Matches the theme: dark or light.
    #[default]
    Theme,
    /// Dark gradient.
    Dark,
    /// Bright gradient.
    Bright,
    /// Sky gradient.
    Sky,
    /// Solid colour.
    Color([f32; 3]),
    /// The environment.
    Surroundings,
    /// The environment, blurred.
    Blurred,
}

impl Backdrop {
    /// All backgrounds with their names.
    pub const ALL: [(Self, &'static str); 7] = [
        (Self::Theme, "Match theme"),
        (Self::Dark, "Dark studio"),
        (Self::Bright, "Bright studio"),
        (Self::Sky, "Sky"),
        (Self::Color([1.0; 3]), "Solid colour"),
        (Self::Surroundings, "Environment"),
        (Self::Blurred, "Blurred environment"),
    ];

    /// Returns the background for the renderer.
    pub fn background(self, dark_window: bool) -> Background {
        match self {
            Self::Theme if dark_window => Background::Gradient([0.185, 0.20, 0.225], [0.105, 0.112, 0.125]),
            Self::Theme => Background::Gradient([0.925, 0.935, 0.95], [0.80, 0.815, 0.84]),
            Self::Dark => Background::Gradient([0.16, 0.16, 0.17], [0.05, 0.05, 0.055]),
            Self::Bright => Background::Gradient([0.97, 0.97, 0.97], [0.86, 0.86, 0.87]),
            Self::Sky => Background::Gradient([0.36, 0.56, 0.82], [0.83, 0.88, 0.92]),
            Self::Color(color) => Background::Color(color),
            Self::Surroundings => Background::Environment { blurred: false },
            Self::Blurred => Background::Environment { blurred: true },
        }
    }
}

/// Distance in radii, and cone, of lights that have none.
const DEFAULT_DISTANCE: f32 = 2.5;
const DEFAULT_CONE_DEG: f32 = 60.0;

/// Lights of the scene.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub enum Rig {
    /// A key light over the left shoulder, a weak fill light from the right.
    #[default]
    Studio,
    /// A light at the camera.
    Headlight,
    /// Directional light from above, fixed in the world.
    Sun,
    /// A point light beside the model.
    Point,
    /// A spot light from above.
    Spot,
}

impl Rig {
    /// All lights with their names.
    pub const ALL: [(Self, &'static str); 5] = [
        (Self::Studio, "Studio"),
        (Self::Headlight, "Headlight"),
        (Self::Sun, "Sun"),
        (Self::Point, "Point light"),
        (Self::Spot, "Spot light"),
    ];

    /// Returns the first light.
    pub fn lamp(self) -> Lamp {
        let light = self.lighting(1.0).lights[0];
        let none = Lamp {
            azimuth_deg: 0.0,
            elevation_deg: 0.0,
            distance: DEFAULT_DISTANCE,
            cone_deg: DEFAULT_CONE_DEG,
            color: [1.0; 3],
        };
        match light.kind {
            LightKind::Directional { to_light } => none.towards(to_light),
            LightKind::Point { at } => Lamp { distance: at.length(), ..none.towards(at) },
            LightKind::Spot { at, half_angle_rad, .. } => {
                let cone_deg = 2.0 * half_angle_rad.to_degrees();
                Lamp { distance: at.length(), cone_deg, ..none.towards(at) }
            }
        }
    }

    /// Returns the lighting for the renderer.
    pub fn lighting(self, brightness: f32) -> Lighting {
        let one = |kind, strength: f32, in_world| Light { kind, color: [strength; 3], in_world };
        let directional = |to_light: Vec3| LightKind::Directional { to_light };
        let dim = Ambient { above: [0.16, 0.17, 0.20], below: [0.07, 0.07, 0.07] };
        let mut lighting = match self {
            Self::Studio => Lighting::default(),
            Self::Headlight => Lighting {
                ambient: dim,
                lights: vec![one(directional(Vec3::new(0.0, 0.05, 1.0)), 0.95, false)],
            },
            Self::Sun => Lighting {
                ambient: Ambient { above: [0.26, 0.31, 0.40], below: [0.13, 0.12, 0.10] },
                lights: vec![one(directional(Vec3::new(0.4, 0.8, 0.45)), 1.0, true)],
            },
            Self::Point => Lighting {
                ambient: dim,
                lights: vec![one(LightKind::Point { at: Vec3::new(-1.1, 1.2, 1.4) }, 4.0, true)],
            },
            Self::Spot => {
                let at = Vec3::new(0.6, 2.4, 1.2);
                let kind = LightKind::Spot { at, toward: -at, half_angle_rad: 0.5 };
                Lighting { ambient: dim, lights: vec![one(kind, 8.0, true)] }
            }
        };
        let ambient = &mut lighting.ambient;
        let all = lighting.lights.iter_mut().map(|l| &mut l.color);
        for color in all.chain([&mut ambient.above, &mut ambient.below]) {
            *color = color.map(|c| c * brightness);
        }
        lighting
    }
}

/// Direction, distance, cone and colour of a light.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct Lamp {
    /// Direction to the light about the vertical axis, in degrees; 0 is in front, 90 on the right.
    pub azimuth_deg: f32,
    /// Direction to the light above the horizon, in degrees.
    pub elevation_deg: f32,
    /// Distance of a point or spot light from the centre of the model, in radii of the model.
    pub distance: f32,
    /// Whole angle of the cone of a spot light, in degrees.
    pub cone_deg: f32,
    /// Colour in sRGB, which multiplies the strength of the light.
    pub color: [f32; 3],
}

impl Default for Lamp {
    fn default() -> Self {
        Rig::default().lamp()
    }
}

impl Lamp {
    /// Returns the direction to the light.
    pub fn direction(&self) -> Vec3 {
        let ((sin_a, cos_a), (sin_e, cos_e)) =
            (self.azimuth_deg.to_radians().sin_cos(), self.elevation_deg.to_radians().sin_cos());
        Vec3::new(cos_e * sin_a, sin_e, cos_e * cos_a)
    }

    /// Sets the direction to the light.
    #[must_use]
    pub fn towards(self, direction: Vec3) -> Self {
        let d = direction.normalize_or(Vec3::Z);
        let azimuth_deg = d.x.atan2(d.z).to_degrees();
        Self { azimuth_deg, elevation_deg: d.y.clamp(-1.0, 1.0).asin().to_degrees(), ..self }
    }

    /// Turns the light about the centre by degrees to the right and up.
    #[must_use]
    pub fn turned(self, right_deg: f32, up_deg: f32) -> Self {
        let azimuth_deg = (self.azimuth_deg + right_deg + 180.0).rem_euclid(360.0) - 180.0;
        Self { azimuth_deg, elevation_deg: (self.elevation_deg + up_deg).clamp(-90.0, 90.0), ..self }
    }

    fn apply_to(&self, light: &mut Light) {
        let to_light = self.direction();
        let at = to_light * self.distance.clamp(0.1, 100.0);
        light.kind = match light.kind {
            LightKind::Directional { .. } => LightKind::Directional { to_light },
            LightKind::Point { .. } => LightKind::Point { at },
            LightKind::Spot { .. } => {
                let half_angle_rad = 0.5 * self.cone_deg.clamp(1.0, 170.0).to_radians();
                LightKind::Spot { at, toward: Vec3::ZERO, half_angle_rad }
            }
        };
        // sRGB to linear, closely enough for a colour that is chosen by eye.
        let tint = self.color.map(|c| c.clamp(0.0, 1.0).powf(2.2));
        light.color = [0, 1, 2].map(|k| light.color[k] * tint[k]);
    }
}

/// A camera, as sessions store it.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Pose {
    /// Position.
    pub eye: [f64; 3],
    /// Point it looks at.
    pub target: [f64; 3],
    /// Up vector.
    pub up: [f64; 3],
    /// Vertical field of view.
    pub fov_y_rad: f64,
}

impl Pose {
    /// Makes one of a camera.
    pub fn of(camera: &Camera) -> Self {
        let fov_y_rad = match camera.lens {
            Lens::Perspective { fov_y_rad } => fov_y_rad,
            Lens::Parallel { height } => 2.0 * (0.5 * height / camera.distance().max(1e-30)).atan(),
        };
        let [eye, target, up] = [camera.eye, camera.target, camera.up].map(|v| v.to_array());
        Self { eye, target, up, fov_y_rad }
    }

    /// Returns the camera.
    pub fn camera(&self) -> Camera {
        let [eye, target, up] = [self.eye, self.target, self.up].map(DVec3::from);
        Camera { eye, target, up, lens: Lens::Perspective { fov_y_rad: self.fov_y_rad } }
    }
}

#[derive(Serialize, Deserialize)]
#[serde(remote = "Look")]
struct LookInFile {
    #[serde(with = "ShadingInFile")]
    shading: Shading,
    surface: [f32; 3],
    wireframe: bool,
    wire: [f32; 4],
    wire_width_px: f32,
    borders: bool,
    defects: bool,
    cull_back: bool,
    #[serde(with = "ColorMapInFile")]
    color_map: ColorMap,
    heat_range: Option<[f32; 2]>,
    #[serde(default)]
    heat_brush: Option<[f32; 2]>,
}

#[derive(Serialize, Deserialize)]
#[serde(remote = "Shading", rename_all = "kebab-case")]
enum ShadingInFile {
    Smooth,
    Flat,
    Textured,
    VertexColors,
    Normals,
    Matcap,
    Heat,
}

#[derive(Serialize, Deserialize)]
#[serde(remote = "ColorMap", rename_all = "kebab-case")]
enum ColorMapInFile {
    Turbo,
    Viridis,
    Diverging,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn settings_come_back_from_a_file() {
        let mut settings = Settings { files: vec!["a b.glb".into()], ..Settings::default() };
        settings.look.look.shading = Shading::VertexColors;
        settings.look.look.heat_range = Some([0.0, 0.5]);
        settings.look.backdrop = Backdrop::Color([0.1, 0.2, 0.3]);
        settings.simplify.options.stop.ratio = Some(0.25);
        settings.turn = Turn([0.0, 1.0, 0.0, 0.0]);
        settings.playback = Playback { clip: None, seconds: 1.25, speed: 0.5, repeats: false };
        settings.cameras[2] =
            Some(Pose { eye: [1.0; 3], target: [0.0; 3], up: [0.0, 1.0, 0.0], fov_y_rad: 0.6 });
        let text = serde_json::to_string(&settings).unwrap();
        assert_eq!(serde_json::from_str::<Settings>(&text).unwrap(), settings);
        assert_eq!(serde_json::from_str::<Settings>("{}").unwrap(), Settings::default());
    }

    #[test]
    fn metal_and_an_environment_background_choose_the_studio() {
        let mut look = Appearance::default();
        assert_eq!(
            [false, true].map(|m| look.surroundings(m)),
            [EnvironmentChoice::Plain, EnvironmentChoice::Studio]
        );
        look.backdrop = Backdrop::Blurred;
        assert_eq!(look.surroundings(false), EnvironmentChoice::Studio);
        look.around = EnvironmentChoice::Plain;
        assert_eq!(look.surroundings(true), EnvironmentChoice::Plain);
    }

    #[test]
    fn an_invalid_rotation_is_the_identity() {
        assert_eq!(Turn([0.0; 4]).rotation(), DQuat::IDENTITY);
        assert_eq!(Turn([f64::NAN; 4]).rotation(), DQuat::IDENTITY);
    }

    #[test]
    fn an_unmoved_light_is_the_first_light_of_the_rig() {
        for (rig, name) in Rig::ALL {
            let plain = Appearance { rig, ..Appearance::default() };
            let same = Appearance { lamp: Some(rig.lamp()), ..plain.clone() };
            let [one, two] = [plain, same].map(|look| {
                let light = look.lighting().lights[0];
                let at = match light.kind {
                    LightKind::Directional { to_light } => to_light.normalize_or_zero(),
                    LightKind::Point { at } | LightKind::Spot { at, .. } => at,
                };
                (at, light.color)
            });
            assert!(one.0.distance(two.0) < 1e-4 && one.1 == two.1, "{name}: {one:?} {two:?}");
        }
    }

    #[test]
    fn a_light_turns_about_the_model_and_has_a_cone_and_a_colour() {
        let lamp = Rig::Spot.lamp().towards(Vec3::X).turned(-90.0, 30.0);
        assert!((lamp.azimuth_deg - 0.0).abs() < 1e-3 && (lamp.elevation_deg - 30.0).abs() < 1e-3);
        let lamp = Lamp { cone_deg: 40.0, distance: 3.0, color: [1.0, 0.0, 0.0], ..lamp };
        let look = Appearance { rig: Rig::Spot, lamp: Some(lamp), ..Appearance::default() };
        let light = look.lighting().lights[0];
        let LightKind::Spot { at, half_angle_rad, .. } = light.kind else { panic!("{light:?}") };
        assert!((at.length() - 3.0).abs() < 1e-5 && (half_angle_rad.to_degrees() - 20.0).abs() < 1e-3);
        assert!(light.color[0] > 0.0 && light.color[1] == 0.0);
    }

    #[test]
    fn brightness_scales_all_light() {
        for (rig, name) in Rig::ALL {
            let [one, two] = [1.0, 2.0].map(|b| rig.lighting(b));
            assert_eq!(one.ambient.above.map(|c| 2.0 * c), two.ambient.above, "{name}");
            assert_eq!(one.lights[0].color.map(|c| 2.0 * c), two.lights[0].color, "{name}");
        }
    }
}
