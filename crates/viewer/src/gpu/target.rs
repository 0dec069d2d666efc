//! Render targets that are displayed or read back.

use std::sync::Arc;

use eframe::egui;
use egui_wgpu::wgpu;
use lodsmith_core::Image;

use super::context::Context;
use super::frame::{Frame, FrameSnapshot};
use super::model::DrawModel;
use super::pipeline::{DEPTH_FORMAT, STORED_FORMAT, draw_format};
use super::uniforms::{linear_from_srgb, srgb_from_linear};

type Renderer = Arc<egui::mutex::RwLock<egui_wgpu::Renderer>>;

/// A picture that a viewport displays, or that is read back. It remembers which frame it shows.
pub struct RenderTarget {
    context: Context,
    size: [u32; 2],
    screen_px: [u32; 2],
    scale: f32,
    planes: TargetTextures,
    pub(super) shown: Option<FrameSnapshot>,
    /// Picture being drawn in parts while the previous one is shown.
    back: Option<PartialFrame>,
    /// Texture id under which the window samples the picture.
    registered: Option<(Renderer, egui::TextureId)>,
}

/// A picture that is still incomplete.
struct PartialFrame {
    planes: TargetTextures,
    of: FrameSnapshot,
    /// Number of triangles already drawn.
    done: u64,
}

/// Textures of a target, all of one size.
struct TargetTextures {
    size: [u32; 2],
    color: wgpu::Texture,
    /// View for the window.
    color_view: wgpu::TextureView,
    /// View for drawing.
    light_view: wgpu::TextureView,
    samples: Option<wgpu::TextureView>,
    depth: wgpu::TextureView,
}

impl RenderTarget {
    pub(super) fn new(context: Context, renderer: Option<&Renderer>, size: [u32; 2]) -> Self {
        let size = clamped(&context, size);
        let planes = TargetTextures::new(&context, size);
        let registered = renderer.map(|renderer| {
            let filter = wgpu::FilterMode::Linear;
            let id = renderer.write().register_native_texture(&context.device, &planes.color_view, filter);
            (Arc::clone(renderer), id)
        });
        Self { context, size, screen_px: size, scale: 1.0, planes, shown: None, back: None, registered }
    }

    /// Sets the size on the screen in pixels, and the number of picture pixels per screen pixel along each
    /// axis: less than 1 draws faster, more is smoother. The current picture stays until something is drawn.
    pub fn resize(&mut self, screen_px: [u32; 2], scale: f32) {
        let scale = scale.clamp(0.1, 4.0);
        let size = screen_px.map(|x| (x as f32 * scale).round() as u32);
        let size = clamped(&self.context, size);
        (self.scale, self.size, self.screen_px) = (scale, size, screen_px);
    }

    /// Prepares the textures for a picture that is drawn in one piece.
    pub(super) fn prepare_textures(&mut self) {
        self.back = None;
        if self.planes.size != self.size {
            self.show(TargetTextures::new(&self.context, self.size));
        }
    }

    fn show(&mut self, planes: TargetTextures) {
        self.planes = planes;
        if let Some((renderer, id)) = &self.registered {
            renderer.write().update_egui_texture_from_wgpu_texture(
                &self.context.device,
                &self.planes.color_view,
                wgpu::FilterMode::Linear,
                *id,
            );
        }
    }

    /// Resumes a picture in parts, or starts it. Returns the number of triangles already drawn.
    pub(super) fn resume_parts(&mut self, frame: &Frame<'_>) -> u64 {
        let size = self.size;
        if let Some(back) = self.back.as_ref().filter(|back| back.of.is(frame, size)) {
            return back.done;
        }
        let kept = self.back.take().map(|back| back.planes).filter(|planes| planes.size == size);
        let planes = kept.unwrap_or_else(|| TargetTextures::new(&self.context, size));
        self.back = Some(PartialFrame { planes, of: FrameSnapshot::new(frame, size), done: 0 });
        0
    }

    /// Records the number of triangles drawn so far, and shows the picture once it is complete.
    pub(super) fn finish_part(&mut self, done: u64, is_whole: bool) {
        if let Some(back) = self.back.as_mut().filter(|_| !is_whole) {
            back.done = done;
        } else if let Some(back) = self.back.take() {
            self.shown = Some(back.of);
            self.show(back.planes);
        }
    }

    /// Returns true if this same frame is being drawn in parts.
    pub fn draws(&self, frame: &Frame<'_>) -> bool {
        self.back.as_ref().is_some_and(|back| back.of.is(frame, self.size))
    }

    /// Returns width and height of the picture in its own pixels.
    pub fn size(&self) -> [u32; 2] {
        self.size
    }
    /// Returns width and height on the screen in pixels.
    pub fn screen_px(&self) -> [u32; 2] {
        self.screen_px
    }
    /// Returns the number of picture pixels per screen pixel.
    pub fn scale(&self) -> f32 {
        self.scale
    }
    /// Returns the texture id for the window; `None` without a window.
    pub fn texture_id(&self) -> Option<egui::TextureId> {
        self.registered.as_ref().map(|(_, id)| *id)
    }
    /// Returns true if it shows a picture.
    pub fn has_picture(&self) -> bool {
        self.shown.is_some()
    }
    /// Returns true if it already shows this same frame.
    pub fn shows(&self, frame: &Frame<'_>) -> bool {
        self.shown.as_ref().is_some_and(|shown| shown.is(frame, self.size))
    }
    /// Returns true if it shows this model or its preview mesh, in any view.
    pub fn shows_model(&self, model: &DrawModel) -> bool {
        let is = |id: u64| self.shown.as_ref().is_some_and(|shown| shown.has(id));
        is(model.version().0) || model.preview().is_some_and(|light| is(light.version().0))
    }
    /// Forgets what it shows, so that the next frame is drawn in any case.
    pub fn forget(&mut self) {
        (self.shown, self.back) = (None, None);
    }

    /// Returns the picture. Waits until it is drawn.
    pub fn read_back(&self) -> Image {
        let size = self.planes.size;
        let [width, height] = size.map(|x| x as usize);
        let bytes = read_texture(&self.context, &self.planes.color, size, 4);
        let pixels = bytes.chunks_exact(4).map(|p| {
            // Linear colours were premultiplied, not the stored sRGB values.
            let alpha = f32::from(p[3].max(1)) / 255.0;
            let apart = |x: u8| {
                let light = linear_from_srgb(f32::from(x) / 255.0) / alpha;
                (srgb_from_linear(light.min(1.0)) * 255.0).round() as u8
            };
            if p[3] == 255 { [p[0], p[1], p[2], 255] } else { [apart(p[0]), apart(p[1]), apart(p[2]), p[3]] }
        });
        Image::new(width, height, pixels.collect())
    }

    /// Returns the colour and depth attachments, cleared for the first part and loaded for later ones.
    pub(super) fn attachments(
        &self,
        part: FramePart,
    ) -> (wgpu::RenderPassColorAttachment<'_>, wgpu::RenderPassDepthStencilAttachment<'_>) {
        let planes = self.back.as_ref().map_or(&self.planes, |back| &back.planes);
        let (view, resolve_target) = match &planes.samples {
            Some(samples) => (samples, Some(&planes.light_view)),
            None => (&planes.light_view, None),
        };
        let clear = wgpu::LoadOp::Clear(wgpu::Color::TRANSPARENT);
        let load = if part.is_first { clear } else { wgpu::LoadOp::Load };
        let ops = wgpu::Operations { load, store: wgpu::StoreOp::Store };
        let color = wgpu::RenderPassColorAttachment { view, depth_slice: None, resolve_target, ops };
        (color, depth_attachment(&planes.depth, part))
    }
}

/// Position of a part among the parts of a picture.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct FramePart {
    pub(super) is_first: bool,
    pub(super) is_last: bool,
}

impl FramePart {
    pub(super) const WHOLE: Self = Self { is_first: true, is_last: true };
}

impl Drop for RenderTarget {
    fn drop(&mut self) {
        if let Some((renderer, id)) = &self.registered {
            renderer.write().free_texture(id);
        }
    }
}

impl TargetTextures {
    fn new(context: &Context, size: [u32; 2]) -> Self {
        let samples = context.sample_count();
        let attachment = wgpu::TextureUsages::RENDER_ATTACHMENT;
        let usage = attachment | wgpu::TextureUsages::TEXTURE_BINDING | wgpu::TextureUsages::COPY_SRC;
        let color = texture(context, size, 1, STORED_FORMAT, usage);
        let drawn_as = draw_format(context);
        let view = |t: &wgpu::Texture| t.create_view(&wgpu::TextureViewDescriptor::default());
        let as_light = wgpu::TextureViewDescriptor { format: Some(drawn_as), ..Default::default() };
        Self {
            size,
            light_view: color.create_view(&as_light),
            color_view: view(&color),
            samples: (samples > 1).then(|| view(&texture(context, size, samples, drawn_as, attachment))),
            depth: view(&texture(context, size, samples, DEPTH_FORMAT, attachment)),
            color,
        }
    }
}

/// Returns the depth attachment: cleared to infinitely far for the first part, stored only if another part
/// follows.
pub(super) fn depth_attachment(
    view: &wgpu::TextureView,
    part: FramePart,
) -> wgpu::RenderPassDepthStencilAttachment<'_> {
    let load = if part.is_first { wgpu::LoadOp::Clear(0.0) } else { wgpu::LoadOp::Load };
    let store = if part.is_last { wgpu::StoreOp::Discard } else { wgpu::StoreOp::Store };
    let ops = wgpu::Operations { load, store };
    wgpu::RenderPassDepthStencilAttachment { view, depth_ops: Some(ops), stencil_ops: None }
}

pub(super) fn texture(
    context: &Context,
    [width, height]: [u32; 2],
    sample_count: u32,
    format: wgpu::TextureFormat,
    usage: wgpu::TextureUsages,
) -> wgpu::Texture {
    context.device.create_texture(&wgpu::TextureDescriptor {
        label: Some("viewport"),
        size: wgpu::Extent3d { width, height, depth_or_array_layers: 1 },
        mip_level_count: 1,
        sample_count,
        dimension: wgpu::TextureDimension::D2,
        format,
        usage,
        view_formats: if format == STORED_FORMAT && context.has_views {
            &[wgpu::TextureFormat::Rgba8UnormSrgb]
        } else {
            &[]
        },
    })
}

/// Returns the bytes of a texture, row by row. Waits until all work on it is done.
pub(super) fn read_texture(
    context: &Context,
    texture: &wgpu::Texture,
    [width, height]: [u32; 2],
    bytes_per_pixel: u32,
) -> Vec<u8> {
    let row = width * bytes_per_pixel;
    let padded = row.next_multiple_of(wgpu::COPY_BYTES_PER_ROW_ALIGNMENT);
    let buffer = context.device.create_buffer(&wgpu::BufferDescriptor {
        label: Some("read back"),
        size: u64::from(padded) * u64::from(height),
        usage: wgpu::BufferUsages::COPY_DST | wgpu::BufferUsages::MAP_READ,
        mapped_at_creation: false,
    });
    let mut encoder = context.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
    let layout = wgpu::TexelCopyBufferLayout { offset: 0, bytes_per_row: Some(padded), rows_per_image: None };
    encoder.copy_texture_to_buffer(
        texture.as_image_copy(),
        wgpu::TexelCopyBufferInfo { buffer: &buffer, layout },
        wgpu::Extent3d { width, height, depth_or_array_layers: 1 },
    );
    context.queue.submit([encoder.finish()]);
    let (sender, receiver) = std::sync::mpsc::channel();
    buffer.map_async(wgpu::MapMode::Read, .., move |result| drop(sender.send(result)));
    let waited = context.device.poll(wgpu::PollType::wait_indefinitely());
    let mapped = waited.is_ok() && matches!(receiver.try_recv(), Ok(Ok(())));
    // A lost device has no picture.
    let Some(view) = mapped.then(|| buffer.get_mapped_range(..).ok()).flatten() else {
        return vec![0; (row * height) as usize];
    };
    view.chunks_exact(padded as usize).flat_map(|r| &r[..row as usize]).copied().collect()
}

fn clamped(context: &Context, size: [u32; 2]) -> [u32; 2] {
    let most = context.device.limits().max_texture_dimension_2d;
    size.map(|x| x.clamp(1, most))
}
