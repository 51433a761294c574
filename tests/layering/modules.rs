//! The modules of a crate and the paths between them: a reader of `mod`, `use` and paths, not a
//! compiler, but enough for a crate that names things by plain paths.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::{Path, PathBuf};

/// Path of a module below the crate's root: `["score", "cells"]`.
pub(crate) type Id = Vec<String>;

/// One file.
pub(crate) struct Module {
    /// Names of its items.
    defined: BTreeSet<String>,
    uses: Vec<Use>,
}

/// One path, of a `use` or of an expression.
struct Use {
    path: Vec<String>,
    /// Name that a `use` gives it; `*` for a glob.
    bound: Option<String>,
    /// `pub use`, with no other mention of the name in the file.
    facade: bool,
}

/// A use of one file's definition in another.
#[derive(Clone, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) struct Edge {
    pub(crate) from: Id,
    pub(crate) to: Id,
    /// First segment that is not a module; empty for a module itself.
    pub(crate) name: String,
    /// True if a parent re-exports a definition of its child.
    pub(crate) facade: bool,
}

impl Module {
    fn defines(&self, name: &str) -> bool {
        self.defined.contains(name)
    }
}

pub(crate) struct Crate(pub(crate) BTreeMap<Id, Module>);

impl Crate {
    pub(crate) fn read(root: &Path) -> Self {
        let mut modules = BTreeMap::new();
        read(root, Vec::new(), &mut modules);
        Self(modules)
    }

    /// All uses of one file by another, each resolved to the file that defines the name.
    pub(crate) fn edges(&self) -> BTreeSet<Edge> {
        let mut edges = BTreeSet::new();
        for (from, module) in &self.0 {
            for used in &module.uses {
                let Some((to, name)) = self.resolve(from, &used.path, 0) else {
                    continue;
                };
                if to != *from {
                    let facade = used.facade && to.starts_with(from);
                    let from = from.clone();
                    edges.insert(Edge {
                        from,
                        to,
                        name,
                        facade,
                    });
                }
            }
        }
        edges
    }

    /// The module that defines the target of `path` in `module`, and the name; `None` for other
    /// crates.
    fn resolve(&self, module: &[String], path: &[String], depth: usize) -> Option<(Id, String)> {
        let mut here = module.to_vec();
        let mut rest = path;
        match path.first()?.as_str() {
            "crate" => here.clear(),
            "self" => {}
            "super" => {
                here.pop();
                while rest.get(1).is_some_and(|segment| segment == "super") {
                    here.pop();
                    rest = &rest[1..];
                }
            }
            first => {
                here.push(first.to_owned());
                if !self.0.contains_key(&here) {
                    return None;
                }
            }
        }
        rest = &rest[1..];
        while let Some((segment, after)) = rest.split_first() {
            here.push(segment.clone());
            if self.0.contains_key(&here) {
                rest = after;
                continue;
            }
            here.pop();
            let (file, name) = self.definition(&here, segment, depth);
            // A module under another name: the rest of the path is below it.
            if name.is_empty() && !after.is_empty() && depth <= 8 {
                (here, rest) = (file, after);
                continue;
            }
            return Some((file, name));
        }
        Some((here, String::new()))
    }

    /// Origin of `name`, found in `module`.
    fn definition(&self, module: &Id, name: &str, depth: usize) -> (Id, String) {
        let here = (module.clone(), name.to_owned());
        if depth > 8 || self.0[module].defines(name) {
            return here;
        }
        for used in &self.0[module].uses {
            let found = match used.bound.as_deref() {
                Some(bound) if bound == name => self.resolve(module, &used.path, depth + 1),
                Some("*") => self
                    .resolve(module, &used.path, depth + 1)
                    .map(|(target, _)| self.definition(&target, name, depth + 1))
                    .filter(|(target, name)| self.0[target].defines(name)),
                _ => None,
            };
            if let Some(found) = found {
                return found;
            }
        }
        here
    }
}

/// Reads the file of module `id` and, below it, those of its children.
fn read(file: &Path, id: Id, modules: &mut BTreeMap<Id, Module>) {
    let text = fs::read_to_string(file).unwrap_or_else(|e| panic!("{}: {e}", file.display()));
    let code = code(&text);
    for (name, child) in children(file, &code, &text) {
        read(&child, [&id[..], &[name]].concat(), modules);
    }
    let uses = uses(&tokens(&code));
    let defined = definitions(&code).into_iter().map(str::to_owned).collect();
    modules.insert(id, Module { defined, uses });
}

/// Names and files of the modules that `code`, the stripped `text` of `file`, declares.
pub(crate) fn children(file: &Path, code: &str, text: &str) -> Vec<(String, PathBuf)> {
    let folder = file.parent().unwrap();
    let stem = file.file_stem().unwrap().to_str().unwrap();
    let is_root = (folder.ends_with("tests") && text.contains("mod "))
        || ["lib", "main", "mod"].contains(&stem);
    let below = if is_root {
        folder.to_owned()
    } else {
        folder.join(stem)
    };
    let lines = code.lines().zip(text.lines()).collect::<Vec<_>>();
    let declared = lines.iter().enumerate().filter_map(|(i, (line, _))| {
        let name = line.trim().strip_suffix(';')?.rsplit_once("mod ")?.1;
        let attribute = i.checked_sub(1).map_or("", |i| lines[i].1).trim();
        let path = attribute
            .strip_prefix("#[path = \"")
            .and_then(|path| path.strip_suffix("\"]"));
        let nested = below.join(name).join("mod.rs");
        let child = match path {
            Some(path) => folder.join(path),
            None if nested.exists() => nested,
            None => below.join(format!("{name}.rs")),
        };
        Some((name.to_owned(), child))
    });
    declared.collect()
}

/// The names of the items at the top level of `code`.
pub(crate) fn definitions(code: &str) -> BTreeSet<&str> {
    const KINDS: [&str; 8] = [
        "fn", "struct", "enum", "trait", "type", "const", "static", "union",
    ];
    let words = tokens(code);
    let mut depth = 0;
    let mut names = BTreeSet::new();
    for pair in words.windows(2) {
        match pair[0] {
            "{" => depth += 1,
            "}" => depth -= 1,
            kind if depth == 0 && KINDS.contains(&kind) => {
                names.insert(pair[1]);
            }
            _ => {}
        }
    }
    names
}

/// `text` with comments and literals replaced by spaces.
pub(crate) fn without_texts(text: &str) -> String {
    let mut code = String::with_capacity(text.len());
    let mut rest = text;
    while let Some(first) = rest.chars().next() {
        let length = skipped(rest, code.chars().next_back());
        if length == 0 {
            code.push(first);
            rest = &rest[first.len_utf8()..];
        } else {
            let blank = |c| if c == '\n' { '\n' } else { ' ' };
            code.extend(rest[..length].chars().map(blank));
            rest = &rest[length..];
        }
    }
    code
}

/// [`without_texts`] without items for tests.
pub(crate) fn code(text: &str) -> String {
    let mut code = without_texts(text);
    while let Some(start) = ["#[cfg(test)]", "#[cfg(all(test"]
        .iter()
        .find_map(|a| code.find(a))
    {
        let end = start + item(&code[start..]);
        let blank = code[start..end]
            .chars()
            .map(|c| if c == '\n' { '\n' } else { ' ' });
        let blank = blank.collect::<String>();
        code.replace_range(start..end, &blank);
    }
    code
}

/// Bytes of the comment or literal with which `text`, after `before`, begins; 0 for none.
fn skipped(text: &str, before: Option<char>) -> usize {
    let to = |end: &str, from: usize| {
        text[from..]
            .find(end)
            .map_or(text.len(), |i| from + i + end.len())
    };
    let word = before.is_some_and(|c| c.is_alphanumeric() || c == '_');
    if text.starts_with("//") {
        return text.find('\n').unwrap_or(text.len());
    }
    if text.starts_with("/*") {
        return to("*/", 2);
    }
    let raw = text.trim_start_matches('b');
    if !word && raw.starts_with('r') {
        let hashes = raw[1..].bytes().take_while(|b| *b == b'#').count();
        if raw[1 + hashes..].starts_with('"') {
            let start = text.len() - raw.len() + hashes + 2;
            return to(&format!("\"{}", "#".repeat(hashes)), start);
        }
    }
    let bytes = text.as_bytes();
    let quoted = |quote: u8| {
        let mut i = 1;
        while i < bytes.len() && bytes[i] != quote {
            i += if bytes[i] == b'\\' { 2 } else { 1 };
        }
        (i + 1).min(bytes.len())
    };
    match bytes[0] {
        b'"' => quoted(b'"'),
        // A lifetime has no quote after its first character.
        b'\'' if bytes.get(1) == Some(&b'\\') => quoted(b'\''),
        b'\'' => {
            let length = text[1..].chars().next().map_or(1, char::len_utf8);
            if text[1 + length..].starts_with('\'') {
                length + 2
            } else {
                0
            }
        }
        _ => 0,
    }
}

/// Bytes of the item, with its attributes, with which `code` begins.
fn item(code: &str) -> usize {
    let mut depth = 0i32;
    for (i, c) in code.char_indices() {
        match c {
            '{' | '(' | '[' => depth += 1,
            '}' | ')' | ']' => depth -= 1,
            _ => {}
        }
        if depth == 0 && (c == ';' || c == '}') {
            return i + 1;
        }
    }
    code.len()
}

/// Identifiers, `::` and all other characters but spaces.
fn tokens(code: &str) -> Vec<&str> {
    let mut tokens = Vec::new();
    let mut rest = code.trim_start();
    while let Some(first) = rest.chars().next() {
        let word = |c: char| c.is_alphanumeric() || c == '_';
        let length = match first {
            c if word(c) => rest.find(|c| !word(c)).unwrap_or(rest.len()),
            ':' if rest.starts_with("::") => 2,
            c => c.len_utf8(),
        };
        tokens.push(&rest[..length]);
        rest = rest[length..].trim_start();
    }
    tokens
}

/// The paths in a file.
fn uses(tokens: &[&str]) -> Vec<Use> {
    let mut uses = Vec::new();
    let mut imported = vec![false; tokens.len()];
    for start in 0..tokens.len() {
        // Not the `use<'_>` of a return type.
        if tokens[start] == "use" && tokens[start + 1] != "<" {
            let end = start + tokens[start..].iter().position(|t| *t == ";").unwrap_or(0);
            imported[start..end].fill(true);
            let public = start > 0 && [")", "pub"].contains(&tokens[start - 1]);
            for (path, bound) in tree(&tokens[start + 1..end]) {
                uses.push(Use {
                    path,
                    bound: Some(bound),
                    facade: public,
                });
            }
        }
    }
    for start in 0..tokens.len() {
        let begins = tokens.get(start + 1) == Some(&"::")
            && tokens[start].starts_with(|c: char| c.is_lowercase())
            && (start == 0 || !["::", "in"].contains(&tokens[start - 1]));
        if begins && !imported[start] {
            let mut path = vec![tokens[start].to_owned()];
            for pair in tokens[start + 1..].chunks_exact(2) {
                if pair[0] != "::" || !pair[1].starts_with(|c: char| c.is_alphabetic() || c == '_')
                {
                    break;
                }
                path.push(pair[1].to_owned());
            }
            uses.push(Use {
                path,
                bound: None,
                facade: false,
            });
        }
    }
    // A module's declaration is not a use of its name.
    let is_mention = |i: &usize| !imported[*i] && (*i == 0 || tokens[*i - 1] != "mod");
    let mentioned = (0..tokens.len()).filter(is_mention).map(|i| tokens[i]);
    let mentioned = mentioned.collect::<BTreeSet<_>>();
    for used in &mut uses {
        used.facade &= used
            .bound
            .as_deref()
            .is_some_and(|name| !mentioned.contains(name));
    }
    uses
}

/// The paths of a `use` tree with the names they get.
fn tree(tokens: &[&str]) -> Vec<(Vec<String>, String)> {
    let mut path = Vec::new();
    let mut i = 0;
    while i < tokens.len() {
        match tokens[i] {
            "::" => {}
            "as" => return vec![(path, tokens[i + 1].to_owned())],
            "*" => return vec![(path, "*".to_owned())],
            "{" => {
                let mut found = Vec::new();
                for part in split(&tokens[i + 1..tokens.len() - 1]) {
                    for (tail, bound) in tree(part) {
                        // `a::{self}` is `a`.
                        let itself = tail == ["self"] && !path.is_empty();
                        let tail = if itself { &[] } else { &tail[..] };
                        let parent = path.last().filter(|_| itself && bound == "self");
                        let bound = parent.cloned().unwrap_or(bound);
                        found.push(([&path[..], tail].concat(), bound));
                    }
                }
                return found;
            }
            segment => path.push(segment.to_owned()),
        }
        i += 1;
    }
    path.last()
        .cloned()
        .map(|bound| (path, bound))
        .into_iter()
        .collect()
}

/// `tokens` split at the commas outside braces.
fn split<'a, 'b>(tokens: &'a [&'b str]) -> Vec<&'a [&'b str]> {
    let mut depth = 0;
    tokens
        .split(|token| {
            match *token {
                "{" => depth += 1,
                "}" => depth -= 1,
                _ => {}
            }
            depth == 0 && *token == ","
        })
        .collect()
}
