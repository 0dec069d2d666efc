//! Dependency cycles of files within a crate: a file uses an item of another file, and so on back to the first.
//! Ignores tests, re-exports (`pub use`) that the file does not use itself, and macros whose arguments are not
//! expressions.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

use anyhow::{Context, Result};
use syn::punctuated::Punctuated;
use syn::visit::{self, Visit};
use syn::{Attribute, Expr, Item, Token, UseTree, Visibility};

/// A path of names, from the root of the crate for modules.
type Names = Vec<String>;

/// A module: its file, its child modules, and the names that `use` imports.
#[derive(Default)]
struct Module {
    file: usize,
    children: BTreeSet<String>,
    imports: BTreeMap<String, Names>,
    /// Functions of this module: an imported module can have the same name.
    functions: BTreeSet<String>,
    /// All paths in its code, including those of `use`.
    named: Vec<Names>,
}

/// The modules of a crate.
#[derive(Default)]
struct Crate {
    files: Vec<PathBuf>,
    modules: BTreeMap<Names, Module>,
}

/// Files in a dependency cycle, sorted by path, and the dependencies between them: user, used file, items.
pub(super) struct Cycle {
    pub(super) files: Vec<PathBuf>,
    pub(super) dependencies: Vec<(PathBuf, PathBuf, Vec<String>)>,
}

/// Finds the cycles of the crate with this root file.
pub(super) fn cycles(root: &Path) -> Result<Vec<Cycle>> {
    let mut all = Crate::default();
    all.read(root, root.parent().context("the root file has no folder")?, Vec::new())?;
    let arrows = all.uses();
    let plain: Vec<BTreeSet<usize>> = arrows.iter().map(|to| to.keys().copied().collect()).collect();
    let groups = strongly_connected(&plain).into_iter().filter(|group| group.len() > 1);
    let cycle_of = |mut group: Vec<usize>| {
        group.sort_by_key(|&file| &all.files[file]);
        let dependencies_of = |&from: &usize| {
            let inside = arrows[from].iter().filter(|(to, _)| group.contains(to));
            let path = |file: usize| all.files[file].clone();
            inside.map(move |(&to, names)| (path(from), path(to), names.iter().cloned().collect()))
        };
        Cycle {
            files: group.iter().map(|&file| all.files[file].clone()).collect(),
            dependencies: group.iter().flat_map(dependencies_of).collect(),
        }
    };
    let mut cycles: Vec<Cycle> = groups.map(cycle_of).collect();
    cycles.sort_by(|a, b| a.files.cmp(&b.files));
    Ok(cycles)
}

impl Crate {
    /// Reads a file as the module of this name, and the files of its child modules, which are in `folder`.
    fn read(&mut self, file: &Path, folder: &Path, name: Names) -> Result<()> {
        let text = std::fs::read_to_string(file).with_context(|| file.display().to_string())?;
        let parsed = syn::parse_file(&text).with_context(|| file.display().to_string())?;
        let number = self.files.len();
        self.files.push(file.to_path_buf());
        self.enter(number, folder, name, &parsed.items)
    }

    fn enter(&mut self, file: usize, folder: &Path, name: Names, items: &[Item]) -> Result<()> {
        let mut module = Module { file, ..Module::default() };
        for item in items {
            let Item::Mod(inner) = item else {
                if let Item::Fn(own) = item {
                    module.functions.insert(own.sig.ident.to_string());
                }
                Reader(&mut module).visit_item(item);
                continue;
            };
            if is_test(&inner.attrs) {
                continue;
            }
            let word = inner.ident.to_string();
            module.children.insert(word.clone());
            let (below, under) = ([name.clone(), vec![word.clone()]].concat(), folder.join(&word));
            match &inner.content {
                Some((_, items)) => self.enter(file, &under, below, items)?,
                None => {
                    let flat = folder.join(format!("{word}.rs"));
                    let file = if flat.is_file() { flat } else { under.join("mod.rs") };
                    self.read(&file, &under, below)?;
                }
            }
        }
        self.modules.insert(name, module);
        Ok(())
    }

    /// Returns for each file the other files that it uses, with the items.
    fn uses(&self) -> Vec<BTreeMap<usize, BTreeSet<String>>> {
        let mut arrows = vec![BTreeMap::<usize, BTreeSet<String>>::new(); self.files.len()];
        for (name, module) in &self.modules {
            for (to, item) in module.named.iter().filter_map(|path| self.item(name, path, 0)) {
                if to != module.file {
                    arrows[module.file].entry(to).or_default().insert(item);
                }
            }
        }
        arrows
    }

    /// Resolves a path as seen from a module to an item and its file; `None` for modules themselves and for
    /// other crates.
    fn item(&self, from: &Names, path: &[String], depth: usize) -> Option<(usize, String)> {
        let (first, mut rest) = path.split_first()?;
        let here = &self.modules[from];
        let mut at = match first.as_str() {
            "crate" => Vec::new(),
            "self" => from.clone(),
            "super" => from[..from.len().checked_sub(1)?].to_vec(),
            word if here.children.contains(word) || here.imports.contains_key(word) => {
                rest = path;
                from.clone()
            }
            _ => return None,
        };
        while let Some((word, further)) = rest.split_first() {
            let module = &self.modules[&at];
            if word == "super" {
                at.pop();
            } else if further.is_empty() && module.functions.contains(word) {
                return Some((module.file, word.clone()));
            } else if module.children.contains(word) {
                at.push(word.clone());
            } else if let Some(import) = module.imports.get(word) {
                // (Imports that refer to each other in a cycle come from other crates.)
                let whole = [&import[..], further].concat();
                return if depth < 16 { self.item(&at, &whole, depth + 1) } else { None };
            } else {
                return Some((module.file, word.clone()));
            }
            rest = further;
        }
        None
    }
}

/// Collects the paths in the code of a module.
struct Reader<'a>(&'a mut Module);

impl Reader<'_> {
    fn import(&mut self, tree: &UseTree, before: &[String]) {
        match tree {
            UseTree::Path(path) => self.import(&path.tree, &[before, &[path.ident.to_string()]].concat()),
            UseTree::Group(group) => group.items.iter().for_each(|tree| self.import(tree, before)),
            UseTree::Name(name) if name.ident == "self" => {
                let alias = before.last().cloned().unwrap_or_default();
                self.add_import(alias, before.to_vec());
            }
            UseTree::Name(name) => {
                let alias = name.ident.to_string();
                self.add_import(alias.clone(), [before, &[alias]].concat());
            }
            UseTree::Rename(name) => {
                self.add_import(name.rename.to_string(), [before, &[name.ident.to_string()]].concat());
            }
            // A glob import depends on its module, whatever it imports.
            UseTree::Glob(_) => self.0.named.push([before, &["*".to_owned()]].concat()),
        }
    }

    fn add_import(&mut self, alias: String, path: Names) {
        self.0.named.push(path.clone());
        // (A name that refers to itself comes from another crate.)
        if path[..] != [alias.clone()] {
            self.0.imports.insert(alias, path);
        }
    }
}

impl<'ast> Visit<'ast> for Reader<'_> {
    fn visit_item(&mut self, item: &'ast Item) {
        if !attributes(item).is_some_and(is_test) {
            visit::visit_item(self, item);
        }
    }
    fn visit_impl_item_fn(&mut self, item: &'ast syn::ImplItemFn) {
        if !is_test(&item.attrs) {
            visit::visit_impl_item_fn(self, item);
        }
    }
    fn visit_item_use(&mut self, item: &'ast syn::ItemUse) {
        if item.leading_colon.is_none() {
            let named = self.0.named.len();
            self.import(&item.tree, &[]);
            if !matches!(item.vis, Visibility::Inherited) {
                self.0.named.truncate(named);
            }
        }
    }
    fn visit_path(&mut self, path: &'ast syn::Path) {
        if path.leading_colon.is_none() {
            self.0.named.push(path.segments.iter().map(|s| s.ident.to_string()).collect());
        }
        visit::visit_path(self, path);
    }
    fn visit_macro(&mut self, call: &'ast syn::Macro) {
        if let Ok(arguments) = call.parse_body_with(Punctuated::<Expr, Token![,]>::parse_terminated) {
            arguments.iter().for_each(|argument| Reader(self.0).visit_expr(argument));
        }
        visit::visit_macro(self, call);
    }
}

pub(super) fn attributes(item: &Item) -> Option<&[Attribute]> {
    match item {
        Item::Const(x) => Some(&x.attrs),
        Item::Enum(x) => Some(&x.attrs),
        Item::Fn(x) => Some(&x.attrs),
        Item::Impl(x) => Some(&x.attrs),
        Item::Mod(x) => Some(&x.attrs),
        Item::Static(x) => Some(&x.attrs),
        Item::Struct(x) => Some(&x.attrs),
        Item::Trait(x) => Some(&x.attrs),
        Item::Type(x) => Some(&x.attrs),
        Item::Use(x) => Some(&x.attrs),
        _ => None,
    }
}

/// Returns whether an item exists only in tests.
pub(super) fn is_test(attributes: &[Attribute]) -> bool {
    let is_cfg_test = |a: &Attribute| {
        a.path().is_ident("cfg") && a.parse_args::<syn::Path>().is_ok_and(|path| path.is_ident("test"))
    };
    attributes.iter().any(is_cfg_test)
}

/// Returns the strongly connected components of a graph. [Tarjan 1972]
fn strongly_connected(arrows: &[BTreeSet<usize>]) -> Vec<Vec<usize>> {
    struct Walk<'a> {
        arrows: &'a [BTreeSet<usize>],
        index: Vec<Option<usize>>,
        low: Vec<usize>,
        is_open: Vec<bool>,
        open: Vec<usize>,
        count: usize,
        groups: Vec<Vec<usize>>,
    }
    impl Walk<'_> {
        fn visit(&mut self, node: usize) {
            (self.index[node], self.low[node]) = (Some(self.count), self.count);
            self.count += 1;
            self.open.push(node);
            self.is_open[node] = true;
            for &to in &self.arrows[node] {
                match self.index[to] {
                    None => {
                        self.visit(to);
                        self.low[node] = self.low[node].min(self.low[to]);
                    }
                    Some(index) if self.is_open[to] => self.low[node] = self.low[node].min(index),
                    Some(_) => {}
                }
            }
            if Some(self.low[node]) == self.index[node] {
                let first = self.open.iter().position(|&other| other == node).unwrap_or_default();
                let group = self.open.split_off(first);
                group.iter().for_each(|&member| self.is_open[member] = false);
                self.groups.push(group);
            }
        }
    }
    let count = arrows.len();
    let mut walk = Walk {
        arrows,
        index: vec![None; count],
        low: vec![0; count],
        is_open: vec![false; count],
        open: Vec::new(),
        count: 0,
        groups: Vec::new(),
    };
    for node in 0..count {
        if walk.index[node].is_none() {
            walk.visit(node);
        }
    }
    walk.groups
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Returns the cycles of a crate with these files, by file name.
    fn found(files: &[(&str, &str)]) -> Vec<Vec<String>> {
        let folder = tempfile::tempdir().unwrap();
        for (name, text) in files {
            let path = folder.path().join(name);
            std::fs::create_dir_all(path.parent().unwrap()).unwrap();
            std::fs::write(path, text).unwrap();
        }
        let shown = |file: &PathBuf| file.strip_prefix(folder.path()).unwrap().display().to_string();
        let cycles = cycles(&folder.path().join("lib.rs")).unwrap();
        cycles.iter().map(|cycle| cycle.files.iter().map(shown).collect()).collect()
    }

    #[test]
    fn files_that_use_each_other_are_a_cycle() {
        let root = ("lib.rs", "mod a; mod b; mod c;");
        let (to_b, to_c) =
            (("a.rs", "use crate::b; fn f() { b::g() }"), ("b.rs", "use super::c::H; fn g(_: H) {}"));
        let back = ("c.rs", "mod d; pub(crate) use d::H;");
        assert_eq!(found(&[root, to_b, to_c, back, ("c/d.rs", "struct H;")]), Vec::<Vec<String>>::new());
        // Through an item that another file re-exports, which does not put that file in the cycle, and through the
        // arguments of a macro.
        let closing = ("c/d.rs", "struct H; fn i() { assert!(crate::a::f()) }");
        assert_eq!(found(&[root, to_b, to_c, back, closing]), [["a.rs", "b.rs", "c/d.rs"]]);
        // Tests do not count.
        let tested = ("c/d.rs", "struct H; #[cfg(test)] mod tests { use crate::a::f; }");
        assert_eq!(found(&[root, to_b, to_c, back, tested]), Vec::<Vec<String>>::new());
    }

    #[test]
    fn a_function_is_found_despite_an_imported_module_of_its_name() {
        let root = ("lib.rs", "mod run; mod cluster;");
        let top = ("run.rs", "use crate::cluster; pub fn run() { cluster::run() } pub fn goal() {}");
        let below = ("cluster.rs", "use crate::run; pub fn run() { run::goal() }");
        assert_eq!(found(&[root, top, below]), [["cluster.rs", "run.rs"]]);
    }

    #[test]
    fn a_module_and_its_child_are_a_cycle_if_each_uses_items_of_the_other() {
        let root = ("lib.rs", "mod a; struct S(T); pub use a::T;");
        assert_eq!(found(&[root, ("a.rs", "pub struct T(super::S);")]), [["a.rs", "lib.rs"]]);
        assert_eq!(found(&[root, ("a.rs", "pub struct T(u8);")]), Vec::<Vec<String>>::new());
    }
}
