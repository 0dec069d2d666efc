//! Drawing: from samples to pixels.

use lodsmith_core::Image;
use lodsmith_core::model::AlphaMode;
use rayon::prelude::*;

use crate::backdrop::Backdrop;
use crate::linear::Encoder;
use crate::look::Shading;
use crate::marks::Marks;
use crate::occlusion;
use crate::projection::Projection;
use crate::raster::{BAND_ROWS, Band, FaceKind, FaceKinds, NO_FACE, SAMPLES, Screen};
use crate::shade::{Batch, Shader};
use crate::subject::Subject;
use crate::view::{MAX_SIDE_PX, RenderError, View};

/// Draws a subject.
///
/// Takes four samples per pixel (sixteen with [`View::fine`]), each of which sees the nearest face; samples
/// of a pixel that see the same face are shaded once. Faces are seen from both sides, except faces with a
/// single-sided material in [`Shading::Textured`], and with [`Look::cull_back`](crate::Look::cull_back).
/// Faces with a non-finite corner and faces without area are left out. An empty subject gives a picture of
/// the background.
///
/// Deterministic at any number of threads; uses the caller's thread pool. Cost: O(faces + pixels).
///
/// # Errors
/// [`RenderError::Size`], [`RenderError::Camera`], [`RenderError::Values`] for a heat map of a subject without values.
pub fn render(subject: &Subject, view: &View) -> Result<Image, RenderError> {
    let (width, height) = (view.width, view.height);
    if !(1..=MAX_SIDE_PX).contains(&width) || !(1..=MAX_SIDE_PX).contains(&height) {
        return Err(RenderError::Size { width, height });
    }
    if view.look.shading == Shading::Heat
        && let Some(mesh) = subject.meshes.iter().position(|m| m.values.is_none())
    {
        let vertices = subject.meshes[mesh].mesh.vertex_count();
        return Err(RenderError::Values { mesh, vertices, values: 0 });
    }
    if view.look.shading == Shading::Textured {
        subject.prepare_textures();
    }
    let factor = if view.fine { 2 } else { 1 };
    let projection = Projection::new(&view.camera, width * factor, height * factor)?;
    let kinds = kinds(subject, view);
    let screen = Screen::new(subject, projection, width * factor, height * factor, kinds);
    let shader = Shader::new(&screen, subject, view);
    let marks = Marks::new(subject, &screen, view);
    let backdrop = Backdrop::new(subject, view)?;
    let frame = Frame { view, factor, screen: &screen, shader, marks };
    let encoder = Encoder::new();
    let mut pixels = vec![[0u8; 4]; width * height];
    let rows = BAND_ROWS / factor;
    if view.occlusion {
        let mut colors = vec![[0f32; 4]; width * height];
        let mut near = vec![f32::NEG_INFINITY; width * height];
        colors.par_chunks_mut(width * rows).zip(near.par_chunks_mut(width * rows)).enumerate().for_each_init(
            Scratch::default,
            |scratch, (band, (colors, near))| {
                frame.draw(band, scratch);
                colors.copy_from_slice(&scratch.colors[..colors.len()]);
                frame.nearest(scratch, near);
            },
        );
        let light = occlusion::ambient_occlusion(&near, width, height, &screen.projection);
        pixels.par_chunks_mut(width).enumerate().for_each(|(y, row)| {
            for (x, pixel) in row.iter_mut().enumerate() {
                let [r, g, b, a] = colors[y * width + x];
                let light = light[y * width + x];
                *pixel = backdrop.over([r * light, g * light, b * light, a], x, y, encoder);
            }
        });
    } else {
        pixels.par_chunks_mut(width * rows).enumerate().for_each_init(
            Scratch::default,
            |scratch, (band, out)| {
                frame.draw(band, scratch);
                for (i, (pixel, color)) in out.iter_mut().zip(&scratch.colors).enumerate() {
                    *pixel = backdrop.over(*color, i % width, band * rows + i / width, encoder);
                }
            },
        );
    }
    Ok(Image::new(width, height, pixels))
}

/// Returns the kinds of the faces of each mesh.
fn kinds(subject: &Subject, view: &View) -> FaceKinds {
    let culls = view.look.cull_back;
    let plain = if culls { FaceKind::Front } else { FaceKind::Solid };
    let of_material = |index: &Option<usize>| {
        let material = index.and_then(|i| subject.surfaces.materials.get(i));
        let Some(material) = material.filter(|_| view.look.shading == Shading::Textured) else {
            return plain;
        };
        match (material.alpha, culls || !material.double_sided) {
            (AlphaMode::Opaque, true) => FaceKind::Front,
            (AlphaMode::Opaque, false) => FaceKind::Solid,
            (AlphaMode::Mask(_), true) => FaceKind::MaskedFront,
            (AlphaMode::Mask(_), false) => FaceKind::Masked,
            (AlphaMode::Blend, true) => FaceKind::BlendedFront,
            (AlphaMode::Blend, false) => FaceKind::Blended,
        }
    };
    let of_part = |part: &crate::subject::PlacedMesh| {
        let mut all: Vec<FaceKind> = subject.meshes[part.mesh].materials.iter().map(of_material).collect();
        if all.iter().all(|k| all.first() == Some(k)) {
            all.truncate(1);
        }
        if all.is_empty() { vec![plain] } else { all }
    };
    subject.parts.iter().map(of_part).collect()
}

/// Scratch buffers of a thread for a band.
#[derive(Default)]
struct Scratch {
    band: Band,
    /// Linear premultiplied colours with opacity; first one for each sampled pixel, then one for each pixel
    /// of the picture.
    colors: Vec<[f32; 4]>,
    batch: Batch,
}

struct Frame<'a> {
    view: &'a View,
    factor: usize,
    screen: &'a Screen<'a>,
    shader: Shader<'a>,
    marks: Marks,
}

impl Frame<'_> {
    fn draw(&self, index: usize, scratch: &mut Scratch) {
        let Scratch { band, colors, batch } = scratch;
        self.screen.draw(index, band, &|face, x, y| self.shader.is_there(face, x, y));
        colors.clear();
        colors.resize(band.cells.len(), [0.0; 4]);
        for (y, row) in band.cells.chunks(band.width).enumerate() {
            let (first, y) = (y * band.width, (y + band.first_row) as u32 as f32 + 0.5);
            for (x, cell) in row.iter().enumerate() {
                let [f0, f1, f2, f3] = cell.face.to_array();
                let (at, x) = (first + x, x as u32 as f32 + 0.5);
                if f0 == f1 && f0 == f2 && f0 == f3 {
                    if f0 != NO_FACE {
                        batch.add(&self.shader, f0, [x, y], (at, 1.0), colors);
                    }
                    continue;
                }
                let faces = [f0, f1, f2, f3];
                let mut open = 0b1111u32;
                while open != 0 {
                    let face = faces[open.trailing_zeros() as usize];
                    let mask = (0..4).fold(0, |m, k| m | u32::from(faces[k] == face) << k);
                    open &= !mask;
                    if face != NO_FACE {
                        let [dx, dy] = CENTRES[mask as usize];
                        let share = mask.count_ones() as f32 * 0.25;
                        batch.add(&self.shader, face, [x + dx, y + dy], (at, share), colors);
                    }
                }
            }
        }
        batch.finish(&self.shader, colors);
        if self.screen.has_blended(index) {
            self.blend(index, band, colors);
        }
        self.marks.draw(index, band, &self.screen.projection, colors);
        if self.factor == 2 {
            let (w, fine) = (self.view.width, band.width);
            for i in 0..colors.len() / 4 {
                let first = (i / w) * 2 * fine + (i % w) * 2;
                let four = [first, first + 1, first + fine, first + fine + 1].map(|k| colors[k]);
                colors[i] = [0, 1, 2, 3].map(|k| (four[0][k] + four[1][k] + four[2][k] + four[3][k]) * 0.25);
            }
            colors.truncate(colors.len() / 4);
        }
    }

    /// Blends transparent faces over the colours. Each sample keeps its own transmittance: adjacent faces in
    /// one pixel neither hide each other nor add up.
    fn blend(&self, index: usize, band: &Band, colors: &mut [[f32; 4]]) {
        let mut through = vec![[1f32; 4]; colors.len()];
        let mut glass = vec![[0f32; 4]; colors.len()];
        self.screen.walk_blended(index, band, |face, x, y, mask| {
            let [dx, dy] = CENTRES[mask as usize];
            let [r, g, b, a] = self.shader.color(face, x as f32 + 0.5 + dx, y as f32 + 0.5 + dy);
            let at = (y - band.first_row) * band.width + x;
            let mut seen = 0.0;
            for (_, through) in through[at].iter_mut().enumerate().filter(|(k, _)| mask >> k & 1 == 1) {
                seen += 0.25 * a * *through;
                *through *= 1.0 - a;
            }
            glass[at] = [
                glass[at][0] + r * seen,
                glass[at][1] + g * seen,
                glass[at][2] + b * seen,
                glass[at][3] + seen,
            ];
        });
        for ((color, glass), through) in colors.iter_mut().zip(&glass).zip(&through) {
            let behind = through.iter().sum::<f32>() * 0.25;
            *color = [0, 1, 2, 3].map(|k| glass[k] + color[k] * behind);
        }
    }

    /// Computes the depth of each pixel of the picture.
    fn nearest(&self, scratch: &Scratch, near: &mut [f32]) {
        let (width, fine) = (self.view.width, scratch.band.width);
        for (i, near) in near.iter_mut().enumerate() {
            let first = (i / width) * self.factor * fine + (i % width) * self.factor;
            let all = scratch.band.cells[first].near.to_array();
            *near = all.into_iter().fold(f32::NEG_INFINITY, f32::max);
        }
    }
}

/// The centre of any subset of the four samples.
static CENTRES: [[f32; 2]; 16] = {
    let mut all = [[0f32; 2]; 16];
    let mut mask = 1;
    while mask < 16 {
        let (mut k, mut n) = (0, 0.0);
        while k < 4 {
            if mask >> k & 1 == 1 {
                all[mask][0] += SAMPLES[k][0];
                all[mask][1] += SAMPLES[k][1];
                n += 1.0;
            }
            k += 1;
        }
        all[mask] = [all[mask][0] / n, all[mask][1] / n];
        mask += 1;
    }
    all
};
