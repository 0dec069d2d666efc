//! An entry of the table of options of jobs on files.

use std::ffi::OsStr;

use super::given::FileOptions;
use crate::request::verb::Verb;

/// An option of jobs on files: its name, the values that it takes, and how it is set.
#[derive(Clone, Copy, Debug)]
pub struct FileOption {
    /// Name on the command line, words joined by dashes: `max-memory`.
    pub name: &'static str,
    /// The values that it takes.
    pub kind: FileKind,
    /// The jobs that have it.
    pub verbs: &'static [Verb],
    /// Section of lists, such as the help of the command.
    pub section: OptionSection,
    /// Placeholder of the value in help texts, in capitals; empty for flags.
    pub value_name: &'static str,
    /// Help text: one sentence in the imperative, without a full stop.
    pub help: &'static str,
    /// The value if it is not given, as text.
    pub default: Option<&'static str>,
    /// An option without which it means nothing.
    pub needs: Option<&'static str>,
    /// Options that cannot be given together with it.
    pub excludes: &'static [&'static str],
    pub(super) set: Set,
}

/// Sets a value, or one of several. The error says which values are taken.
pub(super) type Set = fn(&mut FileOptions, &OsStr) -> Result<(), String>;

/// The values that an option of files takes. Ranges are checked where it is set.
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
    /// Several values, joined by commas where they are a text.
    List(&'static FileKind),
    /// Several values; a text is one of them, whatever it contains.
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

/// Section of lists of options, in the order of such lists.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
#[non_exhaustive]
pub enum OptionSection {
    /// Outputs and their names.
    Output,
    /// Targets, which end a run.
    Target,
    /// Levels to make.
    Levels,
    /// Distances at which levels are switched.
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
    /// Moment of an animation.
    Animation,
    /// A turn of the camera around the model.
    Turntable,
    /// Arrangement of pictures.
    Picture,
    /// How inputs are read.
    Reading,
    /// How outputs are written.
    Writing,
    /// Limits of a run, and its end.
    Run,
}

impl OptionSection {
    /// Returns the heading; `None` for the first section.
    pub const fn title(self) -> Option<&'static str> {
        Some(match self {
            Self::Output => return None,
            Self::Target => {
                "Target (the first one met stops; one at least, unless the method ends by itself)"
            }
            Self::Levels => "Levels (one of these)",
            Self::Switching => "Switching",
            Self::Repair => "Repair",
            Self::Simplification => "Simplification",
            Self::OfMethod => "Of single methods",
            Self::Guards => "Guards of the result",
            Self::Deviation => "Deviation",
            Self::Baking => "Baking",
            Self::Look => "Look",
            Self::View => "View",
            Self::Animation => "Animation",
            Self::Turntable => "Turntable",
            Self::Picture => "Picture",
            Self::Reading => "Reading",
            Self::Writing => "Writing",
            Self::Run => "Run",
        })
    }
}

/// Makes a table: name, kind, jobs, section, placeholder and help of each option; its default, the option that it needs
/// and those that it excludes, if there are any; and how a value `v` is set in options `o`.
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
