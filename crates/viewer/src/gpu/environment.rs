//! Environment maps on the GPU.

use std::sync::atomic::{AtomicU64, Ordering};

use egui_wgpu::wgpu;
use egui_wgpu::wgpu::util::DeviceExt;
use lodsmith_render::Environment;
use lodsmith_render::environment::{MAP_COUNT, MAP_HEIGHT, MAP_WIDTH};

use super::context::Context;

/// An environment map, prefiltered for lighting.
pub struct EnvironmentMap {
    id: u64,
    pub(super) view: wgpu::TextureView,
    /// The background behind the models.
    pub(super) sky: wgpu::TextureView,
}

static NEXT_ID: AtomicU64 = AtomicU64::new(1);

impl EnvironmentMap {
    pub(super) fn new(context: &Context, environment: &Environment) -> Self {
        let texture = |[width, height]: [usize; 2], table: &[[f32; 4]]| {
            let descriptor = wgpu::TextureDescriptor {
                label: Some("environment"),
                size: wgpu::Extent3d { width: width as u32, height: height as u32, depth_or_array_layers: 1 },
                mip_level_count: 1,
                sample_count: 1,
                dimension: wgpu::TextureDimension::D2,
                format: wgpu::TextureFormat::Rgba32Float,
                usage: wgpu::TextureUsages::TEXTURE_BINDING,
                view_formats: &[],
            };
            let texture = context.device.create_texture_with_data(
                &context.queue,
                &descriptor,
                wgpu::util::TextureDataOrder::LayerMajor,
                bytemuck::cast_slice(table),
            );
            texture.create_view(&wgpu::TextureViewDescriptor::default())
        };
        let (size, sky) = environment.sky();
        Self {
            id: NEXT_ID.fetch_add(1, Ordering::Relaxed),
            view: texture([MAP_WIDTH, MAP_HEIGHT * MAP_COUNT + 1], &environment.table()),
            sky: texture(size, &sky),
        }
    }

    pub(super) fn id(&self) -> u64 {
        self.id
    }
}
