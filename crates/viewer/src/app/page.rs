//! The window inside a page of a browser.

use std::path::{Path, PathBuf};
use std::rc::Rc;

use eframe::egui;
use lodsmith_io::Format;

use super::App;
use super::dialog::Purpose;
use super::options::ViewOptions;
use crate::document::Document;
use crate::gpu::GpuError;
use crate::page::BrowserPage;

impl App {
    /// Creates the window inside a page.
    ///
    /// # Errors
    /// As [`App::new`].
    pub fn on_page(cc: &eframe::CreationContext<'_>, page: Rc<dyn BrowserPage>) -> Result<Self, GpuError> {
        let options = ViewOptions { remember: false, use_system_dialogs: false, ..ViewOptions::default() };
        let mut app = Self::new(cc, &options)?;
        let (context, ctx) = (app.document.context().cloned(), cc.egui_ctx.clone());
        app.document = Document::on_page(context, &page, move || ctx.request_repaint());
        app.facts.is_on_page = true;
        app.page = Some(page);
        Ok(app)
    }

    /// Lets the user choose files on the page, or saves under the suggested name. Returns false without a page.
    pub(super) fn choose_on_page(&mut self, purpose: Purpose, start: &Path) -> bool {
        let Some(page) = &self.page else { return false };
        if purpose == Purpose::ExportFolder {
            return true;
        }
        if !purpose.is_saving() {
            self.choosing = Some(purpose);
            page.choose_files(&purpose.endings(), purpose == Purpose::Open);
            return true;
        }
        let (page, start) = (page.clone(), start.to_owned());
        self.chosen(purpose, vec![start.clone()]);
        page.save_written(&start);
        true
    }

    /// Opens files that were dropped on the page, or chosen.
    pub(super) fn take_files_of_page(&mut self) {
        let Some(page) = &self.page else { return };
        let paths = page.take_opened();
        if paths.is_empty() {
            return;
        }
        let purpose = self.choosing.take().filter(|purpose| *purpose != Purpose::Open);
        let count = paths.len();
        let (models, others): (Vec<PathBuf>, Vec<PathBuf>) = paths.into_iter().partition(|p| is_model(p));
        let is_session = |p: &PathBuf| p.extension().is_some_and(|e| e.eq_ignore_ascii_case("json"));
        match purpose {
            // The dialog may have been cancelled before these were dropped.
            _ if !models.is_empty() => self.open(models),
            Some(purpose) => self.chosen(purpose, others),
            None if others.iter().any(is_session) => self.open(others),
            None => {
                let names = Format::ALL.map(|f| f.name().to_uppercase()).join(", ");
                self.fail(format!("none of the {count} files is a model ({names})"));
            }
        }
    }

    /// Puts the sample model among the files of the page; returns false without a page.
    pub(super) fn open_sample_on_page(&mut self, name: &str, bytes: &[u8]) -> bool {
        let Some(page) = &self.page else { return false };
        page.put_file(name, bytes);
        self.open(vec![PathBuf::from(name)]);
        true
    }

    /// Shows an error of the page, such as an archive that cannot be read.
    pub fn fail_on_page(&mut self, why: String) {
        self.fail(why);
    }

    /// Offers a file that was written for download, if there is a page.
    pub(super) fn hand_over(&self, path: &Path) {
        if let Some(page) = &self.page {
            page.save_written(path);
        }
    }
}

/// Returns true if the name is that of a model.
fn is_model(path: &Path) -> bool {
    let is_gz = path.extension().is_some_and(|e| e.eq_ignore_ascii_case("gz"));
    let plain = if is_gz { path.with_extension("") } else { path.to_owned() };
    plain.extension().and_then(|e| e.to_str()).is_some_and(|e| Format::from_name(e).is_some())
}

/// Does work on another thread if there are threads.
pub(super) fn in_background(ctx: egui::Context, work: impl FnOnce() + Send + 'static) {
    let work = move || {
        work();
        ctx.request_repaint();
    };
    if cfg!(target_arch = "wasm32") {
        work();
    } else {
        std::thread::spawn(work);
    }
}
