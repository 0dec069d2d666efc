//! The values of the options of a job: those that were given, and defaults.

use std::path::PathBuf;

use lodsmith::options::by_name::{self, OptionValue};
use lodsmith::{CleanOptions, Length, Levels, LodOptions, Measure, Screen, SimplifyOptions};
use lodsmith_bake::{BakeOptions, MapKind};
use lodsmith_io::{AssetScope, Format, ReadOptions};

use crate::baking::Baking;
use crate::constraints::PartNames;
use crate::destination::Writing;
use crate::error::{AssetError, usage};
use crate::job::Job;
use crate::lod::Naming;
use crate::normals::Normals;
#[cfg(feature = "pictures")]
use crate::picture::PictureRecipe;
use crate::values::LEVEL_FACTOR;

/// The values of all options of a job on files: those of the engine by name, each of the others as a field or a part of
/// one.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct FileOptions {
    /// Options of the engine by name.
    pub(super) engine: Vec<(&'static str, OptionValue<'static>)>,
    /// Names of the given options, without flags that are off.
    pub(super) given: Vec<&'static str>,
    /// Format of the inputs.
    pub from: Option<Format>,
    pub(super) asset_root: Option<PathBuf>,
    pub(super) allow_outside: bool,
    /// Names of parts with locks, importance or an error map.
    pub names: PartNames,
    /// Normals of the result.
    pub normals: Normals,
    pub(super) bake: BakeOptions,
    pub(super) map_files: bool,
    /// Format of the outputs.
    pub to: Option<Format>,
    /// Options of writing.
    pub writing: Writing,
    /// Repairs.
    pub clean: CleanOptions,
    pub(super) ratios: Vec<f64>,
    pub(super) faces: Vec<usize>,
    pub(super) errors: Vec<Length>,
    pub(super) count: Option<usize>,
    pub(super) factor: Option<f64>,
    /// Naming of levels.
    pub naming: Naming,
    /// Template of the file names of levels or frames in a folder.
    pub name: Option<String>,
    pub(super) geomorph: bool,
    /// The screen for switching distances.
    pub screen: Screen,
    /// Options of pictures.
    #[cfg(feature = "pictures")]
    pub picture: PictureRecipe,
    /// Write nothing.
    pub dry_run: bool,
    /// Treat lost data and missed targets as errors.
    pub strict: bool,
    /// Number of threads.
    pub threads: Option<usize>,
    /// Time limit of a run, in seconds.
    pub time_limit: Option<f64>,
    /// Memory limit of a step, in bytes.
    pub max_memory: Option<u64>,
}

impl FileOptions {
    /// Adds a map to bake.
    pub(super) fn add_map(&mut self, kind: MapKind) {
        self.bake.maps = BakeOptions::new(self.bake.maps.iter().copied().chain([kind])).maps;
    }

    /// Returns the files that a model may refer to.
    pub fn scope(&self) -> AssetScope {
        match &self.asset_root {
            Some(root) => AssetScope::Root(root.clone()),
            None if self.allow_outside => AssetScope::Anywhere,
            None => AssetScope::Folder,
        }
    }

    /// Returns the options of reading, with a memory limit in bytes.
    pub fn reading(&self, memory: u64) -> ReadOptions {
        let mut options = ReadOptions::default();
        options.format = self.from;
        options.assets = self.scope();
        options.limits.memory = memory;
        options
    }

    /// Returns the memory limit of a step, in bytes.
    pub fn memory(&self) -> u64 {
        self.max_memory.unwrap_or_else(Job::default_memory)
    }

    /// Returns the options of the engine.
    ///
    /// # Errors
    /// [`AssetError::Simplify`] for options that the method does not have, or that exclude each other.
    pub fn engine(&self) -> Result<SimplifyOptions, AssetError> {
        Ok(by_name::from_names(&self.engine)?)
    }

    /// Returns the maps to bake; `None` for none.
    pub(crate) fn baking(&self) -> Option<Baking> {
        let (options, map_files) = (self.bake.clone(), self.map_files);
        (!options.maps.is_empty()).then_some(Baking { options, map_files })
    }

    /// Returns the options of levels.
    ///
    /// # Errors
    /// [`AssetError::Usage`] if no option determines the levels; those of [`FileOptions::engine`].
    pub fn levels(&self) -> Result<LodOptions, AssetError> {
        let Self { ratios, faces, errors, factor, .. } = self;
        let mut options = LodOptions::new(match self.count {
            Some(count) => Levels::Steps { count, factor: factor.unwrap_or(LEVEL_FACTOR) },
            None if !errors.is_empty() => Levels::Errors(errors.clone()),
            None if !faces.is_empty() => Levels::Faces(faces.clone()),
            None if !ratios.is_empty() => Levels::Ratios(ratios.clone()),
            None => return Err(usage("one of --levels, --faces, --count and --errors is needed")),
        });
        options.simplify = self.engine()?;
        // Switching distances are computed from measured errors.
        options.simplify.measure = Measure::Always;
        options.geomorph = self.geomorph;
        Ok(options)
    }
}
