//! Models on the GPU.

use std::ops::Range;
use std::sync::atomic::{AtomicU64, Ordering};

use egui_wgpu::wgpu;
use egui_wgpu::wgpu::util::DeviceExt;
use glam::DMat4;
use lodsmith_core::geometry::UnitFrame;
use lodsmith_core::mesh::creases::with_copies;
use lodsmith_core::model::{Instance, ModelMesh, Pose, Skin};
use lodsmith_core::{Model, TriMesh, WedgeId};
use rayon::prelude::*;

use super::buffer::{Item, Storage};
use super::context::Context;
use super::marks::Marks;
use super::pack::{self, AttributeLayout, ShadedMesh};
use super::texture::Surfaces;

/// A model on the GPU: its meshes, their placement and their materials.
///
/// Created by [`Context::upload`], on any thread. Dropping it frees the GPU memory.
pub struct DrawModel {
    context: Context,
    id: u64,
    revision: u64,
    /// Nodes, roots and skins, without meshes.
    hierarchy: Model,
    pub(super) meshes: Vec<DrawMesh>,
    at_rest: Vec<Instance>,
    pub(super) surfaces: Surfaces,
    pub(super) has_linear_colors: bool,
    preview: Option<Box<Self>>,
    /// The angle in degrees above which edges of meshes without normals are sharp.
    crease_deg: Option<f64>,
}

/// A mesh on the GPU.
pub(super) struct DrawMesh {
    pub(super) chunks: Vec<Chunk>,
    pages: Vec<Page>,
    pub(super) user_from_unit: DMat4,
    /// Radius of the bounding sphere around the origin of the unit frame.
    pub(super) radius: f64,
    pub(super) skinned: bool,
    pub(super) has_colors: bool,
    pub(super) has_own_normals: bool,
    pub(super) morph_targets: u32,
    pub(super) morph_weights: Vec<f32>,
    /// Largest of the values of [`DrawModel::set_heat`]; `None` without values.
    pub(super) heat_max: Option<f32>,
    materials: Vec<Option<usize>>,
    /// Per page, the marked edges whose ends it contains.
    marks: Vec<MarkedEdges>,
    frame: UnitFrame,
    row: AttributeLayout,
    face_count: usize,
    /// Number of wedges of the mesh, without copies.
    wedge_count: usize,
    /// The originals of the wedges that follow: copies with other normals.
    copies: Vec<WedgeId>,
}

/// Triangles of one draw call.
pub(super) struct Chunk {
    page: usize,
    indices: Storage,
    pub(super) bind: wgpu::BindGroup,
    pub(super) parts: Vec<MaterialRange>,
}

/// Edges that are drawn as lines.
struct MarkedEdges {
    page: usize,
    edges: Storage,
    bind: wgpu::BindGroup,
    /// Number of corners, six per line.
    corners: u32,
}

/// Triangles of one material.
pub(super) struct MaterialRange {
    pub(super) material: Option<usize>,
    /// Range of corners in the index buffer of the chunk.
    pub(super) corners: Range<u32>,
}

/// Buffers of wedges: all of the mesh, or those of one chunk.
struct Page {
    /// The wedges in buffer order; `None` for all wedges of the mesh.
    wedges: Option<Vec<WedgeId>>,
    info: wgpu::Buffer,
    corners: Storage,
    rows: Storage,
    heat: Storage,
    morphs: Storage,
}

/// The uniform of a page; the same order as in `vertex.wgsl`.
#[repr(C)]
#[derive(Clone, Copy, bytemuck::Pod, bytemuck::Zeroable)]
struct MeshInfo {
    stride: u32,
    uv: [u32; 2],
    color: u32,
    tangent: u32,
    joints: u32,
    joint_sets: u32,
    wedge_count: u32,
}

static NEXT_ID: AtomicU64 = AtomicU64::new(0);

impl Context {
    /// Uploads a model to the GPU. Slow for a large model; may run on a worker thread.
    ///
    /// Cost: O(n). Meshes without normals get computed ones, which break at the edges of [`Context::creases`].
    pub fn upload(&self, model: &Model) -> DrawModel {
        self.upload_with(model, self.creases().angle_deg(model.meshes.iter().map(|m| &*m.mesh)))
    }

    /// Uploads a model to the GPU, with edges that are sharp where those of another one are.
    pub(crate) fn upload_like(&self, model: &Model, other: &DrawModel) -> DrawModel {
        self.upload_with(model, other.crease_deg)
    }

    fn upload_with(&self, model: &Model, crease_deg: Option<f64>) -> DrawModel {
        let hierarchy = Model {
            nodes: model.nodes.clone(),
            roots: model.roots.clone(),
            skins: model.skins.clone(),
            ..Model::default()
        };
        let meshes = model.meshes.iter().map(|m| DrawMesh::new(self, m, crease_deg)).collect();
        let at_rest = hierarchy.instances(&Pose::default());
        let id = NEXT_ID.fetch_add(1, Ordering::Relaxed);
        let surfaces = Surfaces::new(self, &model.materials, &model.images);
        DrawModel {
            context: self.clone(),
            id,
            revision: 0,
            hierarchy,
            meshes,
            at_rest,
            surfaces,
            has_linear_colors: false,
            preview: None,
            crease_deg,
        }
    }
}

impl DrawModel {
    /// Sets whether vertex colours are linear, as in glTF, or sRGB.
    pub fn with_linear_colors(self, is_linear: bool) -> Self {
        Self { has_linear_colors: is_linear, ..self }
    }

    /// Returns the id of the model and the number of its changes: equal if the picture is the same.
    pub fn version(&self) -> (u64, u64) {
        (self.id, self.revision)
    }
    /// Returns a lighter model that may be drawn instead while drawing has to be fast.
    pub fn preview(&self) -> Option<&Self> {
        self.preview.as_deref()
    }
    /// Sets the model that [`DrawModel::preview`] returns.
    pub fn set_preview(&mut self, light: Self) {
        self.preview = Some(Box::new(light));
    }
    /// Returns the number of triangles of a mesh.
    ///
    /// # Panics
    /// If there is no such mesh.
    pub fn face_count(&self, mesh: usize) -> usize {
        self.meshes[mesh].face_count
    }
    /// Returns the number of triangles of all mesh instances at rest.
    pub fn triangles(&self) -> u64 {
        self.at_rest.iter().map(|i| self.meshes[i.mesh].face_count as u64).sum()
    }
    /// Returns the number of meshes.
    pub fn mesh_count(&self) -> usize {
        self.meshes.len()
    }

    /// Replaces the geometry of a mesh, keeping its materials and dropping its heat values. Buffers are
    /// reused if they are large enough.
    ///
    /// Cost: O(n).
    ///
    /// # Panics
    /// If there is no such mesh.
    pub fn replace_mesh(&mut self, mesh: usize, geometry: &TriMesh) {
        self.meshes[mesh].replace(&self.context, &pack::shaded(geometry, self.crease_deg, false));
        self.revision += 1;
    }

    /// Updates a mesh to another level, writing only the changed ranges if possible. `faces` and `wedges` are
    /// the changed ranges of triangles and of wedge attributes, including new ones; all positions and normals
    /// are rewritten. Coincident vertices must already be welded: normals are recomputed without searching
    /// for them. Heat values and marks are dropped.
    ///
    /// Returns true if writing ranges was enough. A mesh with several regions or buffers, with morph targets,
    /// with creases or with attributes other than before is replaced as a whole.
    ///
    /// # Panics
    /// If there is no such mesh, or a range goes beyond it.
    pub fn patch_mesh(
        &mut self,
        mesh: usize,
        geometry: &TriMesh,
        faces: &[Range<usize>],
        wedges: &[Range<usize>],
    ) -> bool {
        let has_creases = self.crease_deg.is_some() && geometry.normals().is_none();
        let is_enough = !has_creases && self.meshes[mesh].patch(&self.context, geometry, faces, wedges);
        if !is_enough {
            self.meshes[mesh].replace(&self.context, &pack::shaded(geometry, self.crease_deg, true));
        }
        self.revision += 1;
        is_enough
    }

    /// Sets the values for [`Shading::Heat`](lodsmith_render::Shading::Heat), one per wedge of a mesh; `None`
    /// removes them.
    ///
    /// # Panics
    /// If there is no such mesh, or not one value for each wedge.
    pub fn set_heat(&mut self, mesh: usize, values: Option<&[f32]>) {
        self.meshes[mesh].set_heat(&self.context, values);
        self.revision += 1;
    }

    /// Sets the edges for [`Look::borders`](lodsmith_render::Look::borders) and
    /// [`Look::defects`](lodsmith_render::Look::defects); they are dropped when the geometry is replaced.
    ///
    /// # Panics
    /// If there is no such mesh, or the marks belong to a larger mesh.
    pub fn set_marks(&mut self, mesh: usize, marks: &Marks) {
        self.meshes[mesh].set_marks(&self.context, marks);
        self.revision += 1;
    }

    pub(super) fn instances(&self, pose: &Pose) -> std::borrow::Cow<'_, [Instance]> {
        if pose.transforms.is_empty() {
            self.at_rest.as_slice().into()
        } else {
            self.hierarchy.instances(pose).into()
        }
    }
    pub(super) fn world_from_nodes(&self, pose: &Pose) -> Vec<DMat4> {
        self.hierarchy.world_from_nodes(pose)
    }
    /// Returns the skin of a node, if its mesh has joint weights.
    pub(super) fn skin(&self, instance: &Instance) -> Option<&Skin> {
        let skin = self.hierarchy.nodes[instance.node].skin?;
        self.meshes[instance.mesh].skinned.then(|| &self.hierarchy.skins[skin])
    }
    /// Returns the morph target weights at a node.
    pub(super) fn morph_weights<'a>(&'a self, pose: &'a Pose, instance: &Instance) -> &'a [f32] {
        let posed = pose.morph_weights.get(instance.node).and_then(Option::as_deref);
        let own = self.hierarchy.nodes[instance.node].morph_weights.as_deref();
        posed.or(own).unwrap_or(&self.meshes[instance.mesh].morph_weights)
    }
}

impl DrawMesh {
    fn new(context: &Context, mesh: &ModelMesh, crease_deg: Option<f64>) -> Self {
        let shaded = pack::shaded(&mesh.mesh, crease_deg, false);
        let mut new = Self::of(context, &shaded, &mesh.materials, None);
        new.morph_weights.clone_from(&mesh.morph_weights);
        new
    }

    fn replace(&mut self, context: &Context, mesh: &ShadedMesh<'_>) {
        let materials = std::mem::take(&mut self.materials);
        let morph_weights = std::mem::take(&mut self.morph_weights);
        let pages = std::mem::take(&mut self.pages);
        let chunks = std::mem::take(&mut self.chunks);
        *self = Self::of(context, mesh, &materials, Some((pages, chunks)));
        self.morph_weights = morph_weights;
    }

    /// Builds a mesh, reusing the buffers of an older one if there is one.
    fn of(
        context: &Context,
        ShadedMesh { mesh, normals, copies }: &ShadedMesh<'_>,
        materials: &[Option<usize>],
        old: Option<(Vec<Page>, Vec<Chunk>)>,
    ) -> Self {
        let frame = pack::frame_of(mesh);
        let row = AttributeLayout::of(mesh);
        let (faces, regions) = pack::by_region(mesh);
        let (old_pages, old_chunks) = old.unwrap_or_default();
        let (mut old_pages, mut old_chunks) = (old_pages.into_iter(), old_chunks.into_iter());
        let (mut pages, mut chunks, mut radius) = (Vec::new(), Vec::new(), 0f32);
        for cut in split_faces(&faces, mesh.wedge_count(), context) {
            if let Some(wedges) = cut.wedges {
                let wedges = (!wedges.is_empty() || pages.is_empty()).then_some(wedges);
                let (page, r) = Page::fill(context, mesh, &frame, &row, normals, wedges, old_pages.next());
                radius = radius.max(r);
                pages.push(page);
            } else if pages.is_empty() {
                let (page, r) = Page::fill(context, mesh, &frame, &row, normals, None, old_pages.next());
                radius = r;
                pages.push(page);
            }
            let page = pages.len() - 1;
            let parts = parts_within(&regions, &cut.faces, materials);
            chunks.push(Chunk::fill(context, page, &pages[page], &cut.indices, parts, old_chunks.next()));
        }
        Self {
            chunks,
            pages,
            user_from_unit: pack::user_from_unit(&frame),
            radius: f64::from(radius),
            skinned: row.joint_sets > 0,
            has_colors: mesh.colors().is_some(),
            has_own_normals: mesh.normals().is_some(),
            morph_targets: pack::morph_target_count(mesh),
            morph_weights: Vec::new(),
            heat_max: None,
            materials: materials.to_vec(),
            marks: Vec::new(),
            frame,
            row,
            face_count: mesh.face_count(),
            wedge_count: mesh.wedge_count() - copies.len(),
            copies: copies.clone(),
        }
    }

    fn patch(
        &mut self,
        context: &Context,
        mesh: &TriMesh,
        faces: &[Range<usize>],
        wedges: &[Range<usize>],
    ) -> bool {
        let split = context.buffer_limits;
        let fits = mesh.face_count() <= split.triangles && mesh.wedge_count() <= split.wedges;
        let is_plain =
            mesh.regions().is_none() && self.morph_targets == 0 && self.row == AttributeLayout::of(mesh);
        let has_own_normals = mesh.normals().is_some();
        let ([page], [chunk]) = (self.pages.as_mut_slice(), self.chunks.as_mut_slice()) else { return false };
        let is_whole = page.wedges.is_none() && chunk.parts.len() <= 1;
        if !(fits && is_plain && is_whole && has_own_normals == self.has_own_normals) {
            return false;
        }
        let mut moved = false;
        for range in faces {
            let bytes = bytemuck::cast_slice(&mesh.triangles()[range.clone()]);
            moved |= chunk.indices.write(context, 12 * range.start as u64, bytes);
        }
        // A fit moves all vertices of a level slightly.
        let ids = (0..mesh.wedge_count()).into_par_iter().map(WedgeId::new);
        let corners = pack::corners(mesh, &self.frame, &pack::quick_normals(mesh), ids);
        self.radius = self.radius.max(f64::from(pack::radius(&corners)));
        moved |= page.corners.write(context, 0, bytemuck::cast_slice(&corners));
        for range in wedges {
            let rows = pack::rows(mesh, &self.row, range.clone().map(WedgeId::new));
            let at = 4 * u64::from(self.row.stride) * range.start as u64;
            moved |= page.rows.write(context, at, bytemuck::cast_slice(&rows));
        }
        let material = self.materials.first().copied().flatten();
        chunk.parts = vec![MaterialRange { material, corners: 0..3 * mesh.face_count() as u32 }];
        self.face_count = mesh.face_count();
        self.wedge_count = mesh.wedge_count();
        self.heat_max = None;
        self.marks.clear();
        if moved {
            self.rebuild_bind_groups(context, 0);
        }
        true
    }

    fn set_heat(&mut self, context: &Context, values: Option<&[f32]>) {
        let Some(values) = values else {
            self.heat_max = None;
            return;
        };
        assert_eq!(values.len(), self.wedge_count, "one value for each wedge");
        let values = &with_copies(values, 1, &self.copies);
        for k in 0..self.pages.len() {
            let page = &mut self.pages[k];
            let moved = match &page.wedges {
                None => page.heat.replace(context, bytemuck::cast_slice(values)),
                Some(wedges) => {
                    let values: Vec<f32> = wedges.iter().map(|w| values[w.index()]).collect();
                    page.heat.replace(context, bytemuck::cast_slice(&values))
                }
            };
            if moved {
                self.rebuild_bind_groups(context, k);
            }
        }
        self.heat_max = Some(values.iter().copied().filter(|x| x.is_finite()).fold(0.0, f32::max));
    }

    fn set_marks(&mut self, context: &Context, marks: &Marks) {
        self.marks.clear();
        for (number, page) in self.pages.iter().enumerate() {
            let edges: Vec<[u32; 3]> = match &page.wedges {
                None => marks.edges.clone(),
                Some(wedges) => {
                    let mut local = vec![pack::NO_OFFSET; self.wedge_count];
                    let original =
                        |w: WedgeId| w.index().checked_sub(self.wedge_count).map_or(w, |k| self.copies[k]);
                    wedges.iter().enumerate().for_each(|(k, w)| local[original(*w).index()] = k as u32);
                    let here = |e: &[u32; 3]| [local[e[0] as usize], local[e[1] as usize], e[2]];
                    marks
                        .edges
                        .iter()
                        .map(here)
                        .filter(|e| e[0] != pack::NO_OFFSET && e[1] != pack::NO_OFFSET)
                        .collect()
                }
            };
            if edges.is_empty() {
                continue;
            }
            let storage = Storage::new(context, "marks", Item::Word, bytemuck::cast_slice(&edges));
            let bind = bind(context, page, &storage);
            self.marks.push(MarkedEdges {
                page: number,
                edges: storage,
                bind,
                corners: 6 * edges.len() as u32,
            });
        }
    }

    /// Returns the bind groups of marked edges, each with the number of corners of its lines.
    pub(super) fn marks(&self) -> impl Iterator<Item = (&wgpu::BindGroup, u32)> {
        self.marks.iter().map(|m| (&m.bind, m.corners))
    }

    /// Rebuilds the bind groups that use buffers of a page, after some of them were reallocated.
    fn rebuild_bind_groups(&mut self, context: &Context, page: usize) {
        for chunk in self.chunks.iter_mut().filter(|c| c.page == page) {
            chunk.bind = bind(context, &self.pages[page], &chunk.indices);
        }
        for marks in self.marks.iter_mut().filter(|m| m.page == page) {
            marks.bind = bind(context, &self.pages[page], &marks.edges);
        }
    }
}

impl Page {
    /// Returns a page, and the radius of the bounding sphere of its corners around the origin.
    fn fill(
        context: &Context,
        mesh: &TriMesh,
        frame: &UnitFrame,
        row: &AttributeLayout,
        normals: &[[f32; 3]],
        wedges: Option<Vec<WedgeId>>,
        old: Option<Self>,
    ) -> (Self, f32) {
        let all: Vec<WedgeId>;
        let ids: &[WedgeId] = match &wedges {
            Some(wedges) => wedges,
            None => {
                all = (0..mesh.wedge_count()).map(WedgeId::new).collect();
                &all
            }
        };
        let corners = pack::corners(mesh, frame, normals, ids.par_iter().copied());
        let rows = pack::rows(mesh, row, ids.iter().copied());
        let morphs = pack::morphs(mesh, frame, ids.iter().copied());
        let radius = pack::radius(&corners);
        let info = MeshInfo {
            stride: row.stride,
            uv: row.uv,
            color: row.color,
            tangent: row.tangent,
            joints: row.joints,
            joint_sets: row.joint_sets,
            wedge_count: ids.len() as u32,
        };
        let page = match old {
            None => {
                let usage = wgpu::BufferUsages::UNIFORM | wgpu::BufferUsages::COPY_DST;
                let contents = bytemuck::bytes_of(&info);
                let init = wgpu::util::BufferInitDescriptor { label: Some("mesh"), contents, usage };
                Self {
                    wedges,
                    info: context.device.create_buffer_init(&init),
                    corners: Storage::new(context, "corners", Item::Quad, bytemuck::cast_slice(&corners)),
                    rows: Storage::new(context, "rows", Item::Word, bytemuck::cast_slice(&rows)),
                    heat: Storage::new(context, "heat", Item::Word, &[]),
                    morphs: Storage::new(context, "morphs", Item::Word, bytemuck::cast_slice(&morphs)),
                }
            }
            Some(mut page) => {
                context.queue.write_buffer(&page.info, 0, bytemuck::bytes_of(&info));
                page.corners.replace(context, bytemuck::cast_slice(&corners));
                page.rows.replace(context, bytemuck::cast_slice(&rows));
                page.morphs.replace(context, bytemuck::cast_slice(&morphs));
                page.heat.replace(context, &[]);
                page.wedges = wedges;
                page
            }
        };
        (page, radius)
    }
}

impl Chunk {
    fn fill(
        context: &Context,
        page: usize,
        of: &Page,
        indices: &[[u32; 3]],
        parts: Vec<MaterialRange>,
        old: Option<Self>,
    ) -> Self {
        let bytes = bytemuck::cast_slice(indices);
        let indices = match old {
            None => Storage::new(context, "indices", Item::Word, bytes),
            Some(Self { mut indices, .. }) => {
                indices.replace(context, bytes);
                indices
            }
        };
        let bind = bind(context, of, &indices);
        Self { page, indices, bind, parts }
    }
}

/// Returns an empty mesh bind group for passes that read no mesh.
pub(super) fn empty_mesh_bind_group(context: &Context) -> wgpu::BindGroup {
    let [words, quads] = [Item::Word, Item::Quad].map(|item| Storage::new(context, "nothing", item, &[]));
    let info = context.device.create_buffer(&wgpu::BufferDescriptor {
        label: Some("nothing"),
        size: size_of::<MeshInfo>() as u64,
        usage: wgpu::BufferUsages::UNIFORM,
        mapped_at_creation: false,
    });
    let page = Page {
        wedges: None,
        info,
        corners: quads,
        rows: words.clone(),
        heat: words.clone(),
        morphs: words.clone(),
    };
    bind(context, &page, &words)
}

fn bind(context: &Context, page: &Page, indices: &Storage) -> wgpu::BindGroup {
    let resources = [
        page.info.as_entire_binding(),
        indices.resource(),
        page.corners.resource(),
        page.rows.resource(),
        page.heat.resource(),
        page.morphs.resource(),
    ];
    let entries: Vec<wgpu::BindGroupEntry<'_>> =
        (0..).zip(resources).map(|(binding, resource)| wgpu::BindGroupEntry { binding, resource }).collect();
    context.device.create_bind_group(&wgpu::BindGroupDescriptor {
        label: Some("mesh"),
        layout: &context.layouts.mesh,
        entries: &entries,
    })
}

/// Faces of one chunk.
struct ChunkFaces {
    faces: Range<usize>,
    indices: Vec<[u32; 3]>,
    /// The wedges of the chunk, if the mesh has more of them than fit into one buffer.
    wedges: Option<Vec<WedgeId>>,
}

/// Splits a list of faces so that each piece fits into its buffers.
fn split_faces(faces: &[[WedgeId; 3]], wedge_count: usize, context: &Context) -> Vec<ChunkFaces> {
    let split = context.buffer_limits;
    let most = split.triangles.max(1);
    if wedge_count <= split.wedges {
        let plain = |start: usize| {
            let end = (start + most).min(faces.len());
            let indices = bytemuck::cast_slice(&faces[start..end]).to_vec();
            ChunkFaces { faces: start..end, indices, wedges: None }
        };
        return (0..faces.len().max(1)).step_by(most).map(plain).collect();
    }
    let mut cuts = Vec::new();
    let mut local = vec![pack::NO_OFFSET; wedge_count];
    let mut start = 0;
    while start < faces.len() {
        let (mut indices, mut wedges): (Vec<[u32; 3]>, Vec<WedgeId>) = (Vec::new(), Vec::new());
        for face in &faces[start..] {
            if indices.len() == most || wedges.len() + 3 > split.wedges.max(3) {
                break;
            }
            indices.push(face.map(|w| {
                let local = &mut local[w.index()];
                if *local == pack::NO_OFFSET {
                    *local = wedges.len() as u32;
                    wedges.push(w);
                }
                *local
            }));
        }
        for w in &wedges {
            local[w.index()] = pack::NO_OFFSET;
        }
        let end = start + indices.len();
        cuts.push(ChunkFaces { faces: start..end, indices, wedges: Some(wedges) });
        start = end;
    }
    cuts
}

/// Returns the part of each region that lies in a range of faces, with its material.
fn parts_within(
    regions: &[(lodsmith_core::RegionId, Range<usize>)],
    faces: &Range<usize>,
    materials: &[Option<usize>],
) -> Vec<MaterialRange> {
    let clip = |(region, range): &(lodsmith_core::RegionId, Range<usize>)| {
        let (start, end) = (range.start.max(faces.start), range.end.min(faces.end));
        let corner = |face: usize| 3 * (face - faces.start) as u32;
        let material = materials.get(region.index()).copied().flatten();
        (start < end).then(|| MaterialRange { material, corners: corner(start)..corner(end) })
    };
    regions.iter().filter_map(clip).collect()
}
