//! The identity of free-field columns.

use crate::{
    errors::CoreError,
    section::Section,
    stages::{Gravity, Shaking},
};
use pyo3::{prelude::*, types::PyBytes};
use sandboil_solver as solver;

/// Identities of the columns of the left and the right side in a stage; `None` where there is none.
#[pyfunction]
pub fn column_identities<'py>(
    py: Python<'py>,
    section: &Section,
    gravity: Option<PyRef<'_, Gravity>>,
    stage: &Shaking,
) -> PyResult<[Option<Bound<'py, PyBytes>>; 2]> {
    let found = solver::column_identities(&section.0, gravity.map(|stage| stage.0), stage.0.clone())
        .map_err(CoreError)?;
    Ok(found.map(|bytes| bytes.map(|bytes| PyBytes::new(py, &bytes))))
}
