//! What can be typed after `lodsmith render`.

use std::ffi::OsString;
use std::path::PathBuf;

use clap::Args;
use clap::builder::{PossibleValuesParser, TypedValueParser};
use lodsmith_render::{Background, ColorMap, Light, LightKind, Shading, StandardView};

use super::choice::MethodChoice;
use super::{Reading, Run, Up, values};
use crate::file::{Sink, Source};

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
surroundings, what --environment puts around; blurred, the same out of focus.
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
  lodsmith render scan.ply -o sheet.png --levels 5000,2500,1500,750,300,100 --wireframe";

#[derive(Args, Debug)]
#[command(after_help = AFTER)]
pub(crate) struct RenderArgs {
    /// Files to draw, side by side if several; `-` is standard input
    #[arg(value_name = "IN", required = true)]
    pub(crate) inputs: Vec<Source>,
    /// Where the picture goes: .png, .jpg or .webp; `-` is standard output, as PNG
    #[arg(short, long, value_name = "OUT")]
    pub(crate) output: Sink,
    /// Draw this one first, from the same place
    #[arg(long, value_name = "REFERENCE")]
    pub(crate) compare: Option<Source>,
    /// Draw the model, and what is left of it at so many faces, side by side
    #[arg(long, value_name = "N,...", value_delimiter = ',', value_parser = values::count, conflicts_with = "compare")]
    pub(crate) levels: Vec<usize>,
    /// Method that makes the levels; see lodsmith simplify --help
    #[arg(long, value_name = "METHOD", value_enum, default_value_t, requires = "levels")]
    pub(crate) method: MethodChoice,
    #[command(flatten)]
    pub(crate) look: LookArgs,
    #[command(flatten)]
    pub(crate) place: PlaceArgs,
    #[command(flatten)]
    pub(crate) moment: MomentArgs,
    #[command(flatten)]
    pub(crate) sheet: SheetArgs,
    #[command(flatten)]
    pub(crate) reading: Reading,
    /// Write over an input or a write-protected file; a folder is never overwritten
    #[arg(long, help_heading = "Run")]
    pub(crate) force: bool,
    /// One JSON object
    #[arg(long, help_heading = "Run")]
    pub(crate) json: bool,
    #[command(flatten)]
    pub(crate) run: Run,
}

/// How surfaces are shown.
#[derive(Args, Debug)]
#[command(next_help_heading = "Look")]
pub(crate) struct LookArgs {
    /// What colours surfaces, see below [default: textured where there are materials, vertex-colors where
    /// there are colours, else smooth]
    #[arg(long, value_name = "SHADING", value_parser = shading())]
    pub(crate) shading: Option<Shading>,
    /// Colour of the surface, as #rrggbb
    #[arg(long, value_name = "COLOR", value_parser = values::color)]
    pub(crate) color: Option<[f32; 3]>,
    /// Lines along the edges of all faces
    #[arg(long)]
    pub(crate) wireframe: bool,
    /// Width of the lines
    #[arg(long, value_name = "PX", value_parser = values::above_zero)]
    pub(crate) wire_width: Option<f64>,
    /// Open borders in red
    #[arg(long)]
    pub(crate) borders: bool,
    /// Non-manifold edges in violet, faces without area in yellow, faces that stand twice in blue
    #[arg(long)]
    pub(crate) defects: bool,
    /// Leave out faces seen from behind
    #[arg(long)]
    pub(crate) cull: bool,
    /// Picture of a lit ball for --shading matcap [default: clay]
    #[arg(long, value_name = "FILE")]
    pub(crate) matcap: Option<PathBuf>,
    /// Values at the ends of the colours of --shading heat, in the units of the file [default: 0 to the largest]
    #[arg(long, value_name = "LOW,HIGH", value_parser = values::range)]
    pub(crate) range: Option<[f32; 2]>,
    /// Colours of --shading heat
    #[arg(long, value_name = "MAP", value_parser = color_map(), default_value = ColorMap::default().name())]
    pub(crate) colors: ColorMap,
    /// A light, see below; may be repeated
    #[arg(long, value_name = "LIGHT", value_parser = light, allow_hyphen_values = true)]
    pub(crate) light: Vec<Light>,
    /// What materials mirror and are lit by beside the lights: studio, none, or a picture of all directions (.hdr,
    /// .png, .jpg), twice as wide as high; auto: studio for models with metal, or with it behind
    #[arg(long, value_name = "ENVIRONMENT", default_value = "auto")]
    pub(crate) environment: Surroundings,
    /// Darken creases, as if less light came into them
    #[arg(long)]
    pub(crate) occlusion: bool,
    /// Let the model darken the ground where it stands
    #[arg(long)]
    pub(crate) shadow: bool,
    /// Lines on the ground
    #[arg(long)]
    pub(crate) grid: bool,
    /// What lies behind, see below
    #[arg(long, value_name = "BACKGROUND", value_parser = background, default_value = "gradient")]
    pub(crate) background: Background,
}

/// What is all around.
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

/// From where.
#[derive(Args, Debug)]
#[command(next_help_heading = "View")]
pub(crate) struct PlaceArgs {
    /// From where
    #[arg(long, value_name = "VIEW", value_parser = standard_view(), default_value = StandardView::default().name())]
    pub(crate) view: StandardView,
    /// Degrees round the model from the front to the right, instead of --view
    #[arg(long, value_name = "DEG", allow_negative_numbers = true, value_parser = values::finite, conflicts_with = "view")]
    pub(crate) azimuth: Option<f64>,
    /// Degrees above the horizon, instead of --view
    #[arg(long, value_name = "DEG", allow_negative_numbers = true, value_parser = values::elevation_deg, conflicts_with = "view")]
    pub(crate) elevation: Option<f64>,
    /// The axis of the files that is up
    #[arg(long, value_name = "AXIS", value_enum, default_value = "y")]
    pub(crate) up: Up,
    /// Angle of the lens from the lower to the upper edge [default: 35]
    #[arg(long, value_name = "DEG", value_parser = values::fov_deg, conflicts_with = "parallel")]
    pub(crate) fov: Option<f64>,
    /// What is far is as large as what is near
    #[arg(long)]
    pub(crate) parallel: bool,
}

/// Which moment of an animation.
#[derive(Args, Debug)]
#[command(next_help_heading = "Animation")]
pub(crate) struct MomentArgs {
    /// The animation of a glTF file, by name or by number from 1 [default: with --time the first, else at rest]
    #[arg(long, value_name = "NAME")]
    pub(crate) clip: Option<String>,
    /// Seconds from its begin [default: 0]
    #[arg(long, value_name = "SECONDS", allow_negative_numbers = true, value_parser = values::not_negative)]
    pub(crate) time: Option<f64>,
}

/// How pictures stand together.
#[derive(Args, Debug)]
#[command(next_help_heading = "Picture")]
pub(crate) struct SheetArgs {
    /// Pixels of the picture; of each, where several stand together [default: 1200x800, each 480x480]
    #[arg(long, value_name = "WxH", value_parser = values::size)]
    pub(crate) size: Option<[usize; 2]>,
    /// Pictures in a row [default: up to 4]
    #[arg(long, value_name = "N", value_parser = values::count)]
    pub(crate) columns: Option<usize>,
    /// No text below pictures
    #[arg(long)]
    pub(crate) no_captions: bool,
    /// Sixteen samples a pixel instead of four
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
        "surroundings" => Ok(Background::Surroundings { blurred: false }),
        "blurred" => Ok(Background::Surroundings { blurred: true }),
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
        // Half of a cone of 50 degrees: it holds the model from a distance of two radii and a bit. (By eye.)
        "spot" => LightKind::Spot { at: at.into(), toward: [0.0; 3].into(), half_angle_rad: 0.436 },
        _ => return Err(wanted()),
    };
    Ok(Light { kind, color: [strength; 3], in_world: false })
}

impl RenderArgs {
    /// How many pictures there will be.
    pub(crate) fn picture_count(&self) -> usize {
        match self.levels.len() {
            0 => self.inputs.len() + usize::from(self.compare.is_some()),
            levels => self.inputs.len() * (1 + levels),
        }
    }

    /// Pixels of each picture.
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
        assert_eq!(background("blurred"), Ok(Background::Surroundings { blurred: true }));
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
