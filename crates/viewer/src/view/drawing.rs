//! Drawn pictures on the screen. On software adapters they are coarse while the camera moves, and antialiased at rest:
//! drawn again with four samples for each pixel.

use eframe::egui::{self, Color32, Rect, Ui, pos2};
use web_time::{Duration, Instant};

use crate::gpu::{Frame, RenderTarget};

/// Picture pixels per screen pixel along each axis while the camera moves. Measured: a quarter of the pixels take a
/// third of the time.
pub(crate) const COARSE_SCALE: f32 = 0.5;
/// Number of triangles up to which software adapters draw at full size.
pub(crate) const MAX_FULL_SIZE_TRIANGLES: u64 = 50_000;
/// Time after the last movement until the picture is drawn at full size.
pub(crate) const CAMERA_REST: Duration = Duration::from_millis(160);
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

/// Returns how long a camera that moved at this time still counts as moving, and requests the frame that follows.
pub(crate) fn rests_in(ctx: &egui::Context, moved: Option<Instant>) -> Option<Duration> {
    let rest = CAMERA_REST.checked_sub(moved?.elapsed())?;
    ctx.request_repaint_after(rest + Duration::from_millis(5));
    Some(rest)
}

/// Returns the size of an area in pixels of the screen.
pub(crate) fn pixels_of(ui: &Ui, area: Rect) -> [u32; 2] {
    let scale = ui.pixels_per_point();
    [area.width(), area.height()].map(|x| (x * scale).round().max(1.0) as u32)
}

/// Paints a texture over an area.
pub(crate) fn paint(painter: &egui::Painter, area: Rect, texture: egui::TextureId) {
    let whole = Rect::from_min_max(pos2(0.0, 0.0), pos2(1.0, 1.0));
    painter.image(texture, area, whole, Color32::WHITE);
}
