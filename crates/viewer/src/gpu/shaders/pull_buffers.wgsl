// Vertices pull their values from storage buffers.

@group(0) @binding(1) var<storage, read> instances: array<Instance>;
@group(0) @binding(2) var<storage, read> palette: array<vec4<f32>>;
@group(1) @binding(1) var<storage, read> indices: array<u32>;
@group(1) @binding(2) var<storage, read> corners: array<vec4<u32>>;
@group(1) @binding(3) var<storage, read> rows: array<u32>;
@group(1) @binding(4) var<storage, read> heat: array<f32>;
@group(1) @binding(5) var<storage, read> morphs: array<f32>;

fn instance_at(k: u32) -> Instance {
    return instances[k];
}

fn palette_at(k: u32) -> vec4<f32> {
    return palette[k];
}

fn index_at(k: u32) -> u32 {
    return indices[k];
}

fn corner_at(k: u32) -> vec4<u32> {
    return corners[k];
}

fn row_word(k: u32) -> u32 {
    return rows[k];
}

fn heat_at(k: u32) -> f32 {
    return heat[k];
}

fn morph_at(k: u32) -> f32 {
    return morphs[k];
}
