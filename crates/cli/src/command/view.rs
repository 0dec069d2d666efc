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

/// Explains how to get the window.
#[cfg(not(feature = "view"))]
pub(super) fn run(args: &ViewArgs) -> anyhow::Result<Status> {
    let what = match args.inputs.first() {
        Some(path) => format!("{}: ", path.display()),
        None => String::new(),
    };
    anyhow::bail!(
        "{what}this lodsmith was built without its window. `cargo install lodsmith-cli --features view` builds one with \
         it (from a checkout: cargo install --path crates/cli --features view); `lodsmith render` makes pictures without"
    )
}

#[cfg(all(test, feature = "view"))]
mod tests {
    use clap::Parser as _;
    use lodsmith::{Length, MethodKind, Preset, Stop};
    use lodsmith_viewer::settings::simplification::Simplification;

    use crate::args::Cli;

    /// Returns the options that the command line gets from the window's text.
    fn typed(how: &Simplification) -> lodsmith::SimplifyOptions {
        let words = ["lodsmith", "simplify", "a.ply", "--dry-run"].map(str::to_owned);
        let cli = Cli::try_parse_from(words.into_iter().chain(how.words())).unwrap();
        cli.command.job().expect("simplify is a job").options.engine().unwrap()
    }

    #[test]
    fn the_command_line_that_the_window_shows_means_what_the_window_does() {
        for preset in Preset::ALL {
            let how = Simplification::of_preset(preset, Stop::ratio(0.1));
            assert_eq!(typed(&how), how.options, "{preset:?}");
        }
        for method in MethodKind::ALL {
            let mut how = Simplification::of_preset(Preset::Auto, Stop::faces(100));
            how.options.method = method.into();
            how.options.weld = Some(Length::OfDiagonal(0.07 / 100.0));
            how.options.guards.max_normal_deg = Some(40.0);
            how.options.sharp_deg = Some(30.0);
            how.options.guards.max_edge = Some(Length::Units(0.3));
            how.options.weights.uv = 2.5;
            how.options.seed = 3;
            how.options.escalate = true;
            assert_eq!(typed(&how), how.options, "{method:?}");
        }
        let mut how = Simplification::of_preset(Preset::Scan, Stop::ratio(0.1));
        how.options.weld = None;
        assert_eq!(typed(&how), how.options);
        let mut how = Simplification::of_preset(Preset::Cad, Stop::error(Length::OfDiagonal(0.001)));
        how.options.measure = lodsmith::Measure::Always;
        assert_eq!(typed(&how), how.options);
    }
}
