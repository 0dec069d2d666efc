//! The page of a browser around the viewer: its workers and its files.
//!
//! A browser has no threads that share memory with the window, no file system and no dialogs that wait. The
//! viewer sends jobs as text to a worker, which runs an [`Engine`](crate::document::Engine), and gets bytes
//! back.

use std::path::{Path, PathBuf};

/// The page around the viewer.
pub trait BrowserPage {
    /// Starts a worker. `wake` is called when it has a message.
    fn start_worker(&self, wake: Box<dyn Fn()>) -> Box<dyn PageWorker>;
    /// Lets the user choose files with these extensions; they are passed on by [`BrowserPage::take_opened`]. Files
    /// other than models are put into the memory of the window.
    fn choose_files(&self, extensions: &[&str], are_models: bool);
    /// Adds a file to those that can be opened.
    fn put_file(&self, path: &str, bytes: &[u8]);
    /// Returns the paths of files that were dropped or chosen and not opened yet.
    fn take_opened(&self) -> Vec<PathBuf>;
    /// Offers a file that the window has written into its memory for download.
    fn save_written(&self, path: &Path);
    /// Offers a file for download.
    fn save(&self, name: &str, bytes: &[u8]);
    /// Offers several files for download at once.
    fn save_all(&self, folder: &str, files: &[(&str, &[u8])]);
}

/// A worker of the page. It ends when it is dropped.
pub trait PageWorker {
    /// Sends a request.
    fn post(&self, request: &str);
    /// Returns the next message.
    fn poll(&self) -> Option<WorkerMessage>;
}

/// A message of a worker.
#[derive(Clone, Debug, PartialEq)]
pub enum WorkerMessage {
    /// Progress from 0 to 1 of a stage.
    Progress(f64, String),
    /// The answer to a request.
    Answer(Vec<u8>),
    /// The worker has failed.
    Failed(String),
}
