//! Counts of the extensions that are left out of a file, and the warnings about them.

use std::collections::BTreeMap;

use crate::error::Warning;
use crate::excerpt::excerpt;

/// Reason why an extension, or a part of it, is left out.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum LossReason {
    /// It describes vertices or triangles that were replaced.
    Geometry,
    /// It describes the material, or its coordinates, that a baked one replaces.
    Material,
    /// What it refers to is not known, and it may contain a number that has another meaning now.
    Opaque,
    /// What it refers to is gone.
    Gone,
    /// Entries of it refer to what is gone.
    Entries,
    /// Channels of animations move what is gone.
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
    let (are, is_one) = if count == 1 { ("is", true) } else { ("are", false) };
    Warning::lost(match reason {
        LossReason::Geometry => {
            format!("the extension {name} is left out{times}: it describes vertices that were replaced")
        }
        LossReason::Material => {
            format!("the extension {name} is left out{times}: a baked material replaces what it describes")
        }
        LossReason::Opaque => format!(
            "the extension {name} is left out{times}: it is not known, and may contain numbers that have another meaning now"
        ),
        LossReason::Gone => {
            format!("the extension {name} is left out{times}: what it refers to is no longer in the file")
        }
        LossReason::Entries => {
            let entries = if is_one { "an entry".to_owned() } else { format!("{count} entries") };
            format!(
                "{entries} of the extension {name} {are} left out: what is named is no longer in the file"
            )
        }
        LossReason::Channels => {
            let channels = if is_one { "a channel".to_owned() } else { format!("{count} channels") };
            format!("{channels} of animations ({name}) {are} left out: the target is no longer in the file")
        }
    })
}
