//! The table of options of pictures.

use lodsmith::MethodKind;
use lodsmith_render::{ColorMap, Shading, StandardView};

use super::entry::{FileKind, FileOption, OptionSection, file_options};
use super::words::{flag, names, parsed, word};
use crate::destination::Up;
use crate::paths::Source;
use crate::picture::Surroundings;
use crate::picture::words::{
    background, color, elevation_deg, finite, fov_deg, fps, frames, light, not_negative, range, size,
};
use crate::request::verb::Verb;
use crate::values::{above_zero, count};
use FileKind::{Count, Flag, List, Number, Path, Repeated, Text, Word};
use Verb::Render;

file_options! {
    /// The options of pictures, without the options of all jobs.
    OPTIONS:
    "compare" (Path) [Render] Output "REFERENCE" "Reference to render first, with the same camera"
        |o, v| o.picture.compare = Some(Source::from(v.to_owned()));
    "levels" (List(&Count)) [Render] Output "N,..." "Render the model and its simplifications to N faces side by side"
        excludes "compare" |o, v| o.picture.levels.push(parsed(v, count)?);
    "method" (Word(names::<MethodKind>)) [Render] Output "METHOD" "Method for --levels; see lodsmith simplify --help"
        default "memoryless" needs "levels" |o, v| o.picture.method = word(v)?;

    "shading" (Word(names::<Shading>)) [Render] Look "SHADING"
        "Shading of surfaces, see below [default: textured if there are materials, else vertex-colors if there are \
         colours, else smooth]"
        |o, v| o.picture.shading = Some(word(v)?);
    "color" (Text) [Render] Look "COLOR" "Colour of the surface, as #rrggbb"
        |o, v| o.picture.look.surface = parsed(v, color)?;
    "wireframe" (Flag) [Render] Look "" "Draw the edges of all faces" |o, v| o.picture.look.wireframe = flag(v)?;
    "wire-width" (Number) [Render] Look "PX" "Width of these lines"
        |o, v| o.picture.look.wire_width_px = parsed(v, above_zero)? as f32;
    "borders" (Flag) [Render] Look "" "Draw open borders in red" |o, v| o.picture.look.borders = flag(v)?;
    "defects" (Flag) [Render] Look ""
        "Draw non-manifold edges in violet, faces without area in yellow, duplicate faces in blue"
        |o, v| o.picture.look.defects = flag(v)?;
    "cull" (Flag) [Render] Look "" "Hide faces seen from behind" |o, v| o.picture.look.cull_back = flag(v)?;
    "matcap" (Path) [Render] Look "FILE" "Image of a lit sphere for --shading matcap [default: clay]"
        |o, v| o.picture.matcap = Some(v.into());
    "range" (Text) [Render] Look "LOW,HIGH"
        "Distances at the ends of the colour scale of --shading heat, in units of the file [default: 0 and the largest]"
        |o, v| o.picture.look.heat_range = Some(parsed(v, range)?);
    "colors" (Word(names::<ColorMap>)) [Render] Look "MAP" "Colour scale of --shading heat"
        default "turbo" |o, v| o.picture.look.color_map = word(v)?;
    "light" (Repeated(&Text)) [Render] Look "LIGHT" "Light, see below; may be repeated"
        |o, v| o.picture.lights.push(parsed(v, light)?);
    "environment" (Path) [Render] Look "ENVIRONMENT"
        "Environment that lights the model and is reflected in materials: studio, none, or a panorama twice as wide as \
         high (.hdr, .png, .jpg); auto is studio for models with metal, or if the environment is the background"
        default "auto" |o, v| o.picture.environment = Surroundings::from(v.to_owned());
    "occlusion" (Flag) [Render] Look "" "Darken creases (ambient occlusion)" |o, v| o.picture.occlusion = flag(v)?;
    "shadow" (Flag) [Render] Look "" "Draw a shadow on the ground" |o, v| o.picture.ground.shadow = flag(v)?;
    "grid" (Flag) [Render] Look "" "Draw a grid on the ground" |o, v| o.picture.ground.grid = flag(v)?;
    "background" (Text) [Render] Look "BACKGROUND" "Background, see below"
        default "gradient" |o, v| o.picture.background = parsed(v, background)?;

    "view" (Word(names::<StandardView>)) [Render] View "VIEW" "Direction of the camera"
        default "iso" |o, v| o.picture.viewpoint.view = word(v)?;
    "azimuth" (Number) [Render] View "DEG"
        "Camera angle around the model from the front to the right, in degrees, instead of --view"
        excludes "view" |o, v| o.picture.viewpoint.azimuth_deg = Some(parsed(v, finite)?);
    "elevation" (Number) [Render] View "DEG" "Camera angle above the horizon, in degrees, instead of --view"
        excludes "view" |o, v| o.picture.viewpoint.elevation_deg = Some(parsed(v, elevation_deg)?);
    "up" (Word(names::<Up>)) [Render] View "AXIS" "Axis that points up in the files"
        default "y" |o, v| o.picture.up = word(v)?;
    "fov" (Number) [Render] View "DEG" "Vertical field of view, in degrees [default: 35]"
        excludes "parallel" |o, v| o.picture.viewpoint.fov_deg = Some(parsed(v, fov_deg)?);
    "parallel" (Flag) [Render] View "" "Use a parallel projection" |o, v| o.picture.viewpoint.parallel = flag(v)?;

    "clip" (Text) [Render] Animation "NAME"
        "Animation of a glTF file, by name or by number from 1 [default: the first with --time, else none]"
        |o, v| o.picture.clip = Some(parsed(v, |text| Ok(text.to_owned()))?);
    "time" (Number) [Render] Animation "SECONDS" "Time in the animation, in seconds [default: 0]"
        |o, v| o.picture.time = Some(parsed(v, not_negative)?);

    "turntable" (Count) [Render] Turntable "N"
        "Render N views around the model: an animated PNG with -o, one image per view with -O"
        |o, v| o.picture.turntable = Some(parsed(v, frames)?);
    "fps" (Count) [Render] Turntable "N" "Frames per second of the animated PNG"
        default "20" needs "turntable" |o, v| o.picture.fps = parsed(v, fps)?;
    "name" (Text) [Render] Turntable "TEMPLATE"
        "File names in the folder (.png, .jpg, .webp) [default: {stem}_{frame}.png]"
        |o, v| o.name = Some(parsed(v, |text| Ok(text.to_owned()))?);

    "size" (Text) [Render] Picture "WxH"
        "Size of the image, or of each image if there are several [default: 1200x800, several 480x480]"
        |o, v| o.picture.size = Some(parsed(v, size)?);
    "columns" (Count) [Render] Picture "N" "Images per row [default: up to 4]"
        |o, v| o.picture.columns = Some(parsed(v, count)?);
    "no-captions" (Flag) [Render] Picture "" "Leave out the captions" |o, v| o.picture.captions = !flag(v)?;
    "fine" (Flag) [Render] Picture "" "Use 16 samples per pixel instead of 4" |o, v| o.picture.fine = flag(v)?;

    "force" (Flag) [Render] Run "" "Overwrite inputs and write-protected files (never folders)"
        |o, v| o.writing.force = flag(v)?;
}
