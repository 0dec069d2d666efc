// Environment maps, stacked vertically by falling gloss, then the coefficients of diffuse light: as in
// `lodsmith_render`.
@group(0) @binding(5) var environment: texture_2d<f32>;
const ENVIRONMENT_SIZE = vec2(128, 64);
const ENVIRONMENT_LEVELS = 6;

fn in_world(v: vec3<f32>) -> vec3<f32> {
    let axes = globals.view_from_world_axes;
    return vec3(dot(v, axes[0].xyz), dot(v, axes[1].xyz), dot(v, axes[2].xyz));
}

fn environment_matt(n_view: vec3<f32>) -> vec3<f32> {
    let n = in_world(n_view);
    let basis = array<f32, 9>(
        0.2820948, 0.4886025 * n.y, 0.4886025 * n.z, 0.4886025 * n.x, 1.0925484 * n.x * n.y, 1.0925484 * n.y * n.z,
        0.31539157 * (3.0 * n.z * n.z - 1.0), 1.0925484 * n.x * n.z, 0.5462742 * (n.x * n.x - n.y * n.y),
    );
    var sum = vec3(0.0);
    for (var k = 0; k < 9; k++) {
        sum += basis[k] * textureLoad(environment, vec2(k, ENVIRONMENT_SIZE.y * ENVIRONMENT_LEVELS), 0).rgb;
    }
    return max(sum, vec3(0.0));
}

fn environment_pixel(level: i32, x: i32, y: i32) -> vec3<f32> {
    let column = (x + ENVIRONMENT_SIZE.x) % ENVIRONMENT_SIZE.x;
    let row = clamp(y, 0, ENVIRONMENT_SIZE.y - 1) + level * ENVIRONMENT_SIZE.y;
    return textureLoad(environment, vec2(column, row), 0).rgb;
}

fn environment_map(level: i32, at: vec2<f32>) -> vec3<f32> {
    let first = floor(at);
    let share = at - first;
    let x = i32(first.x);
    let y = i32(first.y);
    let upper = mix(environment_pixel(level, x, y), environment_pixel(level, x + 1, y), share.x);
    let lower = mix(environment_pixel(level, x, y + 1), environment_pixel(level, x + 1, y + 1), share.x);
    return mix(upper, lower, share.y);
}

fn environment_mirrored(along: vec3<f32>, roughness: f32) -> vec3<f32> {
    let d = in_world(along);
    let pi = 3.14159265;
    let turn = vec2(atan2(d.z, d.x) / (2.0 * pi) + 0.5, 0.5 - asin(clamp(d.y, -1.0, 1.0)) / pi);
    let at = turn * vec2<f32>(ENVIRONMENT_SIZE) - 0.5;
    let level = roughness * f32(ENVIRONMENT_LEVELS - 1);
    let first = min(i32(level), ENVIRONMENT_LEVELS - 2);
    return mix(environment_map(first, at), environment_map(first + 1, at), level - f32(first));
}

// The environment as seen directly, not reflected.
@group(0) @binding(6) var sky: texture_2d<f32>;

fn sky_pixel(x: i32, y: i32) -> vec3<f32> {
    let size = vec2<i32>(textureDimensions(sky));
    return textureLoad(sky, vec2((x + size.x) % size.x, clamp(y, 0, size.y - 1)), 0).rgb;
}

fn sky_seen(along: vec3<f32>) -> vec3<f32> {
    let d = in_world(along);
    let pi = 3.14159265;
    let turn = vec2(atan2(d.z, d.x) / (2.0 * pi) + 0.5, 0.5 - asin(clamp(d.y, -1.0, 1.0)) / pi);
    let at = turn * vec2<f32>(textureDimensions(sky)) - 0.5;
    let first = floor(at);
    let share = at - first;
    let x = i32(first.x);
    let y = i32(first.y);
    let upper = mix(sky_pixel(x, y), sky_pixel(x + 1, y), share.x);
    let lower = mix(sky_pixel(x, y + 1), sky_pixel(x + 1, y + 1), share.x);
    return mix(upper, lower, share.y);
}
