//! Conversion of files to other formats.

use lodsmith_io::{Format, ReadOptions, Sizes, Warning};
use serde_json::{Value, json};

use crate::asset::{Asset, Edit};
use crate::destination::Destination;
use crate::error::AssetError;
use crate::job::{Job, StageClock, Step};
use crate::paths::Source;
use crate::report_json::micros;
use crate::sizes::{self, WriteOutcome};
use crate::warnings::texts;

/// Outcome of a conversion.
#[derive(Debug)]
pub struct ConvertOutcome {
    /// Format of the input.
    pub input_format: Format,
    /// Number of faces, as in the file.
    pub faces: usize,
    /// Warnings of reading and of writing.
    pub warnings: Vec<Warning>,
    /// Sizes of the input; `None` if they are not known.
    pub sizes_before: Option<Sizes>,
    /// The outcome of writing, without its warnings.
    pub written: WriteOutcome,
    /// Seconds by stage.
    pub clock: StageClock,
}

/// Reads a file, rotates or scales it if requested, and writes it.
///
/// # Errors
/// Those of [`Asset::read`] and [`Asset::write`].
pub fn convert(
    source: &Source,
    reading: &ReadOptions,
    to: &Destination,
    job: &mut Job<'_>,
) -> Result<ConvertOutcome, AssetError> {
    job.set_stages(&[Step::Read, Step::Write]);
    job.enter(Step::Read);
    let asset = Asset::read(source, reading, to.keeps_scenes(), job)?;
    job.enter(Step::Write);
    let sizes_before = asset.sizes();
    let faces = match asset.scene() {
        Some(scene) => scene.contents().polygons,
        None => asset.counts()[0],
    };
    let mut warnings = asset.warnings().to_vec();
    if faces == 0 {
        // Meshes without faces are refused; a scene may be meant for its cameras or animations.
        warnings.push(Warning::lost("the scene has no faces, so the output has none"));
    }
    let input_format = asset.format();
    let mut written = asset.write(Edit::default(), to, job)?;
    warnings.append(&mut written.warnings);
    Ok(ConvertOutcome { input_format, faces, warnings, sizes_before, written, clock: job.times() })
}

impl ConvertOutcome {
    /// Returns the report, with this path of the input.
    pub fn to_json(&self, path: &str, to: &Destination) -> Value {
        let mut report = json!({
            "input": {
                "path": path, "format": self.input_format.name(), "faces": self.faces,
                "sizes": sizes::to_json(self.sizes_before),
            },
            "output": {
                "path": to.sink.to_string(), "format": to.format.name(),
                "sizes": sizes::to_json(self.written.sizes),
            },
            "warnings": texts(&self.warnings),
            "seconds": micros(self.clock.total()),
        });
        if let Some(packed) = &self.written.packed {
            report["output"]["packing"] = sizes::packed_json(packed);
        }
        report
    }
}
