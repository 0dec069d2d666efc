//! Simplification of a scene that stays one.

use lodsmith::SimplifiedScene;
use lodsmith::core::TriMesh;
use lodsmith_io::gltf::Scene;

use super::report::SimplifyOutcome;
use crate::args::SimplifyArgs;
use crate::file::Destination;
use crate::normals::set_normals;
use crate::paths::Source;
use crate::run_control::{RunControl, not_interrupted};
use crate::scene_parts::{self, parts_of};
use crate::warnings::{not_reached, warnings_of};
use crate::{constraints, images, memory, memory_need, palettes};

/// Simplifies all meshes of a scene under one budget; the rest of the scene is not changed.
pub(super) fn simplify_scene(
    mut scene: Scene,
    source: &Source,
    to: &Destination,
    args: &SimplifyArgs,
    mut watch: RunControl<'_>,
) -> anyhow::Result<SimplifyOutcome> {
    let meshes = scene.meshes().to_vec();
    let (taken, parts) = parts_of(&meshes);
    let diagonal = scene.bounds().map_or(0.0, |b| b.diagonal());
    let mut options = args.options();
    constraints::of_scene(&args.engine.how, &scene, &taken, &mut options)?;
    options.textures = palettes::of_scene(&scene, &taken);
    memory::check("simplify", memory_need::simplify_scene(&meshes, scene.buffer_bytes(), &options))?;
    let done = lodsmith::simplify_scene(&parts, diagonal, &options, &mut watch);
    let SimplifiedScene { meshes: mut lighter, mut report, mut counts } = not_interrupted(done)?;
    // As in the file: the reader merges vertices at one place.
    report.input_vertices = scene_parts::count(&parts, TriMesh::wedge_count);
    for (counts, part) in counts.iter_mut().zip(&parts) {
        counts.input_vertices = part.mesh.wedge_count();
    }
    let not_reached = not_reached(&report, &options, watch.time_limit, &lighter);

    watch.write();
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
    warnings.extend(warnings_of(&report));
    warnings.extend(images.bring(&mut scene, to.format, to.writing.textures));
    let relink = |uri: &str| images.uri(uri);
    warnings.extend(to.write_scene(&scene, &replaced, &relink)?);
    let meshes = taken.iter().map(|&i| meshes[i].name.clone()).zip(counts).collect();
    Ok(SimplifyOutcome {
        input_format: scene.format(),
        report,
        not_reached,
        warnings,
        meshes,
        threads: rayon::current_num_threads(),
        clock: watch.end(),
    })
}
