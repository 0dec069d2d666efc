//! Outputs of pictures: one picture, an animated PNG, or a folder of frames.

use std::f64::consts::TAU;
use std::fmt;
use std::path::{Path, PathBuf};

use lodsmith_core::Image;
use lodsmith_render::{AnimationOptions, PictureFormat, encode, encode_animation};
use serde_json::Value;

use super::recipe::PictureRecipe;
use crate::error::{AssetError, usage};
use crate::job::{Job, Step};
use crate::paths::{self, Sink, Source};
use crate::plan::Outputs;

/// Destination of rendered pictures.
#[derive(Clone, Debug)]
pub struct PictureOutput {
    files: PictureFiles,
    force: bool,
}

#[derive(Clone, Debug)]
enum PictureFiles {
    /// One picture.
    One { sink: Sink, format: PictureFormat },
    /// An animated PNG.
    Animation { sink: Sink, frames: usize, fps: u16 },
    /// One picture for each frame.
    Frames { folder: PathBuf, files: Vec<PathBuf>, format: PictureFormat },
}

/// Renders the picture with cameras rotated by an angle in radians.
pub(super) type Draw<'d> = &'d mut dyn FnMut(f64) -> Result<Image, AssetError>;

impl PictureOutput {
    /// Plans the outputs; `None` if there are none. `template` names the frames in a folder.
    ///
    /// # Errors
    /// [`AssetError::Usage`] if they are not pictures, are inputs, or do not suit a turntable.
    pub fn new(
        outputs: &Outputs<'_>,
        template: Option<&str>,
        recipe: &PictureRecipe,
    ) -> Result<Option<Self>, AssetError> {
        if template.is_some() && outputs.out_dir.is_none() {
            return Err(usage("--name needs a folder for the images"));
        }
        let force = outputs.writing.force;
        let refuse_inputs =
            |sink: &Sink| paths::refuse_inputs(sink, outputs.inputs.iter().chain(&recipe.compare), force);
        if let Some(folder) = outputs.out_dir {
            let count = recipe.turntable.ok_or_else(|| usage("a folder of images needs --turntable"))?;
            let template = template.unwrap_or("{stem}_{frame}.png");
            let (files, format) = frames(outputs, template, folder, count)?;
            if folder.exists() && !folder.is_dir() {
                return Err(usage(format!("{}: is not a folder", folder.display())));
            }
            for file in &files {
                let sink = Sink::Path(file.clone());
                paths::refuse_folder(&sink, "")?;
                refuse_inputs(&sink)?;
            }
            let folder = folder.to_owned();
            return Ok(Some(Self { files: PictureFiles::Frames { folder, files, format }, force }));
        }
        let Some(sink) = outputs.output.cloned() else { return Ok(None) };
        let format = picture_format(&sink)?;
        refuse_inputs(&sink)?;
        if sink == Sink::Stream && outputs.json {
            return Err(usage("standard output cannot have both the image and --json: write to a file"));
        }
        let files = match recipe.turntable {
            None => PictureFiles::One { sink, format },
            Some(frames) if format == PictureFormat::Png => {
                PictureFiles::Animation { sink, frames, fps: recipe.fps }
            }
            Some(_) => {
                return Err(usage(format!(
                    "{sink}: a turntable is written as an animated .png, or with --out-dir as one image for each frame"
                )));
            }
        };
        Ok(Some(Self { files, force }))
    }

    /// Returns true if an image goes to standard output.
    pub fn is_stdout(&self) -> bool {
        use PictureFiles::{Animation, One};
        matches!(&self.files, One { sink, .. } | Animation { sink, .. } if *sink == Sink::Stream)
    }

    /// Adds the output to the part of a report that has the size.
    pub(super) fn describe(&self, report: &mut Value) {
        let (path, format, frames) = match &self.files {
            PictureFiles::One { sink, format } => (sink.to_string(), format.name(), None),
            PictureFiles::Animation { sink, frames, .. } => (sink.to_string(), "apng", Some(*frames)),
            PictureFiles::Frames { folder, files, format } => {
                (folder.display().to_string(), format.name(), Some(files.len()))
            }
        };
        (report["path"], report["format"]) = (path.into(), format.into());
        if let Some(frames) = frames {
            report["frames"] = frames.into();
        }
    }

    /// Renders and writes all pictures.
    pub(super) fn write(&self, has_alpha: bool, draw: Draw<'_>, job: &mut Job<'_>) -> Result<(), AssetError> {
        let turn = |frame: usize, all: usize| TAU * frame as f64 / all as f64;
        match &self.files {
            PictureFiles::One { sink, format } => write_picture(&draw(0.0)?, sink, *format, self.force, job),
            PictureFiles::Animation { sink, frames: count, fps } => {
                let options = AnimationOptions { frames: *count as u32, fps: *fps, has_alpha };
                let frames = (0..*count).map(|i| {
                    job.frame(i, *count);
                    draw(turn(i, *count))
                });
                let bytes = encode_animation(options, frames)?;
                job.enter(Step::Write);
                job.put_bytes(&bytes, sink, self.force)
            }
            PictureFiles::Frames { folder, files, format } => {
                std::fs::create_dir_all(folder)
                    .map_err(|problem| AssetError::File { path: folder.clone(), problem })?;
                for (i, file) in files.iter().enumerate() {
                    job.frame(i, files.len());
                    let picture = draw(turn(i, files.len()))?;
                    write_picture(&picture, &Sink::Path(file.clone()), *format, self.force, job)?;
                }
                Ok(())
            }
        }
    }
}

impl fmt::Display for PictureOutput {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match &self.files {
            PictureFiles::One { sink, .. } => sink.fmt(f),
            PictureFiles::Animation { sink, frames, .. } => write!(f, "{sink}: {frames} frames"),
            PictureFiles::Frames { folder, files, .. } => {
                write!(f, "{}: {} images", folder.display(), files.len())
            }
        }
    }
}

/// Returns the image format of an output by its file extension; for standard output, PNG.
///
/// # Errors
/// [`AssetError::Usage`] if the extension is not of an image format, or if the output is a folder.
pub fn picture_format(sink: &Sink) -> Result<PictureFormat, AssetError> {
    paths::refuse_folder(sink, "")?;
    match sink {
        Sink::Stream => Ok(PictureFormat::Png),
        Sink::Path(path) => PictureFormat::of_path(path).ok_or_else(|| {
            usage(format!("{}: the file name must end in .png, .jpg or .webp", path.display()))
        }),
    }
}

/// Writes an image completely or not at all.
///
/// # Errors
/// Those of [`Job::put`]; [`AssetError::Picture`] if the format does not allow its size.
pub fn write_picture(
    picture: &Image,
    sink: &Sink,
    format: PictureFormat,
    force: bool,
    job: &mut Job<'_>,
) -> Result<(), AssetError> {
    let bytes = encode(picture, format)
        .map_err(|why| AssetError::from(why).of(format_args!("{sink}: cannot be stored")))?;
    job.put_bytes(&bytes, sink, force)
}

/// Returns the files of the frames, named by the template, and their format. Numbers start at 0 and have as many digits
/// as the last one, so that the files sort by name.
fn frames(
    outputs: &Outputs<'_>,
    template: &str,
    folder: &Path,
    count: usize,
) -> Result<(Vec<PathBuf>, PictureFormat), AssetError> {
    let unknown = template.replace("{stem}", "").replace("{frame}", "");
    if unknown.contains(['{', '}']) {
        return Err(usage(format!("--name {template}: only {{stem}} and {{frame}} are known")));
    }
    if !template.contains("{frame}") {
        return Err(usage(format!(
            "--name {template}: {{frame}} is missing, so all frames would be one file"
        )));
    }
    let stem = paths::stem(outputs.inputs.first().unwrap_or(&Source::Stream).name());
    let digits = (count - 1).to_string().len();
    let name = |i: usize| {
        let name = template.replace("{frame}", &format!("{i:0digits$}")).replace("{stem}", &stem);
        if name.contains(['/', '\\']) {
            return Err(usage(format!("--name {template}: {name} is a path; only a file name is allowed")));
        }
        Ok(folder.join(name))
    };
    let files = (0..count).map(name).collect::<Result<Vec<_>, _>>()?;
    let format = PictureFormat::of_path(&files[0])
        .ok_or_else(|| usage(format!("--name {template}: the name must end in .png, .jpg or .webp")))?;
    Ok((files, format))
}
