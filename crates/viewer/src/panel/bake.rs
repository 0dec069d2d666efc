//! Bake panel: maps of the result, made of the detail of the original.

use std::sync::Arc;

use eframe::egui::{self, Color32, ColorImage, TextureHandle, TextureOptions, Ui, Vec2};
use lodsmith_bake::{AtlasMode, MapKind};
use lodsmith_core::Image;

use super::{PanelContext, UiRequest, widgets};
use crate::command::Command;
use crate::content::baked::{BakedMaps, NamedMap};
use crate::document::log::Severity;
use crate::job::JobKind;
use crate::numbers::seconds;

/// The maps of a material with their names and descriptions.
const MAPS: [(MapKind, &str, &str); 5] = [
    (MapKind::Normal, "Normals", "Normals of the original, in the tangent frame of the result"),
    (MapKind::Color, "Colour", "Textures, factors and vertex colours of the original together"),
    (MapKind::MetallicRoughness, "Metal and roughness", "Metallic and roughness of the original"),
    (MapKind::Emissive, "Emission", "Light that the original emits"),
    (MapKind::Occlusion, "Occlusion", "Ambient light that reaches the original's grooves"),
];

const SIZES: [(Option<usize>, &str); 6] = [
    (None, "Automatic"),
    (Some(256), "256"),
    (Some(512), "512"),
    (Some(1024), "1024"),
    (Some(2048), "2048"),
    (Some(4096), "4096"),
];

/// Width of a map in the panel, and largest side of one in its dialog, in points.
const THUMBNAIL: f32 = 104.0;
const LARGE: f32 = 720.0;

/// Draws the panel.
pub fn show(ui: &mut Ui, scope: &mut PanelContext<'_>) {
    let before = &scope.document.settings().bake;
    let mut bake = before.clone();
    for (kind, name, tip) in MAPS {
        let mut is_on = bake.maps.contains(&kind);
        if widgets::switch(ui, name, None, tip, &mut is_on) {
            bake.maps.retain(|other| *other != kind);
            bake.maps.extend(is_on.then_some(kind));
            bake.maps.sort_unstable();
        }
    }
    widgets::choose(ui, "Size", "Width and height of the maps in texels", &SIZES, &mut bake.size);
    let tip = "Keep: the texture coordinates of the result, where they do not overlap; New: a new atlas";
    widgets::choose(ui, "UVs", tip, &[(AtlasMode::Keep, "Keep"), (AtlasMode::New, "New")], &mut bake.atlas);
    if bake != *before {
        scope.command(Command::Bake(bake));
    }
    let document = scope.document;
    let exact = document.lighter().filter(|l| l.content.report.is_some() && !document.is_outdated());
    let is_busy = document.is_busy(JobKind::Bake);
    let can_bake = exact.is_some() && !is_busy && !before.maps.is_empty();
    let tip = "Bake the detail of the original into textures of the result";
    ui.horizontal(|ui| {
        if ui.add_enabled(can_bake, egui::Button::new("Bake")).on_hover_text(tip).clicked() {
            scope.requests.push(UiRequest::Bake(true));
        }
        let has_maps = document.baked().is_some() && !is_busy;
        let tip = "Show the result without maps";
        if ui.add_enabled(has_maps, egui::Button::new("Remove maps")).on_hover_text(tip).clicked() {
            scope.requests.push(UiRequest::Bake(false));
        }
    });
    match document.baked() {
        Some(baked) => maps(ui, baked),
        None if document.lighter().is_none() => {
            widgets::empty_note(ui, "Nothing simplified yet; drag the slider below");
        }
        None => {}
    }
}

/// Draws all maps; a click shows one large.
fn maps(ui: &mut Ui, baked: &Arc<BakedMaps>) {
    widgets::log_line(ui, Severity::Good, &format!("Baked in {}", seconds(baked.seconds)));
    let opened = ui.scope_id().with("opened");
    ui.horizontal_wrapped(|ui| {
        for (number, map) in baked.maps.iter().enumerate() {
            ui.vertical(|ui| {
                let texture = texture(ui, baked, number);
                let size = Vec2::splat(THUMBNAIL);
                let image = egui::Image::new((texture.id(), size));
                let response = ui.add(egui::Button::image(image).frame(false));
                let name = format!("Map {}", map.name);
                response.widget_info(|| egui::WidgetInfo::labeled(egui::Role::Button, true, &name));
                if response.on_hover_text("Show large").clicked() {
                    ui.data_mut(|data| data.insert_temp(opened, number));
                }
                ui.set_max_width(THUMBNAIL);
                ui.add(egui::Label::new(egui::RichText::new(&map.name).small()).truncate());
            });
        }
    });
    let Some(number) = ui.data(|data| data.get_temp::<usize>(opened)) else { return };
    let is_closed = match baked.maps.get(number) {
        Some(map) => large(ui, map, &texture(ui, baked, number)),
        None => true,
    };
    if is_closed {
        ui.data_mut(|data| data.remove::<usize>(opened));
    }
}

/// Draws one map in a dialog; returns true once it is closed.
fn large(ui: &Ui, map: &NamedMap, texture: &TextureHandle) -> bool {
    let screen = ui.ctx().content_rect().size();
    let side = LARGE.min(screen.min_elem() - 140.0).max(64.0);
    let modal = widgets::modal(ui.ctx(), "map").show(ui.ctx(), |ui| {
        ui.label(format!("{}, {} × {} texels", map.name, map.image.width(), map.image.height()));
        ui.add(egui::Image::new((texture.id(), Vec2::splat(side))));
        ui.button("Close").clicked()
    });
    modal.inner || modal.should_close()
}

/// Textures of the maps in the window, and the maps that they are of.
#[derive(Clone, Default)]
struct MapTextures {
    of: Option<Arc<BakedMaps>>,
    all: Vec<Option<TextureHandle>>,
}

/// Returns the texture of a map. It is made on the first call, without opacity, which hides colours.
fn texture(ui: &Ui, baked: &Arc<BakedMaps>, number: usize) -> TextureHandle {
    let id = egui::Id::unique("textures of baked maps");
    let mut textures: MapTextures = ui.data_mut(|data| data.remove_temp(id)).unwrap_or_default();
    if textures.of.as_ref().is_none_or(|of| !Arc::ptr_eq(of, baked)) {
        textures = MapTextures { of: Some(baked.clone()), all: vec![None; baked.maps.len()] };
    }
    let made = textures.all[number].get_or_insert_with(|| {
        let image = reduced(&baked.maps[number].image, LARGE as usize);
        ui.ctx().load_texture("baked map", image, TextureOptions::LINEAR)
    });
    let made = made.clone();
    ui.data_mut(|data| data.insert_temp(id, textures));
    made
}

/// Returns an image with at most this many pixels a side, without its opacity; each pixel is the mean of a square.
fn reduced(image: &Image, side: usize) -> ColorImage {
    let step = image.width().max(image.height()).div_ceil(side).max(1);
    let size = [image.width() / step, image.height() / step].map(|n| n.max(1));
    let pixel = |i: usize| {
        let (x0, y0) = (i % size[0] * step, i / size[0] * step);
        let mut sum = [0u32; 3];
        let mut count = 0;
        for y in y0..(y0 + step).min(image.height()) {
            for x in x0..(x0 + step).min(image.width()) {
                let pixel = image.at(x, y);
                (0..3).for_each(|k| sum[k] += u32::from(pixel[k]));
                count += 1;
            }
        }
        let [r, g, b] = sum.map(|s| (s / count.max(1)) as u8);
        Color32::from_rgb(r, g, b)
    };
    ColorImage::new(size, (0..size[0] * size[1]).map(pixel).collect())
}
