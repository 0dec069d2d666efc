//! Arguments of `lodsmith render`.

use std::ffi::OsString;
use std::path::PathBuf;

use clap::Args;
use clap::builder::{PossibleValuesParser, TypedValueParser};
use lodsmith::MethodKind;
use lodsmith_render::{Background, ColorMap, Light, LightKind, Shading, StandardView};

use super::{Reading, Run, choice, values};
use lodsmith_asset::{Sink, Source, Up};

const AFTER: &str = "\
Shadings:
  smooth         one colour, normals blended: the file's own, or those of the shape
  flat           one colour, one normal for each face
  textured       materials with their images
  vertex-colors  colours of vertices
  normals        normals as colours
  matcap         a picture of a lit ball, looked up by the normal
  heat           distance from the reference, with --compare or --levels

Backgrounds: transparent; #rrggbb; #rrggbb,#rrggbb from top to bottom; gradient, the default;
surroundings, the environment (--environment); blurred, the same out of focus.
Lights, in radii of the model from its centre, x to the right, y up, z towards the eye:
  sun:X,Y,Z    from that direction
  point:X,Y,Z  from that place to all sides
  spot:X,Y,Z   from that place to the centre
  each with =STRENGTH behind it, if not 1; they take the place of the usual two.

Examples:
  lodsmith render bunny.obj -o bunny.png
  lodsmith render part.stl -o part.png --up z --shading flat --wireframe --view front
  lodsmith render low.glb -o error.png --compare full.glb --shading heat
  lodsmith render fox.glb fox_low.glb -o walk.png --clip Walk --time 0.4
  lodsmith render bunny.obj -o turn.png --turntable 60 --background transparent
  lodsmith render scan.ply -o sheet.png --levels 5000,2500,1500,750,300,100 --wireframe";

#[derive(Args, Debug)]
#[command(after_help = AFTER)]
pub(crate) struct RenderArgs {
    /// Files to render, side by side if several; `-` is standard input
    #[arg(value_name = "IN", required = true)]
    pub(crate) inputs: Vec<Source>,
    /// Picture to write: .png, .jpg or .webp; `-` is standard output, as PNG
    #[arg(short, long, value_name = "OUT", required_unless_present = "out_dir", conflicts_with = "out_dir")]
    pub(crate) output: Option<Sink>,
    /// Render this file first, with the same camera
    #[arg(long, value_name = "REFERENCE")]
    pub(crate) compare: Option<Source>,
    /// Render the model and its simplifications to N faces side by side
    #[arg(long, value_name = "N,...", value_delimiter = ',', value_parser = values::count, conflicts_with = "compare")]
    pub(crate) levels: Vec<usize>,
    /// Method for --levels; see lodsmith simplify --help
    #[arg(long, value_name = "METHOD", value_parser = choice(MethodKind::ALL, MethodKind::name),
          default_value = MethodKind::default().name(), requires = "levels")]
    pub(crate) method: MethodKind,
    #[command(flatten)]
    pub(crate) look: LookArgs,
    #[command(flatten)]
    pub(crate) place: PlaceArgs,
    #[command(flatten)]
    pub(crate) moment: MomentArgs,
    #[command(flatten)]
    pub(crate) turntable: TurntableArgs,
    #[command(flatten)]
    pub(crate) sheet: SheetArgs,
    #[command(flatten)]
    pub(crate) reading: Reading,
    /// Overwrite inputs and write-protected files (never folders)
    #[arg(long, help_heading = "Run")]
    pub(crate) force: bool,
    /// Print one JSON object
    #[arg(long, help_heading = "Run")]
    pub(crate) json: bool,
    #[command(flatten)]
    pub(crate) run: Run,
}

/// Appearance of surfaces.
#[derive(Args, Debug)]
#[command(next_help_heading = "Look")]
pub(crate) struct LookArgs {
    /// Colouring of surfaces, see below [default: textured if there are materials, vertex-colors if there
    /// are colours, else smooth]
    #[arg(long, value_name = "SHADING", value_parser = shading())]
    pub(crate) shading: Option<Shading>,
    /// Colour of the surface, as #rrggbb
    #[arg(long, value_name = "COLOR", value_parser = values::color)]
    pub(crate) color: Option<[f32; 3]>,
    /// Draw the edges of all faces
    #[arg(long)]
    pub(crate) wireframe: bool,
    /// Width of these lines
    #[arg(long, value_name = "PX", value_parser = values::above_zero)]
    pub(crate) wire_width: Option<f64>,
    /// Draw open borders in red
    #[arg(long)]
    pub(crate) borders: bool,
    /// Draw non-manifold edges in violet, faces without area in yellow, duplicate faces in blue
    #[arg(long)]
    pub(crate) defects: bool,
    /// Hide faces seen from behind
    #[arg(long)]
    pub(crate) cull: bool,
    /// Picture of a lit ball for --shading matcap [default: clay]
    #[arg(long, value_name = "FILE")]
    pub(crate) matcap: Option<PathBuf>,
    /// Range of the colours of --shading heat, in units of the file [default: 0 to the largest]
    #[arg(long, value_name = "LOW,HIGH", value_parser = values::range)]
    pub(crate) range: Option<[f32; 2]>,
    /// Colours of --shading heat
    #[arg(long, value_name = "MAP", value_parser = color_map(), default_value = ColorMap::default().name())]
    pub(crate) colors: ColorMap,
    /// A light, see below; may be repeated
    #[arg(long, value_name = "LIGHT", value_parser = light, allow_hyphen_values = true)]
    pub(crate) light: Vec<Light>,
    /// Environment that lights and reflects in materials: studio, none, or a panorama (.hdr, .png, .jpg), twice as
    /// wide as high; auto: studio for models with metal, or if it is the background
    #[arg(long, value_name = "ENVIRONMENT", default_value = "auto")]
    pub(crate) environment: Surroundings,
    /// Darken creases (ambient occlusion)
    #[arg(long)]
    pub(crate) occlusion: bool,
    /// Draw a shadow on the ground
    #[arg(long)]
    pub(crate) shadow: bool,
    /// Draw a grid on the ground
    #[arg(long)]
    pub(crate) grid: bool,
    /// Background, see below
    #[arg(long, value_name = "BACKGROUND", value_parser = background, default_value = "gradient")]
    pub(crate) background: Background,
}

/// Environment of the model.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) enum Surroundings {
    Auto,
    None,
    Studio,
    File(PathBuf),
}

impl From<OsString> for Surroundings {
    fn from(word: OsString) -> Self {
        match word.to_str() {
            Some("auto") => Self::Auto,
            Some("none") => Self::None,
            Some("studio") => Self::Studio,
            _ => Self::File(word.into()),
        }
    }
}

/// Position of the camera.
#[derive(Args, Debug)]
#[command(next_help_heading = "View")]
pub(crate) struct PlaceArgs {
    /// Direction of the camera
    #[arg(long, value_name = "VIEW", value_parser = standard_view(), default_value = StandardView::default().name())]
    pub(crate) view: StandardView,
    /// Camera angle around the model from the front to the right, in degrees, instead of --view
    #[arg(long, value_name = "DEG", allow_negative_numbers = true, value_parser = values::finite, conflicts_with = "view")]
    pub(crate) azimuth: Option<f64>,
    /// Camera angle above the horizon, in degrees, instead of --view
    #[arg(long, value_name = "DEG", allow_negative_numbers = true, value_parser = values::elevation_deg, conflicts_with = "view")]
    pub(crate) elevation: Option<f64>,
    /// Axis that points up in the files
    #[arg(long, value_name = "AXIS", value_parser = choice(Up::ALL, Up::name), default_value = Up::Y.name())]
    pub(crate) up: Up,
    /// Vertical field of view, in degrees [default: 35]
    #[arg(long, value_name = "DEG", value_parser = values::fov_deg, conflicts_with = "parallel")]
    pub(crate) fov: Option<f64>,
    /// Use a parallel projection
    #[arg(long)]
    pub(crate) parallel: bool,
}

/// Moment of an animation.
#[derive(Args, Debug)]
#[command(next_help_heading = "Animation")]
pub(crate) struct MomentArgs {
    /// Animation of a glTF file, by name or by number from 1 [default: the first with --time, else none]
    #[arg(long, value_name = "NAME")]
    pub(crate) clip: Option<String>,
    /// Time in the animation, in seconds [default: 0]
    #[arg(long, value_name = "SECONDS", allow_negative_numbers = true, value_parser = values::not_negative)]
    pub(crate) time: Option<f64>,
}

/// A turn of the camera around the model.
#[derive(Args, Debug)]
#[command(next_help_heading = "Turntable")]
pub(crate) struct TurntableArgs {
    /// Render N views all around the model: an animated PNG with -o, a picture for each with -O
    #[arg(long = "turntable", value_name = "N", value_parser = values::frames)]
    pub(crate) frames: Option<usize>,
    /// Frames per second of the animated PNG
    #[arg(long, value_name = "N", value_parser = values::fps, default_value = "20", requires = "frames")]
    pub(crate) fps: u16,
    /// Folder for the pictures; created if missing
    #[arg(short = 'O', long, value_name = "DIR", requires = "frames")]
    pub(crate) out_dir: Option<PathBuf>,
    /// File names in the folder: .png, .jpg or .webp
    #[arg(long, value_name = "TEMPLATE", default_value = "{stem}_{frame}.png", requires = "out_dir")]
    pub(crate) name: String,
}

/// Arrangement of pictures.
#[derive(Args, Debug)]
#[command(next_help_heading = "Picture")]
pub(crate) struct SheetArgs {
    /// Size of the picture, or of each if there are several [default: 1200x800, several 480x480]
    #[arg(long, value_name = "WxH", value_parser = values::size)]
    pub(crate) size: Option<[usize; 2]>,
    /// Pictures per row [default: up to 4]
    #[arg(long, value_name = "N", value_parser = values::count)]
    pub(crate) columns: Option<usize>,
    /// Leave out the captions
    #[arg(long)]
    pub(crate) no_captions: bool,
    /// Use sixteen samples per pixel instead of four
    #[arg(long)]
    pub(crate) fine: bool,
}

fn shading() -> impl TypedValueParser<Value = Shading> {
    PossibleValuesParser::new(Shading::ALL.map(Shading::name))
        .map(|name| Shading::ALL.into_iter().find(|s| s.name() == name).expect("the words are the names"))
}

fn standard_view() -> impl TypedValueParser<Value = StandardView> {
    PossibleValuesParser::new(StandardView::ALL.map(StandardView::name)).map(|name| {
        StandardView::ALL.into_iter().find(|v| v.name() == name).expect("the words are the names")
    })
}

fn color_map() -> impl TypedValueParser<Value = ColorMap> {
    PossibleValuesParser::new(ColorMap::ALL.map(ColorMap::name))
        .map(|name| ColorMap::ALL.into_iter().find(|m| m.name() == name).expect("the words are the names"))
}

fn background(text: &str) -> Result<Background, String> {
    match text {
        "transparent" => Ok(Background::Transparent),
        "gradient" => Ok(Background::default()),
        "surroundings" => Ok(Background::Environment { blurred: false }),
        "blurred" => Ok(Background::Environment { blurred: true }),
        _ => match text.split_once(',') {
            Some((upper, lower)) => Ok(Background::Gradient(values::color(upper)?, values::color(lower)?)),
            None => values::color(text).map(Background::Color),
        }
        .map_err(|e: String| format!("transparent, gradient, surroundings, blurred, or {e}")),
    }
}

fn light(text: &str) -> Result<Light, String> {
    let wanted = || "a light is sun:X,Y,Z, point:X,Y,Z or spot:X,Y,Z, with =STRENGTH if not 1".to_owned();
    let (place, strength) = match text.split_once('=') {
        Some((place, strength)) => (place, values::above_zero(strength).map_err(|_| wanted())? as f32),
        None => (text, 1.0),
    };
    let (kind, numbers) = place.split_once(':').ok_or_else(wanted)?;
    let numbers: Vec<f32> =
        numbers.split(',').map(|n| n.trim().parse().map_err(|_| wanted())).collect::<Result<_, _>>()?;
    let &[x, y, z] = numbers.as_slice() else { return Err(wanted()) };
    let at = [x, y, z];
    if at.iter().any(|n| !n.is_finite()) || at == [0.0; 3] {
        return Err(wanted());
    }
    let kind = match kind {
        "sun" => LightKind::Directional { to_light: at.into() },
        "point" => LightKind::Point { at: at.into() },
        // Half of a cone of 50 degrees, which contains the model from a distance of a little over two radii.
        // (By eye.)
        "spot" => LightKind::Spot { at: at.into(), toward: [0.0; 3].into(), half_angle_rad: 0.436 },
        _ => return Err(wanted()),
    };
    Ok(Light { kind, color: [strength; 3], in_world: false })
}

impl RenderArgs {
    /// Returns the number of pictures.
    pub(crate) fn picture_count(&self) -> usize {
        match self.levels.len() {
            0 => self.inputs.len() + usize::from(self.compare.is_some()),
            levels => self.inputs.len() * (1 + levels),
        }
    }

    /// Returns the size of each picture, in pixels.
    pub(crate) fn size(&self) -> [usize; 2] {
        self.sheet.size.unwrap_or(if self.picture_count() > 1 { [480, 480] } else { [1200, 800] })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn backgrounds_and_lights_are_told_by_words() {
        assert_eq!(background("#ff0000"), Ok(Background::Color([1.0, 0.0, 0.0])));
        assert_eq!(background("#000000,#ffffff"), Ok(Background::Gradient([0.0; 3], [1.0; 3])));
        assert_eq!(background("transparent"), Ok(Background::Transparent));
        assert_eq!(background("blurred"), Ok(Background::Environment { blurred: true }));
        for bad in ["red", "#ff00", "#gg0000", "#000000,", ""] {
            assert!(background(bad).is_err(), "{bad}");
        }
        let sun = light("sun:1,-2,0.5=0.7").unwrap();
        assert_eq!(
            (sun.kind, sun.color),
            (LightKind::Directional { to_light: [1.0, -2.0, 0.5].into() }, [0.7; 3])
        );
        for bad in
            ["sun", "sun:1,2", "moon:1,2,3", "sun:0,0,0", "point:1,2,nan", "spot:1,2,3=0", "sun:1,2,3=x"]
        {
            assert!(light(bad).is_err(), "{bad}");
        }
    }
}
