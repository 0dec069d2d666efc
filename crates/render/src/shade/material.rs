//! Shading with glTF 2.0 materials: base colour, metallic and roughness, normal map, occlusion, emission.

use glam::{DVec3, Vec2, Vec3};
use lodsmith_core::model::{AlphaMode, Material, TextureRef};
use lodsmith_core::{Semantic, WedgeId};

use super::{Shader, SurfacePoint};
use crate::texture::TexelKind;

/// Reflectance of a dielectric surface at normal incidence. (As in glTF 2.0.)
const DIELECTRIC_REFLECTANCE: f32 = 0.04;
/// Minimum roughness: a perfect mirror would show lights as points, which no sample hits.
const MIN_ROUGHNESS: f32 = 0.08;

/// Texture coordinates at a point, and at the neighbouring pixels to the right and below.
#[derive(Clone, Copy)]
struct TexturePoint {
    uv: [f32; 2],
    across: [f32; 2],
    down: [f32; 2],
}

impl Shader<'_> {
    /// Returns the material of a face; `None` for a plain one.
    fn material(&self, hit: &SurfacePoint<'_>) -> Option<&Material> {
        let mesh = &hit.placed.drawn.mesh;
        let region = mesh.regions().map_or(0, |r| r[hit.face].index());
        let index = (*hit.placed.drawn.materials.get(region)?)?;
        self.subject.surfaces.materials.get(index)
    }

    /// True if an alpha-tested face is opaque at a point of the screen.
    pub(crate) fn is_there(&self, whole: u32, x: f32, y: f32) -> bool {
        let hit = self.hit(whole, x, y);
        let Some(material) = self.material(&hit) else { return true };
        match material.alpha {
            AlphaMode::Mask(cutoff) => self.base_color(&hit, Some(material)).1 >= cutoff,
            _ => true,
        }
    }

    pub(super) fn textured(&self, hit: &SurfacePoint<'_>) -> (Vec3, f32) {
        let Some(material) = self.material(hit) else {
            let (base, _) = self.base_color(hit, None);
            return (self.lit_one(base, self.normal(hit), hit), 1.0);
        };
        let (base, alpha) = self.base_color(hit, Some(material));
        let alpha = if material.alpha == AlphaMode::Blend { alpha } else { 1.0 };
        let own = Vec3::from(material.emissive) * self.colors(hit, &material.emissive_texture).0;
        if material.unlit {
            return (base, alpha);
        }
        let rough_metal = self.numbers(hit, &material.metallic_roughness_texture);
        let [_, g, b, _] = rough_metal.unwrap_or([1.0; 4]);
        let (roughness, metallic) = (material.roughness * g, (material.metallic * b).clamp(0.0, 1.0));
        let open = self.numbers(hit, &material.occlusion_texture).map_or(1.0, |c| c[0]);
        let n = self.mapped_normal(hit, material);
        (self.reflected(hit, base, n, roughness, metallic, open) + own, alpha)
    }

    /// Returns linear colour and opacity before lighting.
    fn base_color(&self, hit: &SurfacePoint<'_>, material: Option<&Material>) -> (Vec3, f32) {
        let (color, alpha) = self.vertex_color(hit.placed, hit.wedges, hit.b);
        let Some(material) = material else { return (color, alpha) };
        let has_colors = hit.placed.drawn.mesh.colors().is_some();
        let (color, alpha) = if has_colors { (color, alpha) } else { (Vec3::ONE, 1.0) };
        let [r, g, b, a] = material.base_color;
        let (image, opacity) = self.colors(hit, &material.base_color_texture);
        (color * Vec3::new(r, g, b) * image, alpha * a * opacity)
    }

    /// Returns the reflected light of all lights. A light of intensity one makes white paper white.
    fn reflected(
        &self,
        hit: &SurfacePoint<'_>,
        base: Vec3,
        n: Vec3,
        roughness: f32,
        metallic: f32,
        open: f32,
    ) -> Vec3 {
        let place = self.place(hit);
        let to_eye = self.to_eye(place);
        let straight = Vec3::splat(DIELECTRIC_REFLECTANCE).lerp(base, metallic);
        let matt = base * (1.0 - metallic);
        let roughness = roughness.clamp(MIN_ROUGHNESS, 1.0);
        let a2 = roughness.powi(4);
        let n_eye = n.dot(to_eye).max(1e-3);
        let mut light = Vec3::ZERO;
        self.each_light(place, |to_light, color| {
            let along = n.dot(to_light);
            if along <= 0.0 {
                return;
            }
            let half = (to_light + to_eye).normalize_or(n);
            let n_half = n.dot(half).max(0.0);
            let spread = n_half * n_half * (a2 - 1.0) + 1.0;
            let facets = a2 / (spread * spread).max(1e-9);
            let hidden = along * (n_eye * n_eye * (1.0 - a2) + a2).sqrt()
                + n_eye * (along * along * (1.0 - a2) + a2).sqrt();
            let fresnel = straight + (Vec3::ONE - straight) * (1.0 - to_eye.dot(half).max(0.0)).powi(5);
            let specular = fresnel * (facets * 0.5 / hidden.max(1e-4));
            light += color * along * (matt * (Vec3::ONE - fresnel) + specular);
        });
        let mirrored = 2.0 * n.dot(to_eye) * n - to_eye;
        let rim_over =
            |straight: Vec3| (Vec3::splat(1.0 - roughness).max(straight) - straight) * (1.0 - n_eye).powi(5);
        if let Some(environment) = &self.environment {
            let [n, mirrored] = [n, mirrored].map(|v| self.projection.direction_to_world(v));
            // Dielectric and metallic parts mixed: each reflects all incoming light if it is white.
            let plain = Vec3::splat(DIELECTRIC_REFLECTANCE);
            let plain = plain + rim_over(plain);
            let reflected = plain.lerp(base + rim_over(base), metallic);
            let around = environment.mirrored(mirrored, roughness) * reflected;
            return light + (environment.matt(n) * matt * (Vec3::ONE - plain) + around) * open;
        }
        // Without an environment, a sky above a ground is reflected; the rougher the surface, the more both
        // are mixed.
        let around = self.ambient(mirrored.lerp(n, roughness));
        light + (self.ambient(n) * matt + around * (straight + rim_over(straight))) * open
    }

    fn mapped_normal(&self, hit: &SurfacePoint<'_>, material: &Material) -> Vec3 {
        let n = self.normal(hit);
        let Some([x, y, z, _]) = self.numbers(hit, &material.normal_texture) else { return n };
        let Some((t, b)) = self.tangents(hit, n, &material.normal_texture) else { return n };
        let scale = material.normal_scale;
        let (x, y, z) = ((2.0 * x - 1.0) * scale, (2.0 * y - 1.0) * scale, 2.0 * z - 1.0);
        (t * x + b * y + n * z).normalize_or(n)
    }

    /// Returns the tangent and bitangent, perpendicular to the normal.
    fn tangents(&self, hit: &SurfacePoint<'_>, n: Vec3, image: &Option<TextureRef>) -> Option<(Vec3, Vec3)> {
        let mesh = &hit.placed.drawn.mesh;
        let set = image.as_ref().map_or(0, |i| i.uv_set);
        let own = mesh.further_attributes().iter().find(|a| a.semantic == Semantic::Tangent && a.width == 4);
        if let Some(own) = own.filter(|_| set == 0) {
            let mut sum = [0f32; 4];
            for (w, b) in hit.wedges.iter().zip(hit.b) {
                own.of(*w).iter().zip(&mut sum).for_each(|(x, s)| *s += x * b);
            }
            let linear = hit.placed.to_view.linear;
            let t = linear * DVec3::new(sum[0].into(), sum[1].into(), sum[2].into());
            let t = t.try_normalize()?.as_vec3();
            let t = (t - n * n.dot(t)).try_normalize()?;
            // The sign of the bitangent refers to the normal in the file.
            let outer = if n.dot(self.own_normal(hit)) < 0.0 { -n } else { n };
            return Some((t, outer.cross(t) * sum[3].signum()));
        }
        // Otherwise computed from the texture coordinates of the face.
        let uv = |w: WedgeId| uv_of(hit, w, set).map(Vec2::from);
        let [u0, u1, u2] = [uv(hit.wedges[0])?, uv(hit.wedges[1])?, uv(hit.wedges[2])?];
        let (d1, d2) = (u1 - u0, u2 - u0);
        let turn = d1.perp_dot(d2);
        let [p0, p1, p2] = hit.placed.in_view(hit.face);
        let (e1, e2) = ((p1 - p0).as_vec3(), (p2 - p0).as_vec3());
        let side = turn.signum();
        let t = ((e1 * d2.y - e2 * d1.y) * side).try_normalize()?;
        let b = ((e2 * d1.x - e1 * d2.x) * side).try_normalize()?;
        let t = (t - n * n.dot(t)).try_normalize()?;
        Some((t, (b - n * n.dot(b) - t * t.dot(b)).try_normalize()?))
    }

    /// Returns linear colour and opacity of a texture; white if there is none.
    fn colors(&self, hit: &SurfacePoint<'_>, image: &Option<TextureRef>) -> (Vec3, f32) {
        let [r, g, b, a] = self.looked_up(hit, image, TexelKind::Colors).unwrap_or([1.0; 4]);
        (Vec3::new(r, g, b), a)
    }

    fn numbers(&self, hit: &SurfacePoint<'_>, image: &Option<TextureRef>) -> Option<[f32; 4]> {
        self.looked_up(hit, image, TexelKind::Numbers)
    }

    fn looked_up(
        &self,
        hit: &SurfacePoint<'_>,
        image: &Option<TextureRef>,
        meaning: TexelKind,
    ) -> Option<[f32; 4]> {
        let image = image.as_ref()?;
        let texture = self.subject.surfaces.textures.get(image, meaning)?;
        let spot = self.spot(hit, image)?;
        Some(texture.at(spot.uv, spot.across, spot.down, image.sampler))
    }

    fn spot(&self, hit: &SurfacePoint<'_>, image: &TextureRef) -> Option<TexturePoint> {
        let all = hit.wedges.map(|w| uv_of(hit, w, image.uv_set));
        let [a, b, c] = [all[0]?, all[1]?, all[2]?];
        let at = |l: [f32; 3]| image.look_up([0, 1].map(|k| l[0] * a[k] + l[1] * b[k] + l[2] * c[k]));
        let [x, y] = hit.at;
        let uv = at(hit.b);
        let to = |l: [f32; 3]| {
            let other = at(l);
            [other[0] - uv[0], other[1] - uv[1]]
        };
        let across = to(self.barycentrics(hit, x + 1.0, y));
        let down = to(self.barycentrics(hit, x, y + 1.0));
        Some(TexturePoint { uv, across, down })
    }
}

/// Returns the texture coordinates of a wedge in a set.
fn uv_of(hit: &SurfacePoint<'_>, wedge: WedgeId, set: u8) -> Option<[f32; 2]> {
    let mesh = &hit.placed.drawn.mesh;
    if set == 0 {
        return mesh.uvs().map(|all| all[wedge.index()]);
    }
    let own = mesh.further_attributes().iter().find(|a| a.semantic == Semantic::Uv(set) && a.width == 2)?;
    let [u, v] = own.of(wedge) else { return None };
    Some([*u, *v])
}
