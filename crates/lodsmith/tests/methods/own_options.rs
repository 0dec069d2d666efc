//! Options of single methods, and options that methods share.

use lodsmith::options::by_name::{NamedOption, OPTIONS, OptionKind, OptionValue};

use super::*;

/// Options of single methods with a valid value, and the methods that have them.
fn own_options() -> impl Iterator<Item = (&'static NamedOption, OptionValue<'static>, &'static [MethodKind])>
{
    let value = |option: &NamedOption| match option.kind {
        OptionKind::Length(_) => "5%".into(),
        OptionKind::Degrees(_) => OptionValue::Number(5.0),
        OptionKind::Count(_) => OptionValue::Whole(2),
        OptionKind::Flag => OptionValue::Flag(true),
        other => panic!("no value for {other:?}"),
    };
    let own = OPTIONS.iter().filter(|option| !option.methods.is_empty());
    own.map(move |option| (option, value(option), option.methods))
}

#[test]
fn own_options_keep_the_guarantees_too() {
    let mut all = Complaints::default();
    for promise in PROMISES.iter() {
        for (option, value, takers) in own_options() {
            if !takers.contains(&promise.method) {
                continue;
            }
            for (name, mesh) in shapes::all() {
                for stop in [Stop::ratio(0.4), Stop::default()] {
                    let mut options = options(promise.method, stop);
                    option.set(&mut options, &value).expect("the method has it");
                    let closes = option.name == "voxel";
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

/// Options that many methods share, and the guarantees of methods that have them.
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
                        all.check(&case, strange == 0, &format!("{strange} vertices are not from the input"));
                    }
                    "border lock" if done.report.parts_removed == 0 => {
                        let gone = border(&mesh).difference(&here).count();
                        all.check(&case, gone == 0, &format!("{gone} border vertices are gone"));
                    }
                    "locked" => {
                        // Clustering can leave a single locked vertex without any face; then it is dropped.
                        let may_go = promise.method == MethodKind::Cluster;
                        all.add(
                            &case,
                            attributed::locked_complaints(&mesh, &locked, (may_go, false), &done.mesh),
                        );
                    }
                    _ => {}
                }
            }
        }
    }
    all.report_all();
}
