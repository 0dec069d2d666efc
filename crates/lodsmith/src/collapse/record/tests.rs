//! The log of a few collapses: its contents, and that undoing it restores the input.

use glam::Vec3;

use super::*;
use crate::collapse::candidate::CollapseOutcome;
use crate::collapse::test_support::{engine_of, engine_with_values, try_at, without_lines};
use crate::collapse::{Engine, Goal, order};
use crate::cost::metric::Memoryless;
use crate::test_support::{SmallMesh, octahedron, pyramid, sheet, tetrahedron};

/// Starts to record an engine of a small mesh, which has the numbers of the input.
fn recorded(small: &SmallMesh) -> Engine<Memoryless> {
    let mut engine = engine_of(Memoryless, small, &without_lines());
    engine.mesh.store.names = Some((0..small.faces.len() as u32).collect());
    let (mesh, count) = (small.mesh(), small.points.len());
    let names = InputNames {
        vertices: (0..count).map(VertexId::new).collect(),
        wedges: (0..count).map(WedgeId::new).collect(),
        faces: (0..small.faces.len()).map(FaceId::new).collect(),
        has_wedges: false,
        keeps_wedges: false,
    };
    let copy = MeshCopy {
        faces: mesh.triangles().to_vec(),
        vertex_of: (0..count).map(VertexId::new).collect(),
        width: 0,
        rows: Vec::new(),
        positions: mesh.positions().clone(),
    };
    engine.log_start(Box::new(Record::new(names, copy, unit_frame(), None, Vec::new())));
    engine
}

/// Returns the frame that leaves the coordinates of the input unchanged.
fn unit_frame() -> UnitFrame {
    let octahedron = octahedron().scaled(0.5).mesh();
    order::order(&octahedron.surface()).frame
}

fn record(engine: &Engine<Memoryless>) -> &Record {
    engine.record.as_deref().expect("the run is recorded")
}

fn collapse(engine: &mut Engine<Memoryless>, ends: [u32; 2], step: Vec3) {
    assert!(matches!(try_at(engine, ends, step, f32::MAX), CollapseOutcome::Done), "{ends:?}");
}

/// Undoes all changes of a log in the copy, the last one first.
fn undone(record: &Record) -> MeshCopy {
    let (mut copy, log) = (record.copy.clone(), &record.log);
    for change in (0..log.steps.len()).rev() {
        let of = |list: usize| {
            let before = change.checked_sub(1).map_or(0, |i| log.steps[i].ends[list]);
            before as usize..log.steps[change].ends[list] as usize
        };
        for &(face, corners) in &log.dead[of(0)] {
            copy.faces[face.index()] = corners;
        }
        for &(at, wedge) in &log.corners[of(1)] {
            copy.faces[at as usize / 3][at as usize % 3] = wedge;
        }
        for &(wedge, vertex) in &log.owners[of(2)] {
            copy.vertex_of[wedge.index()] = vertex;
        }
        for i in of(4) {
            if let Positions::F32(all) = &mut copy.positions {
                all[log.places[i].index()] = log.positions[i].map(|x| x as f32);
            }
        }
    }
    copy
}

#[test]
fn a_collapse_logs_dead_faces_corners_and_the_moved_vertex() {
    let small = pyramid(0.5);
    let mut engine = recorded(&small);
    // The cleanup at the start had nothing to do.
    assert_eq!(record(&engine).log.steps.len(), 1);
    assert_eq!(record(&engine).log.steps[0].ends, [0; 6]);
    collapse(&mut engine, [1, 0], Vec3::new(-0.5, -0.5, 0.25));
    let log = &record(&engine).log;
    let corners = |f: usize| small.faces[f].map(WedgeId);
    assert_eq!(log.dead, [(FaceId(0), corners(0)), (FaceId(3), corners(3))]);
    // The first corners of faces 1 and 2 were the apex.
    assert_eq!(log.corners, [(3, WedgeId(0)), (6, WedgeId(0))]);
    assert_eq!((&log.places[..], &log.positions[..]), (&[VertexId(1)][..], &[[1.0, 1.0, 0.0]][..]));
    assert_eq!(log.merged, [(VertexId(0), VertexId(1))]);
    assert!(log.owners.is_empty() && log.rows.is_empty());
    assert_eq!(log.steps[1].ends, [2, 2, 0, 0, 1, 1]);
    let spent = engine.tally.collapse_cost;
    assert!(spent > 0.0 && (f64::from(log.steps[1].spent) - spent).abs() < 1e-6 && log.steps[1].lost == 0.0);
    assert_eq!(record(&engine).copy.faces[1], [1, 2, 3].map(WedgeId));
    let view = record(&engine).copy.positions.view();
    assert!((0..3).all(|k| (view.get(VertexId(1))[k] - [0.5, 0.5, 0.25][k]).abs() < 1e-6));
}

#[test]
fn a_vertex_at_an_input_position_keeps_its_bits() {
    // At the kept end nothing moves; at the other end the merged vertex is the input's vertex there, and
    // corners of 1 become 0.
    let small = pyramid(0.5);
    let mut stays = recorded(&small);
    collapse(&mut stays, [1, 0], Vec3::ZERO);
    assert!(record(&stays).log.places.is_empty());
    let mut other = recorded(&small);
    collapse(&mut other, [1, 0], Vec3::new(-1.0, -1.0, 0.5));
    let log = &record(&other).log;
    assert!(log.places.is_empty() && log.corners.is_empty(), "{log:?}");
    assert_eq!(log.merged, [(VertexId(1), VertexId(0))]);
}

#[test]
fn undoing_the_log_restores_the_input_to_the_bit() {
    let mut small = sheet(4);
    small.points.iter_mut().for_each(|p| p.z = 0.1 * (p.x * 1.3).sin() * (p.y * 0.7).cos());
    let mut engine = recorded(&small);
    for (ends, step) in [
        ([12, 17], Vec3::new(0.1, 0.4, 0.02)),
        ([6, 7], Vec3::new(0.3, 0.1, 0.0)),
        ([12, 13], Vec3::ZERO),
        ([11, 12], Vec3::new(0.2, 0.1, 0.01)),
    ] {
        collapse(&mut engine, ends, step);
    }
    let record = record(&engine);
    assert_eq!(record.log.steps.len(), 5);
    let (back, mesh) = (undone(record), small.mesh());
    assert_eq!(back.faces, mesh.triangles());
    assert_eq!(&back.positions, mesh.positions());
    assert!(back.positions != record.copy.positions && back.faces != record.copy.faces);
}

#[test]
fn keys_are_never_below_those_of_earlier_changes_nearby() {
    // The first change is expensive, the second is near it and cheap, and the third is far away.
    let mut small = sheet(7);
    small.points[18].z = 0.4;
    let mut engine = recorded(&small);
    collapse(&mut engine, [18, 19], Vec3::X);
    collapse(&mut engine, [19 - 8 - 1, 19 - 8], Vec3::ZERO);
    collapse(&mut engine, [45, 46], Vec3::ZERO);
    let keys: Vec<f32> = record(&engine).log.steps.iter().map(|s| s.key).collect();
    assert!(keys[0] == f32::NEG_INFINITY && keys[1] > 0.01, "{keys:?}");
    assert_eq!(keys[2], keys[1]);
    assert!(keys[3] < 1e-6, "{keys:?}");
    // After a floor, no key is below an earlier one.
    engine.record.as_deref_mut().expect("recorded").raise_floor();
    collapse(&mut engine, [52, 53], Vec3::ZERO);
    assert_eq!(record(&engine).log.steps[4].key, keys[1]);
}

#[test]
fn removed_parts_and_their_cost_are_logged() {
    let small = tetrahedron().and(&tetrahedron().scaled(0.5), Vec3::X * 4.0);
    let mut engine = recorded(&small);
    let goal = Goal { faces: Some(4), vertices: None };
    assert!(engine.remove_parts(&goal));
    let log = &record(&engine).log;
    assert_eq!(log.dead.iter().map(|d| d.0.0).collect::<Vec<_>>(), [4, 5, 6, 7]);
    let lost = engine.tally.removed_part_cost;
    let step = log.steps.last().expect("a change");
    assert!(lost > 0.0 && (f64::from(step.lost) - lost).abs() < 1e-6 && step.spent == 0.0);
    // It has four faces, so two of them cost half as much.
    assert!((f64::from(step.key) - lost / 2.0).abs() < 1e-6);
    assert_eq!(undone(record(&engine)).faces, small.mesh().triangles());
}

#[test]
fn an_input_wedge_at_another_vertex_gets_a_number_of_its_own() {
    // If wedges keep their numbers, each wedge belongs to one vertex of the input.
    let small = pyramid(0.5);
    let engine = engine_with_values(Memoryless, &small, (&small.faces, &[0.0; 5]), &without_lines());
    let mut record = Record::new(
        InputNames {
            vertices: (0..5).map(VertexId).collect(),
            wedges: Vec::new(),
            faces: (0..4).map(FaceId).collect(),
            has_wedges: true,
            keeps_wedges: true,
        },
        MeshCopy {
            faces: small.mesh().triangles().to_vec(),
            vertex_of: (0..5).map(VertexId).collect(),
            width: 1,
            rows: vec![0.0, 1.0, 2.0, 3.0, 4.0],
            positions: small.mesh().positions().clone(),
        },
        unit_frame(),
        None,
        (0..5).map(VertexId).collect(),
    );
    let attributes = engine.mesh.values.attributes.as_ref();
    let mut number =
        |vertex: u32, wedge: u32| record.wedge(VertexId(vertex), Some(WedgeId(wedge)), attributes);
    assert_eq!([number(2, 2), number(2, 3), number(4, 3), number(2, 3)], [2, 5, 6, 5].map(WedgeId));
    assert_eq!(record.copy.rows, [0.0, 1.0, 2.0, 3.0, 4.0, 3.0, 3.0]);
    assert_eq!(record.copy.vertex_of[5..], [2, 4].map(VertexId));
    // A vertex made by a cut gets the next number, and a position.
    assert_eq!(record.vertex(VertexId(5)), VertexId(5));
    assert_eq!((record.copy.positions.len(), record.keys.len()), (6, 6));
}
