//! Pipelines: made when first asked for, kept ever after.

use std::collections::HashMap;

use egui_wgpu::wgpu;
use lodsmith_render::Shading;

use super::context::Context;
use super::target::{COLOR, DEPTH};

/// What a pipeline draws.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(super) enum Pass {
    /// The colour or gradient behind everything.
    Background,
    /// Triangles.
    Surface(Shading),
}

/// All pipelines of a device, for pictures of one number of samples.
pub(super) struct Pipelines {
    layout: wgpu::PipelineLayout,
    surface: wgpu::ShaderModule,
    background: wgpu::ShaderModule,
    samples: u32,
    made: HashMap<Pass, wgpu::RenderPipeline>,
}

const GLOBALS: &str = include_str!("../shaders/globals.wgsl");
const VERTEX: &str = include_str!("../shaders/vertex.wgsl");
const SURFACE: &str = include_str!("../shaders/surface.wgsl");
const BACKGROUND: &str = include_str!("../shaders/background.wgsl");

impl Pipelines {
    pub(super) fn new(context: &Context) -> Self {
        let device = &context.device;
        let module = |label: &str, texts: &[&str]| {
            let source = wgpu::ShaderSource::Wgsl(texts.join("\n").into());
            device.create_shader_module(wgpu::ShaderModuleDescriptor { label: Some(label), source })
        };
        let layouts = &context.layouts;
        Self {
            layout: device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
                label: Some("lodsmith"),
                bind_group_layouts: &[Some(&layouts.frame), Some(&layouts.mesh), Some(&layouts.material)],
                immediate_size: 0,
            }),
            surface: module("surface", &[GLOBALS, VERTEX, SURFACE]),
            background: module("background", &[GLOBALS, BACKGROUND]),
            samples: context.sample_count(),
            made: HashMap::new(),
        }
    }

    /// Makes a pipeline, unless it is there.
    pub(super) fn prepare(&mut self, context: &Context, pass: Pass) {
        if self.made.contains_key(&pass) {
            return;
        }
        let pipeline = match pass {
            Pass::Background => self.make(context, pass, &self.background, &[], None),
            Pass::Surface(shading) => {
                let constants = [("SHADING", f64::from(shading_number(shading)))];
                self.make(context, pass, &self.surface, &constants, Some(wgpu::CompareFunction::Greater))
            }
        };
        self.made.insert(pass, pipeline);
    }

    /// A pipeline that was prepared.
    pub(super) fn get(&self, pass: Pass) -> &wgpu::RenderPipeline {
        &self.made[&pass]
    }

    fn make(
        &self,
        context: &Context,
        pass: Pass,
        module: &wgpu::ShaderModule,
        constants: &[(&str, f64)],
        depth: Option<wgpu::CompareFunction>,
    ) -> wgpu::RenderPipeline {
        let label = format!("{pass:?}");
        let options = wgpu::PipelineCompilationOptions { constants, ..Default::default() };
        context.device.create_render_pipeline(&wgpu::RenderPipelineDescriptor {
            label: Some(&label),
            layout: Some(&self.layout),
            vertex: wgpu::VertexState {
                module,
                entry_point: Some("vs"),
                compilation_options: options.clone(),
                buffers: &[],
            },
            primitive: wgpu::PrimitiveState::default(),
            depth_stencil: Some(wgpu::DepthStencilState {
                format: DEPTH,
                depth_write_enabled: Some(depth.is_some()),
                depth_compare: Some(depth.unwrap_or(wgpu::CompareFunction::Always)),
                stencil: wgpu::StencilState::default(),
                bias: wgpu::DepthBiasState::default(),
            }),
            multisample: wgpu::MultisampleState { count: self.samples, ..Default::default() },
            fragment: Some(wgpu::FragmentState {
                module,
                entry_point: Some("fs"),
                compilation_options: options,
                targets: &[Some(wgpu::ColorTargetState {
                    format: COLOR,
                    blend: Some(wgpu::BlendState::PREMULTIPLIED_ALPHA_BLENDING),
                    write_mask: wgpu::ColorWrites::ALL,
                })],
            }),
            multiview_mask: None,
            cache: None,
        })
    }
}

/// The number of a shading in `surface.wgsl`.
fn shading_number(shading: Shading) -> u32 {
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
