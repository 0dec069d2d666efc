//! The command `lodsmith`.
fn main() {}
