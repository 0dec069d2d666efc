//! The detailed surface, and its properties at a point.

use glam::{DVec3, Vec2, Vec3, Vec4, Vec4Swizzles};
use lodsmith_core::geometry::triangle::double_area_normal;
use lodsmith_core::model::{AlphaMode, Material, TextureRef, VertexColors};
use lodsmith_core::spatial::Bvh;
use lodsmith_core::{Model, Semantic, WedgeId};
use lodsmith_render::{TexelKind, TextureSet, linear};

use crate::flat::{Flat, NO_MATERIAL};
use crate::options::MapKind;
use crate::tangents::corner_tangents;

/// A point on the detailed surface.
#[derive(Clone, Copy, Debug)]
pub(crate) struct SourcePoint {
    pub(crate) face: usize,
    pub(crate) weights: [f64; 3],
    /// Distance of the point from the lighter surface along the direction of the cage.
    pub(crate) height: f64,
}

/// Vectors on the surface from a sample to its neighbours in the two directions of a map.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Footprint {
    pub(crate) across: DVec3,
    pub(crate) down: DVec3,
}

/// The detailed surface.
pub(crate) struct Source<'a> {
    pub(crate) flat: Flat,
    pub(crate) tree: Bvh,
    model: &'a Model,
    plain: Material,
    textures: TextureSet,
    /// Tangents at the corners of each face; empty if no material has a normal map.
    tangents: Vec<[Vec4; 3]>,
    /// First texture coordinates at the corners of each face; empty if there are none.
    uvs: Vec<[Vec2; 3]>,
    /// The normal of each face, of unit length; zero for a face without area.
    face_normals: Vec<DVec3>,
}

impl<'a> Source<'a> {
    pub(crate) fn new(model: &'a Model, flat: Flat, needs_tangents: bool) -> Self {
        let tree = Bvh::new(&flat.mesh.surface());
        let textures = TextureSet::new(&model.images);
        let has_normal_map = model.materials.iter().any(|m| m.normal_texture.is_some());
        let tangents = if has_normal_map && needs_tangents { tangents(model, &flat) } else { Vec::new() };
        let corner_uvs = |all: &[[f32; 2]]| {
            let at = |w: WedgeId| Vec2::from(all[w.index()]);
            flat.mesh.triangles().iter().map(|&[a, b, c]| [at(a), at(b), at(c)]).collect()
        };
        let uvs = flat.mesh.uvs().map(corner_uvs).unwrap_or_default();
        let face_normals = flat.corners.iter().map(|c| double_area_normal(*c).normalize_or_zero()).collect();
        Self { tree, model, plain: Material::default(), textures, tangents, uvs, face_normals, flat }
    }

    /// Builds the textures that maps of these kinds read, before the parallel work.
    pub(crate) fn prepare_textures(&self, kinds: &[MapKind]) {
        let reads = |of: &[MapKind]| of.iter().any(|kind| kinds.contains(kind));
        let used = self.model.materials.iter().flat_map(|m| {
            [
                (&m.base_color_texture, TexelKind::Colors, &[MapKind::Color][..]),
                (&m.metallic_roughness_texture, TexelKind::Numbers, &[MapKind::MetallicRoughness]),
                (&m.normal_texture, TexelKind::Numbers, &[MapKind::Normal, MapKind::ObjectNormal]),
                (&m.occlusion_texture, TexelKind::Numbers, &[MapKind::Occlusion]),
                (&m.emissive_texture, TexelKind::Colors, &[MapKind::Emissive]),
            ]
        });
        let used = used.filter(|(_, _, maps)| reads(maps));
        self.textures.prepare(used.filter_map(|(reference, kind, _)| Some((reference.as_ref()?, kind))));
    }

    pub(crate) fn material(&self, face: usize) -> &Material {
        match self.flat.materials[face] {
            NO_MATERIAL => &self.plain,
            m => &self.model.materials[m as usize],
        }
    }

    /// The normal of a face, of unit length; zero for a face without area.
    #[inline]
    pub(crate) fn face_normal(&self, face: usize) -> DVec3 {
        self.face_normals[face]
    }

    pub(crate) fn point(&self, at: &SourcePoint) -> DVec3 {
        let [a, b, c] = self.flat.corners(at.face);
        a * at.weights[0] + b * at.weights[1] + c * at.weights[2]
    }

    /// The normal without a normal map.
    pub(crate) fn smooth_normal(&self, at: &SourcePoint) -> Vec3 {
        let [a, b, c] = self.flat.normals[at.face];
        let [u, v, w] = at.weights.map(|x| x as f32);
        (a * u + b * v + c * w).normalize_or(a)
    }

    /// The normal that shading uses.
    pub(crate) fn normal(&self, at: &SourcePoint, footprint: &Footprint) -> Vec3 {
        let smooth = self.smooth_normal(at);
        let material = self.material(at.face);
        let Some(map) = material.normal_texture.filter(|_| !self.tangents.is_empty()) else { return smooth };
        let Some(texel) = self.texel(&map, TexelKind::Numbers, at, footprint) else { return smooth };
        let [a, b, c] = self.tangents[at.face];
        let [u, v, w] = at.weights.map(|x| x as f32);
        let [na, nb, nc] = self.flat.normals[at.face];
        let normal = na * u + nb * v + nc * w;
        let tangent = a * u + b * v + c * w;
        let bitangent = normal.cross(tangent.xyz()) * a.w;
        let [x, y, z] = [0, 1, 2].map(|k| texel[k] * 2.0 - 1.0);
        let scale = material.normal_scale;
        (tangent.xyz() * (x * scale) + bitangent * (y * scale) + normal * z).normalize_or(smooth)
    }

    /// Linear base colour and opacity.
    pub(crate) fn color(&self, at: &SourcePoint, footprint: &Footprint) -> [f32; 4] {
        let material = self.material(at.face);
        let mut color = Vec4::from(material.base_color) * Vec4::from(self.vertex_color(at));
        if let Some(map) = &material.base_color_texture {
            let texel = self.texel(map, TexelKind::Colors, at, footprint);
            color *= texel.map_or(Vec4::ONE, Vec4::from);
        }
        if material.alpha == AlphaMode::Opaque {
            color.w = 1.0;
        }
        color.to_array()
    }

    /// Linear colour of the vertices; white without any.
    pub(crate) fn vertex_color(&self, at: &SourcePoint) -> [f32; 4] {
        let mesh = &self.flat.mesh;
        let Some(colors) = mesh.colors() else { return [1.0; 4] };
        let corners = mesh.triangles()[at.face].map(|w| colors[w.index()]);
        let is_linear = self.model.vertex_colors == VertexColors::Linear;
        let light = corners.map(|[r, g, b, a]| {
            if is_linear {
                [r, g, b, a]
            } else {
                let [r, g, b] = [r, g, b].map(linear::decoded);
                [r, g, b, a]
            }
        });
        [0, 1, 2, 3].map(|k| (0..3).map(|c| light[c][k] * at.weights[c] as f32).sum())
    }

    /// Metallic and roughness.
    pub(crate) fn metallic_roughness(&self, at: &SourcePoint, footprint: &Footprint) -> [f32; 2] {
        let material = self.material(at.face);
        let map = material.metallic_roughness_texture.as_ref();
        let texel = map.and_then(|map| self.texel(map, TexelKind::Numbers, at, footprint));
        let [_, roughness, metallic, _] = texel.unwrap_or([1.0; 4]);
        [material.metallic * metallic, material.roughness * roughness]
    }

    /// Linear emitted light.
    pub(crate) fn emissive(&self, at: &SourcePoint, footprint: &Footprint) -> [f32; 3] {
        let material = self.material(at.face);
        let map = material.emissive_texture.as_ref();
        let texel = map.and_then(|map| self.texel(map, TexelKind::Colors, at, footprint));
        let texel = texel.unwrap_or([1.0; 4]);
        [0, 1, 2].map(|k| material.emissive[k] * texel[k])
    }

    /// The share of light that the occlusion map of the source lets through.
    pub(crate) fn occlusion(&self, at: &SourcePoint, footprint: &Footprint) -> f32 {
        let map = self.material(at.face).occlusion_texture.as_ref();
        map.and_then(|map| self.texel(map, TexelKind::Numbers, at, footprint)).map_or(1.0, |texel| texel[0])
    }

    /// Samples a texture, filtered over the footprint. `None` if the surface lacks its coordinates.
    fn texel(
        &self,
        map: &TextureRef,
        kind: TexelKind,
        at: &SourcePoint,
        footprint: &Footprint,
    ) -> Option<[f32; 4]> {
        let uvs = self.uvs(at.face, map.uv_set)?;
        let weights = at.weights.map(|x| x as f32);
        let uv = uvs[0] * weights[0] + uvs[1] * weights[1] + uvs[2] * weights[2];
        let [of_u, of_v] = uv_gradient(self.flat.corners(at.face), uvs);
        // Directions: without the translation of the transform.
        let [[a, b, _], [c, d, _]] = map.transform;
        let moved = |along: DVec3| {
            let (u, v) = (of_u.dot(along) as f32, of_v.dot(along) as f32);
            [a * u + b * v, c * u + d * v]
        };
        let (across, down) = (moved(footprint.across), moved(footprint.down));
        let texture = self.textures.get(map, kind)?;
        Some(texture.at(map.look_up(uv.to_array()), across, down, map.sampler))
    }

    fn uvs(&self, face: usize, set: u8) -> Option<[Vec2; 3]> {
        if set == 0 {
            return self.uvs.get(face).copied();
        }
        let piece = self.flat.piece_of(face);
        let mesh = &self.model.meshes[piece.mesh].mesh;
        let further = mesh.further_attributes().iter().find(|a| a.semantic == Semantic::Uv(set))?;
        let wedges = self.flat.mesh.triangles()[face];
        Some(wedges.map(|w| {
            let own = &further.values[(w.index() - piece.first_wedge) * further.width..];
            Vec2::new(own[0], own[1])
        }))
    }
}

/// Returns the gradients of u and v on a triangle; zero for one without area.
fn uv_gradient([a, b, c]: [DVec3; 3], uvs: [Vec2; 3]) -> [DVec3; 2] {
    let (ab, ac) = (b - a, c - a);
    let normal = ab.cross(ac);
    let area_sq = normal.length_squared();
    if area_sq.is_nan() || area_sq <= 0.0 {
        return [DVec3::ZERO; 2];
    }
    // The dual basis of the two edges.
    let (along_ab, along_ac) = (ac.cross(normal) / area_sq, normal.cross(ab) / area_sq);
    let [d1, d2] = [uvs[1] - uvs[0], uvs[2] - uvs[0]];
    let gradient = |of_ab: f32, of_ac: f32| along_ab * f64::from(of_ab) + along_ac * f64::from(of_ac);
    [gradient(d1.x, d2.x), gradient(d1.y, d2.y)]
}

/// Returns the tangents at the corners of all faces: from the file if it has them, else by MikkTSpace.
fn tangents(model: &Model, flat: &Flat) -> Vec<[Vec4; 3]> {
    let mut all = Vec::with_capacity(flat.mesh.face_count());
    for (i, piece) in flat.pieces.iter().enumerate() {
        let end = flat.pieces.get(i + 1).map_or(flat.mesh.face_count(), |next| next.first_face);
        let source = &model.meshes[piece.mesh];
        let mesh = &*source.mesh;
        let has_map = |m: &Option<usize>| m.is_some_and(|m| model.materials[m].normal_texture.is_some());
        if !source.materials.iter().any(has_map) || mesh.uvs().is_none() {
            all.resize(end, [Vec4::X; 3]);
            continue;
        }
        let stored = mesh.further_attributes().iter().find(|a| a.semantic == Semantic::Tangent);
        let computed = stored.is_none().then(|| {
            let uvs = mesh.uvs().unwrap_or_default();
            let wedge = |f: usize, k: usize| mesh.triangles()[f][k].index();
            let normal = |f: usize, k: usize| match mesh.normals() {
                Some(all) => all[wedge(f, k)],
                // (Exchanged corners of mirrored pieces matter little here.)
                None => flat.normals[piece.first_face + f][k].to_array(),
            };
            corner_tangents(mesh, &normal, &|f, k| uvs[wedge(f, k)])
        });
        let is_mirrored = piece.linear.determinant() < 0.0;
        let order = if is_mirrored { [0, 2, 1] } else { [0, 1, 2] };
        for (f, wedges) in mesh.triangles().iter().enumerate() {
            all.push(order.map(|k| {
                let t: [f32; 4] = match (&computed, stored) {
                    (Some(all), _) => all[f][k],
                    (None, Some(stored)) => std::array::from_fn(|i| stored.of(wedges[k])[i]),
                    (None, None) => [1.0, 0.0, 0.0, 1.0],
                };
                let direction = piece.linear * Vec3::new(t[0], t[1], t[2]).as_dvec3();
                let sign = if is_mirrored { -t[3] } else { t[3] };
                direction.normalize_or_zero().as_vec3().extend(sign)
            }));
        }
    }
    all
}
