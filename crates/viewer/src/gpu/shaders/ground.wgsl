// A grid on the floor: as in `lodsmith_render`, visible from above only. Drawn over the whole image before
// the model.

@vertex
fn vs(@builtin(vertex_index) corner: u32) -> @builtin(position) vec4<f32> {
    return vec4(f32(corner & 1u) * 4.0 - 1.0, f32(corner >> 1u) * 4.0 - 1.0, 0.0, 1.0);
}

const REACH: f32 = 6.0;

// Projects a pixel to the floor. Returns the hit relative to the centre of the grid, along the world's x
// and z, and 1 if there is one.
fn on_floor(at: vec2<f32>) -> vec3<f32> {
    let axes = globals.view_from_world_axes;
    let up = axes[1].xyz;
    let screen = vec2(2.0 * at.x / globals.picture.x - 1.0, 1.0 - 2.0 * at.y / globals.picture.y);
    let slope = vec2(screen.x / globals.clip_from_view[0][0], screen.y / globals.clip_from_view[1][1]);
    let perspective = globals.picture.z > 0.5;
    let start = select(vec3(slope, 0.0), vec3(0.0), perspective);
    let along = select(vec3(0.0, 0.0, -1.0), vec3(slope, -1.0), perspective);
    let t = dot(globals.ground.xyz - start, up) / dot(along, up);
    let hit = start + along * t - globals.ground.xyz;
    return vec3(dot(hit, axes[0].xyz), dot(hit, axes[2].xyz), select(0.0, 1.0, t > 0.0));
}

@fragment
fn fs(@builtin(position) at: vec4<f32>) -> @location(0) vec4<f32> {
    let here = on_floor(at.xy);
    let right = on_floor(at.xy + vec2(1.0, 0.0));
    let below = on_floor(at.xy + vec2(0.0, 1.0));
    let radius = sqrt(globals.widths.w);
    let away = length(here.xy) / radius;
    // The camera must be above the floor.
    let above = dot(-globals.ground.xyz, globals.view_from_world_axes[1].xyz) > 0.0;
    if !above || here.z * right.z * below.z < 0.5 || away > REACH {
        return vec4(0.0);
    }
    let fade = (1.0 - away / REACH) * (1.0 - away / REACH);
    let step = globals.ground.w;
    var cover = 0.0;
    for (var k = 0u; k < 2u; k++) {
        let place = here[k] / step;
        let pixel = (abs(right[k] - here[k]) + abs(below[k] - here[k])) / step;
        let nearest = abs(place - round(place)) / max(pixel, 1e-9);
        // Far away lines are denser than pixels.
        cover = max(cover, clamp(1.0 - nearest, 0.0, 1.0) * clamp(1.0 - 2.0 * pixel, 0.0, 1.0));
    }
    let behind = linear_from_srgb(globals.background[1].rgb);
    let line = select(0.55, 0.05, dot(behind, vec3(0.21, 0.72, 0.07)) > 0.18);
    return encoded(vec4(vec3(line), 0.35 * cover * fade));
}
