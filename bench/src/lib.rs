//! Shared code of the programs that compare Lodsmith with other simplifiers.
//!
//! This crate is not part of the product. Times depend on the machine and the run: compare only within a table.

pub mod cases;
pub mod lab;
pub mod order;
pub mod page;
pub mod process;
pub mod soup;
pub mod stats;
pub mod vertices;

pub use soup::Soup;
pub use vertices::VertexBuffers;
