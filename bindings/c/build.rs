//! Sets the name of the shared library (soname).
#![allow(clippy::print_stdout, reason = "a build script passes instructions to Cargo on standard output")]

fn main() {
    println!("cargo:rerun-if-changed=build.rs");
    let major = std::env::var("CARGO_PKG_VERSION_MAJOR").unwrap_or_default();
    match std::env::var("CARGO_CFG_TARGET_OS").as_deref() {
        Ok("macos") => {
            println!("cargo:rustc-cdylib-link-arg=-Wl,-install_name,@rpath/liblodsmith.{major}.dylib");
        }
        Ok("linux" | "freebsd" | "netbsd" | "openbsd") => {
            println!("cargo:rustc-cdylib-link-arg=-Wl,-soname,liblodsmith.so.{major}");
        }
        _ => {}
    }
}
