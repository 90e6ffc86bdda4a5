//! Which file imports which, read as the compiler reads it: a re-export is followed to the file that holds the item.
//!
//! A path counts wherever it stands in the code, inside functions too; comments and unit tests do not. A file that only hands out names of others is no
//! file of a circle; one that holds code of its own is, `mod.rs`, `lib.rs` and `main.rs` included. What it hands out and does not use itself is no
//! import. A glob that is handed out may mean any file behind it. `scripts/imports.py` reads by the same rule.
#![allow(clippy::unwrap_used)]

use crate::architecture::each_source;
use std::collections::{BTreeMap, BTreeSet};

/// A name that a `use` brings in, `*` for all of a module.
struct Import {
    public: bool,
    path: Vec<String>,
    name: String,
}

/// A file's imports, the words and paths of the rest, and whether the rest is more than a list of modules.
struct Text {
    imports: Vec<Import>,
    words: BTreeSet<Vec<String>>,
    own: bool,
}

/// Files by their place: `crates/servotune/src/tune/spec`; `mod.rs`, `lib.rs` and `main.rs` stand at their folder's.
#[derive(Default)]
pub struct House(BTreeMap<String, Text>);

/// Where a file's module stands.
pub fn place(name: &str) -> &str {
    let place = name.trim_end_matches(".rs");
    ["/mod", "/lib", "/main"].iter().find_map(|end| place.strip_suffix(end)).unwrap_or(place)
}

fn read(text: &str) -> Text {
    let text = text.split("#[cfg(test)]\nmod ").next().unwrap();
    let mut lines = text.lines().map(str::trim).filter(|l| !l.is_empty() && !l.starts_with("//"));
    let mut read = Text { imports: Vec::new(), words: BTreeSet::new(), own: false };
    while let Some(line) = lines.next() {
        // `pub(in crate::tune)` opens a door and uses nothing.
        let door = line.strip_prefix("pub(").and_then(|l| l.split_once(") ")).map(|(_, l)| l);
        let bare = door.or(line.strip_prefix("pub ")).unwrap_or(line);
        if let Some(tree) = bare.strip_prefix("use ") {
            let mut tree = tree.to_owned();
            while !tree.contains(';') {
                tree += lines.next().unwrap();
            }
            let tree = tree.split(';').next().unwrap().replace(" as ", "@").replace(' ', "");
            take_apart("", &tree, &mut |leaf| {
                let (path, name) = leaf.split_once('@').unwrap_or((leaf, ""));
                let path: Vec<String> =
                    path.split("::").filter(|p| !["", "self"].contains(p)).map(str::to_owned).collect();
                let name = if name.is_empty() { path.last().unwrap() } else { name }.to_owned();
                read.imports.push(Import { public: bare != line, path, name });
            });
        } else if !(bare.starts_with("mod ") && bare.ends_with(';')) {
            read.own |= !bare.starts_with('#');
            let words = bare.split(|c: char| !(c.is_alphanumeric() || c == '_' || c == ':'));
            let words = words.filter(|w| !w.is_empty() && !w.starts_with(':')).map(|w| w.trim_end_matches(':'));
            read.words.extend(words.map(|w| w.split("::").map(str::to_owned).collect()));
        }
    }
    read
}

/// `a::{b, c::{d, e}}` as `a::b`, `a::c::d`, `a::c::e`.
fn take_apart(before: &str, tree: &str, take: &mut impl FnMut(&str)) {
    let Some((head, group)) = tree.split_once('{') else { return take(&format!("{before}{tree}")) };
    let (before, mut depth) = (format!("{before}{head}"), 0);
    let parts = group.strip_suffix('}').unwrap().split(|c| {
        depth += i32::from(c == '{') - i32::from(c == '}');
        c == ',' && depth == 0
    });
    parts.filter(|p| !p.is_empty()).for_each(|p| take_apart(&before, p, &mut *take));
}

impl House {
    /// The installed crates and the studies.
    pub fn ours() -> House {
        let mut house = House::default();
        each_source(|name, text| house.take(name, text));
        house
    }

    fn take(&mut self, name: &str, text: &str) {
        self.0.entry(place(name).to_owned()).or_insert_with(|| read(text));
    }

    /// A path as it reads from the root of its crate; none where it begins in another crate.
    fn rooted(&self, place: &str, path: &[String]) -> Option<String> {
        let below = self.0.contains_key(&format!("{place}/{}", path[0]));
        let mut full = (below || ["crate", "super", "self"].contains(&path[0].as_str())).then(|| place.to_owned())?;
        for part in path {
            match part.as_str() {
                "crate" => full.truncate(full.find("src").unwrap() + "src".len()),
                "super" => full.truncate(full.rfind('/').unwrap()),
                "self" => {}
                part => full = format!("{full}/{part}"),
            }
        }
        Some(full)
    }

    /// All that a file's code names in its crate, before re-exports are followed.
    pub fn paths(&self, place: &str) -> BTreeSet<String> {
        let text = &self.0[place];
        let used: BTreeSet<&String> = text.words.iter().map(|w| &w[0]).collect();
        let imports = text.imports.iter().filter(|i| !i.public || used.contains(&i.name)).map(|i| i.path.clone());
        let words = text.words.iter().filter(|w| w.len() > 1);
        let through = words.clone().flat_map(|w| {
            let named = text.imports.iter().filter(|i| i.name == w[0]);
            named.map(|i| [&i.path[..], &w[1..]].concat())
        });
        imports.chain(words.cloned()).chain(through).filter_map(|p| self.rooted(place, &p)).collect()
    }

    /// Files that hold what a path from the root of the crate names.
    fn meant(&self, path: &str, seen: &mut BTreeSet<String>, found: &mut BTreeSet<String>) {
        if !seen.insert(path.to_owned()) {
            return;
        }
        let ends = path.match_indices('/').map(|(at, _)| at).chain([path.len()]);
        let module = ends.map(|end| &path[..end]).rfind(|p| self.0.contains_key(*p)).unwrap();
        // A path that ends at a module may also name an item of the same name that is handed out beside it.
        let (outer, rest) = match path[module.len()..].strip_prefix('/') {
            Some(rest) => (module, rest),
            None => module.rsplit_once('/').unwrap_or(("", module)),
        };
        let imports = self.0.get(outer).map_or(&[][..], |t| &t.imports);
        let (name, on) = rest.split_at(rest.find('/').unwrap_or(rest.len()));
        let named: Vec<&Import> = imports.iter().filter(|i| i.name == name).collect();
        let inside = outer == module;
        if self.0[module].own && (!inside || named.is_empty()) {
            found.insert(module.to_owned());
        }
        for i in &named {
            if let Some(behind) = self.rooted(outer, &i.path) {
                self.meant(&format!("{behind}{on}"), seen, found);
            }
        }
        for i in imports.iter().filter(|i| i.name == "*" && inside && named.is_empty()) {
            if let Some(behind) = self.rooted(outer, &i.path) {
                self.meant(&format!("{}{rest}", behind.trim_end_matches('*')), seen, found);
            }
        }
    }

    /// The files that each file with code of its own uses.
    fn arrows(&self) -> BTreeMap<&str, BTreeSet<String>> {
        let own = self.0.iter().filter(|(_, text)| text.own);
        own.map(|(place, _)| {
            let mut found = BTreeSet::new();
            self.paths(place).iter().for_each(|p| self.meant(p, &mut BTreeSet::new(), &mut found));
            found.remove(place);
            (place.as_str(), found)
        })
        .collect()
    }

    /// Files that import each other in a circle, each with those of the circle that it names.
    fn circles(&self) -> Vec<String> {
        let arrows = self.arrows();
        let mut reached: BTreeMap<&str, BTreeSet<&str>> = BTreeMap::new();
        for start in arrows.keys() {
            let (seen, mut todo) = (reached.entry(start).or_default(), vec![*start]);
            while let Some(next) = todo.pop() {
                todo.extend(arrows[next].iter().map(String::as_str).filter(|used| seen.insert(used)));
            }
        }
        let back =
            |place: &str| arrows[place].iter().filter(|u| reached[u.as_str()].contains(place)).cloned().collect();
        let told =
            arrows.keys().map(|place| (place, back(place))).filter(|(_, used): &(_, Vec<String>)| !used.is_empty());
        told.map(|(place, used)| format!("{place} -> {}", used.join(", "))).collect()
    }
}

/// A house of the named texts, below `src/`.
fn built(files: &[(&str, &str)]) -> House {
    let mut house = House::default();
    files.iter().for_each(|(name, text)| house.take(&format!("src/{name}"), text));
    house
}

#[test]
fn paths_are_read_as_the_compiler_reads_them() {
    let text = "use super::{\n    a::{B, c},\n    d,\n};\nfn f() { super::super::g::h(crate::i::J, c::K) }\n// super::k\n#[cfg(test)]\nmod tests { use super::l; }";
    let house = built(&[("diagnose/fit/model.rs", text)]);
    let read: Vec<String> = house.paths("src/diagnose/fit/model").into_iter().collect();
    let below = "src/diagnose/fit";
    let expected = ["a/B", "a/c", "a/c/K", "d"].map(|p| format!("{below}/{p}"));
    assert_eq!(read, [&expected[..], &["src/diagnose/g/h".to_owned(), "src/i/J".to_owned()]].concat());
}

#[test]
fn a_circle_is_seen_through_every_way_of_handing_out() {
    let b = ("b.rs", "use super::a::A;\npub struct B;\nfn f() -> A {}");
    for (root, a) in [
        ("mod a;\nmod b;", "use super::b::B;\nfn g(b: B) {}"),
        ("mod a;\nmod b;", "fn g(b: crate::b::B) {}"),
        ("mod a;\npub(crate) mod b;\npub use b::B;", "fn g(b: super::B) {}"),
        ("mod a;\nmod b;\npub(crate) use b::{\n    B as C,\n};", "use super::C;\nfn g(b: C) {}"),
        ("mod a;\nmod b;\npub use b::*;", "use crate::B;\nfn g(b: B) {}"),
        ("mod a;\nmod b;\nuse b::B;\nfn main() {}", "use crate::B;\nfn g(b: B) {}"),
        ("mod a;\nmod b;", "use crate::b;\nfn g(b: b::B) {}"),
        ("mod a;\nmod b;\nmod c;\npub use c::B;", "use crate::B;\nfn g(b: B) {}"),
    ] {
        let house = built(&[("main.rs", root), ("a.rs", a), b, ("c.rs", "pub use crate::b::B;")]);
        assert_eq!(house.circles(), ["src/a -> src/b", "src/b -> src/a"], "{root}\n{a}");
    }
}

#[test]
fn a_root_with_code_of_its_own_stands_in_the_circle_that_it_makes() {
    let b = ("room/b.rs", "pub struct B;\nfn f() { super::g() }");
    let uses = built(&[("lib.rs", "mod room;"), ("room/mod.rs", "mod b;\npub use b::B;\nfn g() { B }"), b]);
    assert_eq!(uses.circles(), ["src/room -> src/room/b", "src/room/b -> src/room"]);
    let only_hands_out = built(&[("lib.rs", "mod room;"), ("room/mod.rs", "mod b;\npub use b::B;\nfn g() {}"), b]);
    assert_eq!(only_hands_out.circles(), [""; 0]);
}

#[test]
fn no_files_import_each_other_in_a_circle() {
    let house = House::ours();
    let arrows: usize = house.arrows().values().map(BTreeSet::len).sum();
    assert!(arrows > 2000, "{arrows} imports seen");
    let circles = house.circles();
    assert!(circles.is_empty(), "{} files:\n{}", circles.len(), circles.join("\n"));
}
