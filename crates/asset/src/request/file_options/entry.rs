//! An entry of the table of options of jobs on files.

use std::ffi::OsStr;

use super::given::FileOptions;
use crate::request::verb::Verb;

/// An option of jobs on files that is not one of the engine: its name, its values, and the function that sets it.
#[derive(Clone, Copy, Debug)]
pub struct FileOption {
    /// Name on the command line, words joined by dashes: `max-memory`.
    pub name: &'static str,
    /// The kind of its values.
    pub kind: FileKind,
    /// The jobs that have the option.
    pub verbs: &'static [Verb],
    /// Section of lists, such as the help of the command.
    pub section: OptionSection,
    /// Placeholder of the value in help texts, in capitals; empty for flags.
    pub value_name: &'static str,
    /// Help text: one sentence in the imperative, without a full stop.
    pub help: &'static str,
    /// The default value, as text.
    pub default: Option<&'static str>,
    /// The option that this option needs.
    pub needs: Option<&'static str>,
    /// The options that this option excludes.
    pub excludes: &'static [&'static str],
    pub(super) set: Set,
}

/// Sets a single value. The error names the permitted values.
pub(super) type Set = fn(&mut FileOptions, &OsStr) -> Result<(), String>;

/// The kind of values of a [`FileOption`]. The function that sets an option checks the range.
#[derive(Clone, Copy, Debug)]
#[non_exhaustive]
pub enum FileKind {
    /// On or off.
    Flag,
    /// One of these words.
    Word(fn() -> Vec<&'static str>),
    /// A whole number.
    Count,
    /// A number.
    Number,
    /// A fraction, or a text such as `10%`.
    Ratio,
    /// A length in the units of the mesh, or a text such as `0.1%` for a share of the diagonal.
    Length,
    /// A text.
    Text,
    /// The path of a file or a folder.
    Path,
    /// Several values; one text can have several, separated by commas.
    List(&'static FileKind),
    /// Several values; each text is one value, even with commas.
    Repeated(&'static FileKind),
}

impl FileKind {
    /// Returns the kind of a single value.
    pub const fn item(&self) -> Self {
        match self {
            Self::List(item) | Self::Repeated(item) => **item,
            one => *one,
        }
    }

    /// Returns a name of the kind of a single value, for lists in other languages.
    pub const fn name(&self) -> &'static str {
        match self.item() {
            Self::Flag => "flag",
            Self::Word(_) => "word",
            Self::Count => "count",
            Self::Number => "number",
            Self::Ratio => "ratio",
            Self::Length => "length",
            Self::Path => "path",
            _ => "text",
        }
    }
}

/// Section of lists of options; lists have this order.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
#[non_exhaustive]
pub enum OptionSection {
    /// Outputs and their names.
    Output,
    /// Targets that end a run.
    Target,
    /// Levels to make.
    Levels,
    /// Switching distances of levels.
    Switching,
    /// Repairs.
    Repair,
    /// Options of most methods.
    Simplification,
    /// Options of single methods.
    OfMethod,
    /// Limits on the shape of the result.
    Guards,
    /// Measurement and proof of the deviation.
    Deviation,
    /// Maps to bake.
    Baking,
    /// Appearance of surfaces.
    Look,
    /// Position of the camera.
    View,
    /// Animation and its time.
    Animation,
    /// Frames of a camera that moves around the model.
    Turntable,
    /// Size and arrangement of pictures.
    Picture,
    /// Options of reading.
    Reading,
    /// Options of writing.
    Writing,
    /// Limits and exit status of a run.
    Run,
}

impl OptionSection {
    /// Returns the heading; `None` for the first section.
    pub const fn title(self) -> Option<&'static str> {
        Some(match self {
            Self::Output => return None,
            Self::Target => {
                "Target (at least one, unless the method ends by itself; the first one met stops)"
            }
            Self::Levels => "Levels (one of these)",
            Self::Switching => "Switching",
            Self::Repair => "Repair",
            Self::Simplification => "Simplification",
            Self::OfMethod => "Options of single methods",
            Self::Guards => "Limits on the shape of the result",
            Self::Deviation => "Deviation",
            Self::Baking => "Baking",
            Self::Look => "Look",
            Self::View => "View",
            Self::Animation => "Animation",
            Self::Turntable => "Turntable",
            Self::Picture => "Image",
            Self::Reading => "Reading",
            Self::Writing => "Writing",
            Self::Run => "Run",
        })
    }
}

/// Defines a table. Each option has a name, a kind, jobs, a section, a placeholder and a help text; optionally a
/// default, the option that it needs and the options that it excludes; and an expression that sets its value `v` in the
/// options `o`.
macro_rules! file_options {
    ($(#[$doc:meta])* $table:ident: $($name:literal ($kind:expr) $verbs:tt $section:ident $value:literal $help:literal
        $(default $default:literal)? $(needs $needs:literal)? $(excludes $($other:literal)+)?
        |$o:ident, $v:ident| $set:expr;)+) => {
        $(#[$doc])*
        pub(super) const $table: &[FileOption] = &[$(FileOption {
            name: $name,
            kind: $kind,
            verbs: &$verbs,
            section: OptionSection::$section,
            value_name: $value,
            help: $help,
            default: [$(Some($default),)? None][0],
            needs: [$(Some($needs),)? None][0],
            excludes: &[$($($other),+)?],
            set: |$o, $v| {
                $set;
                Ok(())
            },
        }),+];
    };
}
pub(super) use file_options;
