//! Benchmark panel: its key, its table, and copying.

use std::path::Path;

use eframe::egui::{Key, Modifiers, OutputCommand, Role};
use egui_kittest::kittest::Queryable;
use lodsmith_viewer::content::benchmark::COLUMN_HEADINGS;
use lodsmith_viewer::panel::Panel;

use super::harness::AppHarness;

/// Returns the text that a button copies to the clipboard.
fn copied(window: &mut AppHarness, button: &str) -> String {
    window.harness.get_by_role_and_label(Role::Button, button).click();
    for _ in 0..4 {
        window.harness.step();
        let commands = &window.harness.output().platform_output.commands;
        if let Some(OutputCommand::CopyText(text)) = commands.first() {
            return text.clone();
        }
    }
    unreachable!("{button} copies nothing")
}

#[test]
fn times_of_every_level_are_measured_and_copied() {
    for is_light in [false, true] {
        let Some(mut window) = AppHarness::with(is_light, Some(Path::new("../../testdata/finial.ply")))
        else {
            return;
        };
        assert!(!window.app().is_shown(Panel::Benchmark));
        window.press(Key::F10);
        window.harness.get_by_label("Nothing measured yet");
        window.press_with(Modifiers::COMMAND, Key::B);
        let table = window.app().document().benchmark_table().unwrap();
        assert_eq!(table.rows.len(), 6);
        for row in &table.rows {
            let level = row.level.as_ref().unwrap();
            assert_eq!(level.simplify_secs.is_some(), row.share < 1.0);
            assert!(level.upload_secs.is_some_and(|s| s > 0.0) && level.frame_secs.is_some_and(|s| s > 0.0));
            assert!(level.adapter_secs.is_none_or(|s| (0.0..60.0).contains(&s)), "{level:?}");
        }
        window.picture(if is_light { "benchmark_light" } else { "benchmark_dark" });
        assert_eq!(copied(&mut window, "Copy as Markdown"), table.markdown());
        let tsv = copied(&mut window, "Copy as TSV");
        assert_eq!(tsv, table.tsv());
        assert_eq!(tsv.lines().count(), 7);
        assert!(COLUMN_HEADINGS.iter().all(|head| table.markdown().contains(head)));
    }
}

#[test]
fn measuring_can_be_cancelled() {
    let Some(mut window) = AppHarness::open("sphere.ply") else { return };
    window.harness.key_press_modifiers(Modifiers::COMMAND, Key::B);
    window.harness.run_steps(2);
    assert!(window.app().is_shown(Panel::Benchmark), "who asks wants to see");
    window.harness.get_by_role_and_label(Role::Button, "Stop benchmark").click();
    window.settle();
    let table = window.app().document().benchmark_table().unwrap();
    assert!(table.rows.len() < 6, "{} rows", table.rows.len());
    window.harness.get_by_role_and_label(Role::Button, "Run benchmark");
    window.picture("benchmark_stopped");
}
