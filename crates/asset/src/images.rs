//! References of a glTF scene to other files, which change when the scene is written to another folder.

use std::fs;
use std::path::{Component, Path, PathBuf};

use lodsmith_io::gltf::Scene;
use lodsmith_io::{Format, Textures, Warning};

use crate::paths::{Sink, Source};

/// Move of a scene from one folder to another.
pub(crate) struct FolderMove {
    /// Relative path from the folder of the output to that of the input, as a URI that ends in a slash; empty
    /// if they are the same. `None` if there is no such path or it is unknown.
    path: Option<String>,
}

impl FolderMove {
    pub(crate) fn new(input: &Source, output: &Sink) -> Self {
        let from = match input {
            Source::Path(path) => folder(path),
            Source::Stream => None,
        };
        let to = match output {
            Sink::Path(path) => folder(path),
            Sink::Stream => None,
        };
        let path = from.as_deref().zip(to.as_deref()).and_then(|(from, to)| relative_uri(to, from));
        Self { path }
    }

    /// Returns the URI of a file relative to the folder of the output; `None` leaves it unchanged.
    pub(crate) fn uri(&self, uri: &str) -> Option<String> {
        // Absolute paths do not depend on the folder.
        if uri.starts_with(['/', '\\']) || uri.contains(':') {
            return None;
        }
        let path = self.path.as_ref().filter(|path| !path.is_empty())?;
        Some(format!("{path}{uri}"))
    }

    /// Embeds the images of a scene that is written as GLB. Returns warnings about files that stay external. For 3MF,
    /// and for a `.gltf` with copies of its images, the writer returns such warnings.
    pub(crate) fn embed(&self, scene: &mut Scene, format: Format, textures: Textures) -> Vec<Warning> {
        if format == Format::ThreeMf {
            return Vec::new();
        }
        let mut warnings = if format == Format::Glb { scene.embed_files() } else { Vec::new() };
        if format == Format::Glb || textures != Textures::Copy || self.path.is_none() {
            warnings.extend(self.external_file_warnings(scene));
        }
        warnings
    }

    /// Returns warnings about files that stay external, in the folder of the input or at an unknown path.
    fn external_file_warnings(&self, scene: &Scene) -> Vec<Warning> {
        let outside = scene.external_files();
        let Some(first) = outside.first() else { return Vec::new() };
        let others =
            if outside.len() > 1 { format!(" and {} more", outside.len() - 1) } else { String::new() };
        let text = match &self.path {
            None => "expected beside the output",
            Some(path) if !path.is_empty() => "still in the folder of the input",
            Some(_) => return Vec::new(),
        };
        vec![Warning::note(format!("files that the scene refers to are {text}: {first}{others}"))]
    }
}

/// Returns the folder of a file in canonical form, without links and dots.
fn folder(path: &Path) -> Option<PathBuf> {
    let parent = path.parent().filter(|p| !p.as_os_str().is_empty()).unwrap_or(Path::new("."));
    fs::canonicalize(parent).ok()
}

/// Returns the relative path from one folder to another, as a URI that ends in a slash or is empty.
fn relative_uri(from: &Path, to: &Path) -> Option<String> {
    let shared = from.components().zip(to.components()).take_while(|(a, b)| a == b).count();
    let (up, down) = (from.components().skip(shared), to.components().skip(shared));
    let mut uri = "../".repeat(up.count());
    for part in down {
        // A relative path cannot lead to another drive.
        let Component::Normal(part) = part else { return None };
        for byte in part.to_str()?.bytes() {
            if byte.is_ascii_alphanumeric() || b"-._~".contains(&byte) {
                uri.push(byte.into());
            } else {
                uri.push_str(&format!("%{byte:02X}"));
            }
        }
        uri.push('/');
    }
    Some(uri)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn relative_paths_between_folders() {
        let path = |a: &str, b: &str| super::relative_uri(Path::new(a), Path::new(b)).unwrap();
        assert_eq!(path("/a/b", "/a/b"), "");
        assert_eq!(path("/a/b", "/a"), "../");
        assert_eq!(path("/a/b", "/a/c d/ü"), "../c%20d/%C3%BC/");
    }

    #[test]
    fn relative_names_are_updated() {
        let step = FolderMove { path: Some("../in/".to_owned()) };
        assert_eq!(step.uri("x.png").as_deref(), Some("../in/x.png"));
        assert_eq!(step.uri("../x.png").as_deref(), Some("../in/../x.png"));
        assert_eq!(step.uri("/x.png"), None);
        assert_eq!(step.uri("c:x.png"), None);
        assert_eq!(FolderMove { path: None }.uri("x.png"), None);
    }
}
