//! What can be typed after `lodsmith clusters`.

use clap::{Args, Subcommand};
use lodsmith::ClusterLodOptions;
use lodsmith::core::clusters::Eye;
use lodsmith_io::Format;

use super::engine::AttributeName;
use super::{BorderChoice, Ending, Run, TypedLength, Writing, values};
use crate::file::{Sink, Source};

/// What is done with clusters.
#[derive(Debug, Subcommand)]
pub(crate) enum ClustersCommand {
    /// Make a file of clusters at all levels of detail
    Build(Box<BuildArgs>),
    /// Take one surface out of it, by an error or for an eye
    Cut(Box<CutArgs>),
    /// What is in such a file: levels, clusters, how full they are, errors
    Info(LevelsArgs),
}

const AFTER_BUILD: &str = "\
The file holds the original triangles in clusters, lighter clusters for groups of them, and so on up to a single one. \
An engine draws the clusters that are good enough and whose parents are not; any such choice is free of cracks. \
docs/cluster-lod.md says how the file is laid out and how to choose.

Examples:
  lodsmith clusters build statue.ply -o statue.lclod
  lodsmith clusters build rock.glb -o rock.lclod --triangles 124 --vertices 64";

const AFTER_CUT: &str = "\
Examples:
  lodsmith clusters cut statue.lclod -o far.glb --error 0.1%
  lodsmith clusters cut statue.lclod -o seen.ply --eye 0,1.5,4 --pixels 1 --height 1080
  lodsmith clusters cut rock.lclod -o rock_low.glb --error 0.02 --materials rock.glb";

#[derive(Args, Debug)]
#[command(after_help = AFTER_BUILD)]
pub(crate) struct BuildArgs {
    /// The file to read; `-` is standard input
    #[arg(value_name = "IN")]
    pub(crate) input: Source,
    /// Where the clusters go, usually NAME.lclod; `-` is standard output
    #[arg(short, long, value_name = "OUT")]
    pub(crate) output: Sink,
    /// Triangles of a cluster, at most: 8 to 256
    #[arg(long, value_name = "N", value_parser = values::cluster_size, help_heading = "How",
          default_value_t = ClusterLodOptions::default().triangles)]
    pub(crate) triangles: usize,
    /// Vertices of a cluster, at most, those of seams counted once for each side: 8 to 256
    #[arg(long, value_name = "N", value_parser = values::cluster_size, help_heading = "How",
          default_value_t = ClusterLodOptions::default().vertices)]
    vertices: usize,
    /// About how many clusters become lighter together: 4 to 64
    #[arg(long, value_name = "N", value_parser = values::group_size, help_heading = "How",
          default_value_t = ClusterLodOptions::default().group)]
    group: usize,
    /// Open borders
    #[arg(long, value_name = "POLICY", value_enum, default_value_t, help_heading = "How")]
    border: BorderChoice,
    /// How much an attribute counts, times what it counts by itself: normal, uv, color, morph, skin, other; or the
    /// lines of open borders: border; may be repeated
    #[arg(long, value_name = "NAME=W", value_parser = values::weight, help_heading = "How")]
    weight: Vec<(AttributeName, f64)>,
    /// Format of the input, whatever its content
    #[arg(long, value_name = "FORMAT", value_parser = values::format(), help_heading = "Writing")]
    pub(crate) from: Option<Format>,
    /// Overwrite a write-protected output too; a folder is never overwritten
    #[arg(long, help_heading = "Writing")]
    pub(crate) force: bool,
    #[command(flatten)]
    pub(crate) ending: Ending,
    #[command(flatten)]
    pub(crate) run: Run,
}

impl BuildArgs {
    /// What the library is told.
    pub(crate) fn options(&self) -> ClusterLodOptions {
        let mut options = ClusterLodOptions::default();
        (options.triangles, options.vertices, options.group) = (self.triangles, self.vertices, self.group);
        options.border = self.border.into();
        for (name, weight) in &self.weight {
            *name.of(&mut options.weights) = *weight;
        }
        options
    }
}

#[derive(Args, Debug)]
#[command(after_help = AFTER_CUT)]
pub(crate) struct CutArgs {
    /// The file of clusters; `-` is standard input
    #[arg(value_name = "IN")]
    pub(crate) input: Source,
    /// Where the surface goes, in any format that is written; `-` is standard output
    #[arg(short, long, value_name = "OUT")]
    pub(crate) output: Sink,
    /// Largest distance from the original, in units of the file or of its diagonal (0.1%)
    #[arg(
        long,
        value_name = "D",
        help_heading = "Which",
        conflicts_with = "eye",
        required_unless_present = "eye"
    )]
    pub(crate) error: Option<TypedLength>,
    /// Choose for an eye at this place, finer where it is near
    #[arg(long, value_name = "X,Y,Z", value_parser = values::point, allow_hyphen_values = true, help_heading = "Which")]
    eye: Option<[f64; 3]>,
    /// Largest error that the eye may see, in pixels
    #[arg(long, value_name = "N", value_parser = values::above_zero, default_value_t = 1.0, requires = "eye",
          help_heading = "Which")]
    pub(crate) pixels: f64,
    /// Height of the picture in pixels
    #[arg(long, value_name = "N", value_parser = values::count, default_value_t = 1080, requires = "eye",
          help_heading = "Which")]
    height: usize,
    /// Height of the view in degrees
    #[arg(long, value_name = "DEG", value_parser = values::view_deg, default_value_t = 60.0, requires = "eye",
          help_heading = "Which")]
    fov: f64,
    /// The file that the clusters were made of: its libraries and textures go along
    #[arg(long, value_name = "FILE", help_heading = "Writing")]
    pub(crate) materials: Option<Source>,
    #[command(flatten)]
    pub(crate) writing: Writing,
    #[command(flatten)]
    pub(crate) ending: Ending,
    #[command(flatten)]
    pub(crate) run: Run,
}

impl CutArgs {
    /// The eye, where one is given; nothing is nearer than a millionth of the `diagonal`.
    pub(crate) fn eye(&self, diagonal: f64) -> Option<Eye> {
        let pixels_per_unit = self.height as f64 / (2.0 * (self.fov.to_radians() / 2.0).tan());
        let near = (1e-6 * diagonal).max(f64::MIN_POSITIVE);
        self.eye.map(|position| Eye { position, pixels_per_unit, near })
    }
}

#[derive(Args, Debug)]
pub(crate) struct LevelsArgs {
    /// The file of clusters; `-` is standard input
    #[arg(value_name = "IN")]
    pub(crate) input: Source,
    /// One JSON object
    #[arg(long)]
    pub(crate) json: bool,
    #[command(flatten)]
    pub(crate) run: Run,
}
