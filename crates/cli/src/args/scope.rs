//! Arguments that define the scope of a target: small parts removed first, a target for each mesh,
//! escalation.

use clap::Args;
use lodsmith::SimplifyOptions;

use super::{TypedLength, values};

#[derive(Args, Debug)]
#[command(next_help_heading = "Simplification")]
pub(super) struct Scope {
    /// Remove connected parts smaller than this first (diagonal of their box, in units or as a share: 0.1%)
    #[arg(long, value_name = "SIZE", value_parser = values::some_length)]
    prune: Option<TypedLength>,
    /// Apply the target to each mesh of a scene instead of the whole scene
    #[arg(long)]
    per_mesh: bool,
    /// If the target is not reached, try looser topology: relaxed, then free
    #[arg(long)]
    escalate: bool,
}

impl Scope {
    /// Copies the arguments into the engine's options.
    pub(super) fn apply(&self, options: &mut SimplifyOptions) {
        options.prune = self.prune.as_ref().map(|d| d.length);
        options.per_mesh = self.per_mesh;
        options.escalate = self.escalate;
    }
}
