//! Outputs of levels: one file, or one file for each level and a list of the levels.

use std::fs;
use std::path::{Path, PathBuf};

use lodsmith_io::Format;
use serde_json::Value;

use crate::destination::Destination;
use crate::error::{AssetError, usage};
use crate::job::Job;
use crate::paths::{self, Sink, Source};
use crate::plan::{self, Outputs};

/// The list of levels in a folder.
const LIST_FILE: &str = "lods.json";

/// Naming style of levels.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Naming {
    /// `NAME_lod1`; in a single file, the original keeps its name.
    #[default]
    Plain,
    /// `NAME_LOD1`, which Unity recognises.
    Unity,
    /// `NAME_LOD1`.
    Unreal,
    /// `NAME_LOD1`.
    Godot,
}

impl Naming {
    /// All styles.
    pub const ALL: [Self; 4] = [Self::Plain, Self::Unity, Self::Unreal, Self::Godot];

    /// Returns the name of the style.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Plain => "plain",
            Self::Unity => "unity",
            Self::Unreal => "unreal",
            Self::Godot => "godot",
        }
    }

    /// Returns the text between the name and the number of a level.
    pub(super) const fn mark(self) -> &'static str {
        match self {
            Self::Plain => "_lod",
            Self::Unity | Self::Unreal | Self::Godot => "_LOD",
        }
    }
}

/// The outputs of the levels of one input.
#[derive(Clone, Debug)]
pub struct LevelOutputs {
    /// The input.
    pub source: Source,
    /// The output of the original, or of all levels; `None` without an output.
    pub first: Option<Destination>,
    /// Set if each level has its own file.
    pub(super) folder: Option<LevelFolder>,
}

impl LevelOutputs {
    /// Plans the outputs of the original and of `levels` levels below, and creates their folder. `template` names the
    /// files in a folder; without it, the style does.
    ///
    /// # Errors
    /// [`AssetError::Usage`], also if a level would overwrite the input; [`AssetError::Folder`].
    pub fn new(
        outputs: &Outputs<'_>,
        template: Option<&str>,
        naming: Naming,
        levels: usize,
    ) -> Result<Self, AssetError> {
        if template.is_some() && outputs.out_dir.is_none() {
            return Err(usage("--name needs a folder for the levels"));
        }
        let template =
            template.map_or_else(|| format!("{{stem}}{}{{level}}.{{ext}}", naming.mark()), str::to_owned);
        if outputs.out_dir.is_some() && !template.contains("{level}") {
            return Err(usage(format!(
                "--name {template}: {{level}} is missing, so all levels would be one file"
            )));
        }
        // The rest of the template is checked as for any output folder, with a number as level.
        let name = template.replace("{level}", "0");
        let assigned = plan::assign(&Outputs { name: &name, ..*outputs })?.remove(0);
        let folder = match (outputs.out_dir, &assigned.output) {
            (None, Some(Destination { sink, format, .. }))
                if !matches!(format, Format::Gltf | Format::Glb) =>
            {
                return Err(usage(format!(
                    "{sink}: only GLB and glTF have all levels in one file; use a folder (--out-dir) for {}",
                    format.title()
                )));
            }
            (Some(path), Some(to)) => Some(LevelFolder::new(path, &template, to)?),
            _ => None,
        };
        let planned = Self { source: assigned.source, first: assigned.output, folder };
        let is_allowed = outputs.writing.force || outputs.dry_run;
        for sink in planned.sinks(levels) {
            paths::refuse_inputs(&sink, [&planned.source], is_allowed)?;
        }
        Ok(planned)
    }

    /// Returns the outputs of the original and of this many levels below; empty without an output.
    pub(super) fn sinks(&self, levels: usize) -> Vec<Sink> {
        let sink = |level, first: &Sink| match &self.folder {
            Some(folder) => Sink::Path(folder.path.join(folder.file(level))),
            None => first.clone(),
        };
        self.first.iter().flat_map(|to| (0..=levels).map(|k| sink(k, &to.sink))).collect()
    }

    /// Writes the list of levels.
    pub(super) fn write_list(&self, list: &Value, job: &mut Job<'_>) -> Result<(), AssetError> {
        match (&self.folder, &self.first) {
            (Some(folder), Some(to)) if !to.dry_run => {
                let text = format!("{list:#}\n");
                let sink = Sink::Path(folder.path.join(LIST_FILE));
                job.put_bytes(text.as_bytes(), &sink, to.writing.force)
            }
            _ => Ok(()),
        }
    }
}

/// A folder with a file for each level.
#[derive(Clone, Debug)]
pub(super) struct LevelFolder {
    pub(super) path: PathBuf,
    /// Template of the file names, with a placeholder for the level.
    template: String,
}

impl LevelFolder {
    /// Makes the template for all levels from the output of level 0, and creates the folder unless nothing is written.
    /// An error if the template cannot name them all.
    fn new(folder: &Path, template: &str, first: &Destination) -> Result<Self, AssetError> {
        let path = match &first.sink {
            Sink::Path(path) => path.as_path(),
            Sink::Stream => Path::new(""),
        };
        let name = path.file_name().map(|n| n.to_string_lossy().into_owned()).unwrap_or_default();
        // The name of level 0, with a placeholder where the template has the number.
        let (before, after) = template.split_once("{level}").unwrap_or((template, ""));
        let is_stem_before = before.contains("{stem}");
        let tail = after.replace("{ext}", path.extension().and_then(|e| e.to_str()).unwrap_or_default());
        let template = match name.strip_suffix(&tail).filter(|_| !tail.contains("{stem}")) {
            Some(head) if is_stem_before || !after.contains("{stem}") => {
                format!("{}{{level}}{tail}", head.strip_suffix('0').unwrap_or(head))
            }
            _ => return Err(usage(format!("--name {template}: {{stem}} must be before {{level}}"))),
        };
        // In memory every folder exists.
        if !first.dry_run && !cfg!(target_arch = "wasm32") {
            fs::create_dir_all(folder)
                .map_err(|problem| AssetError::Folder { path: folder.to_owned(), problem })?;
        }
        Ok(Self { path: folder.to_owned(), template })
    }

    /// Returns the file name of a level.
    fn file(&self, level: usize) -> String {
        self.template.replace("{level}", &level.to_string())
    }
}
