//! Bind group layouts of the shaders: frame, mesh and material.

use egui_wgpu::wgpu;

/// Layouts of all bind groups.
pub(super) struct Layouts {
    pub(super) frame: wgpu::BindGroupLayout,
    pub(super) mesh: wgpu::BindGroupLayout,
    pub(super) material: wgpu::BindGroupLayout,
}

/// Number of textures of a material.
pub(super) const MATERIAL_TEXTURES: u32 = 5;

impl Layouts {
    /// Creates the layouts. The values of vertices are in textures, or else in storage buffers.
    pub(super) fn new(device: &wgpu::Device, pulls_textures: bool) -> Self {
        let values = if pulls_textures { number_texture } else { storage };
        let vertex = wgpu::ShaderStages::VERTEX;
        let fragment = wgpu::ShaderStages::FRAGMENT;
        let group = |label, entries: &[wgpu::BindGroupLayoutEntry]| {
            device.create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor { label: Some(label), entries })
        };
        let mut material = vec![uniform(0, fragment)];
        for k in 0..MATERIAL_TEXTURES {
            material.push(texture(1 + k));
            material.push(sampler(1 + MATERIAL_TEXTURES + k));
        }
        Self {
            frame: group(
                "frame",
                &[
                    uniform(0, vertex | fragment),
                    values(1),
                    values(2),
                    texture(3),
                    sampler(4),
                    image(5, false),
                    image(6, false),
                ],
            ),
            mesh: group("mesh", &[uniform(0, vertex), values(1), values(2), values(3), values(4), values(5)]),
            material: group("material", &material),
        }
    }
}

fn entry(binding: u32, visibility: wgpu::ShaderStages, ty: wgpu::BindingType) -> wgpu::BindGroupLayoutEntry {
    wgpu::BindGroupLayoutEntry { binding, visibility, ty, count: None }
}

fn buffer(
    binding: u32,
    visibility: wgpu::ShaderStages,
    ty: wgpu::BufferBindingType,
) -> wgpu::BindGroupLayoutEntry {
    entry(
        binding,
        visibility,
        wgpu::BindingType::Buffer { ty, has_dynamic_offset: false, min_binding_size: None },
    )
}

fn uniform(binding: u32, visibility: wgpu::ShaderStages) -> wgpu::BindGroupLayoutEntry {
    buffer(binding, visibility, wgpu::BufferBindingType::Uniform)
}

fn storage(binding: u32) -> wgpu::BindGroupLayoutEntry {
    buffer(binding, wgpu::ShaderStages::VERTEX, wgpu::BufferBindingType::Storage { read_only: true })
}

fn number_texture(binding: u32) -> wgpu::BindGroupLayoutEntry {
    let ty = wgpu::BindingType::Texture {
        sample_type: wgpu::TextureSampleType::Uint,
        view_dimension: wgpu::TextureViewDimension::D2,
        multisampled: false,
    };
    entry(binding, wgpu::ShaderStages::VERTEX, ty)
}

fn texture(binding: u32) -> wgpu::BindGroupLayoutEntry {
    image(binding, true)
}

fn image(binding: u32, filterable: bool) -> wgpu::BindGroupLayoutEntry {
    let ty = wgpu::BindingType::Texture {
        sample_type: wgpu::TextureSampleType::Float { filterable },
        view_dimension: wgpu::TextureViewDimension::D2,
        multisampled: false,
    };
    entry(binding, wgpu::ShaderStages::FRAGMENT, ty)
}

fn sampler(binding: u32) -> wgpu::BindGroupLayoutEntry {
    let ty = wgpu::BindingType::Sampler(wgpu::SamplerBindingType::Filtering);
    entry(binding, wgpu::ShaderStages::FRAGMENT, ty)
}
