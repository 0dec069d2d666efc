//! Picking of the model and the point under the cursor.

use egui_wgpu::wgpu;
use glam::{DVec3, Mat4, Vec3};

use super::frame::{Frame, build_draw_list, max_distance};
use super::pipeline::{DEPTH_FORMAT, PICK_FORMAT, Pass};
use super::renderer::Gpu;
use super::target::{FramePart, RenderTarget, depth_attachment, read_texture, texture};
use super::uniforms::ViewTransform;

/// Model and point found under a pixel.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PickHit {
    /// Index in [`Frame::models`].
    pub model: usize,
    /// Point on the surface, in world coordinates.
    pub position: DVec3,
}

impl Gpu {
    /// Returns the model and the point at a position in the target, given from 0 to 1 from its upper left
    /// corner; `None` if there is no surface.
    ///
    /// Draws a picture of one pixel and waits for it: meant for clicks and the first turn of the mouse wheel,
    /// not for every frame.
    pub fn pick(&mut self, target: &RenderTarget, frame: &Frame<'_>, at: [f32; 2]) -> Option<PickHit> {
        let size = target.size();
        let aspect = f64::from(size[0]) / f64::from(size[1]);
        let whole = ViewTransform::new(&frame.camera, aspect, max_distance(frame));
        let [x, y] = [0, 1].map(|k| at[k] * size[k] as f32);
        let view = whole.of_pixel([x, y], size);
        let gathered = build_draw_list(frame, &whole);
        self.write_frame(frame, &view, [1, 1], 1.0, &gathered);
        self.prepare(Pass::Pick);
        let context = self.context().clone();
        let usage = wgpu::TextureUsages::RENDER_ATTACHMENT | wgpu::TextureUsages::COPY_SRC;
        let picked = texture(&context, [1, 1], 1, PICK_FORMAT, usage);
        let depth = texture(&context, [1, 1], 1, DEPTH_FORMAT, wgpu::TextureUsages::RENDER_ATTACHMENT);
        let plane = |t: &wgpu::Texture| t.create_view(&wgpu::TextureViewDescriptor::default());
        let (picked_view, depth_view) = (plane(&picked), plane(&depth));
        let mut encoder = context.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        {
            let ops = wgpu::Operations {
                load: wgpu::LoadOp::Clear(wgpu::Color::TRANSPARENT),
                store: wgpu::StoreOp::Store,
            };
            let color = wgpu::RenderPassColorAttachment {
                view: &picked_view,
                depth_slice: None,
                resolve_target: None,
                ops,
            };
            let mut pass = encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
                label: Some("pick"),
                color_attachments: &[Some(color)],
                depth_stencil_attachment: Some(depth_attachment(&depth_view, FramePart::WHOLE)),
                ..wgpu::RenderPassDescriptor::default()
            });
            self.draw_plain(&mut pass, Pass::Pick, &gathered);
        }
        context.queue.submit([encoder.finish()]);
        let bytes = read_texture(&context, &picked, [1, 1], 8);
        let word = |k: usize| u32::from_le_bytes([bytes[k], bytes[k + 1], bytes[k + 2], bytes[k + 3]]);
        let model = word(0).checked_sub(1)? as usize;
        let depth = f32::from_bits(word(4));
        let clip = Vec3::new(0.0, 0.0, depth);
        let clip_to_view: Mat4 = view.clip_from_view;
        let place = glam::DMat4::from_cols_array(&clip_to_view.to_cols_array().map(f64::from))
            .inverse()
            .project_point3(clip.as_dvec3());
        let position = view.view_from_world.inverse().transform_point3(place);
        position.is_finite().then_some(PickHit { model, position })
    }
}
