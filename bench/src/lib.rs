//! Shared code of the programs that compare Lodsmith with other simplifiers.
//!
//! Nothing here is part of the product. Times are of this machine and this run; compare only within a table.

pub mod cases;
pub mod lab;
pub mod order;
pub mod process;
pub mod soup;
pub mod stats;
pub mod vertices;

pub use soup::Soup;
pub use vertices::VertexBuffers;
