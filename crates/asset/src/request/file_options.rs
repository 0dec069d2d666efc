//! The options of jobs on files by name, besides those of the engine.

use std::path::PathBuf;

use lodsmith::options::by_name::{self, NamedOption, OPTIONS, OptionGroup, OptionKind, OptionValue};
use lodsmith::{CleanOptions, Levels, LodOptions, NonManifold, Screen, Sheets};
use lodsmith_bake::{AtlasMode, BakeOptions, MapKind};
use lodsmith_io::gltf::{Compression, Packing};
use lodsmith_io::{AssetScope, Format, ReadOptions, Textures};
use serde_json::{Map, Value};

use super::verb::Verb;
use crate::baking::Baking;
use crate::constraints::PartNames;
use crate::destination::{Up, Writing};
use crate::error::{AssetError, usage};
use crate::lod::Naming;
use crate::normals::Normals;
use crate::values;

/// The options of a job, from their names.
#[derive(Clone, Debug)]
pub(super) struct FileOptions {
    engine: Vec<(&'static NamedOption, OptionValue<'static>)>,
    pub(super) from: Option<Format>,
    asset_root: Option<PathBuf>,
    allow_outside: bool,
    pub(super) names: PartNames,
    pub(super) normals: Normals,
    bake: BakeOptions,
    map_files: bool,
    /// The first option given that needs maps to bake.
    needs_bake: Option<&'static str>,
    pub(super) to: Option<Format>,
    pub(super) writing: Writing,
    compress: Compression,
    quantize: bool,
    pub(super) clean: CleanOptions,
    levels: Option<Levels>,
    factor: Option<f64>,
    pub(super) naming: Naming,
    /// Template of names in a folder.
    pub(super) name: Option<String>,
    pub(super) geomorph: bool,
    pixels: f64,
    fov: f64,
    height: f64,
    pub(super) dry_run: bool,
    pub(super) strict: bool,
    pub(super) threads: Option<usize>,
    pub(super) time_limit: Option<f64>,
    pub(super) max_memory: Option<u64>,
}

impl Default for FileOptions {
    fn default() -> Self {
        let screen = Screen::default();
        Self {
            engine: Vec::new(),
            from: None,
            asset_root: None,
            allow_outside: false,
            names: PartNames::default(),
            normals: Normals::default(),
            bake: BakeOptions::new([]),
            map_files: false,
            needs_bake: None,
            to: None,
            writing: Writing::default(),
            compress: Compression::default(),
            quantize: false,
            clean: CleanOptions::default(),
            levels: None,
            factor: None,
            naming: Naming::default(),
            name: None,
            geomorph: false,
            pixels: screen.pixels,
            fov: screen.fov_deg,
            height: screen.height_px,
            dry_run: false,
            strict: false,
            threads: None,
            time_limit: None,
            max_memory: None,
        }
    }
}

/// Sets an option to a value: a text, or several where it takes a list.
type Set = fn(&mut FileOptions, &[String]) -> Result<(), String>;

/// An option of jobs on files.
struct FileOption {
    name: &'static str,
    verbs: &'static [Verb],
    is_flag: bool,
    set: Set,
}

use Verb::{Bake, Clean, Convert, Info, Lod, Simplify};
const ALL: &[Verb] = &Verb::ALL;
const ENGINE: &[Verb] = &[Simplify, Lod];
const WRITE: &[Verb] = &[Simplify, Lod, Convert, Clean, Bake];
const STRICT: &[Verb] = WRITE;
const BAKES: &[Verb] = &[Simplify, Lod, Bake];

const fn value(name: &'static str, verbs: &'static [Verb], set: Set) -> FileOption {
    FileOption { name, verbs, is_flag: false, set }
}

const fn flag(name: &'static str, verbs: &'static [Verb], set: Set) -> FileOption {
    FileOption { name, verbs, is_flag: true, set }
}

/// Returns the only text of a value.
fn one(texts: &[String]) -> Result<&str, String> {
    match texts {
        [text] => Ok(text),
        _ => Err("a single value is expected".to_owned()),
    }
}

/// Parses the only text of a value.
fn parsed<T>(texts: &[String], parse: fn(&str) -> Result<T, String>) -> Result<T, String> {
    let text = one(texts)?;
    parse(text).map_err(|why| format!("{why}; it is {text:?}"))
}

/// Parses each text of a list, and each part of a text that has commas.
fn list<T>(texts: &[String], parse: fn(&str) -> Result<T, String>) -> Result<Vec<T>, String> {
    let parts = texts.iter().flat_map(|text| text.split(',')).map(str::trim);
    parts.map(|text| parse(text).map_err(|why| format!("{why}; it is {text:?}"))).collect()
}

/// Returns the value with this name.
fn word<T: Copy>(text: &str, all: &[T], name: fn(T) -> &'static str) -> Result<T, String> {
    all.iter().copied().find(|x| name(*x) == text).ok_or_else(|| {
        let names: Vec<_> = all.iter().map(|x| name(*x)).collect();
        format!("one of {} is expected, not {text:?}", names.join(", "))
    })
}

fn is_on(texts: &[String]) -> Result<bool, String> {
    one(texts)?.parse().map_err(|_| "true or false is expected".to_owned())
}

fn map_kind(text: &str) -> Result<MapKind, String> {
    word(text, &MapKind::ALL, MapKind::name)
}

fn set_maps(options: &mut FileOptions, texts: &[String]) -> Result<(), String> {
    options.bake.maps = BakeOptions::new(list(texts, map_kind)?).maps;
    Ok(())
}

fn set_levels(options: &mut FileOptions, levels: Levels) -> Result<(), String> {
    match options.levels.replace(levels) {
        Some(_) => Err("only one of levels, faces, count and errors says which levels are made".to_owned()),
        None => Ok(()),
    }
}

const OPTIONS_OF_FILES: &[FileOption] = &[
    value("from", ALL, |o, v| word(one(v)?, &Format::ALL, Format::name).map(|x| o.from = Some(x))),
    value("asset-root", ALL, |o, v| one(v).map(|x| o.asset_root = Some(x.into()))),
    flag("allow-outside", ALL, |o, v| is_on(v).map(|x| o.allow_outside = x)),
    value("lock", ENGINE, |o, v| {
        o.names.lock.extend_from_slice(v);
        Ok(())
    }),
    value("importance", ENGINE, |o, v| parsed(v, values::importance).map(|x| o.names.importance = Some(x))),
    value("normals", ENGINE, |o, v| word(one(v)?, &Normals::ALL, Normals::name).map(|x| o.normals = x)),
    value("bake", ENGINE, set_maps),
    value("maps", &[Bake], set_maps),
    value("texture-size", BAKES, |o, v| {
        o.needs_bake.get_or_insert("texture_size");
        parsed(v, values::texture_size).map(|x| o.bake.size = Some(x))
    }),
    value("atlas", BAKES, |o, v| word(one(v)?, &AtlasMode::ALL, AtlasMode::name).map(|x| o.bake.atlas = x)),
    value("ao-rays", BAKES, |o, v| parsed(v, values::rays).map(|x| o.bake.rays = x)),
    value("ao-distance", BAKES, |o, v| {
        o.needs_bake.get_or_insert("ao_distance");
        parsed(v, values::above_zero).map(|x| o.bake.occlusion_distance = Some(x))
    }),
    flag("map-files", BAKES, |o, v| {
        o.map_files = is_on(v)?;
        if o.map_files {
            o.needs_bake.get_or_insert("map_files");
        }
        Ok(())
    }),
    value("to", WRITE, |o, v| word(one(v)?, &Format::WRITTEN, Format::name).map(|x| o.to = Some(x))),
    flag("ascii", WRITE, |o, v| is_on(v).map(|x| o.writing.ascii = x)),
    value("textures", WRITE, |o, v| {
        word(one(v)?, &Textures::ALL, Textures::name).map(|x| o.writing.textures = x)
    }),
    value("compress", WRITE, |o, v| {
        word(one(v)?, &Compression::ALL, Compression::name).map(|x| o.compress = x)
    }),
    flag("quantize", WRITE, |o, v| is_on(v).map(|x| o.quantize = x)),
    value("scale", WRITE, |o, v| parsed(v, values::above_zero).map(|x| o.writing.scale = Some(x))),
    value("up", WRITE, |o, v| word(one(v)?, &Up::ALL, Up::name).map(|x| o.writing.up = Some(x))),
    flag("force", WRITE, |o, v| is_on(v).map(|x| o.writing.force = x)),
    value("levels", &[Lod], |o, v| set_levels(o, Levels::Ratios(list(v, values::ratio)?))),
    value("faces", &[Lod], |o, v| set_levels(o, Levels::Faces(list(v, values::count)?))),
    value("errors", &[Lod], |o, v| set_levels(o, Levels::Errors(list(v, values::length)?))),
    value("count", &[Lod], |o, v| {
        set_levels(o, Levels::Steps { count: parsed(v, values::count)?, factor: values::LEVEL_FACTOR })
    }),
    value("factor", &[Lod], |o, v| parsed(v, values::below_one).map(|x| o.factor = Some(x))),
    value("naming", &[Lod], |o, v| word(one(v)?, &Naming::ALL, Naming::name).map(|x| o.naming = x)),
    value("name", &[Lod], |o, v| one(v).map(|x| o.name = Some(x.to_owned()))),
    flag("geomorph", &[Lod], |o, v| is_on(v).map(|x| o.geomorph = x)),
    value("pixels", &[Lod], |o, v| parsed(v, values::above_zero).map(|x| o.pixels = x)),
    value("fov", &[Lod], |o, v| parsed(v, values::view_deg).map(|x| o.fov = x)),
    value("height", &[Lod], |o, v| parsed(v, values::above_zero).map(|x| o.height = x)),
    value("weld", &[Clean], |o, v| parsed(v, values::some_length).map(|x| o.clean.weld = Some(x))),
    value("prune", &[Clean], |o, v| parsed(v, values::some_length).map(|x| o.clean.prune = Some(x))),
    value("non-manifold", &[Clean], |o, v| {
        word(one(v)?, &NonManifold::ALL, NonManifold::name).map(|x| o.clean.non_manifold = x)
    }),
    value("sheets", &[Clean], |o, v| word(one(v)?, &Sheets::ALL, Sheets::name).map(|x| o.clean.sheets = x)),
    flag("dry-run", &[Simplify, Lod, Clean], |o, v| is_on(v).map(|x| o.dry_run = x)),
    flag("strict", STRICT, |o, v| is_on(v).map(|x| o.strict = x)),
    value("threads", ALL, |o, v| parsed(v, values::count).map(|x| o.threads = Some(x))),
    value("time-limit", &[Simplify, Lod], |o, v| parsed(v, values::seconds).map(|x| o.time_limit = Some(x))),
    value("max-memory", ALL, |o, v| parsed(v, values::memory).map(|x| o.max_memory = Some(x))),
];

/// Returns the options of the engine that a job has.
fn engine_options(verb: Verb) -> impl Iterator<Item = &'static NamedOption> {
    let has = move |option: &&NamedOption| match verb {
        Simplify => true,
        Lod => !matches!(option.group, OptionGroup::Target | OptionGroup::Deviation),
        Convert | Clean | Bake | Info => false,
    };
    OPTIONS.iter().filter(has)
}

fn file_options(verb: Verb) -> impl Iterator<Item = &'static FileOption> {
    OPTIONS_OF_FILES.iter().filter(move |option| option.verbs.contains(&verb))
}

/// Returns the names of the flags of a job, and of its other options.
pub(super) fn names(verb: Verb) -> (Vec<&'static str>, Vec<&'static str>) {
    let of_engine = engine_options(verb).map(|option| (option.name, option.kind == OptionKind::Flag));
    let all = file_options(verb).map(|option| (option.name, option.is_flag)).chain(of_engine);
    let (flags, others): (Vec<_>, Vec<_>) = all.partition(|(_, is_flag)| *is_flag);
    let names = |list: Vec<(&'static str, bool)>| list.into_iter().map(|(name, _)| name).collect();
    (names(flags), names(others))
}

/// Returns a value as texts.
fn texts(value: &Value) -> Result<Vec<String>, String> {
    let one = |value: &Value| match value {
        Value::String(text) => Ok(text.clone()),
        Value::Bool(_) | Value::Number(_) => Ok(value.to_string()),
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
/// The reason, for a value that is of no kind of option.
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
            // Several texts of one option, as weights are on a command line.
            let texts: Option<Vec<&str>> = all.iter().map(Value::as_str).collect();
            OptionValue::Text(texts.ok_or("a single value is expected")?.join(",").into())
        }
        Value::Null => return Err("a value is expected".to_owned()),
    })
}

impl FileOptions {
    /// Reads options by name; those that are null are not given.
    pub(super) fn new(verb: Verb, given: &Map<String, Value>) -> Result<Self, AssetError> {
        let mut options = Self::default();
        for (name, value) in given.iter().filter(|(_, value)| !value.is_null()) {
            let dashed = name.replace('_', "-");
            let wrong = |why: String| usage(format!("{name}: {why}"));
            if let Some(option) = file_options(verb).find(|option| option.name == dashed) {
                texts(value).and_then(|texts| (option.set)(&mut options, &texts)).map_err(wrong)?;
            } else if let Some(option) = engine_options(verb).find(|option| option.name == dashed) {
                options.engine.push((option, engine_value(value).map_err(wrong)?));
            } else {
                let (flags, others) = names(verb);
                let nearest = by_name::nearest(name, flags.into_iter().chain(others));
                return Err(AssetError::UnknownOption { name: name.clone(), nearest });
            }
        }
        options.writing.packing = Packing::new(options.compress, options.quantize);
        Ok(options)
    }

    pub(super) fn reading(&self) -> ReadOptions {
        let mut options = ReadOptions::default();
        options.format = self.from;
        options.assets = match &self.asset_root {
            Some(root) => AssetScope::Root(root.clone()),
            None if self.allow_outside => AssetScope::Anywhere,
            None => AssetScope::Folder,
        };
        options
    }

    /// Returns the values of options of the engine, by name.
    pub(super) fn engine_values(&self) -> Vec<(&'static str, OptionValue<'static>)> {
        self.engine.iter().map(|(option, value)| (option.name, value.clone())).collect()
    }

    /// Returns the maps to bake; `None` for none.
    pub(super) fn baking(&self) -> Option<Baking> {
        let (options, map_files) = (self.bake.clone(), self.map_files);
        (!options.maps.is_empty()).then_some(Baking { options, map_files })
    }

    /// Returns the maps to bake; an error if there are none and an option needs them.
    pub(super) fn checked_baking(&self) -> Result<Option<Baking>, AssetError> {
        match (self.baking(), self.needs_bake) {
            (None, Some(option)) => Err(usage(format!("{option}: it needs bake, the maps to bake"))),
            (baking, _) => Ok(baking),
        }
    }

    pub(super) fn levels(&self) -> Result<LodOptions, AssetError> {
        let levels = match (self.levels.clone(), self.factor) {
            (None, _) => return Err(usage("say which levels are made: levels, faces, count or errors")),
            (Some(Levels::Steps { count, .. }), Some(factor)) => Levels::Steps { count, factor },
            (Some(_), Some(_)) => return Err(usage("factor: it goes with count")),
            (Some(levels), None) => levels,
        };
        Ok(LodOptions::new(levels))
    }

    pub(super) fn screen(&self) -> Result<Screen, AssetError> {
        Screen::new(self.fov, self.height, self.pixels).ok_or_else(|| {
            usage("fov, height, pixels: a field of view below 180 and sizes above 0 are expected")
        })
    }
}

#[cfg(test)]
mod tests {
    use lodsmith::Length;
    use serde_json::json;

    use super::*;

    fn given(verb: Verb, options: Value) -> Result<FileOptions, AssetError> {
        let Value::Object(options) = options else { panic!("an object is given") };
        FileOptions::new(verb, &options)
    }

    #[test]
    fn values_may_be_texts_numbers_and_lists() {
        let options = json!({
            "ratio": 0.1, "weight": { "uv": 2 }, "lock": ["a", "b"], "bake": "normal,color", "texture_size": 64,
            "up": "z", "quantize": true, "max_memory": "1G", "threads": "2", "importance": "quality=2", "fit": null,
        });
        let options = given(Verb::Simplify, options).unwrap();
        assert_eq!(options.engine_values().len(), 2);
        assert_eq!(options.names.lock, ["a", "b"]);
        assert_eq!(options.names.importance.as_ref().unwrap().strength, 2.0);
        assert_eq!(options.bake.maps, [MapKind::Normal, MapKind::Color]);
        assert_eq!((options.bake.size, options.writing.up), (Some(64), Some(Up::Z)));
        assert!(options.writing.packing.quantize);
        assert_eq!((options.max_memory, options.threads), (Some(1 << 30), Some(2)));
        let levels = given(Verb::Lod, json!({ "levels": [0.5, "25%"], "geomorph": true })).unwrap();
        assert_eq!(levels.levels().unwrap().levels, Levels::Ratios(vec![0.5, 0.25]));
        let errors = given(Verb::Lod, json!({ "errors": ["0.1%", 2] })).unwrap();
        let wanted = Levels::Errors(vec![Length::OfDiagonal(0.001), Length::Units(2.0)]);
        assert_eq!(errors.levels().unwrap().levels, wanted);
    }

    #[test]
    fn what_a_job_does_not_take_is_named() {
        let text = |verb, options| given(verb, options).unwrap_err().to_string();
        assert_eq!(
            text(Verb::Simplify, json!({ "rato": 0.1 })),
            "there is no option rato; a similar one is ratio"
        );
        assert_eq!(text(Verb::Info, json!({ "ratio": 0.1 })), "there is no option ratio");
        assert!(
            text(Verb::Simplify, json!({ "compress": "zip" })).starts_with("compress: one of none, meshopt")
        );
        assert!(text(Verb::Simplify, json!({ "scale": 0 })).starts_with("scale: it must be above 0"));
        assert!(text(Verb::Lod, json!({ "count": 2, "levels": [0.5] })).contains("only one of"));
        let options = given(Verb::Simplify, json!({ "texture_size": 64 })).unwrap();
        assert!(options.checked_baking().unwrap_err().to_string().contains("texture_size"));
        assert!(given(Verb::Lod, json!({ "factor": 0.5, "levels": [0.5] })).unwrap().levels().is_err());
    }
}
