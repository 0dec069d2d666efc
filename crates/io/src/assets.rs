//! Finds the files that a model refers to (material libraries, textures, buffers, images), refuses files
//! outside its folder, and reads the others within limits.
//!
//! All readers use this module for such files, so an untrusted model can only read and copy files that came
//! with it.

use std::ffi::OsStr;
use std::io::Read;
use std::path::{Component, Path, PathBuf};

use crate::drive::{self, File};

/// Maximum total bytes of the images of one model that are kept encoded. Guessed: half of what a GLB can
/// hold.
pub(crate) const MAX_IMAGE_BYTES: u64 = 2 << 30;

/// The folder that limits which files a model may refer to: its material libraries, textures, buffers and
/// images.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[non_exhaustive]
pub enum AssetScope {
    /// Files in the folder of the model and below, after resolving links.
    #[default]
    Folder,
    /// Files in this folder and below, after resolving links.
    Root(PathBuf),
    /// All files that this process may read. Only for trusted models.
    Anywhere,
}

impl AssetScope {
    /// Returns true if a file in `folder` may refer to the file at `path`; for files other than models, such
    /// as sessions.
    pub fn allows(&self, path: &Path, folder: &Path) -> bool {
        Assets::new(folder, self).find(path) != Err(Refusal::Outside)
    }
}

/// Reason not to use a file that a model refers to. If several apply, the last one listed here is shown.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum Refusal {
    Absent,
    NotAFile,
    Outside,
}

impl Refusal {
    /// The end of a sentence that begins with the name of the file.
    pub(crate) fn reason(self) -> &'static str {
        match self {
            Self::Absent => "was not found",
            Self::NotAFile => "is not a regular file",
            Self::Outside => {
                "is outside the folder of the model (--asset-root DIR or --allow-outside permits it)"
            }
        }
    }
}

/// The folders that are searched for the files that a model refers to.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(crate) struct Assets {
    /// Search folders, in this order.
    folders: Vec<PathBuf>,
    /// The allowed folder, as given and after resolving links; `None` allows all folders.
    root: Option<[PathBuf; 2]>,
}

/// A file that a model refers to, found inside the allowed folder.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
pub(crate) struct Asset {
    /// The path as the model has it; a link keeps its own name here.
    path: PathBuf,
    /// The file itself, after resolving links.
    real_path: PathBuf,
}

impl Assets {
    /// Returns the assets of a model in this folder.
    pub(crate) fn new(folder: &Path, scope: &AssetScope) -> Self {
        let root = match scope {
            AssetScope::Folder => Some(folder),
            AssetScope::Root(root) => Some(root.as_path()),
            AssetScope::Anywhere => None,
        };
        let root = root.map(|root| {
            let given = normalized(root);
            // A folder that does not exist contains no file.
            let real = drive::canonicalize(root).unwrap_or_else(|_| given.clone());
            [given, real]
        });
        Self { folders: vec![folder.to_owned()], root }
    }

    /// Returns true if there is a folder to search.
    pub(crate) fn has_folder(&self) -> bool {
        !self.folders.is_empty()
    }

    /// Returns the assets for names in a file of this folder, which is searched first.
    pub(crate) fn searched_from(&self, own: &Path) -> Self {
        let others = self.folders.iter().filter(|folder| *folder != own);
        let folders = [own].into_iter().chain(others.map(PathBuf::as_path)).map(Path::to_owned).collect();
        Self { folders, root: self.root.clone() }
    }

    /// Returns the file that a name refers to.
    pub(crate) fn find(&self, name: &Path) -> Result<Asset, Refusal> {
        let mut refusal = Refusal::Absent;
        for folder in &self.folders {
            match self.file_at(folder.join(name)) {
                Ok(asset) => return Ok(asset),
                Err(other) => refusal = refusal.max(other),
            }
        }
        Err(refusal)
    }

    fn file_at(&self, path: PathBuf) -> Result<Asset, Refusal> {
        // A name that leads outside is refused before the file system is touched, so that its existence does
        // not leak.
        if let Some(roots) = &self.root
            && !roots.iter().any(|root| normalized(&path).starts_with(root))
        {
            return Err(Refusal::Outside);
        }
        let real = drive::canonicalize(&path).map_err(|_| Refusal::Absent)?;
        if self.root.as_ref().is_some_and(|[_, root]| !real.starts_with(root)) {
            return Err(Refusal::Outside);
        }
        match drive::metadata(&real) {
            Ok(about) if about.is_file() => Ok(Asset { path, real_path: real }),
            Ok(_) => Err(Refusal::NotAFile),
            Err(_) => Err(Refusal::Absent),
        }
    }
}

impl Asset {
    /// The folder where it was found, before resolving links.
    pub(crate) fn folder(&self) -> &Path {
        self.path.parent().unwrap_or(Path::new(""))
    }

    /// Its file name; for a link, the name of the link.
    pub(crate) fn name(&self) -> &OsStr {
        self.path.file_name().unwrap_or_default()
    }

    /// The file itself, after resolving links.
    pub(crate) fn real_path(&self) -> &Path {
        &self.real_path
    }

    /// Opens the file.
    pub(crate) fn open(&self) -> Result<File, String> {
        File::open(&self.real_path).map_err(|e| format!("cannot be read: {e}"))
    }

    /// Reads its bytes, up to a maximum.
    ///
    /// # Errors
    /// The end of a sentence that begins with its name.
    pub(crate) fn read(&self, max_bytes: u64) -> Result<Vec<u8>, String> {
        let mut bytes = Vec::new();
        let read = self.open()?.take(max_bytes.saturating_add(1)).read_to_end(&mut bytes);
        read.map_err(|e| format!("cannot be read: {e}"))?;
        if bytes.len() as u64 > max_bytes {
            return Err(format!("is too large: only {max_bytes} bytes of the limit are left"));
        }
        Ok(bytes)
    }

    /// Reads its bytes if they are an image, and subtracts their number from `left`.
    ///
    /// # Errors
    /// The end of a sentence that begins with its name.
    pub(crate) fn read_image(&self, left: &mut u64) -> Result<Vec<u8>, String> {
        let bytes = self.read(*left)?;
        if !is_image(&bytes, &self.path) {
            return Err("is not an image of a known type".to_owned());
        }
        *left -= bytes.len() as u64;
        Ok(bytes)
    }
}

/// Returns an absolute path without `.` and `..`, without accessing the file system.
fn normalized(path: &Path) -> PathBuf {
    let path = std::path::absolute(path).unwrap_or_else(|_| path.to_owned());
    let mut plain = PathBuf::new();
    for part in path.components() {
        match part {
            Component::ParentDir => {
                plain.pop();
            }
            Component::CurDir => {}
            part => plain.push(part),
        }
    }
    plain
}

/// Returns true if the bytes begin like an image: the signature of a type, and after it a header with a size
/// if that can be read. For types without a signature the extension is also needed.
fn is_image(bytes: &[u8], name: &Path) -> bool {
    let is_tga = name.extension().is_some_and(|e| e.eq_ignore_ascii_case("tga"));
    let has_size = || imagesize::blob_size(bytes).is_ok_and(|size| size.width > 0 && size.height > 0);
    match bytes {
        // Signatures long enough to be unambiguous: DDS, KTX 1, OpenEXR, Radiance HDR, QOI, JPEG 2000, JPEG
        // XL, AVIF.
        [b'D', b'D', b'S', b' ', 124, 0, 0, 0, ..]
        | [0xab, b'K', b'T', b'X', b' ', b'1', b'1', 0xbb, ..]
        | [0x76, 0x2f, 0x31, 0x01, ..]
        | [b'#', b'?', b'R', b'A', b'D', b'I', b'A', b'N', b'C', b'E', b'\n', ..]
        | [b'#', b'?', b'R', b'G', b'B', b'E', b'\n', ..]
        | [b'q', b'o', b'i', b'f', 0, ..]
        | [0, 0, 0, 12, b'j' | b'J', b'P' | b'X', b' ' | b'L', b' ', 13, 10, 0x87, 10, ..]
        | [0, 0, 0, _, b'f', b't', b'y', b'p', b'a', b'v', b'i', b'f' | b's', ..] => true,
        [b'P', kind @ b'1'..=b'6', rest @ ..] => is_portable_map(rest, *kind),
        // Two letters are too short for a signature; the header length that follows confirms it.
        [b'B', b'M', ..] => {
            bytes.get(14).is_some_and(|n| [12, 40, 52, 56, 64, 108, 124].contains(n)) && has_size()
        }
        _ if is_tga => is_targa(bytes),
        _ => has_size(),
    }
}

/// Returns true if the rest of a PBM, PGM or PPM header is valid: width, height and, unless black and white,
/// the maximum value.
fn is_portable_map(header: &[u8], kind: u8) -> bool {
    // Comments may come between; no program writes a longer header. Guessed.
    let header = &header[..header.len().min(4096)];
    let words = header
        .split(|&b| b == b'\n')
        .map(|line| line.split(|&b| b == b'#').next().unwrap_or_default())
        .flat_map(|line| line.split(u8::is_ascii_whitespace))
        .filter(|word| !word.is_empty());
    let numbers = if matches!(kind, b'1' | b'4') { 2 } else { 3 };
    let is_count = |word: &[u8]| word.len() < 10 && word.iter().all(u8::is_ascii_digit);
    header.first().is_some_and(u8::is_ascii_whitespace)
        && words.take(numbers).filter(|word| is_count(word)).count() == numbers
}

/// Returns true if these bytes begin with a valid header of a Targa image, which has no signature.
fn is_targa(bytes: &[u8]) -> bool {
    let Some(header) = bytes.first_chunk::<18>() else { return false };
    matches!((header[1], header[2]), (0 | 1, 1 | 9) | (0, 2 | 3 | 10 | 11))
        && header[12..14] != [0; 2]
        && header[14..16] != [0; 2]
        && matches!(header[16], 8 | 15 | 16 | 24 | 32)
}

#[cfg(test)]
mod tests {
    use std::fs;

    use super::*;

    #[test]
    fn a_name_that_leads_out_of_the_folder_is_refused() {
        let all = tempfile::tempdir().unwrap();
        let folder = all.path().join("in");
        fs::create_dir_all(folder.join("tex")).unwrap();
        for name in ["secret", "in/a", "in/tex/b"] {
            fs::write(all.path().join(name), name).unwrap();
        }
        let secret = all.path().join("secret");
        let inside = Assets::new(&folder, &AssetScope::Folder);
        for name in ["a", "tex/b", "tex/../a", "../in/a"] {
            assert!(inside.find(Path::new(name)).is_ok(), "{name}");
        }
        assert!(inside.find(&folder.join("a")).is_ok());
        // The result does not depend on whether the file exists.
        for name in ["../secret", "../none", "tex/../../secret", "/etc/hostname", "/none"] {
            assert_eq!(inside.find(Path::new(name)), Err(Refusal::Outside), "{name}");
        }
        assert_eq!(inside.find(&secret), Err(Refusal::Outside));
        assert_eq!(inside.find(Path::new("none")), Err(Refusal::Absent));
        assert_eq!(inside.find(Path::new("tex")), Err(Refusal::NotAFile));
        assert_eq!(Assets::default().find(Path::new("a")), Err(Refusal::Absent));
        for scope in [AssetScope::Anywhere, AssetScope::Root(all.path().to_owned())] {
            assert!(Assets::new(&folder, &scope).find(Path::new("../secret")).is_ok());
        }
        let elsewhere = AssetScope::Root(folder.join("tex"));
        assert_eq!(Assets::new(&folder, &elsewhere).find(Path::new("a")), Err(Refusal::Outside));
    }

    #[cfg(unix)]
    #[test]
    fn a_link_that_leads_out_of_the_folder_is_refused() {
        use std::os::unix::fs::symlink;
        let all = tempfile::tempdir().unwrap();
        let folder = all.path().join("in");
        fs::create_dir(&folder).unwrap();
        fs::write(all.path().join("secret"), "s").unwrap();
        fs::write(folder.join("a"), "a").unwrap();
        symlink("../secret", folder.join("out")).unwrap();
        symlink("..", folder.join("up")).unwrap();
        symlink("a", folder.join("same")).unwrap();
        // A folder that is reached by a link is still the folder.
        symlink("in", all.path().join("also")).unwrap();
        for folder in [folder.clone(), all.path().join("also")] {
            let inside = Assets::new(&folder, &AssetScope::Folder);
            for name in ["out", "up/secret"] {
                assert_eq!(inside.find(Path::new(name)), Err(Refusal::Outside), "{name}");
            }
            let same = inside.find(Path::new("same")).unwrap();
            assert_eq!((same.name(), same.read(1)), (OsStr::new("same"), Ok(b"a".to_vec())));
            assert!(same.read(0).unwrap_err().contains("too large"));
        }
        assert!(Assets::new(&folder, &AssetScope::Anywhere).find(Path::new("out")).is_ok());
    }

    #[test]
    fn only_files_with_image_headers_are_images() {
        let is = |bytes: &[u8], name: &str| is_image(bytes, Path::new(name));
        let png = b"\x89PNG\r\n\x1a\n\0\0\0\x0dIHDR\0\0\0\x02\0\0\0\x03\x08\x02\0\0\0";
        assert!(is(png, "a.png") && is(png, "a") && !is(&png[..12], "a.png"));
        assert!(is(b"P3 1 1 255 120 80 40", "a.ppm") && is(b"P5\n# by hand\n2 2\n255\nabcd", "a.pgm"));
        assert!(is(b"P4\n8 1\n\xff", "a.pbm") && is(b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n", "a.hdr"));
        assert!(is(b"DDS |\0\0\0\x07\x10\0\0", "a.dds"));
        let mut tga = [0; 18];
        (tga[2], tga[12], tga[14], tga[16]) = (2, 1, 1, 24);
        assert!(is(&tga, "a.TGA") && !is(&tga[..17], "a.tga"));
        for text in [
            "root:x:0:0:root:/root:/bin/sh\n",
            "P3 is a word",
            "BMW is a brand of motor vehicles\n",
            "",
            "-----BEGIN KEY-----",
            "DDS ",
        ] {
            for name in ["a.png", "a.tga", "a.bmp", "a"] {
                assert!(!is(text.as_bytes(), name), "{text} as {name}");
            }
        }
    }
}
