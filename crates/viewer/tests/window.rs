//! End-to-end test on a virtual display: a real window is opened, dragged, restored and exported by simulated
//! input.

use std::io::{BufRead as _, BufReader};
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use lodsmith_core::shapes;

const TIMEOUT: Duration = Duration::from_secs(120);

/// Kills a process when the test ends.
struct ProcessGuard(Child);

impl Drop for ProcessGuard {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

fn is_installed(program: &str) -> bool {
    let paths = std::env::var_os("PATH").unwrap_or_default();
    std::env::split_paths(&paths).any(|folder| folder.join(program).is_file())
}

/// Starts a virtual display; returns its process and its name.
fn screen() -> Option<(ProcessGuard, String)> {
    let missing: Vec<_> = ["Xvfb", "xdotool"].into_iter().filter(|p| !is_installed(p)).collect();
    if !missing.is_empty() {
        let is_demanded = std::env::var_os("LODSMITH_REQUIRE_GPU").is_some_and(|v| v == "1");
        assert!(!is_demanded, "demanded, but missing: {}", missing.join(", "));
        let text = format!("SKIPPED: {} missing (apt install xvfb xdotool)\n", missing.join(", "));
        let _ = std::io::Write::write_all(&mut std::io::stderr(), text.as_bytes());
        return None;
    }
    // Xvfb chooses a free display number and prints it once it is ready. Without `-noreset` it resets when
    // its last client disconnects, such as a search before the window opened, and refuses connections
    // meanwhile.
    let child = Command::new("Xvfb")
        .args(["-displayfd", "1", "-screen", "0", "1440x900x24", "-nolisten", "tcp", "-noreset"])
        .stdout(Stdio::piped())
        .stderr(Stdio::null())
        .spawn()
        .unwrap();
    let mut running = ProcessGuard(child);
    let mut number = String::new();
    BufReader::new(running.0.stdout.take().unwrap()).read_line(&mut number).unwrap();
    let number: u32 = number.trim().parse().expect("no virtual screen could be started");
    Some((running, format!(":{number}")))
}

struct InputSimulator {
    screen: String,
    window: String,
}

impl InputSimulator {
    fn run(&self, words: &[&str]) -> String {
        let output = Command::new("xdotool").env("DISPLAY", &self.screen).args(words).output().unwrap();
        String::from_utf8_lossy(&output.stdout).trim().to_owned()
    }
    fn go(&self, x: i32, y: i32) {
        self.run(&["mousemove", "--window", &self.window, &x.to_string(), &y.to_string()]);
        std::thread::sleep(Duration::from_millis(120));
    }
    fn key(&self, key: &str) {
        self.run(&["key", "--clearmodifiers", key]);
        std::thread::sleep(Duration::from_millis(250));
    }
}

fn until<T>(what: &str, mut found: impl FnMut() -> Option<T>) -> T {
    let end = Instant::now() + TIMEOUT;
    loop {
        if let Some(found) = found() {
            return found;
        }
        assert!(Instant::now() < end, "{what}: waited too long");
        std::thread::sleep(Duration::from_millis(100));
    }
}

fn export(hand: &InputSimulator, path: &Path) -> usize {
    // The file does not exist yet: the loop waits until the export has written it.
    hand.key("ctrl+s");
    hand.key("Return");
    until("the exported file", || {
        let read = lodsmith_io::read_path(path, &Default::default()).ok()?;
        Some(read.mesh.face_count())
    })
}

/// Copies the command line and asks another program for it.
fn copies_to_the_clipboard(hand: &InputSimulator, model: &Path) {
    if !is_installed("xclip") {
        let _ = std::io::Write::write_all(&mut std::io::stderr(), b"SKIPPED: xclip missing\n");
        return;
    }
    hand.key("ctrl+shift+c");
    let text = until("the clipboard", || {
        let asked = Command::new("xclip")
            .env("DISPLAY", &hand.screen)
            .args(["-selection", "clipboard", "-o"])
            .output()
            .unwrap();
        asked.status.success().then(|| String::from_utf8_lossy(&asked.stdout).into_owned())
    });
    let output = model.with_file_name("sphere_low.ply");
    assert!(text.starts_with("lodsmith simplify") && text.contains(&*output.to_string_lossy()), "{text}");
}

#[test]
fn a_window_opens_drags_holds_restores_and_exports() {
    let Some((_screen, name)) = screen() else { return };
    let folder = tempfile::tempdir().unwrap();
    let model = folder.path().join("sphere.ply");
    lodsmith_io::write_path(&shapes::icosphere(5), &model, &Default::default()).unwrap();
    let out = folder.path().join("sphere_low.ply");
    // The examples are built beside the tests.
    let tests = std::env::current_exe().unwrap();
    let program = tests.parent().and_then(Path::parent).unwrap().join("examples/window");
    let viewer = Command::new(program)
        .arg(&model)
        .env("DISPLAY", &name)
        .env_remove("WAYLAND_DISPLAY")
        .env("XDG_RUNTIME_DIR", folder.path())
        .stdout(Stdio::null())
        .spawn()
        .unwrap();
    let mut viewer = ProcessGuard(viewer);
    let mut hand = InputSimulator { screen: name, window: String::new() };
    hand.window = until("the window", || {
        let found = hand.run(&["search", "--name", "sphere.ply"]);
        found.lines().last().filter(|l| !l.is_empty()).map(str::to_owned)
    });
    std::thread::sleep(Duration::from_millis(1500));
    hand.run(&["windowfocus", &hand.window]);

    // The slider is at the lower edge, between the docks.
    let y = 900 - 34;
    hand.go(1120, y);
    hand.run(&["mousedown", "1"]);
    for x in [1060, 980, 900, 820] {
        hand.go(x, y);
    }
    hand.run(&["mouseup", "1"]);
    std::thread::sleep(Duration::from_secs(3));
    let dragged = export(&hand, &out);
    assert!(dragged < 12_000, "dragged to {dragged} faces");

    copies_to_the_clipboard(&hand, &model);
    std::fs::remove_file(&out).unwrap();
    hand.run(&["keydown", "m"]);
    std::thread::sleep(Duration::from_millis(2500));
    hand.run(&["keyup", "m"]);
    std::thread::sleep(Duration::from_secs(2));
    let held = export(&hand, &out);
    assert!(held < dragged, "held to {held} of {dragged} faces");

    std::fs::remove_file(&out).unwrap();
    hand.key("r");
    std::thread::sleep(Duration::from_secs(2));
    assert_eq!(export(&hand, &out), 20_480, "restored");

    hand.key("ctrl+q");
    let status = until("the end", || viewer.0.try_wait().unwrap());
    assert!(status.success(), "{status}");
}
