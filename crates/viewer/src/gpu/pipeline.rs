//! Render pipelines, built on first use and cached.

use std::collections::HashMap;

use egui_wgpu::wgpu;
use lodsmith_render::Shading;

use super::context::Context;

/// Content drawn by a pipeline.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(super) enum Pass {
    /// The background.
    Background {
        /// True for the environment, false for a gradient.
        is_environment: bool,
    },
    /// Triangles; transparent ones do not write depth.
    Surface {
        /// Number of the shading in `surface.wgsl`.
        shading: u32,
        is_blended: bool,
    },
    /// The ground grid.
    Ground,
    /// Borders and defects.
    Marks,
    /// Borders and defects behind a surface.
    HiddenMarks,
    /// Model numbers and depths instead of colours.
    Pick,
}

/// Opacity of borders and defects behind a surface.
const HIDDEN_MARK_OPACITY: f64 = 0.4;
/// Shading number of a user's shader.
pub(super) const CUSTOM_SHADING: u32 = 7;

/// All pipelines of a device, for a fixed sample count.
pub(super) struct Pipelines {
    layout: wgpu::PipelineLayout,
    surface: wgpu::ShaderModule,
    background: wgpu::ShaderModule,
    ground: wgpu::ShaderModule,
    marks: wgpu::ShaderModule,
    pick: wgpu::ShaderModule,
    samples: u32,
    made: HashMap<Pass, wgpu::RenderPipeline>,
}

const GLOBALS: &str = include_str!("shaders/globals.wgsl");
const ENVIRONMENT: &str = include_str!("shaders/environment.wgsl");
const PULL_BUFFERS: &str = include_str!("shaders/pull_buffers.wgsl");
const PULL_TEXTURES: &str = include_str!("shaders/pull_textures.wgsl");
const VERTEX: &str = include_str!("shaders/vertex.wgsl");
const SURFACE: &str = include_str!("shaders/surface.wgsl");
const BACKGROUND: &str = include_str!("shaders/background.wgsl");
const GROUND: &str = include_str!("shaders/ground.wgsl");
const MARKS: &str = include_str!("shaders/marks.wgsl");
const PICK: &str = include_str!("shaders/pick.wgsl");
/// Placeholder for the user's shader.
const PLACEHOLDER_SHADER: &str = "fn surface(at: Surface) -> vec4<f32> { return vec4(at.base, 1.0); }";
/// Format of a pick: number of the model hit, and the bits of its depth.
pub(super) const PICK_FORMAT: wgpu::TextureFormat = wgpu::TextureFormat::Rg32Uint;
/// Depth format. Depth is the inverse of the distance: 0 is infinitely far.
pub(super) const DEPTH_FORMAT: wgpu::TextureFormat = wgpu::TextureFormat::Depth32Float;
/// Format that the window samples: raw sRGB values, premultiplied by alpha.
pub(super) const STORED_FORMAT: wgpu::TextureFormat = wgpu::TextureFormat::Rgba8Unorm;

/// Returns the format for drawing: passes write linear colours, which are stored as sRGB. If an adapter does
/// not support two view formats for a texture, the shaders encode sRGB themselves.
pub(super) fn draw_format(context: &Context) -> wgpu::TextureFormat {
    if context.has_views { wgpu::TextureFormat::Rgba8UnormSrgb } else { STORED_FORMAT }
}

impl Pipelines {
    pub(super) fn new(context: &Context) -> Self {
        let module = |label: &str, texts: &[&str]| module(context, label, texts);
        let pull = pull(context);
        Self {
            layout: layout(context),
            surface: module("surface", &[GLOBALS, ENVIRONMENT, pull, VERTEX, SURFACE, PLACEHOLDER_SHADER]),
            background: module("background", &[GLOBALS, ENVIRONMENT, BACKGROUND]),
            ground: module("ground", &[GLOBALS, GROUND]),
            marks: module("marks", &[GLOBALS, pull, VERTEX, MARKS]),
            pick: module("pick", &[GLOBALS, pull, VERTEX, PICK]),
            samples: context.sample_count(),
            made: HashMap::new(),
        }
    }

    /// Builds a pipeline if it does not exist yet.
    pub(super) fn prepare(&mut self, context: &Context, pass: Pass) {
        if !self.made.contains_key(&pass) {
            let pipeline = self.make(context, pass, self.module(pass));
            self.made.insert(pass, pipeline);
        }
    }

    /// Returns the pipelines of a user's surface shader: solid, then blended.
    pub(super) fn of_shader(
        &self,
        context: &Context,
        module: &wgpu::ShaderModule,
    ) -> [wgpu::RenderPipeline; 2] {
        [false, true].map(|is_blended| {
            self.make(context, Pass::Surface { shading: CUSTOM_SHADING, is_blended }, module)
        })
    }

    /// Returns a prepared pipeline.
    pub(super) fn get(&self, pass: Pass) -> &wgpu::RenderPipeline {
        &self.made[&pass]
    }

    fn module(&self, pass: Pass) -> &wgpu::ShaderModule {
        match pass {
            Pass::Background { .. } => &self.background,
            Pass::Surface { .. } => &self.surface,
            Pass::Ground => &self.ground,
            Pass::Marks | Pass::HiddenMarks => &self.marks,
            Pass::Pick => &self.pick,
        }
    }

    fn make(&self, context: &Context, pass: Pass, module: &wgpu::ShaderModule) -> wgpu::RenderPipeline {
        let label = format!("{pass:?}");
        let mut constants = vec![("ENCODE", f64::from(u8::from(!context.has_views)))];
        if let Pass::Surface { shading, .. } = pass {
            constants.push(("SHADING", f64::from(shading)));
        }
        if let Pass::Background { is_environment } = pass {
            constants.push(("IS_ENVIRONMENT", f64::from(u8::from(is_environment))));
        }
        if pass == Pass::HiddenMarks {
            constants.push(("OPACITY", HIDDEN_MARK_OPACITY));
        }
        let options = wgpu::PipelineCompilationOptions { constants: &constants, ..Default::default() };
        let (writes_depth, compare) = match pass {
            Pass::Background { .. } => (false, wgpu::CompareFunction::Always),
            Pass::Surface { is_blended, .. } => (!is_blended, wgpu::CompareFunction::Greater),
            Pass::Ground | Pass::Marks => (false, wgpu::CompareFunction::GreaterEqual),
            Pass::HiddenMarks => (false, wgpu::CompareFunction::Less),
            Pass::Pick => (true, wgpu::CompareFunction::Greater),
        };
        let (format, blend, count) = if pass == Pass::Pick {
            (PICK_FORMAT, None, 1)
        } else {
            (draw_format(context), Some(wgpu::BlendState::PREMULTIPLIED_ALPHA_BLENDING), self.samples)
        };
        context.device.create_render_pipeline(&wgpu::RenderPipelineDescriptor {
            label: Some(&label),
            layout: Some(&self.layout),
            vertex: wgpu::VertexState {
                module,
                entry_point: Some(if matches!(pass, Pass::Marks | Pass::HiddenMarks) {
                    "line"
                } else {
                    "vs"
                }),
                compilation_options: options.clone(),
                buffers: &[],
            },
            primitive: wgpu::PrimitiveState::default(),
            depth_stencil: Some(wgpu::DepthStencilState {
                format: DEPTH_FORMAT,
                depth_write_enabled: Some(writes_depth),
                depth_compare: Some(compare),
                stencil: wgpu::StencilState::default(),
                bias: wgpu::DepthBiasState::default(),
            }),
            multisample: wgpu::MultisampleState { count, ..Default::default() },
            fragment: Some(wgpu::FragmentState {
                module,
                entry_point: Some("fs"),
                compilation_options: options,
                targets: &[Some(wgpu::ColorTargetState {
                    format,
                    blend,
                    write_mask: wgpu::ColorWrites::ALL,
                })],
            }),
            multiview_mask: None,
            cache: None,
        })
    }
}

/// Returns the functions by which vertices pull their values.
fn pull(context: &Context) -> &'static str {
    if context.pulls_textures { PULL_TEXTURES } else { PULL_BUFFERS }
}

fn layout(context: &Context) -> wgpu::PipelineLayout {
    let layouts = &context.layouts;
    context.device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
        label: Some("lodsmith"),
        bind_group_layouts: &[Some(&layouts.frame), Some(&layouts.mesh), Some(&layouts.material)],
        immediate_size: 0,
    })
}

fn module(context: &Context, label: &str, texts: &[&str]) -> wgpu::ShaderModule {
    let source = wgpu::ShaderSource::Wgsl(texts.join("\n").into());
    context.device.create_shader_module(wgpu::ShaderModuleDescriptor { label: Some(label), source })
}

/// Returns the shader module of a user's surface shader, and the number of lines before the user's first
/// line.
pub(super) fn custom_module(context: &Context, text: &str) -> (wgpu::ShaderModule, u32) {
    let before = [GLOBALS, ENVIRONMENT, pull(context), VERTEX, SURFACE].join("\n");
    let lines = before.matches('\n').count() as u32 + 1;
    (module(context, "surface of a file", &[&before, text]), lines)
}

/// Returns the number of a shading in `surface.wgsl`.
pub(super) fn shading_number(shading: Shading) -> u32 {
    match shading {
        Shading::Smooth => 0,
        Shading::Flat => 1,
        Shading::Textured => 2,
        Shading::VertexColors => 3,
        Shading::Normals => 4,
        Shading::Matcap => 5,
        Shading::Heat => 6,
    }
}
