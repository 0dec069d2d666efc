// Picking: writes the number of the face at a pixel, from 1, and the bits of its depth.

@fragment
fn fs(in: Varying) -> @location(0) vec2<u32> {
    return vec2(in.id + 1u, bitcast<u32>(in.clip.z));
}
