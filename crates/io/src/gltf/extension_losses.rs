//! Counts of the extensions that are left out of a file, and the warnings about them.

use std::collections::BTreeMap;

use lodsmith_core::numbers::counted;

use crate::error::Warning;
use crate::excerpt::excerpt;

/// Reason why an extension, or a part of it, is left out.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum LossReason {
    /// It describes vertices or triangles that were replaced.
    Geometry,
    /// It describes the material, or its coordinates, that a baked one replaces.
    Material,
    /// The extension is not known, and may contain a number that has another meaning now.
    Opaque,
    /// An element that it refers to is gone.
    Gone,
    /// Entries of it refer to elements that are gone.
    Entries,
    /// Channels of animations move elements that are gone.
    Channels,
}

/// Numbers of losses by reason and name of the extension.
#[derive(Clone, Debug, Default)]
pub(super) struct ExtensionLosses(BTreeMap<(LossReason, String), usize>);

/// Maximum number of names in warnings: a file may have any number of extensions. (Guessed: more do not help.)
const MAX_NAMES: usize = 16;

impl ExtensionLosses {
    /// Counts losses of an extension; none if `count` is zero.
    pub(super) fn add(&mut self, reason: LossReason, name: &str, count: usize) {
        if count > 0 {
            *self.0.entry((reason, name.to_owned())).or_default() += count;
        }
    }

    /// Returns the names of the extensions.
    pub(super) fn names(&self) -> Vec<String> {
        self.0.keys().map(|(_, name)| name.clone()).collect()
    }

    /// Returns the number of all losses.
    pub(super) fn count(&self) -> usize {
        self.0.values().sum()
    }

    /// Returns a warning for each reason and name.
    pub(super) fn warnings(&self) -> Vec<Warning> {
        let mut warnings: Vec<Warning> = self
            .0
            .iter()
            .take(MAX_NAMES)
            .map(|((reason, name), count)| warning(*reason, &excerpt(name), *count))
            .collect();
        if self.0.len() > MAX_NAMES {
            let more = self.0.len() - MAX_NAMES;
            warnings.push(Warning::lost(format!("{more} more extensions are left out for such reasons")));
        }
        warnings
    }
}

fn warning(reason: LossReason, name: &str, count: usize) -> Warning {
    let times = if count == 1 { String::new() } else { format!(" {count} times") };
    let because = |reason: &str| Warning::lost(format!("the extension {name} is left out{times}: {reason}"));
    let are = if count == 1 { "is" } else { "are" };
    match reason {
        LossReason::Geometry => because("it describes vertices that were replaced"),
        LossReason::Material => because("a baked material replaces what it describes"),
        LossReason::Opaque => {
            because("it is not known, and may contain numbers that have another meaning now")
        }
        LossReason::Gone => because("what it refers to is no longer in the file"),
        LossReason::Entries => {
            let entries = counted(count, "entry", "entries");
            Warning::lost(format!(
                "{entries} of the extension {name} {are} left out: what is named is no longer in the file"
            ))
        }
        LossReason::Channels => {
            let channels = counted(count, "channel", "channels");
            Warning::lost(format!(
                "{channels} of animations ({name}) {are} left out: the target is no longer in the file"
            ))
        }
    }
}
