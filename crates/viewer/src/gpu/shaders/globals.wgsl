// Uniforms of the frame. Same order as `Globals` in uniforms.rs.

struct Light {
    place: vec4<f32>,
    toward: vec4<f32>,
    color: vec4<f32>,
}

struct Globals {
    clip_from_view: mat4x4<f32>,
    view_from_world_axes: array<vec4<f32>, 3>,
    picture: vec4<f32>,
    ambient_above: vec4<f32>,
    ambient_below: vec4<f32>,
    surface: vec4<f32>,
    wire: vec4<f32>,
    widths: vec4<f32>,
    heat: vec4<f32>,
    brush: vec4<f32>,
    background: array<vec4<f32>, 2>,
    ground: vec4<f32>,
    marks: vec4<f32>,
    mark_colors: array<vec4<f32>, 4>,
    tints: array<vec4<f32>, 12>,
    stops: array<vec4<f32>, 16>,
    lights: array<Light, 8>,
}

@group(0) @binding(0) var<uniform> globals: Globals;

fn srgb_from_linear(c: vec3<f32>) -> vec3<f32> {
    let x = clamp(c, vec3(0.0), vec3(1.0));
    return select(1.055 * pow(x, vec3(1.0 / 2.4)) - 0.055, 12.92 * x, x < vec3(0.0031308));
}

fn linear_from_srgb(c: vec3<f32>) -> vec3<f32> {
    return select(pow((c + 0.055) / 1.055, vec3(2.4)), c / 12.92, c <= vec3(0.04045));
}

// 1 if the render target does not take linear colours: then blending is done on encoded colours.
override ENCODE: u32 = 0u;

// Converts a linear colour with opacity to the format of the render target, premultiplied.
fn encoded(color: vec4<f32>) -> vec4<f32> {
    let rgb = clamp(color.rgb, vec3(0.0), vec3(1.0));
    return vec4(select(rgb, srgb_from_linear(rgb), ENCODE != 0u) * color.a, color.a);
}
