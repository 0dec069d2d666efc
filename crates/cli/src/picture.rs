//! Pictures: in which format they go where, and what most of them look like.

use std::ffi::OsString;
use std::fs;
use std::io::Write as _;
use std::path::Path;

use anyhow::{Context as _, anyhow};
use lodsmith::core::{Bounds, Image, TriMesh};
use lodsmith_render::{
    Background, Camera, Panel, PictureFormat, StandardView, Subject, View, encode, render,
};

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

/// Room that is left on each side of what is seen, as a share of the picture.
pub(crate) const MARGIN: f64 = 0.06;

/// The usual camera before a subject, for pictures of this size.
pub(crate) fn camera(subject: &Subject, [width, height]: [usize; 2]) -> Camera {
    let bounds = subject.bounds().unwrap_or(Bounds { min: [0.0; 3], max: [1.0; 3] });
    let aspect = width as f64 / height as f64;
    subject.framed(Camera::fitting(&bounds, StandardView::Iso, aspect), aspect, MARGIN)
}

/// A mesh as it stands in a sheet, with lines along its edges, through the camera of the first.
pub(crate) fn panel(
    mesh: TriMesh,
    first: &mut Option<Camera>,
    caption: Vec<String>,
) -> anyhow::Result<Panel> {
    let subject = Subject::of_mesh(mesh)?;
    let camera = *first.get_or_insert_with(|| camera(&subject, PANEL));
    let mut view = View::new(camera, PANEL[0], PANEL[1]);
    view.background = Background::Transparent;
    view.look.wireframe = true;
    Ok(Panel { picture: render(&subject, &view)?, caption })
}
