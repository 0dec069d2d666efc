//! Whole files, as bytes.

use std::io::{self, Read, Write};

use js_sys::{Array, Function, Object, Uint8Array};
use lodsmith::{Control, Stage, Verdict};
use lodsmith_asset::request::{Request, Verb};
use lodsmith_asset::warnings::Spelling;
use lodsmith_asset::{AssetError, Sink, Source, Watch};
use serde_json::Map;
use wasm_bindgen::prelude::*;

use crate::errors::{cancelled, dashed, wrong_type, wrong_value};
use crate::options::{entries, json_of, vertices_of};
use crate::progress::Progress;
use crate::report::{report, set};

/// Memory limit of a job in bytes: three quarters of the 32-bit address space of the module.
const MEMORY: u64 = 3 << 30;

/// Simplifies all meshes of a GLB file, or of a glTF file with embedded buffers and images, with one target for all.
///
/// # Errors
/// If the file cannot be read, options are wrong, or the run failed or was cancelled.
#[wasm_bindgen(js_name = simplifyGlb)]
pub fn simplify_glb(bytes: &[u8], options: &JsValue, progress: Option<Function>) -> Result<Object, JsValue> {
    if !options.is_object() {
        return Err(wrong_type("an object of options is expected, such as { ratio: 0.1 }"));
    }
    let mut given = Map::new();
    given.insert("to".to_owned(), "glb".into());
    given.insert("max-memory".to_owned(), MEMORY.to_string().into());
    let (vertices, others) = vertices_of(entries(options))?;
    for (name, value) in others {
        given.insert(dashed(&name), json_of(&name, &value)?);
    }
    let mut request = Request::new(Verb::Simplify, &given, Spelling::Property).map_err(|e| error_of(&e))?;
    request.vertices = vertices;
    let mut watch = Bytes { input: bytes, output: Vec::new(), progress: Progress::new(progress) };
    let answer = request.run(&[Source::Stream], Some(&Sink::Stream), None, &mut watch);
    let answer = answer.map_err(|e| error_of(&e))?;
    let all = Object::new();
    set(&all, "bytes", &Uint8Array::from(&watch.output[..]));
    set(&all, "report", &report(answer.report));
    // (Without the name of the input, which is a stream.)
    let text = |text: &String| JsValue::from(text.strip_prefix("-: ").unwrap_or(text));
    set(&all, "warnings", &answer.warnings.iter().map(text).collect::<Array>());
    Ok(all)
}

/// The caller of a job on bytes.
struct Bytes<'b> {
    input: &'b [u8],
    output: Vec<u8>,
    progress: Progress,
}

impl Control for Bytes<'_> {
    fn stage(&mut self, stage: Stage) {
        self.progress.stage(stage);
    }
    fn progress(&mut self, done: f64) -> Verdict {
        self.progress.progress(done)
    }
}

impl Watch for Bytes<'_> {
    fn input(&mut self) -> Box<dyn Read + '_> {
        Box::new(io::Cursor::new(self.input))
    }
    fn output(&mut self) -> Box<dyn Write + '_> {
        Box::new(&mut self.output)
    }
}

/// Returns the error for a job that failed.
fn error_of(error: &AssetError) -> JsValue {
    let text = Spelling::Property.apply(&error.to_string());
    let text = text.strip_prefix("-: ").unwrap_or(&text);
    match error {
        AssetError::Cancelled => cancelled(),
        AssetError::UnknownOption { .. } => wrong_type(text),
        _ => wrong_value(text),
    }
}
