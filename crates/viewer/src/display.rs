//! Whether there is a screen to open a window on.

use std::any::Any;
use std::panic::catch_unwind;

use winit::event_loop::EventLoop;

/// The display server that the window would go to, for people.
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

/// Goes to the display server as the window does, and gives its name. Works once in a process, on its first thread, and
/// no window can be opened in it afterwards.
///
/// # Errors
/// Why there is none.
pub fn find() -> Result<String, String> {
    // Where a library of the keyboard is missing, the window library panics.
    match catch_unwind(|| EventLoop::new().map(drop)) {
        Ok(Ok(())) => Ok(server()),
        Ok(Err(e)) => Err(reason(&e.to_string())),
        Err(panic) => Err(words(&*panic)),
    }
}

/// What a panic says.
pub(crate) fn words(panic: &(dyn Any + Send)) -> String {
    match (panic.downcast_ref::<String>(), panic.downcast_ref::<&str>()) {
        (Some(text), _) => text.clone(),
        (None, Some(text)) => (*text).to_owned(),
        (None, None) => "the window library gave up".to_owned(),
    }
}

/// Libraries of the system: by what they are known in what is said, and how they are installed.
const LIBRARIES: [(&str, &str); 4] = [
    (
        "libxkbcommon",
        "on Debian and Ubuntu `apt install libxkbcommon0 libxkbcommon-x11-0`, on Fedora `dnf install libxkbcommon \
         libxkbcommon-x11`",
    ),
    (
        "wayland",
        "on Debian and Ubuntu `apt install libwayland-client0 libwayland-cursor0`, on Fedora `dnf install \
         libwayland-client libwayland-cursor`",
    ),
    ("libX", X11),
    ("xlib", X11),
];
const X11: &str = "on Debian and Ubuntu `apt install libx11-6 libx11-xcb1 libxcursor1 libxi6 libxrandr2`, on Fedora `dnf \
                   install libX11 libX11-xcb libXcursor libXi libXrandr`";

/// The library of the system that something could not be done for the lack of, and how it is installed.
pub(crate) fn missing_library(text: &str) -> Option<(String, &'static str)> {
    let is_lack = ["could not be loaded", "cannot open shared object", "Failed to load one of"];
    if !is_lack.iter().any(|words| text.contains(words)) {
        return None;
    }
    let how = LIBRARIES.iter().find(|(known, _)| text.contains(known)).map(|(_, how)| *how);
    let is_of_name = |c: char| c.is_ascii_alphanumeric() || "-_.+".contains(c);
    let mut words = text.split(|c| !is_of_name(c)).map(|w| w.trim_end_matches('.'));
    let library = words.find(|w| w.starts_with("lib") && w.contains(".so"));
    match (library, how) {
        (None, None) => None,
        (library, how) => Some((
            library.unwrap_or("a library of the display").to_owned(),
            how.unwrap_or("the packages of your system have it"),
        )),
    }
}

/// What the system says, without the place in the source of the window library where it was met.
pub(crate) fn reason(text: &str) -> String {
    let said = text.split_once(".rs:").and_then(|(_, rest)| rest.split_once(": "));
    said.map_or(text, |(_, why)| why).trim_end_matches('.').to_owned()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_library_that_is_missing_is_named_with_what_brings_it() {
        let of = |text: &str| missing_library(text).unwrap();
        let (name, how) = of("Library libxkbcommon-x11.so could not be loaded.");
        assert_eq!(name, "libxkbcommon-x11.so");
        assert!(how.contains("apt install libxkbcommon0 libxkbcommon-x11-0"));
        let (name, how) = of("libXcursor.so.1: cannot open shared object file: No such file or directory");
        assert!(name == "libXcursor.so.1" && how.contains("libxcursor1"), "{name} {how}");
        let (name, how) = of("libodd.so.2: cannot open shared object file");
        assert!(name == "libodd.so.2" && how.contains("your system"));
        let (name, how) = of("os error at x.rs:9: Failed to load one of xlib's shared libraries");
        assert!(name == "a library of the display" && how.contains("libx11-6"), "{name} {how}");
        assert!(of("The wayland library could not be loaded").1.contains("libwayland-client0"));
        assert_eq!(missing_library("neither WAYLAND_DISPLAY nor DISPLAY is set"), None);
        assert_eq!(missing_library("index out of bounds in lib.rs"), None);
    }

    #[test]
    fn the_reason_is_what_the_system_says() {
        assert_eq!(reason("os error at a/b/mod.rs:765: neither is set."), "neither is set");
        assert_eq!(reason("not supported"), "not supported");
    }
}
