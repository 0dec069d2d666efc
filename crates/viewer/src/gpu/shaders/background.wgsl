// One triangle that covers the image: a vertical gradient, or the environment.

// Same values as in `lodsmith_render`: roughness of the blurred environment, and half the height of a
// parallel view.
const BLUR = 0.4;
const PARALLEL = 0.31;

// True if the background may be the environment. Software renderers compute both branches of what is not constant.
override IS_ENVIRONMENT: bool = true;

@vertex
fn vs(@builtin(vertex_index) corner: u32) -> @builtin(position) vec4<f32> {
    return vec4(f32(corner & 1u) * 4.0 - 1.0, f32(corner >> 1u) * 4.0 - 1.0, 0.0, 1.0);
}

@fragment
fn fs(@builtin(position) at: vec4<f32>) -> @location(0) vec4<f32> {
    if IS_ENVIRONMENT {
        if globals.marks.w > 0.0 {
            let place = vec2(2.0, -2.0) * at.xy / globals.picture.xy + vec2(-1.0, 1.0);
            let scale = vec2(globals.clip_from_view[0][0], globals.clip_from_view[1][1]);
            let parallel = vec2(PARALLEL * globals.picture.x / globals.picture.y, PARALLEL);
            let along = normalize(vec3(place * select(parallel, 1.0 / scale, globals.picture.z > 0.0), -1.0));
            if globals.marks.w > 1.0 {
                return encoded(vec4(environment_mirrored(along, BLUR), 1.0));
            }
            return encoded(vec4(sky_seen(along), 1.0));
        }
    }
    let color = mix(globals.background[0], globals.background[1], at.y / globals.picture.y);
    return encoded(vec4(linear_from_srgb(color.rgb), color.a));
}
