// Vertex stage. Corners pull their values by number (vertex pulling), so that each knows which of the three
// it is, and a change of part of the values is visible at once.

struct Instance {
    // Rows of the matrix from the unit frame of the mesh to camera space.
    rows: array<vec4<f32>, 3>,
    // Rows of the normal matrix.
    normal_rows: array<vec4<f32>, 3>,
    // Number for picking; first joint in the palette; first morph target there; number of morph targets,
    // with flags in the upper half.
    ids: vec4<u32>,
}

struct MeshInfo {
    // Words in a row of values, and their offsets in it; 0xffffffff for absent ones.
    stride: u32,
    uv0: u32,
    uv1: u32,
    color: u32,
    tangent: u32,
    joints: u32,
    joint_sets: u32,
    wedge_count: u32,
}

const NONE: u32 = 0xffffffffu;
const SKINNED: u32 = 0x10000u;
const MIRRORED: u32 = 0x20000u;
const SELECTED: u32 = 0x40000u;
const HAS_HEAT: u32 = 0x80000u;
const HAS_COLORS: u32 = 0x100000u;
const LINEAR_COLORS: u32 = 0x200000u;
const OWN_NORMALS: u32 = 0x400000u;
// A number from 1 in four bits; 0 for none.
const TINT_SHIFT: u32 = 24u;

@group(1) @binding(0) var<uniform> info: MeshInfo;

struct Varying {
    @builtin(position) clip: vec4<f32>,
    @location(0) view: vec3<f32>,
    @location(1) normal: vec3<f32>,
    @location(2) uv: vec4<f32>,
    @location(3) color: vec4<f32>,
    @location(4) tangent: vec4<f32>,
    @location(5) bary: vec3<f32>,
    @location(6) heat: f32,
    @location(7) @interpolate(flat) flags: u32,
    @location(8) @interpolate(flat) id: u32,
}

struct Placed {
    place: vec3<f32>,
    normal: vec3<f32>,
    tangent: vec3<f32>,
}

fn from_octahedral(packed: u32) -> vec3<f32> {
    let p = max(vec2<f32>(vec2(i32(packed << 16u) >> 16u, i32(packed) >> 16u)) / 32767.0, vec2(-1.0));
    let z = 1.0 - abs(p.x) - abs(p.y);
    let fold = max(-z, 0.0);
    return normalize(vec3(p.x - select(-fold, fold, p.x >= 0.0), p.y - select(-fold, fold, p.y >= 0.0), z));
}

// (The built-in function for this is not in WebGL.)
fn from_bytes(packed: u32) -> vec4<f32> {
    return vec4<f32>((vec4(packed) >> vec4(0u, 8u, 16u, 24u)) & vec4(255u)) / 255.0;
}

fn word(wedge: u32, at: u32) -> u32 {
    return row_word(wedge * info.stride + at);
}

fn pair(wedge: u32, at: u32) -> vec2<f32> {
    if at == NONE {
        return vec2(0.0);
    }
    return vec2(bitcast<f32>(word(wedge, at)), bitcast<f32>(word(wedge, at + 1u)));
}

fn by_rows(r: array<vec4<f32>, 3>, v: vec4<f32>) -> vec3<f32> {
    return vec3(dot(r[0], v), dot(r[1], v), dot(r[2], v));
}

// Returns the position of a wedge in camera space: morphed, then skinned by its joints or transformed as a
// whole.
fn placed(wedge: u32, instance: Instance, direction: vec3<f32>) -> Placed {
    let corner = corner_at(wedge);
    var place = bitcast<vec3<f32>>(corner.xyz);
    var normal = from_octahedral(corner.w);
    let morph_count = instance.ids.w & 0xffffu;
    for (var k = 0u; k < morph_count; k++) {
        let morph = palette_at(instance.ids.z + k);
        let at = (bitcast<u32>(morph.x) * info.wedge_count + wedge) * 6u;
        place += morph.y * vec3(morph_at(at), morph_at(at + 1u), morph_at(at + 2u));
        normal += morph.y * vec3(morph_at(at + 3u), morph_at(at + 4u), morph_at(at + 5u));
    }
    var matrix = instance.rows;
    var normal_matrix = instance.normal_rows;
    if (instance.ids.w & SKINNED) != 0u && info.joints != NONE {
        matrix = array<vec4<f32>, 3>(vec4(0.0), vec4(0.0), vec4(0.0));
        for (var g = 0u; g < info.joint_sets; g++) {
            let at = info.joints + 6u * g;
            for (var k = 0u; k < 4u; k++) {
                let weight = bitcast<f32>(word(wedge, at + 2u + k));
                if weight != 0.0 {
                    let joint = (word(wedge, at + (k >> 1u)) >> (16u * (k & 1u))) & 0xffffu;
                    let first = instance.ids.y + 3u * joint;
                    matrix[0] += weight * palette_at(first);
                    matrix[1] += weight * palette_at(first + 1u);
                    matrix[2] += weight * palette_at(first + 2u);
                }
            }
        }
        // Rows of the inverse transpose, up to a factor: cross products of the rows.
        normal_matrix[0] = vec4(cross(matrix[1].xyz, matrix[2].xyz), 0.0);
        normal_matrix[1] = vec4(cross(matrix[2].xyz, matrix[0].xyz), 0.0);
        normal_matrix[2] = vec4(cross(matrix[0].xyz, matrix[1].xyz), 0.0);
    }
    return Placed(
        by_rows(matrix, vec4(place, 1.0)),
        by_rows(normal_matrix, vec4(normal, 0.0)),
        by_rows(matrix, vec4(direction, 0.0)),
    );
}

@vertex
fn vs(@builtin(vertex_index) corner: u32, @builtin(instance_index) which: u32) -> Varying {
    let wedge = index_at(corner);
    let instance = instance_at(which);
    var tangent = vec4(0.0);
    if info.tangent != NONE {
        tangent = vec4(from_octahedral(word(wedge, info.tangent)), bitcast<f32>(word(wedge, info.tangent + 1u)));
    }
    let at = placed(wedge, instance, tangent.xyz);
    var out: Varying;
    out.view = at.place;
    out.clip = globals.clip_from_view * vec4(at.place, 1.0);
    let length = length(at.normal);
    out.normal = select(vec3(0.0), at.normal / length, length > 0.0);
    out.tangent = vec4(at.tangent, tangent.w);
    out.uv = vec4(pair(wedge, info.uv0), pair(wedge, info.uv1));
    out.color = vec4(1.0);
    if info.color != NONE {
        out.color = from_bytes(word(wedge, info.color));
    }
    let k = corner % 3u;
    out.bary = vec3(f32(k == 0u), f32(k == 1u), f32(k == 2u));
    out.flags = instance.ids.w;
    if (instance.ids.w & HAS_HEAT) != 0u {
        out.heat = heat_at(wedge);
    }
    out.id = instance.ids.x;
    return out;
}
