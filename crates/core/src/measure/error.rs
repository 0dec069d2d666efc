//! Errors of comparisons.

/// Reasons why two surfaces cannot be compared.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum MeasureError {
    /// One of them has no face with finite corners.
    #[error("the {which} mesh has no face with finite corners")]
    Empty {
        /// `reference` or `candidate`; `prepared` if [`Prepared::new`](super::Prepared::new) fails.
        which: &'static str,
    },
    /// The caller cancelled the comparison.
    #[error("cancelled")]
    Cancelled,
}
