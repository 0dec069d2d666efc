//! The meshes and targets of the benchmarks.

use std::path::{Path, PathBuf};

use anyhow::{Context, Result, bail, ensure};
use lodsmith_io::Format;

use crate::Soup;

/// A triangle count to reach.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Target {
    /// A percentage of the input.
    Percent(f64),
    /// An absolute number.
    Faces(usize),
}

impl Target {
    /// The targets of the published table.
    pub const DEFAULT: [Self; 5] =
        [Self::Percent(50.0), Self::Percent(10.0), Self::Percent(1.0), Self::Faces(1000), Self::Faces(100)];

    /// Parses `10%` or `1000`.
    ///
    /// # Errors
    /// If the text is neither.
    pub fn parse(text: &str) -> Result<Self> {
        let text = text.trim();
        let target = match text.strip_suffix('%') {
            Some(percent) => Self::Percent(percent.trim().parse().with_context(|| format!("target {text}"))?),
            None => Self::Faces(text.parse().with_context(|| format!("target {text}"))?),
        };
        match target {
            Self::Percent(p) if !(p > 0.0 && p <= 100.0) => {
                bail!("target {text} is not above 0 % and up to 100 %")
            }
            Self::Faces(0) => bail!("target 0 leaves no faces"),
            target => Ok(target),
        }
    }

    /// The number of triangles for a mesh of `faces`.
    pub fn of(self, faces: usize) -> usize {
        match self {
            Self::Percent(p) => ((faces as f64 * p / 100.0).round() as usize).max(4),
            Self::Faces(n) => n,
        }
    }

    /// The most triangles of a result that has reached a target of this many.
    pub fn max_faces(requested: usize) -> usize {
        (requested as f64 * 1.02) as usize + 2
    }

    /// The name of the target in tables.
    pub fn name(self) -> String {
        match self {
            Self::Percent(p) => format!("{p}%"),
            Self::Faces(n) => n.to_string(),
        }
    }
}

/// Names of the models in the tables, as far as the folder has them: scans, parts, terrain and art, small and large.
pub const MODELS: &[&str] = &[
    "cow",
    "suzanne",
    "spot",
    "fandisk",
    "homer",
    "heptoroid",
    "hammer",
    "bunny",
    "st_helens",
    "st_helens_dem",
    "horse",
    "horse_colour_be",
    "nefertiti",
    "terrain",
    "dragon",
    "dragon_vrip_res2",
    "horse400k",
    "brain588k",
    "brain_mri",
    "horse1.5m",
];

/// Returns the name of a model: its file name without extensions.
pub fn stem(path: &Path) -> String {
    let name = path.file_name().unwrap_or_default().to_string_lossy();
    let name = name.strip_suffix(".gz").unwrap_or(&name);
    name.rsplit_once('.').map_or(name, |(stem, _)| stem).to_owned()
}

/// Returns whether the extension names a readable format, compressed or not.
pub fn is_model(path: &Path) -> bool {
    let name = path.file_name().unwrap_or_default().to_string_lossy().to_ascii_lowercase();
    let name = name.strip_suffix(".gz").unwrap_or(&name);
    name.rsplit_once('.').is_some_and(|(_, extension)| Format::from_name(extension).is_some())
}

/// Returns all models below a folder, sorted by path; for a file, returns the file.
///
/// # Errors
/// If there is no such file or folder.
pub fn find_models(path: &Path) -> Result<Vec<PathBuf>> {
    ensure!(path.exists(), "{} does not exist", path.display());
    if path.is_file() {
        return Ok(vec![path.to_owned()]);
    }
    let mut found = Vec::new();
    for entry in std::fs::read_dir(path).with_context(|| format!("reading {}", path.display()))? {
        let path = entry?.path();
        if path.is_dir() {
            found.extend(find_models(&path)?);
        } else if is_model(&path) {
            found.push(path);
        }
    }
    found.sort();
    Ok(found)
}

/// Returns a wavy torus of `around` × `across` vertices and twice as many triangles.
pub fn torus(around: usize, across: usize) -> Soup {
    let angle = |i: usize, n: usize| i as f64 / n as f64 * std::f64::consts::TAU;
    let mut soup = Soup::default();
    for i in 0..around {
        for j in 0..across {
            let (u, v) = (angle(i, around), angle(j, across));
            let tube = 0.4 + 0.02 * (23.0 * u).sin() * (17.0 * v).sin();
            let ring = 1.0 + tube * v.cos();
            soup.positions.push([ring * u.cos(), tube * v.sin(), ring * u.sin()].map(|x| x as f32));
            let at = |i: usize, j: usize| ((i % around) * across + j % across) as u32;
            let (a, b, c, d) = (at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1));
            soup.indices.extend([a, c, b, a, d, c]);
        }
    }
    soup
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn targets_are_parsed_or_refused() {
        assert_eq!(Target::parse("10%").unwrap().of(12_946), 1295);
        assert_eq!(Target::parse(" 100 ").unwrap().of(7), 100);
        for bad in ["", "0", "0%", "101%", "x", "-5", "NaN%"] {
            assert!(Target::parse(bad).is_err(), "{bad}");
        }
    }

    #[test]
    fn names_of_models() {
        assert_eq!(stem(Path::new("a/horse1.5m.ply")), "horse1.5m");
        assert_eq!(stem(Path::new("dragon.ply.gz")), "dragon");
        assert!(
            is_model(Path::new("a.PLY.gz")) && !is_model(Path::new("a.blend")) && !is_model(Path::new("ply"))
        );
    }

    #[test]
    fn a_torus_is_closed() {
        let torus = torus(9, 8);
        assert_eq!((torus.positions.len(), torus.face_count()), (72, 144));
        let mut edges = std::collections::HashMap::new();
        for t in torus.indices.chunks_exact(3) {
            for k in 0..3 {
                *edges.entry((t[k], t[(k + 1) % 3])).or_insert(0) += 1;
            }
        }
        assert!(edges.iter().all(|(&(a, b), &n)| n == 1 && edges.get(&(b, a)) == Some(&1)));
    }
}
