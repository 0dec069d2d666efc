//! Error panel: distances between result and original, histogram, legend.

use eframe::egui::{self, Color32, Rect, Sense, Ui, Vec2, pos2};
use lodsmith_render::{ColorMap, Look, Shading};

use super::{PanelContext, widgets};
use crate::command::Command;
use crate::content::Distances;
use crate::document::Document;
use crate::numbers::{grouped, percent, seconds, significant};
use crate::panel::keys::Action;
use crate::settings::HeatOf;
use crate::theme::{palette, weak};

/// Draws the panel.
pub fn show(ui: &mut Ui, scope: &mut PanelContext<'_>) {
    let document = scope.document;
    let settings = document.settings();
    let mut is_heat = settings.look.look.shading == Shading::Heat;
    if widgets::switch(
        ui,
        "Heat map",
        Some(Action::Shade(6)),
        "Colour both sides by their distance",
        &mut is_heat,
    ) {
        let mut look = settings.look.clone();
        look.look.shading = if is_heat { Shading::Heat } else { Shading::Smooth };
        scope.command(Command::Look(look));
    }
    let mut quantity = settings.look.heat_of;
    widgets::choose(ui, "Quantity", "What the heat map compares", &HeatOf::ALL, &mut quantity);
    if quantity != settings.look.heat_of {
        let mut look = settings.look.clone();
        look.heat_of = quantity;
        // Ranges are in the units of the quantity.
        (look.look.heat_range, look.look.heat_brush) = (None, None);
        scope.command(Command::Look(look));
    }
    let Some(original) = document.original() else {
        widgets::empty_note(ui, "Open a file first");
        return;
    };
    if document.lighter().is_none() {
        widgets::empty_note(ui, "No result yet; drag the slider below");
        return;
    }
    let now = document.distances();
    let latest = now.or_else(|| document.latest_distances());
    if now.is_none() {
        let text = match (document.shows_preview(), latest) {
            (false, _) => "Measuring…",
            (true, Some(_)) => "Of the last exact result",
            (true, None) => "Measured when the exact result is there",
        };
        ui.label(weak(ui, text));
    }
    let Some(distances) = latest else { return };
    if distances.histogram.iter().all(|n| *n == 0) && quantity != HeatOf::Distance {
        let text = match quantity {
            HeatOf::Uvs => "Both sides need UVs",
            HeatOf::Colors => "Both sides need vertex colours",
            _ => "Both sides are equal",
        };
        widgets::empty_note(ui, text);
        return;
    }
    figures(ui, distances, original.content.bounds.diagonal());
    widgets::heading(ui, "Histogram");
    histogram(ui, scope, distances);
    range(ui, scope, distances);
    let places = if quantity == HeatOf::Distance { "" } else { ", on each side of seams," };
    let text =
        format!("Measured in both directions at all vertices{places} in {}", seconds(distances.seconds));
    ui.label(weak(ui, text).small());
    ui.label(weak(ui, "Click the surface to read the value there").small());
}

/// Draws the maximum, the RMS and the mean.
fn figures(ui: &mut Ui, distances: &Distances, diagonal: f64) {
    let quantity = distances.quantity;
    let (title, heads) = match quantity {
        HeatOf::Distance => ("Vertex distance", vec!["units".into(), "diagonal".into()]),
        HeatOf::Normals => ("Normals", vec!["angle".into()]),
        HeatOf::Uvs => ("UVs", vec!["texture widths".into()]),
        HeatOf::Colors => ("Vertex colours", vec!["0 to 1".into()]),
    };
    widgets::table_row(ui, title, &heads, true);
    for (name, d) in [("Maximum", distances.largest), ("RMS", distances.rms), ("Mean", distances.mean)] {
        let values = match quantity {
            HeatOf::Distance => vec![significant(d, 3), format!("{} %", significant(share(d, diagonal), 3))],
            HeatOf::Normals => vec![format!("{}°", significant(d, 3))],
            HeatOf::Uvs | HeatOf::Colors => vec![significant(d, 3)],
        };
        widgets::table_row(ui, name, &values, false);
    }
}

fn share(d: f64, diagonal: f64) -> f64 {
    if diagonal > 0.0 { 100.0 * d / diagonal } else { 0.0 }
}

/// Returns a value with its unit.
pub fn value_text(quantity: HeatOf, value: f64, diagonal: f64) -> String {
    match quantity {
        HeatOf::Distance => {
            format!("{}  ·  {} %", significant(value, 3), significant(share(value, diagonal), 3))
        }
        HeatOf::Normals => format!("{}°", significant(value, 3)),
        HeatOf::Uvs => format!("UV {}", significant(value, 3)),
        HeatOf::Colors => format!("colour {}", significant(value, 3)),
    }
}

/// Draws a histogram in the colours of the map, and a line at the error that the target allows. Heights are logarithmic.
/// A drag selects the values that keep
/// their colour on the surface; a click selects all again.
fn histogram(ui: &mut Ui, scope: &mut PanelContext<'_>, distances: &Distances) {
    let all = scope.document.settings().look.clone();
    let look = &all.look;
    let size = Vec2::new(ui.available_width(), 88.0);
    let (rect, response) = ui.allocate_exact_size(size, Sense::click_and_drag());
    response.widget_info(|| egui::WidgetInfo::labeled(egui::Role::Image, true, "Histogram of distances"));
    let p = palette(ui);
    let painter = ui.painter();
    painter.rect_filled(rect, 3.0, p.sunken);
    let bars = rect.shrink2(Vec2::new(6.0, 6.0));
    let count = distances.histogram.len().max(1);
    let limit = scope.document.error_limit();
    let most = axis_end(distances.largest, limit);
    let x_of = |value: f64| bars.left() + bars.width() * (value / most.max(1e-300)) as f32;
    let width = (x_of(distances.largest) - bars.left()).max(1.0) / count as f32;
    // Bars are narrow where the limit is much larger than all values.
    let gap = 1f32.min(0.5 * width);
    let height = |n: u32| (f64::from(n) + 1.0).ln() as f32;
    let highest = distances.histogram.iter().copied().map(height).fold(1e-6, f32::max);
    let [low, high] = color_range(look, scope.document.heat_end(distances));
    let step = distances.largest / count as f64;
    let brushed = look.heat_brush.map(|brush| brushed_bars(brush, step, count));
    for (i, &n) in distances.histogram.iter().enumerate() {
        let at = ((i as f64 + 0.5) * step) as f32;
        let color = of_map(look.color_map, (at - low) / (high - low).max(1e-30));
        let is_in = brushed.as_ref().is_none_or(|bars| bars.contains(&i));
        let x = bars.left() + width * i as f32;
        let top = bars.bottom() - bars.height() * height(n) / highest;
        let bar = Rect::from_min_max(pos2(x, top), pos2(x + width - gap, bars.bottom()));
        painter.rect_filled(bar, 0.0, if is_in { color } else { p.weak.gamma_multiply(0.4) });
    }
    if let Some(limit) = limit {
        let x = x_of(limit);
        painter.line_segment([pos2(x, rect.top() + 2.0), pos2(x, rect.bottom() - 2.0)], (1.0, p.text));
    }
    let bar_at = |x: f32| ((x - bars.left()) / width).clamp(0.0, count as f32 - 1.0) as usize;
    let interval = |from: usize, to: usize| {
        let [a, b] = [from as f64, to as f64 + 1.0].map(|k| significant(k * step, 3));
        let n: u64 = distances.histogram[from..=to].iter().copied().map(u64::from).sum();
        let whole: u64 = distances.histogram.iter().copied().map(u64::from).sum();
        let part = percent(n as f64 / whole.max(1) as f64);
        let places = if distances.quantity == HeatOf::Distance { "vertices" } else { "values" };
        format!("{a} to {b}: {} {places} ({part})", grouped(n as usize))
    };
    brush(scope, &response, distances, &bar_at);
    match brushed {
        Some(bars) => ui.label(weak(ui, interval(bars.start, bars.end - 1)).small()),
        None => ui.label(weak(ui, "Drag to highlight a range on the model").small()),
    };
    if let Some(pointer) = response.hover_pos().filter(|_| !response.dragged()) {
        let i = bar_at(pointer.x);
        response.on_hover_text(interval(i, i));
    }
    let [zero, most] = ["0".to_owned(), significant(most, 3)];
    ui.horizontal(|ui| {
        ui.label(weak(ui, zero).small());
        ui.with_layout(egui::Layout::right_to_left(egui::Align::Center), |ui| {
            ui.label(weak(ui, most).small())
        });
    });
    if let Some(limit) = limit {
        ui.label(weak(ui, format!("The line is the error limit, {}", significant(limit, 3))).small());
    }
}

/// Returns the value at the right end of the histogram: the largest, or the error limit if that is larger.
fn axis_end(largest: f64, limit: Option<f64>) -> f64 {
    limit.map_or(largest, |limit| limit.max(largest))
}

/// Returns the bars within a brush.
fn brushed_bars([from, to]: [f32; 2], step: f64, count: usize) -> std::ops::Range<usize> {
    let bar = |value: f32| if step > 0.0 { (f64::from(value) / step).round().max(0.0) as usize } else { 0 };
    let first = bar(from).min(count - 1);
    first..bar(to).clamp(first + 1, count)
}

/// Selects the dragged bars, and shows the heat map; a click selects everything.
fn brush(
    scope: &mut PanelContext<'_>,
    response: &egui::Response,
    distances: &Distances,
    bar_at: &dyn Fn(f32) -> usize,
) {
    let mut look = scope.document.settings().look.clone();
    let anchor = response.id.with("anchor");
    let pointer = response.interact_pointer_pos();
    if let Some(pointer) = pointer.filter(|_| response.dragged()) {
        let origin = response.ctx.input(|i| i.pointer.press_origin()).unwrap_or(pointer);
        let start = response.ctx.data_mut(|d| *d.get_temp_mut_or(anchor, origin.x));
        let (a, b) = (bar_at(start), bar_at(pointer.x));
        let step = distances.largest / distances.histogram.len().max(1) as f64;
        let to = if a.max(b) + 1 == distances.histogram.len() {
            // The largest value is within, whatever its rounding.
            f64::from(f32::MAX)
        } else {
            (a.max(b) + 1) as f64 * step
        };
        look.look.heat_brush = Some([(a.min(b) as f64 * step) as f32, to as f32]);
        look.look.shading = Shading::Heat;
    } else {
        response.ctx.data_mut(|d| d.remove::<f32>(anchor));
    }
    if response.clicked() {
        look.look.heat_brush = None;
    }
    if look != scope.document.settings().look {
        scope.command(Command::Look(look));
    }
}

/// Draws the field for the upper end of the colour range.
fn range(ui: &mut Ui, scope: &mut PanelContext<'_>, distances: &Distances) {
    let mut look = scope.document.settings().look.clone();
    let end = scope.document.heat_end(distances);
    let largest = end as f32;
    widgets::field(
        ui,
        "Range maximum",
        "Value shown in the last colour; Auto uses the error limit of the target, else the largest value",
        |ui| {
            let mut high = color_range(&look.look, end)[1];
            let drag = egui::DragValue::new(&mut high).range(largest * 1e-4..=largest * 10.0);
            if ui.add(drag.speed(largest * 0.005).custom_formatter(|x, _| significant(x, 3))).changed() {
                look.look.heat_range = Some([0.0, high]);
            }
            let is_set = look.look.heat_range.is_some();
            if ui.add_enabled(is_set, egui::Button::new("Auto")).clicked() {
                look.look.heat_range = None;
            }
        },
    );
    if look != scope.document.settings().look {
        scope.command(Command::Look(look));
    }
}

/// Returns the range of the colour map, which ends at `end` unless the user chose it.
pub fn color_range(look: &Look, end: f64) -> [f32; 2] {
    look.heat_range.unwrap_or([0.0, end as f32])
}

fn of_map(map: ColorMap, t: f32) -> Color32 {
    let [r, g, b] = map.color(t).map(|c| (c * 255.0).round() as u8);
    Color32::from_rgb(r, g, b)
}

/// Draws the legend of the heat map over a picture, whose colours end at a value unless the user chose it. The end is
/// known before anything is measured if it is the limit of the target.
pub fn legend(ui: &Ui, picture: Rect, document: &Document) {
    let Some(original) = document.original() else { return };
    let (look, diagonal) = (&document.settings().look.look, original.content.bounds.diagonal());
    let quantity = document.settings().look.heat_of;
    let distances = document.distances();
    let end = distances.map(|distances| document.heat_end(distances)).or_else(|| document.error_limit());
    let Some([low, high]) = end.map(|end| color_range(look, end)) else {
        return scale(ui, picture, look.color_map, ["Measuring…".into(), String::new()]);
    };
    let figure = |x: f32| significant(f64::from(x), 2);
    let most = match quantity {
        HeatOf::Distance => {
            format!("{} ({} %)", figure(high), significant(share(f64::from(high), diagonal), 2))
        }
        HeatOf::Normals => format!("{}°", figure(high)),
        HeatOf::Uvs | HeatOf::Colors => format!("{} {}", quantity.name(), figure(high)),
    };
    let low = if distances.is_some() { figure(low) } else { "Measuring…".to_owned() };
    scale(ui, picture, look.color_map, [low, most]);
}

/// Draws a colour map over a picture, with texts at its ends.
pub fn scale(ui: &Ui, picture: Rect, map: ColorMap, [low, high]: [String; 2]) {
    let p = palette(ui);
    let size = Vec2::new(192.0, 46.0);
    let rect = Rect::from_min_size(picture.right_bottom() - size - Vec2::splat(12.0), size);
    if picture.width() < size.x + 24.0 || picture.height() < 120.0 {
        return;
    }
    let painter = ui.painter_at(picture);
    painter.rect_filled(rect, 5.0, p.panel.gamma_multiply(0.92));
    let font = egui::TextStyle::Small.resolve(ui.style());
    let bar = Rect::from_min_size(rect.min + Vec2::new(10.0, 10.0), Vec2::new(size.x - 20.0, 10.0));
    let steps = 64;
    for i in 0..steps {
        let x = bar.left() + bar.width() * i as f32 / steps as f32;
        let part =
            Rect::from_min_max(pos2(x, bar.top()), pos2(x + bar.width() / steps as f32 + 0.5, bar.bottom()));
        painter.rect_filled(part, 0.0, of_map(map, (i as f32 + 0.5) / steps as f32));
    }
    let below = bar.bottom() + 4.0;
    let text = |at, align, text: String| painter.text(at, align, text, font.clone(), p.text);
    text(pos2(bar.left(), below), egui::Align2::LEFT_TOP, low);
    text(pos2(bar.right(), below), egui::Align2::RIGHT_TOP, high);
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_brush_is_made_of_whole_bars() {
        assert_eq!(brushed_bars([0.0, 0.5], 0.25, 8), 0..2);
        assert_eq!(brushed_bars([0.5, f32::MAX], 0.25, 8), 2..8);
        assert_eq!(brushed_bars([9.0, 12.0], 0.25, 8), 7..8, "beyond the largest value of a closer result");
        assert_eq!(brushed_bars([0.0, 1.0], 0.0, 8), 0..1);
    }

    #[test]
    fn the_histogram_reaches_to_the_error_limit() {
        assert_eq!([None, Some(0.5), Some(3.0)].map(|limit| axis_end(2.0, limit)), [2.0, 2.0, 3.0]);
    }

    #[test]
    fn values_have_the_unit_of_their_quantity() {
        assert_eq!(value_text(HeatOf::Distance, 0.01, 2.0), "0.0100  ·  0.500 %");
        assert_eq!(value_text(HeatOf::Normals, 12.34, 2.0), "12.3°");
    }
}
