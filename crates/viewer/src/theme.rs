//! Themes of the window: colours, fonts, and spacing in steps of four points.

use eframe::egui::{
    self, Color32, CornerRadius, FontFamily, FontId, Margin, RichText, Stroke, TextStyle, Theme, Vec2,
    Visuals,
};

/// Spacing step, in points.
pub const SPACING: f32 = 4.0;
/// Widths of the docks, in wide and in narrow windows.
const DOCK_WIDTHS: [f32; 2] = [296.0, 264.0];
/// Windows narrower than this have less room for bars and docks.
pub const NARROW_WINDOW: f32 = 1080.0;

/// Returns the width of the docks in a window of this width.
pub fn dock_width(window: f32) -> f32 {
    DOCK_WIDTHS[usize::from(window < NARROW_WINDOW)]
}

/// Colours of a theme.
#[derive(Clone, Copy, Debug)]
pub struct Palette {
    /// Background of the window.
    pub window: Color32,
    /// Docks and bars.
    pub panel: Color32,
    /// Headings of sections.
    pub raised: Color32,
    /// Text fields.
    pub sunken: Color32,
    /// Buttons.
    pub button: Color32,
    /// Hovered buttons.
    pub hovered: Color32,
    /// Separator lines.
    pub line: Color32,
    /// Text.
    pub text: Color32,
    /// Secondary text.
    pub weak: Color32,
    /// Selection and draggable items.
    pub accent: Color32,
    /// Text on the accent colour.
    pub on_accent: Color32,
    /// Success.
    pub good: Color32,
    /// Warning.
    pub warning: Color32,
    /// Error.
    pub error: Color32,
}

const fn rgb(hex: u32) -> Color32 {
    Color32::from_rgb((hex >> 16) as u8, (hex >> 8) as u8, hex as u8)
}

/// Colours of the dark theme.
pub const DARK: Palette = Palette {
    window: rgb(0x141619),
    panel: rgb(0x1c1f23),
    raised: rgb(0x24282d),
    sunken: rgb(0x121416),
    button: rgb(0x2e3339),
    hovered: rgb(0x3a4048),
    line: rgb(0x343940),
    text: rgb(0xe4e6e9),
    weak: rgb(0x9da5ae),
    accent: rgb(0xf0a94b),
    on_accent: rgb(0x1f1608),
    good: rgb(0x7cc88f),
    warning: rgb(0xf2c45a),
    error: rgb(0xff8578),
};

/// Colours of the light theme.
pub const LIGHT: Palette = Palette {
    window: rgb(0xe3e6ea),
    panel: rgb(0xf6f7f9),
    raised: rgb(0xe9ecf0),
    sunken: rgb(0xffffff),
    button: rgb(0xe2e6eb),
    hovered: rgb(0xd3d9e0),
    line: rgb(0xcdd3da),
    text: rgb(0x1d2228),
    weak: rgb(0x58626d),
    accent: rgb(0xa85a00),
    on_accent: rgb(0xffffff),
    good: rgb(0x1a6b32),
    warning: rgb(0x7d5100),
    error: rgb(0xb3261e),
};

/// Returns the colours of the current theme.
pub fn palette(ui: &egui::Ui) -> &'static Palette {
    if ui.visuals().dark_mode { &DARK } else { &LIGHT }
}

/// Installs both themes.
pub fn install(ctx: &egui::Context) {
    for (theme, palette) in [(Theme::Dark, &DARK), (Theme::Light, &LIGHT)] {
        ctx.style_mut_of(theme, |style| {
            style.visuals = visuals(theme, palette);
            style.text_styles = [
                (TextStyle::Small, FontId::new(11.5, FontFamily::Proportional)),
                (TextStyle::Body, FontId::new(13.0, FontFamily::Proportional)),
                (TextStyle::Button, FontId::new(13.0, FontFamily::Proportional)),
                (TextStyle::Heading, FontId::new(20.0, FontFamily::Proportional)),
                (TextStyle::Monospace, FontId::new(12.5, FontFamily::Monospace)),
            ]
            .into();
            let spacing = &mut style.spacing;
            spacing.item_spacing = Vec2::new(2.0 * SPACING, 1.5 * SPACING);
            spacing.button_padding = Vec2::new(2.0 * SPACING, SPACING);
            spacing.interact_size = Vec2::new(28.0, 24.0);
            spacing.window_margin = Margin::same(16);
            spacing.menu_margin = Margin::same(6);
            spacing.indent = 4.0 * SPACING;
            spacing.combo_width = 120.0;
            spacing.slider_rail_height = SPACING;
            spacing.tooltip_width = 360.0;
            style.interaction.tooltip_delay = 0.4;
            style.interaction.selectable_labels = false;
            // Animations of the interface cost frames on a software adapter.
            style.animation_time = 0.0;
        });
    }
}

fn visuals(theme: Theme, p: &Palette) -> Visuals {
    let mut v = if theme == Theme::Dark { Visuals::dark() } else { Visuals::light() };
    let radius = CornerRadius::same(5);
    v.panel_fill = p.panel;
    v.window_fill = p.panel;
    v.window_stroke = Stroke::new(1.0, p.line);
    v.window_corner_radius = CornerRadius::same(8);
    v.menu_corner_radius = CornerRadius::same(6);
    v.extreme_bg_color = p.sunken;
    v.text_edit_bg_color = Some(p.sunken);
    v.faint_bg_color = p.raised;
    v.code_bg_color = p.sunken;
    v.weak_text_color = Some(p.weak);
    v.hyperlink_color = p.accent;
    v.warn_fg_color = p.warning;
    v.error_fg_color = p.error;
    v.selection.bg_fill = p.accent;
    v.selection.stroke = Stroke::new(1.0, p.on_accent);
    v.slider_trailing_fill = true;
    v.striped = false;
    let w = &mut v.widgets;
    w.noninteractive.bg_fill = p.panel;
    w.noninteractive.weak_bg_fill = p.panel;
    w.noninteractive.bg_stroke = Stroke::new(1.0, p.line);
    w.noninteractive.fg_stroke = Stroke::new(1.0, p.text);
    for (state, fill) in [
        (&mut w.inactive, p.button),
        (&mut w.hovered, p.hovered),
        (&mut w.active, p.hovered),
        (&mut w.open, p.raised),
    ] {
        state.bg_fill = fill;
        state.weak_bg_fill = fill;
        state.bg_stroke = Stroke::NONE;
        state.fg_stroke = Stroke::new(1.0, p.text);
        state.expansion = 0.0;
    }
    w.inactive.bg_stroke = Stroke::new(1.0, p.line);
    w.hovered.bg_stroke = Stroke::new(1.0, p.weak);
    w.active.bg_stroke = Stroke::new(1.0, p.accent);
    w.open.bg_stroke = Stroke::new(1.0, p.line);
    for state in [&mut w.noninteractive, &mut w.inactive, &mut w.hovered, &mut w.active, &mut w.open] {
        state.corner_radius = radius;
    }
    v
}

/// Returns text in the secondary colour.
pub fn weak(ui: &egui::Ui, text: impl Into<String>) -> RichText {
    RichText::new(text).color(palette(ui).weak)
}

/// Returns monospace text, for numbers.
pub fn number(text: impl Into<String>) -> RichText {
    RichText::new(text).monospace()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Relative luminance as defined by the Web Content Accessibility Guidelines.
    fn luminance(color: Color32) -> f64 {
        let linear = |c: u8| {
            let c = f64::from(c) / 255.0;
            if c <= 0.03928 { c / 12.92 } else { ((c + 0.055) / 1.055).powf(2.4) }
        };
        0.2126 * linear(color.r()) + 0.7152 * linear(color.g()) + 0.0722 * linear(color.b())
    }

    fn contrast(a: Color32, b: Color32) -> f64 {
        let (a, b) = (luminance(a), luminance(b));
        (a.max(b) + 0.05) / (a.min(b) + 0.05)
    }

    #[test]
    fn text_can_be_read_in_both_themes() {
        for p in [DARK, LIGHT] {
            for ground in [p.panel, p.raised, p.sunken, p.window] {
                for text in [p.text, p.weak, p.error, p.good, p.warning] {
                    let got = contrast(text, ground);
                    assert!(got >= 4.5, "{text:?} on {ground:?}: {got:.2}");
                }
            }
            assert!(contrast(p.text, p.button) >= 7.0);
            assert!(contrast(p.on_accent, p.accent) >= 4.5);
            assert!(contrast(p.accent, p.panel) >= 3.0);
        }
    }
}
