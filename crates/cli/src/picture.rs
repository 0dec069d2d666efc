//! Pictures: in which format they go where, and what most of them look like.

use std::ffi::OsString;
use std::fs;
use std::io::Write as _;
use std::path::Path;

use anyhow::{Context as _, anyhow};
use lodsmith::core::{Bounds, Image, TriMesh};
use lodsmith_render::{Background, Panel, PictureFormat, StandardView, Subject, View, encode, render};

use crate::exit::{self, usage};
use crate::file::{self, Sink};

/// The format of a picture by the ending of its file; standard output gets PNG.
///
/// # Errors
/// A fault of the command line: an ending that is none of a picture, or a folder.
pub(crate) fn format_of(sink: &Sink) -> anyhow::Result<PictureFormat> {
    file::refuse_folder(sink, "")?;
    match sink {
        Sink::Stdout => Ok(PictureFormat::Png),
        Sink::Path(path) => of_path(path).ok_or_else(|| {
            usage(format!("{}: the name of a .png, .jpg or .webp file is wanted", path.display()))
        }),
    }
}

/// The format of a picture by the ending of a path; `None` if it is none of a picture.
pub(crate) fn of_path(path: &Path) -> Option<PictureFormat> {
    path.extension().and_then(|e| e.to_str()).and_then(PictureFormat::of_ending)
}

/// Writes a picture whole or not at all.
pub(crate) fn write(picture: &Image, sink: &Sink, format: PictureFormat) -> anyhow::Result<()> {
    let bytes = encode(picture, format).with_context(|| format!("{sink}: cannot be stored"))?;
    let path = match sink {
        Sink::Path(path) => path,
        Sink::Stdout => {
            return match std::io::stdout().lock().write_all(&bytes) {
                // Whoever closed the pipe had what it wanted.
                Err(e) if e.kind() != std::io::ErrorKind::BrokenPipe => {
                    Err(anyhow!("cannot write to standard output: {e}"))
                }
                _ => Ok(()),
            };
        }
    };
    let _guard = exit::writing()?;
    let said = |e: std::io::Error| anyhow!("{}: cannot write: {e}", path.display());
    // What is no plain file (a pipe, a device) has no neighbour to be replaced by.
    if fs::metadata(path).is_ok_and(|a| !a.is_file()) {
        return fs::write(path, &bytes).map_err(said);
    }
    if fs::metadata(path).is_ok_and(|a| a.permissions().readonly()) {
        return Err(anyhow!("{}: is write-protected", path.display()));
    }
    let mut name = OsString::from(format!(".lodsmith-{}-", std::process::id()));
    name.push(path.file_name().unwrap_or_default());
    let neighbour = path.with_file_name(name);
    let written = fs::write(&neighbour, &bytes).and_then(|()| fs::rename(&neighbour, path));
    if written.is_err() {
        let _ = fs::remove_file(&neighbour);
    }
    written.map_err(said)
}

/// Pixels of a picture in a sheet of methods.
const PANEL: [usize; 2] = [300, 300];

/// A mesh as it stands in a sheet, with lines along its edges.
pub(crate) fn panel(mesh: TriMesh, bounds: Option<Bounds>, caption: Vec<String>) -> anyhow::Result<Panel> {
    let subject = Subject::of_mesh(mesh)?;
    let bounds = bounds.unwrap_or(Bounds { min: [0.0; 3], max: [1.0; 3] });
    let mut view = View::of(&bounds, StandardView::Iso, PANEL[0], PANEL[1]);
    view.background = Background::Transparent;
    view.look.wireframe = true;
    Ok(Panel { picture: render(&subject, &view)?, caption })
}
