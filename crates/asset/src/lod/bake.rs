//! Baking for the levels of a scene.

use lodsmith_bake::with_tangents;
use lodsmith_core::TriMesh;
use lodsmith_io::Warning;
use lodsmith_io::gltf::Scene;

use crate::baking::{Baking, SideFile};
use crate::error::AssetError;
use crate::job::Job;

/// Maps and materials of levels.
#[derive(Debug, Default)]
pub(super) struct BakedLevels {
    /// For each level from 1 on and each mesh, the materials of its primitives.
    pub(super) materials: Vec<Vec<Vec<usize>>>,
    /// For each bake, the maps that are written to files.
    pub(super) files: Vec<Vec<SideFile>>,
    /// True if all levels share one bake.
    pub(super) is_shared: bool,
    pub(super) warnings: Vec<Warning>,
}

/// Bakes the levels from level 1 on; `replaced` has the meshes of all levels. If the texture coordinates of the input
/// are kept, all levels share the maps of level 1; otherwise each level has its own atlas and materials.
pub(super) fn bake_levels(
    scene: &mut Scene,
    replaced: &mut [Vec<Option<TriMesh>>],
    baking: &Baking,
    job: &mut Job<'_>,
) -> Result<BakedLevels, AssetError> {
    let mut baking = baking.clone();
    baking.options.is_same_model = true;
    let mut all = BakedLevels::default();
    let (high, unread) = scene.model();
    // Maps show the model at rest: they lack its images that were not read, but not its animations.
    all.warnings.extend(unread.into_iter().filter(|warning| warning.data_lost));
    let levels = replaced.len();
    for k in 1..levels {
        let low = lodsmith_bake::model_with(&high, &replaced[k]);
        let mut baked = baking.bake(&high, &low, scene, job)?;
        let mut of_level = std::mem::take(&mut baked.warnings);
        of_level.retain(|w| !all.warnings.contains(w));
        all.warnings.append(&mut of_level);
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
        // All levels have these texture coordinates.
        for level in &mut replaced[k + 1..] {
            for mesh in level.iter_mut().flatten() {
                *mesh = with_tangents(mesh);
                if baking.has_color() {
                    mesh.set_colors(None)?;
                }
            }
        }
        all.materials.resize(levels - 1, baked.materials);
        all.is_shared = k == 1;
        break;
    }
    Ok(all)
}

#[cfg(test)]
mod tests {
    use lodsmith::NoControl;
    use lodsmith_bake::{BakeOptions, MapKind};
    use lodsmith_io::ReadOptions;

    use super::*;

    #[test]
    fn each_level_has_materials_if_level_1_cannot_keep_its_coordinates() {
        let wave = concat!(env!("CARGO_MANIFEST_DIR"), "/../../testdata/wave.glb");
        let mut scene = Scene::read(&std::fs::read(wave).unwrap(), &ReadOptions::default()).unwrap();
        let good = TriMesh::clone(&scene.meshes()[0].mesh);
        // The texture coordinates are folded: both halves of the surface lie in one half of the map.
        let mut folded = good.clone();
        let fold = |[u, v]: [f32; 2]| [(2.0 * u - 1.0).abs(), v];
        folded.set_uvs(Some(good.uvs().unwrap().iter().copied().map(fold).collect())).unwrap();
        let mut replaced = vec![vec![None], vec![Some(folded)], vec![Some(good.clone())], vec![Some(good)]];
        let mut options = BakeOptions::new([MapKind::Height]);
        (options.size, options.rays) = (Some(32), 1);
        let baking = Baking { options, map_files: false };
        let mut watch = NoControl;
        let mut job = Job::new(&mut watch, None, u64::MAX);
        let baked = bake_levels(&mut scene, &mut replaced, &baking, &mut job).unwrap();
        let [first, second, third] = &baked.materials[..] else { panic!("{:?}", baked.materials) };
        assert!(first != second && second == third, "{:?}", baked.materials);
        // Each of the two bakes has its own files.
        assert!(baked.files.len() == 2 && !baked.is_shared);
    }
}
