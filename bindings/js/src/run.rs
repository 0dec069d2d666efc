//! Simplification of meshes and scenes.

use js_sys::{Array, Function, Object};
use lodsmith::{Input, Part, SimplifiedScene, simplify_scene, simplify_with};
use lodsmith_asset::report_json;
use wasm_bindgen::prelude::*;

use crate::errors::run_error;
use crate::mesh::{GivenMesh, list_of};
use crate::options::{options_of, property};
use crate::progress::Progress;
use crate::report::{object, report, set};

/// Simplifies a mesh.
///
/// # Errors
/// If the arrays are not a mesh, options are wrong, or the run failed or was cancelled.
#[wasm_bindgen(js_name = simplifyMesh)]
pub fn simplify_mesh(
    mesh: &JsValue,
    options: &JsValue,
    progress: Option<Function>,
) -> Result<Object, JsValue> {
    let (options, data) = options_of(options)?;
    let given = GivenMesh::of(mesh)?;
    let input = Input::new(&given.mesh).with(data.view());
    let done = simplify_with(&input, &options, &mut Progress::new(progress)).map_err(|e| run_error(&e))?;
    let arrays = given.arrays_of(done.mesh);
    set(&arrays, "report", &report(report_json::run(&done.report, &options)));
    Ok(arrays)
}

/// Simplifies meshes with one target for all. In addition to its arrays, each has `instances`, `scale` and `system`;
/// `diagonal` is the diagonal of the scene.
///
/// # Errors
/// Those of [`simplify_mesh`].
#[wasm_bindgen(js_name = simplifyScene)]
pub fn simplify_meshes(
    meshes: &JsValue,
    diagonal: f64,
    options: &JsValue,
    progress: Option<Function>,
) -> Result<Object, JsValue> {
    let (options, data) = options_of(options)?;
    let objects: Vec<JsValue> = list_of(meshes)?.iter().collect();
    let given: Result<Vec<GivenMesh>, JsValue> = objects.iter().map(GivenMesh::of).collect();
    let given = given?;
    let counts: Vec<usize> = given.iter().map(|own| own.mesh.vertex_count()).collect();
    let data = data.split(&counts).map_err(|e| run_error(&e))?;
    let number = |of: &JsValue, name: &str| property(of, name).and_then(|x| x.as_f64());
    let parts: Vec<Part<'_>> = objects
        .iter()
        .zip(&given)
        .zip(&data)
        .map(|((object, given), data)| Part {
            instances: number(object, "instances").map_or(1, |x| x as usize),
            scale: number(object, "scale").unwrap_or(1.0),
            system: number(object, "system").map(|x| x as usize),
            data: data.view(),
            ..Part::new(&given.mesh)
        })
        .collect();
    let done = simplify_scene(&parts, diagonal, &options, &mut Progress::new(progress));
    let SimplifiedScene { meshes, report: of_run, counts } = done.map_err(|e| run_error(&e))?;
    let lighter: Array = meshes.into_iter().zip(&given).map(|(mesh, given)| given.arrays_of(mesh)).collect();
    let counts: Array = counts
        .iter()
        .map(|c| {
            object([
                ("instances", (c.instances as f64).into()),
                ("inputFaces", (c.input_faces as f64).into()),
                ("inputVertices", (c.input_vertices as f64).into()),
                ("faces", (c.faces as f64).into()),
                ("vertices", (c.vertices as f64).into()),
                ("reached", c.reached.into()),
            ])
        })
        .collect();
    let all = Object::new();
    set(&all, "meshes", &lighter);
    set(&all, "counts", &counts);
    set(&all, "report", &report(report_json::run(&of_run, &options)));
    Ok(all)
}
