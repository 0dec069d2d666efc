//! The table of options of jobs on files.

use lodsmith::{NonManifold, Sheets};
use lodsmith_bake::{AtlasMode, MapKind};
use lodsmith_io::gltf::Compression;
use lodsmith_io::{Format, Textures};

use super::entry::{FileKind, FileOption, OptionSection, file_options};
use super::words::{flag, names, output_format, output_names, parsed, word};
use crate::destination::Up;
use crate::lod::Naming;
use crate::normals::Normals;
use crate::request::verb::Verb;
use crate::values::{
    above_zero, below_one, count, importance, length, memory, ratio, rays, seconds, some_length,
    texture_size, threads, view_deg,
};
use FileKind::{Count, Flag, Length, List, Number, Path, Ratio, Repeated, Text, Word};
use Verb::{Bake, Clean, Convert, Lod, Simplify};

const ALL: [Verb; Verb::ALL.len()] = Verb::ALL;
const ENGINE: [Verb; 2] = [Simplify, Lod];
const BAKES: [Verb; 3] = [Simplify, Lod, Bake];
const WRITE: [Verb; 5] = [Simplify, Lod, Convert, Clean, Bake];

file_options! {
    /// The options of jobs on files, without the options of the engine.
    OPTIONS:
    "name" (Text) [Lod] Output "TEMPLATE" "File names in the folder [default: by --naming]"
        |o, v| o.name = Some(parsed(v, |text| Ok(text.to_owned()))?);

    "levels" (List(&Ratio)) [Lod] Levels "R,..."
        "Fractions of the triangles to keep, in falling order (0.5,0.25 or 50%,25%)"
        excludes "faces" "count" "errors" |o, v| o.ratios.push(parsed(v, ratio)?);
    "faces" (List(&Count)) [Lod] Levels "N,..." "Numbers of triangles, in falling order"
        excludes "count" "errors" |o, v| o.faces.push(parsed(v, count)?);
    "count" (Count) [Lod] Levels "N" "Number of levels; each keeps --factor of the previous one"
        excludes "errors" |o, v| o.count = Some(parsed(v, count)?);
    "errors" (List(&Length)) [Lod] Levels "D,..."
        "Largest deviations, in rising order, in units of the file or as shares of the diagonal (0.1%)"
        |o, v| o.errors.push(parsed(v, length)?);
    "factor" (Ratio) [Lod] Levels "F"
        "With --count, the fraction of the triangles of the previous level that each level keeps"
        default "0.5" needs "count" excludes "levels" "faces" "errors" |o, v| o.factor = Some(parsed(v, below_one)?);

    "pixels" (Number) [Lod] Switching "N" "Largest permitted deviation on the screen, in pixels"
        default "1" |o, v| o.screen.pixels = parsed(v, above_zero)?;
    "fov" (Number) [Lod] Switching "DEG" "Vertical field of view, in degrees"
        default "60" |o, v| o.screen.fov_deg = parsed(v, view_deg)?;
    "height" (Number) [Lod] Switching "PX" "Height of the screen, in pixels"
        default "1080" |o, v| o.screen.height_px = parsed(v, above_zero)?;

    "weld" (Length) [Clean] Repair "D"
        "Merge vertices closer than D, in units of the file or as a share of the diagonal (0.1%) [default: only \
         coincident ones]"
        |o, v| o.clean.weld = Some(parsed(v, some_length)?);
    "non-manifold" (Word(names::<NonManifold>)) [Clean] Repair "POLICY"
        "Treatment of edges with more than two faces, and of vertices where the surface touches itself; see below"
        default "keep" |o, v| o.clean.non_manifold = word(v)?;
    "prune" (Length) [Clean] Repair "SIZE"
        "Remove connected parts smaller than this (diagonal of their box, in units or as a share: 0.1%)"
        |o, v| o.clean.prune = Some(parsed(v, some_length)?);
    "sheets" (Word(names::<Sheets>)) [Clean] Repair "SIDES"
        "Keep both sides of sheets (faces back to back), or a single side; see below"
        default "both" |o, v| o.clean.sheets = word(v)?;

    "lock" (Repeated(&Text)) ENGINE Simplification "NAME"
        "Keep a part unchanged, bit for bit: a material, group, object, mesh or node, or the vertices where an \
         attribute is not zero; may be repeated"
        |o, v| o.names.lock.push(parsed(v, |text| Ok(text.to_owned()))?);
    "importance" (Text) ENGINE Simplification "NAME[=STRENGTH]"
        "Keep more triangles where a vertex attribute is large: at 1, or at the largest value if that is above \
         1, STRENGTH times as many per area as at 0 [default STRENGTH: 4]"
        |o, v| o.names.importance = Some(parsed(v, importance)?);

    "error-map" (Text) ENGINE Simplification "NAME"
        "Multiply the limit of --error by a vertex attribute, from 0 (keep unchanged) to 1"
        |o, v| o.names.error_map = Some(parsed(v, |text| Ok(text.to_owned()))?);

    "bake" (List(&Word(names::<MapKind>))) ENGINE Baking "MAPS"
        "Bake the lost detail into textures of these kinds, see `lodsmith bake --help` [default: none]"
        |o, v| o.add_map(word(v)?);
    "maps" (List(&Word(names::<MapKind>))) [Bake] Baking "MAPS" "Maps to bake"
        default "normal,color,ao" |o, v| o.add_map(word(v)?);
    "texture-size" (Count) BAKES Baking "N"
        "Width and height of the maps, in texels [default: from the detail of the source, 256 to 4096]"
        needs "bake" |o, v| o.bake.size = Some(parsed(v, texture_size)?);
    "atlas" (Word(names::<AtlasMode>)) BAKES Baking "ATLAS"
        "Texture coordinates: keep those that do not overlap, or make a new atlas with one material"
        default "keep" |o, v| o.bake.atlas = word(v)?;
    "ao-rays" (Count) BAKES Baking "N" "Rays per texel for ambient occlusion"
        default "32" |o, v| o.bake.rays = parsed(v, rays)?;
    "ao-distance" (Number) BAKES Baking "D"
        "Ignore faces farther than D for ambient occlusion, in units of the model [default: no limit]"
        needs "bake" |o, v| o.bake.occlusion_distance = Some(parsed(v, above_zero)?);
    "map-files" (Flag) BAKES Baking "" "Also write every map as a PNG file beside the output"
        needs "bake" |o, v| o.map_files = flag(v)?;

    "from" (Word(names::<Format>)) ALL Reading "FORMAT" "Format of the inputs [default: detected from the content]"
        |o, v| o.from = Some(word(v)?);
    "asset-root" (Path) ALL Reading "DIR"
        "Allow models to refer to files in DIR and below, not only in their own folder and below"
        |o, v| o.asset_root = Some(v.into());
    "allow-outside" (Flag) ALL Reading ""
        "Allow models to refer to any file; use it only for models that you trust"
        excludes "asset-root" |o, v| o.allow_outside = flag(v)?;

    "naming" (Word(names::<Naming>)) [Lod] Writing "STYLE" "Naming of files, meshes and nodes, see below"
        default "plain" |o, v| o.naming = word(v)?;
    "geomorph" (Flag) [Lod] Writing ""
        "Store the position of each vertex in the next coarser level: `_GEOMORPH` in GLB, `geomorph_x` and so on in PLY"
        |o, v| o.geomorph = flag(v)?;
    "to" (Word(output_names)) WRITE Writing "FORMAT"
        "Format of the output [default: from its file name]"
        |o, v| o.to = Some(output_format(v)?);
    "ascii" (Flag) WRITE Writing "" "Write text instead of binary (PLY, STL)" |o, v| o.writing.ascii = flag(v)?;
    "textures" (Word(names::<Textures>)) WRITE Writing "POLICY"
        "Copy material and image files to the folder of the output (OBJ, .gltf), link to them, or write none (OBJ)"
        default "copy" |o, v| o.writing.textures = word(v)?;
    "compress" (Word(names::<Compression>)) WRITE Writing "HOW"
        "Compress geometry and animations without loss (glTF, GLB): none, meshopt (EXT_meshopt_compression, which most \
         programs read), or meshopt-khr (KHR_meshopt_compression, smaller)"
        default "none" |o, v| o.writing.packing.compression = word(v)?;
    "quantize" (Flag) WRITE Writing ""
        "Quantize attributes (glTF, GLB): positions to 14 bits, normals to 8; readers need KHR_mesh_quantization"
        |o, v| o.writing.packing.quantize = flag(v)?;
    "scale" (Number) WRITE Writing "F" "Multiply every coordinate of the output by F"
        |o, v| o.writing.scale = Some(parsed(v, above_zero)?);
    "up" (Word(names::<Up>)) WRITE Writing "AXIS" "Rotate the output about x so that this axis points up"
        |o, v| o.writing.up = Some(word(v)?);
    "force" (Flag) WRITE Writing "" "Overwrite inputs and write-protected files (never folders)"
        |o, v| o.writing.force = flag(v)?;
    "normals" (Word(names::<Normals>)) ENGINE Writing "NORMALS"
        "Normals of the result: kept from the input, recomputed, or none"
        default "keep" |o, v| o.normals = word(v)?;
    "dry-run" (Flag) [Simplify, Lod, Clean] Writing "" "Print the report without writing a file"
        |o, v| o.dry_run = flag(v)?;

    "strict" (Flag) [Simplify, Lod, Clean] Run "" "Exit with status 3 if a target is not reached or data are dropped"
        |o, v| o.strict = flag(v)?;
    "strict" (Flag) [Convert, Bake] Run "" "Exit with status 3 if data are dropped" |o, v| o.strict = flag(v)?;
    "threads" (Count) ALL Run "N" "Number of threads; the result does not depend on it [default: all cores]"
        |o, v| o.threads = Some(parsed(v, threads)?);
    "time-limit" (Number) ALL Run "S"
        "Stop after S seconds: simplify, lod and methods write the best result so far for each input; all other \
         commands fail and write nothing [default: no limit]"
        |o, v| o.time_limit = Some(parsed(v, seconds)?);
    "max-memory" (Text) ALL Run "SIZE"
        "Limit the memory of the process, such as 512M or 2G (powers of 1024); fail if more is needed [default: \
         three quarters of the memory of the machine or container]"
        |o, v| o.max_memory = Some(parsed(v, memory)?);
}
