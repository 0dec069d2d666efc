//! Draw calls of a frame, and their division into parts: a software adapter draws a large frame in several
//! steps so that the window stays responsive.

use std::ops::Range;
use std::sync::{Arc, Mutex, PoisonError};

use egui_wgpu::wgpu;
use web_time::{Duration, Instant};

use super::context::Context;
use super::frame::DrawList;

/// One draw call.
pub(super) struct Call<'a> {
    pub(super) kind: DrawKind,
    pub(super) mesh: &'a wgpu::BindGroup,
    pub(super) material: &'a wgpu::BindGroup,
    pub(super) corners: Range<u32>,
    pub(super) instances: Range<u32>,
}

/// Pipeline of a draw call; kinds are drawn in this order.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum DrawKind {
    /// Opaque triangles.
    Solid,
    /// Transparent triangles.
    Blended,
    /// Lines along marked edges.
    Marks,
}

impl Call<'_> {
    fn triangles_each(&self) -> u64 {
        u64::from(self.corners.end - self.corners.start) / 3
    }
    /// Number of triangles, counting every instance.
    pub(super) fn triangles(&self) -> u64 {
        self.triangles_each() * u64::from(self.instances.end - self.instances.start)
    }

    /// Returns the calls that draw a range of its triangles, in order: one instance after the other.
    fn in_range(&self, range: Range<u64>) -> Vec<Self> {
        let each = self.triangles_each().max(1);
        let part = |triangles: Range<u64>, copies: Range<u64>| {
            let corner = |t: u64| self.corners.start + 3 * t as u32;
            let copy = |c: u64| self.instances.start + c as u32;
            Self {
                kind: self.kind,
                mesh: self.mesh,
                material: self.material,
                corners: corner(triangles.start)..corner(triangles.end),
                instances: copy(copies.start)..copy(copies.end),
            }
        };
        let ((first, from), (last, to)) =
            ((range.start / each, range.start % each), (range.end / each, range.end % each));
        if first == last {
            return vec![part(from..to, first..first + 1)];
        }
        let whole = first + u64::from(from > 0);
        let all = [
            part(from..each, first..whole),
            part(0..each, whole..last),
            part(0..to, last..last + u64::from(to > 0)),
        ];
        all.into_iter().filter(|c| c.triangles() > 0).collect()
    }
}

/// Returns all draw calls of a frame.
pub(super) fn calls<'a>(
    gathered: &DrawList<'a>,
    is_textured: bool,
    has_marks: bool,
    plain: &'a wgpu::BindGroup,
) -> Vec<Call<'a>> {
    let mut calls = Vec::new();
    for kind in [DrawKind::Solid, DrawKind::Blended] {
        for batch in &gathered.batches {
            let surfaces = &batch.model.surfaces;
            for chunk in &batch.model.meshes[batch.mesh].chunks {
                for part in &chunk.parts {
                    let surface = part.material.filter(|_| is_textured).and_then(|m| surfaces.get(m));
                    if surface.is_some_and(|s| s.is_blended) == (kind == DrawKind::Blended) {
                        calls.push(Call {
                            kind,
                            mesh: &chunk.bind,
                            material: surface.map_or(surfaces.plain(), |s| &s.bind),
                            corners: part.corners.clone(),
                            instances: batch.instances.clone(),
                        });
                    }
                }
            }
        }
    }
    for batch in gathered.batches.iter().filter(|_| has_marks) {
        for (mesh, corners) in batch.model.meshes[batch.mesh].marks() {
            let (material, instances) = (plain, batch.instances.clone());
            calls.push(Call { kind: DrawKind::Marks, mesh, material, corners: 0..corners, instances });
        }
    }
    calls
}

/// Returns the calls that draw a range of the triangles of these calls.
pub(super) fn calls_in_range<'a>(calls: Vec<Call<'a>>, range: Range<u64>) -> Vec<Call<'a>> {
    let mut begin = 0;
    let mut taken = Vec::new();
    for call in calls {
        let end = begin + call.triangles();
        let within = range.start.max(begin)..range.end.min(end);
        if within.start < within.end {
            taken.extend(call.in_range(within.start - begin..within.end - begin));
        }
        begin = end;
    }
    taken
}

/// Size of the next part, adapted to the time that earlier parts took.
pub(super) struct PartPacer {
    /// Triangles in a part.
    pub(super) part_triangles: u64,
    sent: Option<(Instant, u64)>,
    done: Arc<Mutex<Option<Instant>>>,
}

/// Frames with at most this many triangles are drawn in one piece.
pub(super) const MAX_TRIANGLES_AT_ONCE: u64 = 100_000;
/// Triangles in the first part, and the limits for all others.
const FIRST_PART_TRIANGLES: u64 = 40_000;
const PART_TRIANGLE_LIMITS: [u64; 2] = [5_000, 4_000_000];
/// Target time of a part. A window that is drawn by the same CPU then responds ten times a second. (Guessed.)
const TARGET_PART_TIME: Duration = Duration::from_millis(60);
/// Polling interval for the end of a part, and the maximum number of polls.
const POLL_INTERVAL: Duration = Duration::from_millis(4);
const MAX_POLLS: usize = 5_000;

impl Default for PartPacer {
    fn default() -> Self {
        Self { part_triangles: FIRST_PART_TRIANGLES, sent: None, done: Arc::default() }
    }
}

impl PartPacer {
    /// Returns true if the previous part is done, without waiting. Adapts the part size to the time it took.
    pub(super) fn is_ready(&mut self, context: &Context) -> bool {
        let Some((begin, triangles)) = self.sent else { return true };
        if cfg!(target_arch = "wasm32") {
            let _ = context.device.poll(wgpu::PollType::Poll);
        }
        let done = self.done.lock().unwrap_or_else(PoisonError::into_inner).take();
        let Some(end) = done else { return false };
        self.sent = None;
        let took = end.saturating_duration_since(begin).as_secs_f64().max(1e-4);
        let factor = (TARGET_PART_TIME.as_secs_f64() / took).clamp(0.25, 2.0);
        self.part_triangles =
            ((triangles as f64 * factor) as u64).clamp(PART_TRIANGLE_LIMITS[0], PART_TRIANGLE_LIMITS[1]);
        true
    }

    /// Records that this many triangles were submitted to the adapter.
    pub(super) fn record_submission(&mut self, context: &Context, triangles: u64) {
        // Each part has its own completion slot, so that a late completion is not attributed to another part.
        self.done = Arc::default();
        let done = Arc::clone(&self.done);
        self.sent = Some((Instant::now(), triangles));
        let is_done = Arc::clone(&self.done);
        context.queue.on_submitted_work_done(move || {
            *done.lock().unwrap_or_else(PoisonError::into_inner) = Some(Instant::now());
        });
        if cfg!(target_arch = "wasm32") {
            return;
        }
        // The window polls once per frame, too rarely to measure the duration.
        let context = context.clone();
        std::thread::spawn(move || {
            for _ in 0..MAX_POLLS {
                std::thread::sleep(POLL_INTERVAL);
                // A lost device runs the callback as well.
                let _ = context.device.poll(wgpu::PollType::Poll);
                if Arc::strong_count(&is_done) == 1 || is_done.lock().is_ok_and(|done| done.is_some()) {
                    break;
                }
            }
        });
    }
}
