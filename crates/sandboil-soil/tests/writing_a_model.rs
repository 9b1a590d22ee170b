//! The page on writing a model quotes the present code.

#![allow(clippy::unwrap_used, reason = "a failure here is a failure of the test")]

use std::path::Path;

const PAGE: &str = "docs/theory/writing_a_model.md";

fn read(file: &str) -> String {
    std::fs::read_to_string(Path::new(env!("CARGO_MANIFEST_DIR")).join("../..").join(file)).unwrap()
}

/// Lines without indentation, because a quotation is indented less.
fn lines(text: &str) -> Vec<&str> {
    text.lines().map(str::trim).collect()
}

/// Fenced blocks of a page that name a file: the file name and the lines.
fn quotations(page: &str) -> Vec<(&str, Vec<&str>)> {
    let mut quotations = Vec::new();
    let mut lines = page.lines();
    while let Some(line) = lines.next() {
        let Some(fence) = line.strip_prefix("```") else { continue };
        let block: Vec<&str> = lines.by_ref().take_while(|line| *line != "```").map(str::trim).collect();
        if let Some((_, file)) = fence.split_once(' ') {
            quotations.push((file, block));
        }
    }
    quotations
}

#[test]
fn every_block_is_found_in_its_file() {
    let page = read(PAGE);
    let quotations = quotations(&page);
    assert!(quotations.len() > 10, "{} blocks", quotations.len());
    for (file, block) in quotations {
        let text = read(file);
        let found = lines(&text).windows(block.len()).any(|part| part == block);
        assert!(found, "not found in {file}:\n{}", block.join("\n"));
    }
}

/// The page quotes the whole model except its tests.
#[test]
fn the_page_contains_the_whole_model() {
    let file = "crates/sandboil-soil/src/pressure_elastic.rs";
    let (page, text) = (read(PAGE), read(file));
    let sorted = |mut lines: Vec<String>| {
        lines.retain(|line| !line.is_empty());
        lines.sort();
        lines
    };
    let quoted = quotations(&page).into_iter().filter(|(name, _)| *name == file).flat_map(|(_, block)| block);
    let code = lines(&text).into_iter().take_while(|line| *line != "#[cfg(test)]");
    assert_eq!(sorted(quoted.map(String::from).collect()), sorted(code.map(String::from).collect()));
}
