//! Antialiasing on software adapters: pictures at rest are drawn again with four samples for each pixel.

use eframe::egui;
use web_time::{Duration, Instant};

use crate::gpu::{Frame, RenderTarget};

/// Picture pixels per screen pixel along each axis, at rest: the window averages the four of them.
const SMOOTH_SCALE: f32 = 2.0;
/// Time for which a picture stays unchanged before it is drawn again with more samples.
const REST: Duration = Duration::from_millis(250);

/// Time since which a target shows the same picture.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Smoothing {
    since: Option<Instant>,
}

impl Smoothing {
    /// Sets the size of a target for this frame: one sample for each pixel while pictures change, four at rest.
    /// Returns true until the antialiased picture is complete.
    pub(crate) fn resize(
        &mut self,
        ctx: &egui::Context,
        target: &mut RenderTarget,
        frame: &Frame<'_>,
        screen_px: [u32; 2],
    ) -> bool {
        target.resize(screen_px, SMOOTH_SCALE);
        if target.shows(frame) {
            return false;
        }
        if target.draws(frame) {
            return true;
        }
        target.resize(screen_px, 1.0);
        if !target.shows(frame) {
            self.since = None;
            return true;
        }
        let since = *self.since.get_or_insert_with(Instant::now);
        if ctx.input(|i| i.pointer.any_down()) {
            // The end of the movement draws another frame.
            self.since = Some(Instant::now());
            return true;
        }
        match REST.checked_sub(since.elapsed()) {
            Some(rest) if !rest.is_zero() => ctx.request_repaint_after(rest + Duration::from_millis(5)),
            _ => target.resize(screen_px, SMOOTH_SCALE),
        }
        true
    }
}
