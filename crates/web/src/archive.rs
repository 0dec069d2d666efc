//! ZIP archives: models and textures that were dropped together, and several files of one export.

use std::io::{Cursor, Read, Write};

use js_sys::{Array, Error, JsString, Uint8Array};
use wasm_bindgen::prelude::*;
use zip::write::SimpleFileOptions;
use zip::{ZipArchive, ZipWriter};

/// Largest total of unpacked bytes: what a module can read at once.
const MAX_UNPACKED: u64 = 1 << 30;
/// Largest number of files in an archive. Guessed.
const MAX_FILES: usize = 10_000;

fn error(why: impl std::fmt::Display) -> JsValue {
    Error::new(&why.to_string()).into()
}

/// Returns the files of an archive as pairs of path and bytes.
///
/// # Errors
/// If it is no archive, or has too many files or bytes.
#[wasm_bindgen]
pub fn unpack(bytes: &[u8]) -> Result<Array, JsValue> {
    let mut archive = ZipArchive::new(Cursor::new(bytes)).map_err(error)?;
    if archive.len() > MAX_FILES {
        return Err(error(format!("the archive has {} files, more than {MAX_FILES}", archive.len())));
    }
    let all = Array::new();
    let mut left = MAX_UNPACKED;
    for number in 0..archive.len() {
        let file = archive.by_index(number).map_err(error)?;
        let Some(path) = file.enclosed_name().filter(|_| file.is_file()) else { continue };
        let mut content = Vec::new();
        file.take(left + 1).read_to_end(&mut content).map_err(error)?;
        left = left
            .checked_sub(content.len() as u64)
            .ok_or_else(|| error("the archive is too large: unpacked, it has more than 1 GB"))?;
        let path = JsString::from(path.to_string_lossy().replace('\\', "/"));
        all.push(&Array::of2(&path, &Uint8Array::from(&content[..])));
    }
    Ok(all)
}

/// Returns an archive of files, given as pairs of path and bytes.
///
/// # Errors
/// If there is not enough memory.
#[wasm_bindgen]
pub fn zip(files: &Array) -> Result<Uint8Array, JsValue> {
    let mut writer = ZipWriter::new(Cursor::new(Vec::new()));
    for file in files.iter() {
        let [path, bytes] = [0, 1].map(|k| Array::from(&file).get(k));
        writer
            .start_file(path.as_string().unwrap_or_default(), SimpleFileOptions::default())
            .map_err(error)?;
        writer.write_all(&Uint8Array::new(&bytes).to_vec()).map_err(error)?;
    }
    Ok(Uint8Array::from(&writer.finish().map_err(error)?.into_inner()[..]))
}
