//! Simplification of a scene that stays one.

use lodsmith::core::TriMesh;
use lodsmith::{OwnedMeshData, SimplifiedScene};
use lodsmith_io::Loaded;
use lodsmith_io::gltf::Scene;

use super::report::SimplifyOutcome;
use crate::args::SimplifyArgs;
use crate::baking::{self, BakedScene};
use crate::file::Destination;
use crate::mesh_scene::MeshScene;
use crate::normals::set_normals;
use crate::paths::Source;
use crate::run_control::{RunControl, not_interrupted};
use crate::scene_parts::{self, parts_of, taken};
use crate::warnings::{not_reached, starved, warnings_of};
use crate::{engine_input, images, memory, memory_need, sizes};

/// Simplifies a mesh that becomes a scene, so that maps can be baked for it.
pub(super) fn simplify_mesh(
    loaded: Loaded,
    source: &Source,
    to: &Destination,
    args: &SimplifyArgs,
    watch: RunControl<'_>,
) -> anyhow::Result<SimplifyOutcome> {
    let format = loaded.format;
    let own = MeshScene::new(loaded, &args.engine.names, to)?;
    let mut done = simplify_scene(own.scene, source, to, args, Some(own.data), watch)?;
    done.input_format = format;
    done.warnings.splice(0..0, own.warnings);
    Ok(done)
}

/// Simplifies all meshes of a scene under one budget; the rest of the scene is not changed, unless maps are baked.
/// `own` has the data of a mesh that became a scene.
pub(super) fn simplify_scene(
    mut scene: Scene,
    source: &Source,
    to: &Destination,
    args: &SimplifyArgs,
    own: Option<OwnedMeshData>,
    mut watch: RunControl<'_>,
) -> anyhow::Result<SimplifyOutcome> {
    let sizes_before = sizes::of_input(source, &args.reading, scene.sizes());
    let meshes = scene.meshes().to_vec();
    let taken = taken(&meshes);
    let diagonal = scene.bounds().map_or(0.0, |b| b.diagonal());
    let options = args.options();
    let (data, left_out) = engine_input::of_scene(&scene, &taken, &args.engine.names, own)?;
    let parts = parts_of(&meshes, &data);
    let need = memory_need::simplify_scene(&meshes, scene.buffer_bytes(), &options);
    memory::check("simplify", need.saturating_add(memory_need::images(&data)))?;
    let done = lodsmith::simplify_scene(&parts, diagonal, &options, &mut watch);
    let SimplifiedScene { meshes: mut lighter, mut report, mut counts } = not_interrupted(done)?;
    // As in the file: the reader merges vertices at one place.
    report.input_vertices = scene_parts::count(&parts, TriMesh::wedge_count);
    for (counts, part) in counts.iter_mut().zip(&parts) {
        counts.input_vertices = part.mesh.wedge_count();
    }
    let not_reached = not_reached(&report, &options, watch.time_limit, &lighter);

    for mesh in &mut lighter {
        set_normals(mesh, args.normals)?;
    }
    let mut replaced = vec![None; meshes.len()];
    for (&i, mesh) in taken.iter().zip(lighter) {
        // A mesh without faces in the input is not changed.
        replaced[i] = (meshes[i].mesh.face_count() > 0).then_some(mesh);
    }
    let images = images::FolderMove::new(source, &to.sink);
    let mut warnings: Vec<_> = scene.warnings().to_vec();
    warnings.extend(left_out);
    warnings.extend(warnings_of(&report));
    warnings.extend(starved(&counts));
    let mut baked = None;
    if args.baking.is_asked() {
        watch.bake();
        let made = bake(&mut scene, &mut replaced, args, &mut watch)?;
        warnings.extend(made.warnings.iter().cloned());
        baked = Some(made);
    }
    watch.write();
    warnings.extend(images.bring(&mut scene, to.format, to.writing.textures));
    let relink = |uri: &str| images.uri(uri);
    let mut written = match &baked {
        Some(baked) => {
            let mut written = baking::write_baked(to, &scene, &replaced, &relink)?;
            baking::forgive_colors(&mut written.warnings, baked.has_color);
            baking::write_files(&baked.files, "", to)?;
            written
        }
        None => to.write_scene(&scene, &replaced, &relink)?,
    };
    warnings.append(&mut written.warnings);
    let meshes = taken.iter().map(|&i| meshes[i].name.clone()).zip(counts).collect();
    Ok(SimplifyOutcome {
        input_format: scene.format(),
        report,
        not_reached,
        warnings,
        meshes,
        baked: baked.map(|b| b.report),
        sizes_before,
        written,
        threads: rayon::current_num_threads(),
        clock: watch.end(),
    })
}

/// Bakes maps for the meshes of a scene, and lets these use them.
fn bake(
    scene: &mut Scene,
    replaced: &mut [Option<TriMesh>],
    args: &SimplifyArgs,
    watch: &mut RunControl<'_>,
) -> anyhow::Result<BakedScene> {
    let high = baking::model_of(scene).model;
    let low = lodsmith_bake::model_with(&high, replaced);
    let (options, texture) = (args.baking.options(), &args.baking.texture);
    let mut baked = baking::bake_scene(&high, &low, scene, &options, texture, watch)?;
    for (mesh, made) in replaced.iter_mut().zip(std::mem::take(&mut baked.replaced)) {
        if made.is_some() {
            *mesh = made;
        }
    }
    lodsmith_bake::set_materials(scene, &baked.materials);
    scene.drop_unused_materials();
    Ok(baked)
}
