// Lines of constant width along marked edges: two triangles each, whose ends read their wedges from the
// indices of the marks. The third number of an edge is its kind.

struct Line {
    @builtin(position) clip: vec4<f32>,
    @location(0) across: f32,
    @location(1) @interpolate(flat) kind: u32,
}

@vertex
fn line(@builtin(vertex_index) corner: u32, @builtin(instance_index) which: u32) -> Line {
    let edge = corner / 6u;
    let k = corner % 6u;
    let instance = instance_at(which);
    let kind = index_at(3u * edge + 2u);
    let a = globals.clip_from_view * vec4(placed(index_at(3u * edge), instance, vec3(0.0)).place, 1.0);
    let b = globals.clip_from_view * vec4(placed(index_at(3u * edge + 1u), instance, vec3(0.0)).place, 1.0);
    // Corners: a left, a right, b left; then a right, b left, b right.
    let at_b = k == 2u || k == 4u || k == 5u;
    let side = select(-1.0, 1.0, k == 1u || k == 3u || k == 5u);
    let size = globals.picture.xy;
    let way = (b.xy / max(b.w, 1e-6) - a.xy / max(a.w, 1e-6)) * size;
    let along = select(vec2(1.0, 0.0), normalize(way), dot(way, way) > 1e-12);
    let half = 0.5 * globals.widths.y + 0.5;
    let out_px = vec2(-along.y, along.x) * side * half + along * select(-0.5, 0.5, at_b);
    var clip = select(a, b, at_b);
    // Lines with an end behind the camera are not drawn.
    let kind_is_shown = (kind == 0u && globals.marks.x > 0.5) || (kind != 0u && globals.marks.y > 0.5);
    let shown = a.w > 0.0 && b.w > 0.0 && kind_is_shown;
    // Slightly nearer than the surface below: depth is the inverse of distance, or decreases with it.
    let nearer = select(clip.z + 3e-3 * clip.w * globals.clip_from_view[2][2], clip.z * 1.003, globals.picture.z > 0.5);
    clip = vec4(clip.xy + 2.0 * out_px / size * clip.w, nearer, clip.w);
    var out: Line;
    out.clip = select(vec4(0.0, 0.0, -1.0, 1.0), clip, shown);
    out.across = side * half;
    out.kind = kind;
    return out;
}

// Opacity of the lines.
override OPACITY: f32 = 1.0;

@fragment
fn fs(in: Line) -> @location(0) vec4<f32> {
    let cover = clamp(half_width() + 0.5 - abs(in.across), 0.0, 1.0);
    let color = globals.mark_colors[in.kind].rgb;
    return encoded(vec4(linear_from_srgb(color), cover * OPACITY));
}

fn half_width() -> f32 {
    return 0.5 * globals.widths.y;
}
