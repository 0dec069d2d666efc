//! How long a picture takes: `cargo run --release -p lodsmith-render --example draw_speed [FACES...]`.
#![allow(clippy::print_stdout, reason = "an example prints")]

use std::f32::consts::{PI, TAU};
use std::time::Instant;

use lodsmith_core::{Positions, TriMesh, VertexId};
use lodsmith_render::{Shading, StandardView, Subject, View, render};

/// A wavy ball of about so many faces.
fn ball(faces: usize) -> TriMesh {
    let rows = ((faces as f32 / 4.0).sqrt() as u32).max(3);
    let columns = rows * 2;
    let place = |a: f32, b: f32| {
        let r = 1.0 + 0.08 * (8.0 * a).sin() * (8.0 * b).sin();
        [a.sin() * b.cos() * r, a.cos() * r, a.sin() * b.sin() * r]
    };
    let angle = |i: u32, n: u32, turn: f32| i as f32 / n as f32 * turn;
    let positions = (0..=rows)
        .flat_map(|r| (0..=columns).map(move |c| (r, c)))
        .map(|(r, c)| place(angle(r, rows, PI), angle(c, columns, TAU)))
        .collect();
    let triangles = (0..rows)
        .flat_map(|r| (0..columns).map(move |c| r * (columns + 1) + c))
        .flat_map(|k| [[k, k + 1, k + columns + 1], [k + columns + 1, k + 1, k + columns + 2]])
        .map(|t| t.map(VertexId))
        .collect();
    TriMesh::new(Positions::F32(positions), triangles).expect("the indices are in range")
}

fn main() {
    let asked: Vec<usize> = std::env::args().skip(1).filter_map(|a| a.parse().ok()).collect();
    let counts = if asked.is_empty() { vec![70_000, 1_000_000] } else { asked };
    for faces in counts {
        let subject = Subject::of_mesh(ball(faces)).expect("a ball can be drawn");
        let bounds = subject.bounds().expect("a ball has faces");
        let mut view = View::of(&bounds, StandardView::Iso, 1024, 768);
        let looks = [(Shading::Flat, false), (Shading::Smooth, false), (Shading::Smooth, true)];
        for (shading, wireframe) in looks {
            (view.look.shading, view.look.wireframe) = (shading, wireframe);
            for threads in [1, 2] {
                let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("threads");
                let once = || {
                    let begin = Instant::now();
                    let picture = pool.install(|| render(&subject, &view));
                    assert!(picture.is_ok_and(|p| p.width() == 1024));
                    begin.elapsed().as_secs_f64() * 1e3
                };
                once();
                let best = (0..9).map(|_| once()).fold(f64::INFINITY, f64::min);
                let lines = if wireframe { " with lines" } else { "" };
                let faces = subject.face_count();
                println!("{faces} faces, {}{lines}, {threads} threads: {best:.1} ms", shading.name());
            }
        }
    }
}
