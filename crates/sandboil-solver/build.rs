//! Tells the solver what distinguishes the sources it is built from: a state is stored in the layout of its types.

use std::{
    fs, io,
    path::{Path, PathBuf},
};

/// The crates whose types and arithmetic make up a simulation.
const CRATES: [&str; 3] = ["../sandboil-sph/src", "../sandboil-soil/src", "src"];

fn files(folder: &Path, into: &mut Vec<PathBuf>) -> io::Result<()> {
    for entry in fs::read_dir(folder)? {
        let path = entry?.path();
        if path.is_dir() {
            files(&path, into)?;
        } else {
            into.push(path);
        }
    }
    Ok(())
}

fn main() -> io::Result<()> {
    let mut sources = Vec::new();
    for folder in CRATES {
        files(Path::new(folder), &mut sources)?;
        println!("cargo:rerun-if-changed={folder}");
    }
    sources.sort();
    let mut sum = crc32fast::Hasher::new();
    for path in sources {
        sum.update(&fs::read(path)?);
    }
    println!("cargo:rustc-env=SANDBOIL_SOURCES={:08x}", sum.finalize());
    Ok(())
}
