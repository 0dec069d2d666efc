//! Files as values: read, simplified, baked, compressed and written, with one report.
//!
//! A file of any format is an [`Asset`], the instructions for a job are plain data, such as a [`Recipe`], and its result
//! is a value, such as an [`Outcome`]. The command, the viewer and the packages for other languages all call this crate,
//! which prints nothing and knows neither arguments nor screens. The jobs are [`simplify()`], [`lod()`], [`clean()`],
//! [`convert()`], [`bake()`] and [`info()`], and with the feature `pictures` also `picture::render`. They read files and
//! write files; [`request`] does them by name.
//!
//! ```
//! use lodsmith::{NoControl, SimplifyOptions, Stop};
//! use lodsmith_asset::{Destination, Job, Recipe, Sink, Source, Writing, simplify};
//! use lodsmith_io::{Format, ReadOptions};
//!
//! # let folder = tempfile::tempdir()?;
//! # let output = folder.path().join("wave_low.glb");
//! let input = Source::Path(concat!(env!("CARGO_MANIFEST_DIR"), "/../../testdata/wave.glb").into());
//! let recipe = Recipe { options: SimplifyOptions::new(Stop::ratio(0.5)), ..Recipe::default() };
//! let sink = Sink::Path(output);
//! let to = Destination { sink, format: Format::Glb, writing: Writing::default(), dry_run: false };
//! let mut watch = NoControl;
//! let mut job = Job::new(&mut watch, None, u64::MAX);
//! let outcome = simplify(&input, &ReadOptions::default(), &recipe, Some(&to), &mut job)?;
//! assert!(outcome.report.reached);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod asset;
mod bake;
mod baking;
mod clean;
pub mod constraints;
mod convert;
mod destination;
mod error;
pub mod farthest;
mod images;
mod info;
mod job;
mod lod;
pub mod memory_need;
mod normals;
mod orient;
mod palettes;
pub mod paths;
#[cfg(feature = "pictures")]
pub mod picture;
pub mod plan;
pub mod progress;
mod proposals;
pub mod report_json;
pub mod request;
mod simplify;
pub mod sizes;
pub mod values;
pub mod warnings;

pub use asset::{Asset, Chain, Edit, SimplifiedMeshes};
pub use bake::{BakeOutcome, bake};
pub use baking::{BakedScene, Baking, MovedIntoMaps, SideFile};
pub use clean::{CleanOutcome, clean};
pub use constraints::{Importance, PartNames};
pub use convert::{ConvertOutcome, convert};
pub use destination::{Destination, Up, Writing};
pub use error::AssetError;
pub use info::{Info, MeshFacts, info};
pub use job::{Job, StageClock, Step, Watch, check_memory};
pub use lod::{Level, LevelOutputs, LodOutcome, LodRecipe, Naming, coverage, lod};
pub use normals::Normals;
pub use orient::orient;
pub use paths::{Sink, Source};
pub use progress::JobProgress;
pub use simplify::{Made, Outcome, Recipe, simplify};
