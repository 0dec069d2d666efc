//! Surfaces coloured by a file of the user.

use std::sync::atomic::{AtomicU64, Ordering};

use egui_wgpu::wgpu;

use super::pipeline::custom_module;
use super::renderer::Gpu;

/// Why a shader cannot be used.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{}{message}", match line { Some(line) => format!("line {line}: "), None => String::new() })]
pub struct ShaderError {
    /// The line of the file, from 1, where it can be told.
    pub line: Option<u32>,
    /// What is wrong.
    pub message: String,
}

/// A shader of the user that has been checked.
///
/// Its text is WGSL and defines `fn surface(at: Surface) -> vec4<f32>`, which returns a linear colour. `Surface` has
/// `place`, `normal`, `face_normal`, `uv`, `base`, `color` and `heat`; `lit(albedo, normal, place)` lights a plain surface.
pub struct SurfaceShader {
    id: u64,
    pub(super) pipelines: [wgpu::RenderPipeline; 2],
}

static NEXT_ID: AtomicU64 = AtomicU64::new(0);

impl SurfaceShader {
    pub(super) fn id(&self) -> u64 {
        self.id
    }
}

impl Gpu {
    /// Checks a shader of the user, and makes it ready.
    ///
    /// # Errors
    /// [`ShaderError`] with the first thing that is wrong.
    pub fn shader(&self, text: &str) -> Result<SurfaceShader, ShaderError> {
        let device = &self.context().device;
        let scope = device.push_error_scope(wgpu::ErrorFilter::Validation);
        let (module, before) = custom_module(self.context(), text);
        let info = pollster::block_on(module.get_compilation_info());
        let failed = pollster::block_on(scope.pop());
        let first = info.messages.iter().find(|m| m.message_type == wgpu::CompilationMessageType::Error);
        if let Some(error) = first {
            let line =
                error.location.map(|l| l.line_number).and_then(|l| l.checked_sub(before)).filter(|l| *l > 0);
            return Err(ShaderError { line, message: error.message.clone() });
        }
        if let Some(error) = failed {
            return Err(ShaderError { line: None, message: error.to_string() });
        }
        let scope = device.push_error_scope(wgpu::ErrorFilter::Validation);
        let pipelines = self.pipelines().of_shader(self.context(), &module);
        if let Some(error) = pollster::block_on(scope.pop()) {
            return Err(ShaderError { line: None, message: error.to_string() });
        }
        Ok(SurfaceShader { id: NEXT_ID.fetch_add(1, Ordering::Relaxed), pipelines })
    }
}
