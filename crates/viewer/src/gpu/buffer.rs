//! Growable GPU buffers, reused while new content fits.

use std::sync::Arc;

use egui_wgpu::wgpu;

use super::context::Context;

/// A growable storage buffer.
#[derive(Clone)]
pub(super) struct Storage {
    buffer: wgpu::Buffer,
    label: Arc<str>,
}

/// Minimum size: an empty buffer cannot be bound.
const MIN_SIZE: u64 = 256;

impl Storage {
    /// Creates a buffer for exactly these bytes.
    pub(super) fn new(context: &Context, label: &str, bytes: &[u8]) -> Self {
        let buffer = make(context, label, bytes.len() as u64);
        context.queue.write_buffer(&buffer, 0, bytes);
        Self { buffer, label: label.into() }
    }

    pub(super) fn buffer(&self) -> &wgpu::Buffer {
        &self.buffer
    }

    /// Replaces the content. Returns true if the buffer was reallocated, with an eighth more space than
    /// needed.
    pub(super) fn replace(&mut self, context: &Context, bytes: &[u8]) -> bool {
        let wanted = bytes.len() as u64;
        // A far too large buffer is freed.
        let fits = wanted <= self.buffer.size() && self.buffer.size() / 8 <= wanted.max(MIN_SIZE);
        if !fits {
            self.buffer = make(context, &self.label, wanted + wanted / 8);
        }
        context.queue.write_buffer(&self.buffer, 0, bytes);
        !fits
    }

    /// Writes bytes at an offset, keeping the rest. Returns true if the buffer was reallocated to a larger
    /// one.
    pub(super) fn write(&mut self, context: &Context, at: u64, bytes: &[u8]) -> bool {
        let wanted = at + bytes.len() as u64;
        let fits = wanted <= self.buffer.size();
        if !fits {
            let larger = make(context, &self.label, wanted + wanted / 2);
            let mut encoder =
                context.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
            encoder.copy_buffer_to_buffer(&self.buffer, 0, &larger, 0, self.buffer.size());
            context.queue.submit([encoder.finish()]);
            self.buffer = larger;
        }
        context.queue.write_buffer(&self.buffer, at, bytes);
        !fits
    }
}

fn make(context: &Context, label: &str, size: u64) -> wgpu::Buffer {
    context.device.create_buffer(&wgpu::BufferDescriptor {
        label: Some(label),
        size: size.max(MIN_SIZE).next_multiple_of(4),
        usage: wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_DST | wgpu::BufferUsages::COPY_SRC,
        mapped_at_creation: false,
    })
}
