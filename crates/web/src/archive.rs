//! ZIP archives: dropped archives of models with textures, and exports of several files.

use std::io::{Cursor, Read, Write};

use js_sys::{Array, Error, JsString, Uint8Array};
use wasm_bindgen::prelude::*;
use zip::write::SimpleFileOptions;
use zip::{ZipArchive, ZipWriter};

/// Largest total number of unpacked bytes: what a WebAssembly module can hold.
const MAX_UNPACKED: u64 = 1 << 30;
/// Largest number of files in an archive. Guessed.
const MAX_FILES: usize = 10_000;

fn error(why: impl std::fmt::Display) -> JsValue {
    Error::new(&why.to_string()).into()
}

/// Returns the files of a ZIP archive as pairs of path and bytes.
///
/// # Errors
/// If the bytes are not a ZIP archive, or it has too many files or bytes.
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

/// Returns a ZIP archive of files, given as pairs of path and bytes.
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
