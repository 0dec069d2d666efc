//! Options of single methods, and those that methods share.

use super::*;

/// Options of single methods with a valid value, and the methods that have them.
fn own_options() -> Vec<(&'static str, MethodOptions, &'static [Method])> {
    use Method::{Cluster, Memoryless, Planar, Quadric, Remesh, ShortestEdge, Unsubdivide, VertexRemoval};
    let with = |set: fn(&mut MethodOptions)| {
        let mut own = MethodOptions::default();
        set(&mut own);
        own
    };
    const LENGTH: Option<Length> = Some(Length::OfDiagonal(0.05));
    vec![
        ("pairs", with(|o| o.pairs = LENGTH), &[Memoryless, Quadric]),
        ("cell", with(|o| o.cell = LENGTH), &[Cluster]),
        ("two-stage", with(|o| o.two_stage = true), &[Cluster]),
        ("edge-length", with(|o| o.edge_length = LENGTH), &[ShortestEdge, Remesh]),
        ("angle", with(|o| o.angle_deg = Some(5.0)), &[Planar, VertexRemoval, Remesh]),
        ("flat", with(|o| o.flat = LENGTH), &[Planar]),
        ("iterations", with(|o| o.iterations = Some(2)), &[Unsubdivide, Remesh]),
        ("voxel", with(|o| o.voxel = LENGTH), &[Remesh]),
        ("subdivisions", with(|o| o.subdivisions = Some(2)), &[Remesh]),
        ("adaptive", with(|o| o.adaptive = true), &[Remesh]),
    ]
}

#[test]
fn options_of_other_methods_are_refused_by_name() {
    let mesh = shapes::icosphere(2);
    for promise in &PROMISES {
        for (name, own, takers) in own_options() {
            if takers.contains(&promise.method) {
                continue;
            }
            let mut options = options(promise.method, Stop::ratio(0.5));
            options.method_options = own;
            match simplify(&mesh, &options) {
                Err(SimplifyError::NotOfMethod { option, takers: told, method }) => {
                    assert_eq!((option, told, method), (name, takers, promise.method));
                }
                other => panic!("{name} for {}: {:?}", promise.method.name(), other.map(|d| d.report)),
            }
        }
    }
}

#[test]
fn own_options_keep_the_promises_too() {
    let mut all = Complaints::default();
    for promise in PROMISES.iter() {
        for (_, own, takers) in own_options() {
            if !takers.contains(&promise.method) {
                continue;
            }
            for (name, mesh) in shapes::all() {
                for stop in [Stop::ratio(0.4), Stop::default()] {
                    let mut options = options(promise.method, stop);
                    options.method_options = own;
                    let closes = own.voxel.is_some();
                    let case = case(name, &options);
                    let done = match closes {
                        // A new surface around the input has its own topology.
                        true => match run(&mesh, &options) {
                            Ok(Ok(done)) => Some(done),
                            Ok(Err(error)) if is_refusal(&error, promise.method) => None,
                            other => {
                                all.add(&case, [format!("{:?}", other.map(|r| r.map(|d| d.report)))]);
                                None
                            }
                        },
                        false => tried(&mut all, name, &mesh, promise, &options),
                    };
                    let Some(done) = done else { continue };
                    if closes {
                        let c = counts(&done.mesh);
                        let sound = c.is_closed() && c.is_manifold() && c.is_oriented();
                        all.check(&case, sound, &format!("not closed and manifold: {c:?}"));
                    }
                }
            }
        }
    }
    all.report_all();
}

/// Returns the ends of border edges, by position.
fn border(mesh: &TriMesh) -> HashSet<[u64; 3]> {
    let surface = mesh.surface();
    let topology = Topology::new(&surface);
    let edges = topology.edges().filter(|&h| topology.kind(h) == Some(EdgeKind::Border));
    edges
        .flat_map(|h| [topology.origin(h), topology.target(h)])
        .map(|v| bits(surface.positions().get(v)))
        .collect()
}

/// Options that many methods share, and the promises of methods that have them.
#[test]
fn shared_options_are_honoured_or_refused() {
    type Set = fn(&mut SimplifyOptions);
    let shared: [(&str, Set); 12] = [
        ("placement endpoint", |o| o.placement = Placement::Endpoint),
        ("placement midpoint", |o| o.placement = Placement::Midpoint),
        ("fit on", |o| o.fit = Fit::On),
        ("fit off", |o| o.fit = Fit::Off),
        ("border lock", |o| o.border = BorderPolicy::Lock),
        ("border slide", |o| o.border = BorderPolicy::Slide),
        ("border free", |o| o.border = BorderPolicy::Free),
        ("guards", |o| {
            o.guards = Guards { max_edge: Some(Length::OfDiagonal(0.5)), ..Guards::default() };
        }),
        ("locked", |_| {}),
        ("importance", |_| {}),
        ("weld", |o| o.weld = Some(Length::OfDiagonal(1e-4))),
        ("prune", |o| o.prune = Some(Length::OfDiagonal(0.01))),
    ];
    let mut all = Complaints::default();
    for promise in PROMISES.iter() {
        for (what, set) in shared {
            for (name, mesh) in shapes::all() {
                let mut options = options(promise.method, Stop::ratio(0.3));
                set(&mut options);
                let locked: Vec<bool> = (0..mesh.vertex_count()).map(|v| v % 7 == 0).collect();
                let importance = vec![2f32; mesh.vertex_count()];
                let input = match what {
                    "locked" => Input::new(&mesh).locked(&locked),
                    "importance" => Input::new(&mesh).importance(&importance),
                    _ => Input::new(&mesh),
                };
                let case = case(name, &options);
                let Some(done) = tried(&mut all, name, input, promise, &options) else { continue };
                let here = places(&done.mesh);
                match what {
                    "placement endpoint" => {
                        let strange = here.difference(&places(&mesh)).count();
                        all.check(&case, strange == 0, &format!("{strange} vertices are not of the input"));
                    }
                    "border lock" if done.report.parts_removed == 0 => {
                        let gone = border(&mesh).difference(&here).count();
                        all.check(&case, gone == 0, &format!("{gone} border vertices are gone"));
                    }
                    "locked" => {
                        // Clustering can leave a single locked vertex without any face; then it is dropped.
                        let may_go = promise.method == Method::Cluster;
                        all.add(&case, laden::locked_complaints(&mesh, &locked, (may_go, false), &done.mesh));
                    }
                    _ => {}
                }
            }
        }
    }
    all.report_all();
}
