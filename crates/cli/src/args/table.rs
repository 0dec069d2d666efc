//! Arguments generated from the tables of options.

use std::ffi::OsString;
use std::marker::PhantomData;
use std::ops::Deref;

use clap::builder::{OsStringValueParser, PossibleValuesParser, TypedValueParser};
use clap::error::{Error, ErrorKind};
use clap::parser::ValueSource;
use clap::{Arg, ArgAction, ArgMatches, Args, Command, FromArgMatches, ValueHint};
use lodsmith::Stop;
use lodsmith_asset::request::{FileOptions, JobOption, OptionSection, Verb};
use lodsmith_io::ReadOptions;

use crate::in_order::available_threads;
use crate::memory;

/// Heading of targets.
pub(super) const TARGET: &str = match OptionSection::Target.title() {
    Some(title) => title,
    None => "",
};

/// A selection of the options of a job.
pub(crate) trait Part {
    const VERB: Verb;
    fn has(option: &JobOption) -> bool;

    fn options() -> Vec<JobOption> {
        let mut all = JobOption::all(Self::VERB);
        all.retain(Self::has);
        all
    }
}

macro_rules! parts {
    ($($(#[$doc:meta])* $name:ident: $verb:ident, |$option:pat_param| $has:expr;)+) => {$(
        $(#[$doc])*
        #[derive(Debug)]
        pub(crate) enum $name {}
        impl Part for $name {
            const VERB: Verb = Verb::$verb;
            fn has($option: &JobOption) -> bool {
                $has
            }
        }
    )+};
}

parts! {
    /// All options of `simplify`.
    OfSimplify: Simplify, |_| true;
    /// All options of `lod`.
    OfLod: Lod, |_| true;
    /// All options of `convert`.
    OfConvert: Convert, |_| true;
    /// All options of `clean`.
    OfClean: Clean, |_| true;
    /// All options of `bake`.
    OfBake: Bake, |_| true;
    /// All options of `info`.
    OfInfo: Info, |_| true;
    /// All options of `render`.
    OfRender: Render, |_| true;
    /// Targets of a run.
    Targets: Simplify, |o| o.section() == OptionSection::Target;
    /// Options of a run, without its target.
    Engine: Lod, |o| (OptionSection::Simplification..=OptionSection::Guards).contains(&o.section());
    /// Reading options.
    InReading: Info, |o| o.section() == OptionSection::Reading;
    /// Files that a model may refer to.
    InScope: Info, |o| ["asset-root", "allow-outside"].contains(&o.name());
    /// Writing options.
    InWriting: Convert, |o| o.section() == OptionSection::Writing;
    /// Limits of a run.
    Limits: Info, |o| o.section() == OptionSection::Run;
}

/// The given options of a selection.
#[derive(Debug)]
pub(crate) struct Options<P>(Box<FileOptions>, PhantomData<P>);

/// Options of commands that read a model.
pub(crate) type Reading = Options<InReading>;
/// Options of commands that write a model.
pub(crate) type Writing = Options<InWriting>;
/// Target of a run.
pub(crate) type Target = Options<Targets>;

impl<P> Deref for Options<P> {
    type Target = FileOptions;
    fn deref(&self) -> &FileOptions {
        &self.0
    }
}

impl<P: Part> Args for Options<P> {
    fn augment_args(command: Command) -> Command {
        let all = P::options();
        all.iter().fold(command, |command, option| command.arg(argument(*option, &all)))
    }
    fn augment_args_for_update(command: Command) -> Command {
        Self::augment_args(command)
    }
}

impl<P: Part> FromArgMatches for Options<P> {
    fn from_arg_matches(matches: &ArgMatches) -> Result<Self, Error> {
        let mut options = FileOptions::default();
        let is_given =
            |option: &JobOption| matches.value_source(option.name()) == Some(ValueSource::CommandLine);
        for option in P::options().into_iter().filter(is_given) {
            let values: Vec<OsString> = match option.is_flag() {
                true => vec!["true".into()],
                false => matches.get_many(option.name()).into_iter().flatten().cloned().collect(),
            };
            option.set(&mut options, &values).map_err(|why| Error::raw(ErrorKind::ValueValidation, why))?;
        }
        Ok(Self(Box::new(options), PhantomData))
    }
    fn update_from_arg_matches(&mut self, matches: &ArgMatches) -> Result<(), Error> {
        *self = Self::from_arg_matches(matches)?;
        Ok(())
    }
}

/// Returns the argument of an option, which is one of `all`.
fn argument(option: JobOption, all: &[JobOption]) -> Arg {
    let name = option.name();
    let excluded = option.excludes().iter().filter(|other| all.iter().any(|option| option.name() == **other));
    let arg = Arg::new(name).long(name).help(option.help()).conflicts_with_all(excluded);
    let arg = match option.section() {
        // The heading of the target depends on the command.
        OptionSection::Target => arg,
        section => section.title().into_iter().fold(arg, Arg::help_heading),
    };
    if option.is_flag() {
        return arg.action(ArgAction::SetTrue);
    }
    let words = option.words();
    let arg = match words.is_empty() {
        true => arg.value_parser(
            OsStringValueParser::new().try_map(move |value| option.check(&value).map(|()| value)),
        ),
        false => arg.value_parser(PossibleValuesParser::new(words).map(OsString::from)),
    };
    let arg = arg.value_name(option.value_name()).allow_negative_numbers(option.kind_name() == "number");
    let arg = if option.kind_name() == "path" { arg.value_hint(ValueHint::AnyPath) } else { arg };
    let arg = if option.takes_several() { arg.action(ArgAction::Append) } else { arg };
    let arg = if option.is_list() { arg.value_delimiter(',') } else { arg };
    option.default_text().into_iter().fold(arg, Arg::default_value)
}

impl Reading {
    /// Returns the options of reading.
    pub(crate) fn options(&self) -> ReadOptions {
        self.reading(memory::limit())
    }
}

impl Target {
    /// Returns true if any target is set.
    pub(crate) fn is_given(&self) -> bool {
        self.stop() != Stop::default()
    }

    /// Returns the target as a stop of the engine.
    pub(crate) fn stop(&self) -> Stop {
        self.engine().expect("targets do not exclude each other").stop
    }
}

/// Verbosity of a command.
#[derive(Args, Clone, Copy, Debug)]
#[command(next_help_heading = "Run")]
pub(crate) struct Loudness {
    /// Print errors only
    #[arg(short, long)]
    pub(crate) quiet: bool,
    /// Print details
    #[arg(short, long, conflicts_with = "quiet")]
    pub(crate) verbose: bool,
}

/// Output options of jobs on files.
#[derive(Args, Clone, Copy, Debug)]
pub(crate) struct Printing {
    /// Print one line of JSON for each input
    #[arg(long, help_heading = "Run", display_order = 0)]
    pub(crate) json: bool,
    #[command(flatten)]
    pub(crate) loudness: Loudness,
}

/// Limits and verbosity of other commands.
#[derive(Args, Debug)]
pub(crate) struct Run {
    #[command(flatten)]
    pub(crate) limits: Options<Limits>,
    #[command(flatten)]
    pub(crate) loudness: Loudness,
}

impl Run {
    pub(crate) fn threads(&self) -> usize {
        threads(&self.limits)
    }
}

/// Returns the number of threads to use.
pub(crate) fn threads(options: &FileOptions) -> usize {
    options.threads.unwrap_or_else(available_threads)
}
