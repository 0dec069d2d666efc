//! What keeps surfaces from being compared.

/// Why two surfaces cannot be compared.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum MeasureError {
    /// One of them has no face whose corners are finite.
    #[error("the {which} mesh has no face with finite corners")]
    Empty {
        /// `reference` or `candidate`; `prepared` where [`Prepared::new`](super::Prepared::new) says so.
        which: &'static str,
    },
}
