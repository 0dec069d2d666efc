// Surface shading.

override SHADING: u32 = 0u;

const SMOOTH: u32 = 0u;
const FLAT: u32 = 1u;
const TEXTURED: u32 = 2u;
const VERTEX_COLORS: u32 = 3u;
const NORMALS: u32 = 4u;
const MATCAP: u32 = 5u;
const HEAT: u32 = 6u;
const CUSTOM: u32 = 7u;

@group(0) @binding(3) var matcap: texture_2d<f32>;
@group(0) @binding(4) var matcap_sampler: sampler;

fn to_world(v: vec3<f32>) -> vec3<f32> {
    let axes = globals.view_from_world_axes;
    return vec3(dot(axes[0].xyz, v), dot(axes[1].xyz, v), dot(axes[2].xyz, v));
}

// Returns the direction from a surface to the camera.
fn to_eye(view: vec3<f32>) -> vec3<f32> {
    return select(vec3(0.0, 0.0, 1.0), normalize(-view), globals.picture.z > 0.5);
}

fn ambient(n: vec3<f32>) -> vec3<f32> {
    let up = dot(n, globals.view_from_world_axes[1].xyz);
    return mix(globals.ambient_below.rgb, globals.ambient_above.rgb, 0.5 + 0.5 * up);
}

// The direction to a light, and the colour of its light at the surface.
struct Arriving {
    to_light: vec3<f32>,
    color: vec3<f32>,
}

fn arriving(k: u32, view: vec3<f32>) -> Arriving {
    let light = globals.lights[k];
    if light.place.w < 0.5 {
        return Arriving(light.place.xyz, light.color.rgb);
    }
    let way = light.place.xyz - view;
    let distance_sq = max(dot(way, way), 1e-12);
    let to_light = way * inverseSqrt(distance_sq);
    var strength = globals.widths.w / distance_sq;
    if light.place.w > 1.5 {
        let along = dot(-to_light, light.toward.xyz);
        strength *= smoothstep(light.toward.w, light.color.w, along);
    }
    return Arriving(to_light, light.color.rgb * strength);
}

// Returns the shading of a plain surface under the lights: as in `lodsmith_render`.
fn lit(albedo: vec3<f32>, n: vec3<f32>, view: vec3<f32>) -> vec3<f32> {
    let eye = to_eye(view);
    var light = ambient(n);
    var gleam = vec3(0.0);
    for (var k = 0u; k < u32(globals.picture.w); k++) {
        let ray = arriving(k, view);
        let along = dot(n, ray.to_light);
        if along > 0.0 {
            light += ray.color * along;
            let half = ray.to_light + eye;
            gleam += ray.color * pow(max(dot(n, half), 0.0) / max(length(half), 1e-6), 32.0);
        }
    }
    return albedo * light + 0.10 * gleam;
}

// Returns the light reflected by a metallic-roughness material from all lights: as in `lodsmith_render`.
fn reflected(base: vec3<f32>, n: vec3<f32>, view: vec3<f32>, rough: f32, metallic: f32, open: f32) -> vec3<f32> {
    let eye = to_eye(view);
    let straight = mix(vec3(0.04), base, metallic);
    let matt = base * (1.0 - metallic);
    let roughness = clamp(rough, 0.08, 1.0);
    let a2 = roughness * roughness * roughness * roughness;
    let n_eye = max(dot(n, eye), 1e-3);
    var light = vec3(0.0);
    for (var k = 0u; k < u32(globals.picture.w); k++) {
        let ray = arriving(k, view);
        let along = dot(n, ray.to_light);
        if along <= 0.0 {
            continue;
        }
        let between = ray.to_light + eye;
        let half = select(n, normalize(between), dot(between, between) > 1e-12);
        let n_half = max(dot(n, half), 0.0);
        let spread = n_half * n_half * (a2 - 1.0) + 1.0;
        let facets = a2 / max(spread * spread, 1e-9);
        let hidden = along * sqrt(n_eye * n_eye * (1.0 - a2) + a2) + n_eye * sqrt(along * along * (1.0 - a2) + a2);
        let fresnel = straight + (1.0 - straight) * pow(1.0 - max(dot(eye, half), 0.0), 5.0);
        let gleam = fresnel * (facets * 0.5 / max(hidden, 1e-4));
        light += ray.color * along * (matt * (1.0 - fresnel) + gleam);
    }
    let mirrored = 2.0 * dot(n, eye) * n - eye;
    let grazing = pow(1.0 - n_eye, 5.0);
    if globals.marks.z > 0.5 {
        let plain = 0.04 + (max(1.0 - roughness, 0.04) - 0.04) * grazing;
        let metal = base + (max(vec3(1.0 - roughness), base) - base) * grazing;
        let thrown = mix(vec3(plain), metal, metallic);
        let diffuse = environment_matt(n) * matt * (1.0 - plain);
        return light + (diffuse + environment_mirrored(mirrored, roughness) * thrown) * open;
    }
    let around = ambient(mix(mirrored, n, roughness));
    let rim = (max(vec3(1.0 - roughness), straight) - straight) * grazing;
    return light + (ambient(n) * matt + around * (straight + rim)) * open;
}

// Clay shading, lit as by a window: as in `lodsmith_render`.
fn clay(n: vec3<f32>) -> vec3<f32> {
    let key = max(dot(n, vec3(-0.42, 0.62, 0.66)), 0.0);
    let fill = max(dot(n, vec3(0.80, -0.15, 0.58)), 0.0);
    let rim = pow(1.0 - clamp(n.z, 0.0, 1.0), 3.0);
    let gleam = pow(max(dot(n, vec3(-0.26, 0.38, 0.886)), 0.0), 40.0);
    return vec3(0.050, 0.030, 0.027) + vec3(0.62, 0.31, 0.19) * key * sqrt(key) + vec3(0.05, 0.07, 0.12) * fill
        + vec3(0.13, 0.12, 0.14) * rim + vec3(0.16) * gleam;
}

fn heat_color(value: f32) -> vec3<f32> {
    // NaN is grey.
    if value != value {
        return vec3(0.5);
    }
    let last = globals.heat.z - 1.0;
    let t = clamp((value - globals.heat.x) * globals.heat.y, 0.0, 1.0) * last;
    let i = u32(min(floor(t), last - 1.0));
    return mix(globals.stops[i].rgb, globals.stops[i + 1u].rgb, t - f32(i));
}

// Returns the change of each barycentric coordinate per pixel.
fn bary_per_pixel(bary: vec3<f32>) -> vec3<f32> {
    let x = dpdx(bary);
    let y = dpdy(bary);
    return sqrt(x * x + y * y);
}

// Returns the share of a pixel that wires cover. Lines of tiny triangles fade, or they would cover
// everything.
fn wire_coverage(bary: vec3<f32>, per_pixel: vec3<f32>) -> f32 {
    let heights = 1.0 / max(per_pixel, vec3(1e-20));
    let d = bary * heights;
    let nearest = min(d.x, min(d.y, d.z));
    let least = min(heights.x, min(heights.y, heights.z));
    let strength = clamp((least - 0.7) / 8.0, 0.04, 1.0);
    return clamp(0.5 * globals.widths.x + 0.5 - nearest, 0.0, 1.0) * strength;
}

struct Material {
    base_color: vec4<f32>,
    // Emission; scale of the normal map.
    emissive: vec4<f32>,
    // Metalness, roughness, alpha cutoff, and alpha mode: 0 opaque, 1 mask, 2 blend.
    numbers: vec4<f32>,
    // Bits: textures present, then those that use the second set of coordinates; unlit; double-sided.
    flags: vec4<u32>,
    // Two rows for each texture.
    transforms: array<vec4<f32>, 10>,
}

const UNLIT: u32 = 0x10000u;
const DOUBLE_SIDED: u32 = 0x20000u;
const PLAIN: u32 = 0x40000u;

@group(2) @binding(0) var<uniform> material: Material;
@group(2) @binding(1) var base_image: texture_2d<f32>;
@group(2) @binding(2) var rough_image: texture_2d<f32>;
@group(2) @binding(3) var normal_image: texture_2d<f32>;
@group(2) @binding(4) var occlusion_image: texture_2d<f32>;
@group(2) @binding(5) var emissive_image: texture_2d<f32>;
@group(2) @binding(6) var base_sampler: sampler;
@group(2) @binding(7) var rough_sampler: sampler;
@group(2) @binding(8) var normal_sampler: sampler;
@group(2) @binding(9) var occlusion_sampler: sampler;
@group(2) @binding(10) var emissive_sampler: sampler;

fn uv_of(k: u32, uv: vec4<f32>) -> vec2<f32> {
    let second = (material.flags.x >> (8u + k)) & 1u;
    let chosen = vec3(select(uv.xy, uv.zw, second != 0u), 1.0);
    let at = vec2(dot(material.transforms[2u * k].xyz, chosen), dot(material.transforms[2u * k + 1u].xyz, chosen));
    // The first row of an image is its top.
    return vec2(at.x, 1.0 - at.y);
}

fn has(k: u32) -> bool {
    return ((material.flags.x >> k) & 1u) != 0u;
}

fn vertex_color(in: Varying) -> vec4<f32> {
    if (in.flags & HAS_COLORS) == 0u {
        return vec4(globals.surface.rgb, 1.0);
    }
    let linear = (in.flags & LINEAR_COLORS) != 0u;
    return vec4(select(linear_from_srgb(in.color.rgb), in.color.rgb, linear), in.color.a);
}

// Applies the normal map in tangent space: from the tangents of the mesh, else from the screen-space
// derivatives of the texture coordinates.
fn mapped_normal(in: Varying, n: vec3<f32>, outer: vec3<f32>, uv: vec2<f32>, texel: vec3<f32>) -> vec3<f32> {
    let x = dpdx(in.view);
    let y = dpdy(in.view);
    let u = dpdx(uv);
    let v = dpdy(uv);
    if !has(2u) {
        return n;
    }
    let m = (2.0 * texel - 1.0) * vec3(material.emissive.w, material.emissive.w, 1.0);
    var t: vec3<f32>;
    var b: vec3<f32>;
    if in.tangent.w != 0.0 {
        t = in.tangent.xyz - n * dot(n, in.tangent.xyz);
        t = t * inverseSqrt(max(dot(t, t), 1e-20));
        b = cross(outer, t) * sign(in.tangent.w);
    } else {
        // v increases down the image here.
        let side = sign(u.x * v.y - u.y * v.x);
        t = (x * v.y - y * u.y) * side;
        b = -(y * u.x - x * v.x) * side;
        t -= n * dot(n, t);
        t = t * inverseSqrt(max(dot(t, t), 1e-20));
        b -= n * dot(n, b) + t * dot(t, b);
        b = b * inverseSqrt(max(dot(b, b), 1e-20));
    }
    let mapped = t * m.x + b * m.y + n * m.z;
    return select(n, normalize(mapped), dot(mapped, mapped) > 1e-12);
}

// Input of the `surface` function of a custom shader file. Positions and directions are in camera
// coordinates (x right, y up, z towards the camera), colours are linear.
struct Surface {
    place: vec3<f32>,
    // Faces the camera, unit length.
    normal: vec3<f32>,
    face_normal: vec3<f32>,
    uv: vec2<f32>,
    // Colour of the shading mode, and of the vertices.
    base: vec3<f32>,
    color: vec4<f32>,
    heat: f32,
}

@fragment
fn fs(in: Varying, @builtin(front_facing) faces_front: bool) -> @location(0) vec4<f32> {
    let per_pixel = bary_per_pixel(in.bary);
    let across = cross(dpdy(in.view), dpdx(in.view));
    let front = faces_front != ((in.flags & MIRRORED) != 0u);
    let face = select(vec3(0.0, 0.0, 1.0), normalize(across), dot(across, across) > 0.0);
    let own = select(face, normalize(in.normal), dot(in.normal, in.normal) > 1e-12);
    var n = select(-own, own, front);
    // Normals of a file may point to either side of its faces.
    if (in.flags & OWN_NORMALS) != 0u {
        n = select(own, -own, dot(own, face) < 0.0);
    }
    var rgb: vec3<f32>;
    var alpha = 1.0;
    var single_sided = globals.widths.z > 0.5;
    var cut = false;
    if SHADING == SMOOTH {
        rgb = lit(globals.surface.rgb, n, in.view);
    } else if SHADING == FLAT {
        rgb = lit(globals.surface.rgb, face, in.view);
    } else if SHADING == VERTEX_COLORS {
        rgb = lit(vertex_color(in).rgb, n, in.view);
    } else if SHADING == NORMALS {
        rgb = linear_from_srgb(0.5 + 0.5 * to_world(own));
    } else if SHADING == MATCAP {
        // The rim of the ball is skipped: images of matcaps are seldom cropped to the pixel.
        let image = textureSample(matcap, matcap_sampler, vec2(0.5 + 0.49 * n.x, 0.5 - 0.49 * n.y)).rgb;
        rgb = select(clay(n), image, globals.heat.w > 0.5);
    } else if SHADING == HEAT {
        rgb = globals.surface.rgb;
        if (in.flags & HAS_HEAT) != 0u {
            rgb = linear_from_srgb(heat_color(in.heat));
            // Values outside the brush are grey.
            if in.heat < globals.brush.x || in.heat > globals.brush.y {
                rgb = vec3(0.13);
            }
        }
        // Darker where the surface turns away, so that its shape shows: as in `lodsmith_render`.
        rgb *= mix(0.35, 1.0, max(dot(n, to_eye(in.view)), 0.0));
    } else if SHADING == CUSTOM {
        let color = vertex_color(in);
        let shown = surface(Surface(in.view, n, face, in.uv.xy, globals.surface.rgb, color, in.heat));
        rgb = shown.rgb;
    } else {
        let normal_uv = uv_of(2u, in.uv);
        let base_texel = textureSample(base_image, base_sampler, uv_of(0u, in.uv));
        let rough_texel = textureSample(rough_image, rough_sampler, uv_of(1u, in.uv));
        let normal_texel = textureSample(normal_image, normal_sampler, normal_uv);
        let occlusion_texel = textureSample(occlusion_image, occlusion_sampler, uv_of(3u, in.uv));
        let emissive_texel = textureSample(emissive_image, emissive_sampler, uv_of(4u, in.uv));
        let outer = select(n, -n, dot(n, own) < 0.0);
        let mapped = mapped_normal(in, n, outer, normal_uv, normal_texel.xyz);
        let flags = material.flags.x;
        if (flags & PLAIN) != 0u {
            rgb = lit(vertex_color(in).rgb, n, in.view);
        } else {
            single_sided = single_sided || (flags & DOUBLE_SIDED) == 0u;
            let tint = select(vec4(1.0), vertex_color(in), (in.flags & HAS_COLORS) != 0u);
            let base = tint * material.base_color * base_texel;
            cut = material.numbers.w == 1.0 && base.a < material.numbers.z;
            alpha = select(1.0, clamp(base.a, 0.0, 1.0), material.numbers.w == 2.0);
            if (flags & UNLIT) != 0u {
                rgb = base.rgb;
            } else {
                let metallic = clamp(material.numbers.x * rough_texel.b, 0.0, 1.0);
                let roughness = material.numbers.y * rough_texel.g;
                rgb = reflected(base.rgb, mapped, in.view, roughness, metallic, occlusion_texel.r)
                    + material.emissive.rgb * emissive_texel.rgb;
            }
        }
    }
    if cut || (single_sided && !front) {
        discard;
    }
    let tint = (in.flags >> TINT_SHIFT) & 0xfu;
    if tint != 0u {
        rgb = lit(globals.tints[tint - 1u].rgb, n, in.view);
    }
    if (in.flags & SELECTED) != 0u {
        rgb = mix(rgb, vec3(1.0, 0.34, 0.02), 0.35);
    }
    if globals.widths.x > 0.0 {
        let cover = globals.wire.a * wire_coverage(in.bary, per_pixel);
        rgb = mix(rgb, linear_from_srgb(globals.wire.rgb), cover);
        alpha = alpha + (1.0 - alpha) * cover;
    }
    return encoded(vec4(rgb, alpha));
}
