//! Pictures: output formats, and the defaults of camera and style.

use std::path::Path;

use anyhow::Context as _;
use lodsmith::core::mesh::creases::Creases;
use lodsmith::core::{Bounds, Image, TriMesh};
use lodsmith_render::{
    Background, Camera, Panel, PictureFormat, StandardView, Subject, View, encode, render,
};

use crate::file;
use crate::status::usage;
use lodsmith_asset::{Sink, paths};

/// Returns the picture format of an output by its file extension; standard output gets PNG.
///
/// # Errors
/// A usage error if the extension is not that of a picture, or the output is a folder.
pub(crate) fn format_of(sink: &Sink) -> anyhow::Result<PictureFormat> {
    paths::refuse_folder(sink, "")?;
    match sink {
        Sink::Stream => Ok(PictureFormat::Png),
        Sink::Path(path) => of_path(path).ok_or_else(|| {
            usage(format!("{}: the name of a .png, .jpg or .webp file is wanted", path.display()))
        }),
    }
}

/// Returns the picture format of a path by its extension; `None` if it is not that of a picture.
pub(crate) fn of_path(path: &Path) -> Option<PictureFormat> {
    path.extension().and_then(|e| e.to_str()).and_then(PictureFormat::from_extension)
}

/// Writes a picture completely or not at all.
pub(crate) fn write(picture: &Image, sink: &Sink, format: PictureFormat, force: bool) -> anyhow::Result<()> {
    let bytes = encode(picture, format).with_context(|| format!("{sink}: cannot be stored"))?;
    write_bytes(&bytes, sink, force)
}

/// Writes an encoded picture completely or not at all.
pub(crate) fn write_bytes(bytes: &[u8], sink: &Sink, force: bool) -> anyhow::Result<()> {
    file::write_bytes(bytes, sink, force)
}

/// Size of a picture in a sheet of methods, in pixels.
const PANEL_SIZE: [usize; 2] = [300, 300];

/// Margin on each side of the subject, as a fraction of the picture.
pub(crate) const MARGIN: f64 = 0.06;

/// Returns the default camera for a subject and a picture of this size.
pub(crate) fn camera(subject: &Subject, [width, height]: [usize; 2]) -> Camera {
    let bounds = subject.bounds().unwrap_or(Bounds { min: [0.0; 3], max: [1.0; 3] });
    let aspect = width as f64 / height as f64;
    subject.framed(Camera::fitting(&bounds, StandardView::Iso, aspect), aspect, MARGIN)
}

/// Renders a mesh for a sheet, with its edges, through the camera of the first, and with sharp edges as that has them.
pub(crate) fn render_panel(
    mesh: TriMesh,
    first: &mut Option<(Camera, Creases)>,
    caption: Vec<String>,
) -> anyhow::Result<Panel> {
    let subject = Subject::of_mesh(mesh)?;
    let (camera, creases) = *first.get_or_insert_with(|| (camera(&subject, PANEL_SIZE), subject.creases()));
    let subject = subject.with_creases(creases);
    let mut view = View::new(camera, PANEL_SIZE[0], PANEL_SIZE[1]);
    view.background = Background::Transparent;
    view.look.wireframe = true;
    Ok(Panel { picture: render(&subject, &view)?, caption })
}
