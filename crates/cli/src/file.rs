//! Reading and writing for commands that are no jobs on files: meshes to measure, progressive meshes, images.

use std::fs;
use std::io::{self, ErrorKind};

use anyhow::anyhow;
use lodsmith::core::{Image, Splits};
use lodsmith_asset::{AssetError, Job, Sink, Source, picture};
use lodsmith_io::lpm::{self, LpmWritten};
use lodsmith_io::{Loaded, Lpm, LpmOptions, ReadError, ReadOptions, Regions, WriteError};
use lodsmith_render::PictureFormat;

use crate::args::Reading;
use crate::memory;
use crate::progress::Progress;
use crate::run_control::BarWatch;

/// Reads a file as one mesh. The error does not name the source.
pub(crate) fn read(source: &Source, reading: &Reading) -> anyhow::Result<Loaded> {
    read_with(source, reading, Vec::new())
}

/// Reads a file as one mesh, with these additional vertex properties. The error does not name the source.
pub(crate) fn read_with(
    source: &Source,
    reading: &Reading,
    properties: Vec<String>,
) -> anyhow::Result<Loaded> {
    let mut options = reading.options();
    options.properties = properties;
    match source {
        Source::Path(path) => lodsmith_io::read_path(path, &options).map_err(unnamed),
        Source::Stream => {
            let bytes = lodsmith_io::read_stream(&mut io::stdin().lock(), Vec::new(), options.limits);
            lodsmith_io::read_bytes(&bytes.map_err(unnamed)?, &options).map_err(unnamed)
        }
    }
}

/// Returns the error without the name of the file, which the caller adds.
fn unnamed(error: ReadError) -> anyhow::Error {
    AssetError::from(error).into()
}

/// Writes an image completely or not at all.
pub(crate) fn write_picture(
    picture: &Image,
    sink: &Sink,
    format: PictureFormat,
    force: bool,
) -> anyhow::Result<()> {
    Ok(writer(|job| picture::write_picture(picture, sink, format, force, job))?)
}

/// Runs a job that only writes.
pub(crate) fn writer<T>(write: impl FnOnce(&mut Job<'_>) -> Result<T, AssetError>) -> Result<T, AssetError> {
    let progress = Progress::new(1, true);
    let bar = progress.file("");
    write(&mut Job::new(&mut BarWatch::new(&bar), None, memory::limit()))
}

/// Writes a progressive mesh, completely or not at all.
pub(crate) fn write_lpm(
    splits: &Splits,
    regions: &Regions,
    sink: &Sink,
    options: &LpmOptions,
    job: &mut Job<'_>,
) -> anyhow::Result<LpmWritten> {
    let stream = |source| WriteError::Io { path: "output stream".into(), source };
    Ok(job.put(
        sink,
        |out| lpm::write(splits, Some(regions), options, &mut io::BufWriter::new(out)).map_err(stream),
        |path| lpm::write_path(splits, Some(regions), options, path),
    )?)
}

/// Reads a progressive mesh, or a prefix of one. The error does not name the source.
pub(crate) fn read_lpm(source: &Source) -> anyhow::Result<Lpm> {
    let mut options = ReadOptions::default();
    options.limits = memory::limits();
    match source {
        Source::Path(path) => {
            let file = fs::File::open(path).map_err(|e| match e.kind() {
                ErrorKind::NotFound => anyhow!("cannot read: there is no such file"),
                _ => anyhow!("cannot read: {e}"),
            })?;
            lpm::read(io::BufReader::new(file), &options)
        }
        Source::Stream => lpm::read(io::stdin().lock(), &options),
    }
    .map_err(unnamed)
}
