//! Core errors as Python exceptions. The classes live in `sandboil._errors`; this module imports and
//! raises them.

use pyo3::{
    exceptions::{PyRuntimeError, PyValueError},
    prelude::*,
    types::PyDict,
};
use sandboil_soil::SoilError;
use sandboil_solver::{SolverError, StateError};
use std::path::Path;

/// A solver error on its way to Python.
pub struct CoreError(pub SolverError);

impl From<CoreError> for PyErr {
    fn from(CoreError(error): CoreError) -> Self {
        Python::attach(|py| exception(py, error).unwrap_or_else(|failure| failure))
    }
}

fn exception(py: Python<'_>, error: SolverError) -> PyResult<PyErr> {
    let classes = py.import("sandboil._errors")?;
    let keywords = PyDict::new(py);
    let (error, place) = match error {
        SolverError::Column { side, source } if matches!(*source, SolverError::Diverged { .. }) => {
            (*source, format!(" in the free-field column on the {side}"))
        }
        other => (other, String::new()),
    };
    let raised = match error {
        SolverError::Diverged { quantity, node, x, y, value, time, step } => {
            keywords.set_item("quantity", format!("{quantity}{place}"))?;
            keywords.set_item("node", node)?;
            keywords.set_item("position", (x, y))?;
            keywords.set_item("value", value)?;
            keywords.set_item("time", time)?;
            keywords.set_item("step", step)?;
            classes.getattr("SimulationDiverged")?.call((), Some(&keywords))?
        }
        SolverError::InvalidInput { name, value, expected } => {
            keywords.set_item("path", name)?;
            keywords.set_item("value", value)?;
            keywords.set_item("allowed", format!("must be {expected}"))?;
            classes.getattr("InvalidInput")?.call((), Some(&keywords))?
        }
        other => classes.getattr("SandboilError")?.call1((other.to_string(),))?,
    };
    Ok(PyErr::from_value(raised))
}

/// What is wrong with the stored state in a file.
pub fn state_error(py: Python<'_>, path: &Path, error: &StateError) -> PyResult<PyErr> {
    let classes = py.import("sandboil._errors")?;
    let raised = match error {
        StateError::Foreign | StateError::Damaged(_) => {
            classes.getattr("DamagedState")?.call1((format!("{} {error}", path.display()),))?
        }
        StateError::Version { .. } | StateError::Build | StateError::OtherModel => {
            let hint = "run the scene again, or continue with the sandboil and the scene that stored it";
            classes.getattr("InvalidInput")?.call1(("state", path, error.to_string(), hint))?
        }
    };
    Ok(PyErr::from_value(raised))
}

/// An error of a soil model without a node: a refused parameter with its name, or the message alone.
pub fn refused(error: &SoilError) -> PyErr {
    match *error {
        SoilError::InvalidParameter { name, value, expected } => {
            CoreError(SolverError::InvalidInput { name, value, expected }).into()
        }
        ref other => PyValueError::new_err(other.to_string()),
    }
}

/// A description as bytes: equal descriptions have equal bytes.
pub fn serialised(description: &impl serde::Serialize) -> PyResult<Vec<u8>> {
    postcard::to_stdvec(description).map_err(|error| PyRuntimeError::new_err(error.to_string()))
}
