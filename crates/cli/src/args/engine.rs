//! Arguments of simplification, made from the library's table of options.

use clap::builder::{PossibleValuesParser, StringValueParser, TypedValueParser};
use clap::error::Error;
use clap::parser::ValueSource;
use clap::{Arg, ArgAction, ArgMatches, Args, Command, FromArgMatches};
use lodsmith::options::by_name::{self, NamedOption, OPTIONS, OptionGroup, OptionKind, OptionValue};
use lodsmith::{Preset, SimplifyOptions, Stop};
use lodsmith_asset::Importance;

use crate::status::usage;

/// An option, and the value that was typed.
type Typed = (&'static NamedOption, OptionValue<'static>);

/// Returns the options of some groups.
fn of_groups(groups: &[OptionGroup]) -> impl Iterator<Item = &'static NamedOption> {
    OPTIONS.iter().filter(move |option| groups.contains(&option.group))
}

/// Returns the argument of an option.
fn argument(option: &'static NamedOption) -> Arg {
    let default = option.default_text();
    let is_of_presets = default.is_some()
        && Preset::ALL.into_iter().any(|preset| {
            let other = SimplifyOptions::preset(preset, Stop::default());
            option.get(&other) != option.get(&SimplifyOptions::default())
        });
    let help = match &default {
        Some(default) if is_of_presets => format!("{} [default: {default}, or by preset]", option.help),
        _ => option.help.to_owned(),
    };
    let arg = Arg::new(option.name).long(option.name).help(help);
    let arg = match option.group {
        OptionGroup::Simplification => arg.help_heading("Simplification"),
        OptionGroup::OfMethod => arg.help_heading("Of single methods"),
        OptionGroup::Guards => arg.help_heading("Guards of the result"),
        OptionGroup::Deviation => arg.help_heading("Deviation"),
        // That of the target depends on the command.
        _ => arg,
    };
    if option.kind == OptionKind::Flag {
        return arg.action(ArgAction::SetTrue);
    }
    let arg = arg.value_name(option.value_name);
    let arg = match option.kind {
        OptionKind::Word(words) => {
            let word = |word: String| OptionValue::Text(word.into());
            arg.value_parser(PossibleValuesParser::new(words.iter().copied()).map(word))
        }
        OptionKind::Weights(_) => arg.action(ArgAction::Append).value_parser(parser(option.kind)),
        kind => arg.value_parser(parser(kind)),
    };
    match default.filter(|_| !is_of_presets) {
        Some(default) => arg.default_value(default),
        None => arg,
    }
}

/// Returns a parser of values of a kind.
fn parser(kind: OptionKind) -> impl TypedValueParser<Value = OptionValue<'static>> {
    StringValueParser::new().try_map(move |text| {
        kind.parse(&text.as_str().into()).map_err(|_| format!("{} is expected", kind.wanted()))
    })
}

/// Returns the options of some groups that were typed, in the order of the table.
fn typed(groups: &[OptionGroup], matches: &ArgMatches) -> Vec<Typed> {
    let is_typed =
        |option: &&NamedOption| matches.value_source(option.name) == Some(ValueSource::CommandLine);
    let values = |option: &'static NamedOption| -> Vec<Typed> {
        match option.kind {
            OptionKind::Flag => vec![(option, OptionValue::Flag(matches.get_flag(option.name)))],
            _ => {
                let all = matches.get_many::<OptionValue<'static>>(option.name).into_iter().flatten();
                all.map(|value| (option, value.clone())).collect()
            }
        }
    };
    of_groups(groups).filter(is_typed).flat_map(values).collect()
}

/// Returns options with the values that were typed.
fn options(typed: &[Typed]) -> Result<SimplifyOptions, by_name::OptionError> {
    let named: Vec<_> = typed.iter().map(|(option, value)| (option.name, value.clone())).collect();
    by_name::from_names(&named)
}

/// Makes a group of arguments from groups of the table.
macro_rules! typed_options {
    ($(#[$doc:meta])* $name:ident: $groups:expr) => {
        $(#[$doc])*
        #[derive(Clone, Debug)]
        pub(crate) struct $name(Vec<Typed>);

        impl FromArgMatches for $name {
            fn from_arg_matches(matches: &ArgMatches) -> Result<Self, Error> {
                Ok(Self(typed($groups, matches)))
            }
            fn update_from_arg_matches(&mut self, matches: &ArgMatches) -> Result<(), Error> {
                self.0 = typed($groups, matches);
                Ok(())
            }
        }

        impl Args for $name {
            fn augment_args(command: Command) -> Command {
                of_groups($groups).fold(command, |command, option| command.arg(argument(option)))
            }
            fn augment_args_for_update(command: Command) -> Command {
                Self::augment_args(command)
            }
        }
    };
}

typed_options! {
    /// Target of a run.
    Target: &[OptionGroup::Target]
}
typed_options! {
    /// Measurement and proof of the deviation.
    Deviation: &[OptionGroup::Deviation]
}
typed_options! {
    /// Options of a run besides its target.
    Engine: ENGINE
}
const ENGINE: &[OptionGroup] = &[OptionGroup::Simplification, OptionGroup::OfMethod, OptionGroup::Guards];

impl Target {
    /// Returns true if any target is set.
    pub(crate) fn is_given(&self) -> bool {
        !self.0.is_empty()
    }

    /// Converts the target to a stop of the engine.
    pub(crate) fn stop(&self) -> Stop {
        options(&self.0).expect("targets do not exclude each other").stop
    }
}

/// Names of parts and attributes of a file.
#[derive(Args, Debug)]
#[command(next_help_heading = "Simplification")]
pub(crate) struct PartNames {
    /// Keep this unchanged, bit for bit: a material, group, object, mesh or node, or the vertices where this attribute is
    /// not zero; may be repeated
    #[arg(long, value_name = "NAME")]
    pub(crate) lock: Vec<String>,
    /// Keep more triangles where this attribute of vertices is large: at 1, or at the largest value if that is above 1,
    /// STRENGTH times as many per area as at 0 [default STRENGTH: 4]
    #[arg(long, value_name = "NAME[=STRENGTH]", value_parser = lodsmith_asset::values::importance)]
    pub(crate) importance: Option<Importance>,
}

impl PartNames {
    /// Returns the names.
    pub(crate) fn names(&self) -> lodsmith_asset::PartNames {
        lodsmith_asset::PartNames { lock: self.lock.clone(), importance: self.importance.clone() }
    }
}

/// Options of a run besides its target, and names of parts of the file.
#[derive(Debug)]
pub(crate) struct EngineArgs {
    pub(crate) names: PartNames,
    typed: Engine,
}

impl FromArgMatches for EngineArgs {
    fn from_arg_matches(matches: &ArgMatches) -> Result<Self, Error> {
        let (names, typed) = (PartNames::from_arg_matches(matches)?, Engine::from_arg_matches(matches)?);
        Ok(Self { names, typed })
    }
    fn update_from_arg_matches(&mut self, matches: &ArgMatches) -> Result<(), Error> {
        *self = Self::from_arg_matches(matches)?;
        Ok(())
    }
}

impl Args for EngineArgs {
    fn augment_args(command: Command) -> Command {
        of_groups(ENGINE).fold(command, |command, option| {
            let command = command.arg(argument(option));
            if option.name == "weight" { PartNames::augment_args(command) } else { command }
        })
    }
    fn augment_args_for_update(command: Command) -> Command {
        Self::augment_args(command)
    }
}

impl EngineArgs {
    /// Returns an error if options exclude each other, or the method does not have one.
    pub(super) fn check(&self) -> anyhow::Result<()> {
        options(&self.typed.0).map(drop).map_err(|error| usage(error.to_string()))
    }

    /// Returns the engine's options for this stop.
    ///
    /// # Panics
    /// If the options were not [checked](Self::check).
    pub(super) fn options(&self, stop: Stop) -> SimplifyOptions {
        let mut options = options(&self.typed.0).expect("they were checked");
        options.stop = stop;
        options
    }
}

impl Deviation {
    /// Copies the arguments into the engine's options.
    pub(super) fn apply(&self, to: &mut SimplifyOptions) {
        for (option, value) in &self.0 {
            option.set(to, value).expect("every method has them");
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_option_of_the_table_is_an_argument_of_simplify_once() {
        let command = Engine::augment_args(Target::augment_args(Command::new("all")));
        let command = Deviation::augment_args(command);
        let mut typed: Vec<&str> = command.get_arguments().filter_map(Arg::get_long).collect();
        let mut named: Vec<&str> = OPTIONS.iter().map(|option| option.name).collect();
        typed.sort_unstable();
        named.sort_unstable();
        assert_eq!(typed, named);
    }
}
