//! `lodsmith view`: opens the window, if built with it.

use crate::args::ViewArgs;
use crate::status::Status;

/// Opens the window; returns when it is closed.
#[cfg(feature = "view")]
pub(super) fn run(args: &ViewArgs) -> anyhow::Result<Status> {
    let mut options = lodsmith_viewer::ViewOptions::default();
    options.inputs.clone_from(&args.inputs);
    options.assets = args.assets.scope();
    lodsmith_viewer::run(&options)?;
    Ok(Status::Done)
}

/// Returns an error that explains how to install the window.
#[cfg(not(feature = "view"))]
pub(super) fn run(args: &ViewArgs) -> anyhow::Result<Status> {
    let what = match args.inputs.first() {
        Some(path) => format!("{}: ", path.display()),
        None => String::new(),
    };
    anyhow::bail!(
        "{what}this lodsmith was built without the window. Install it with `cargo install lodsmith-cli --features view` \
         (from a checkout: cargo install --path crates/cli --features view); `lodsmith render` renders images without it"
    )
}

#[cfg(all(test, feature = "view"))]
mod tests {
    use clap::Parser as _;
    use lodsmith::{Length, MethodKind, Preset, Stop};
    use lodsmith_viewer::settings::simplification::Simplification;

    use crate::args::Cli;

    /// Returns the options that the command parses from the command line that the window shows.
    fn parsed(simplification: &Simplification) -> lodsmith::SimplifyOptions {
        let arguments = ["lodsmith", "simplify", "a.ply", "--dry-run"].map(str::to_owned);
        let cli = Cli::try_parse_from(arguments.into_iter().chain(simplification.words())).unwrap();
        cli.command.job().expect("simplify is a job").options.engine().unwrap()
    }

    #[test]
    fn the_command_line_in_the_window_has_the_options_of_the_window() {
        for preset in Preset::ALL {
            let shown = Simplification::of_preset(preset, Stop::ratio(0.1));
            assert_eq!(parsed(&shown), shown.options, "{preset:?}");
        }
        for method in MethodKind::ALL {
            let mut shown = Simplification::of_preset(Preset::Auto, Stop::faces(100));
            shown.options.method = method.into();
            shown.options.weld = Some(Length::OfDiagonal(0.07 / 100.0));
            shown.options.guards.max_normal_deg = Some(40.0);
            shown.options.sharp_deg = Some(30.0);
            shown.options.guards.max_edge = Some(Length::Units(0.3));
            shown.options.weights.uv = 2.5;
            shown.options.seed = 3;
            shown.options.escalate = true;
            assert_eq!(parsed(&shown), shown.options, "{method:?}");
        }
        let mut shown = Simplification::of_preset(Preset::Scan, Stop::ratio(0.1));
        shown.options.weld = None;
        assert_eq!(parsed(&shown), shown.options);
        let mut shown = Simplification::of_preset(Preset::Cad, Stop::error(Length::OfDiagonal(0.001)));
        shown.options.measure = lodsmith::Measure::Always;
        assert_eq!(parsed(&shown), shown.options);
    }
}
