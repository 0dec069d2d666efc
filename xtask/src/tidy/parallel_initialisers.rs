//! Parallel work inside the initialiser of a shared cell can deadlock. While a thread of a pool waits for other
//! threads, it may run other work; if that work reads the same cell, the thread waits for itself.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

use anyhow::{Context, Result};
use syn::punctuated::Punctuated;
use syn::visit::{self, Visit};
use syn::{Expr, ExprCall, ExprMethodCall, ImplItemFn, Item, ItemFn, ItemImpl, Local, Pat, Token, Type};

use super::cycles::{attributes, is_test};

/// Methods that call their argument at most once, while other threads wait.
const INITIALISING_METHODS: &[&str] = &["get_or_init", "get_or_try_init", "call_once", "call_once_force"];
/// Types whose function `new` takes an initialiser.
const INITIALISED_TYPES: &[&str] = &["LazyLock", "LazyCell", "Lazy"];
/// Methods of a pool that wait for its threads; methods of parallel iterators begin with `par_` or `into_par_`.
const POOL_METHODS: &[&str] = &["install", "in_place_scope", "broadcast"];
/// Functions of rayon that do not wait.
const HARMLESS_FUNCTIONS: &[&str] = &["current_num_threads", "current_thread_index", "yield_now"];
/// Methods of the standard library; methods of this workspace with the same names are ignored.
const STANDARD_METHODS: &[&str] = &["map", "join"];

/// Returns each initialiser in these files that does parallel work, with the name of that work.
///
/// Functions are identified by name and type; a function of the same file has priority over others of its name. A
/// method call is parallel work if all methods of that name are. Tests are ignored.
pub(super) fn found(files: &[PathBuf]) -> Result<Vec<(&Path, String)>> {
    let mut functions: Functions = BTreeMap::new();
    let mut initialisers = Vec::new();
    for (number, file) in files.iter().enumerate() {
        let text = std::fs::read_to_string(file).with_context(|| file.display().to_string())?;
        let parsed = syn::parse_file(&text).with_context(|| file.display().to_string())?;
        let mut reader = FunctionReader::default();
        reader.visit_file(&parsed);
        let is_free = |name: &str| !name.contains([':', '.']);
        let of_file = |name: &str| format!("{name}@{number}");
        let resolved = |calls: BTreeSet<String>| -> BTreeSet<String> {
            let is_own = |name: &str| is_free(name) && reader.functions.contains_key(name);
            calls.into_iter().map(|name| if is_own(&name) { of_file(&name) } else { name }).collect()
        };
        initialisers.extend(reader.initialisers.iter().map(|calls| (&**file, resolved(calls.clone()))));
        for (name, bodies) in &reader.functions {
            let bodies: Vec<_> = bodies.iter().cloned().map(resolved).collect();
            if is_free(name) {
                functions.entry(of_file(name)).or_default().extend(bodies.clone());
            }
            functions.entry(name.clone()).or_default().extend(bodies);
        }
    }
    let parallel = parallel(&functions);
    let broken = |(file, calls): (_, BTreeSet<String>)| {
        let name = calls.into_iter().find(|call| parallel.contains(call))?;
        Some((file, name.split('@').next().unwrap_or_default().to_owned()))
    };
    Ok(initialisers.into_iter().filter_map(broken).collect())
}

/// The names that each function calls, by its name: `f`, `f@N` in file N, `Type::f`, and `.f` for methods.
type Functions = BTreeMap<String, Vec<BTreeSet<String>>>;

/// The name that stands for waiting for the threads of a pool.
const POOL: &str = "rayon";

/// Returns the names of functions that do parallel work, directly or through other functions.
fn parallel(functions: &Functions) -> BTreeSet<String> {
    let mut parallel = BTreeSet::from([POOL.to_owned()]);
    loop {
        let is_parallel = |calls: &BTreeSet<String>| !calls.is_disjoint(&parallel);
        let new = functions.iter().filter(|(name, bodies)| {
            !parallel.contains(*name)
                && if name.starts_with('.') {
                    bodies.iter().all(is_parallel)
                } else {
                    bodies.iter().any(is_parallel)
                }
        });
        let new: Vec<String> = new.map(|(name, _)| name.clone()).collect();
        if new.is_empty() {
            return parallel;
        }
        parallel.extend(new);
    }
}

/// Reads functions and initialisers.
#[derive(Default)]
struct FunctionReader {
    functions: Functions,
    /// The names that each initialiser calls.
    initialisers: Vec<BTreeSet<String>>,
    /// The type of the current `impl` block.
    own_type: String,
    /// The names that each closure of the function calls, by the variable of the closure.
    closures: BTreeMap<String, BTreeSet<String>>,
    /// Parameters and variables of the function.
    variables: BTreeSet<String>,
}

impl FunctionReader {
    fn calls(&self, read: impl FnOnce(&mut Calls<'_>)) -> BTreeSet<String> {
        let mut calls = Calls { own_type: &self.own_type, names: BTreeSet::new() };
        read(&mut calls);
        // A variable's calls are known only for closures, which are read at their definition.
        calls.names.retain(|name| !self.variables.contains(name));
        calls.names
    }

    fn enter_function(&mut self, read: impl FnOnce(&mut Variables)) {
        let mut variables = Variables(BTreeSet::new());
        read(&mut variables);
        self.variables = variables.0;
        self.closures.clear();
    }

    /// Adds the argument of an initialising call: a closure, or the name of a closure or function.
    fn add_initialiser(&mut self, argument: &Expr) {
        let mut named = BTreeSet::new();
        let mut all = Calls { own_type: &self.own_type, names: BTreeSet::new() };
        match argument {
            Expr::Path(path) => all.add_path(&path.path),
            other => all.visit_expr(other),
        }
        for name in &all.names {
            named.extend(self.closures.get(name).into_iter().flatten().cloned());
        }
        all.names.retain(|name| !self.variables.contains(name));
        let mut calls = all.names;
        calls.extend(named);
        self.initialisers.push(calls);
    }
}

impl<'ast> Visit<'ast> for FunctionReader {
    fn visit_item(&mut self, item: &'ast Item) {
        if !attributes(item).is_some_and(is_test) {
            visit::visit_item(self, item);
        }
    }

    fn visit_item_impl(&mut self, item: &'ast ItemImpl) {
        let of = match &*item.self_ty {
            Type::Path(path) => path.path.segments.last().map(|s| s.ident.to_string()),
            _ => None,
        };
        let outer = std::mem::replace(&mut self.own_type, of.unwrap_or_default());
        visit::visit_item_impl(self, item);
        self.own_type = outer;
    }

    fn visit_item_fn(&mut self, item: &'ast ItemFn) {
        self.enter_function(|variables| variables.visit_item_fn(item));
        let calls = self.calls(|calls| calls.visit_block(&item.block));
        self.functions.entry(item.sig.ident.to_string()).or_default().push(calls);
        visit::visit_item_fn(self, item);
    }

    fn visit_impl_item_fn(&mut self, item: &'ast ImplItemFn) {
        if is_test(&item.attrs) {
            return;
        }
        self.enter_function(|variables| variables.visit_impl_item_fn(item));
        let calls = self.calls(|calls| calls.visit_block(&item.block));
        let name = &item.sig.ident;
        if item.sig.receiver().is_some() {
            self.functions.entry(format!(".{name}")).or_default().push(calls.clone());
        }
        self.functions.entry(format!("{}::{name}", self.own_type)).or_default().push(calls);
        visit::visit_impl_item_fn(self, item);
    }

    fn visit_local(&mut self, local: &'ast Local) {
        if let (Pat::Ident(name), Some(init)) = (&local.pat, &local.init)
            && let Expr::Closure(closure) = &*init.expr
        {
            let calls = self.calls(|calls| calls.visit_expr(&closure.body));
            self.closures.insert(name.ident.to_string(), calls);
        }
        visit::visit_local(self, local);
    }

    fn visit_expr_method_call(&mut self, call: &'ast ExprMethodCall) {
        if INITIALISING_METHODS.iter().any(|name| call.method == name) {
            call.args.iter().for_each(|argument| self.add_initialiser(argument));
        }
        visit::visit_expr_method_call(self, call);
    }

    fn visit_expr_call(&mut self, call: &'ast ExprCall) {
        if let Expr::Path(path) = &*call.func {
            let names: Vec<String> = path.path.segments.iter().map(|s| s.ident.to_string()).collect();
            let is_initialised = match &names[..] {
                [.., of, new] if new == "new" => INITIALISED_TYPES.contains(&of.as_str()),
                [.., last] => INITIALISING_METHODS.contains(&last.as_str()),
                [] => false,
            };
            if is_initialised {
                call.args.iter().for_each(|argument| self.add_initialiser(argument));
            }
        }
        visit::visit_expr_call(self, call);
    }
}

/// Collects parameters and variables.
struct Variables(BTreeSet<String>);

impl<'ast> Visit<'ast> for Variables {
    fn visit_pat_ident(&mut self, name: &'ast syn::PatIdent) {
        self.0.insert(name.ident.to_string());
        visit::visit_pat_ident(self, name);
    }
}

/// Collects the names that code calls.
struct Calls<'a> {
    own_type: &'a str,
    names: BTreeSet<String>,
}

impl Calls<'_> {
    fn add_path(&mut self, path: &syn::Path) {
        let names: Vec<String> = path.segments.iter().map(|s| s.ident.to_string()).collect();
        match &names[..] {
            [first, .., last] if first == POOL => {
                if !HARMLESS_FUNCTIONS.contains(&last.as_str())
                    && !names.iter().any(|n| n == "ThreadPoolBuilder")
                {
                    self.names.insert(POOL.to_owned());
                }
            }
            [.., of, name] if of == "Self" => drop(self.names.insert(format!("{}::{name}", self.own_type))),
            [.., of, name] if of.starts_with(char::is_uppercase) => {
                _ = self.names.insert(format!("{of}::{name}"));
            }
            [.., name] => drop(self.names.insert(name.clone())),
            [] => {}
        }
    }
}

impl<'ast> Visit<'ast> for Calls<'_> {
    fn visit_item(&mut self, item: &'ast Item) {
        if !attributes(item).is_some_and(is_test) {
            visit::visit_item(self, item);
        }
    }

    fn visit_expr_call(&mut self, call: &'ast ExprCall) {
        if let Expr::Path(path) = &*call.func {
            self.add_path(&path.path);
        }
        visit::visit_expr_call(self, call);
    }

    /// Functions are also passed as arguments; a single name is mostly a variable.
    fn visit_expr_path(&mut self, path: &'ast syn::ExprPath) {
        if path.path.segments.len() > 1 {
            self.add_path(&path.path);
        }
        visit::visit_expr_path(self, path);
    }

    fn visit_expr_method_call(&mut self, call: &'ast ExprMethodCall) {
        let name = call.method.to_string();
        if name.starts_with("par_") || name.starts_with("into_par_") || POOL_METHODS.contains(&name.as_str())
        {
            self.names.insert(POOL.to_owned());
        } else if !STANDARD_METHODS.contains(&name.as_str()) {
            self.names.insert(format!(".{name}"));
        }
        visit::visit_expr_method_call(self, call);
    }

    fn visit_macro(&mut self, call: &'ast syn::Macro) {
        if let Ok(arguments) = call.parse_body_with(Punctuated::<Expr, Token![,]>::parse_terminated) {
            arguments.iter().for_each(|argument| self.visit_expr(argument));
        }
        visit::visit_macro(self, call);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Returns the parallel work in the initialisers of a source text.
    fn works(text: &str) -> Vec<String> {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.rs");
        std::fs::write(&path, text).unwrap();
        found(&[path]).unwrap().into_iter().map(|(_, work)| work).collect()
    }

    #[test]
    fn parallel_work_is_found_in_initialisers() {
        let direct = [
            "fn f(c: &C) { c.get_or_init(|| v.par_iter().sum()); }",
            "fn f(c: &C) { c.get_or_try_init(|| rayon::join(a, b)); }",
            "fn f(c: &C) { c.call_once(|| rayon::scope(|s| s.spawn(g))); }",
            "static L: LazyLock<u8> = LazyLock::new(|| pool.install(g));",
            "fn f(c: &C) { OnceLock::get_or_init(c, || assert!(v.par_iter().all(g))); }",
        ];
        for text in direct {
            assert_eq!(works(text), ["rayon"], "{text}");
        }
    }

    #[test]
    fn parallel_work_is_found_through_functions() {
        let below =
            "impl Tree { fn new() { sort(); } fn of(self) { Self::new() } } fn sort() { v.par_sort(); }";
        for (call, work) in [
            ("|| sort()", "sort"),
            ("|| core::tree::sort()", "sort"),
            ("|| Tree::new()", "Tree::new"),
            ("Tree::new", "Tree::new"),
            ("|| x.of()", ".of"),
        ] {
            assert_eq!(works(&format!("{below} fn f(c: &C) {{ c.get_or_init({call}); }}")), [work], "{call}");
        }
        let named = "fn f(c: &C) { let make = || sort(); c.get_or_init(make); }";
        assert_eq!(works(&format!("{below} {named}")), ["sort"]);
    }

    #[test]
    fn other_work_is_not_found() {
        for text in [
            // The value is computed before.
            "fn f(c: &C) { let made = v.par_iter().sum(); c.get_or_init(|| made); }",
            "fn f(c: &C) { c.get_or_init(|| rayon::current_num_threads()); }",
            "fn f(c: &C) { c.get_or_init(|| v.iter().sum()); v.par_iter().sum() }",
            // A variable, and a function of the same file, with the name of a parallel function elsewhere.
            "fn sort() { v.par_sort() } fn f(c: &C) { let sort = 1; c.get_or_init(|| g(sort)); }",
            "mod a { fn f(c: &C) { c.get_or_init(|| Plain::sort()); } } impl Tree { fn sort() { v.par_sort() } }",
            "fn sort() { v.par_sort() } fn f(c: &C, sort: impl Fn()) { c.get_or_init(|| sort()); }",
            // One method of this name is not parallel.
            "impl A { fn go(&self) { v.par_iter(); } } impl B { fn go(&self) {} } fn f(c: &C) { c.get_or_init(|| b.go()); }",
            "#[cfg(test)] mod tests { fn f(c: &C) { c.get_or_init(|| v.par_iter().sum()); } }",
        ] {
            assert_eq!(works(text), Vec::<String>::new(), "{text}");
        }
    }
}
