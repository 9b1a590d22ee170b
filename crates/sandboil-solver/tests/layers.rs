//! The solver's modules depend on each other in one direction only.
#![allow(clippy::unwrap_used)] // a failure is the test's own report

use std::{
    collections::{BTreeMap, BTreeSet},
    fs,
    path::{Path, PathBuf},
};

/// Folders and files of the source; each may use itself and those before it.
const LAYERS: [&str; 13] = [
    "error",
    "parallel",
    "linear",
    "section",
    "weights",
    "edges",
    "skeleton",
    "water",
    "stages",
    "run",
    "neighbours",
    "shear_cell",
    "lib",
];

fn sources(folder: &Path) -> Vec<PathBuf> {
    let mut found = Vec::new();
    for entry in fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() {
            found.extend(sources(&path));
        } else if path.extension().is_some_and(|ending| ending == "rs") {
            found.push(path);
        }
    }
    found
}

/// The modules that a source imports from the crate, without its tests: paths in `use` trees and in the code.
fn imports(text: &str) -> BTreeSet<Vec<String>> {
    let code: String = text
        .lines()
        .take_while(|line| *line != "#[cfg(test)]")
        .filter(|line| !line.trim_start().starts_with("//"))
        .collect::<Vec<_>>()
        .join("\n");
    let mut found = BTreeSet::new();
    let mut rest = code.as_str();
    while let Some(start) = rest.find("crate::") {
        rest = &rest[start + "crate::".len()..];
        expand(&mut rest.chars().peekable(), &[], &mut found);
    }
    found
}

/// Reads one tree of a `use` statement: `a::{b, c::d}`.
fn expand(
    text: &mut std::iter::Peekable<std::str::Chars>,
    prefix: &[String],
    found: &mut BTreeSet<Vec<String>>,
) {
    let mut path = prefix.to_vec();
    let mut name = String::new();
    while let Some(&next) = text.peek() {
        match next {
            '_' | 'a'..='z' | 'A'..='Z' | '0'..='9' => name.push(next),
            ':' if !name.is_empty() => path.push(std::mem::take(&mut name)),
            '{' => {
                text.next();
                loop {
                    expand(text, &path, found);
                    match text.next() {
                        Some(',') => {}
                        _ => return,
                    }
                }
            }
            ':' | ' ' | '\n' if name.is_empty() => {}
            _ => break,
        }
        text.next();
    }
    if !name.is_empty() {
        path.push(name);
    }
    if path.len() > prefix.len() {
        found.insert(path);
    }
}

#[test]
fn modules_depend_in_one_direction() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("src");
    let place = |layer: &str| LAYERS.iter().position(|known| *known == layer);
    let module = |path: &Path| -> Vec<String> {
        let inside = path.strip_prefix(&root).unwrap().with_extension("");
        let parts = inside.iter().map(|part| part.to_str().unwrap().to_owned());
        parts.filter(|part| part != "mod").collect()
    };
    let texts: BTreeMap<Vec<String>, String> =
        sources(&root).iter().map(|path| (module(path), fs::read_to_string(path).unwrap())).collect();
    let mut edges: BTreeMap<Vec<String>, BTreeSet<Vec<String>>> = BTreeMap::new();
    for (from, text) in &texts {
        let own = &from[0];
        // Fixtures, and files that contain only tests.
        let last = from.last().unwrap();
        if own == "testing" || last == "tests" || last.ends_with("_tests") {
            continue;
        }
        for path in imports(text) {
            let to = &path[0];
            let (Some(lower), Some(upper)) = (place(to), place(own)) else {
                panic!("{}: {} is in no layer", from.join("::"), path.join("::"))
            };
            assert!(lower <= upper, "{} uses {}, a layer above it", from.join("::"), path.join("::"));
            // The file that defines it: the longest path that exists.
            let file =
                (1..=path.len()).rev().map(|n| path[..n].to_vec()).find(|part| texts.contains_key(part));
            if let Some(file) = file.filter(|file| file != from) {
                edges.entry(from.clone()).or_default().insert(file);
            }
        }
    }
    assert!(edges.len() > 30, "{}", edges.len());
    // No circle among files: files that depend on no other remaining file are removed until none remains.
    loop {
        let open: BTreeSet<_> = edges.keys().cloned().collect();
        let before = edges.len();
        edges.retain(|_, uses| uses.iter().any(|file| open.contains(file)));
        if edges.len() == before {
            break;
        }
    }
    assert!(edges.is_empty(), "a circle among {:?}", edges.keys());
}
