//! States of simulations in files.

use crate::errors::state_error;
use pyo3::{prelude::*, types::PyBytes};
use sandboil_solver::{self as solver, checkpoint};
use std::{
    fs::File,
    io::{self, BufWriter, Read},
    path::{Path, PathBuf},
};

/// Most bytes of a state that are read: a section of ten million nodes, the largest that a scene may have, takes some
/// 5 kB for each.
const MAX_BYTES: u64 = 1 << 36;

/// Writes the state of a simulation and a note to a file, and returns when the disk has them.
pub fn write(simulation: &solver::Simulation, path: &Path, note: &[u8]) -> io::Result<()> {
    let file = File::create(path)?;
    simulation.store(note, BufWriter::new(&file))?;
    file.sync_all()
}

/// The bytes of a stored state; the first ones alone if they are not those of one, before memory is taken for the rest.
pub fn read(path: &Path) -> io::Result<Vec<u8>> {
    let file = File::open(path)?;
    let mut bytes = Vec::new();
    (&file).take(checkpoint::MAGIC.len() as u64).read_to_end(&mut bytes)?;
    if bytes == checkpoint::MAGIC {
        let rest = file.metadata()?.len().min(MAX_BYTES);
        bytes.reserve_exact(usize::try_from(rest).unwrap_or_default());
        (&file).take(MAX_BYTES).read_to_end(&mut bytes)?;
    }
    Ok(bytes)
}

/// The note that was stored with a state in a file, whichever build wrote it.
#[pyfunction]
#[expect(clippy::needless_pass_by_value, reason = "PyO3 gives paths as owned values only")]
pub fn stored_note(py: Python<'_>, path: PathBuf) -> PyResult<Bound<'_, PyBytes>> {
    let bytes = py.detach(|| read(&path))?;
    match py.detach(|| checkpoint::note(&bytes)) {
        Ok(note) => Ok(PyBytes::new(py, note)),
        Err(error) => Err(state_error(py, &path, &error)?),
    }
}
