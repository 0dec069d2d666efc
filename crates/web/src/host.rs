//! The viewer's calls to the page: files, workers and downloads, through JavaScript functions.

use std::path::{Path, PathBuf};

use js_sys::{Array, Reflect, Uint8Array};
use lodsmith_io::drive::memory;
use lodsmith_viewer::page::{BrowserPage, PageWorker, WorkerMessage};
use wasm_bindgen::prelude::*;

#[wasm_bindgen]
extern "C" {
    /// The JavaScript object that serves the viewer: see `page.js`.
    pub type Host;

    #[wasm_bindgen(method, js_name = startWorker)]
    fn start_worker(this: &Host, wake: &JsValue) -> HostWorker;
    #[wasm_bindgen(method, js_name = chooseFiles)]
    fn choose_files(this: &Host, extensions: Vec<String>, are_models: bool);
    #[wasm_bindgen(method, js_name = putFile)]
    fn put_file(this: &Host, path: &str, bytes: &Uint8Array);
    #[wasm_bindgen(method, js_name = takeOpened)]
    fn take_opened(this: &Host) -> Vec<String>;
    #[wasm_bindgen(method)]
    fn save(this: &Host, name: &str, bytes: &Uint8Array);
    #[wasm_bindgen(method, js_name = saveAll)]
    fn save_all(this: &Host, folder: &str, files: &Array);

    /// A worker of the page.
    pub type HostWorker;

    #[wasm_bindgen(method)]
    fn post(this: &HostWorker, request: &str);
    #[wasm_bindgen(method)]
    fn poll(this: &HostWorker) -> JsValue;
    #[wasm_bindgen(method)]
    fn end(this: &HostWorker);
}

/// The page.
pub(crate) struct WebPage(pub(crate) Host);

impl BrowserPage for WebPage {
    fn start_worker(&self, wake: Box<dyn Fn()>) -> Box<dyn PageWorker> {
        let wake = Closure::<dyn Fn()>::new(wake);
        let worker = self.0.start_worker(wake.as_ref());
        Box::new(WebWorker { worker, _wake: wake })
    }

    fn choose_files(&self, extensions: &[&str], are_models: bool) {
        let extensions = extensions.iter().map(|&e| e.to_owned()).collect();
        self.0.choose_files(extensions, are_models);
    }

    fn put_file(&self, path: &str, bytes: &[u8]) {
        self.0.put_file(path, &Uint8Array::from(bytes));
    }

    fn take_opened(&self) -> Vec<PathBuf> {
        self.0.take_opened().into_iter().map(PathBuf::from).collect()
    }

    fn save_written(&self, path: &Path) {
        if let Some(bytes) = memory::take(path) {
            let name = path.file_name().unwrap_or_default().to_string_lossy();
            self.save(&name, &bytes);
        }
    }

    fn save(&self, name: &str, bytes: &[u8]) {
        self.0.save(name, &Uint8Array::from(bytes));
    }

    fn save_all(&self, folder: &str, files: &[(&str, &[u8])]) {
        let pair = |(name, bytes): &(&str, &[u8])| Array::of2(&(*name).into(), &Uint8Array::from(*bytes));
        self.0.save_all(folder, &files.iter().map(pair).collect());
    }
}

struct WebWorker {
    worker: HostWorker,
    /// Called by JavaScript.
    _wake: Closure<dyn Fn()>,
}

impl Drop for WebWorker {
    fn drop(&mut self) {
        self.worker.end();
    }
}

impl PageWorker for WebWorker {
    fn post(&self, request: &str) {
        self.worker.post(request);
    }

    fn poll(&self) -> Option<WorkerMessage> {
        let message = self.worker.poll();
        let get = |name: &str| Reflect::get(&message, &name.into()).ok().filter(|x| !x.is_undefined());
        if !message.is_object() {
            None
        } else if let Some(answer) = get("answer") {
            Some(WorkerMessage::Answer(Uint8Array::new(&answer).to_vec()))
        } else if let Some(failed) = get("failed") {
            Some(WorkerMessage::Failed(failed.as_string().unwrap_or_default()))
        } else {
            let done = get("done").and_then(|x| x.as_f64()).unwrap_or(0.0);
            let stage = get("stage").and_then(|x| x.as_string()).unwrap_or_default();
            Some(WorkerMessage::Progress(done, stage))
        }
    }
}
