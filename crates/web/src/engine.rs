//! The engine in a worker.

use std::path::{Path, PathBuf};

use js_sys::Function;
use lodsmith_io::drive::memory;
use lodsmith_viewer::document::Engine;
use wasm_bindgen::prelude::*;

/// The engine of a worker, with its files in memory.
#[wasm_bindgen]
#[derive(Default)]
pub struct WebEngine {
    engine: Engine,
}

#[wasm_bindgen]
impl WebEngine {
    /// Creates an engine without files.
    #[wasm_bindgen(constructor)]
    #[must_use]
    pub fn new() -> Self {
        Self::default()
    }

    /// Returns whether this request needs files of the page: [`put_file`](Self::put_file) them before `run`.
    #[wasm_bindgen(js_name = needsFiles)]
    #[must_use]
    pub fn needs_files(&self, request: &str) -> bool {
        self.engine.needs_files(request)
    }

    /// Stores a file in the memory of this worker.
    #[wasm_bindgen(js_name = putFile)]
    pub fn put_file(&mut self, path: &str, bytes: Vec<u8>) {
        memory::put(Path::new(path), bytes);
    }

    /// Runs a request and removes the files. `report` is called with the progress from 0 to 1 and the name of
    /// the stage.
    pub fn run(&mut self, request: &str, report: Function) -> Vec<u8> {
        let answer = self.engine.run(request, move |done, stage| {
            let _ = report.call2(&JsValue::NULL, &done.into(), &stage.into());
        });
        let left: Vec<PathBuf> = memory::paths();
        left.iter().for_each(|path| drop(memory::take(path)));
        answer
    }
}
