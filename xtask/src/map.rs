//! The map of the sources: a tree of crates, folders and files, with the first sentence of the head of each file.

use std::collections::BTreeMap;
use std::io::Write;

use anyhow::{Context, Result, ensure};

use crate::absolute_path;
use crate::files::{shown, tree};

/// Maximum columns of a line of the map, as in the sources.
const COLUMNS: usize = 120;
/// Maximum characters of the first sentence of a head: about two lines of the map (guessed).
const SENTENCE_MAX: usize = 200;

/// Prints the map of all sources, or of one crate, folder or file.
pub(crate) fn run(args: &[String]) -> Result<()> {
    ensure!(args.len() <= 1, "usage: cargo xtask map [CRATE|FOLDER]");
    let mut files = Vec::new();
    for path in tree()? {
        if path.extension().is_some_and(|e| e == "rs") || path.ends_with("Cargo.toml") {
            let text = std::fs::read_to_string(&path).with_context(|| shown(&path))?;
            files.push((shown(&path), text));
        }
    }
    let tree = Node::of(files);
    let part = match args.first() {
        None => &tree,
        Some(name) => tree
            .of_crate(name)
            .or_else(|| tree.at(&shown(&absolute_path(name))))
            .with_context(|| format!("the map has no crate, folder or file called {name}"))?,
    };
    // A reader such as `head` may close the pipe before the end.
    _ = std::io::stdout().write_all(part.map().as_bytes());
    Ok(())
}

/// Returns the first sentence of the head of a file, on one line.
fn sentence(text: &str) -> Option<String> {
    let lines = text.lines().map_while(|line| line.strip_prefix("//!").map(str::trim));
    let paragraph: Vec<&str> = lines.take_while(|line| !line.is_empty()).collect();
    let paragraph = paragraph.join(" ");
    // A full stop within a sentence, as in `et al. 1998`, is not followed by a capital letter, code or a bracket.
    let is_end =
        |at: &usize| paragraph[at + 2..].starts_with(|c: char| c.is_uppercase() || "`[(".contains(c));
    let end =
        paragraph.match_indices(". ").map(|(at, _)| at).find(is_end).map_or(paragraph.len(), |at| at + 1);
    (!paragraph.is_empty()).then(|| paragraph[..end].to_owned())
}

/// Returns the reason if the head of a file cannot be its entry in the map.
pub(crate) fn fault(text: &str) -> Option<String> {
    let Some(sentence) = sentence(text) else { return Some("does not begin with a head (`//! …`)".into()) };
    let count = sentence.chars().count();
    if !sentence.ends_with('.') {
        Some("has a head whose first sentence has no full stop".into())
    } else if sentence.starts_with(char::is_lowercase) {
        Some("has a head that does not begin with a capital letter".into())
    } else if sentence.contains("](") {
        Some("has a link in the first sentence of its head, which the map would print unresolved".into())
    } else if count > SENTENCE_MAX {
        Some(format!("has {count} characters in the first sentence of its head, of at most {SENTENCE_MAX}"))
    } else {
        None
    }
}

/// A file with the files below it, or a folder.
#[derive(Default)]
struct Node {
    /// Name of the file, or of the folder with a slash.
    name: String,
    /// Name of the package whose folder this is.
    package: Option<String>,
    /// First sentence of the head, without its full stop.
    entry: String,
    /// By name, files without their extension: a module and the folder of its files are one node.
    children: BTreeMap<String, Node>,
}

impl Node {
    /// Builds the tree of some files, each with its path and its text.
    fn of(mut files: Vec<(String, String)>) -> Self {
        let mut tree = Self::default();
        files.sort();
        for (path, text) in &files {
            tree.add(path, text);
        }
        tree
    }

    fn add(&mut self, path: &str, text: &str) {
        let (folder, name) = path.rsplit_once('/').unwrap_or(("", path));
        if name == "Cargo.toml" {
            let package = text.lines().find_map(|line| line.strip_prefix("name = \"")?.strip_suffix('"'));
            self.below(folder).package = package.map(str::to_owned);
            return;
        }
        let node = match (name, folder.strip_suffix("/src")) {
            ("mod.rs", _) => self.below(folder),
            ("lib.rs", Some(package)) => self.below(package),
            // The program stands for the package only if there is no library.
            ("main.rs", Some(package)) if self.below(package).entry.is_empty() => self.below(package),
            _ => self.below(path),
        };
        node.entry = sentence(text).unwrap_or_default().trim_end_matches('.').to_owned();
    }

    /// Returns the node of a path, after adding it and the folders above it.
    fn below(&mut self, path: &str) -> &mut Self {
        let mut node = self;
        for name in path.split('/').filter(|name| !name.is_empty()) {
            let file = name.strip_suffix(".rs");
            node = node.children.entry(file.unwrap_or(name).to_owned()).or_default();
            if file.is_some() {
                name.clone_into(&mut node.name);
            } else if node.name.is_empty() {
                node.name = format!("{name}/");
            }
        }
        node
    }

    /// Finds a crate by the name of its package or of its folder.
    fn of_crate(&self, word: &str) -> Option<&Self> {
        let is_named = |package: &String| package == word || self.name.trim_end_matches('/') == word;
        if self.package.as_ref().is_some_and(is_named) {
            return Some(self);
        }
        self.children.values().find_map(|child| child.of_crate(word))
    }

    /// Finds a file or a folder by its path.
    fn at(&self, path: &str) -> Option<&Self> {
        let mut names = path.split('/').filter(|name| !name.is_empty());
        names.try_fold(self, |node, name| node.children.get(name.strip_suffix(".rs").unwrap_or(name)))
    }

    /// Returns the map as text: names in one column, entries in the next one.
    fn map(&self) -> String {
        let mut rows = Vec::new();
        self.rows("", &mut rows);
        let column = 2 + rows.iter().map(|(name, _)| name.chars().count()).max().unwrap_or_default();
        let mut map = String::new();
        for (mut line, entry) in rows {
            for word in entry.split_whitespace() {
                let gap = column.saturating_sub(line.chars().count()).max(1);
                if line.chars().count() + gap + word.chars().count() <= COLUMNS {
                    line += &" ".repeat(gap);
                } else {
                    map += &line;
                    map += "\n";
                    line = " ".repeat(column);
                }
                line += word;
            }
            map += &line;
            map += "\n";
        }
        map
    }

    /// Adds the rows of this node and its descendants: the indented name, and the entry.
    fn rows<'a>(&'a self, indent: &str, rows: &mut Vec<(String, &'a str)>) {
        // The root has no name: it has no row, and its children are not indented.
        let mut below = indent.to_owned();
        if !self.name.is_empty() {
            let package = self.package.as_ref().map(|package| format!(" ({package})")).unwrap_or_default();
            rows.push((format!("{indent}{}{package}", self.name), &self.entry));
            below += "  ";
        }
        for child in self.children.values() {
            child.rows(&below, rows);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Two packages: a library with a module in several files, and a program.
    fn tree() -> Node {
        let long = format!("//! {} end.\n", ["word"; 30].join(" "));
        let files = [
            ("Cargo.toml", "[workspace]\n"),
            ("crates/ball/Cargo.toml", "[package]\nname = \"a-ball\"\n"),
            ("crates/ball/src/lib.rs", "//! Balls\n//! of all sizes. Not cubes.\n//!\n//! More.\n"),
            ("crates/ball/src/roll/slope.rs", "//! Slopes, as in [Doe et al. 1998]. Steep ones.\n"),
            ("crates/ball/src/roll.rs", "//! Rolling.\nmod slope;\n"),
            ("crates/ball/src/throw.rs", &long),
            ("crates/ball/tests/field/mod.rs", "//! A field.\n"),
            ("tool/Cargo.toml", "[package]\nname = \"tool\"\n"),
            ("tool/src/main.rs", "//! A tool.\n"),
        ];
        Node::of(files.map(|(path, text)| (path.to_owned(), text.to_owned())).to_vec())
    }

    #[test]
    fn a_map_has_a_row_for_each_file() {
        let words = |count: usize| ["word"; 30][..count].join(" ");
        let expected = format!(
            "\
crates/
  ball/ (a-ball)  Balls of all sizes
    src/
      roll.rs     Rolling
        slope.rs  Slopes, as in [Doe et al. 1998]
      throw.rs    {}
                  {} end
    tests/
      field/      A field
tool/ (tool)      A tool
",
            words(20),
            words(10)
        );
        assert_eq!(tree().map(), expected);
    }

    #[test]
    fn a_part_is_named_by_crate_or_by_path() {
        let tree = tree();
        let name = |node: Option<&Node>| node.map(|node| node.name.clone());
        assert_eq!(name(tree.of_crate("a-ball")).as_deref(), Some("ball/"));
        assert_eq!(name(tree.of_crate("ball")).as_deref(), Some("ball/"));
        assert_eq!(name(tree.of_crate("roll")), None);
        assert_eq!(name(tree.at("crates/ball/src/")).as_deref(), Some("src/"));
        assert_eq!(name(tree.at("crates/ball/src/gone")), None);
        // A module and the folder of its files are one node.
        let part = "roll.rs     Rolling\n  slope.rs  Slopes, as in [Doe et al. 1998]\n";
        for path in ["crates/ball/src/roll", "crates/ball/src/roll.rs"] {
            assert_eq!(tree.at(path).map(Node::map).as_deref(), Some(part));
        }
    }

    #[test]
    fn unusable_heads_are_found() {
        assert_eq!(fault("//! One ball.\n"), None);
        assert_eq!(fault("//! `ball`, and more.\n//!\n//! No full stop here\n"), None);
        let long = format!("//! {}.\n", "W".repeat(SENTENCE_MAX));
        for (text, reason) in [
            ("use std::fs;\n//! One ball.\n", "does not begin"),
            ("//! One ball\n", "no full stop"),
            ("//! one ball.\n", "capital letter"),
            ("//! One [ball](crate::ball).\n", "link"),
            (&*long, "201 characters"),
        ] {
            assert!(fault(text).is_some_and(|fault| fault.contains(reason)), "{text}");
        }
    }
}
