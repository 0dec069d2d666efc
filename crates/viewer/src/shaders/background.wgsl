// One triangle over the whole picture, from the colour of the upper edge to that of the lower one.

@vertex
fn vs(@builtin(vertex_index) corner: u32) -> @builtin(position) vec4<f32> {
    return vec4(f32(corner & 1u) * 4.0 - 1.0, f32(corner >> 1u) * 4.0 - 1.0, 0.0, 1.0);
}

@fragment
fn fs(@builtin(position) at: vec4<f32>) -> @location(0) vec4<f32> {
    let color = mix(globals.background[0], globals.background[1], at.y / globals.picture.y);
    return encoded(vec4(linear_from_srgb(color.rgb), color.a));
}
