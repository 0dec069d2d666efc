//! Growable GPU storage that vertices pull from, reused while new content fits: buffers, or textures where the
//! vertex stage has no storage buffers, as in WebGL.

use std::sync::Arc;

use egui_wgpu::wgpu;

use super::context::{Context, ROW_ITEMS};

/// Growable storage.
#[derive(Clone)]
pub(super) struct Storage {
    memory: Memory,
    item: Item,
    label: Arc<str>,
}

/// The items that the shader reads at once.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Item {
    /// 32 bits.
    Word,
    /// Four words.
    Quad,
}

impl Item {
    fn bytes(self) -> u64 {
        match self {
            Self::Word => 4,
            Self::Quad => 16,
        }
    }

    fn format(self) -> wgpu::TextureFormat {
        match self {
            Self::Word => wgpu::TextureFormat::R32Uint,
            Self::Quad => wgpu::TextureFormat::Rgba32Uint,
        }
    }
}

#[derive(Clone)]
enum Memory {
    Buffer(wgpu::Buffer),
    Texture(wgpu::Texture, wgpu::TextureView),
}

/// Minimum size: an empty buffer cannot be bound.
const MIN_SIZE: u64 = 256;

impl Storage {
    /// Creates storage for exactly these bytes.
    pub(super) fn new(context: &Context, label: &str, item: Item, bytes: &[u8]) -> Self {
        let memory = Memory::new(context, label, item, bytes.len() as u64);
        memory.write(context, item, 0, bytes);
        Self { memory, item, label: label.into() }
    }

    /// Returns the resource for a bind group.
    pub(super) fn resource(&self) -> wgpu::BindingResource<'_> {
        match &self.memory {
            Memory::Buffer(buffer) => buffer.as_entire_binding(),
            Memory::Texture(_, view) => wgpu::BindingResource::TextureView(view),
        }
    }

    /// Replaces the content. Returns true if the storage was reallocated, with an eighth more space than
    /// needed.
    pub(super) fn replace(&mut self, context: &Context, bytes: &[u8]) -> bool {
        let wanted = bytes.len() as u64;
        // Far too large storage is freed.
        let size = self.memory.size(self.item);
        let fits = wanted <= size && size / 8 <= wanted.max(self.memory.min_size(self.item));
        if !fits {
            self.memory = Memory::new(context, &self.label, self.item, wanted + wanted / 8);
        }
        self.memory.write(context, self.item, 0, bytes);
        !fits
    }

    /// Writes bytes at an offset, keeping the rest. Returns true if the storage was reallocated to a larger
    /// one.
    pub(super) fn write(&mut self, context: &Context, at: u64, bytes: &[u8]) -> bool {
        let wanted = at + bytes.len() as u64;
        let fits = wanted <= self.memory.size(self.item);
        if !fits {
            let larger = Memory::new(context, &self.label, self.item, wanted + wanted / 2);
            let mut encoder =
                context.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
            self.memory.copy(&mut encoder, &larger);
            context.queue.submit([encoder.finish()]);
            self.memory = larger;
        }
        self.memory.write(context, self.item, at, bytes);
        !fits
    }
}

impl Memory {
    fn new(context: &Context, label: &str, item: Item, size: u64) -> Self {
        if !context.pulls_textures {
            return Self::Buffer(context.device.create_buffer(&wgpu::BufferDescriptor {
                label: Some(label),
                size: size.max(MIN_SIZE).next_multiple_of(4),
                usage: wgpu::BufferUsages::STORAGE
                    | wgpu::BufferUsages::COPY_DST
                    | wgpu::BufferUsages::COPY_SRC,
                mapped_at_creation: false,
            }));
        }
        let most = u64::from(context.device.limits().max_texture_dimension_2d);
        let rows = size.div_ceil(item.bytes() * ROW_ITEMS).clamp(1, most);
        let usage = wgpu::TextureUsages::TEXTURE_BINDING
            | wgpu::TextureUsages::COPY_DST
            | wgpu::TextureUsages::COPY_SRC;
        let texture = context.device.create_texture(&wgpu::TextureDescriptor {
            label: Some(label),
            size: extent(ROW_ITEMS, rows),
            mip_level_count: 1,
            sample_count: 1,
            dimension: wgpu::TextureDimension::D2,
            format: item.format(),
            usage,
            view_formats: &[],
        });
        let view = texture.create_view(&wgpu::TextureViewDescriptor::default());
        Self::Texture(texture, view)
    }

    fn size(&self, item: Item) -> u64 {
        match self {
            Self::Buffer(buffer) => buffer.size(),
            Self::Texture(texture, _) => u64::from(texture.height()) * ROW_ITEMS * item.bytes(),
        }
    }

    fn min_size(&self, item: Item) -> u64 {
        match self {
            Self::Buffer(_) => MIN_SIZE,
            Self::Texture(..) => ROW_ITEMS * item.bytes(),
        }
    }

    fn copy(&self, encoder: &mut wgpu::CommandEncoder, to: &Self) {
        match (self, to) {
            (Self::Buffer(from), Self::Buffer(to)) => {
                encoder.copy_buffer_to_buffer(from, 0, to, 0, from.size());
            }
            (Self::Texture(from, _), Self::Texture(to, _)) => {
                encoder.copy_texture_to_texture(from.as_image_copy(), to.as_image_copy(), from.size());
            }
            _ => {}
        }
    }

    fn write(&self, context: &Context, item: Item, at: u64, bytes: &[u8]) {
        match self {
            Self::Buffer(buffer) => context.queue.write_buffer(buffer, at, bytes),
            Self::Texture(texture, _) => {
                let first = at / item.bytes();
                for (items, origin, size) in pieces(first, bytes.len() as u64 / item.bytes()) {
                    let [from, to] = [items.start, items.end].map(|k| (k * item.bytes()) as usize);
                    let target = wgpu::TexelCopyTextureInfo { origin, ..texture.as_image_copy() };
                    let layout = wgpu::TexelCopyBufferLayout {
                        offset: 0,
                        bytes_per_row: Some((ROW_ITEMS * item.bytes()) as u32),
                        rows_per_image: None,
                    };
                    context.queue.write_texture(target, &bytes[from..to], layout, size);
                }
            }
        }
    }
}

fn extent(width: u64, height: u64) -> wgpu::Extent3d {
    wgpu::Extent3d { width: width as u32, height: height as u32, depth_or_array_layers: 1 }
}

/// Returns the rectangles of a texture that hold `count` items from item `first`, each with the range of
/// items, counted from the first: the end of a row, whole rows, the begin of a row.
fn pieces(
    first: u64,
    count: u64,
) -> impl Iterator<Item = (std::ops::Range<u64>, wgpu::Origin3d, wgpu::Extent3d)> {
    let mut done = 0;
    std::iter::from_fn(move || {
        let left = count - done;
        let (x, y) = ((first + done) % ROW_ITEMS, (first + done) / ROW_ITEMS);
        let (width, height) = if x == 0 && left >= ROW_ITEMS {
            (ROW_ITEMS, left / ROW_ITEMS)
        } else {
            (left.min(ROW_ITEMS - x), 1)
        };
        let range = done..done + width * height;
        done = range.end;
        (left > 0).then(|| (range, wgpu::Origin3d { x: x as u32, y: y as u32, z: 0 }, extent(width, height)))
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pieces_cover_each_item_once() {
        for (first, count) in [(0, 0), (0, 5), (0, 2048), (2047, 2), (5, 10_000), (4096, 4096), (100, 1948)] {
            let mut next = 0;
            let mut number = 0;
            for (items, origin, size) in pieces(first, count) {
                assert_eq!(items.start, next);
                assert_eq!(u64::from(origin.y) * ROW_ITEMS + u64::from(origin.x), first + next);
                assert_eq!(u64::from(size.width) * u64::from(size.height), items.end - items.start);
                assert!(u64::from(origin.x + size.width) <= ROW_ITEMS);
                (next, number) = (items.end, number + 1);
            }
            assert!(next == count && number <= 3, "{first} {count}");
        }
    }
}
