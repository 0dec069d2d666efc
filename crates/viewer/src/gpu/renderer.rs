//! Renderer that draws frames into targets.

use std::sync::Arc;

use eframe::egui;
use egui_wgpu::wgpu;
use lodsmith_core::{Image, Model};
use lodsmith_render::{Background, Shading};
use web_time::Instant;

use super::buffer::{Item, Storage};
use super::context::{Context, GpuError};
use super::draw_calls::{self, Call, DrawKind, PartPacer};
use super::environment::EnvironmentMap;
use super::frame::{
    DrawList, DrawStats, Frame, FrameSnapshot, build_draw_list, heat_range, max_distance, triangle_count,
};
use super::matcap::Matcap;
use super::model::DrawModel;
use super::pipeline::{Pass, Pipelines, shading_number};
use super::surface_shader::{ShaderError, SurfaceShader};
use super::target::{FramePart, RenderTarget};
use super::timer::Timer;
use super::uniforms::{Globals, GlobalsInput, MAX_LIGHTS, ViewTransform};

/// The renderer: a device with its pipelines.
pub struct Gpu {
    context: Context,
    renderer: Option<Arc<egui::mutex::RwLock<egui_wgpu::Renderer>>>,
    pipelines: Pipelines,
    globals: wgpu::Buffer,
    instances: Storage,
    palette: Storage,
    frame_bind: wgpu::BindGroup,
    plain_material: wgpu::BindGroup,
    no_mesh: wgpu::BindGroup,
    /// Placeholder texture for a missing matcap or environment.
    white: wgpu::TextureView,
    /// Id of the matcap in `frame_bind`; 0 for none.
    bound_matcap: u64,
    /// Id of the environment in `frame_bind`; 0 for none.
    bound_environment: u64,
    sampler: wgpu::Sampler,
    timer: Option<Timer>,
    pace: PartPacer,
}

impl Gpu {
    /// Creates a renderer for a window.
    pub fn new(state: &egui_wgpu::RenderState) -> Self {
        Self::with(Context::of_window(state), Some(Arc::clone(&state.renderer)))
    }

    /// Creates a renderer without a window.
    ///
    /// # Errors
    /// As [`Context::headless`].
    pub fn headless() -> Result<Self, GpuError> {
        Ok(Self::with(Context::headless()?, None))
    }

    /// Creates a renderer on a device, without a window.
    pub fn on(context: Context) -> Self {
        Self::with(context, None)
    }

    /// Enables timestamps for every frame, if the adapter supports them.
    pub fn with_timestamps(self) -> Self {
        Self { timer: Timer::new(&self.context), ..self }
    }

    /// Returns the GPU time in seconds of the last frame, after waiting for it. `None` without [`Gpu::with_timestamps`]
    /// or without timestamp support.
    pub fn gpu_secs(&self) -> Option<f64> {
        self.timer.as_ref()?.seconds(&self.context)
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
        let white = super::texture::texture(&context, &Image::filled(1, 1, [255; 4]), true);
        let sampler = device.create_sampler(&wgpu::SamplerDescriptor {
            mag_filter: wgpu::FilterMode::Linear,
            min_filter: wgpu::FilterMode::Linear,
            ..wgpu::SamplerDescriptor::default()
        });
        let instances = Storage::new(&context, "instances", Item::Quad, &[]);
        let palette = Storage::new(&context, "palette", Item::Quad, &[]);
        let frame_bind = bind_frame(&context, &globals, &instances, &palette, &white, &sampler, [&white; 2]);
        let nothing = context.upload(&Model::default());
        let plain_material = nothing.surfaces.plain().clone();
        let no_mesh = super::model::empty_mesh_bind_group(&context);
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
            no_mesh,
            white,
            bound_matcap: 0,
            bound_environment: 0,
            sampler,
            timer: None,
            pace: PartPacer::default(),
        }
    }

    /// Uploads an environment map.
    pub fn environment(&self, environment: &lodsmith_render::Environment) -> EnvironmentMap {
        EnvironmentMap::new(&self.context, environment)
    }

    /// Returns the device, for uploads from any thread.
    pub fn context(&self) -> &Context {
        &self.context
    }
    /// Returns true for a software renderer.
    pub fn is_software(&self) -> bool {
        self.context.is_software()
    }
    /// Returns the name of the adapter, for display.
    pub fn adapter_name(&self) -> String {
        self.context.adapter_name()
    }
    /// Uploads a model, as [`Context::upload`].
    pub fn upload(&self, model: &Model) -> DrawModel {
        self.context.upload(model)
    }
    /// Uploads a picture of a lit sphere for [`Frame::matcap`].
    pub fn matcap(&self, image: &Image) -> Matcap {
        Matcap::new(&self.context, image)
    }
    /// Checks a user's shader and builds its pipelines.
    ///
    /// # Errors
    /// [`ShaderError`] with the first error found.
    pub fn shader(&self, text: &str) -> Result<SurfaceShader, ShaderError> {
        SurfaceShader::new(&self.context, &self.pipelines, text)
    }
    /// Creates a target of this size in pixels.
    pub fn target(&self, size: [u32; 2]) -> RenderTarget {
        RenderTarget::new(self.context.clone(), self.renderer.as_ref(), size)
    }

    /// Draws a frame unless the target already shows it. Does not wait for the picture.
    ///
    /// Cost on the calling thread: O(placed models), independent of their size.
    pub fn draw(&mut self, target: &mut RenderTarget, frame: &Frame<'_>) -> DrawStats {
        if target.shows(frame) {
            return DrawStats::default();
        }
        target.prepare_textures();
        let drawn = self.draw_range(target, frame, Some(0..u64::MAX));
        target.shown = Some(FrameSnapshot::new(frame, target.size()));
        drawn
    }

    /// Draws a frame like [`Gpu::draw`], but on a software renderer a large frame is drawn one part per call:
    /// the previous picture stays until the new one is complete. Call again while [`DrawStats::triangles_left`]
    /// is not zero. Each part is sized to take a few hundredths of a second.
    pub fn draw_in_parts(&mut self, target: &mut RenderTarget, frame: &Frame<'_>) -> DrawStats {
        if !self.is_software()
            || target.shows(frame)
            || triangle_count(frame) <= draw_calls::MAX_TRIANGLES_AT_ONCE
        {
            return self.draw(target, frame);
        }
        let is_free = self.pace.is_ready(&self.context);
        let most = self.pace.part_triangles;
        self.draw_next_part(target, frame, is_free.then_some(most))
    }

    /// Draws up to `most` more triangles; `None` draws nothing and only counts those left.
    pub(super) fn draw_next_part(
        &mut self,
        target: &mut RenderTarget,
        frame: &Frame<'_>,
        most: Option<u64>,
    ) -> DrawStats {
        let from = target.resume_parts(frame);
        let mut drawn = self.draw_range(target, frame, most.map(|most| from..from + most));
        if drawn.drawn {
            self.pace.record_submission(&self.context, drawn.triangles.saturating_sub(from).max(1));
            target.finish_part(from + most.unwrap_or(0), drawn.triangles_left == 0);
        } else {
            (drawn.triangles, drawn.triangles_left) = (from, drawn.triangles_left.saturating_sub(from));
        }
        drawn
    }

    /// Draws a range of the triangles of a frame; `None` draws nothing.
    fn draw_range(
        &mut self,
        target: &RenderTarget,
        frame: &Frame<'_>,
        range: Option<std::ops::Range<u64>>,
    ) -> DrawStats {
        let begin = Instant::now();
        let size = target.size();
        let aspect = f64::from(size[0]) / f64::from(size[1]);
        let view = ViewTransform::new(&frame.camera, aspect, max_distance(frame));
        let gathered = build_draw_list(frame, &view);
        let is_textured = frame.look.shading == Shading::Textured && frame.shader.is_none();
        let has_marks = frame.look.borders || frame.look.defects;
        let plain = self.plain_material.clone();
        let calls = draw_calls::calls(&gathered, is_textured, has_marks, &plain);
        let total: u64 = calls.iter().map(Call::triangles).sum();
        let mut drawn = DrawStats {
            culled: gathered.culled,
            lights_left_out: frame.lighting.lights.len().saturating_sub(MAX_LIGHTS) as u32,
            triangles_left: total,
            ..DrawStats::default()
        };
        let Some(range) = range else { return drawn };
        (drawn.drawn, drawn.triangles_left) = (true, total.saturating_sub(range.end));
        drawn.triangles = range.start;
        let part = FramePart { is_first: range.start == 0, is_last: drawn.triangles_left == 0 };
        let calls = if part == FramePart::WHOLE { calls } else { draw_calls::calls_in_range(calls, range) };
        self.write_frame(frame, &view, size, target.scale(), &gathered);
        let shading = shading_number(frame.look.shading);
        let [solid, blended] = [false, true].map(|is_blended| Pass::Surface { shading, is_blended });
        let is_environment = matches!(frame.background, Background::Environment { .. });
        let background = Pass::Background { is_environment };
        for pass in [background, Pass::Ground, Pass::HiddenMarks, Pass::Marks, solid, blended] {
            self.prepare(pass);
        }
        let surfaces = match frame.shader {
            Some(shader) => [&shader.pipelines[0], &shader.pipelines[1]],
            None => [self.pipelines.get(solid), self.pipelines.get(blended)],
        };
        let mut encoder =
            self.context.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        {
            let (color, depth) = target.attachments(part);
            let mut pass = encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
                label: Some("frame"),
                color_attachments: &[Some(color)],
                depth_stencil_attachment: Some(depth),
                timestamp_writes: self.timer.as_ref().map(Timer::writes),
                ..wgpu::RenderPassDescriptor::default()
            });
            pass.set_bind_group(0, &self.frame_bind, &[]);
            pass.set_bind_group(1, &self.no_mesh, &[]);
            pass.set_bind_group(2, &self.plain_material, &[]);
            if part.is_first && frame.background != Background::Transparent {
                pass.set_pipeline(self.pipelines.get(background));
                pass.draw(0..3, 0..1);
            }
            if part.is_first && frame.ground {
                pass.set_pipeline(self.pipelines.get(Pass::Ground));
                pass.draw(0..3, 0..1);
            }
            let mut last = None;
            for call in &calls {
                if last.replace(call.kind) != Some(call.kind) {
                    pass.set_pipeline(match call.kind {
                        DrawKind::Solid => surfaces[0],
                        DrawKind::Blended => surfaces[1],
                        DrawKind::Marks => self.pipelines.get(Pass::Marks),
                    });
                }
                pass.set_bind_group(1, call.mesh, &[]);
                pass.set_bind_group(2, call.material, &[]);
                if call.kind == DrawKind::Marks && frame.marks_stand_out {
                    pass.set_pipeline(self.pipelines.get(Pass::HiddenMarks));
                    pass.draw(call.corners.clone(), call.instances.clone());
                    pass.set_pipeline(self.pipelines.get(Pass::Marks));
                }
                pass.draw(call.corners.clone(), call.instances.clone());
                drawn.calls += 1;
                if call.kind != DrawKind::Marks {
                    drawn.triangles += call.triangles();
                }
            }
        }
        if let Some(timer) = &self.timer {
            timer.resolve(&mut encoder);
        }
        let commands = encoder.finish();
        drawn.cpu_time = begin.elapsed();
        self.context.queue.submit([commands]);
        drawn
    }

    /// Draws all triangles with one pipeline, ignoring materials.
    pub(super) fn draw_plain(&self, pass: &mut wgpu::RenderPass<'_>, with: Pass, gathered: &DrawList<'_>) {
        pass.set_pipeline(self.pipelines.get(with));
        pass.set_bind_group(0, &self.frame_bind, &[]);
        pass.set_bind_group(2, &self.plain_material, &[]);
        for batch in &gathered.batches {
            for chunk in &batch.model.meshes[batch.mesh].chunks {
                pass.set_bind_group(1, &chunk.bind, &[]);
                for part in &chunk.parts {
                    pass.draw(part.corners.clone(), batch.instances.clone());
                }
            }
        }
    }

    pub(super) fn prepare(&mut self, pass: Pass) {
        self.pipelines.prepare(&self.context, pass);
    }

    pub(super) fn write_frame(
        &mut self,
        frame: &Frame<'_>,
        view: &ViewTransform,
        size: [u32; 2],
        scale: f32,
        gathered: &DrawList<'_>,
    ) {
        let globals = Globals::new(&GlobalsInput {
            view,
            size,
            bounds: &frame.bounds,
            look: frame.look,
            lighting: frame.lighting,
            background: frame.background,
            heat_range: heat_range(frame),
            has_matcap: frame.matcap.is_some(),
            has_environment: frame.environment.is_some(),
            marks_stand_out: frame.marks_stand_out,
            scale,
        });
        self.context.queue.write_buffer(&self.globals, 0, bytemuck::bytes_of(&globals));
        let moved = [
            self.instances.replace(&self.context, bytemuck::cast_slice(&gathered.instances)),
            self.palette.replace(&self.context, bytemuck::cast_slice(&gathered.palette)),
        ];
        let matcap = frame.matcap.map_or(0, Matcap::id);
        let environment = frame.environment.map_or(0, EnvironmentMap::id);
        if moved.contains(&true) || matcap != self.bound_matcap || environment != self.bound_environment {
            self.bound_matcap = matcap;
            self.bound_environment = environment;
            self.frame_bind = bind_frame(
                &self.context,
                &self.globals,
                &self.instances,
                &self.palette,
                frame.matcap.map_or(&self.white, |m| &m.view),
                &self.sampler,
                frame.environment.map_or([&self.white; 2], |e| [&e.view, &e.sky]),
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
    [environment, sky]: [&wgpu::TextureView; 2],
) -> wgpu::BindGroup {
    let entry = |binding, resource| wgpu::BindGroupEntry { binding, resource };
    context.device.create_bind_group(&wgpu::BindGroupDescriptor {
        label: Some("frame"),
        layout: &context.layouts.frame,
        entries: &[
            entry(0, globals.as_entire_binding()),
            entry(1, instances.resource()),
            entry(2, palette.resource()),
            entry(3, wgpu::BindingResource::TextureView(matcap)),
            entry(4, wgpu::BindingResource::Sampler(sampler)),
            entry(5, wgpu::BindingResource::TextureView(environment)),
            entry(6, wgpu::BindingResource::TextureView(sky)),
        ],
    })
}
