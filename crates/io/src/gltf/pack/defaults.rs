//! Shorter JSON of the same content: properties with their default value are left out, and single-precision numbers
//! have no more digits than they need.

use serde_json::{Value, json};

use super::super::container::list_mut;

/// Leaves out default values and digits. With `has_pointers` (`KHR_animation_pointer`) all properties stay.
pub(super) fn shorten(json: &mut Value, has_pointers: bool) {
    if !has_pointers {
        leave_out(json);
    }
    let numbers = [
        ("nodes", ["matrix", "translation", "rotation", "scale"].as_slice()),
        ("accessors", ["min", "max"].as_slice()),
    ];
    for (list, keys) in numbers {
        for object in list_mut(json, list) {
            for key in keys {
                object.get_mut(*key).into_iter().for_each(shorten_numbers);
            }
        }
    }
    for material in list_mut(json, "materials") {
        let pointers = ["/emissiveFactor", "/pbrMetallicRoughness/baseColorFactor"];
        for pointer in pointers {
            material.pointer_mut(pointer).into_iter().for_each(shorten_numbers);
        }
    }
}

/// Source: Khronos, "glTF 2.0 Specification", properties reference.
fn leave_out(json: &mut Value) {
    for node in list_mut(json, "nodes") {
        let identity = json!([1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1]);
        let defaults = [
            ("matrix", identity),
            ("translation", json!([0, 0, 0])),
            ("rotation", json!([0, 0, 0, 1])),
            ("scale", json!([1, 1, 1])),
        ];
        without(node, &defaults);
    }
    for primitive in list_mut(json, "meshes").iter_mut().flat_map(|m| list_mut(m, "primitives")) {
        without(primitive, &[("mode", json!(4))]);
    }
    for sampler in list_mut(json, "animations").iter_mut().flat_map(|a| list_mut(a, "samplers")) {
        without(sampler, &[("interpolation", json!("LINEAR"))]);
    }
    for sampler in list_mut(json, "samplers") {
        without(sampler, &[("wrapS", json!(10497)), ("wrapT", json!(10497))]);
    }
    for material in list_mut(json, "materials") {
        let defaults = [
            ("emissiveFactor", json!([0, 0, 0])),
            ("alphaMode", json!("OPAQUE")),
            ("doubleSided", json!(false)),
        ];
        without(material, &defaults);
        if let Some(colors) = material.get_mut("pbrMetallicRoughness") {
            let defaults = [
                ("baseColorFactor", json!([1, 1, 1, 1])),
                ("metallicFactor", json!(1)),
                ("roughnessFactor", json!(1)),
            ];
            without(colors, &defaults);
        }
        let textures = [
            "/pbrMetallicRoughness/baseColorTexture",
            "/pbrMetallicRoughness/metallicRoughnessTexture",
            "/normalTexture",
            "/occlusionTexture",
            "/emissiveTexture",
        ];
        for pointer in textures {
            if let Some(texture) = material.pointer_mut(pointer) {
                without(texture, &[("texCoord", json!(0)), ("scale", json!(1)), ("strength", json!(1))]);
            }
        }
    }
}

/// Removes the properties of an object that have these values.
fn without(object: &mut Value, defaults: &[(&str, Value)]) {
    let Some(object) = object.as_object_mut() else { return };
    for (key, default) in defaults {
        if object.get(*key).is_some_and(|value| is_same(value, default)) {
            object.shift_remove(*key);
        }
    }
}

/// Returns true for equal values, `1.0` and `1` among them.
fn is_same(a: &Value, b: &Value) -> bool {
    match (a, b) {
        (Value::Number(a), Value::Number(b)) => a.as_f64() == b.as_f64(),
        (Value::Array(a), Value::Array(b)) => {
            a.len() == b.len() && a.iter().zip(b).all(|(a, b)| is_same(a, b))
        }
        _ => a == b,
    }
}

/// Writes the numbers of an array with the digits that single precision needs, where they are no more precise.
fn shorten_numbers(value: &mut Value) {
    for number in value.as_array_mut().into_iter().flatten() {
        let Some(exact) = number.as_f64().filter(|x| number.is_f64() && f64::from(*x as f32) == *x) else {
            continue;
        };
        // (A negative zero stays: it is no integer.)
        let is_whole = exact.fract() == 0.0 && exact.abs() < 1e9 && exact.to_bits() != (-0.0f64).to_bits();
        let short: Result<f64, _> = (exact as f32).to_string().parse();
        match short {
            _ if is_whole => *number = (exact as i64).into(),
            Ok(short) => *number = short.into(),
            Err(_) => {}
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn defaults_and_needless_digits_go_and_nothing_else() {
        let third = f64::from(1f32 / 3.0);
        let source = json!({
            "nodes": [
                {"name": "a", "translation": [0.0, 0, 0], "rotation": [0, 0, 0, 1.0], "scale": [2.0, third, 0.1]},
                {"matrix": [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 5, 0, 0, 1]},
            ],
            "meshes": [{"primitives": [{"mode": 4}, {"mode": 1}]}],
            "animations": [{"samplers": [{"interpolation": "LINEAR"}, {"interpolation": "STEP"}]}],
            "samplers": [{"wrapS": 10497, "wrapT": 33071}],
            "materials": [{
                "alphaMode": "MASK", "doubleSided": false,
                "pbrMetallicRoughness": {"metallicFactor": 1, "roughnessFactor": 0.5},
                "normalTexture": {"index": 0, "texCoord": 0, "scale": 2},
            }],
        });
        let mut short = source.clone();
        shorten(&mut short, false);
        let expected = json!({
            "nodes": [
                {"name": "a", "scale": [2, 0.33333334, 0.1]},
                {"matrix": [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 5, 0, 0, 1]},
            ],
            "meshes": [{"primitives": [{}, {"mode": 1}]}],
            "animations": [{"samplers": [{}, {"interpolation": "STEP"}]}],
            "samplers": [{"wrapT": 33071}],
            "materials": [{
                "alphaMode": "MASK",
                "pbrMetallicRoughness": {"roughnessFactor": 0.5},
                "normalTexture": {"index": 0, "scale": 2},
            }],
        });
        assert_eq!(short, expected);
        let mut kept = source.clone();
        shorten(&mut kept, true);
        assert_eq!(kept["materials"], source["materials"]);
        assert_eq!(kept["animations"], source["animations"]);
    }
}
