//! Repository rules that the compiler does not check: dependencies between packages, forbidden words in sources, files
//! in the tree. Each rule is a test, so `cargo test` checks them all; `cargo xtask tidy` prints them all at once.

mod cycles;
mod float_functions;
mod parallel_initialisers;
mod type_names;

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

use anyhow::{Context, Result, ensure};
use serde_json::Value;

use crate::files::{files_under, shown, sources, tree};
use crate::{cargo, map, root};

/// A package, the packages of this workspace that it may use, and crates that it must not depend on, even indirectly.
struct PackageRule {
    package: &'static str,
    /// Its folder, from the root.
    folder: &'static str,
    uses: &'static [&'static str],
    never: &'static [&'static str],
}

/// Crates for windows and graphics drivers, and crates on top of them.
const GPU: &[&str] = &["wgpu", "winit", "egui", "eframe", "glow", "ash"];
/// Crates for files, clocks, logs and arguments, which belong to the caller, and for file formats, which need files.
const CALLER_OWNED_CRATES: &[&str] = &[
    "tempfile",
    "walkdir",
    "memmap2",
    "chrono",
    "time",
    "log",
    "tracing",
    "env_logger",
    "clap",
    "anyhow",
    "serde_json",
    "flate2",
    "image",
    "gltf",
    "tobj",
    "tokio",
    "libc",
    "rand",
    "getrandom",
];

const PACKAGE_RULES: &[PackageRule] = &[
    PackageRule { package: "lodsmith-core", folder: "crates/core", uses: &[], never: CALLER_OWNED_CRATES },
    PackageRule {
        package: "lodsmith",
        folder: "crates/lodsmith",
        uses: &["lodsmith-core"],
        never: CALLER_OWNED_CRATES,
    },
    PackageRule {
        package: "lodsmith-io",
        folder: "crates/io",
        uses: &["lodsmith-core"],
        never: &["clap", "anyhow", "tokio"],
    },
    PackageRule {
        package: "lodsmith-render",
        folder: "crates/render",
        uses: &["lodsmith-core"],
        never: &["clap", "anyhow", "tokio"],
    },
    PackageRule {
        package: "lodsmith-bake",
        folder: "crates/bake",
        uses: &["lodsmith-core", "lodsmith", "lodsmith-io", "lodsmith-render"],
        never: &["clap", "anyhow", "tokio"],
    },
    PackageRule {
        package: "lodsmith-asset",
        folder: "crates/asset",
        uses: &["lodsmith-core", "lodsmith", "lodsmith-io", "lodsmith-render", "lodsmith-bake"],
        never: &["clap", "anyhow", "tokio", "egui"],
    },
    PackageRule {
        package: "lodsmith-cli",
        folder: "crates/cli",
        uses: &[
            "lodsmith-core",
            "lodsmith",
            "lodsmith-io",
            "lodsmith-render",
            "lodsmith-bake",
            "lodsmith-asset",
            "lodsmith-viewer",
        ],
        never: &[],
    },
    PackageRule {
        package: "lodsmith-viewer",
        folder: "crates/viewer",
        uses: &[
            "lodsmith-core",
            "lodsmith",
            "lodsmith-io",
            "lodsmith-render",
            "lodsmith-bake",
            "lodsmith-asset",
        ],
        // (Not tokio: the lock file has it for windows in browsers, where it is not built.)
        never: &["clap"],
    },
    PackageRule {
        package: "lodsmith-web",
        folder: "crates/web",
        uses: &["lodsmith-io", "lodsmith-viewer"],
        never: &["clap"],
    },
];

/// Words that the sources of some folders must not contain, and the reason. Strings count as code: the words are rare.
struct ForbiddenWords {
    folders: &'static [&'static str],
    words: &'static [&'static str],
    why: &'static str,
}

const FORBIDDEN_WORDS: &[ForbiddenWords] = &[
    ForbiddenWords {
        folders: &[
            "crates/core/src",
            "crates/lodsmith/src",
            "crates/io/src",
            "crates/render/src",
            "crates/bake/src",
            "crates/asset/src",
        ],
        words: &["println!", "print!", "eprintln!", "eprint!", "dbg!"],
        why: "libraries return values; the command prints",
    },
    ForbiddenWords {
        folders: &["crates/core/src", "crates/lodsmith/src", "crates/bake/src"],
        words: &["std::fs", "std::env", "std::net", "std::process", "std::time", "std::path"],
        why: "core, lodsmith and bake use no files, environment or clocks: these belong to the caller",
    },
    ForbiddenWords {
        folders: &["crates/core/src", "crates/lodsmith/src"],
        words: &["ThreadPoolBuilder"],
        why: "core and lodsmith make no thread pools: these belong to the caller",
    },
    ForbiddenWords {
        folders: &["crates/viewer/src"],
        words: &["std::time::Instant", "std::time::{Duration, Instant", "std::time::SystemTime::now"],
        why: "a browser has no such clock: use web_time",
    },
    ForbiddenWords {
        folders: &["crates", "bench", "xtask", "fuzz"],
        words: &["unsafe {", "unsafe fn", "unsafe impl", "allow(unsafe_code"],
        why: "only bindings/c, which takes pointers, may be unsafe",
    },
    ForbiddenWords {
        folders: &["bindings/c/src"],
        words: &["eprintln!", "eprint!", "dbg!", "std::fs", "std::net"],
        why: "the C interface uses the caller's memory; lodsmith-asset handles files",
    },
    ForbiddenWords {
        folders: &["crates", "bindings", "bench", "xtask", "fuzz"],
        words: &["#[ignore", "allow(dead_code", "todo!(", "unimplemented!("],
        why: "no test is ignored, and no code is left unfinished",
    },
];

/// File names without meaning.
const VAGUE_NAMES: &[&str] = &["utils", "util", "helpers", "helper", "common", "misc"];
/// Maximum bytes of `testdata` in total.
const TESTDATA_MAX: u64 = 300_000;
/// Maximum lines of a file; a file that is nearly as long already has two concepts.
const LINES_MAX: usize = 2000;
/// Maximum bytes of ARCHITECTURE.md: about a quarter of an hour of reading. The map lists the files.
const ARCHITECTURE_MAX: usize = 16_000;

type Rule = fn() -> Result<Vec<String>>;

/// Every rule: its name, and the function that returns its violations.
const RULES: &[(&str, Rule)] = &[
    ("packages use only packages below them", directions),
    ("docs/dependencies.md has a reason for each dependency", reasons),
    ("packages do not depend on forbidden crates", forbidden_crates),
    ("sources have no forbidden words", forbidden_words),
    ("crates include only their own files", foreign_files),
    ("file names are concepts", vague_names),
    ("files are not too long", long_files),
    ("every file has a head that can be its entry in the map", heads),
    ("ARCHITECTURE.md is short, and names every package and only files that exist", architecture),
    ("testdata is small and has an origin", testdata),
    ("every test file belongs to a test program", test_files),
    ("no file contains paths of a machine", machine_paths),
    ("every cited paper is in docs/papers.md", papers),
    ("files do not use each other in cycles", file_cycles),
    ("type names are unique in a crate", repeated_type_names),
    ("core and lodsmith use no float functions of the system", system_float_functions),
    ("no initialiser of a shared cell waits for the threads of a pool", parallel_work_in_initialisers),
];

/// Prints every rule.
pub(crate) fn run() -> Result<()> {
    let mut broken = 0;
    for (name, rule) in RULES {
        let findings = rule()?;
        println!("{} {name}", if findings.is_empty() { "holds " } else { "BROKEN" });
        for finding in &findings {
            println!("       {finding}");
        }
        broken += usize::from(!findings.is_empty());
    }
    ensure!(broken == 0, "{broken} of {} rules are broken", RULES.len());
    Ok(())
}

/// Returns the packages of the workspace as Cargo reports them. Needs no network: nothing is resolved.
fn packages() -> Result<Vec<Value>> {
    let out = cargo().args(["metadata", "--no-deps", "--offline", "--format-version", "1"]).output()?;
    ensure!(out.status.success(), "cargo metadata: {}", String::from_utf8_lossy(&out.stderr));
    let all: Value = serde_json::from_slice(&out.stdout)?;
    Ok(all["packages"].as_array().context("no packages")?.clone())
}

/// Returns the dependencies of a package, without dependencies of tests and build scripts, and without `proptest`,
/// which only tests enable.
fn direct(package: &Value) -> impl Iterator<Item = &str> {
    let all = package["dependencies"].as_array().into_iter().flatten();
    let kept = |d: &&Value| d["kind"].is_null() && !(d["optional"] == true && d["name"] == "proptest");
    all.filter(kept).filter_map(|d| d["name"].as_str())
}

fn directions() -> Result<Vec<String>> {
    let packages = packages()?;
    let ours: BTreeSet<&str> = packages.iter().filter_map(|p| p["name"].as_str()).collect();
    let mut findings = Vec::new();
    for package in &packages {
        let name = package["name"].as_str().unwrap_or_default();
        let unpublished = package["publish"].as_array().is_some_and(Vec::is_empty);
        match PACKAGE_RULES.iter().find(|r| r.package == name) {
            None if unpublished => {}
            None => {
                findings.push(format!("{name} is a published package without a row in xtask/src/tidy.rs"))
            }
            Some(rule) => {
                let manifest = Path::new(package["manifest_path"].as_str().unwrap_or_default());
                if manifest.parent() != Some(&root().join(rule.folder)) {
                    findings.push(format!("{name} is not in {}", rule.folder));
                }
                for used in direct(package).filter(|d| ours.contains(d) && !rule.uses.contains(d)) {
                    findings.push(format!("{name} depends on {used}"));
                }
            }
        }
    }
    Ok(findings)
}

/// Returns the external dependencies in the manifests, each with the packages that use it, named as in
/// docs/dependencies.md.
fn dependencies(packages: &[Value]) -> BTreeMap<&str, BTreeSet<String>> {
    let ours: BTreeSet<&str> = packages.iter().filter_map(|p| p["name"].as_str()).collect();
    let mut all: BTreeMap<&str, BTreeSet<String>> = BTreeMap::new();
    for package in packages {
        let user = package["name"].as_str().unwrap_or_default();
        let user = user.strip_prefix("lodsmith-").unwrap_or(user);
        for used in package["dependencies"].as_array().into_iter().flatten() {
            if let Some(name) = used["name"].as_str().filter(|name| !ours.contains(name)) {
                all.entry(name).or_default().insert(user.to_owned());
            }
        }
    }
    all
}

/// Parses the rows of docs/dependencies.md: a crate and its users, without remarks in brackets.
fn documented(page: &str) -> BTreeMap<&str, BTreeSet<String>> {
    let mut rows = BTreeMap::new();
    for line in page.lines() {
        let cells: Vec<&str> = line.split('|').map(str::trim).collect();
        let [_, name, users, .., _] = cells[..] else { continue };
        let Some(name) = name.strip_prefix('`').and_then(|name| name.strip_suffix('`')) else { continue };
        let users = users.split(", ").filter_map(|user| user.split(' ').next()).map(str::to_owned);
        rows.insert(name, users.collect());
    }
    rows
}

fn reasons() -> Result<Vec<String>> {
    let packages = packages()?;
    let page = std::fs::read_to_string(root().join("docs/dependencies.md"))?;
    Ok(dependencies_without_reason(&dependencies(&packages), &documented(&page)))
}

fn dependencies_without_reason(
    named: &BTreeMap<&str, BTreeSet<String>>,
    rows: &BTreeMap<&str, BTreeSet<String>>,
) -> Vec<String> {
    let mut findings = Vec::new();
    for (name, users) in named {
        match rows.get(name) {
            None => findings.push(format!("{name} has no row in docs/dependencies.md")),
            Some(listed) if listed != users => {
                findings
                    .push(format!("{name} is used by {users:?}, but docs/dependencies.md lists {listed:?}"));
            }
            Some(_) => {}
        }
    }
    let gone = rows.keys().filter(|name| !named.contains_key(*name));
    findings.extend(gone.map(|name| format!("{name} has a row in docs/dependencies.md but is not used")));
    findings
}

/// Returns each package of the lock file with all its possible dependencies, on any system and with any feature.
fn locked(text: &str) -> BTreeMap<&str, Vec<&str>> {
    let mut packages: BTreeMap<&str, Vec<&str>> = BTreeMap::new();
    let mut name = "";
    for line in text.lines() {
        if let Some(quoted) = line.strip_prefix("name = ") {
            name = quoted.trim_matches('"');
            packages.entry(name).or_default();
        } else if let Some(item) = line.strip_prefix(" \"") {
            // "name", or "name version" if there are several versions.
            let used = item.split(['"', ' ']).next().unwrap_or_default();
            packages.entry(name).or_default().push(used);
        }
    }
    packages
}

fn forbidden_crates() -> Result<Vec<String>> {
    let lock = std::fs::read_to_string(root().join("Cargo.lock"))?;
    let lock = locked(&lock);
    let packages = packages()?;
    let ours: BTreeMap<&str, &Value> =
        packages.iter().filter_map(|p| Some((p["name"].as_str()?, p))).collect();
    let mut findings = Vec::new();
    for rule in PACKAGE_RULES {
        let Some(package) = ours.get(rule.package) else { continue };
        // For our own packages the lock file includes test dependencies, so these come from the manifests.
        let mut from: BTreeMap<&str, &str> = direct(package).map(|d| (d, rule.package)).collect();
        let mut todo: Vec<&str> = from.keys().copied().collect();
        while let Some(name) = todo.pop() {
            let used: Vec<&str> = match ours.get(name) {
                Some(own) => direct(own).collect(),
                None => lock.get(name).cloned().unwrap_or_default(),
            };
            for next in used {
                if !from.contains_key(next) && next != rule.package {
                    from.insert(next, name);
                    todo.push(next);
                }
            }
        }
        let windowed = matches!(rule.package, "lodsmith-viewer" | "lodsmith-cli" | "lodsmith-web");
        let gpu = if windowed { &[] } else { GPU };
        for never in rule.never.iter().chain(gpu) {
            if let Some(through) = from.get(never) {
                findings.push(format!("{} depends on {never} through {through}", rule.package));
            }
        }
        if rule.package == "lodsmith-cli" && direct(package).any(|d| d == "wgpu") {
            findings.push("lodsmith-cli depends on wgpu directly instead of through the viewer".into());
        }
    }
    Ok(findings)
}

/// Returns whether a line contains a word, but not only as the end of a longer word.
fn contains_word(line: &str, word: &str) -> bool {
    line.match_indices(word).any(|(at, _)| {
        !word.starts_with(char::is_alphanumeric)
            || !line[..at].ends_with(|c: char| c.is_alphanumeric() || c == '_')
    })
}

fn forbidden_words() -> Result<Vec<String>> {
    let mut findings = Vec::new();
    for rule in FORBIDDEN_WORDS {
        for folder in rule.folders {
            for path in sources(folder)? {
                // The list above is not a use of the words.
                if path == root().join("xtask/src/tidy.rs") {
                    continue;
                }
                let text = std::fs::read_to_string(&path)?;
                for (number, line) in text.lines().enumerate() {
                    let code = line.trim_start();
                    if code.starts_with("//") {
                        continue;
                    }
                    for word in rule.words.iter().filter(|w| contains_word(code, w)) {
                        findings.push(format!("{}:{}: {word}: {}", shown(&path), number + 1, rule.why));
                    }
                }
            }
        }
    }
    Ok(findings)
}

/// Finds files that a crate includes at build time from outside its package.
fn foreign_files() -> Result<Vec<String>> {
    let mut findings = Vec::new();
    for rule in PACKAGE_RULES {
        let folder = root().join(rule.folder);
        for path in sources(&format!("{}/src", rule.folder))? {
            let text = std::fs::read_to_string(&path)?;
            for name in included(&text) {
                let depth = path.strip_prefix(&folder).map_or(0, |inside| inside.components().count() - 1);
                if name.split('/').take_while(|step| *step == "..").count() > depth {
                    findings.push(format!("{} includes {name}, which is outside its package", shown(&path)));
                }
            }
        }
    }
    Ok(findings)
}

/// Returns the files that a source includes at build time.
fn included(text: &str) -> impl Iterator<Item = &str> {
    text.split("include_").skip(1).filter_map(|rest| {
        let (macro_name, rest) = rest.split_once("!(\"")?;
        matches!(macro_name, "bytes" | "str").then(|| rest.split('"').next())?
    })
}

fn vague_names() -> Result<Vec<String>> {
    let mut findings = Vec::new();
    for folder in ["crates", "bindings", "bench", "xtask", "fuzz"] {
        for path in sources(folder)? {
            let relative = path.strip_prefix(root()).unwrap_or(&path);
            let vague = |part: &std::ffi::OsStr| {
                VAGUE_NAMES.contains(&part.to_string_lossy().trim_end_matches(".rs"))
            };
            if relative.iter().any(vague) {
                findings.push(format!("{}: the file name has no meaning", shown(&path)));
            }
        }
    }
    Ok(findings)
}

fn long_files() -> Result<Vec<String>> {
    let mut findings = Vec::new();
    for folder in ["crates", "bindings", "bench", "xtask", "fuzz"] {
        for path in sources(folder)? {
            let lines = std::fs::read_to_string(&path)?.lines().count();
            if lines > LINES_MAX {
                findings.push(format!("{} has {lines} lines of at most {LINES_MAX}", shown(&path)));
            }
        }
    }
    Ok(findings)
}

/// Finds sources without a head that `cargo xtask map` can print.
fn heads() -> Result<Vec<String>> {
    let mut findings = Vec::new();
    for path in tree()?.iter().filter(|path| path.extension().is_some_and(|e| e == "rs")) {
        let text = std::fs::read_to_string(path)?;
        findings.extend(map::fault(&text).map(|fault| format!("{} {fault}", shown(path))));
    }
    Ok(findings)
}

fn architecture() -> Result<Vec<String>> {
    let page = std::fs::read_to_string(root().join("ARCHITECTURE.md"))?;
    // The package of the fuzz targets is outside the workspace.
    let mut folders = vec!["fuzz".to_owned()];
    for package in packages()? {
        let manifest = Path::new(package["manifest_path"].as_str().unwrap_or_default());
        folders.extend(manifest.parent().map(shown));
    }
    let mut findings: Vec<String> = folders
        .iter()
        .filter(|folder| !page.contains(&format!("`{folder}`")))
        .map(|folder| format!("ARCHITECTURE.md does not name `{folder}`"))
        .collect();
    let gone = paths_in(&page).filter(|path| !root().join(path).exists());
    findings.extend(gone.map(|path| format!("ARCHITECTURE.md names {path}, which does not exist")));
    if page.len() > ARCHITECTURE_MAX {
        findings.push(format!("ARCHITECTURE.md has {} bytes of at most {ARCHITECTURE_MAX}", page.len()));
    }
    Ok(findings)
}

/// Returns the paths in a page that begin with a folder of the workspace.
fn paths_in(page: &str) -> impl Iterator<Item = &str> {
    let folders = [".ci/", "bench/", "bindings/", "crates/", "docs/", "fuzz/", "testdata/", "xtask/"];
    page.split('`')
        .skip(1)
        .step_by(2)
        .filter(move |span| folders.iter().any(|folder| span.starts_with(folder)))
}

fn testdata() -> Result<Vec<String>> {
    let mut findings = Vec::new();
    let mut sum = 0;
    let mut folders = vec![root().join("testdata")];
    for entry in std::fs::read_dir(root().join("crates"))? {
        folders.push(entry?.path().join("testdata"));
        folders.push(folders[folders.len() - 1].with_file_name("tests").join("testdata"));
    }
    for folder in folders.iter().filter(|f| f.is_dir()) {
        let origin = std::fs::read_to_string(folder.join("ORIGIN.md")).unwrap_or_default();
        for path in files_under(folder)? {
            let name = path.strip_prefix(folder).unwrap_or(&path).to_string_lossy().replace('\\', "/");
            sum += path.metadata()?.len();
            if name != "ORIGIN.md" && !origin.contains(&format!("`{name}`")) {
                findings.push(format!("{} is not named in the ORIGIN.md of its folder", shown(&path)));
            }
        }
    }
    if sum > TESTDATA_MAX {
        findings.push(format!("testdata has {sum} bytes of at most {TESTDATA_MAX}"));
    }
    Ok(findings)
}

/// Finds files in folders of tests that are not a module of any test program: their tests would never run.
fn test_files() -> Result<Vec<String>> {
    let mut findings = Vec::new();
    for package in &packages()? {
        let targets = package["targets"].as_array().into_iter().flatten();
        let programs: BTreeSet<&Path> = targets
            .filter(|target| target["kind"][0] == "test")
            .filter_map(|target| target["src_path"].as_str().map(Path::new))
            .collect();
        let mut text = String::new();
        for program in &programs {
            text += &std::fs::read_to_string(program)?;
        }
        let manifest = Path::new(package["manifest_path"].as_str().unwrap_or_default());
        let Ok(entries) = std::fs::read_dir(manifest.with_file_name("tests")) else { continue };
        for entry in entries {
            let path = entry?.path();
            let stem = path.file_stem().unwrap_or_default().to_string_lossy();
            let is_module = text.lines().any(|line| line == format!("mod {stem};"));
            if path.extension().is_some_and(|e| e == "rs") && !programs.contains(&*path) && !is_module {
                findings.push(format!("{} is not a module of a test program", shown(&path)));
            }
        }
    }
    findings.sort();
    Ok(findings)
}

fn machine_paths() -> Result<Vec<String>> {
    // Composed here, so that this file does not contain them.
    let paths: Vec<String> =
        ["home", "root", "Users", "work", "mnt"].iter().map(|d| format!("/{d}/")).collect();
    let mut findings = Vec::new();
    for path in tree()? {
        let Ok(text) = std::fs::read_to_string(&path) else { continue };
        for (number, line) in text.lines().enumerate() {
            for machine in &paths {
                let starts = |at: usize| {
                    // Only at the beginning of a path: not inside a relative path or a URL.
                    !line[..at].ends_with(|c: char| c.is_alphanumeric() || "._-/}".contains(c))
                };
                if line.match_indices(machine.as_str()).any(|(at, _)| starts(at)) {
                    findings.push(format!("{}:{}: {machine}", shown(&path), number + 1));
                }
            }
        }
    }
    Ok(findings)
}

fn file_cycles() -> Result<Vec<String>> {
    let mut findings = Vec::new();
    for PackageRule { folder, .. } in PACKAGE_RULES {
        let all = cycles::cycles(&root().join(folder).join("src/lib.rs"))?;
        for (from, to, names) in all.iter().flat_map(|circle| &circle.dependencies) {
            findings.push(format!("{} names {} of {}", shown(from), names.join(", "), shown(to)));
        }
    }
    Ok(findings)
}

fn repeated_type_names() -> Result<Vec<String>> {
    let mut findings = Vec::new();
    for PackageRule { folder, .. } in PACKAGE_RULES {
        let files = sources(&format!("{folder}/src"))?;
        for (name, files) in type_names::repeated(&files)? {
            let files: Vec<String> = files.into_iter().map(shown).collect();
            findings.push(format!("{folder}: {name} in {}", files.join(", ")));
        }
    }
    Ok(findings)
}

fn system_float_functions() -> Result<Vec<String>> {
    let mut findings = Vec::new();
    for folder in ["crates/core/src", "crates/lodsmith/src"] {
        // Files of test modules have these names.
        let is_test = |path: &Path| path.ends_with("tests.rs") || path.ends_with("test_support.rs");
        let files: Vec<PathBuf> = sources(folder)?.into_iter().filter(|path| !is_test(path)).collect();
        for (file, name) in float_functions::calls(&files)? {
            findings.push(format!("{}: {name}: use the function of the crate libm", shown(file)));
        }
    }
    Ok(findings)
}

fn parallel_work_in_initialisers() -> Result<Vec<String>> {
    let mut files = Vec::new();
    for folder in ["crates", "bindings"] {
        files.extend(sources(folder)?);
    }
    files.retain(|path| path.components().any(|part| part.as_os_str() == "src"));
    let found = parallel_initialisers::found(&files)?;
    Ok(found.into_iter().map(|(file, work)| format!("{}: {work} in an initialiser", shown(file))).collect())
}

/// Returns the keys in a line, such as `[Name 1999]` or `[Name-Other 1999]`.
fn keys(line: &str) -> impl Iterator<Item = &str> {
    line.split('[').skip(1).filter_map(|rest| rest.split_once(']')).map(|(key, _)| key).filter(|key| {
        key.split_once(' ').is_some_and(|(names, year)| {
            year.len() == 4
                && year.bytes().all(|b| b.is_ascii_digit())
                && names
                    .split('-')
                    .all(|n| n.starts_with(char::is_uppercase) && n.chars().all(char::is_alphabetic))
        })
    })
}

fn papers() -> Result<Vec<String>> {
    let known = std::fs::read_to_string(root().join("docs/papers.md"))?;
    let known: BTreeSet<&str> = known.lines().filter(|l| l.starts_with("- ")).flat_map(keys).collect();
    let mut findings = Vec::new();
    for path in sources("crates")? {
        let text = std::fs::read_to_string(&path)?;
        for (number, line) in text.lines().enumerate() {
            for key in keys(line).filter(|k| !known.contains(k)) {
                findings.push(format!("{}:{}: [{key}]", shown(&path), number + 1));
            }
        }
    }
    Ok(findings)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[track_caller]
    fn holds(rule: Rule) {
        let findings = rule().unwrap();
        assert!(findings.is_empty(), "{}", findings.join("\n"));
    }

    #[test]
    fn packages_use_only_packages_below_them() {
        holds(directions);
    }
    #[test]
    fn each_dependency_has_a_reason() {
        holds(reasons);
    }
    #[test]
    fn packages_do_not_depend_on_forbidden_crates() {
        holds(forbidden_crates);
    }
    #[test]
    fn sources_have_no_forbidden_words() {
        holds(forbidden_words);
    }
    #[test]
    fn crates_include_only_their_own_files() {
        holds(foreign_files);
        let text = "const A: &str = include_str!(\"../a.txt\");\nconst B: &[u8] = include_bytes!(\"b\");\n";
        assert_eq!(included(text).collect::<Vec<_>>(), ["../a.txt", "b"]);
    }
    #[test]
    fn file_names_are_concepts() {
        holds(vague_names);
    }
    #[test]
    fn files_are_not_too_long() {
        holds(long_files);
    }
    #[test]
    fn every_file_has_a_head_for_the_map() {
        holds(heads);
    }
    #[test]
    fn architecture_is_short_and_names_existing_files() {
        holds(architecture);
        let page = "```text\ncrates/a\n```\n`crates/b.rs`, crates/c and `d/e`, `docs/f/`\n";
        assert_eq!(paths_in(page).collect::<Vec<_>>(), ["crates/b.rs", "docs/f/"]);
    }
    #[test]
    fn testdata_is_small_and_has_an_origin() {
        holds(testdata);
    }
    #[test]
    fn every_test_file_belongs_to_a_test_program() {
        holds(test_files);
    }
    #[test]
    fn no_file_contains_paths_of_a_machine() {
        holds(machine_paths);
    }
    #[test]
    fn files_do_not_use_each_other_in_cycles() {
        holds(file_cycles);
    }
    #[test]
    fn type_names_are_unique_in_a_crate() {
        holds(repeated_type_names);
    }

    #[test]
    fn float_functions_do_not_come_from_the_system() {
        holds(system_float_functions);
    }
    #[test]
    fn no_initialiser_waits_for_a_pool() {
        holds(parallel_work_in_initialisers);
    }
    #[test]
    fn every_cited_paper_is_listed() {
        holds(papers);
    }

    #[test]
    fn the_lock_file_is_parsed() {
        let text = "[[package]]\nname = \"a\"\nversion = \"1\"\ndependencies = [\n \"b\",\n \"c 0.2.0\",\n]\n\n\
                    [[package]]\nname = \"b\"\n";
        let lock = locked(text);
        assert_eq!(lock["a"], ["b", "c"]);
        assert!(lock["b"].is_empty());
    }

    #[test]
    fn dependencies_without_rows_and_unused_rows_are_found() {
        let page = "| crate | used by |\n|---|---|\n| `a` | io, cli (test) | 1 | why |\n| `gone` | io | 1 | why |\n\
                    | `b` | io | 1 | why |\n";
        let users = |names: &[&str]| names.iter().map(|&n| n.to_owned()).collect::<BTreeSet<_>>();
        let named = BTreeMap::from([
            ("a", users(&["io", "cli"])),
            ("b", users(&["io", "core"])),
            ("new", users(&["io"])),
        ]);
        let findings = dependencies_without_reason(&named, &documented(page));
        assert_eq!(findings.len(), 3, "{findings:?}");
        for (finding, name) in findings.iter().zip(["b is", "new has no row", "gone has a row"]) {
            assert!(finding.starts_with(name), "{finding}");
        }
    }

    #[test]
    fn forbidden_words_are_whole_words() {
        assert!(contains_word("println!(1)", "println!") && !contains_word("eprintln!(1)", "println!"));
        assert!(contains_word("(std::fs::read)", "std::fs") && !contains_word("mystd::fs", "std::fs"));
    }

    #[test]
    fn keys_are_names_and_years() {
        let line = "After [Lindstrom-Turk 1998] and [Dey 1999], not [a 1999], [Foo], [Bar 99] or [x][1999].";
        assert_eq!(keys(line).collect::<Vec<_>>(), ["Lindstrom-Turk 1998", "Dey 1999"]);
    }
}
