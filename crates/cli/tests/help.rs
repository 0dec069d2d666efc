//! Snapshots of `--help`, which is a contract with users.

use assert_cmd::Command;

fn help(command: &[&str]) -> String {
    let output = Command::cargo_bin("lodsmith")
        .expect("the command is built")
        .args(command)
        .arg("--help")
        .env("COLUMNS", "100")
        .output()
        .expect("it runs");
    assert!(output.status.success() && output.stderr.is_empty());
    // The name of the binary has an extension on some systems.
    String::from_utf8(output.stdout).expect("help is text").replace("lodsmith.exe", "lodsmith")
}

#[test]
fn help_of_lodsmith() {
    insta::assert_snapshot!(help(&[]));
}

#[test]
fn help_of_simplify() {
    insta::assert_snapshot!(help(&["simplify"]));
}

#[test]
fn help_of_lod() {
    insta::assert_snapshot!(help(&["lod"]));
}

#[test]
fn help_of_view() {
    insta::assert_snapshot!(help(&["view"]));
}

#[test]
fn help_of_doctor() {
    insta::assert_snapshot!(help(&["doctor"]));
}

#[test]
fn help_of_info() {
    insta::assert_snapshot!(help(&["info"]));
}

#[test]
fn help_of_compare() {
    insta::assert_snapshot!(help(&["compare"]));
}

#[test]
fn help_of_convert() {
    insta::assert_snapshot!(help(&["convert"]));
}

#[test]
fn help_of_methods() {
    insta::assert_snapshot!(help(&["methods"]));
}

#[test]
fn help_of_bake() {
    insta::assert_snapshot!(help(&["bake"]));
}

#[test]
fn help_of_clean() {
    insta::assert_snapshot!(help(&["clean"]));
}

#[test]
fn options_of_later_releases_are_unknown() {
    assert!(!help(&["simplify"]).contains("--cache"));
}

#[test]
fn help_of_render() {
    insta::assert_snapshot!(help(&["render"]));
}

#[test]
fn help_of_progressive() {
    insta::assert_snapshot!(help(&["progressive"]));
}

#[test]
fn help_of_progressive_build() {
    insta::assert_snapshot!(help(&["progressive", "build"]));
}

#[test]
fn help_of_progressive_extract() {
    insta::assert_snapshot!(help(&["progressive", "extract"]));
}

#[test]
fn help_of_progressive_info() {
    insta::assert_snapshot!(help(&["progressive", "info"]));
}
