//! The options of jobs on files by name: those of the engine, and all others (reading, writing, baking, limits).

mod entry;
mod given;
#[cfg(feature = "pictures")]
mod pictures;
mod table;
mod words;

use std::ffi::{OsStr, OsString};

use lodsmith::options::by_name::{self, NamedOption, OPTIONS, OptionGroup, OptionKind, OptionValue};
use serde_json::{Map, Value, json};

use super::verb::Verb;
use crate::error::{AssetError, usage};
pub use entry::{FileKind, FileOption, OptionSection};
pub use given::FileOptions;

/// The tables of options of files.
const TABLES: &[&[FileOption]] = &[
    #[cfg(feature = "pictures")]
    pictures::OPTIONS,
    table::OPTIONS,
];

/// An option of a job.
#[derive(Clone, Copy, Debug)]
pub enum JobOption {
    /// An option of the engine.
    Engine(&'static NamedOption),
    /// Any other option.
    File(&'static FileOption),
}

impl JobOption {
    /// Returns the options of a job, in the order of lists.
    pub fn all(verb: Verb) -> Vec<Self> {
        let has = move |option: &&NamedOption| match verb {
            Verb::Simplify => true,
            Verb::Lod => !matches!(option.group, OptionGroup::Target | OptionGroup::Deviation),
            _ => false,
        };
        let of_files = TABLES.iter().copied().flatten().filter(|option| option.verbs.contains(&verb));
        let of_engine = OPTIONS.iter().filter(has);
        let mut all: Vec<_> = of_engine.map(Self::Engine).chain(of_files.map(Self::File)).collect();
        all.sort_by_key(Self::section);
        all
    }

    /// Returns the name on the command line, words joined by dashes.
    pub const fn name(&self) -> &'static str {
        match self {
            Self::Engine(option) => option.name,
            Self::File(option) => option.name,
        }
    }

    /// Returns the section of lists.
    pub const fn section(&self) -> OptionSection {
        match self {
            Self::Engine(option) => match option.group {
                OptionGroup::Target => OptionSection::Target,
                OptionGroup::Simplification => OptionSection::Simplification,
                OptionGroup::OfMethod => OptionSection::OfMethod,
                OptionGroup::Guards => OptionSection::Guards,
                _ => OptionSection::Deviation,
            },
            Self::File(option) => option.section,
        }
    }

    /// Returns the placeholder of the value in help texts; empty for flags.
    pub const fn value_name(&self) -> &'static str {
        match self {
            Self::Engine(option) => option.value_name,
            Self::File(option) => option.value_name,
        }
    }

    /// Returns the help text. It names the default if [`JobOption::default_text`] does not.
    pub fn help(&self) -> String {
        match self {
            Self::Engine(option) => match option.default_text().filter(|_| option.is_of_presets()) {
                Some(default) => format!("{} [default: {default}, or by preset]", option.help),
                None => option.help.to_owned(),
            },
            Self::File(option) => option.help.to_owned(),
        }
    }

    /// Returns the default as text; `None` if the option is off by default, or has a default of the preset.
    pub fn default_text(&self) -> Option<String> {
        match self {
            Self::Engine(option) => option.default_text().filter(|_| !option.is_of_presets()),
            Self::File(option) => option.default.map(str::to_owned),
        }
    }

    /// Returns the kind of the value, or of each value if the option takes several.
    pub const fn kind_name(&self) -> &'static str {
        match self {
            Self::Engine(option) => option.kind.name(),
            Self::File(option) => option.kind.name(),
        }
    }

    /// True for an option that is on or off.
    pub fn is_flag(&self) -> bool {
        self.kind_name() == "flag"
    }

    /// True if one text, with commas, can have several values.
    pub const fn is_list(&self) -> bool {
        matches!(self, Self::File(FileOption { kind: FileKind::List(_), .. }))
    }

    /// True if the option takes several values.
    pub const fn takes_several(&self) -> bool {
        match self {
            Self::Engine(option) => matches!(option.kind, OptionKind::Weights(_)),
            Self::File(option) => matches!(option.kind, FileKind::List(_) | FileKind::Repeated(_)),
        }
    }

    /// Returns the permitted words; empty if the value is not a word.
    pub fn words(&self) -> Vec<&'static str> {
        match self {
            Self::Engine(option) => option.kind.words().to_vec(),
            Self::File(option) => match option.kind.item() {
                FileKind::Word(names) => names(),
                _ => Vec::new(),
            },
        }
    }

    /// Returns the options that this option excludes.
    pub const fn excludes(&self) -> &'static [&'static str] {
        match self {
            Self::Engine(_) => &[],
            Self::File(option) => option.excludes,
        }
    }

    /// Returns the entry as JSON, for lists in other languages.
    pub fn to_json(&self) -> Value {
        json!({
            "name": self.name(),
            "kind": self.kind_name(),
            "list": matches!(self, Self::File(_)) && self.takes_several(),
            "words": self.words(),
            "default": self.default_text(),
            "help": self.help(),
        })
    }

    /// Checks a single value.
    ///
    /// # Errors
    /// The values that the option takes, as text.
    pub fn check(&self, value: &OsStr) -> Result<(), String> {
        match self {
            Self::Engine(option) => {
                let text = value.to_string_lossy();
                let checked = option.kind.parse(&OptionValue::Text(text));
                checked.map(drop).map_err(|_| format!("{} is expected", option.kind.expected()))
            }
            Self::File(option) => (option.set)(&mut FileOptions::default(), value),
        }
    }

    /// Sets the value, or several values of an option that takes a list.
    ///
    /// # Errors
    /// [`AssetError::Usage`] for a value that the option does not take.
    pub fn set(&self, options: &mut FileOptions, values: &[OsString]) -> Result<(), AssetError> {
        match self {
            Self::Engine(option) => {
                let texts: Vec<_> = values.iter().map(|value| value.to_string_lossy()).collect();
                options.engine.push((option.name, OptionValue::Text(texts.join(",").into())));
            }
            Self::File(option) => {
                option.set(options, values).map_err(|why| self.wrong(&why))?;
                // A flag that is off counts as not given.
                if !self.is_flag() || values.iter().all(|value| value == "true") {
                    options.given.push(option.name);
                }
            }
        }
        Ok(())
    }

    fn set_json(&self, options: &mut FileOptions, value: &Value) -> Result<(), AssetError> {
        match self {
            Self::Engine(option) => {
                options.engine.push((option.name, engine_value(value).map_err(|why| self.wrong(&why))?));
                Ok(())
            }
            Self::File(_) => self.set(options, &texts(value).map_err(|why| self.wrong(&why))?),
        }
    }

    fn wrong(&self, why: &str) -> AssetError {
        usage(format!("--{}: {why}", self.name()))
    }
}

impl FileOption {
    /// Sets one value, or several if the option takes a list.
    fn set(&self, options: &mut FileOptions, values: &[OsString]) -> Result<(), String> {
        let parts = |value: &OsString| match value.to_str() {
            Some(text) => text.split(',').map(|part| part.trim().into()).collect(),
            None => vec![value.clone()],
        };
        let values: Vec<OsString> = match (self.kind, values) {
            (FileKind::List(_), values) => values.iter().flat_map(parts).collect(),
            (FileKind::Repeated(_), values) | (_, values @ [_]) => values.to_vec(),
            _ => return Err("a single value is expected".to_owned()),
        };
        let set = |value: &OsString| {
            (self.set)(options, value)
                .map_err(|why| format!("{why}; it is {}", OptionValue::from(&*value.to_string_lossy())))
        };
        values.iter().try_for_each(set)
    }
}

/// Returns a value as texts.
fn texts(value: &Value) -> Result<Vec<OsString>, String> {
    let one = |value: &Value| match value {
        Value::String(text) => Ok(text.into()),
        Value::Bool(_) | Value::Number(_) => Ok(value.to_string().into()),
        _ => Err("a text, a number, true or false, or a list of them is expected".to_owned()),
    };
    match value {
        Value::Array(all) => all.iter().map(one).collect(),
        value => Ok(vec![one(value)?]),
    }
}

/// Returns a value of an option of the engine.
///
/// # Errors
/// The reason why no option takes the value.
pub fn engine_value(value: &Value) -> Result<OptionValue<'static>, String> {
    Ok(match value {
        Value::Bool(x) => OptionValue::Flag(*x),
        Value::Number(x) => match (x.as_u64(), x.as_f64()) {
            (Some(n), _) => OptionValue::Whole(n),
            (None, x) => OptionValue::Number(x.unwrap_or(f64::NAN)),
        },
        Value::String(text) => OptionValue::Text(text.clone().into()),
        Value::Object(all) => {
            let one = |(name, x): (&String, &Value)| {
                let number = x.as_f64().or_else(|| x.as_str()?.parse().ok());
                Some((name.clone().into(), number?))
            };
            let all: Option<Vec<_>> = all.iter().map(one).collect();
            OptionValue::Weights(all.ok_or("a number is expected for each name")?)
        }
        Value::Array(all) => {
            // Several texts for one option, as for weights on a command line.
            let texts: Option<Vec<&str>> = all.iter().map(Value::as_str).collect();
            OptionValue::Text(texts.ok_or("a single value is expected")?.join(",").into())
        }
        Value::Null => return Err("a value is expected".to_owned()),
    })
}

impl FileOptions {
    /// Reads options by name; null means not given.
    pub(super) fn of_json(verb: Verb, given: &Map<String, Value>) -> Result<Self, AssetError> {
        let all = JobOption::all(verb);
        let mut options = Self::default();
        for (name, value) in given.iter().filter(|(_, value)| !value.is_null()) {
            let dashed = name.replace('_', "-");
            let option = all.iter().find(|option| option.name() == dashed).ok_or_else(|| {
                let nearest = by_name::nearest(name, all.iter().map(JobOption::name));
                AssetError::UnknownOption { name: name.clone(), nearest }
            })?;
            option.set_json(&mut options, value)?;
        }
        options.completed(verb)
    }

    /// Sets defaults, and checks that the given options do not exclude each other.
    pub(super) fn completed(mut self, verb: Verb) -> Result<Self, AssetError> {
        let all = JobOption::all(verb);
        for option in &all {
            let JobOption::File(file) = option else { continue };
            if self.given.contains(&file.name) {
                if let Some(other) = file.excludes.iter().find(|other| self.given.contains(other)) {
                    return Err(usage(format!("only one of --{} and --{other} may be given", file.name)));
                }
                let is_missing = |other: &&'static str| {
                    !self.given.contains(other) && all.iter().any(|option| option.name() == *other)
                };
                if let Some(other) = file.needs.filter(is_missing) {
                    return Err(option.wrong(&format!("it needs --{other}")));
                }
            } else if let Some(default) = file.default {
                file.set(&mut self, &[default.into()]).map_err(|why| option.wrong(&why))?;
            }
        }
        Ok(self)
    }
}

#[cfg(test)]
mod tests {
    use lodsmith::{Length, Levels};
    use lodsmith_bake::MapKind;

    use super::*;
    use crate::destination::Up;
    use crate::values::LEVEL_FACTOR;

    fn given(verb: Verb, options: Value) -> Result<FileOptions, AssetError> {
        let Value::Object(options) = options else { panic!("options are an object") };
        FileOptions::of_json(verb, &options)
    }

    #[test]
    fn values_may_be_texts_numbers_and_lists() {
        let options = json!({
            "ratio": 0.1, "weight": { "uv": 2 }, "lock": ["a,b", "c"], "bake": "normal,color", "texture_size": 64,
            "up": "z", "quantize": true, "max_memory": "1G", "threads": "2", "importance": "quality=2", "fit": null,
        });
        let options = given(Verb::Simplify, options).unwrap();
        assert_eq!(options.engine.len(), 2);
        assert_eq!(options.names.lock, ["a,b", "c"]);
        assert_eq!(options.names.importance.as_ref().unwrap().strength, 2.0);
        assert_eq!(options.baking().unwrap().options.maps, [MapKind::Normal, MapKind::Color]);
        assert_eq!((options.bake.size, options.writing.up), (Some(64), Some(Up::Z)));
        assert!(options.writing.packing.quantize);
        assert_eq!((options.max_memory, options.threads), (Some(1 << 30), Some(2)));
        let levels = given(Verb::Lod, json!({ "levels": [0.5, "25%"], "geomorph": true })).unwrap();
        assert_eq!(levels.levels().unwrap().levels, Levels::Ratios(vec![0.5, 0.25]));
        let errors = given(Verb::Lod, json!({ "errors": ["0.1%", 2] })).unwrap();
        let expected = Levels::Errors(vec![Length::OfDiagonal(0.001), Length::Units(2.0)]);
        assert_eq!(errors.levels().unwrap().levels, expected);
    }

    #[test]
    fn defaults_agree_with_the_libraries() {
        for verb in Verb::ALL {
            let mut options = given(verb, json!({})).unwrap();
            if verb == Verb::Bake {
                assert_eq!(options.bake.maps, [MapKind::Normal, MapKind::Color, MapKind::Occlusion]);
                options.bake.maps.clear();
            }
            assert!(options.factor.take().is_none_or(|factor| factor == LEVEL_FACTOR));
            assert_eq!(options, FileOptions::default(), "{}", verb.name());
        }
    }

    #[test]
    fn names_of_options_are_unique_within_a_job() {
        for verb in Verb::ALL {
            let all = JobOption::all(verb);
            let named = |name: &str| all.iter().filter(|option| option.name() == name).count();
            for option in &all {
                assert_eq!(named(option.name()), 1, "{} of {}", option.name(), verb.name());
                assert!(option.excludes().iter().all(|other| named(other) == 1), "{}", option.name());
                let words = option.words();
                assert!(words.iter().all(|word| option.check(OsStr::new(word)).is_ok()), "{words:?}");
            }
        }
    }

    #[test]
    fn unknown_options_and_values_are_named() {
        let text = |verb, options| given(verb, options).unwrap_err().to_string();
        assert_eq!(
            text(Verb::Simplify, json!({ "rato": 0.1 })),
            "there is no option rato; a similar one is ratio"
        );
        assert_eq!(text(Verb::Info, json!({ "ratio": 0.1 })), "there is no option ratio");
        let unknown = text(Verb::Simplify, json!({ "compress": "zip" }));
        assert!(
            unknown.starts_with("--compress: one of none, meshopt") && unknown.ends_with("\"zip\""),
            "{unknown}"
        );
        assert!(text(Verb::Simplify, json!({ "scale": 0 })).starts_with("--scale: it must be above 0"));
        assert!(text(Verb::Simplify, json!({ "scale": [1, 2] })).contains("a single value"));
        assert!(text(Verb::Lod, json!({ "count": 2, "levels": [0.5] })).contains("only one of"));
        assert_eq!(text(Verb::Simplify, json!({ "texture_size": 64 })), "--texture-size: it needs --bake");
        assert!(given(Verb::Simplify, json!({ "map_files": false })).is_ok());
        assert!(given(Verb::Bake, json!({ "texture_size": 64 })).is_ok());
        assert!(text(Verb::Lod, json!({ "factor": 0.5 })).contains("it needs --count"));
        assert!(given(Verb::Lod, json!({})).unwrap().levels().is_err());
    }
}
