//! Proposals of a report when the target is out of reach, and their effect.

use lodsmith::core::{TriMesh, shapes};
use lodsmith::{
    BorderPolicy, Change, Guards, Length, MethodKind, Placement, Simplified, SimplifyOptions, Stop,
    TopologyPolicy, simplify,
};

use crate::support::{Complaints, options_text};

fn run(mesh: &TriMesh, options: &SimplifyOptions) -> Simplified {
    simplify(mesh, options).unwrap()
}

/// Options that prevent a run from reaching its target, alone and together.
fn strict() -> Vec<SimplifyOptions> {
    let none = Guards::default();
    let guards = [
        Guards { max_normal_deg: Some(5.0), ..none },
        Guards { min_quality: Some(0.6), ..none },
        Guards { max_valence: Some(6), ..none },
        Guards { max_edge: Some(Length::OfDiagonal(0.1)), ..none },
        Guards { min_quality: Some(0.9), max_edge: Some(Length::OfDiagonal(0.05)), ..none },
    ];
    let mut all = Vec::new();
    let mut add = |change: &dyn Fn(&mut SimplifyOptions)| {
        for method in [MethodKind::Memoryless, MethodKind::Quadric] {
            let mut options = SimplifyOptions::new(Stop::faces(1));
            options.method = method.into();
            change(&mut options);
            all.push(options);
        }
    };
    add(&|_| {});
    for g in guards {
        add(&|o| o.guards = g);
        add(&|o| (o.guards, o.topology) = (g, TopologyPolicy::Preserve));
    }
    for border in [BorderPolicy::Lock, BorderPolicy::Slide, BorderPolicy::Free] {
        add(&|o| o.border = border);
        add(&|o| (o.border, o.guards.min_quality) = (border, Some(0.8)));
    }
    for placement in [Placement::Endpoint, Placement::Midpoint] {
        add(&|o| (o.placement, o.topology) = (placement, TopologyPolicy::Preserve));
        add(&|o| (o.placement, o.border) = (placement, BorderPolicy::Lock));
    }
    all
}

#[test]
fn proposed_changes_lead_further() {
    let mut all = Complaints::default();
    let (mut followed, mut in_vain) = (0, 0);
    for (name, mesh) in shapes::all() {
        for options in strict() {
            let done = run(&mesh, &options);
            let case = format!("{name}, {}", options_text(&options));
            for proposal in &done.report.proposals {
                followed += 1;
                all.check(&case, !done.report.reached && proposal.gain > 0, "a proposal without need");
                let changed = proposal.changes.iter().fold(options.clone(), |o, c| c.apply(&o));
                all.check(&case, changed != options, "nothing is changed");
                let further = run(&mesh, &changed);
                let (before, after) = (done.report.faces, further.report.faces);
                // A run with the change starts again and may get stuck elsewhere; hardly any does.
                all.check(
                    &case,
                    after <= before,
                    &format!("{proposal:?} leads from {before} to {after} faces"),
                );
                in_vain += usize::from(after == before);
            }
        }
    }
    assert!(followed > 100, "{followed} proposals were followed");
    assert!(50 * in_vain < followed, "{in_vain} of {followed} proposals had no effect");
    all.report_all();
}

#[test]
fn proposals_name_what_blocks_the_target() {
    let (blob, torus) = (shapes::blob(4, 1), shapes::torus(24, 16));
    let asked = |mesh: &TriMesh, change: &dyn Fn(&mut SimplifyOptions)| {
        let mut options = SimplifyOptions::new(Stop::faces(2));
        change(&mut options);
        let report = run(mesh, &options).report;
        report.proposals.into_iter().map(|p| p.changes).collect::<Vec<_>>()
    };
    let ask = |change: &dyn Fn(&mut SimplifyOptions)| asked(&blob, change);
    assert_eq!(ask(&|o| o.guards.min_quality = Some(0.95)), [[Change::MinQuality]]);
    assert_eq!(ask(&|o| o.guards.max_valence = Some(6)), [[Change::MaxValence]]);
    // Each of these two alone has little effect.
    let both =
        Guards { min_quality: Some(0.95), max_edge: Some(Length::OfDiagonal(0.02)), ..Guards::default() };
    assert_eq!(ask(&|o| o.guards = both), [[Change::MinQuality, Change::MaxEdge]]);
    // The handle of a ring limits the count.
    let preserve = |o: &mut SimplifyOptions| o.topology = TopologyPolicy::Preserve;
    assert_eq!(asked(&torus, &preserve), [[Change::Topology(TopologyPolicy::Relaxed)]]);
    // A closed surface cannot become two faces, whatever is allowed; a border policy has no effect without a
    // border.
    assert_eq!(ask(&|_| {}), [[]; 0]);
    assert_eq!(ask(&|o| o.border = BorderPolicy::Lock), [[]; 0]);
    // Nothing is proposed if the target is met.
    let mut options = SimplifyOptions::new(Stop::ratio(0.5));
    options.guards.min_quality = Some(0.01);
    assert_eq!(run(&blob, &options).report.proposals, []);
}
