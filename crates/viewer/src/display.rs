//! Whether there is a screen to open a window on.

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
        Err(panic) => Err(match (panic.downcast_ref::<String>(), panic.downcast_ref::<&str>()) {
            (Some(text), _) => text.clone(),
            (None, Some(text)) => (*text).to_owned(),
            (None, None) => "the window library gave up".to_owned(),
        }),
    }
}

/// What the system says, without the place in the source of the window library where it was met.
pub(crate) fn reason(text: &str) -> String {
    let said = text.split_once(".rs:").and_then(|(_, rest)| rest.split_once(": "));
    said.map_or(text, |(_, why)| why).trim_end_matches('.').to_owned()
}

#[cfg(test)]
mod tests {
    use super::reason;

    #[test]
    fn the_reason_is_what_the_system_says() {
        assert_eq!(reason("os error at a/b/mod.rs:765: neither is set."), "neither is set");
        assert_eq!(reason("not supported"), "not supported");
    }
}
