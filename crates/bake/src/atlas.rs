//! A new atlas: charts, their flattening and packing, by the crate `uvunwrap` (decision 0024).

use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};

use glam::DVec3;
use lodsmith_core::WedgeId;
use uvunwrap::{Atlas, Density, Error, MeshInput, Options, Packing, Stage, generate_with_progress};

use crate::error::BakeError;
use crate::flat::Flat;

/// Texels between a chart and the border of its cell, for a map of this size: enough to keep charts separate in four
/// mip levels at 2048.
pub(crate) fn padding(size: usize) -> usize {
    (size / 256).clamp(2, 16)
}

/// Charts are packed in a grid of cells, with at most this many cells in a row. (Measured with 10,000 faces of a brain
/// on a map of 2048²: with a cell for each texel, packing takes half of the time of a bake.)
const MAX_CELLS: usize = 1024;

/// Number of charts above which they are packed in rows: that is less dense, but takes a small part of the time.
/// (Measured: a bake of a cave with 48,000 charts at 2048² takes 52 s, and over 190 s if they are packed by their shapes.)
const MANY_CHARTS: usize = 1 << 14;

/// Share of the map that charts usually fill.
pub(crate) const USUAL_FILL: f64 = 0.65;

/// Returns texture coordinates at the corners of some faces, in a common atlas; v grows upwards. `proceed` is called
/// often, and returns false to cancel.
pub(crate) fn unwrap(
    light: &Flat,
    faces: &[usize],
    size: usize,
    proceed: &(dyn Fn() -> bool + Sync),
) -> Result<Vec<[[f32; 2]; 3]>, BakeError> {
    let failed = |problem: String| BakeError::Atlas { size, problem };
    // Relative to the centre, in units of the diagonal: the crate works in single precision.
    let bounds = light.mesh.positions().view().bounds();
    let bounds = bounds.ok_or(BakeError::Empty { which: "lighter" })?;
    let centre = (DVec3::from(bounds.min) + DVec3::from(bounds.max)) * 0.5;
    let scale = 1.0 / bounds.diagonal().max(f64::MIN_POSITIVE);
    let view = light.mesh.positions().view();
    let mut number = vec![u32::MAX; light.mesh.wedge_count()];
    let mut positions: Vec<[f32; 3]> = Vec::new();
    let mut indices = Vec::with_capacity(faces.len() * 3);
    for &f in faces {
        for w in light.mesh.triangles()[f] {
            let n = &mut number[w.index()];
            if *n == u32::MAX {
                *n = positions.len() as u32;
                let place = (DVec3::from(view.get(light.mesh.vertex_of(WedgeId(w.0)))) - centre) * scale;
                positions.push(place.as_vec3().to_array());
            }
            indices.push(*n);
        }
    }
    let cells = size.min(MAX_CELLS);
    let mut pad = (padding(size) * cells).div_ceil(size) as u32;
    let mut packing = Packing::Shape;
    // A larger map has no more cells than that.
    let advice = if size < MAX_CELLS { "use a larger --texture-size" } else { "keep fewer faces" };
    loop {
        let density = Density::Auto { page_size: cells as u32 };
        let options = Options { density, padding: pad, packing, ..Options::default() };
        let input = MeshInput::new(&positions, &indices);
        // The number of charts is known before they are packed, which takes the most time.
        let (charts, is_suited) = (AtomicUsize::new(0), AtomicBool::new(true));
        let made = generate_with_progress(&[input], &options, |progress| {
            let mut goes_on = proceed();
            if progress.stage == Stage::Parameterizing {
                // It is called once for each chart.
                let count = charts.fetch_add(1, Ordering::Relaxed) + 1;
                let is_last = progress.total == Some(progress.done);
                if is_last && suited_to(count, cells, pad) != Some((pad, packing)) {
                    is_suited.store(false, Ordering::Relaxed);
                    goes_on = false;
                }
            }
            goes_on
        });
        if !is_suited.into_inner() {
            let charts = charts.into_inner();
            (pad, packing) = suited_to(charts, cells, pad).ok_or_else(|| {
                let least = area_of_chart(1) * size * size / (cells * cells);
                failed(format!("its {charts} charts need {least} texels each or more; {advice}"))
            })?;
            continue;
        }
        match made {
            Ok(atlas) if atlas.page_count <= 1 => return Ok(corner_uvs(&atlas, cells)),
            Err(Error::Cancelled) => return Err(BakeError::Cancelled),
            // Many small charts: less padding between them may be enough.
            _ if pad > 1 => pad /= 2,
            Ok(_) => return Err(failed(format!("its charts do not fit; {advice}"))),
            Err(e) => return Err(failed(format!("{e}; {advice}"))),
        }
    }
}

/// Returns the padding, at most `pad`, and the packing for a number of charts on a map of `cells` × `cells`; `None` if they
/// cannot fit.
fn suited_to(charts: usize, cells: usize, pad: u32) -> Option<(u32, Packing)> {
    let mut halves = std::iter::successors(Some(pad), |pad| (*pad > 1).then_some(pad / 2));
    let pad = halves.find(|&pad| charts.saturating_mul(area_of_chart(pad)) <= cells * cells)?;
    Some((pad, if charts > MANY_CHARTS { Packing::Fast } else { Packing::Shape }))
}

/// Returns the least number of cells of a chart with the padding around it.
fn area_of_chart(pad: u32) -> usize {
    (1 + 2 * pad as usize).pow(2)
}

/// Returns the coordinates at the corners; the atlas may be cropped to the rows in use, the map is not.
fn corner_uvs(atlas: &Atlas, cells: usize) -> Vec<[[f32; 2]; 3]> {
    let mesh = &atlas.meshes[0];
    let factor = |side: u32| side as f32 / cells as f32;
    let (x, y) = (factor(atlas.width), factor(atlas.height));
    let uv = |i: &u32| {
        let [u, v] = mesh.vertices[*i as usize].uv;
        [u * x, v * y]
    };
    let (triangles, _) = mesh.indices.as_chunks::<3>();
    triangles.iter().map(|t| [uv(&t[0]), uv(&t[1]), uv(&t[2])]).collect()
}
