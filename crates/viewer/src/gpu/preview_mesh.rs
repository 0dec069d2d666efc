//! Preview mesh of a large model on software adapters, shown while the camera moves: the model, clustered
//! coarsely.

use std::sync::{Arc, Mutex};

use lodsmith::{MethodKind, SimplifyOptions, Stop};
use lodsmith_core::{Model, TriMesh};

use crate::gpu::shown::Drawing;
use crate::gpu::{Context, DrawModel};

/// Models with more triangles have a preview mesh: a software adapter takes most of a second to draw them.
pub const PREVIEW_ABOVE_FACES: usize = 400_000;
/// Number of triangles of a preview mesh. These and a quarter of the pixels of a window take about 0.1 s.
/// (Measured.)
const PREVIEW_FACES: usize = 60_000;

/// Uploads a model, with a preview mesh if it needs one. Slow: meant for a worker thread.
pub fn upload(context: &Context, model: &Model) -> Drawing {
    Arc::new(Mutex::new(draw_model(context, model)))
}

/// Uploads a model like [`upload`].
pub(crate) fn draw_model(context: &Context, model: &Model) -> DrawModel {
    let light = if context.is_software() { preview_of(model) } else { None };
    draw_both(context, model, light.as_ref())
}

/// Uploads a model and its preview mesh, if it has one.
pub fn upload_both(context: &Context, model: &Model, light: Option<&Model>) -> Drawing {
    Arc::new(Mutex::new(draw_both(context, model, light)))
}

fn draw_both(context: &Context, model: &Model, light: Option<&Model>) -> DrawModel {
    let mut drawn = context.upload(model);
    if let Some(light) = light {
        drawn.set_preview(context.upload_like(light, &drawn));
    }
    drawn
}

/// Returns the preview mesh of a model; `None` if it is small, or clustering does not reduce it enough.
pub fn preview_of(model: &Model) -> Option<Model> {
    let all: usize = model.meshes.iter().map(|m| m.mesh.face_count()).sum();
    if all <= PREVIEW_ABOVE_FACES {
        return None;
    }
    let ratio = PREVIEW_FACES as f64 / all as f64;
    let clustered = |mesh: &Arc<TriMesh>| {
        let mut options = SimplifyOptions::new(Stop::ratio(ratio));
        options.method = MethodKind::Cluster.into();
        let done = lodsmith::simplify(mesh, &options);
        done.map_or_else(|_| mesh.clone(), |done| Arc::new(without_normals(done.mesh)))
    };
    let light = model.with_meshes(model.meshes.iter().map(|m| clustered(&m.mesh)).collect());
    let left: usize = light.meshes.iter().map(|m| m.mesh.face_count()).sum();
    (left < all / 2).then_some(light)
}

/// Drops the normals: those of clustered vertices may point away from the coarse faces, which shows as specks.
fn without_normals(mut mesh: TriMesh) -> TriMesh {
    mesh.set_normals(None).expect("no normals always fit");
    mesh
}

#[cfg(test)]
mod tests {
    use lodsmith_core::shapes;

    use super::*;

    #[test]
    fn a_large_model_has_a_preview_mesh_at_its_position() {
        let model = Model::of_mesh(shapes::torus(900, 260));
        let light = preview_of(&model).unwrap();
        let faces = light.meshes[0].mesh.face_count();
        assert!((PREVIEW_FACES / 3..=PREVIEW_FACES).contains(&faces), "{faces}");
        let [one, two] = [&model, &light].map(|m| m.bounds(&Default::default()).unwrap());
        assert!((0..3).all(|k| (one.max[k] - two.max[k]).abs() < 0.02), "{one:?} {two:?}");
        assert!(preview_of(&Model::of_mesh(shapes::torus(300, 200))).is_none());
    }
}
