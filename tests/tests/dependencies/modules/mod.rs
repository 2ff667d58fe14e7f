//! Which module of a crate uses which, from the tokens of its sources.
//!
//! Comments are no tokens, and doc comments are strings; what is compiled for tests alone is left out.
//! Paths that begin with `crate`, `self` or `super` count, wherever they stand. A name that a module
//! passes on by `use` or `pub use` leads further, to the module that the name comes from.

mod tests;

use proc_macro2::{Delimiter, TokenStream, TokenTree};
use std::collections::{BTreeMap, BTreeSet};
use std::fmt;
use std::path::{Path, PathBuf};

/// A module by the names of its parents and its own, from the crate's root, which is `[]`.
type Module = Vec<String>;

/// A place in a file.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Place {
    file: PathBuf,
    line: usize,
}

impl fmt::Display for Place {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}:{}", self.file.display(), self.line)
    }
}

/// Modules that use each other, with one place for each edge.
#[derive(Debug)]
pub struct Knot {
    /// The modules, each with its parents: `a::b`.
    pub modules: Vec<String>,
    edges: Vec<(String, String, Place)>,
}

impl fmt::Display for Knot {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} use each other:", self.modules.join(", "))?;
        self.edges.iter().try_for_each(|(from, to, place)| write!(f, "\n  {from} -> {to}: {place}"))
    }
}

/// A path in the sources, as it is written.
struct Mention {
    from: Module,
    path: Vec<String>,
    place: Place,
}

/// The modules of one crate.
#[derive(Default)]
pub struct Crate {
    modules: BTreeSet<Module>,
    mentions: Vec<Mention>,
    /// Where a name of a module comes from, if the module has it by `use`: module, name -> path.
    imports: BTreeMap<(Module, String), Vec<String>>,
}

impl Crate {
    /// Reads the module tree below this root, `src/lib.rs` or `src/main.rs`.
    pub fn read(root: &Path) -> Self {
        let mut all = Self::default();
        all.file(root, root.parent().unwrap(), &Vec::new());
        all
    }

    /// `folder` holds the files of the submodules.
    fn file(&mut self, file: &Path, folder: &Path, module: &Module) {
        let text = std::fs::read_to_string(file)
            .unwrap_or_else(|error| panic!("{}: {error}", file.display()));
        let tokens: TokenStream =
            text.parse().unwrap_or_else(|error| panic!("{}: {error}", file.display()));
        let tokens: Vec<TokenTree> = tokens.into_iter().collect();
        if !is_for_tests_alone(&tokens) {
            self.modules.insert(module.clone());
            self.tokens(&tokens, file, folder, module);
        }
    }

    fn tokens(&mut self, tokens: &[TokenTree], file: &Path, folder: &Path, module: &Module) {
        let place = |token| Place { file: file.to_owned(), line: line(token) };
        let mut at = 0;
        while at < tokens.len() {
            if let Some(item) = after_test_attribute(&tokens[at..]) {
                at += item + item_length(&tokens[at + item..]);
                continue;
            }
            let word = word(&tokens[at]);
            if word == "mod"
                && let Some([_, name, body]) = tokens.get(at..at + 3)
            {
                let name = self::word(name);
                let (child, files) = (below(module, &name), folder.join(&name));
                if let Some(inside) = group(body, Delimiter::Brace) {
                    self.modules.insert(child.clone());
                    self.tokens(&inside, file, &files, &child);
                } else {
                    let beside = files.with_extension("rs");
                    let beside = if beside.exists() { beside } else { files.join("mod.rs") };
                    let given = given_path(&tokens[..at]).map(|path| file.with_file_name(path));
                    self.file(&given.unwrap_or(beside), &files, &child);
                }
                at += 3;
                continue;
            }
            if word == "use" && !tokens.get(at + 1).is_some_and(|next| is(next, '<')) {
                let end = at + tokens[at..].iter().take_while(|token| !is(token, ';')).count();
                for (path, name) in leaves(&tokens[at + 1..end]) {
                    self.mention(&path, module, place(&tokens[at]));
                    self.imports.insert((module.clone(), name), path);
                }
                at = end;
            } else if ["crate", "self", "super"].contains(&&*word) {
                let end = at + path_length(&tokens[at..]);
                let path = tokens[at..end].iter().filter(|token| !is_colon(token));
                let path: Vec<String> = path.map(self::word).collect();
                self.mention(&path, module, place(&tokens[at]));
                at = end - 1;
            } else if let TokenTree::Group(group) = &tokens[at] {
                let inside: Vec<TokenTree> = group.stream().into_iter().collect();
                self.tokens(&inside, file, folder, module);
            }
            at += 1;
        }
    }

    fn mention(&mut self, path: &[String], from: &Module, place: Place) {
        if path.len() > 1 {
            self.mentions.push(Mention { from: from.clone(), path: path.to_vec(), place });
        }
    }

    /// Every module that this path of `from` passes through on its way, and the last one.
    fn reached(&self, from: &Module, path: &[String], depth: usize) -> Vec<Module> {
        let mut now = match path[0].as_str() {
            "crate" => Vec::new(),
            "self" | "super" => from.clone(),
            child if self.modules.contains(&below(from, child)) => from.clone(),
            _ => return Vec::new(),
        };
        let mut reached = vec![now.clone()];
        for (index, name) in path.iter().enumerate() {
            match name.as_str() {
                "crate" | "self" => continue,
                "super" => {
                    now.pop();
                }
                name => {
                    let child = below(&now, name);
                    if !self.modules.contains(&child) {
                        let import = self.imports.get(&(now.clone(), name.to_owned()));
                        if let Some(import) = import.filter(|_| depth > 0) {
                            let further = [import, &path[index + 1..]].concat();
                            reached.extend(self.reached(&now, &further, depth - 1));
                        }
                        break;
                    }
                    now = child;
                }
            }
            reached.push(now.clone());
        }
        reached
    }

    /// The edges among the children of each module.
    fn edges(&self) -> BTreeMap<(Module, Module), &Place> {
        let mut edges = BTreeMap::new();
        for Mention { from, path, place } in &self.mentions {
            for to in self.reached(from, path, 8) {
                let common = from.iter().zip(&to).take_while(|(a, b)| a == b).count();
                if common < from.len() && common < to.len() {
                    let edge = (from[..=common].to_vec(), to[..=common].to_vec());
                    edges.entry(edge).or_insert(place);
                }
            }
        }
        edges
    }

    /// Sets of sibling modules that use each other.
    pub fn knots(&self) -> Vec<Knot> {
        let edges = self.edges();
        let mut uses: BTreeMap<&Module, BTreeSet<&Module>> = BTreeMap::new();
        for (from, to) in edges.keys() {
            uses.entry(from).or_default().insert(to);
        }
        // Who is reached by any number of steps.
        let mut reaches = uses.clone();
        loop {
            let mut grown = false;
            for (from, direct) in &uses {
                let further: BTreeSet<&Module> =
                    direct.iter().filter_map(|to| reaches.get(to)).flatten().copied().collect();
                let known = reaches.get_mut(from).unwrap();
                grown |= !further.is_subset(known);
                known.extend(further);
            }
            if !grown {
                break;
            }
        }
        let knotted = |a: &Module, b: &Module| {
            reaches.get(a).is_some_and(|all| all.contains(b))
                && reaches.get(b).is_some_and(|all| all.contains(a))
        };
        let mut seen = BTreeSet::new();
        let mut knots = Vec::new();
        for module in uses.keys().filter(|module| knotted(module, module)) {
            if seen.contains(module) {
                continue;
            }
            let members: BTreeSet<&Module> =
                uses.keys().filter(|other| knotted(module, other)).copied().collect();
            let inside = |((from, to), place): (&(Module, Module), &&Place)| {
                let both = members.contains(from) && members.contains(to);
                both.then(|| (from.join("::"), to.join("::"), (*place).clone()))
            };
            let edges = edges.iter().filter_map(inside).collect();
            let modules = members.iter().map(|member| member.join("::")).collect();
            knots.push(Knot { modules, edges });
            seen.extend(members);
        }
        knots
    }
}

fn below(module: &Module, name: &str) -> Module {
    module.iter().cloned().chain([name.to_owned()]).collect()
}

fn word(token: &TokenTree) -> String {
    match token {
        TokenTree::Ident(word) => word.to_string(),
        _ => String::new(),
    }
}

fn is(token: &TokenTree, mark: char) -> bool {
    matches!(token, TokenTree::Punct(punct) if punct.as_char() == mark)
}

fn is_colon(token: &TokenTree) -> bool {
    is(token, ':')
}

fn line(token: &TokenTree) -> usize {
    token.span().start().line
}

fn group(token: &TokenTree, delimiter: Delimiter) -> Option<Vec<TokenTree>> {
    match token {
        TokenTree::Group(group) if group.delimiter() == delimiter => {
            Some(group.stream().into_iter().collect())
        }
        _ => None,
    }
}

/// Number of tokens of the path at the beginning: words joined by `::`.
fn path_length(tokens: &[TokenTree]) -> usize {
    let mut length = 1;
    while let Some([first, second, TokenTree::Ident(_)]) = tokens.get(length..length + 3) {
        if !is_colon(first) || !is_colon(second) {
            break;
        }
        length += 3;
    }
    length
}

/// The paths of a `use`, each with the name that it gives.
fn leaves(tree: &[TokenTree]) -> Vec<(Vec<String>, String)> {
    let mut path = Vec::new();
    for (at, token) in tree.iter().enumerate() {
        if let Some(inside) = group(token, Delimiter::Brace) {
            let each = inside.split(|token| is(token, ',')).flat_map(leaves);
            let joined = |(rest, name): (Vec<String>, String)| {
                // `a::{self}` is `a`.
                let rest: Vec<String> = rest.into_iter().filter(|word| word != "self").collect();
                let name =
                    if name == "self" { path.last().cloned().unwrap_or_default() } else { name };
                ([&path[..], &rest].concat(), name)
            };
            return each.map(joined).collect();
        }
        match word(token).as_str() {
            "as" => return vec![(path, tree.get(at + 1).map(word).unwrap_or_default())],
            "" => {}
            word => path.push(word.to_owned()),
        }
    }
    let name = path.last().cloned().unwrap_or_default();
    if path.is_empty() { Vec::new() } else { vec![(path, name)] }
}

/// The path in `#[path = "..."]`, if this attribute is among those that the tokens end with.
fn given_path(before: &[TokenTree]) -> Option<String> {
    let visibility =
        |token: &&TokenTree| word(token) == "pub" || group(token, Delimiter::Parenthesis).is_some();
    let mut attributes = before.iter().rev().skip_while(visibility);
    while let Some(attribute) = attributes.next()
        && let Some(attribute) = group(attribute, Delimiter::Bracket)
        && attributes.next().is_some_and(|mark| is(mark, '#'))
    {
        if let [name, _, TokenTree::Literal(path)] = &attribute[..]
            && word(name) == "path"
        {
            return Some(path.to_string().trim_matches('"').to_owned());
        }
    }
    None
}

/// Whether a file begins with `#![cfg(test)]`.
fn is_for_tests_alone(tokens: &[TokenTree]) -> bool {
    tokens
        .windows(3)
        .any(|three| is(&three[0], '#') && is(&three[1], '!') && attribute_is_for_tests(&three[2]))
}

fn attribute_is_for_tests(attribute: &TokenTree) -> bool {
    fn asks(tokens: Vec<TokenTree>) -> bool {
        let pairs = tokens.iter().zip(tokens.iter().skip(1).map(Some).chain([None]));
        let mut asked = pairs.filter(|(name, _)| ["test", "all"].contains(&&*word(name)));
        asked.any(|(name, inside)| {
            let inside = inside.and_then(|inside| group(inside, Delimiter::Parenthesis));
            word(name) == "test" || inside.is_some_and(asks)
        })
    }
    let Some(tokens) = group(attribute, Delimiter::Bracket) else { return false };
    match &tokens[..] {
        [cfg, condition] if word(cfg) == "cfg" => {
            group(condition, Delimiter::Parenthesis).is_some_and(asks)
        }
        _ => false,
    }
}

/// Number of tokens before the item, if the tokens begin with attributes one of which is
/// `#[cfg(test)]`.
fn after_test_attribute(tokens: &[TokenTree]) -> Option<usize> {
    let mut length = 0;
    let mut found = false;
    while let Some([mark, attribute]) = tokens.get(length..length + 2) {
        if !is(mark, '#') || group(attribute, Delimiter::Bracket).is_none() {
            break;
        }
        found |= attribute_is_for_tests(attribute);
        length += 2;
    }
    found.then_some(length)
}

/// Number of tokens of an item, a statement, a field or a variant.
fn item_length(tokens: &[TokenTree]) -> usize {
    const ITEMS: [&str; 13] = [
        "async", "const", "enum", "extern", "fn", "impl", "mod", "static", "struct", "trait",
        "type", "unsafe", "use",
    ];
    let starts = tokens.iter().take_while(|token| !is(token, ':')).take(4);
    let is_item = starts.into_iter().any(|token| ITEMS.contains(&&*word(token)));
    for (at, token) in tokens.iter().enumerate() {
        let ends = is(token, ';')
            || !is_item && is(token, ',')
            || group(token, Delimiter::Brace).is_some() && word(&tokens[0]) != "use";
        if ends {
            return at + 1;
        }
    }
    tokens.len()
}
