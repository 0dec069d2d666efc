//! Tests of the whole crate but the window, in one program: each program links everything again
//! (docs/decisions/0026).

mod adapter;
mod commands;
mod documents;
mod gpu_equals_cpu;
mod page;
mod screens;
mod slider_preview;
mod stage;
