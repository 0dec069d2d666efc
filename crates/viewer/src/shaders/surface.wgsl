// What colours a surface.

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

// From a surface to the eye.
fn to_eye(view: vec3<f32>) -> vec3<f32> {
    return select(vec3(0.0, 0.0, 1.0), normalize(-view), globals.picture.z > 0.5);
}

fn ambient(n: vec3<f32>) -> vec3<f32> {
    let up = dot(n, globals.view_from_world_axes[1].xyz);
    return mix(globals.ambient_below.rgb, globals.ambient_above.rgb, 0.5 + 0.5 * up);
}

// The direction to a light, and how much of it arrives.
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

fn diffuse(n: vec3<f32>, view: vec3<f32>) -> vec3<f32> {
    var light = ambient(n);
    for (var k = 0u; k < u32(globals.picture.w); k++) {
        let from = arriving(k, view);
        light += from.color * max(dot(n, from.to_light), 0.0);
    }
    return light;
}

fn heat_color(value: f32) -> vec3<f32> {
    // Not a number is grey.
    if value != value {
        return vec3(0.5);
    }
    let last = globals.heat.z - 1.0;
    let t = clamp((value - globals.heat.x) * globals.heat.y, 0.0, 1.0) * last;
    let i = u32(min(floor(t), last - 1.0));
    return mix(globals.stops[i].rgb, globals.stops[i + 1u].rgb, t - f32(i));
}

// Length of a step of one pixel in barycentric coordinates, for each.
fn bary_per_pixel(bary: vec3<f32>) -> vec3<f32> {
    let x = dpdx(bary);
    let y = dpdy(bary);
    return sqrt(x * x + y * y);
}

// How much of a pixel the wires cover.
fn wire_coverage(bary: vec3<f32>, per_pixel: vec3<f32>) -> f32 {
    let d = bary / max(per_pixel, vec3(1e-20));
    let nearest = min(d.x, min(d.y, d.z));
    return clamp(0.5 * globals.widths.x + 0.5 - nearest, 0.0, 1.0);
}

@fragment
fn fs(in: Varying, @builtin(front_facing) faces_front: bool) -> @location(0) vec4<f32> {
    let per_pixel = bary_per_pixel(in.bary);
    let across = cross(dpdy(in.view), dpdx(in.view));
    let front = faces_front != ((in.flags & MIRRORED) != 0u);
    if globals.widths.z > 0.5 && !front {
        discard;
    }
    var n = normalize(in.normal);
    n = select(-n, n, front);
    if SHADING == FLAT && dot(across, across) > 0.0 {
        n = normalize(across);
    }
    var rgb: vec3<f32>;
    if SHADING == HEAT {
        rgb = heat_color(in.heat);
    } else if SHADING == NORMALS {
        rgb = 0.5 + 0.5 * to_world(n);
    } else {
        var base = globals.surface.rgb;
        if SHADING == VERTEX_COLORS {
            base = linear_from_srgb(in.color.rgb);
        }
        rgb = srgb_from_linear(base * diffuse(n, in.view));
    }
    if (in.flags & SELECTED) != 0u {
        rgb = mix(rgb, vec3(1.0, 0.62, 0.15), 0.35);
    }
    if globals.widths.x > 0.0 {
        rgb = mix(rgb, globals.wire.rgb, globals.wire.a * wire_coverage(in.bary, per_pixel));
    }
    return vec4(rgb, 1.0);
}
