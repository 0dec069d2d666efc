//! What a target is for, what may go before it, and how far one goes for it.

use clap::Args;
use lodsmith::SimplifyOptions;

use super::{TypedLength, values};

#[derive(Args, Debug)]
#[command(next_help_heading = "How")]
pub(super) struct Scope {
    /// Remove connected parts smaller than this first: the diagonal of their box, in units or of the whole's (0.1%)
    #[arg(long, value_name = "SIZE", value_parser = values::some_length)]
    prune: Option<TypedLength>,
    /// The target is for each mesh of a scene by itself, not for all together
    #[arg(long)]
    pub(super) per_mesh: bool,
    /// Where the target is out of reach, try looser topology in turn: relaxed, then free
    #[arg(long)]
    escalate: bool,
}

impl Scope {
    /// Tells the engine.
    pub(super) fn apply(&self, options: &mut SimplifyOptions) {
        options.prune = self.prune.as_ref().map(|d| d.length);
        options.per_mesh = self.per_mesh;
        options.escalate = self.escalate;
    }
}
