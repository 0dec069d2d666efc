//! Check that two pictures have the same size.

use lodsmith_core::Image;

/// The pictures differ in size, or are empty, and cannot be compared.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("pictures of {}x{} and {}x{} pixels cannot be compared", reference[0], reference[1], candidate[0], candidate[1])]
pub struct SizeError {
    /// Width and height of the reference.
    pub reference: [usize; 2],
    /// Width and height of the candidate.
    pub candidate: [usize; 2],
}

/// Checks that two pictures can be compared.
pub(super) fn check_sizes(reference: &Image, candidate: &Image) -> Result<(), SizeError> {
    let size = |image: &Image| [image.width(), image.height()];
    let [reference, candidate] = [reference, candidate].map(size);
    if reference == candidate && !reference.contains(&0) {
        Ok(())
    } else {
        Err(SizeError { reference, candidate })
    }
}
