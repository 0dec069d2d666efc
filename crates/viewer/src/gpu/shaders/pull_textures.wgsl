// Vertices pull their values from textures, row after row: WebGL has no storage buffers.

@group(0) @binding(1) var instances: texture_2d<u32>;
@group(0) @binding(2) var palette: texture_2d<u32>;
@group(1) @binding(1) var indices: texture_2d<u32>;
@group(1) @binding(2) var corners: texture_2d<u32>;
@group(1) @binding(3) var rows: texture_2d<u32>;
@group(1) @binding(4) var heat: texture_2d<u32>;
@group(1) @binding(5) var morphs: texture_2d<u32>;

// A row has 2048 items.
fn place_of(k: u32) -> vec2<i32> {
    return vec2(i32(k & 2047u), i32(k >> 11u));
}

fn number_at(k: u32) -> vec4<f32> {
    return bitcast<vec4<f32>>(textureLoad(instances, place_of(k), 0));
}

fn instance_at(k: u32) -> Instance {
    let at = 7u * k;
    return Instance(
        array<vec4<f32>, 3>(number_at(at), number_at(at + 1u), number_at(at + 2u)),
        array<vec4<f32>, 3>(number_at(at + 3u), number_at(at + 4u), number_at(at + 5u)),
        textureLoad(instances, place_of(at + 6u), 0),
    );
}

fn palette_at(k: u32) -> vec4<f32> {
    return bitcast<vec4<f32>>(textureLoad(palette, place_of(k), 0));
}

fn index_at(k: u32) -> u32 {
    return textureLoad(indices, place_of(k), 0).x;
}

fn corner_at(k: u32) -> vec4<u32> {
    return textureLoad(corners, place_of(k), 0);
}

fn row_word(k: u32) -> u32 {
    return textureLoad(rows, place_of(k), 0).x;
}

fn heat_at(k: u32) -> f32 {
    return bitcast<f32>(textureLoad(heat, place_of(k), 0).x);
}

fn morph_at(k: u32) -> f32 {
    return bitcast<f32>(textureLoad(morphs, place_of(k), 0).x);
}
