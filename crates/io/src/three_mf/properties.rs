//! The properties of the triangles of a mesh: textures, colours and materials.

use std::collections::{BTreeMap, BTreeSet, HashMap};

use lodsmith_core::mesh::Semantic;
use lodsmith_core::model::TextureRef;
use lodsmith_core::{TriMesh, WedgeId};

use super::looks::{Looks, LostParts, key_of};
use crate::attributes::srgb_of_linear;

/// Looks of the triangles of a mesh.
pub(super) struct Properties<'a> {
    pub(super) mesh: &'a TriMesh,
    looks: &'a Looks,
    /// The material of each region; one entry for a mesh without regions.
    of_region: &'a [Option<usize>],
    /// Distinct colours of wedges in sRGB, and the index of each wedge's colour; empty if no triangle shows
    /// any.
    pub(super) colors: Vec<[u8; 4]>,
    color_of: Vec<u32>,
    /// Texture coordinates by texture.
    pub(super) coordinates: Vec<TextureCoordinates>,
    /// Materials with a texture, and their entries of `coordinates`.
    textured: BTreeMap<usize, usize>,
    /// Materials that triangles show.
    pub(super) materials: BTreeSet<usize>,
    /// True if some triangles have no properties.
    has_bare: bool,
    /// True if other meshes of the same object have properties.
    is_beside_others: bool,
}

/// The coordinates of a texture.
pub(super) struct TextureCoordinates {
    pub(super) texture: TextureRef,
    /// The wedges that use it, ascending.
    pub(super) wedges: Vec<u32>,
}

/// The property that a triangle shows.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(super) enum Shown {
    Nothing,
    /// A material.
    Material(usize),
    /// The colours of its wedges.
    Colors,
    /// An entry of [`Properties::coordinates`].
    Texture(usize),
}

impl<'a> Properties<'a> {
    pub(super) fn new(
        mesh: &'a TriMesh,
        looks: &'a Looks,
        of_region: &'a [Option<usize>],
        (lost, is_rounded): (&mut LostParts, &mut bool),
    ) -> Self {
        let mut new = Self {
            mesh,
            looks,
            of_region,
            colors: Vec::new(),
            color_of: Vec::new(),
            coordinates: Vec::new(),
            textured: BTreeMap::new(),
            materials: BTreeSet::new(),
            has_bare: false,
            is_beside_others: false,
        };
        new.find_textures();
        let mut has_colors = false;
        for face in 0..mesh.face_count() {
            let material = new.material_of(face);
            let is_white = new.is_white(face);
            let shown = new.shown(face);
            match shown {
                Shown::Nothing => new.has_bare = true,
                Shown::Material(material) => {
                    new.materials.insert(material);
                }
                Shown::Colors => has_colors = true,
                Shown::Texture(group) => {
                    new.coordinates[group].wedges.extend(mesh.triangles()[face].map(|w| w.0));
                    lost.add(!is_white, "colours of triangles with a texture");
                }
            }
            let Some(look) = material.map(|m| &looks.all[m]) else { continue };
            if shown == Shown::Colors {
                let is_tinted = !looks.has_linear_colors && look.color[..3] != [1.0; 3];
                lost.add(is_tinted || !look.is_dull(), "materials of triangles with colours");
            } else if matches!(shown, Shown::Texture(_)) {
                lost.add(!look.is_dull(), "metalness and roughness of materials with a texture");
            }
        }
        for coordinates in &mut new.coordinates {
            coordinates.wedges.sort_unstable();
            coordinates.wedges.dedup();
        }
        new.coordinates_lost(lost);
        if has_colors {
            new.number_colors(is_rounded);
        }
        new
    }

    fn find_textures(&mut self) {
        let mut known = HashMap::new();
        for &material in self.of_region.iter().flatten() {
            let texture = self.looks.all[material].texture;
            let Some(texture) = texture.filter(|t| uvs(self.mesh, t.uv_set).is_some()) else { continue };
            let group = *known.entry(key_of(&texture)).or_insert_with(|| {
                self.coordinates.push(TextureCoordinates { texture, wedges: Vec::new() });
                self.coordinates.len() - 1
            });
            self.textured.insert(material, group);
        }
    }

    fn coordinates_lost(&self, lost: &mut LostParts) {
        lost.add(self.mesh.normals().is_some(), "normals of vertices");
        let used: BTreeSet<u8> = self.used_coordinates().map(|c| c.texture.uv_set).collect();
        let is_unused = |set: u8| uvs(self.mesh, set).is_some() && !used.contains(&set);
        lost.add((0..=u8::MAX).any(is_unused), "texture coordinates without a texture");
    }

    /// Returns the coordinates that triangles use.
    pub(super) fn used_coordinates(&self) -> impl Iterator<Item = &TextureCoordinates> {
        self.coordinates.iter().filter(|c| !c.wedges.is_empty())
    }

    /// Numbers the colours of all wedges.
    fn number_colors(&mut self, is_rounded: &mut bool) {
        let mut numbers = HashMap::new();
        let tints = self.tints();
        for (wedge, &color) in self.mesh.colors().unwrap_or_default().iter().enumerate() {
            let tint = tints.as_ref().map_or([1.0; 4], |tints| tints[wedge]);
            let [r, g, b, a] = [0, 1, 2, 3].map(|k| color[k] * tint[k]);
            let shown = if self.looks.has_linear_colors {
                let [r, g, b] = [r, g, b].map(srgb_of_linear);
                [r, g, b, a]
            } else {
                [r, g, b, a]
            };
            let bytes = shown.map(|x| {
                let byte = byte(x);
                *is_rounded |= f32::from(byte) / 255.0 != x;
                byte
            });
            self.color_of.push(*numbers.entry(bytes).or_insert_with(|| {
                self.colors.push(bytes);
                self.colors.len() as u32 - 1
            }));
        }
    }

    /// Returns the colour factor of each wedge, if the materials of coloured triangles have any. A wedge of several
    /// materials gets the factor of the last.
    fn tints(&self) -> Option<Vec<[f32; 4]>> {
        let is_tinting = |m: &usize| self.looks.all[*m].color != [1.0; 4];
        if !self.looks.has_linear_colors || !self.of_region.iter().flatten().any(is_tinting) {
            return None;
        }
        let mut tints = vec![[1.0; 4]; self.mesh.wedge_count()];
        for (face, wedges) in self.mesh.triangles().iter().enumerate() {
            if let (Shown::Colors, Some(material)) = (self.shown(face), self.material_of(face)) {
                wedges.iter().for_each(|w| tints[w.index()] = self.looks.all[material].color);
            }
        }
        Some(tints)
    }

    /// Returns true unless the corners of a face have colours other than white.
    fn is_white(&self, face: usize) -> bool {
        let Some(colors) = self.mesh.colors() else { return true };
        self.mesh.triangles()[face].iter().all(|w| colors[w.index()] == [1.0; 4])
    }

    /// Returns the material of a face.
    fn material_of(&self, face: usize) -> Option<usize> {
        let region = self.mesh.regions().map_or(0, |regions| regions[face].index());
        self.of_region.get(region).copied().flatten()
    }

    /// Returns the property of a face: a texture, else colours other than white, else a material other than white, else
    /// colours, else a material.
    pub(super) fn shown(&self, face: usize) -> Shown {
        let material = self.material_of(face);
        match material.and_then(|m| self.textured.get(&m)) {
            Some(&group) => Shown::Texture(group),
            None if !self.is_white(face) => Shown::Colors,
            None => match material {
                Some(m) if self.mesh.colors().is_none() || !self.looks.all[m].is_plain() => {
                    Shown::Material(m)
                }
                None if self.mesh.colors().is_none() => Shown::Nothing,
                _ => Shown::Colors,
            },
        }
    }

    /// Returns the number of kinds of triangles: by material, by texture, with colours, and without properties.
    pub(super) fn kind_count(&self) -> usize {
        let others = usize::from(!self.colors.is_empty()) + usize::from(self.has_bare);
        self.materials.len() + self.used_coordinates().count() + others
    }

    /// Returns true if some triangles have properties, and others none.
    pub(super) fn is_mixed(&self) -> bool {
        self.has_bare && (self.is_beside_others || self.kind_count() > 1)
    }

    /// Returns true if some triangles have properties.
    pub(super) fn has_any(&self) -> bool {
        self.kind_count() > usize::from(self.has_bare)
    }

    /// Notes that other meshes of the same object have properties, so that triangles without any need the default.
    pub(super) fn set_beside_others(&mut self) {
        self.is_beside_others = true;
    }

    /// Returns the entry of the colour of a wedge.
    pub(super) fn color_entry(&self, wedge: WedgeId) -> u32 {
        self.color_of[wedge.index()]
    }
}

impl TextureCoordinates {
    /// Returns the entry of a wedge that uses the texture.
    pub(super) fn entry(&self, wedge: WedgeId) -> u32 {
        // If all wedges use it, entry and wedge numbers are equal.
        if self.wedges.get(wedge.index()) == Some(&wedge.0) {
            return wedge.0;
        }
        self.wedges.partition_point(|&w| w < wedge.0) as u32
    }

    /// Returns the coordinates in the image, from its lower left corner, in the order of the entries.
    pub(super) fn values<'a>(&'a self, mesh: &'a TriMesh) -> impl Iterator<Item = [f32; 2]> + 'a {
        let all = uvs(mesh, self.texture.uv_set).unwrap_or_default();
        let is_plain = self.texture.transform == TextureRef::PLAIN;
        self.wedges.iter().map(move |&w| {
            let uv = all[w as usize];
            if is_plain { uv } else { self.texture.look_up(uv) }
        })
    }
}

/// Returns a set of texture coordinates.
fn uvs(mesh: &TriMesh, set: u8) -> Option<&[[f32; 2]]> {
    if set == 0 {
        return mesh.uvs();
    }
    let further = mesh.further_attributes().iter().find(|a| a.semantic == Semantic::Uv(set))?;
    Some(further.values.as_chunks().0)
}

/// Returns a colour value as a byte.
pub(super) fn byte(x: f32) -> u8 {
    (x * 255.0).round().clamp(0.0, 255.0) as u8
}

/// Returns a linear colour with opacity as bytes of sRGB.
pub(super) fn bytes_of_linear([r, g, b, a]: [f32; 4]) -> [u8; 4] {
    let [r, g, b] = [r, g, b].map(srgb_of_linear);
    [r, g, b, a].map(byte)
}
