//! The exchange file of a benchmark lab: `i64` vertices, `i64` faces, `f64` positions, `i32` indices, little endian.

use std::fs::File;
use std::io::{BufReader, BufWriter, Read, Write};
use std::path::Path;

use anyhow::{Context, Result, ensure};
use lodsmith_core::{Positions, Surface};

/// A mesh from an exchange file; positions are single precision if that is exact for every coordinate.
#[derive(Clone, Debug, PartialEq)]
pub struct Exchange {
    /// One for each vertex.
    pub positions: Positions,
    /// Three for each face.
    pub indices: Vec<u32>,
}

impl Exchange {
    /// Borrows the surface.
    ///
    /// # Errors
    /// If an index is out of range.
    pub fn surface(&self) -> Result<Surface<'_>> {
        Ok(Surface::new(self.positions.view(), bytemuck::cast_slice(&self.indices))?)
    }
}

/// Reads an exchange file directly into buffers, so that no freed memory hides a later peak.
///
/// # Errors
/// If the file cannot be read or has a wrong length.
pub fn read(path: &Path) -> Result<Exchange> {
    let context = || format!("reading {}", path.display());
    let file = File::open(path).with_context(context)?;
    let bytes = file.metadata().with_context(context)?.len();
    let mut file = BufReader::with_capacity(1 << 16, file);
    let mut head = [0; 16];
    file.read_exact(&mut head).with_context(context)?;
    let count = |at: usize| i64::from_le_bytes(head[at..at + 8].try_into().expect("eight bytes"));
    let (vertices, faces) = (count(0), count(8));
    let expected = i128::from(vertices) * 24 + i128::from(faces) * 12 + 16;
    ensure!(vertices >= 0 && faces >= 0 && expected == i128::from(bytes), "{}: wrong length", path.display());
    let (vertices, faces) = (usize::try_from(vertices)?, usize::try_from(faces)?);

    let mut single: Vec<[f32; 3]> = Vec::with_capacity(vertices);
    let mut double: Vec<[f64; 3]> = Vec::new();
    let mut point = [[0; 8]; 3];
    for _ in 0..vertices {
        file.read_exact(point.as_flattened_mut()).with_context(context)?;
        let p = point.map(f64::from_le_bytes);
        let narrow = p.map(|x| x as f32);
        if double.is_empty() && narrow.map(f64::from) == p {
            single.push(narrow);
        } else {
            if double.is_empty() {
                double.reserve_exact(vertices);
                double.extend(single.drain(..).map(|p| p.map(f64::from)));
                single = Vec::new();
            }
            double.push(p);
        }
    }
    let mut indices = Vec::with_capacity(faces * 3);
    let mut index = [0; 4];
    for _ in 0..faces * 3 {
        file.read_exact(&mut index).with_context(context)?;
        indices.push(u32::from_le_bytes(index));
    }
    let positions = if double.is_empty() { Positions::F32(single) } else { Positions::F64(double) };
    Ok(Exchange { positions, indices })
}

/// Writes a surface as an exchange file.
///
/// # Errors
/// If the file cannot be written.
pub fn write(path: &Path, surface: &Surface<'_>) -> Result<()> {
    let mut out = BufWriter::new(File::create(path).with_context(|| format!("writing {}", path.display()))?);
    out.write_all(&(surface.positions().len() as i64).to_le_bytes())?;
    out.write_all(&(surface.triangles().len() as i64).to_le_bytes())?;
    for x in surface.positions().iter().flatten() {
        out.write_all(&x.to_le_bytes())?;
    }
    for v in surface.triangles().as_flattened() {
        out.write_all(&v.0.to_le_bytes())?;
    }
    out.into_inner()?.sync_all()?;
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn files_are_read_in_the_required_precision() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.labm");
        for third in [0.25, 1.0 / 3.0] {
            let positions = Positions::F64(vec![[0.0; 3], [1.0, 0.0, 0.0], [0.0, third, 0.0]]);
            let mesh = Exchange { positions, indices: vec![0, 1, 2] };
            write(&path, &mesh.surface().unwrap()).unwrap();
            let got = read(&path).unwrap();
            assert_eq!(matches!(got.positions, Positions::F32(_)), third == 0.25);
            assert_eq!(got.indices, mesh.indices);
            assert!(got.positions.view().iter().eq(mesh.positions.view().iter()));
        }
        std::fs::write(&path, [1u8; 40]).unwrap();
        assert!(read(&path).is_err(), "the header is checked against the length of the file");
    }
}
