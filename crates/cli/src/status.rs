//! Exit statuses, and the errors that determine them.

use lodsmith::SimplifyError;
use lodsmith_asset::AssetError;

/// Exit status of the command.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
pub(crate) enum Status {
    /// Success.
    Done = 0,
    /// An error in a file, a mesh or the system.
    Failed = 1,
    /// An error in the command line.
    Usage = 2,
    /// With `--strict`: target not reached or data dropped.
    Strict = 3,
    /// Interrupted by a signal.
    Interrupted = 130,
}

impl Status {
    /// Returns the more severe of two statuses: an interrupt outweighs a usage error, a usage error outweighs a
    /// failure, and a failure outweighs a violation of `--strict`.
    pub(crate) fn or_worse(self, other: Self) -> Self {
        let rank = |status| {
            [Self::Done, Self::Strict, Self::Failed, Self::Usage, Self::Interrupted]
                .iter()
                .position(|x| *x == status)
        };
        if rank(other) > rank(self) { other } else { self }
    }
}

/// An error in the command line that parsing does not detect.
#[derive(Debug, thiserror::Error)]
#[error("{0}")]
pub(crate) struct UsageError(pub(crate) String);

/// The run was interrupted by a signal.
#[derive(Debug, thiserror::Error)]
#[error("interrupted")]
pub(crate) struct Interrupted;

/// Returns an error of the command line.
pub(crate) fn usage(text: impl Into<String>) -> anyhow::Error {
    UsageError(text.into()).into()
}

/// Returns the exit status for an error.
pub(crate) fn status_of(error: &anyhow::Error) -> Status {
    let is_bad_option = error.downcast_ref().is_some_and(SimplifyError::is_usage);
    let of_job = error.downcast_ref::<AssetError>();
    if is_bad_option || error.is::<UsageError>() || of_job.is_some_and(AssetError::is_usage) {
        Status::Usage
    } else if error.is::<Interrupted>() || matches!(of_job, Some(AssetError::Cancelled)) {
        Status::Interrupted
    } else {
        Status::Failed
    }
}

#[cfg(test)]
mod tests {
    use anyhow::anyhow;

    use super::*;

    #[test]
    fn a_failure_outweighs_strictness() {
        assert_eq!(Status::Strict.or_worse(Status::Failed), Status::Failed);
        assert_eq!(Status::Failed.or_worse(Status::Strict), Status::Failed);
        assert_eq!(Status::Failed.or_worse(Status::Usage), Status::Usage);
        assert_eq!(Status::Done.or_worse(Status::Done), Status::Done);
    }

    #[test]
    fn the_kind_of_error_determines_the_status() {
        assert_eq!(status_of(&usage("no")), Status::Usage);
        let bad = SimplifyError::BadOption { option: "cell", wanted: "longer", got: 0.1 };
        assert_eq!(status_of(&bad.into()), Status::Usage);
        assert_eq!(status_of(&Interrupted.into()), Status::Interrupted);
        assert_eq!(status_of(&anyhow!("disk full")), Status::Failed);
    }
}
