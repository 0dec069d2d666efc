//! User-written surface shaders.

use std::sync::atomic::{AtomicU64, Ordering};

use egui_wgpu::wgpu;

use super::context::Context;
use super::pipeline::{Pipelines, custom_module};

/// Error in a user's shader.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{}{message}", match line { Some(line) => format!("line {line}: "), None => String::new() })]
pub struct ShaderError {
    /// Line of the file, counted from 1, if known.
    pub line: Option<u32>,
    /// Description of the error.
    pub message: String,
}

/// A user's shader that has been checked and compiled.
///
/// Its source is WGSL and defines `fn surface(at: Surface) -> vec4<f32>`, which returns a linear colour.
/// `Surface` has `place`, `normal`, `face_normal`, `uv`, `base`, `color` and `heat`; `lit(albedo, normal,
/// place)` shades a diffuse surface.
pub struct SurfaceShader {
    id: u64,
    pub(super) pipelines: [wgpu::RenderPipeline; 2],
}

static NEXT_ID: AtomicU64 = AtomicU64::new(0);

impl SurfaceShader {
    /// Checks a user's shader and builds its pipelines. Returns the first error found.
    pub(super) fn new(context: &Context, pipelines: &Pipelines, text: &str) -> Result<Self, ShaderError> {
        if cfg!(target_arch = "wasm32") {
            // A page cannot wait for the checks.
            let message = "user shaders are not available in a browser".to_owned();
            return Err(ShaderError { line: None, message });
        }
        let device = &context.device;
        let scope = device.push_error_scope(wgpu::ErrorFilter::Validation);
        let (module, before) = custom_module(context, text);
        let info = pollster::block_on(module.get_compilation_info());
        let failed = pollster::block_on(scope.pop());
        let first = info.messages.iter().find(|m| m.message_type == wgpu::CompilationMessageType::Error);
        if let Some(error) = first {
            let line =
                error.location.map(|l| l.line_number).and_then(|l| l.checked_sub(before)).filter(|l| *l > 0);
            return Err(ShaderError { line, message: without_source_excerpt(&error.message) });
        }
        if let Some(error) = failed {
            return Err(ShaderError { line: None, message: error.to_string() });
        }
        let scope = device.push_error_scope(wgpu::ErrorFilter::Validation);
        let pipelines = pipelines.of_shader(context, &module);
        if let Some(error) = pollster::block_on(scope.pop()) {
            return Err(ShaderError { line: None, message: error.to_string() });
        }
        Ok(Self { id: NEXT_ID.fetch_add(1, Ordering::Relaxed), pipelines })
    }

    pub(super) fn id(&self) -> u64 {
        self.id
    }
}

/// Strips the source excerpt from an error message: its line numbers include the built-in code before the
/// file.
fn without_source_excerpt(message: &str) -> String {
    let first = message.lines().map(str::trim).find(|line| !line.is_empty()).unwrap_or("it cannot be read");
    first.split_once("error: ").map_or(first, |(_, what)| what).to_owned()
}
