//! Text that `lodsmith info` prints.

use lodsmith_asset::Info;

use crate::numbers::{grouped, seconds, significant};
use crate::output::Output;
use crate::sizes;

/// Prints the facts about one input.
pub(super) fn show(out: &Output, path: &str, found: &Info) {
    table(found, path).iter().for_each(|line| out.line(line));
    out.detail(&format!("  time             {}", seconds(found.clock.total())));
}

/// Returns a table; defects with count 0 are left out.
fn table(info: &Info, path: &str) -> Vec<String> {
    let (t, c) = (&info.mesh.topology, &info.contents);
    let mut lines = vec![format!("{path}")];
    let mut row = |name: &str, value: String| lines.push(format!("  {name:<18}{value}"));
    row("format", info.format.name().to_owned());
    let faces = info.mesh.faces;
    if c.polygons == faces {
        row("faces", grouped(faces));
    } else {
        row("faces", format!("{} triangles from {} polygons", grouped(faces), grouped(c.polygons)));
    }
    let vertices = info.mesh.vertices;
    if info.mesh.places == vertices {
        row("vertices", grouped(vertices));
    } else {
        row("vertices", format!("{} at {} positions", grouped(vertices), grouped(info.mesh.places)));
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
    let is = |holds: bool, word: &str| if holds { word.to_owned() } else { format!("not {word}") };
    let closed = match (t.is_closed(), info.closed_by_index) {
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
        ("duplicate faces", info.mesh.duplicate_faces),
        ("two-sided faces", info.two_sided_faces),
        ("unused vertices", info.mesh.unused_vertices),
        ("non-finite vert.", info.mesh.non_finite_vertices),
    ];
    for (name, n) in defects {
        if n > 0 {
            row(name, grouped(n));
        }
    }
    let figure = |x: f64| significant(x, 6);
    if let Some(b) = &info.mesh.bounds {
        let corner = |p: [f64; 3]| p.map(figure).join(" ");
        row("bounds", format!("{} to {}", corner(b.min), corner(b.max)));
        row("diagonal", figure(b.diagonal()));
    }
    row("area", figure(info.mesh.size.area));
    if let Some(s) = &info.sizes {
        let n = |n: u64| usize::try_from(n).unwrap_or(usize::MAX);
        row("draw calls", grouped(n(s.draw_calls)));
        if s.texture_bytes > 0 {
            row("texture memory", sizes::bytes(s.texture_bytes));
        }
        if let Some(bytes) = s.file_bytes {
            row("file size", sizes::bytes(bytes));
        }
    }
    let c = &info.cache;
    let caches = [("ACMR", c.acmr()), ("ATVR", c.atvr()), ("overfetch", c.overfetch())];
    row("vertex cache", caches.map(|(name, x)| format!("{name} {x:.2}")).join(", "));
    if t.is_closed() {
        row("volume", figure(info.mesh.size.volume));
    }
    lines
}
