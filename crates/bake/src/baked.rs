//! A whole bake, from two models to maps.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc;

use glam::Vec4;
use lodsmith::{Control, Verdict};
use lodsmith_core::memory;
use lodsmith_core::mesh::normals::vertex_normals;
use lodsmith_core::model::Material;
use lodsmith_core::{Model, Semantic, TriMesh};

use crate::curvature::Curvature;
use crate::error::BakeError;
use crate::flat::{Flat, Taken};
use crate::link::Link;
use crate::maps::{BakedMap, Texels};
use crate::occluders::Occluders;
use crate::occlusion::Rays;
use crate::options::{BakeOptions, MapKind};
use crate::search::{Found, Search};
use crate::sets::{self, FaceSet};
use crate::source::Source;
use crate::tangents::corner_tangents;
use crate::texels::Baker;
use crate::wedges::with_corners;

/// The result of a bake.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct Baked {
    /// The meshes of the lighter model, in its order, with normals, texture coordinates and tangents; `None` for meshes
    /// that no node places.
    pub meshes: Vec<Option<TriMesh>>,
    /// For each mesh and each of its regions, the index of the set whose maps it uses; empty for meshes that no node
    /// places. A mesh whose regions have all become one set has no regions.
    pub set_of_region: Vec<Vec<usize>>,
    /// The maps.
    pub sets: Vec<BakedSet>,
    /// Counts of how source points were found.
    pub found: Found,
    /// Notes for the user: coordinates that could not be used.
    pub notes: Vec<String>,
}

/// Maps that some faces share.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct BakedSet {
    /// Name for files: the name of the material.
    pub name: String,
    /// The material of the lighter model that gets the maps; `None` if `look` is a new one.
    pub material: Option<usize>,
    /// Materials of the lighter model that the new material replaces.
    pub replaced: Vec<usize>,
    /// The material, without textures. Its factors match the baked maps.
    pub look: Material,
    /// Width and height of the maps, in texels.
    pub size: usize,
    /// True if it has an atlas of its own.
    pub is_new_atlas: bool,
    /// The maps, in the order of their kinds.
    pub maps: Vec<BakedMap>,
}

/// Bakes maps of a lighter model from a detailed one.
///
/// Both must be in the same place, at rest; if a mesh is placed several times in the lighter model, the first instance
/// counts. The lighter model's meshes without normals get smooth ones. Maps are baked with four samples per texel; the
/// same input and options give the same result at any number of threads. Cost: O(texels · log faces), times the rays
/// for occlusion; 2048 x 2048 texels of normals and colours from 500,000 faces take some ten seconds on two cores.
///
/// Tangents follow MikkTSpace, whose author is Morten S. Mikkelsen.
///
/// # Errors
/// [`BakeError::Empty`], [`BakeError::Option`], [`BakeError::Memory`], [`BakeError::Atlas`]; [`BakeError::Cancelled`]
/// if the control requests it: there is no partial result.
pub fn bake(
    detailed: &Model,
    lighter: &Model,
    options: &BakeOptions,
    control: &mut dyn Control,
) -> Result<Baked, BakeError> {
    check(options)?;
    memory::check("baking", memory_need(detailed, lighter, &[]), options.memory)?;
    let taken = |of_lighter: bool| match (options.is_same_model, of_lighter) {
        (true, _) => Taken::FirstInMeshCoordinates,
        (false, true) => Taken::First,
        (false, false) => Taken::All,
    };
    proceed(control, 0.0)?;
    let normal_maps =
        options.maps.contains(&MapKind::Normal) || options.maps.contains(&MapKind::ObjectNormal);
    let smooth = with_normals(lighter);
    let before = Flat::new(&smooth, taken(true));
    if before.mesh.face_count() == 0 {
        return Err(BakeError::Empty { which: "lighter" });
    }
    let flat = Flat::new(detailed, taken(false));
    let source = Source::new(detailed, flat, normal_maps);
    if source.tree.is_empty() {
        return Err(BakeError::Empty { which: "detailed" });
    }
    proceed(control, 0.05)?;
    let has_uvs = |face: usize| lighter.meshes[before.piece_of(face).mesh].mesh.uvs().is_some();
    let (mut sets, notes) = sets::split(&before, lighter, &has_uvs, options.atlas);
    for set in &mut sets {
        let chosen = || sets::chosen_size(set, &before, &source.flat, detailed);
        set.size = options.size.unwrap_or_else(chosen);
        set.maps = sets::maps_of(set, lighter, options);
    }
    memory::check("baking", memory_need(detailed, lighter, &sets), options.memory)?;
    let uvs = if sets.iter().any(|set| set.is_new) {
        watched(control, 0.05, |proceed| sets::all_uvs(&before, &sets, proceed))?
    } else {
        sets::all_uvs(&before, &sets, &|| true)?
    };
    proceed(control, 0.1)?;
    let (meshes, set_of_region) = finished_meshes(&smooth, &before, &sets, &uvs);
    let made =
        meshes.iter().zip(&smooth.meshes).map(|(new, old)| new.clone().unwrap_or_else(|| old.mesh.clone()));
    let mut made = lighter.with_meshes(made.collect());
    // Regions may have become one; materials are not used from here on.
    made.meshes.iter_mut().for_each(|m| m.materials.resize(m.materials.len().max(1), None));
    let light = Flat::new(&made, taken(true));
    let tangents = world_tangents(&made, &light);
    let link = Link::new(&source, &light, options.is_same_model)?;
    proceed(control, 0.15)?;
    let casts_rays = sets.iter().flat_map(|s| &s.maps).any(|j| j.kind == MapKind::Occlusion && !j.is_copied);
    let rays = source.tree.bounds().filter(|_| casts_rays).map(|bounds| {
        let count = options.rays.div_ceil(crate::cover::SAMPLES);
        let rays = Rays::new(count, options.occlusion_distance, options.seed, bounds.diagonal());
        (rays, Occluders::new(&source.flat.corners, &bounds))
    });
    let kinds: Vec<MapKind> = sets.iter().flat_map(|s| &s.maps).map(|job| job.kind).collect();
    source.prepare_textures(&kinds);
    let curvature = options.maps.contains(&MapKind::Curvature).then(|| Curvature::new(&source.flat));
    let search = Search { source: &source, light: &light, link: &link };
    let baker =
        Baker { search, tangents: &tangents, uvs: &uvs, rays: rays.as_ref(), curvature: curvature.as_ref() };
    let mut found = Found::default();
    let mut baked = Vec::with_capacity(sets.len());
    let count = sets.len() as f64;
    for (i, set) in sets.iter().enumerate() {
        let share = |done: f64| 0.15 + 0.85 * (i as f64 + done) / count;
        let (mut maps, own) = baker.bake(set, control, &share)?;
        pack_occlusion(&mut maps);
        found.add(&own);
        baked.push(baked_set(set, maps, lighter));
    }
    proceed(control, 1.0)?;
    let meshes = meshes.into_iter().map(|m| m.map(Arc::unwrap_or_clone)).collect();
    Ok(Baked { meshes, set_of_region, sets: baked, found, notes })
}

fn check(options: &BakeOptions) -> Result<(), BakeError> {
    let fault = |option: &'static str, problem: String| Err(BakeError::Option { option, problem });
    if options.maps.is_empty() {
        return fault("maps", "name at least one map".to_owned());
    }
    if options.size.is_some_and(|size| !BakeOptions::SIZES.contains(&size)) {
        let (low, high) = BakeOptions::SIZES.into_inner();
        return fault("size", format!("must be from {low} to {high} texels"));
    }
    if !BakeOptions::RAYS.contains(&options.rays) {
        let (low, high) = BakeOptions::RAYS.into_inner();
        return fault("rays", format!("must be from {low} to {high}"));
    }
    if options.occlusion_distance.is_some_and(|d| !(d > 0.0 && d.is_finite())) {
        return fault("occlusion distance", "must be above 0".to_owned());
    }
    Ok(())
}

/// Returns the memory that a bake takes: the program, two trees, the textures of the detailed model with their mipmaps,
/// the texels being baked of the largest set, and the maps of all sets with their PNGs.
fn memory_need(detailed: &Model, lighter: &Model, sets: &[FaceSet]) -> u64 {
    let faces = |model: &Model| model.meshes.iter().map(|m| m.mesh.face_count() as u64).sum::<u64>();
    let pixels: u64 = detailed.images.iter().map(|i| (i.width() * i.height()) as u64).sum();
    let texels = |set: &FaceSet| (set.size * set.size) as u64;
    let in_work = |set: &FaceSet| texels(set) * (16 * set.maps.len() as u64 + 32);
    let finished = |set: &FaceSet| texels(set) * 8 * set.maps.len() as u64;
    let of_sets = sets.iter().map(in_work).max().unwrap_or(0) + sets.iter().map(finished).sum::<u64>();
    (8 << 20) + 500 * (faces(detailed) + faces(lighter)) + 12 * pixels + of_sets
}

fn proceed(control: &mut dyn Control, done: f64) -> Result<(), BakeError> {
    if control.progress(done) == Verdict::Continue { Ok(()) } else { Err(BakeError::Cancelled) }
}

/// Runs work on other threads, as many as the caller's pool has, and forwards its questions whether to proceed to the
/// control, which only this thread may call. (This thread waits meanwhile, and may be the only one of the caller's pool.)
fn watched<T: Send>(
    control: &mut dyn Control,
    done: f64,
    work: impl FnOnce(&(dyn Fn() -> bool + Sync)) -> Result<T, BakeError> + Send,
) -> Result<T, BakeError> {
    let threads = rayon::ThreadPoolBuilder::new().num_threads(rayon::current_num_threads());
    let pool = if cfg!(target_arch = "wasm32") { None } else { threads.build().ok() };
    let Some(pool) = pool else {
        // A module, or a system without further threads: the control is asked before the work.
        proceed(control, done)?;
        return work(&|| true);
    };
    let proceeds = AtomicBool::new(true);
    let (asks, questions) = mpsc::channel();
    let mut made = Err(BakeError::Cancelled);
    pool.in_place_scope(|scope| {
        scope.spawn(|_| {
            // The questions end with this task.
            let asks = asks;
            made = work(&|| {
                // (Fails only after the last question.)
                let _ = asks.send(());
                proceeds.load(Ordering::Relaxed)
            });
        });
        for () in questions {
            if control.progress(done) != Verdict::Continue {
                proceeds.store(false, Ordering::Relaxed);
            }
        }
    });
    made
}

/// Returns the model with smooth normals on the meshes without any.
fn with_normals(model: &Model) -> Model {
    let meshes = model.meshes.iter().map(|m| {
        if m.mesh.normals().is_some() || m.mesh.face_count() == 0 {
            return m.mesh.clone();
        }
        let mut mesh = TriMesh::clone(&m.mesh);
        let of_vertex = vertex_normals(&mesh.surface(), |v| v);
        let normals = (0..mesh.wedge_count())
            .map(|w| of_vertex[mesh.vertex_of(lodsmith_core::WedgeId::new(w)).index()])
            .collect();
        mesh.set_normals(Some(normals)).expect("there is one for each wedge");
        Arc::new(mesh)
    });
    model.with_meshes(meshes.collect())
}

type FinishedMeshes = (Vec<Option<Arc<TriMesh>>>, Vec<Vec<usize>>);

/// Returns the meshes with their coordinates and tangents, and the set of each region.
fn finished_meshes(model: &Model, flat: &Flat, sets: &[FaceSet], uvs: &[[[f32; 2]; 3]]) -> FinishedMeshes {
    let mut set_of_face = vec![usize::MAX; flat.mesh.face_count()];
    for (s, set) in sets.iter().enumerate() {
        set.faces.iter().for_each(|&f| set_of_face[f] = s);
    }
    let bakes = |s: usize, kind: MapKind| sets[s].maps.iter().any(|job| job.kind == kind);
    let mut meshes: Vec<Option<Arc<TriMesh>>> = vec![None; model.meshes.len()];
    let mut set_of_region = vec![Vec::new(); model.meshes.len()];
    for piece in &flat.pieces {
        let mesh = &model.meshes[piece.mesh].mesh;
        let faces = piece.first_face..piece.first_face + mesh.face_count();
        let is_mirrored = piece.linear.determinant() < 0.0;
        // Corners in the order of the mesh, not of the flat surface.
        let order = if is_mirrored { [0, 2, 1] } else { [0, 1, 2] };
        let own_uvs: Vec<[[f32; 2]; 3]> = uvs[faces.clone()].iter().map(|uv| order.map(|k| uv[k])).collect();
        let normals = mesh.normals().unwrap_or_default();
        let normal = |f: usize, k: usize| normals[mesh.triangles()[f][k].index()];
        let needs_tangents = faces.clone().any(|f| bakes(set_of_face[f], MapKind::Normal));
        let tangents = needs_tangents.then(|| corner_tangents(mesh, &normal, &|f, k| own_uvs[f][k]));
        let mut made = with_corners(mesh, Some(&own_uvs), tangents.as_deref());
        if faces.clone().all(|f| bakes(set_of_face[f], MapKind::Color)) {
            // Vertex colours are in the map, and would count twice.
            made.set_colors(None).expect("removing cannot fail");
        }
        let regions = mesh.regions().map_or(1, |r| r.iter().map(|r| r.index() + 1).max().unwrap_or(1));
        let mut own_sets = vec![usize::MAX; regions];
        for f in faces {
            let region = mesh.regions().map_or(0, |r| r[f - piece.first_face].index());
            own_sets[region] = set_of_face[f];
        }
        let first = own_sets.iter().copied().find(|s| *s != usize::MAX).unwrap_or(0);
        own_sets.iter_mut().filter(|s| **s == usize::MAX).for_each(|s| *s = first);
        if sets[first].is_new && own_sets.iter().all(|s| *s == first) {
            made.set_regions(None).expect("removing cannot fail");
            own_sets = vec![first];
        }
        meshes[piece.mesh] = Some(Arc::new(made));
        set_of_region[piece.mesh] = own_sets;
    }
    (meshes, set_of_region)
}

/// Returns the tangents at the corners of the flat surface, in model coordinates.
fn world_tangents(model: &Model, flat: &Flat) -> Vec<[Vec4; 3]> {
    let mut all = vec![[Vec4::X; 3]; flat.mesh.face_count()];
    for piece in &flat.pieces {
        let mesh = &model.meshes[piece.mesh].mesh;
        let stored = mesh.further_attributes().iter().find(|a| a.semantic == Semantic::Tangent);
        let Some(stored) = stored else { continue };
        let faces = piece.first_face..piece.first_face + mesh.face_count();
        // The bitangent of the mesh is transformed: a mirror flips its side.
        let side = if piece.linear.determinant() < 0.0 { -1.0 } else { 1.0 };
        for (own, wedges) in all[faces.clone()].iter_mut().zip(&flat.mesh.triangles()[faces]) {
            *own = wedges.map(|w| {
                let t = &stored.values[(w.index() - piece.first_wedge) * 4..][..4];
                let direction = piece.linear * glam::DVec3::new(t[0].into(), t[1].into(), t[2].into());
                direction.normalize_or_zero().as_vec3().extend(side * t[3])
            });
        }
    }
    all
}

/// Puts occlusion into the free channel of the metallic-roughness map, so that one texture serves for both.
fn pack_occlusion(maps: &mut [BakedMap]) {
    let Some(from) = maps.iter().position(|m| m.kind == MapKind::Occlusion) else { return };
    let Some(to) = maps.iter().position(|m| m.kind == MapKind::MetallicRoughness) else { return };
    let Ok([from, to]) = maps.get_disjoint_mut([from, to]) else { return };
    if let (Texels::Rgba8(from), Texels::Rgba8(to)) = (&from.texels, &mut to.texels) {
        to.pixels_mut().iter_mut().zip(from.pixels()).for_each(|(to, from)| to[0] = from[0]);
    }
}

fn baked_set(set: &FaceSet, maps: Vec<BakedMap>, model: &Model) -> BakedSet {
    let known = set.material.map(|m| model.materials[m].clone());
    let mut look = known.unwrap_or_else(|| sets::material_of(set, model));
    look.textures_mut().into_iter().for_each(|t| *t = None);
    for map in &maps {
        match map.kind {
            MapKind::Color => look.base_color = [1.0; 4],
            MapKind::MetallicRoughness => (look.metallic, look.roughness) = (1.0, 1.0),
            MapKind::Emissive => look.emissive = [map.range.map_or(1.0, |white| white as f32); 3],
            MapKind::Normal => look.normal_scale = 1.0,
            _ => {}
        }
    }
    let (size, is_new_atlas) = (set.size, set.is_new);
    let of_model = set.materials.iter().map(|m| *m as usize).filter(|m| *m < model.materials.len());
    let replaced = if is_new_atlas { of_model.collect() } else { Vec::new() };
    BakedSet { name: set.name.clone(), material: set.material, replaced, look, size, is_new_atlas, maps }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Counts questions, and notes whether they come from one thread.
    struct Asked {
        thread: std::thread::ThreadId,
        count: usize,
    }

    impl Control for Asked {
        fn progress(&mut self, _: f64) -> Verdict {
            assert_eq!(std::thread::current().id(), self.thread);
            self.count += 1;
            Verdict::Continue
        }
    }

    #[test]
    fn watched_work_has_as_many_threads_as_the_pool_of_the_caller() {
        for threads in [1, 3] {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            let (found, count) = pool.install(|| {
                let mut control = Asked { thread: std::thread::current().id(), count: 0 };
                let work = |proceed: &(dyn Fn() -> bool + Sync)| {
                    assert!(rayon::join(proceed, proceed) == (true, true));
                    Ok(rayon::current_num_threads())
                };
                (watched(&mut control, 0.05, work).unwrap(), control.count)
            });
            assert_eq!((found, count), (threads, 2));
        }
    }
}
