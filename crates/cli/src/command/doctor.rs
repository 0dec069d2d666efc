//! `lodsmith doctor`: reports versions, adapters, the display and missing libraries.

use serde_json::{Value, json};

use crate::args::DoctorArgs;
use crate::in_order::available_threads;
use crate::output::Output;
use crate::status::Status;

/// Checks the system and prints the findings.
pub(super) fn run(args: &DoctorArgs) -> anyhow::Result<Status> {
    let findings = Findings { threads: available_threads(), window: Window::check_system() };
    let out = Output::plain();
    if args.json {
        out.result(&findings.to_json().to_string());
    } else {
        out.result(&findings.lines().join("\n"));
    }
    let is_complete = findings.window.as_ref().is_none_or(|w| w.missing().is_empty());
    out.finish(if is_complete { Status::Done } else { Status::Failed })
}

/// Findings of all checks.
struct Findings {
    threads: usize,
    /// `None` if built without the window.
    window: Option<Window>,
}

/// Requirements of a window.
struct Window {
    /// The display server, or the reason why no window can be opened.
    display: Result<String, MissingComponent>,
    adapters: Vec<Adapter>,
}

/// A graphics adapter.
struct Adapter {
    name: String,
    backend: String,
    driver: String,
    is_software: bool,
    /// The reason why it cannot be used, if any.
    fault: Option<String>,
}

/// A missing component and how to install it.
#[derive(Clone, Debug, PartialEq, Eq)]
struct MissingComponent {
    what: String,
    /// Advice for the user.
    hint: &'static str,
    /// Packages of Debian and Ubuntu.
    debian: &'static [&'static str],
    /// Packages of Fedora.
    fedora: &'static [&'static str],
}

const HOW_TO_GET: &str = "not built in; install with it: `cargo install lodsmith-cli --features view` (from a checkout: \
                          cargo install --path crates/cli --features view)";
const DRIVERS: [&[&str]; 2] =
    [&["mesa-vulkan-drivers", "libvulkan1"], &["mesa-vulkan-drivers", "vulkan-loader"]];
#[cfg(any(test, feature = "view"))]
const SCREEN: [&[&str]; 2] = [&["xvfb", "libxkbcommon-x11-0"], &["xorg-x11-server-Xvfb", "libxkbcommon-x11"]];

impl Window {
    #[cfg(feature = "view")]
    fn check_system() -> Option<Self> {
        use lodsmith_viewer::app::display;
        let adapter = |a: lodsmith_viewer::gpu::Adapter| Adapter {
            name: a.name,
            backend: a.backend,
            driver: a.driver,
            is_software: a.is_software,
            fault: a.fault,
        };
        let adapters = lodsmith_viewer::gpu::Adapter::all().into_iter().map(adapter).collect();
        let missing = |error: display::DisplayError| match error {
            display::DisplayError::Display { reason } => MissingComponent::display(&reason),
            display::DisplayError::Library { library, packages } => {
                MissingComponent::library(library, [packages.debian, packages.fedora])
            }
        };
        Some(Self { display: display::connect().map_err(missing), adapters })
    }
    #[cfg(not(feature = "view"))]
    fn check_system() -> Option<Self> {
        None
    }

    fn missing(&self) -> Vec<MissingComponent> {
        let mut missing: Vec<_> = self.display.as_ref().err().cloned().into_iter().collect();
        let mut add = |what: &str, hint| missing.push(MissingComponent::new(what.to_owned(), hint, DRIVERS));
        if self.adapters.is_empty() {
            let hint = "install a driver; these packages also render without a graphics card";
            add("a graphics adapter", hint);
        } else if self.adapters.iter().all(|a| a.fault.is_some()) {
            let hint = "update the driver, or install a software renderer";
            add("a usable graphics adapter", hint);
        }
        missing
    }

    /// Returns true if all adapters are software renderers.
    fn is_slow(&self) -> bool {
        let mut usable = self.adapters.iter().filter(|a| a.fault.is_none()).peekable();
        usable.peek().is_some() && usable.all(|a| a.is_software)
    }
}

#[cfg(any(test, feature = "view"))]
impl MissingComponent {
    fn display(why: &str) -> Self {
        let hint = "log in to a desktop, or use a virtual display: `xvfb-run lodsmith view`; `lodsmith render` renders \
                    images without a display";
        Self::new(format!("a display ({why})"), hint, SCREEN)
    }
    fn library(name: String, packages: [&'static [&'static str]; 2]) -> Self {
        Self::new(name, "the window needs it; install it from the packages of the system", packages)
    }
}

impl MissingComponent {
    fn new(what: String, hint: &'static str, [debian, fedora]: [&'static [&'static str]; 2]) -> Self {
        let of = |packages| if cfg!(target_os = "linux") { packages } else { &[][..] };
        Self { what, hint, debian: of(debian), fedora: of(fedora) }
    }

    fn lines(&self) -> Vec<String> {
        let mut lines = vec![format!("  missing          {}: {}", self.what, self.hint)];
        for (system, tool, packages) in
            [("Debian, Ubuntu", "apt", self.debian), ("Fedora", "dnf", self.fedora)]
        {
            if !packages.is_empty() {
                lines.push(format!("    {system:<15}{tool} install {}", packages.join(" ")));
            }
        }
        lines
    }
}

impl Findings {
    fn to_json(&self) -> Value {
        let window = self.window.as_ref();
        let adapter = |a: &Adapter| {
            json!({
                "name": a.name, "backend": a.backend, "driver": a.driver, "software": a.is_software,
                "usable": a.fault.is_none(), "fault": a.fault,
            })
        };
        let missing = |m: MissingComponent| json!({ "what": m.what, "hint": m.hint, "packages": { "debian": m.debian, "fedora": m.fedora } });
        json!({
            "version": env!("CARGO_PKG_VERSION"),
            "platform": { "os": std::env::consts::OS, "arch": std::env::consts::ARCH },
            "threads": self.threads,
            "viewer": {
                "built_in": window.is_some(),
                "display": window.and_then(|w| w.display.as_ref().ok()),
                "adapters": window.map(|w| w.adapters.iter().map(adapter).collect::<Vec<_>>()),
            },
            "missing": window.map(Window::missing).unwrap_or_default().into_iter().map(missing).collect::<Vec<_>>(),
        })
    }

    /// Returns the findings as a table.
    fn lines(&self) -> Vec<String> {
        let row = |name: &str, value: String| format!("  {name:<17}{value}");
        let mut lines = vec![
            format!("lodsmith {}", env!("CARGO_PKG_VERSION")),
            row("platform", format!("{} {}", std::env::consts::OS, std::env::consts::ARCH)),
            row("threads", self.threads.to_string()),
        ];
        let Some(window) = &self.window else {
            lines.push(row("viewer", HOW_TO_GET.to_owned()));
            return lines;
        };
        lines.push(row("viewer", "built in".to_owned()));
        if let Ok(display) = &window.display {
            lines.push(row("display", display.clone()));
        }
        for a in &window.adapters {
            let kind = if a.is_software { ", software renderer" } else { "" };
            let driver = if a.driver.is_empty() { String::new() } else { format!(", {}", a.driver) };
            let fault = a.fault.as_ref().map_or(String::new(), |f| format!("; cannot be used: {f}"));
            lines.push(row("adapter", format!("{} ({}{driver}{kind}){fault}", a.name, a.backend)));
        }
        if window.is_slow() {
            let text = "only software rendering: the window is slow with large models; install the driver of the graphics card";
            lines.push(row("note", text.to_owned()));
        }
        lines.extend(window.missing().iter().flat_map(MissingComponent::lines));
        lines
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn adapter(is_software: bool, fault: Option<&str>) -> Adapter {
        Adapter {
            name: "Card".to_owned(),
            backend: "Vulkan".to_owned(),
            driver: String::new(),
            is_software,
            fault: fault.map(str::to_owned),
        }
    }

    fn window(display: Result<&str, &str>, adapters: Vec<Adapter>) -> Window {
        Window { display: display.map(str::to_owned).map_err(MissingComponent::display), adapters }
    }

    #[test]
    fn nothing_is_missing_if_one_adapter_is_usable() {
        let complete = window(Ok("X11 :0"), vec![adapter(false, Some("old")), adapter(true, None)]);
        assert_eq!(complete.missing(), []);
        assert!(complete.is_slow());
        assert!(!window(Ok(""), vec![adapter(true, None), adapter(false, None)]).is_slow());
        assert!(!window(Ok(""), vec![]).is_slow());
    }

    #[test]
    fn missing_components_name_their_packages() {
        let texts =
            |w: &Window| w.missing().iter().flat_map(MissingComponent::lines).collect::<Vec<_>>().join("\n");
        let bare = texts(&window(Err("neither is set"), vec![]));
        assert!(bare.contains("a display (neither is set)") && bare.contains("xvfb-run"), "{bare}");
        assert!(bare.contains("a graphics adapter:"), "{bare}");
        let old = texts(&window(Ok(":0"), vec![adapter(false, Some("old"))]));
        assert!(old.contains("a usable graphics adapter") && !old.contains("a display"), "{old}");
        let packages: [&[&str]; 2] = [&["libx11-6", "libxi6"], &["libX11", "libXi"]];
        let display = Err(MissingComponent::library("a library of X11".to_owned(), packages));
        let library = texts(&Window { display, adapters: vec![adapter(true, None)] });
        assert!(library.contains("missing          a library of X11: the window"), "{library}");
        assert!(!library.contains("xvfb") && !library.contains("a display"), "{library}");
        if cfg!(target_os = "linux") {
            assert!(
                bare.contains("apt install mesa-vulkan-drivers") && bare.contains("dnf install"),
                "{bare}"
            );
            assert!(library.contains("apt install libx11-6 libxi6"), "{library}");
            assert!(library.contains("dnf install libX11 libXi"), "{library}");
        }
    }

    #[test]
    fn the_table_and_the_json_object_agree() {
        let found =
            Findings { threads: 3, window: Some(window(Ok("X11 :7"), vec![adapter(true, Some("old"))])) };
        let (text, object) = (found.lines().join("\n"), found.to_json());
        assert!(
            text.contains("X11 :7") && text.contains("Card (Vulkan, software renderer); cannot be used: old")
        );
        assert_eq!(object["viewer"]["display"], "X11 :7");
        assert_eq!(object["viewer"]["adapters"][0]["usable"], false);
        assert_eq!(object["missing"].as_array().unwrap().len(), 1);
        let without_window = Findings { threads: 3, window: None };
        assert!(without_window.lines().join("\n").contains("--features view"));
        assert_eq!(without_window.to_json()["viewer"]["built_in"], false);
    }
}
