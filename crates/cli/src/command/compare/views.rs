//! Visual comparison: renders both meshes from many directions and compares the images.

use std::time::Instant;

use anyhow::Context as _;
use lodsmith::core::{Image, Model};
use lodsmith_asset::picture::picture_format;
use lodsmith_asset::{Sink, Source};
use lodsmith_io::{Format, Loaded, ModelFile, read_model_path};
use lodsmith_render::image_error::{ImageError, cameras, image_error};
use lodsmith_render::{Background, Panel, PictureFormat, Shading, Subject, View, render, sheet};
use serde_json::{Value, json};

use crate::args::{CompareArgs, Reading};
use crate::file;
use crate::numbers::{micros, significant};
use crate::status::usage;

/// Result of the comparison.
pub(super) struct ViewComparison {
    views: Vec<ImageError>,
    size: [usize; 2],
    shading: Shading,
    /// Mean time to render one view of the reference and of the candidate.
    draw_seconds: [f64; 2],
}

/// Returns the format of the contact sheet, if one is requested.
pub(super) fn sheet_format(args: &CompareArgs) -> anyhow::Result<Option<PictureFormat>> {
    let Some(path) = &args.views_sheet else { return Ok(None) };
    Ok(Some(picture_format(&Sink::Path(path.clone()))?))
}

/// Renders both models from `count` directions and compares the images.
pub(super) fn compare_views(
    args: &CompareArgs,
    count: usize,
    loaded: [&Loaded; 2],
    format: Option<PictureFormat>,
) -> anyhow::Result<ViewComparison> {
    let models = [
        model(&args.reference, loaded[0], &args.reading)?,
        model(&args.candidate, loaded[1], &args.reading)?,
    ];
    let shading = Shading::intended_by(&models[0]);
    let reference = Subject::new(&models[0])?;
    let candidate = Subject::new(&models[1])?.with_creases(reference.creases());
    let subjects = [reference, candidate];
    let bounds =
        subjects[0].bounds().ok_or_else(|| usage(format!("{}: no faces to render", args.reference)))?;
    let [width, height] = args.size;
    let mut comparison =
        ViewComparison { views: Vec::new(), size: args.size, shading, draw_seconds: [0.0; 2] };
    let mut panels = Vec::new();
    for camera in cameras(&bounds, count, width as f64 / height as f64) {
        let mut view = View::new(camera, width, height);
        view.background = Background::Transparent;
        view.look.shading = shading;
        let mut draw = |side: usize| -> anyhow::Result<Image> {
            let start = Instant::now();
            let picture = render(&subjects[side], &view)?;
            comparison.draw_seconds[side] += start.elapsed().as_secs_f64() / count as f64;
            Ok(picture)
        };
        let pictures = [draw(0)?, draw(1)?];
        let error = image_error(&pictures[0], &pictures[1])?;
        comparison.views.push(error);
        if format.is_some() {
            let caption = format!("FLIP {}", significant(error.flip, 3));
            let captions = ["reference".to_owned(), caption];
            let pairs = pictures.into_iter().zip(captions);
            panels.extend(pairs.map(|(picture, caption)| Panel { picture, caption: vec![caption] }));
        }
    }
    if let (Some(format), Some(path)) = (format, &args.views_sheet) {
        // Two pairs in each row.
        let sheet = sheet(&panels, 4, Background::default(), None);
        file::write_picture(&sheet, &Sink::Path(path.clone()), format, args.force)?;
    }
    Ok(comparison)
}

/// Returns the model to render. A scene file is read again for its materials; for standard input, the mesh is
/// used, and also for 3MF, which has other coordinates as a scene.
fn model(source: &Source, loaded: &Loaded, reading: &Reading) -> anyhow::Result<Model> {
    match source {
        Source::Path(path) if loaded.format.is_scene() && loaded.format != Format::ThreeMf => {
            let mut options = reading.options();
            options.format = Some(loaded.format);
            Ok(read_model_path(path, &options).with_context(|| format!("{source}"))?.model)
        }
        _ => Ok(ModelFile::from(loaded.clone()).model),
    }
}

impl ViewComparison {
    fn mean_and_worst(&self) -> Option<[ImageError; 2]> {
        Some([ImageError::mean(&self.views)?, ImageError::worst(&self.views)?])
    }

    pub(super) fn to_json(&self) -> Value {
        let Some([mean, worst]) = self.mean_and_worst() else { return Value::Null };
        let both =
            |figure: fn(&ImageError) -> Value| json!({ "mean": figure(&mean), "worst": figure(&worst) });
        json!({
            "views": self.views.len(),
            "width": self.size[0],
            "height": self.size[1],
            "shading": self.shading.name(),
            "flip": both(|e| e.flip.into()),
            "ssim": both(|e| e.ssim.into()),
            "psnr_db": both(|e| e.psnr_db().into()),
            "silhouette": both(|e| e.silhouette.into()),
            "draw_seconds": {
                "reference": micros(self.draw_seconds[0]),
                "candidate": micros(self.draw_seconds[1]),
            },
        })
    }

    /// Returns the figures as a table.
    pub(super) fn table(&self) -> Vec<String> {
        let Some([mean, worst]) = self.mean_and_worst() else { return Vec::new() };
        let [width, height] = self.size;
        let line = |name: &str, shown: &dyn Fn(&ImageError) -> String| {
            format!("{name:<16}mean {}, worst {}", shown(&mean), shown(&worst))
        };
        let decibels = |e: &ImageError| e.psnr_db().map_or("∞".to_owned(), |x| significant(x, 4)) + " dB";
        let milliseconds = self.draw_seconds.map(|s| significant(1000.0 * s, 3));
        vec![
            format!("images          {} of {width} × {height}, {}", self.views.len(), self.shading.name()),
            line("  FLIP", &|e| significant(e.flip, 4)),
            line("  SSIM", &|e| significant(e.ssim, 4)),
            line("  PSNR", &decibels),
            line("  silhouette", &|e| format!("{} %", significant(100.0 * e.silhouette, 3))),
            format!("  render time   {} ms, {} ms", milliseconds[0], milliseconds[1]),
        ]
    }
}
