//! Files and open documents for tests without a window.

use std::path::Path;
use std::time::Duration;

use lodsmith_core::TriMesh;
use lodsmith_viewer::command::Command;
use lodsmith_viewer::document::Document;
use lodsmith_viewer::gpu::Context;

/// Time after which work is taken to never end.
pub(crate) const TIMEOUT: Duration = Duration::from_secs(120);

/// Returns a folder with these files.
pub(crate) fn folder_with<const N: usize>(files: [(&str, TriMesh); N]) -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    for (name, mesh) in files {
        lodsmith_io::write_path(&mesh, &folder.path().join(name), &Default::default()).unwrap();
    }
    folder
}

/// Returns a document in which this file is open.
pub(crate) fn opened(path: &Path) -> Document {
    opened_with(None, path)
}

/// Returns a document in which this file is open and uploaded.
pub(crate) fn opened_with(context: Option<Context>, path: &Path) -> Document {
    let mut document = Document::new(context, || {});
    document.run(Command::Open(vec![path.to_owned()]));
    assert!(document.settle(TIMEOUT), "opening never ends");
    document
}
