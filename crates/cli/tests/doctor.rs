//! `lodsmith doctor` from end to end, with or without the window built in.

use crate::sandbox::{CliSandbox, keys};

#[test]
fn the_object_has_the_promised_keys_and_names_what_is_missing() {
    let outcome = CliSandbox::new().run("doctor --json");
    let object = &outcome.objects()[0];
    assert_eq!(keys(object), ["version", "platform", "threads", "viewer", "missing"]);
    assert_eq!(object["version"], env!("CARGO_PKG_VERSION"));
    assert!(object["threads"].as_u64().unwrap() >= 1);
    assert_eq!(object["viewer"]["built_in"], cfg!(feature = "view"));
    let missing = object["missing"].as_array().unwrap();
    assert_eq!(outcome.status, i32::from(!missing.is_empty()));
    for m in missing {
        assert_eq!(keys(m), ["what", "hint", "packages"]);
    }
    if cfg!(feature = "view") {
        let has_usable = object["viewer"]["adapters"].as_array().unwrap().iter().any(|a| a["usable"] == true);
        let says = missing.iter().any(|m| m["what"].as_str().unwrap().starts_with("a graphics adapter"));
        assert_eq!(has_usable, !says);
        assert_eq!(object["viewer"]["display"].is_null(), missing.len() > usize::from(says));
    } else {
        assert!(object["viewer"]["adapters"].is_null() && missing.is_empty());
    }
}

#[test]
fn the_table_says_whether_there_is_a_window() {
    let outcome = CliSandbox::new().run("doctor");
    assert!(
        outcome.text().starts_with(concat!("lodsmith ", env!("CARGO_PKG_VERSION"), "\n")),
        "{}",
        outcome.text()
    );
    let says = if cfg!(feature = "view") { "built in" } else { "--features view" };
    assert!(outcome.text().contains(says), "{}", outcome.text());
}
