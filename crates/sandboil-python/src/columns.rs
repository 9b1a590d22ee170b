//! Records of free-field columns.

use crate::arrays::{Rows, shaped};
use numpy::{PyArray2, PyReadonlyArray2, ToPyArray, ndarray::arr2};
use pyo3::{exceptions::PyValueError, prelude::*};
use sandboil_solver as solver;

/// The record of a column in a stage.
#[pyclass(module = "sandboil._core", frozen, eq, from_py_object)]
#[derive(Clone, PartialEq)]
pub struct ColumnRecord(pub solver::ColumnRecord);

#[pymethods]
impl ColumnRecord {
    #[new]
    #[pyo3(signature = (*, interval, impedance, wet, values))]
    #[expect(clippy::needless_pass_by_value, reason = "arrays come from Python by value")]
    fn new(
        interval: f64,
        impedance: Rows<3>,
        wet: bool,
        values: PyReadonlyArray2<'_, f64>,
    ) -> PyResult<Self> {
        let width = solver::ColumnRecord::width(impedance.0.len(), wet);
        let found = values.as_array().ncols();
        if found != width {
            return Err(PyValueError::new_err(format!("values have {found} columns: must be {width}")));
        }
        let impedance = impedance.0.into_iter().map(|[density, shear_speed, compression_speed]| {
            solver::Impedance { density, shear_speed, compression_speed }
        });
        let values = values.as_slice()?.to_vec();
        Ok(Self(solver::ColumnRecord { interval, impedance: impedance.collect(), wet, values }))
    }

    #[getter]
    fn interval(&self) -> f64 {
        self.0.interval
    }

    #[getter]
    fn impedance<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray2<f64>> {
        let row = |row: &solver::Impedance| [row.density, row.shear_speed, row.compression_speed];
        arr2(&self.0.impedance.iter().map(row).collect::<Vec<_>>()).to_pyarray(py)
    }

    #[getter]
    fn wet(&self) -> bool {
        self.0.wet
    }

    #[getter]
    fn values<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        let width = solver::ColumnRecord::width(self.0.rows(), self.0.wet);
        Ok(shaped(self.0.values.clone(), (self.0.values.len() / width, width))?.to_pyarray(py))
    }
}
