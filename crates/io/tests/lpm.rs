//! LPM: round trips, truncated files as coarser meshes, and untrusted bytes.

use std::io::{Read as _, Write as _};

use flate2::Compression;
use flate2::read::DeflateDecoder;
use flate2::write::DeflateEncoder;
use lodsmith_core::splits::{Checkpoint, SplitData, Splits};
use lodsmith_core::{
    Attribute, IntegerType, Morphed, Positions, RegionId, Semantic, Topology, TriMesh, VertexId, WedgeId,
    shapes,
};
use lodsmith_io::lpm::{self, LpmOptions, LpmReader};
use lodsmith_io::{Format, Limits, ReadError, ReadOptions, read_bytes};

use crate::record::{Random, record};

fn written(splits: &Splits, bits: Option<u8>) -> Vec<u8> {
    let mut options = LpmOptions::default();
    options.bits = bits;
    options.exact_fits = bits.is_none();
    let mut out = Vec::new();
    let written = lpm::write(splits, None, &options, &mut out).unwrap();
    assert_eq!((written.warnings, written.sizes.total()), (Vec::new(), out.len() as u64));
    out
}

fn read(bytes: &[u8]) -> lodsmith_io::Lpm {
    lpm::read(bytes, &ReadOptions::default()).unwrap()
}

/// Returns a sheet with a seam, every kind of attribute and three regions.
fn rich(is_double: bool) -> TriMesh {
    let sheet = shapes::wavy_sheet(8);
    let count = sheet.vertex_count();
    // The faces of the middle column have separate wedges on one side.
    let mut vertex_of: Vec<VertexId> = (0..count).map(VertexId::new).collect();
    let mut triangles: Vec<[WedgeId; 3]> = sheet.triangles().to_vec();
    let is_seam = |v: usize| v % 9 == 4;
    let mut twins = vec![None; count];
    for t in &mut triangles {
        let is_right = t.iter().any(|w| w.index() % 9 > 4);
        for w in t {
            if is_right && is_seam(w.index()) {
                *w = *twins[w.index()].get_or_insert_with(|| {
                    vertex_of.push(VertexId(w.0));
                    WedgeId::new(vertex_of.len() - 1)
                });
            }
        }
    }
    let places: Vec<[f64; 3]> = sheet.positions().view().iter().collect();
    let positions = match is_double {
        true => Positions::F64(places.iter().map(|p| p.map(|x| x * std::f64::consts::PI)).collect()),
        false => Positions::F32(places.iter().map(|p| p.map(|x| x as f32)).collect()),
    };
    let wedges = vertex_of.len();
    let faces = triangles.len();
    let mut mesh = TriMesh::with_wedges(positions, vertex_of, triangles).unwrap();
    let unit = |i: usize| {
        let (a, b) = ((i as f32 * 0.7).sin_cos(), (i as f32 * 0.3).sin_cos());
        [a.0 * b.1, a.1 * b.1, b.0]
    };
    mesh.set_normals(Some((0..wedges).map(unit).collect())).unwrap();
    mesh.set_uvs(Some((0..wedges).map(|i| [i as f32 / 90.0, (i * i % 77) as f32 / 77.0]).collect())).unwrap();
    mesh.set_colors(Some((0..wedges).map(|i| [(i % 5) as f32 / 4.0, 0.5, 1.0, 1.0]).collect())).unwrap();
    let mut add = |semantic, width: usize, value: &dyn Fn(usize, usize) -> f32| {
        let values =
            (0..wedges).flat_map(|i| (0..width).map(move |k| (i, k))).map(|(i, k)| value(i, k)).collect();
        mesh.add_attribute(Attribute { semantic, width, values }).unwrap();
    };
    add(Semantic::Tangent, 4, &|i, k| if k == 3 { [1.0, -1.0][i % 2] } else { unit(i + 1)[k] });
    add(Semantic::Uv(1), 2, &|i, k| (i + k) as f32 * 0.01);
    add(Semantic::Joints(0), 4, &|i, k| (i % 7 + k) as f32);
    add(Semantic::Weights(0), 4, &|_, _| 0.25);
    add(Semantic::Morph { target: 3, of: Morphed::Position }, 3, &|i, k| (i * (k + 1)) as f32 * 1e-3);
    add(Semantic::Custom("_HEAT".to_owned()), 1, &|i, _| if i == 5 { f32::NAN } else { i as f32 });
    let id = Semantic::Discrete { name: "_FEATURE_ID_0".to_owned(), of: IntegerType::U16 };
    add(id, 1, &|i, _| (300 * (i % 9)) as f32);
    mesh.set_regions(Some((0..faces).map(|f| RegionId::new(f / 50)).collect())).unwrap();
    mesh
}

fn bits(values: &[f32]) -> Vec<u32> {
    values.iter().map(|x| x.to_bits()).collect()
}

/// Asserts equality, comparing floats by their bits.
fn assert_same(a: &SplitData, b: &SplitData) {
    let plain = |d: &SplitData| {
        let mut d = d.clone();
        let values = [bits(&d.values), bits(&d.rows.to)];
        d.values.clear();
        d.rows.to.clear();
        (d, values)
    };
    let ((a, values), (b, others)) = (plain(a), plain(b));
    assert_eq!(values, others);
    assert!(a == b, "{a:?}\n{b:?}");
}

#[test]
fn every_bit_comes_back() {
    let mut cases: Vec<(String, TriMesh)> =
        shapes::all().into_iter().map(|(name, mesh)| (name.to_owned(), mesh)).collect();
    cases.push(("soup".to_owned(), shapes::soup(60, 1)));
    cases.push(("rich".to_owned(), rich(false)));
    cases.push(("rich, in double precision".to_owned(), rich(true)));
    for (name, mesh) in cases {
        for seed in 0..3 {
            let splits = record(&mesh, mesh.face_count() / 8, seed);
            let bytes = written(&splits, None);
            let back = read(&bytes);
            assert!(back.is_complete && back.warnings.is_empty(), "{name}");
            assert_same(&back.splits, &splits);
            assert_eq!(back.announced, (splits.len(), *splits.counts.last().unwrap()), "{name}");
            assert_eq!(written(&back.splits, None), bytes, "{name}");
            let mut reader = LpmReader::new(&bytes[..], Limits::default()).unwrap();
            while reader.next_chunk().unwrap() {}
            assert_mesh(&reader.mesh().unwrap(), &mesh);
        }
    }
}

fn assert_mesh(got: &TriMesh, wanted: &TriMesh) {
    let plain = |mesh: &TriMesh| {
        let mut mesh = mesh.clone();
        let mut all = Vec::new();
        for i in 0..mesh.further_attributes().len() {
            let values = mesh.further_values_mut(i);
            all.push(bits(values));
            values.fill(0.0);
        }
        (mesh, all)
    };
    let ((got, further), (wanted, wanted_further)) = (plain(got), plain(wanted));
    assert_eq!(further, wanted_further);
    assert!(got == wanted, "{got:?}\n{wanted:?}");
}

#[test]
fn it_is_read_as_a_mesh_like_any_other_format() {
    let mesh = rich(false);
    let bytes = written(&record(&mesh, 20, 7), None);
    let loaded = read_bytes(&bytes, &ReadOptions::default()).unwrap();
    assert_eq!(loaded.format, Format::Lpm);
    assert_mesh(&loaded.mesh, &mesh);
    assert!(loaded.contents.attributes.iter().any(|a| a == "tangents"));
}

#[test]
fn a_hundred_prefixes_are_meshes() {
    for (mesh, seed) in [(rich(false), 3), (shapes::torus(24, 16), 4), (shapes::soup(80, 2), 5)] {
        let splits = record(&mesh, mesh.face_count() / 10, seed);
        for positions_bits in [None, Some(12)] {
            let bytes = written(&splits, positions_bits);
            let whole = read(&bytes);
            let mut dice = Random(seed);
            let (mut meshes, mut levels) = (0, Vec::new());
            for _ in 0..100 {
                let cut = dice.below(bytes.len());
                let Ok(reader) = LpmReader::new(&bytes[..cut], Limits::default()) else {
                    assert!(cut < bytes.len() / 2, "{cut} of {}", bytes.len());
                    continue;
                };
                let mut reader = reader;
                while reader.next_chunk().unwrap() {}
                assert!(!reader.is_complete());
                let level = reader.level();
                let counts = whole.splits.counts[level];
                assert_eq!(reader.counts(), counts);
                let coarse = reader.mesh().unwrap();
                assert_eq!(coarse.face_count(), counts.faces as usize);
                Topology::unwelded(&coarse.surface()).check();
                let part = reader.into_lpm().unwrap();
                assert!(!part.is_complete && (part.splits.original.is_none() || level == splits.len()));
                assert_eq!(part.splits.counts[..], whole.splits.counts[..=level]);
                assert_eq!(part.splits.faces[..], whole.splits.faces[..counts.faces as usize]);
                let said = &part.warnings[0];
                assert!(said.data_lost && said.text.contains("incomplete"), "{said}");
                meshes += 1;
                levels.push(level);
            }
            assert!(meshes > 30, "{meshes}");
            assert!(levels.iter().any(|l| *l > 0));
        }
    }
}

#[test]
fn rounded_files_are_as_close_as_their_grid() {
    for mesh in [shapes::noisy_sphere(3, 0.01, 1), rich(false), rich(true)] {
        let splits = record(&mesh, mesh.face_count() / 10, 11);
        for positions_bits in [8, 16, 24] {
            let bytes = written(&splits, Some(positions_bits));
            let back = read(&bytes);
            assert_eq!(back.bits, Some(positions_bits));
            assert!(back.is_complete && back.splits.original.is_none());
            let (a, b) = (&back.splits, &splits);
            assert_eq!((&a.counts, &a.faces, &a.corners), (&b.counts, &b.faces, &b.corners));
            assert_eq!((&a.vertex_of, &a.owners, &a.regions), (&b.vertex_of, &b.owners, &b.regions));
            let (born, moved) = (b.positions.view(), b.places.to.view());
            let all = born.iter().chain(moved.iter());
            let (min, max) = all.fold(([f64::INFINITY; 3], [f64::NEG_INFINITY; 3]), |(a, b), p| {
                ([0, 1, 2].map(|k| a[k].min(p[k])), [0, 1, 2].map(|k| b[k].max(p[k])))
            });
            let size = (0..3).map(|k| max[k] - min[k]).fold(0.0, f64::max);
            let step = size / f64::from((1u32 << positions_bits) - 1);
            let farthest = |a: &Positions, b: &Positions| {
                let (a, b) = (a.view(), b.view());
                let pairs = a.iter().zip(b.iter());
                pairs.flat_map(|(p, q)| [0, 1, 2].map(|k| (p[k] - q[k]).abs())).fold(0.0, f64::max)
            };
            let off = farthest(&a.positions, &b.positions).max(farthest(&a.places.to, &b.places.to));
            assert!(off <= 0.5001 * step + 1e-6 * size && off > 0.0, "{off} {step}");
            let width = b.layout.width().max(1);
            for (a, b) in a.values.chunks_exact(width).zip(b.values.chunks_exact(width)) {
                let length = |n: &[f32]| n.iter().map(|x| x * x).sum::<f32>().sqrt();
                let dot = |k: usize| {
                    (k..k + 3).map(|k| a[k] * b[k]).sum::<f32>()
                        / (length(&a[k..k + 3]) * length(&b[k..k + 3]))
                };
                // Normals and tangents have at least 8 bits, colours 8, the others more.
                assert!(dot(0) > 0.999 && dot(9) > 0.999, "{a:?} {b:?}");
                let mut others = (3..width).filter(|k| !(9..12).contains(k));
                assert!(others.all(|k| a[k] == b[k] || (a[k] - b[k]).abs() < 0.01 || b[k].is_nan()));
            }
            assert_eq!(a.checkpoints.len(), b.checkpoints.len());
        }
    }
}

#[test]
fn fits_are_rounded_by_their_error_unless_every_bit_is_asked_for() {
    let splits = record(&rich(false), 20, 5);
    let mut out = Vec::new();
    lpm::write(&splits, None, &LpmOptions::default(), &mut out).unwrap();
    let back = read(&out).splits;
    assert!(out.len() < written(&splits, None).len());
    let mut plain = back.clone().into_data();
    for (a, b) in plain.checkpoints.iter_mut().zip(&splits.checkpoints) {
        let off = |a: &[f32], b: &[f32]| a.iter().zip(b).fold(0f32, |m, (a, b)| m.max((a - b).abs()));
        let moved = off(a.moves.as_flattened(), b.moves.as_flattened());
        assert!(moved > 0.0 && f64::from(moved) <= b.error / 8.0, "{moved} {}", b.error);
        let largest = b.changes.iter().fold(0f32, |m, x| m.max(x.abs()));
        assert!(off(&a.changes, &b.changes) <= largest / 512.0);
        assert_eq!((&a.vertices, &a.wedges), (&b.vertices, &b.wedges));
        a.clone_from(b);
    }
    assert_same(&plain, &splits);
    let mut again = Vec::new();
    lpm::write(&back, None, &LpmOptions::default(), &mut again).unwrap();
    assert_eq!(read(&again).splits.checkpoints[0].moves, back.checkpoints[0].moves);
}

#[test]
fn positions_that_do_not_fit_a_grid_are_refused() {
    let positions = Positions::F32(vec![[0.0; 3], [f32::NAN, 0.0, 0.0], [0.0, 1.0, 0.0]]);
    let mesh = TriMesh::new(positions, vec![[0, 1, 2].map(VertexId)]).unwrap();
    let splits = record(&mesh, 1, 0);
    let mut options = LpmOptions::default();
    for (wrong, word) in [(16, "not finite"), (5, "6 to 24"), (25, "6 to 24")] {
        options.bits = Some(wrong);
        let error = lpm::write(&splits, None, &options, &mut Vec::new()).unwrap_err();
        assert!(error.to_string().contains(word), "{error}");
    }
    let back = read(&written(&splits, None));
    assert!(matches!(&back.splits.positions, Positions::F32(p) if p[1][0].is_nan()));
}

#[test]
fn attributes_that_could_not_be_read_back_are_not_written() {
    let with = |semantic: Semantic, width: usize| {
        let mut mesh = shapes::cube(1);
        let values = vec![0.5; width * mesh.wedge_count()];
        mesh.add_attribute(Attribute { semantic, width, values }).unwrap();
        let splits = record(&mesh, 4, 1);
        let mut bytes = Vec::new();
        lpm::write(&splits, None, &LpmOptions::default(), &mut bytes).map(|_| bytes)
    };
    let named = |length: usize| Semantic::Custom("n".repeat(length));
    for (semantic, width) in [(named(9), 4096), (named(65_535), 1)] {
        assert!(read(&with(semantic, width).unwrap()).is_complete);
    }
    for (semantic, width, word) in [(named(9), 4097, "4,096"), (named(65_536), 1, "65,535")] {
        let error = with(semantic, width).unwrap_err().to_string();
        assert!(error.contains(word) && error.len() < 300, "{error}");
    }
}

#[test]
fn a_limit_of_memory_is_named_and_what_was_read_before_stays() {
    let bytes = written(&record(&shapes::icosphere(3), 20, 1), None);
    let mut limits = Limits::default();
    limits.memory = 60_000;
    let mut options = ReadOptions::default();
    options.limits = limits;
    let error = lpm::read(&bytes[..], &options).unwrap_err();
    assert!(matches!(error, ReadError::Memory(_)), "{error}");
    options.limits = Limits::default();
    options.limits.bytes = bytes.len() as u64 + 1;
    let error = lpm::read(&bytes[..], &options).unwrap_err();
    assert!(matches!(error, ReadError::Limit { what: "the unpacked progressive mesh", .. }), "{error}");

    let mut reader = LpmReader::new(&bytes[..], limits).unwrap();
    let error = loop {
        match reader.next_chunk() {
            Ok(is_open) => assert!(is_open, "the limit is not met"),
            Err(error) => break error,
        }
    };
    assert!(matches!(error, ReadError::Memory(_)), "{error}");
    assert!(!reader.next_chunk().unwrap() && !reader.is_complete());
    assert!(reader.mesh().unwrap().face_count() >= 20);
}

/// Returns the offsets of chunks.
fn chunks(bytes: &[u8]) -> Vec<usize> {
    let mut at = 8;
    let mut all = Vec::new();
    while at + 4 <= bytes.len() {
        all.push(at);
        at += 12 + u32::from_le_bytes(bytes[at..at + 4].try_into().unwrap()) as usize;
    }
    all
}

/// Returns the offset of the packed streams in the content of a chunk.
fn streams_at(kind: &[u8]) -> Option<usize> {
    match kind {
        b"BASE" | b"ORIG" => Some(0),
        b"SPLT" => Some(4),
        b"CHKP" => Some(16),
        _ => None,
    }
}

fn chunk(kind: &[u8], content: &[u8]) -> Vec<u8> {
    let mut chunk = (content.len() as u32).to_le_bytes().to_vec();
    chunk.extend(kind);
    chunk.extend(content);
    let sum = crc32fast::hash(&chunk[4..]);
    chunk.extend(sum.to_le_bytes());
    chunk
}

fn packed(plain: &[u8], level: Compression) -> Vec<u8> {
    let mut out = DeflateEncoder::new(Vec::new(), level);
    out.write_all(plain).unwrap();
    out.finish().unwrap()
}

/// Returns a file whose packed streams have gone through a function, and are stored without compression, so
/// that a changed byte is a changed number.
fn repacked(bytes: &[u8], mut change: impl FnMut(&[u8], &mut Vec<u8>)) -> Vec<u8> {
    let mut out = bytes[..8].to_vec();
    for at in chunks(bytes) {
        let length = u32::from_le_bytes(bytes[at..at + 4].try_into().unwrap()) as usize;
        let (kind, content) = (&bytes[at + 4..at + 8], &bytes[at + 8..at + 8 + length]);
        let mut content = content.to_vec();
        if let Some(front) = streams_at(kind) {
            let mut plain = Vec::new();
            DeflateDecoder::new(&content[front..]).read_to_end(&mut plain).unwrap();
            change(kind, &mut plain);
            content.truncate(front);
            content.extend(packed(&plain, Compression::none()));
        }
        out.extend(chunk(kind, &content));
    }
    out
}

/// Corrects the checksums.
fn fix_checksums(bytes: &mut [u8]) {
    for at in chunks(bytes) {
        let length = u32::from_le_bytes(bytes[at..at + 4].try_into().unwrap()) as usize;
        let Some(all) = bytes.get(at + 4..at + 8 + length) else { return };
        let sum = crc32fast::hash(all).to_le_bytes();
        if let Some(place) = bytes.get_mut(at + 8 + length..at + 12 + length) {
            place.copy_from_slice(&sum);
        }
    }
}

#[test]
fn a_flipped_bit_is_seen() {
    let bytes = written(&record(&shapes::icosphere(3), 20, 1), None);
    let mut dice = Random(9);
    for _ in 0..300 {
        let mut flipped = bytes.clone();
        let at = dice.below(bytes.len());
        flipped[at] ^= 1 << dice.below(8);
        // A changed length looks like a truncated file; any other change is an error.
        let is_length = chunks(&bytes).iter().any(|chunk| (*chunk..chunk + 4).contains(&at));
        match lpm::read(&flipped[..], &ReadOptions::default()) {
            Ok(read) => assert!(is_length && !read.is_complete, "byte {at}"),
            Err(e) => assert!(!e.to_string().is_empty()),
        }
    }
}

/// Reads bytes as far as they go; checks the mesh, and what was read.
fn read_what_there_is(bytes: &[u8]) {
    let mut limits = Limits::default();
    limits.bytes = 1 << 24;
    let Ok(mut reader) = LpmReader::new(bytes, limits) else { return };
    while let Ok(true) = reader.next_chunk() {}
    if let Ok(mesh) = reader.mesh() {
        Topology::unwelded(&mesh.surface()).check();
    }
    // The result is consistent, or refused.
    if let Ok(part) = reader.into_lpm() {
        assert_eq!(part.splits.faces.len(), part.splits.counts.last().unwrap().faces as usize);
    }
}

#[test]
fn damage_at_any_byte_does_no_harm() {
    for (mesh, stride) in
        [(shapes::cube(1), 1), (shapes::icosphere(1), 1), (shapes::soup(8, 4), 1), (rich(false), 31)]
    {
        for positions_bits in [None, Some(10)] {
            let bytes = repacked(&written(&record(&mesh, 4, 2), positions_bits), |_, _| {});
            for at in (8..bytes.len()).step_by(stride) {
                for change in [1, 0xff] {
                    let mut wild = bytes.clone();
                    wild[at] ^= change;
                    if !chunks(&bytes).iter().any(|c| (*c..c + 4).contains(&at)) {
                        fix_checksums(&mut wild);
                    }
                    read_what_there_is(&wild);
                }
            }
        }
    }
}

#[test]
fn streams_stored_without_compression_are_read() {
    let bytes = written(&record(&rich(false), 20, 3), None);
    let stored = repacked(&bytes, |_, _| {});
    assert!(stored.len() > bytes.len());
    assert_same(&read(&stored).splits, &read(&bytes).splits);
}

#[test]
fn files_of_version_1_are_refused_with_advice() {
    let mut bytes = written(&record(&shapes::cube(1), 4, 1), None);
    assert_eq!(bytes[16..18], [2, 0]);
    bytes[16] = 1;
    fix_checksums(&mut bytes);
    let error = lpm::read(&bytes[..], &ReadOptions::default()).unwrap_err();
    assert!(matches!(error, ReadError::Unsupported(_)), "{error}");
    let text = error.to_string();
    assert!(text.contains("version 1") && text.contains("`lodsmith progressive build`"), "{text}");
}

#[test]
fn streams_that_unpack_to_hundreds_of_times_their_size_are_refused() {
    let bytes = written(&record(&shapes::icosphere(2), 20, 1), None);
    let bomb = packed(&vec![0; 80 << 20], Compression::best());
    assert!(bomb.len() < 100_000);
    for kind in [b"BASE", b"SPLT", b"CHKP", b"ORIG"] {
        let mut bad = bytes[..8].to_vec();
        for at in chunks(&bytes) {
            let end = at + 12 + u32::from_le_bytes(bytes[at..at + 4].try_into().unwrap()) as usize;
            match &bytes[at + 4..at + 8] == kind {
                true => {
                    let front = streams_at(kind).unwrap();
                    bad.extend(chunk(kind, &[&bytes[at + 8..at + 8 + front], &bomb[..]].concat()));
                }
                false => bad.extend(&bytes[at..end]),
            }
        }
        let mut options = ReadOptions::default();
        let error = lpm::read(&bad[..], &options).unwrap_err();
        assert!(matches!(error, ReadError::Ratio { what: "a chunk", .. }), "{error}");
        options.limits.bytes = 1 << 20;
        let error = lpm::read(&bad[..], &options).unwrap_err();
        assert!(matches!(error, ReadError::Limit { .. }), "{error}");
        options.limits = Limits::default();
        options.limits.memory = 1 << 20;
        let error = lpm::read(&bad[..], &options).unwrap_err();
        assert!(matches!(error, ReadError::Memory(_)), "{error}");
    }
}

#[test]
fn bytes_that_no_step_uses_are_refused() {
    let bytes = written(&record(&shapes::icosphere(2), 20, 1), None);
    for kind in [b"BASE", b"SPLT", b"CHKP", b"ORIG"] {
        let bad = repacked(&bytes, |own, plain| {
            if own == kind {
                // One more byte in the last stream.
                let count = u32::from_le_bytes(plain[..4].try_into().unwrap()) as usize;
                let length = &mut plain[4 * count..4 * count + 4];
                let more = u32::from_le_bytes(length.try_into().unwrap()) + 1;
                length.copy_from_slice(&more.to_le_bytes());
                plain.push(0);
            }
        });
        let error = lpm::read(&bad[..], &ReadOptions::default()).unwrap_err();
        assert!(error.to_string().contains("bytes that are not used"), "{error}");
    }
}

#[test]
fn empty_splits_and_checkpoints_count_toward_the_limit() {
    let base = record(&shapes::icosphere(3), 1280, 1).into_data();
    let with = |splits: usize, is_fitted: bool| {
        let mut data = base.clone();
        data.original = None;
        data.checkpoints.clear();
        let last = *data.counts.last().unwrap();
        data.counts.extend(vec![last; splits]);
        let SplitData { corners, owners, rows, places, .. } = &mut data;
        for ends in [&mut corners.ends, &mut owners.ends, &mut rows.ends, &mut places.ends] {
            ends.extend(vec![*ends.last().unwrap(); splits]);
        }
        let level = data.counts.len() as u32 - 1 - splits as u32;
        for s in (0..splits as u32).filter(|_| is_fitted) {
            let checkpoint = Checkpoint {
                level: level + s,
                vertices: (0..last.vertices as usize).map(VertexId::new).collect(),
                moves: vec![[0.0; 3]; last.vertices as usize],
                ..Checkpoint::default()
            };
            data.checkpoints.push(checkpoint);
        }
        written(&Splits::new(data).unwrap(), None)
    };
    for (splits, is_fitted) in [(100_000, false), (300, true)] {
        let bytes = with(splits, is_fitted);
        assert!(bytes.len() < 200_000, "{}", bytes.len());
        let mut options = ReadOptions::default();
        options.limits.bytes = 2 << 20;
        let error = lpm::read(&bytes[..], &options).unwrap_err();
        assert!(matches!(error, ReadError::Limit { what: "the unpacked progressive mesh", .. }), "{error}");
        options.limits.bytes = 8 << 20;
        assert!(lpm::read(&bytes[..], &options).unwrap().is_complete);
    }
}

#[test]
fn untrusted_bytes_do_no_harm() {
    let mut dice = Random(17);
    for mesh in [shapes::icosphere(2), rich(false), shapes::soup(30, 3)] {
        for positions_bits in [None, Some(10)] {
            let bytes = repacked(&written(&record(&mesh, 10, 2), positions_bits), |_, _| {});
            for _ in 0..500 {
                let mut wild = bytes.clone();
                for _ in 0..=dice.below(4) {
                    let at = 8 + dice.below(wild.len() - 8);
                    // Lengths mostly stay unchanged, since otherwise no other check would be reached.
                    if dice.below(20) > 0 && chunks(&bytes).iter().any(|c| (*c..c + 8).contains(&at)) {
                        continue;
                    }
                    wild[at] = dice.below(256) as u8;
                }
                if dice.below(10) == 0 {
                    wild.truncate(dice.below(wild.len()));
                }
                let is_whole = chunks(&wild).last().is_some_and(|at| at + 12 <= wild.len());
                if is_whole && dice.below(10) > 0 {
                    fix_checksums(&mut wild);
                }
                read_what_there_is(&wild);
            }
        }
    }
}

#[test]
fn chunks_that_are_not_known_are_skipped_or_refused_by_their_first_letter() {
    let bytes = written(&record(&shapes::cube(3), 20, 1), None);
    let base = chunks(&bytes)[1];
    let with = |at: usize, kind: &[u8; 4]| {
        let mut all = bytes.clone();
        all.splice(at..at, chunk(kind, b"abc"));
        all
    };
    for at in [base, *chunks(&bytes).last().unwrap()] {
        let skipped = read(&with(at, b"note"));
        assert!(skipped.is_complete && skipped.sizes.total() == bytes.len() as u64 + 15);
        match lpm::read(&with(at, b"NOTE")[..], &ReadOptions::default()) {
            Ok(part) => panic!("{} splits of a chunk that is not known", part.splits.len()),
            Err(e) if at == base => assert!(e.to_string().contains("base mesh is missing"), "{e}"),
            Err(e) => assert!(e.to_string().contains("an unknown kind"), "{e}"),
        }
    }
}

#[test]
fn wrong_lengths_reserve_no_memory() {
    let bytes = written(&record(&shapes::cube(3), 20, 1), None);
    for at in chunks(&bytes) {
        let mut lying = bytes.clone();
        lying[at..at + 4].copy_from_slice(&u32::MAX.to_le_bytes());
        let base = chunks(&bytes)[1];
        match lpm::read(&lying[..], &ReadOptions::default()) {
            Ok(part) => assert!(at > base && !part.is_complete),
            Err(e) => assert!(at <= base && e.to_string().contains("before the end of the base mesh"), "{e}"),
        }
        let mut options = ReadOptions::default();
        options.limits.bytes = 1 << 20;
        assert!(lpm::read(&lying[..], &options).is_err());
    }
}
