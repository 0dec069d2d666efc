//! Baking of the levels of a scene.

use std::sync::Arc;

use lodsmith::Control;
use lodsmith::core::TriMesh;
use lodsmith_bake::with_tangents;
use lodsmith_io::Warning;
use lodsmith_io::gltf::Scene;

use crate::args::BakeArgs;
use crate::baking;

/// Maps and materials of levels.
#[derive(Default)]
pub(super) struct BakedLevels {
    /// For each level from 1 on and each mesh, the materials of its primitives.
    pub(super) materials: Vec<Vec<Vec<usize>>>,
    /// For each bake, the maps that are files, by the ends of their names.
    pub(super) files: Vec<Vec<(String, Arc<Vec<u8>>)>>,
    /// True if all levels share one bake.
    pub(super) is_shared: bool,
    pub(super) warnings: Vec<Warning>,
}

/// Bakes the levels from 1 on; `replaced` has the meshes of all levels. Where the texture coordinates of the input are
/// kept, the maps of the finest level are for all; else each level has an atlas and a material of its own.
pub(super) fn bake_levels(
    scene: &mut Scene,
    replaced: &mut [Vec<Option<TriMesh>>],
    args: &BakeArgs,
    control: &mut dyn Control,
) -> anyhow::Result<BakedLevels> {
    let mut all = BakedLevels::default();
    let high = baking::model_of(scene).model;
    let levels = replaced.len();
    for k in 1..levels {
        let low = lodsmith_bake::model_with(&high, &replaced[k]);
        let mut baked = baking::bake_scene(&high, &low, scene, &args.options(), &args.texture, control)?;
        let mut own = std::mem::take(&mut baked.warnings);
        own.retain(|w| !all.warnings.contains(w));
        all.warnings.append(&mut own);
        for (mesh, made) in replaced[k].iter_mut().zip(baked.replaced) {
            if mesh.is_some() {
                *mesh = made.or_else(|| mesh.take());
            }
        }
        all.files.push(baked.files);
        if baked.is_new_atlas {
            all.materials.push(baked.materials);
            continue;
        }
        // The coordinates are those of all levels.
        for level in &mut replaced[k + 1..] {
            for mesh in level.iter_mut().flatten() {
                *mesh = with_tangents(mesh);
                if baked.has_color {
                    mesh.set_colors(None)?;
                }
            }
        }
        all.materials.resize(levels - k, baked.materials);
        all.is_shared = true;
        break;
    }
    Ok(all)
}
