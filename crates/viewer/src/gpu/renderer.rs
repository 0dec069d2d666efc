//! Frames into targets.

use std::sync::Arc;

use eframe::egui;
use egui_wgpu::wgpu;
use lodsmith_core::Model;

use super::buffer::Storage;
use super::context::{Context, GpuError};
use super::frame::{Drawn, Frame, Gathered, Shown, gather, heat_range, reach};
use super::model::DrawModel;
use super::pipeline::{Pass, Pipelines};
use super::target::Target;
use super::uniforms::{Globals, LIGHTS_MAX, Seen, View};

/// What draws: the device with its pipelines.
pub struct Gpu {
    context: Context,
    renderer: Option<Arc<egui::mutex::RwLock<egui_wgpu::Renderer>>>,
    pipelines: Pipelines,
    globals: wgpu::Buffer,
    instances: Storage,
    palette: Storage,
    frame_bind: wgpu::BindGroup,
    plain_material: wgpu::BindGroup,
    matcap: wgpu::TextureView,
    sampler: wgpu::Sampler,
}

impl Gpu {
    /// What draws into a window.
    ///
    /// # Errors
    /// As [`Context::of_window`].
    pub fn new(state: &egui_wgpu::RenderState) -> Result<Self, GpuError> {
        Ok(Self::with(Context::of_window(state)?, Some(Arc::clone(&state.renderer))))
    }

    /// What draws without any window.
    ///
    /// # Errors
    /// As [`Context::headless`].
    pub fn headless() -> Result<Self, GpuError> {
        Ok(Self::with(Context::headless()?, None))
    }

    /// What draws on a device, without any window.
    pub fn on(context: Context) -> Self {
        Self::with(context, None)
    }

    fn with(context: Context, renderer: Option<Arc<egui::mutex::RwLock<egui_wgpu::Renderer>>>) -> Self {
        let device = &context.device;
        let uniform = |label, size| {
            let usage = wgpu::BufferUsages::UNIFORM | wgpu::BufferUsages::COPY_DST;
            let size: usize = size;
            let size = size as u64;
            device.create_buffer(&wgpu::BufferDescriptor {
                label: Some(label),
                size,
                usage,
                mapped_at_creation: false,
            })
        };
        let globals = uniform("globals", size_of::<Globals>());
        let usage = wgpu::TextureUsages::TEXTURE_BINDING | wgpu::TextureUsages::COPY_DST;
        let white = super::target::texture(&context, [1, 1], 1, wgpu::TextureFormat::Rgba8Unorm, usage);
        let matcap = white.create_view(&wgpu::TextureViewDescriptor::default());
        let sampler = device.create_sampler(&wgpu::SamplerDescriptor {
            mag_filter: wgpu::FilterMode::Linear,
            min_filter: wgpu::FilterMode::Linear,
            ..wgpu::SamplerDescriptor::default()
        });
        let instances = Storage::new(&context, "instances", &[]);
        let palette = Storage::new(&context, "palette", &[]);
        let frame_bind = bind_frame(&context, &globals, &instances, &palette, &matcap, &sampler);
        let material = uniform("material", 256);
        let plain_material = bind_material(&context, &material, &matcap, &sampler);
        let pipelines = Pipelines::new(&context);
        Self {
            context,
            renderer,
            pipelines,
            globals,
            instances,
            palette,
            frame_bind,
            plain_material,
            matcap,
            sampler,
        }
    }

    /// The device, to upload with from any thread.
    pub fn context(&self) -> &Context {
        &self.context
    }
    /// Whether pictures are computed on the processor.
    pub fn is_software(&self) -> bool {
        self.context.is_software()
    }
    /// Name of the adapter, for people.
    pub fn adapter_name(&self) -> String {
        self.context.adapter_name()
    }
    /// As [`Context::upload`].
    pub fn upload(&self, model: &Model) -> DrawModel {
        self.context.upload(model)
    }
    /// A picture to draw into, of a size in pixels.
    pub fn target(&self, size: [u32; 2]) -> Target {
        Target::new(self.context.clone(), self.renderer.as_ref(), size)
    }

    /// Draws a frame, unless the target shows it already. Does not wait for the picture.
    ///
    /// Cost of the caller's thread: O(models placed), whatever their size.
    pub fn draw(&mut self, target: &mut Target, frame: &Frame<'_>) -> Drawn {
        let size = target.size();
        if target.shown.as_ref().is_some_and(|shown| shown.is(frame, size)) {
            return Drawn::default();
        }
        let aspect = f64::from(size[0]) / f64::from(size[1]);
        let view = View::new(&frame.camera, aspect, reach(frame));
        let gathered = gather(frame, &view);
        self.write_frame(frame, &view, size, target.scale(), &gathered);
        let surface = Pass::Surface(frame.look.shading);
        for pass in [Pass::Background, surface] {
            self.pipelines.prepare(&self.context, pass);
        }
        let mut drawn = Drawn {
            drawn: true,
            culled: gathered.culled,
            lights_left_out: frame.lighting.lights.len().saturating_sub(LIGHTS_MAX) as u32,
            ..Drawn::default()
        };
        let mut encoder =
            self.context.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        {
            let mut pass = encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
                label: Some("frame"),
                color_attachments: &[Some(target.color_attachment())],
                depth_stencil_attachment: Some(target.depth_attachment()),
                ..wgpu::RenderPassDescriptor::default()
            });
            pass.set_bind_group(0, &self.frame_bind, &[]);
            pass.set_bind_group(2, &self.plain_material, &[]);
            if frame.background != lodsmith_render::Background::Transparent {
                pass.set_pipeline(self.pipelines.get(Pass::Background));
                pass.draw(0..3, 0..1);
            }
            pass.set_pipeline(self.pipelines.get(surface));
            for batch in &gathered.batches {
                let copies = u64::from(batch.instances.end - batch.instances.start);
                for chunk in &batch.model.meshes[batch.mesh].chunks {
                    pass.set_bind_group(1, &chunk.bind, &[]);
                    for part in &chunk.parts {
                        pass.draw(part.corners.clone(), batch.instances.clone());
                        drawn.triangles += u64::from(part.corners.end - part.corners.start) / 3 * copies;
                        drawn.calls += 1;
                    }
                }
            }
        }
        self.context.queue.submit([encoder.finish()]);
        target.shown = Some(Shown::new(frame, size));
        drawn
    }

    fn write_frame(
        &mut self,
        frame: &Frame<'_>,
        view: &View,
        size: [u32; 2],
        scale: f32,
        gathered: &Gathered<'_>,
    ) {
        let globals = Globals::new(&Seen {
            view,
            size,
            bounds: &frame.bounds,
            look: frame.look,
            lighting: frame.lighting,
            background: frame.background,
            heat_range: heat_range(frame),
            scale,
        });
        self.context.queue.write_buffer(&self.globals, 0, bytemuck::bytes_of(&globals));
        let moved = [
            self.instances.replace(&self.context, bytemuck::cast_slice(&gathered.instances)),
            self.palette.replace(&self.context, bytemuck::cast_slice(&gathered.palette)),
        ];
        if moved.contains(&true) {
            self.frame_bind = bind_frame(
                &self.context,
                &self.globals,
                &self.instances,
                &self.palette,
                &self.matcap,
                &self.sampler,
            );
        }
    }
}

fn bind_frame(
    context: &Context,
    globals: &wgpu::Buffer,
    instances: &Storage,
    palette: &Storage,
    matcap: &wgpu::TextureView,
    sampler: &wgpu::Sampler,
) -> wgpu::BindGroup {
    let entry = |binding, resource| wgpu::BindGroupEntry { binding, resource };
    context.device.create_bind_group(&wgpu::BindGroupDescriptor {
        label: Some("frame"),
        layout: &context.layouts.frame,
        entries: &[
            entry(0, globals.as_entire_binding()),
            entry(1, instances.buffer().as_entire_binding()),
            entry(2, palette.buffer().as_entire_binding()),
            entry(3, wgpu::BindingResource::TextureView(matcap)),
            entry(4, wgpu::BindingResource::Sampler(sampler)),
        ],
    })
}

fn bind_material(
    context: &Context,
    uniform: &wgpu::Buffer,
    texture: &wgpu::TextureView,
    sampler: &wgpu::Sampler,
) -> wgpu::BindGroup {
    let mut entries = vec![wgpu::BindGroupEntry { binding: 0, resource: uniform.as_entire_binding() }];
    let textures = super::layout::MATERIAL_TEXTURES;
    for k in 0..textures {
        let (texture, sampler) =
            (wgpu::BindingResource::TextureView(texture), wgpu::BindingResource::Sampler(sampler));
        entries.push(wgpu::BindGroupEntry { binding: 1 + k, resource: texture });
        entries.push(wgpu::BindGroupEntry { binding: 1 + textures + k, resource: sampler });
    }
    context.device.create_bind_group(&wgpu::BindGroupDescriptor {
        label: Some("plain material"),
        layout: &context.layouts.material,
        entries: &entries,
    })
}
