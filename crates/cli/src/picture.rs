//! Pictures: in which format they go where, and what most of them look like.

use std::io::Write as _;
use std::path::Path;

use anyhow::Context as _;
use lodsmith::core::{Bounds, Image, TriMesh};
use lodsmith_render::{
    Background, Camera, Panel, PictureFormat, StandardView, Subject, View, encode, render,
};

use crate::exit::usage;
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
pub(crate) fn write(picture: &Image, sink: &Sink, format: PictureFormat, force: bool) -> anyhow::Result<()> {
    let bytes = encode(picture, format).with_context(|| format!("{sink}: cannot be stored"))?;
    match sink {
        Sink::Path(path) => file::write_bytes(&bytes, path, force),
        Sink::Stdout => {
            let mut out = std::io::stdout().lock();
            out.write_all(&bytes).and_then(|()| out.flush()).map_err(|e| file::stdout_failed(&e))
        }
    }
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
