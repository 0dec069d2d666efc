//! Float functions whose last bit differs between systems: crates with reproducible results use the crate `libm`
//! instead.

use std::path::{Path, PathBuf};

use anyhow::{Context, Result};
use syn::visit::{self, Visit};
use syn::{ExprMethodCall, ImplItemFn, Item};

use super::cycles::{attributes, is_test};

/// Methods of `f32` and `f64` that call functions of the system.
const SYSTEM_FUNCTIONS: &[&str] = &[
    "acos", "acosh", "asin", "asinh", "atan", "atan2", "atanh", "cbrt", "cos", "cosh", "exp", "exp2",
    "exp_m1", "hypot", "ln", "ln_1p", "log", "log10", "log2", "powf", "sin", "sin_cos", "sinh", "tan",
    "tanh",
];

/// Returns each call of such a method in these files, except in tests.
pub(super) fn calls(files: &[PathBuf]) -> Result<Vec<(&Path, String)>> {
    let mut all = Vec::new();
    for file in files {
        let text = std::fs::read_to_string(file).with_context(|| file.display().to_string())?;
        let parsed = syn::parse_file(&text).with_context(|| file.display().to_string())?;
        let mut calls = Calls(Vec::new());
        calls.visit_file(&parsed);
        all.extend(calls.0.into_iter().map(|name| (file.as_path(), name)));
    }
    Ok(all)
}

struct Calls(Vec<String>);

impl<'ast> Visit<'ast> for Calls {
    fn visit_item(&mut self, item: &'ast Item) {
        if !attributes(item).is_some_and(is_test) {
            visit::visit_item(self, item);
        }
    }

    fn visit_impl_item_fn(&mut self, item: &'ast ImplItemFn) {
        if !is_test(&item.attrs) {
            visit::visit_impl_item_fn(self, item);
        }
    }

    fn visit_expr_method_call(&mut self, call: &'ast ExprMethodCall) {
        if SYSTEM_FUNCTIONS.iter().any(|name| call.method == name) {
            self.0.push(call.method.to_string());
        }
        visit::visit_expr_method_call(self, call);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn calls_are_found_outside_tests() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.rs");
        let text = "fn f(x: f64) -> f64 {\n    g(x.sin())\n        + x.sqrt() + libm::cos(x)\n}\n\
                    #[cfg(test)]\nmod tests { fn t(x: f32) { x.ln(); } }";
        std::fs::write(&path, text).unwrap();
        let files = [path];
        assert_eq!(calls(&files).unwrap(), [(&*files[0], "sin".to_owned())]);
    }
}
