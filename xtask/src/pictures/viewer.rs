//! Screenshots of the viewer, and the animation of its slider.
//!
//! An example of the viewer takes them without a window; this module reduces their colours and writes the files.

use std::path::Path;
use std::process::Command;

use anyhow::{Context, Result, bail, ensure};
use lodsmith::core::Image;
use lodsmith_render::decode;

use super::{PALETTE_SIZE, opaque, palette, put, write};
use crate::root;

/// The file names of the screenshots, without extension.
const SCREENSHOTS: [&str; 6] =
    ["viewer", "viewer-error", "viewer-normals", "viewer-difference", "viewer-bake", "stage"];
/// The animation of the README.
const SLIDER: &str = "docs/pictures/slider.png";
/// Palette size of the animation, which shows one surface and the window.
const SLIDER_COLOURS: usize = 64;
/// Frames per second of the animation.
const SLIDER_FPS: u16 = 8;
/// Maximum file size of the animation: the README should load fast.
const SLIDER_MAX_BYTES: usize = 2 << 20;

/// Takes all screenshots and writes them; without a graphics adapter, changes nothing.
pub(super) fn run() -> Result<()> {
    let folder = tempfile::tempdir()?;
    let cargo = std::env::var_os("CARGO").unwrap_or_else(|| "cargo".into());
    let mut command = Command::new(cargo);
    command.args(["run", "--quiet", "-p", "lodsmith-viewer", "--example", "pictures", "--"]);
    let status = command.arg(folder.path()).current_dir(root()).status().context("starting cargo")?;
    if !status.success() {
        bail!("the screenshots of the viewer failed ({status})");
    }
    if folder.path().read_dir()?.next().is_none() {
        println!("viewer: SKIPPED, no graphics adapter; `lodsmith doctor` says what is missing");
        return Ok(());
    }
    for name in SCREENSHOTS {
        write(&read(&folder.path().join(format!("{name}.png")))?, &format!("docs/pictures/{name}.png"))?;
    }
    let mut frames = Vec::new();
    while let Ok(frame) = read(&folder.path().join(format!("slider_{:02}.png", frames.len()))) {
        frames.push(frame);
    }
    slider(&frames)
}

fn read(path: &Path) -> Result<Image> {
    Ok(decode(&std::fs::read(path)?)?)
}

/// Writes the frames, forwards and then backwards, as an animated PNG with one palette.
fn slider(frames: &[Image]) -> Result<()> {
    let first = frames.first().context("there are no frames of the slider")?;
    let (width, size) = (first.width(), first.pixels().len());
    ensure!(frames.iter().all(|f| f.pixels().len() == size), "the frames of the slider differ in size");
    let pixels: Vec<[u8; 3]> = frames.iter().flat_map(opaque).collect();
    let (colours, indices) = palette::indexed(&pixels, SLIDER_COLOURS.min(PALETTE_SIZE));
    let indices: Vec<&[u8]> = indices.chunks(size).collect();
    let back = (1..indices.len().saturating_sub(1)).rev();
    let order: Vec<usize> = (0..indices.len()).chain(back).collect();
    let mut bytes = Vec::new();
    let mut encoder = super::encoder(first, &mut bytes);
    encoder.set_filter(png::Filter::NoFilter);
    encoder.set_color(png::ColorType::Indexed);
    encoder.set_palette(colours.as_flattened().to_vec());
    encoder.set_animated(order.len() as u32, 0)?;
    encoder.set_frame_delay(1, SLIDER_FPS)?;
    let mut writer = encoder.write_header()?;
    let mut before: Option<&[u8]> = None;
    for (number, &i) in order.iter().enumerate() {
        let frame = indices[i];
        let [left, top, w, h] = before.map_or([0, 0, width, size / width], |b| changed(b, frame, width));
        if number > 0 {
            writer.reset_frame_position()?;
            writer.set_frame_dimension(w as u32, h as u32)?;
            writer.set_frame_position(left as u32, top as u32)?;
        }
        // The first and the last frame are shown for a second.
        let holds = number == 0 || i + 1 == indices.len();
        writer.set_frame_delay(1, if holds { 1 } else { SLIDER_FPS })?;
        let rows = frame.chunks(width).skip(top).take(h);
        let part: Vec<u8> = rows.flat_map(|row| row[left..left + w].iter().copied()).collect();
        writer.write_image_data(&part)?;
        before = Some(frame);
    }
    writer.finish()?;
    ensure!(bytes.len() <= SLIDER_MAX_BYTES, "the animation has {} bytes", bytes.len());
    put(first, &bytes, SLIDER)
}

/// Returns the rectangle that differs, as left, top, width and height; one pixel if nothing differs.
fn changed(before: &[u8], after: &[u8], width: usize) -> [usize; 4] {
    let differs = |i: &usize| before[*i] != after[*i];
    let all = || (0..after.len()).filter(differs);
    let columns = || all().map(|i| i % width);
    match (columns().min(), columns().max(), all().next(), all().next_back()) {
        (Some(left), Some(right), Some(first), Some(last)) => {
            [left, first / width, right + 1 - left, last / width + 1 - first / width]
        }
        _ => [0, 0, 1, 1],
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_changed_pixels_are_stored() {
        let before = vec![0; 20];
        let mut after = before.clone();
        assert_eq!(changed(&before, &after, 5), [0, 0, 1, 1]);
        (after[6], after[13]) = (1, 2);
        assert_eq!(changed(&before, &after, 5), [1, 1, 3, 2]);
    }
}
