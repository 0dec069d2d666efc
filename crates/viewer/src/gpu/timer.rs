//! GPU timestamps of a render pass.

use std::sync::mpsc::{TryRecvError, channel};

use egui_wgpu::wgpu;
use web_time::{Duration, Instant};

use super::context::Context;

/// Timestamps at the start and end of a render pass.
pub(super) struct Timer {
    timestamps: wgpu::QuerySet,
    resolved: wgpu::Buffer,
    read: wgpu::Buffer,
}

/// Bytes of two timestamps.
const BYTES: u64 = 16;
/// Maximum wait for a device that may be lost.
const MAP_TIMEOUT: Duration = Duration::from_secs(60);

impl Timer {
    /// Creates a timer; `None` if the adapter has no timestamps.
    pub(super) fn new(context: &Context) -> Option<Self> {
        if !context.device.features().contains(wgpu::Features::TIMESTAMP_QUERY) {
            return None;
        }
        let buffer = |usage| {
            let label = Some("moments");
            let descriptor = wgpu::BufferDescriptor { label, size: BYTES, usage, mapped_at_creation: false };
            context.device.create_buffer(&descriptor)
        };
        Some(Self {
            timestamps: context.device.create_query_set(&wgpu::QuerySetDescriptor {
                label: Some("moments"),
                ty: wgpu::QueryType::Timestamp,
                count: 2,
            }),
            resolved: buffer(wgpu::BufferUsages::QUERY_RESOLVE | wgpu::BufferUsages::COPY_SRC),
            read: buffer(wgpu::BufferUsages::COPY_DST | wgpu::BufferUsages::MAP_READ),
        })
    }

    /// Returns the timestamp writes for a pass.
    pub(super) fn writes(&self) -> wgpu::RenderPassTimestampWrites<'_> {
        wgpu::RenderPassTimestampWrites {
            query_set: &self.timestamps,
            beginning_of_pass_write_index: Some(0),
            end_of_pass_write_index: Some(1),
        }
    }

    /// Copies the timestamps into a mappable buffer; call after the pass.
    pub(super) fn resolve(&self, encoder: &mut wgpu::CommandEncoder) {
        encoder.resolve_query_set(&self.timestamps, 0..2, &self.resolved, 0);
        encoder.copy_buffer_to_buffer(&self.resolved, 0, &self.read, 0, BYTES);
    }

    /// Returns the seconds between both timestamps; call after submitting. Waits, but other threads can use
    /// the device meanwhile.
    pub(super) fn seconds(&self, context: &Context) -> Option<f64> {
        let (sender, receiver) = channel();
        self.read.map_async(wgpu::MapMode::Read, .., move |result| drop(sender.send(result)));
        let begin = Instant::now();
        loop {
            context.device.poll(wgpu::PollType::Poll).ok()?;
            match receiver.try_recv() {
                Ok(Ok(())) => break,
                Err(TryRecvError::Empty) if begin.elapsed() < MAP_TIMEOUT => {
                    std::thread::sleep(Duration::from_millis(1));
                }
                _ => return None,
            }
        }
        let view = self.read.get_mapped_range(..).ok()?;
        let [from, to] = [0, 8].map(|at| u64::from_le_bytes(view[at..at + 8].try_into().unwrap_or_default()));
        drop(view);
        self.read.unmap();
        let ticks = to.checked_sub(from)?;
        Some(ticks as f64 * f64::from(context.queue.get_timestamp_period()) * 1e-9)
    }
}
