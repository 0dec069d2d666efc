//! Code that the packages of Lodsmith for other languages share: simplification of index buffers with the arguments of
//! meshoptimizer, names of attributes, and reports as JSON.

pub mod indices;
pub mod names;
#[cfg(feature = "report")]
pub mod report;
