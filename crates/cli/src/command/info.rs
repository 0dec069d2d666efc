//! `lodsmith info`: reports the content and the defects of a file.

use std::time::Instant;

use lodsmith::core::mesh::weld::weld;
use lodsmith::core::topology::{Size, Topology, TopologyCounts, size_of};
use lodsmith::core::{Bounds, PositionsView, Surface, VertexId};
use lodsmith_io::vertex_cache::CacheUse;
use lodsmith_io::{Format, Loaded, Sizes};
use serde_json::{Value, json};

use crate::args::InfoArgs;
use crate::exit;
use crate::file;
use crate::in_order;
use crate::numbers::{grouped, seconds, significant};
use crate::output::Output;
use crate::paths::{self, Source};
use crate::progress::Progress;
use crate::sizes;
use crate::status::Status;
use crate::warnings::{show_warnings, texts, viewing_warnings};
use crate::{memory, memory_need};

/// Inspects every input.
pub(super) fn run(args: &InfoArgs) -> anyhow::Result<Status> {
    paths::at_most_one_stdin(&args.inputs)?;
    let out = Output::new(&args.run, args.json, false);
    let progress = Progress::new(args.inputs.len(), args.run.quiet);
    let mut status = Status::Done;
    in_order::process_in_order(
        &args.inputs,
        args.run.threads(),
        |source, _| exit::guarded(|| inspect(source, args, &progress)),
        |i, outcome| {
            let path = args.inputs[i].to_string();
            progress.with_bar_hidden(|| match outcome {
                Ok(facts) => {
                    out.object(&facts.to_json(&path));
                    for line in facts.table(&path) {
                        out.line(&line);
                    }
                    out.detail(&format!("  time             {}", seconds(facts.secs)));
                    show_warnings(&out, &path, &viewing_warnings(&facts.loaded.warnings), false);
                }
                Err(e) => status = status.or_worse(out.failure(&path, &e)),
            });
        },
    )?;
    progress.finish();
    out.finish(status)
}

/// Facts about one file.
struct Facts {
    loaded: Loaded,
    places: usize,
    topology: TopologyCounts,
    /// True if it is closed where only vertices with the same index are joined; `None` for a format without
    /// indices.
    closed_by_index: Option<bool>,
    duplicate_faces: usize,
    two_sided_faces: usize,
    unused_vertices: usize,
    non_finite_vertices: usize,
    bounds: Option<Bounds>,
    size: Size,
    /// `None` if they are not known.
    sizes: Option<Sizes>,
    cache: CacheUse,
    secs: f64,
}

fn inspect(source: &Source, args: &InfoArgs, progress: &Progress) -> anyhow::Result<Facts> {
    let name = source.to_string();
    let bar = progress.file(&name);
    bar.read();
    let begin = Instant::now();
    let loaded = file::read(source, &args.reading)?;
    memory::check("info", memory_need::info(memory_need::Size::of(&loaded.mesh)))?;
    bar.stage(lodsmith::Stage::Measure);
    let surface = loaded.mesh.surface();
    let positions = surface.positions();
    let weld = weld(positions);
    let mut is_used = vec![false; positions.len()];
    for v in surface.triangles().iter().flatten() {
        is_used[v.index()] = true;
    }
    let places = weld.distinct_count;
    let topology = Topology::new(&surface).counts();
    let closed_by_index = is_closed_by_index(&loaded);
    let duplicate_faces = duplicate_faces(&surface, &weld.representative);
    let two_sided_faces = lodsmith::two_sided_faces(&surface);
    let unused_vertices = is_used.iter().filter(|used| !**used).count();
    let non_finite_vertices = positions.iter().filter(|p| !p.iter().all(|x| x.is_finite())).count();
    let (bounds, size) = (positions.bounds(), size_of(&surface));
    drop(surface);
    let sizes = sizes::of_input(source, &args.reading, sizes::of_loaded(&loaded));
    let cache = CacheUse::of_mesh(&loaded.mesh);
    let secs = begin.elapsed().as_secs_f64();
    bar.end();
    Ok(Facts {
        loaded,
        places,
        topology,
        closed_by_index,
        duplicate_faces,
        two_sided_faces,
        unused_vertices,
        non_finite_vertices,
        bounds,
        size,
        sizes,
        cache,
        secs,
    })
}

/// True if a surface is closed even if vertices at one position stay apart; `None` if the format has no indices.
/// In glTF a vertex is a position with its attributes.
fn is_closed_by_index(loaded: &Loaded) -> Option<bool> {
    if loaded.format == Format::Stl {
        return None;
    }
    let mesh = &loaded.mesh;
    Some(match (loaded.format, mesh.vertex_map()) {
        (Format::Gltf | Format::Glb, Some(map)) => {
            let places = mesh.positions().view();
            let places: Vec<[f64; 3]> = map.iter().map(|v| places.get(*v)).collect();
            let faces = mesh.triangles().iter().map(|t| t.map(|w| VertexId(w.0))).collect();
            let surface = Surface::with_triangles(PositionsView::F64(&places), faces);
            surface.is_ok_and(|surface| Topology::unwelded(&surface).counts().is_closed())
        }
        _ => Topology::unwelded(&mesh.surface()).counts().is_closed(),
    })
}

/// Returns the number of faces on the same three positions as an earlier one, in either winding.
fn duplicate_faces(surface: &Surface<'_>, place_of: &[VertexId]) -> usize {
    let sorted = |t: &[VertexId; 3]| {
        let mut t = t.map(|v| place_of[v.index()]);
        t.sort_unstable();
        t
    };
    let is_face = |t: &[VertexId; 3]| t[0] != t[1] && t[1] != t[2];
    let mut faces: Vec<[VertexId; 3]> = surface.triangles().iter().map(sorted).filter(is_face).collect();
    faces.sort_unstable();
    faces.windows(2).filter(|w| w[0] == w[1]).count()
}

impl Facts {
    fn to_json(&self, path: &str) -> Value {
        let (t, c) = (&self.topology, &self.loaded.contents);
        let corners = |f: fn(&Bounds) -> [f64; 3]| self.bounds.as_ref().map(f);
        let mut report = json!({
            "path": path,
            "format": self.loaded.format.name(),
            "meshes": c.meshes,
            "faces": self.loaded.mesh.face_count(),
            "polygons": c.polygons,
            "vertices": self.loaded.mesh.vertex_count(),
            "positions": self.places,
            "components": t.component_count,
            "border_edges": t.border_edge_count,
            "border_loops": t.border_loop_count,
            "non_manifold_edges": t.non_manifold_edge_count,
            "non_manifold_vertices": t.non_manifold_vertex_count,
            "degenerate_faces": t.degenerate_face_count,
            "duplicate_faces": self.duplicate_faces,
            "two_sided_faces": self.two_sided_faces,
            "unused_vertices": self.unused_vertices,
            "non_finite_vertices": self.non_finite_vertices,
            "closed": t.is_closed(),
            "closed_by_index": self.closed_by_index,
            "manifold": t.is_manifold(),
            "oriented": t.is_oriented(),
            "genus": t.genus(),
            "bounds": {
                "min": corners(|b| b.min), "max": corners(|b| b.max),
                "diagonal": self.bounds.as_ref().map(Bounds::diagonal),
            },
            "area": self.size.area,
            "volume": self.size.volume,
            "attributes": c.attributes,
            "materials": c.materials,
            "textures": c.textures,
            "skins": c.skins,
            "animations": c.animations,
            "morph_targets": c.morph_targets,
            "sizes": sizes::to_json(self.sizes),
            "cache": sizes::cache_json(&self.cache),
            "warnings": texts(&self.loaded.warnings),
        });
        if c.instances > 0 {
            report["distinct_meshes"] = c.distinct_meshes.into();
            report["instances"] = c.instances.into();
        }
        report
    }

    /// Returns a table; defects with count 0 are left out.
    fn table(&self, path: &str) -> Vec<String> {
        let (t, c) = (&self.topology, &self.loaded.contents);
        let mut lines = vec![format!("{path}")];
        let mut row = |name: &str, value: String| lines.push(format!("  {name:<18}{value}"));
        row("format", self.loaded.format.name().to_owned());
        let faces = self.loaded.mesh.face_count();
        if c.polygons == faces {
            row("faces", grouped(faces));
        } else {
            row("faces", format!("{} triangles from {} polygons", grouped(faces), grouped(c.polygons)));
        }
        let vertices = self.loaded.mesh.vertex_count();
        if self.places == vertices {
            row("vertices", grouped(vertices));
        } else {
            row("vertices", format!("{} at {} places", grouped(vertices), grouped(self.places)));
        }
        if c.instances > c.distinct_meshes {
            row("meshes", format!("{} in {} instances", grouped(c.distinct_meshes), grouped(c.instances)));
        } else if c.meshes > 1 {
            row("meshes", grouped(c.meshes));
        }
        let counts = [
            ("components", t.component_count),
            ("materials", c.materials),
            ("textures", c.textures),
            ("skins", c.skins),
            ("animations", c.animations),
            ("morph targets", c.morph_targets),
        ];
        for (name, n) in counts {
            if n > 0 {
                row(name, grouped(n));
            }
        }
        if !c.attributes.is_empty() {
            row("attributes", c.attributes.join(", "));
        }
        let is = |yes: bool, word: &str| if yes { word.to_owned() } else { format!("not {word}") };
        let closed = match (t.is_closed(), self.closed_by_index) {
            (true, Some(true)) => "closed by its indices".to_owned(),
            (true, Some(false)) => "closed, not by its indices".to_owned(),
            (is_closed, _) => is(is_closed, "closed"),
        };
        let kinds = [closed, is(t.is_manifold(), "manifold"), is(t.is_oriented(), "oriented")];
        let genus = t.genus().map_or(String::new(), |g| format!(", genus {g}"));
        row("surface", kinds.join(", ") + &genus);
        let defects = [
            ("border edges", t.border_edge_count),
            ("border loops", t.border_loop_count),
            ("non-man. edges", t.non_manifold_edge_count),
            ("non-man. vertices", t.non_manifold_vertex_count),
            ("degenerate faces", t.degenerate_face_count),
            ("duplicate faces", self.duplicate_faces),
            ("two-sided faces", self.two_sided_faces),
            ("unused vertices", self.unused_vertices),
            ("non-finite vert.", self.non_finite_vertices),
        ];
        for (name, n) in defects {
            if n > 0 {
                row(name, grouped(n));
            }
        }
        let figure = |x: f64| significant(x, 6);
        if let Some(b) = &self.bounds {
            let corner = |p: [f64; 3]| p.map(figure).join(" ");
            row("bounds", format!("{} to {}", corner(b.min), corner(b.max)));
            row("diagonal", figure(b.diagonal()));
        }
        row("area", figure(self.size.area));
        if let Some(s) = &self.sizes {
            let n = |n: u64| usize::try_from(n).unwrap_or(usize::MAX);
            row("draw calls", grouped(n(s.draw_calls)));
            if s.texture_bytes > 0 {
                row("texture memory", sizes::bytes(s.texture_bytes));
            }
            if let Some(bytes) = s.file_bytes {
                row("file size", sizes::bytes(bytes));
            }
        }
        let c = &self.cache;
        let caches = [("ACMR", c.acmr()), ("ATVR", c.atvr()), ("overfetch", c.overfetch())];
        row("vertex cache", caches.map(|(name, x)| format!("{name} {x:.2}")).join(", "));
        if t.is_closed() {
            row("volume", figure(self.size.volume));
        }
        lines
    }
}

#[cfg(test)]
mod tests {
    use lodsmith::core::{Positions, TriMesh};

    use super::*;

    #[test]
    fn duplicates_are_found_by_place_and_whichever_way_they_go() {
        let mut positions = vec![[0f32; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
        positions.extend(positions.clone());
        let face = |a, b, c| [VertexId(a), VertexId(b), VertexId(c)];
        // The last one is degenerate after welding.
        let faces = vec![face(0, 1, 2), face(5, 4, 3), face(1, 2, 3), face(0, 3, 1)];
        let mesh = TriMesh::new(Positions::F32(positions), faces).unwrap();
        let surface = mesh.surface();
        assert_eq!(duplicate_faces(&surface, &weld(surface.positions()).representative), 2);
    }
}
