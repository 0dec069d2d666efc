//! Materials and their textures on the GPU.

use std::collections::HashMap;
use std::sync::Arc;

use egui_wgpu::wgpu;
use egui_wgpu::wgpu::util::DeviceExt;
use lodsmith_core::Image;
use lodsmith_core::model::{AlphaMode, Material, Sampler, TextureRef, Wrap};
use rayon::prelude::*;

use super::context::Context;
use super::uniforms::{linear_from_srgb, srgb_from_linear};

/// Materials of a model, each with its bind group.
pub(super) struct Surfaces {
    materials: Vec<Surface>,
    plain: wgpu::BindGroup,
}

/// A material on the GPU.
pub(super) struct Surface {
    pub(super) bind: wgpu::BindGroup,
    pub(super) is_blended: bool,
}

/// The uniform of a material; the same order as in `surface.wgsl`.
#[repr(C)]
#[derive(Clone, Copy, bytemuck::Pod, bytemuck::Zeroable)]
struct GpuMaterial {
    base_color: [f32; 4],
    emissive: [f32; 4],
    numbers: [f32; 4],
    flags: [u32; 4],
    transforms: [[f32; 4]; 10],
}

const UNLIT: u32 = 0x10000;
const DOUBLE_SIDED: u32 = 0x20000;
const PLAIN: u32 = 0x40000;

impl Surfaces {
    pub(super) fn new(context: &Context, materials: &[Material], images: &[Arc<Image>]) -> Self {
        let white = texture(context, &Image::filled(1, 1, [255; 4]), false);
        let mut views: HashMap<(usize, bool), wgpu::TextureView> = HashMap::new();
        let mut samplers = HashMap::new();
        let plain = bind(context, &plain_material(), &[None; 5], &views, &white, &mut samplers);
        let materials = materials.iter().map(|m| {
            // In binding order; colours are sRGB, other values are linear.
            let textures = [
                (&m.base_color_texture, true),
                (&m.metallic_roughness_texture, false),
                (&m.normal_texture, false),
                (&m.occlusion_texture, false),
                (&m.emissive_texture, true),
            ];
            let textures =
                textures.map(|(t, is_color)| t.filter(|t| t.image < images.len()).map(|t| (t, is_color)));
            for (t, is_color) in textures.iter().flatten() {
                let view = || texture(context, &images[t.image], *is_color);
                views.entry((t.image, *is_color)).or_insert_with(view);
            }
            let gpu = material(m, &textures);
            Surface {
                bind: bind(context, &gpu, &textures, &views, &white, &mut samplers),
                is_blended: m.alpha == AlphaMode::Blend,
            }
        });
        Self { materials: materials.collect(), plain }
    }

    /// Returns the material with this index in the model.
    pub(super) fn get(&self, material: usize) -> Option<&Surface> {
        self.materials.get(material)
    }
    /// Returns the bind group for faces without a material.
    pub(super) fn plain(&self) -> &wgpu::BindGroup {
        &self.plain
    }
}

type Textures = [Option<(TextureRef, bool)>; 5];

fn plain_material() -> GpuMaterial {
    let mut plain = material(&Material::default(), &[None; 5]);
    plain.flags[0] |= PLAIN | DOUBLE_SIDED;
    plain
}

fn material(m: &Material, textures: &Textures) -> GpuMaterial {
    let mut flags = 0;
    let mut transforms = [[0.0; 4]; 10];
    for (k, t) in textures.iter().enumerate() {
        let [u, v] = t.map_or([[1.0, 0.0, 0.0], [0.0, 1.0, 0.0]], |(t, _)| t.transform);
        transforms[2 * k] = [u[0], u[1], u[2], 0.0];
        transforms[2 * k + 1] = [v[0], v[1], v[2], 0.0];
        if let Some((t, _)) = t {
            flags |= 1 << k | u32::from(t.uv_set == 1) << (8 + k);
        }
    }
    flags |= if m.unlit { UNLIT } else { 0 };
    flags |= if m.double_sided { DOUBLE_SIDED } else { 0 };
    let (cutoff, alpha) = match m.alpha {
        AlphaMode::Opaque => (0.0, 0.0),
        AlphaMode::Mask(cutoff) => (cutoff, 1.0),
        AlphaMode::Blend => (0.0, 2.0),
    };
    let [r, g, b] = m.emissive;
    GpuMaterial {
        base_color: m.base_color,
        emissive: [r, g, b, m.normal_scale],
        numbers: [m.metallic, m.roughness, cutoff, alpha],
        flags: [flags, 0, 0, 0],
        transforms,
    }
}

fn bind(
    context: &Context,
    material: &GpuMaterial,
    textures: &Textures,
    views: &HashMap<(usize, bool), wgpu::TextureView>,
    white: &wgpu::TextureView,
    samplers: &mut HashMap<(u8, u8, bool), wgpu::Sampler>,
) -> wgpu::BindGroup {
    let uniform = context.device.create_buffer_init(&wgpu::util::BufferInitDescriptor {
        label: Some("material"),
        contents: bytemuck::bytes_of(material),
        usage: wgpu::BufferUsages::UNIFORM,
    });
    let key = |s: Sampler| (s.wrap_u as u8, s.wrap_v as u8, s.nearest);
    let wanted = textures.map(|t| t.map_or(Sampler::default(), |(t, _)| t.sampler));
    for s in wanted {
        samplers.entry(key(s)).or_insert_with(|| sampler(context, s));
    }
    let mut entries = vec![wgpu::BindGroupEntry { binding: 0, resource: uniform.as_entire_binding() }];
    for (k, t) in textures.iter().enumerate() {
        let view = t.and_then(|(t, is_color)| views.get(&(t.image, is_color))).unwrap_or(white);
        let resource = wgpu::BindingResource::TextureView(view);
        entries.push(wgpu::BindGroupEntry { binding: 1 + k as u32, resource });
        let resource = wgpu::BindingResource::Sampler(&samplers[&key(wanted[k])]);
        entries.push(wgpu::BindGroupEntry { binding: 6 + k as u32, resource });
    }
    context.device.create_bind_group(&wgpu::BindGroupDescriptor {
        label: Some("material"),
        layout: &context.layouts.material,
        entries: &entries,
    })
}

fn sampler(context: &Context, sampler: Sampler) -> wgpu::Sampler {
    let wrap = |w| match w {
        Wrap::Repeat => wgpu::AddressMode::Repeat,
        Wrap::Mirror => wgpu::AddressMode::MirrorRepeat,
        Wrap::Clamp => wgpu::AddressMode::ClampToEdge,
    };
    let near = if sampler.nearest { wgpu::FilterMode::Nearest } else { wgpu::FilterMode::Linear };
    // Anisotropic filtering requires linear filters; 4 samples, as in the CPU renderer.
    let anisotropy_clamp = if sampler.nearest { 1 } else { 4 };
    context.device.create_sampler(&wgpu::SamplerDescriptor {
        label: Some("material"),
        address_mode_u: wrap(sampler.wrap_u),
        address_mode_v: wrap(sampler.wrap_v),
        mag_filter: near,
        min_filter: wgpu::FilterMode::Linear,
        mipmap_filter: wgpu::MipmapFilterMode::Linear,
        anisotropy_clamp,
        ..wgpu::SamplerDescriptor::default()
    })
}

/// Uploads an image with its mip levels. Levels larger than the adapter allows are left out.
pub(super) fn texture(context: &Context, image: &Image, is_color: bool) -> wgpu::TextureView {
    let most = context.device.limits().max_texture_dimension_2d as usize;
    let mut levels = vec![(image.width(), image.height(), image.pixels().to_vec())];
    while let Some((w, h, pixels)) = levels.last().filter(|(w, h, _)| w.max(h) > &1) {
        levels.push(next_mip_level(*w, *h, pixels, is_color));
    }
    levels.retain(|(w, h, pixels)| *w.max(h) <= most && !pixels.is_empty());
    if levels.is_empty() {
        levels.push((1, 1, vec![[0, 0, 0, 255]]));
    }
    let extent = |(w, h): (usize, usize)| wgpu::Extent3d {
        width: w as u32,
        height: h as u32,
        depth_or_array_layers: 1,
    };
    let format = if is_color { wgpu::TextureFormat::Rgba8UnormSrgb } else { wgpu::TextureFormat::Rgba8Unorm };
    let texture = context.device.create_texture(&wgpu::TextureDescriptor {
        label: Some("image"),
        size: extent((levels[0].0, levels[0].1)),
        mip_level_count: levels.len() as u32,
        sample_count: 1,
        dimension: wgpu::TextureDimension::D2,
        format,
        usage: wgpu::TextureUsages::TEXTURE_BINDING | wgpu::TextureUsages::COPY_DST,
        view_formats: &[],
    });
    for (level, (w, h, pixels)) in levels.iter().enumerate() {
        context.queue.write_texture(
            wgpu::TexelCopyTextureInfo { mip_level: level as u32, ..texture.as_image_copy() },
            bytemuck::cast_slice(pixels),
            wgpu::TexelCopyBufferLayout {
                offset: 0,
                bytes_per_row: Some(4 * *w as u32),
                rows_per_image: None,
            },
            extent((*w, *h)),
        );
    }
    texture.create_view(&wgpu::TextureViewDescriptor::default())
}

/// Returns the next mip level: each pixel is the mean of four, taken in linear light for colours.
fn next_mip_level(w: usize, h: usize, pixels: &[[u8; 4]], is_color: bool) -> (usize, usize, Vec<[u8; 4]>) {
    let light: Vec<f32> = (0..=255u8).map(|b| linear_from_srgb(f32::from(b) / 255.0)).collect();
    let (width, height) = ((w / 2).max(1), (h / 2).max(1));
    let mut half = vec![[0u8; 4]; width * height];
    half.par_chunks_mut(width).enumerate().for_each(|(y, row)| {
        for (x, pixel) in row.iter_mut().enumerate() {
            let four = [(0, 0), (1, 0), (0, 1), (1, 1)]
                .map(|(i, j)| pixels[(2 * y + j).min(h - 1) * w + (2 * x + i).min(w - 1)]);
            *pixel = [0, 1, 2, 3].map(|k| {
                if is_color && k < 3 {
                    let mean = four.iter().map(|p| light[usize::from(p[k])]).sum::<f32>() * 0.25;
                    (srgb_from_linear(mean) * 255.0).round() as u8
                } else {
                    ((four.iter().map(|p| u32::from(p[k])).sum::<u32>() + 2) / 4) as u8
                }
            });
        }
    });
    (width, height, half)
}
