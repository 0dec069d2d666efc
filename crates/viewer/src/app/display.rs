//! Detection of a display to open the window on.

use std::any::Any;
use std::panic::catch_unwind;

use winit::event_loop::EventLoop;

/// Returns the name of the display server of the window, for messages.
fn server() -> String {
    let of = |name: &str| std::env::var(name).ok().filter(|v| !v.is_empty());
    if cfg!(any(windows, target_os = "macos")) {
        return "of the system".to_owned();
    }
    match (of("WAYLAND_DISPLAY").or_else(|| of("WAYLAND_SOCKET")), of("DISPLAY")) {
        (Some(name), _) => format!("Wayland {name}"),
        (None, Some(name)) => format!("X11 {name}"),
        (None, None) => String::new(),
    }
}

/// Why no window can be opened.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum DisplayError {
    /// There is no display server, or it does not answer.
    Display {
        /// Message of the system.
        reason: String,
    },
    /// A shared library that talks to the display server is missing.
    Library {
        /// Name of the library, for messages.
        library: String,
        /// Packages that contain it, if known.
        packages: Packages,
    },
}

/// Package names per distribution.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Packages {
    /// Debian and Ubuntu.
    pub debian: &'static [&'static str],
    /// Fedora.
    pub fedora: &'static [&'static str],
}

impl Packages {
    /// Returns the install commands, for messages.
    pub fn install_hint(&self) -> String {
        if self.debian.is_empty() {
            return "use the package manager of your system".to_owned();
        }
        let [debian, fedora] = [self.debian, self.fedora].map(|p| p.join(" "));
        format!("on Debian and Ubuntu `apt install {debian}`, on Fedora `dnf install {fedora}`")
    }
}

impl DisplayError {
    /// Derives the cause from an error message of the window library.
    fn of(text: &str) -> Self {
        match missing_library(text) {
            Some((library, packages)) => Self::Library { library, packages },
            None => Self::Display { reason: reason(text) },
        }
    }
}

/// Connects to the display server as the window does, and returns its name. Works once per process, on the
/// main thread; no window can be opened in the process afterwards.
///
/// # Errors
/// The reason why no window can be opened: no display server, or a missing library.
pub fn connect() -> Result<String, DisplayError> {
    // The window library panics if a keyboard library is missing.
    match catch_unwind(|| EventLoop::new().map(drop)) {
        Ok(Ok(())) => Ok(server()),
        Ok(Err(e)) => Err(DisplayError::of(&e.to_string())),
        Err(panic) => Err(DisplayError::of(&panic_message(&*panic))),
    }
}

/// Returns the message of a panic.
pub(crate) fn panic_message(panic: &(dyn Any + Send)) -> String {
    match (panic.downcast_ref::<String>(), panic.downcast_ref::<&str>()) {
        (Some(text), _) => text.clone(),
        (None, Some(text)) => (*text).to_owned(),
        (None, None) => "the window library failed".to_owned(),
    }
}

/// System libraries: their mark in error messages, name for messages, and packages.
const LIBRARIES: [(&str, &str, Packages); 4] = [
    (
        "libxkbcommon",
        "a library of the keyboard",
        Packages {
            debian: &["libxkbcommon0", "libxkbcommon-x11-0"],
            fedora: &["libxkbcommon", "libxkbcommon-x11"],
        },
    ),
    (
        "wayland",
        "a library of Wayland",
        Packages {
            debian: &["libwayland-client0", "libwayland-cursor0"],
            fedora: &["libwayland-client", "libwayland-cursor"],
        },
    ),
    ("libX", "a library of X11", X11),
    ("xlib", "a library of X11", X11),
];
const X11: Packages = Packages {
    debian: &["libx11-6", "libx11-xcb1", "libxcursor1", "libxi6", "libxrandr2"],
    fedora: &["libX11", "libX11-xcb", "libXcursor", "libXi", "libXrandr"],
};

/// Finds the missing system library in an error message, with its packages.
pub(crate) fn missing_library(text: &str) -> Option<(String, Packages)> {
    let is_lack = ["could not be loaded", "cannot open shared object", "Failed to load one of"];
    if !is_lack.iter().any(|words| text.contains(words)) {
        return None;
    }
    let known = LIBRARIES.iter().find(|(known, ..)| text.contains(known));
    let is_of_name = |c: char| c.is_ascii_alphanumeric() || "-_.+".contains(c);
    let mut words = text.split(|c| !is_of_name(c)).map(|w| w.trim_end_matches('.'));
    let library = words.find(|w| w.starts_with("lib") && w.contains(".so"));
    let name = library.or(known.map(|(_, name, _)| *name))?;
    Some((name.to_owned(), known.map(|(.., packages)| *packages).unwrap_or_default()))
}

/// Returns the message of the system, without the source location in the window library.
pub(crate) fn reason(text: &str) -> String {
    let said = text.split_once(".rs:").and_then(|(_, rest)| rest.split_once(": "));
    said.map_or(text, |(_, why)| why).trim_end_matches('.').to_owned()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_missing_library_is_named_with_its_package() {
        let of = |text: &str| {
            missing_library(text).map(|(name, packages)| (name, packages.install_hint())).unwrap()
        };
        let (name, how) = of("Library libxkbcommon-x11.so could not be loaded.");
        assert_eq!(name, "libxkbcommon-x11.so");
        assert!(how.contains("apt install libxkbcommon0 libxkbcommon-x11-0"));
        let (name, how) = of("libXcursor.so.1: cannot open shared object file: No such file or directory");
        assert!(name == "libXcursor.so.1" && how.contains("libxcursor1"), "{name} {how}");
        let (name, how) = of("libodd.so.2: cannot open shared object file");
        assert!(name == "libodd.so.2" && how.contains("your system"));
        let (name, how) = of("os error at x.rs:9: Failed to load one of xlib's shared libraries");
        assert!(name == "a library of X11" && how.contains("libx11-6"), "{name} {how}");
        let (name, how) = of("os error at x.rs:9: The wayland library could not be loaded");
        assert!(name == "a library of Wayland" && how.contains("libwayland-client0"), "{name} {how}");
        assert_eq!(missing_library("neither WAYLAND_DISPLAY nor DISPLAY is set"), None);
        assert_eq!(missing_library("index out of bounds in lib.rs"), None);
    }

    #[test]
    fn a_missing_library_is_not_a_missing_display() {
        for text in ["neither WAYLAND_DISPLAY nor DISPLAY is set", "Failed to open connection to X server"] {
            assert!(matches!(DisplayError::of(text), DisplayError::Display { .. }), "{text}");
        }
        for text in [
            "os error at x.rs:9: Failed to load one of xlib's shared libraries",
            "os error at x.rs:9: The wayland library could not be loaded",
            "Library libxkbcommon.so could not be loaded.",
        ] {
            let DisplayError::Library { packages, .. } = DisplayError::of(text) else {
                unreachable!("{text}")
            };
            assert!(!packages.debian.is_empty() && !packages.fedora.is_empty(), "{text}");
        }
    }

    #[test]
    fn the_reason_is_what_the_system_says() {
        assert_eq!(reason("os error at a/b/mod.rs:765: neither is set."), "neither is set");
        assert_eq!(reason("not supported"), "not supported");
    }
}
