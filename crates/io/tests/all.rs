//! Tests of the whole crate, in one program: each program links everything again (docs/decisions/0026).

mod colors;
mod compressed;
mod copies;
mod dae;
mod discrete;
mod gltf_scene;
mod levels;
mod limits;
mod looks;
mod lpm;
mod malformed;
mod malformed_binary;
mod materials;
mod model;
mod mutations;
mod packed;
mod record;
mod regressions;
mod roundtrip;
mod roundtrip_binary;
mod scene_materials;
mod scenes;
mod shapes;
mod three_mf;
mod three_mf_scene;
