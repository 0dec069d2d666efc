//! Transforms of texture coordinates (`KHR_texture_transform`).

use lodsmith_core::model::TextureRef;
use serde_json::Value;

use super::container::number;

/// A transform of texture coordinates from the lower left corner: rows of a matrix.
pub(super) type UvTransform = [[f32; 3]; 2];

/// Returns the set of texture coordinates that places a texture.
pub(super) fn set_of(slot: &Value) -> &Value {
    let transform = &slot["extensions"]["KHR_texture_transform"];
    if transform["texCoord"].is_null() { &slot["texCoord"] } else { &transform["texCoord"] }
}

/// Returns the transform of a texture.
pub(super) fn of_texture(slot: &Value) -> UvTransform {
    transform(&slot["extensions"]["KHR_texture_transform"])
}

/// Returns the transform of the first set of texture coordinates for a material: that of its first texture, colours
/// first.
pub(super) fn of_material(material: &Value) -> UvTransform {
    let glossy = &material["extensions"]["KHR_materials_pbrSpecularGlossiness"]["diffuseTexture"];
    let all = [
        glossy,
        &material["pbrMetallicRoughness"]["baseColorTexture"],
        &material["emissiveTexture"],
        &material["normalTexture"],
    ];
    let is_placed = |slot: &&&Value| slot["index"].is_number() && number(set_of(slot)).unwrap_or(0) == 0;
    all.iter().find(is_placed).map_or(TextureRef::PLAIN, |slot| of_texture(slot))
}

/// Applies a transform to texture coordinates.
pub(super) fn apply(transform: &UvTransform, uvs: &mut [[f32; 2]]) {
    if *transform != TextureRef::PLAIN {
        uvs.iter_mut().for_each(|uv| *uv = transform.map(|[a, b, c]| a * uv[0] + b * uv[1] + c));
    }
}

/// Converts a KHR_texture_transform, with the origin at the upper left corner, to the origin at the lower
/// left.
pub(super) fn transform(moved: &Value) -> [[f32; 3]; 2] {
    if !moved.is_object() {
        return TextureRef::PLAIN;
    }
    let [x, y] = numbers(&moved["offset"], [0.0; 2]);
    let [sx, sy] = numbers(&moved["scale"], [1.0; 2]);
    let (sin, cos) = finite(&moved["rotation"]).unwrap_or(0.0).sin_cos();
    // From the upper left: u' = a u + b v + x, v' = c u + d v + y. Both v are flipped.
    let (a, b, c, d) = (cos * sx, sin * sy, -sin * sx, cos * sy);
    [[a, -b, b + x], [-c, d, 1.0 - d - y]]
}

pub(super) fn finite(value: &Value) -> Option<f32> {
    value.as_f64().map(|x| x as f32).filter(|x| x.is_finite())
}

pub(super) fn numbers<const N: usize>(value: &Value, otherwise: [f32; N]) -> [f32; N] {
    let all: Option<Vec<f32>> = value.as_array().and_then(|all| all.iter().map(finite).collect());
    all.and_then(|all| all.try_into().ok()).unwrap_or(otherwise)
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;

    #[test]
    fn transforms_start_at_the_lower_left() {
        let plain = transform(&json!({}));
        assert_eq!(plain, TextureRef::PLAIN);
        // The upper left quarter of the image: from the lower left, v goes from a half to one.
        let quarter = transform(&json!({"scale": [0.5, 0.5]}));
        assert_eq!(quarter, [[0.5, 0.0, 0.0], [0.0, 0.5, 0.5]]);
        // A quarter turn counter-clockwise: (1, 0) from the upper left corner goes to (0, -1).
        let turned = transform(&json!({"rotation": std::f64::consts::FRAC_PI_2, "offset": [0.0, 1.0]}));
        let at = |u: f32, v: f32| turned.map(|[a, b, c]| a * u + b * (1.0 - v) + c);
        let near = |got: [f32; 2], u: f32, v: f32| {
            assert!((got[0] - u).abs() < 1e-6 && (1.0 - got[1] - v).abs() < 1e-6, "{got:?}");
        };
        near(at(0.0, 0.0), 0.0, 1.0);
        near(at(1.0, 0.0), 0.0, 0.0);
        near(at(0.0, 1.0), 1.0, 1.0);
    }
}
