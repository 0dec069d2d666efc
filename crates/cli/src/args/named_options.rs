//! The options of simplification on the command line are those of the library's table by name, with its defaults.

use std::collections::BTreeSet;

use clap::{Arg, ArgAction, CommandFactory as _};
use lodsmith::options::by_name::{self, OptionKind};

use super::Cli;

/// Options that name parts of a file, which the library has as lists of vertices.
const OF_FILES: [&str; 2] = ["lock", "importance"];
/// Beginnings of the headings of options of simplification; the others are about files, reading, writing and the run.
const HEADINGS: [&str; 5] =
    ["Target", "Simplification", "Of single methods", "Guards of the result", "Deviation"];

/// Returns the arguments of `simplify` under these headings.
fn arguments() -> Vec<Arg> {
    let command = Cli::command();
    let simplify = command.find_subcommand("simplify").expect("a subcommand");
    let is_ours = |a: &&Arg| {
        let heading = a.get_help_heading().unwrap_or_default();
        HEADINGS.iter().any(|h| heading.starts_with(h))
    };
    simplify.get_arguments().filter(is_ours).cloned().collect()
}

#[test]
fn the_table_has_the_options_of_the_command_and_no_others() {
    let all = arguments();
    let typed: BTreeSet<&str> = all.iter().filter_map(Arg::get_long).collect();
    let mut named: BTreeSet<&str> = by_name::OPTIONS.iter().map(|o| o.name).collect();
    assert_eq!(named.len(), by_name::OPTIONS.len(), "a name stands twice");
    named.extend(OF_FILES);
    assert_eq!(typed, named);
}

#[test]
fn defaults_and_values_are_the_same() {
    for argument in arguments() {
        let name = argument.get_long().expect("an option");
        if OF_FILES.contains(&name) {
            continue;
        }
        let option = by_name::find(name).expect("every option is in the table");
        let is_flag = matches!(argument.get_action(), ArgAction::SetTrue);
        assert_eq!(is_flag, option.kind == OptionKind::Flag, "{name}");
        if let OptionKind::Word(words) = option.kind {
            let typed = argument.get_possible_values();
            let typed: Vec<&str> = typed.iter().map(|v| v.get_name()).collect();
            assert_eq!(typed, words, "{name}");
        }
        let typed: Vec<&str> = argument.get_default_values().iter().filter_map(|v| v.to_str()).collect();
        match (typed[..].first().filter(|_| !is_flag), option.default_text()) {
            (Some(typed), default) => assert_eq!(Some(*typed), default.as_deref(), "{name}"),
            (None, None) => {}
            // A default that a preset changes stands in the help text.
            (None, Some(default)) => {
                let help = argument.get_help().map(ToString::to_string).unwrap_or_default();
                assert!(help.contains(&format!("[default: {default}")), "{name}: {default}: {help}");
            }
        }
    }
}
