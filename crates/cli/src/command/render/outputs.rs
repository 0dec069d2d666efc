//! Outputs of `lodsmith render`: one picture, an animated PNG, or a folder of frames.

use std::f64::consts::TAU;
use std::fmt;
use std::path::{Path, PathBuf};

use anyhow::Context as _;
use lodsmith::core::Image;
use lodsmith_render::{AnimationError, AnimationOptions, Background, PictureFormat, encode_animation};
use serde_json::{Value, json};

use crate::args::RenderArgs;
use crate::picture;
use crate::progress::FileProgress;
use crate::status::usage;
use lodsmith_asset::{Sink, Source, paths};

/// Destination of what is rendered.
pub(super) enum Outputs {
    /// One picture.
    Picture { sink: Sink, format: PictureFormat },
    /// An animated PNG of this many frames.
    Animation { sink: Sink, frames: usize },
    /// A picture for each frame.
    Frames { folder: PathBuf, files: Vec<PathBuf>, format: PictureFormat },
}

impl Outputs {
    /// Checks the outputs of a command line.
    ///
    /// # Errors
    /// A usage error if they are not pictures, are inputs, or do not suit a turntable.
    pub(super) fn new(args: &RenderArgs) -> anyhow::Result<Self> {
        let inputs = || args.inputs.iter().chain(&args.compare);
        if let (Some(folder), Some(count)) = (&args.turntable.out_dir, args.turntable.frames) {
            let all = frames(args, folder, count)?;
            if folder.exists() && !folder.is_dir() {
                return Err(usage(format!("{}: is not a folder", folder.display())));
            }
            let Self::Frames { files, .. } = &all else { return Ok(all) };
            for file in files {
                let sink = Sink::Path(file.clone());
                paths::refuse_folder(&sink, "")?;
                paths::refuse_inputs(&sink, inputs(), args.force)?;
            }
            return Ok(all);
        }
        let sink = args.output.clone().unwrap_or(Sink::Stream);
        let format = picture::format_of(&sink)?;
        paths::refuse_inputs(&sink, inputs(), args.force)?;
        if sink == Sink::Stream && args.json {
            return Err(usage("the picture and --json both want standard output: give the picture a file"));
        }
        match args.turntable.frames {
            None => Ok(Self::Picture { sink, format }),
            Some(frames) if format == PictureFormat::Png => Ok(Self::Animation { sink, frames }),
            Some(_) => Err(usage(format!(
                "{sink}: a turntable is written as an animated .png, or with -O as one picture for each frame"
            ))),
        }
    }

    /// Returns true if a picture goes to standard output.
    pub(super) fn is_stdout(&self) -> bool {
        matches!(self, Self::Picture { sink, .. } | Self::Animation { sink, .. } if *sink == Sink::Stream)
    }

    /// Returns the output as part of the report.
    pub(super) fn to_json(&self, [width, height]: [usize; 2]) -> Value {
        let (format, frames) = match self {
            Self::Picture { format, .. } => (format.name(), None),
            Self::Animation { frames, .. } => ("apng", Some(*frames)),
            Self::Frames { files, format, .. } => (format.name(), Some(files.len())),
        };
        let path = match self {
            Self::Picture { sink, .. } | Self::Animation { sink, .. } => sink.to_string(),
            Self::Frames { folder, .. } => folder.display().to_string(),
        };
        let mut object = json!({ "path": path, "format": format, "width": width, "height": height });
        if let Some(frames) = frames {
            object["frames"] = frames.into();
        }
        object
    }

    /// Writes all that is wanted; `draw` renders it after the cameras went around by an angle in radians. Returns
    /// the size of the picture, or of each.
    pub(super) fn write(
        &self,
        args: &RenderArgs,
        bar: &FileProgress<'_>,
        draw: &mut dyn FnMut(f64) -> anyhow::Result<Image>,
    ) -> anyhow::Result<[usize; 2]> {
        let mut size = [0; 2];
        let mut draw = |turn_rad: f64| {
            let picture = draw(turn_rad)?;
            size = [picture.width(), picture.height()];
            anyhow::Ok(picture)
        };
        let turn = |frame: usize, all: usize| TAU * frame as f64 / all as f64;
        match self {
            Self::Picture { sink, format } => picture::write(&draw(0.0)?, sink, *format, args.force)?,
            Self::Animation { sink, frames } => {
                let options = AnimationOptions {
                    frames: *frames as u32,
                    fps: args.turntable.fps,
                    has_alpha: args.look.background == Background::Transparent,
                };
                let frames = (0..*frames).map(|i| {
                    bar.frame(i, *frames);
                    draw(turn(i, *frames)).map_err(AnimationFailure)
                });
                let bytes = encode_animation(options, frames).map_err(|AnimationFailure(error)| error)?;
                bar.write();
                picture::write_bytes(&bytes, sink, args.force)?;
            }
            Self::Frames { folder, files, format } => {
                std::fs::create_dir_all(folder).with_context(|| folder.display().to_string())?;
                for (i, file) in files.iter().enumerate() {
                    bar.frame(i, files.len());
                    let sink = Sink::Path(file.clone());
                    picture::write(&draw(turn(i, files.len()))?, &sink, *format, args.force)?;
                }
            }
        }
        Ok(size)
    }
}

impl fmt::Display for Outputs {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Picture { sink, .. } => sink.fmt(f),
            Self::Animation { sink, frames } => write!(f, "{sink}: {frames} frames"),
            Self::Frames { folder, files, .. } => write!(f, "{}: {} pictures", folder.display(), files.len()),
        }
    }
}

/// An error of rendering or encoding a frame.
struct AnimationFailure(anyhow::Error);

impl From<AnimationError> for AnimationFailure {
    fn from(error: AnimationError) -> Self {
        Self(error.into())
    }
}

/// Returns the files of the frames, named by the template. Numbers begin at 0 and have as many digits as the
/// last, so that they sort by name.
fn frames(args: &RenderArgs, folder: &Path, count: usize) -> anyhow::Result<Outputs> {
    let template = &args.turntable.name;
    let unknown = template.replace("{stem}", "").replace("{frame}", "");
    if unknown.contains(['{', '}']) {
        return Err(usage(format!("--name {template}: only {{stem}} and {{frame}} are known")));
    }
    if !template.contains("{frame}") {
        return Err(usage(format!(
            "--name {template}: {{frame}} is missing, so all frames would be one file"
        )));
    }
    let stem = match &args.inputs[0] {
        Source::Path(path) => path.as_path(),
        Source::Stream => Path::new("stdin"),
    };
    let is_gz = stem.extension().is_some_and(|e| e.eq_ignore_ascii_case("gz"));
    let plain = if is_gz { stem.with_extension("") } else { stem.to_owned() };
    let stem = plain.file_stem().map(|s| s.to_string_lossy().into_owned()).unwrap_or_default();
    let digits = (count - 1).to_string().len();
    let name = |i: usize| {
        let name = template.replace("{frame}", &format!("{i:0digits$}")).replace("{stem}", &stem);
        if name.contains(['/', '\\']) {
            return Err(usage(format!("--name {template}: a name in the folder is wanted, not {name}")));
        }
        Ok(folder.join(name))
    };
    let files = (0..count).map(name).collect::<anyhow::Result<Vec<_>>>()?;
    let format = picture::of_path(&files[0])
        .ok_or_else(|| usage(format!("--name {template}: it must end in .png, .jpg or .webp")))?;
    Ok(Outputs::Frames { folder: folder.to_owned(), files, format })
}
