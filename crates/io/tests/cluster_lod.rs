//! Files of cluster levels: what is written is read, and nothing that is damaged or hostile does more than say so.

use lodsmith_core::clusters::{Bound, Cluster, ClusterLod, Sphere};
use lodsmith_core::{
    Attribute, GroupId, Integer, Morphed, Positions, RegionId, Semantic, TriMesh, VertexId, WedgeId,
};
use lodsmith_io::cluster_lod::{StoredClusterLod, read_bytes, read_path, write_path, write_to};
use lodsmith_io::obj::Region;
use lodsmith_io::{Limits, ReadError, Regions};

/// Bytes of the file before its first section.
const HEADER: usize = 16;

fn sphere(radius: f64) -> Sphere {
    Sphere { center: [0.5, 0.25, 0.0], radius }
}

/// Two clusters of two triangles, and one that stands for both; with everything that a mesh can carry, or nothing.
fn stored(is_double: bool, is_laden: bool) -> StoredClusterLod {
    let p: Vec<[f64; 3]> = [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0], [2.0, 0.0], [2.0, 1.1]]
        .map(|[x, y]| [x, y, 0.5])
        .to_vec();
    let positions = match is_double {
        true => Positions::F64(p),
        false => Positions::F32(p.iter().map(|p| p.map(|x| x as f32)).collect()),
    };
    let faces = [[0, 1, 2], [0, 2, 3], [1, 4, 5], [1, 5, 2], [0, 4, 5], [0, 5, 3]];
    if !is_laden {
        let mesh = TriMesh::new(positions, faces.map(|t| t.map(VertexId)).to_vec()).unwrap();
        return StoredClusterLod { lod: levels(mesh), regions: Regions::default() };
    }
    // Vertex 2 has two wedges: 2 and 6.
    let mut faces = faces.map(|t| t.map(WedgeId));
    faces[3][2] = WedgeId(6);
    let map = [0, 1, 2, 3, 4, 5, 2].map(VertexId).to_vec();
    let mut mesh = TriMesh::with_wedges(positions, map, faces.to_vec()).unwrap();
    mesh.set_normals(Some(vec![[0.0, 0.0, 1.0]; 7])).unwrap();
    mesh.set_uvs(Some((0..7).map(|i| [i as f32, 0.5]).collect())).unwrap();
    mesh.set_colors(Some((0..7).map(|i| [0.1 * i as f32, 0.5, f32::NAN, 1.0]).collect())).unwrap();
    let semantics = [
        (Semantic::Tangent, 4),
        (Semantic::Uv(1), 2),
        (Semantic::Color(2), 4),
        (Semantic::Joints(0), 4),
        (Semantic::Weights(0), 4),
        (Semantic::Morph { target: 300, of: Morphed::Normal }, 3),
        (Semantic::Custom("_wärme".to_owned()), 5),
        (Semantic::Discrete { name: "nummer".to_owned(), of: Integer::I16 }, 2),
    ];
    for (semantic, width) in semantics {
        let values = (0..7 * width).map(|i| i as f32 / 8.0).collect();
        mesh.add_attribute(Attribute { semantic, width, values }).unwrap();
    }
    mesh.set_regions(Some([0, 0, 1, 1, 0, 1].map(RegionId).to_vec())).unwrap();
    let mut first = Region::default();
    (first.object, first.material) = (Some(&b"sheet"[..]), Some(&b"caf\xe9"[..]));
    let mut second = first;
    (second.groups, second.smoothing) = (Some(&b"a b"[..]), Some(&b"off"[..]));
    StoredClusterLod { lod: levels(mesh), regions: Regions::named(&[first, second]) }
}

fn levels(mesh: TriMesh) -> ClusterLod {
    let leaf = Cluster { face_count: 2, sphere: sphere(2.0), from: None, into: Some(GroupId(0)) };
    let coarse = Cluster { from: Some(GroupId(0)), into: None, ..leaf };
    ClusterLod::new(mesh, vec![leaf, leaf, coarse], vec![Bound { sphere: sphere(2.5), error: 0.125 }])
        .unwrap()
}

fn bytes_of(stored: &StoredClusterLod) -> Vec<u8> {
    let mut bytes = Vec::new();
    write_to(&stored.lod, &stored.regions, &mut bytes).unwrap();
    bytes
}

fn read(bytes: &[u8]) -> Result<StoredClusterLod, ReadError> {
    read_bytes(bytes, Limits::default())
}

/// Where the sections of a file are: tags and the ranges of their bytes.
fn sections(file: &[u8]) -> Vec<([u8; 4], std::ops::Range<usize>)> {
    let (mut all, mut at) = (Vec::new(), HEADER);
    while at + 12 <= file.len() {
        let length = u64::from_le_bytes(file[at + 4..at + 12].try_into().unwrap()) as usize;
        if at.saturating_add(length).saturating_add(16) > file.len() {
            break;
        }
        all.push((file[at..at + 4].try_into().unwrap(), at + 12..at + 12 + length));
        at += 16 + length;
    }
    all
}

/// Gives every section the checksum of the bytes that it has now.
fn resealed(mut file: Vec<u8>) -> Vec<u8> {
    for (tag, range) in sections(&file) {
        let mut sum = crc32fast::Hasher::new();
        sum.update(&tag);
        sum.update(&file[range.clone()]);
        file[range.end..range.end + 4].copy_from_slice(&sum.finalize().to_le_bytes());
    }
    file
}

/// A file with a section changed, and its checksum right again.
fn with(tag: &[u8; 4], change: impl FnOnce(&mut Vec<u8>)) -> Vec<u8> {
    let file = bytes_of(&stored(false, true));
    let (_, range) = sections(&file).into_iter().find(|s| s.0 == *tag).unwrap();
    let mut own = file[range.clone()].to_vec();
    change(&mut own);
    let mut changed = file[..range.start - 8].to_vec();
    changed.extend((own.len() as u64).to_le_bytes());
    changed.extend(own);
    changed.extend(&file[range.end..]);
    resealed(changed)
}

#[test]
fn what_is_written_is_read() {
    for (is_double, is_laden) in [(false, false), (true, false), (false, true), (true, true)] {
        let before = stored(is_double, is_laden);
        let bytes = bytes_of(&before);
        let after = read(&bytes).unwrap();
        // A NaN differs from itself.
        assert_eq!(format!("{before:?}"), format!("{after:?}"));
        assert_eq!(bytes_of(&after), bytes);
    }
}

#[test]
fn a_file_appears_whole_and_opens_packed_too() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.lclod");
    let before = stored(false, false);
    write_path(&before.lod, &before.regions, &path).unwrap();
    assert_eq!(read_path(&path, Limits::default()).unwrap(), before);
    let packed = folder.path().join("a.lclod.gz");
    let mut gz =
        flate2::write::GzEncoder::new(std::fs::File::create(&packed).unwrap(), flate2::Compression::fast());
    std::io::Write::write_all(&mut gz, &bytes_of(&before)).unwrap();
    gz.finish().unwrap();
    assert_eq!(read_path(&packed, Limits::default()).unwrap(), before);
    let nowhere = folder.path().join("none/a.lclod");
    assert!(write_path(&before.lod, &before.regions, &nowhere).unwrap_err().to_string().contains("a.lclod"));
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 2);
    let missing = read_path(&folder.path().join("b.lclod"), Limits::default()).unwrap_err();
    assert!(missing.to_string().contains("b.lclod"));
    let mut limits = Limits::default();
    limits.bytes = 100;
    assert!(read_path(&path, limits).unwrap_err().to_string().contains("above the limit of 100"));
    assert!(read_path(&packed, limits).is_err());
}

#[test]
fn every_byte_that_is_changed_is_noticed() {
    let file = bytes_of(&stored(false, true));
    for at in 0..file.len() {
        let mut damaged = file.clone();
        damaged[at] ^= 0x10;
        // A length may lead to another section's end, but never to its checksum.
        assert!(read(&damaged).is_err(), "byte {at}");
    }
    for length in 0..file.len() {
        assert!(read(&file[..length]).is_err(), "{length} bytes");
    }
    let mut longer = file;
    longer.push(0);
    assert!(read(&longer).unwrap_err().to_string().contains("behind the last section"));
}

#[test]
fn what_is_wrong_is_named() {
    let complaint = |file: Vec<u8>| read(&file).unwrap_err().to_string();
    let put = |tag, at: usize, bytes: &'static [u8]| {
        with(tag, |own| own[at..at + bytes.len()].copy_from_slice(bytes))
    };
    let mut amiss = Vec::new();
    let nan = &[0, 0, 0, 0, 0, 0, 0xf8, 0x7f];
    for (file, wanted) in [
        (b"solid".to_vec(), "first bytes"),
        (with(b"POSI", |own| own.truncate(7)), "no multiple of 12"),
        (put(b"POSI", 0, &[0, 0, 0x80, 0x7f]), "position of vertex 0"),
        (put(b"WEDG", 0, &[9]), "wedge 0 belongs to vertex 9"),
        (with(b"NORM", |own| own.truncate(12)), "normals has 1 entries for 7"),
        (put(b"CLUS", 0, &[0]), "uses a vertex beyond its 4"),
        (put(b"CLUS", 2, &[1, 0]), "uses a vertex beyond its 1"),
        (put(b"CLUS", 2, &[255, 255]), "ends before the triangles of cluster 0"),
        (put(b"CLUS", 8, &[7]), "cluster 0 names group 7"),
        (put(b"CLUS", 12, nan), "sphere of cluster 0"),
        (put(b"GRUP", 0, nan), "the error of group 0"),
        (put(b"GRUP", 32, &[0; 8]), "the sphere of group 0 is not round"),
        (with(b"GRUP", |own| own.clear()), "group 0"),
        (put(b"LIST", 0, &[77]), "uses vertex 77"),
        (with(b"LIST", |own| own.extend([0; 4])), "4 bytes belong to no cluster"),
        (with(b"REGI", |own| own.truncate(4)), "regions has 1 entries"),
        (put(b"REGI", 0, &[5]), "a face is of region 5"),
        (put(b"NAME", 0, &[200]), "it ends in a name"),
        (with(b"NAME", |own| own.extend([255; 4])), "do not come in fours"),
        (put(b"ATTR", 0, &[99]), "kind 99"),
        (put(b"ATTR", 12, &[3]), "tangents of 3 values"),
        (put(b"ATTR", 12, &[0]), "tangents of 0 values"),
        (put(b"ATTR", 16, &[255, 255, 255, 255]), "ends in its name"),
    ] {
        let got = complaint(file);
        if !got.contains(wanted) {
            amiss.push(format!("{got:?} does not say {wanted:?}"));
        }
    }
    assert!(amiss.is_empty(), "{amiss:#?}");
    let mut newer = bytes_of(&stored(false, false));
    newer[8] = 2;
    assert!(complaint(newer).contains("version 2"));
}

#[test]
fn sections_of_later_programs_are_passed_over_or_refused_by_their_name() {
    let file = bytes_of(&stored(false, true));
    for (tag, is_read) in [(b"news", true), (b"NEWS", false), (b"GRUP", false)] {
        let mut longer = file[..HEADER].to_vec();
        longer.extend(tag);
        longer.extend(3u64.to_le_bytes());
        longer.extend([1, 2, 3, 0, 0, 0, 0]);
        longer.extend(&file[HEADER..]);
        assert_eq!(read(&resealed(longer)).is_ok(), is_read, "{}", tag.escape_ascii());
    }
}

#[test]
fn damage_behind_right_checksums_makes_levels_or_an_error() {
    let mut state = 0x9e37_79b9_7f4a_7c15u64;
    let mut random = |end: usize| {
        state ^= state << 13;
        state ^= state >> 7;
        state ^= state << 17;
        (state % end.max(1) as u64) as usize
    };
    let files = [bytes_of(&stored(false, true)), bytes_of(&stored(true, false))];
    let mut whole = 0;
    for case in 0..6000 {
        let mut file = files[case % 2].clone();
        for _ in 0..=random(3) {
            let at = HEADER + random(file.len() - HEADER);
            match random(4) {
                0 => file[at] ^= 1 << random(8),
                1 => file[at] = random(256) as u8,
                2 => file[at] = 255,
                _ => file[at] = 0,
            }
        }
        if let Ok(stored) = read(&resealed(file)) {
            whole += 1;
            // Whatever is read is a mesh at every cut, and is written as it was.
            let lod = &stored.lod;
            for cut in [lod.cut(0.0), lod.cut(1.0), lod.cut_where(|b| b.error < 0.1)] {
                assert!(lod.mesh_of(&cut).face_count() <= 6);
            }
            assert_eq!(bytes_of(&read(&bytes_of(&stored)).unwrap()), bytes_of(&stored));
        }
    }
    assert!(whole > 500, "{whole} of the damaged files are still whole");
}
