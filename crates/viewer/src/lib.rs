//! The window: original and lighter mesh side by side, live while you drag.

pub mod gpu;
