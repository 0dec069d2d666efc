//! The window on a canvas.

use std::path::Path;
use std::rc::Rc;
use std::sync::{Arc, Mutex, PoisonError};

use eframe::egui;
use lodsmith_io::drive::memory;
use lodsmith_viewer::app::App;
use lodsmith_viewer::gpu::Context;
use serde_json::{Value, json};
use wasm_bindgen::prelude::*;

use crate::host::{Host, WebPage};

/// Opens the window on a canvas.
///
/// # Errors
/// If neither WebGPU nor WebGL 2 is available.
#[wasm_bindgen]
pub async fn start(canvas: web_sys::HtmlCanvasElement, host: Host) -> Result<Window, JsValue> {
    let mut options = eframe::WebOptions::default();
    options.wgpu_options.wgpu_setup = Context::setup();
    let runner = eframe::WebRunner::new();
    let page = Rc::new(WebPage(host));
    let (tree, context) = (Tree::default(), Rc::new(std::cell::OnceCell::new()));
    let (its_tree, its_context) = (tree.clone(), context.clone());
    let create: eframe::AppCreator<'static> = Box::new(move |cc| {
        let _ = its_context.set(cc.egui_ctx.clone());
        cc.egui_ctx.add_plugin(its_tree);
        Ok(Box::new(App::on_page(cc, page)?))
    });
    runner.start(canvas, options, create).await?;
    let context = context.get().cloned().unwrap_or_default();
    Ok(Window { runner, context, tree })
}

/// The open window, for the JavaScript of the page.
#[wasm_bindgen]
pub struct Window {
    runner: eframe::WebRunner,
    context: egui::Context,
    tree: Tree,
}

#[wasm_bindgen]
impl Window {
    /// Redraws the window, because the page has something new.
    pub fn wake(&self) {
        self.context.request_repaint();
    }

    /// Shows an error of the page.
    pub fn fail(&self, why: String) {
        if let Some(mut app) = self.runner.app_mut::<App>() {
            app.fail_on_page(why);
        }
        self.context.request_repaint();
    }

    /// Stores a small file, such as a session, in the memory that the window reads.
    #[wasm_bindgen(js_name = putFile)]
    pub fn put_file(&self, path: &str, bytes: Vec<u8>) {
        memory::put(Path::new(path), bytes);
    }

    /// Returns the state of the window as JSON: counts of the original and the result, measured errors, and
    /// running jobs.
    #[must_use]
    pub fn state(&self) -> String {
        let Some(app) = self.runner.app_mut::<App>() else { return "null".to_owned() };
        let document = app.document();
        let original = document.original().map(
            |o| json!({ "path": o.content.path, "faces": o.content.faces, "vertices": o.content.vertices }),
        );
        let result = document.lighter().map(|l| {
            let is_exact = l.content.report.is_some();
            json!({ "faces": l.content.faces, "vertices": l.content.vertices, "isExact": is_exact })
        });
        let distances = document.distances().map(|d| json!({ "largest": d.largest, "rms": d.rms }));
        let difference = document.difference().map(|d| d.drawn.mean);
        let progress = document.progress().map(|p| json!({ "job": p.kind.title(), "done": p.done }));
        json!({
            "original": original, "result": result, "distances": distances, "difference": difference, "progress": progress,
            "isDrawn": app.triangles_left() == 0 && document.original().is_some(),
            "isIdle": document.is_idle() && app.triangles_left() == 0, "hasPreview": document.has_preview(),
            "problem": document.problem, "adapter": app.adapter(),
            "command": document.original().map(|_| app.command_line()),
        })
        .to_string()
    }

    /// Returns the widgets of the window as JSON, from the accessibility tree: role, name, value and rectangle in
    /// points. The first call enables the tree; it is empty until the window has been redrawn.
    #[must_use]
    pub fn widgets(&self) -> String {
        self.context.enable_accesskit();
        self.context.request_repaint();
        self.tree.0.lock().unwrap_or_else(PoisonError::into_inner).to_string()
    }
}

/// Keeps the latest accessibility tree.
#[derive(Clone, Default)]
struct Tree(Arc<Mutex<Value>>);

impl egui::Plugin for Tree {
    fn debug_name(&self) -> &'static str {
        "widgets"
    }

    fn output_hook(&mut self, _: &egui::Context, output: &mut egui::FullOutput) {
        let Some(update) = &output.platform_output.accesskit_update else { return };
        let widget = |(_, node): &(egui::accesskit::NodeId, egui::accesskit::Node)| {
            let name = node.label().or(node.value())?;
            let r = node.bounds()?;
            let (role, value) = (format!("{:?}", node.role()), node.numeric_value());
            Some(json!({ "role": role, "name": name, "value": value, "rect": [r.x0, r.y0, r.x1, r.y1] }))
        };
        let all = update.nodes.iter().filter_map(widget).collect();
        *self.0.lock().unwrap_or_else(PoisonError::into_inner) = Value::Array(all);
    }
}
