//! Hydraulic conditions on the edges of a section.

use crate::arrays::{Points, one_of};
use pyo3::prelude::*;
use sandboil_solver::{self as solver, HydraulicCondition};

/// A hydraulic condition on a line.
#[pyclass(module = "sandboil._core", frozen, eq, from_py_object)]
#[derive(Clone, PartialEq)]
pub struct Condition(pub solver::HydraulicBoundary);

#[pymethods]
impl Condition {
    #[new]
    #[pyo3(signature = (*, kind, line, time, value))]
    fn new(kind: &str, line: Points, time: Vec<f64>, value: Vec<f64>) -> PyResult<Self> {
        type Kind = fn(solver::Series) -> HydraulicCondition;
        const KINDS: [(&str, Kind); 7] = [
            ("head", HydraulicCondition::Head),
            ("pressure", HydraulicCondition::Pressure),
            ("flux", HydraulicCondition::Flux),
            ("rain", HydraulicCondition::Rain),
            ("reservoir", HydraulicCondition::Reservoir),
            ("seepage-face", |_| HydraulicCondition::SeepageFace),
            ("drain", |_| HydraulicCondition::Drain),
        ];
        let condition = one_of("kind", kind, &KINDS)?(solver::Series { time, value });
        Ok(Self(solver::HydraulicBoundary { line: line.0, condition }))
    }
}

/// A hydraulic condition of a stage in which the ground moves.
#[pyclass(module = "sandboil._core", frozen, eq, from_py_object)]
#[derive(Clone, PartialEq)]
pub struct MovingCondition(pub solver::MovingBoundary);

#[pymethods]
impl MovingCondition {
    #[new]
    #[pyo3(signature = (*, condition, at_rest))]
    fn new(condition: Condition, at_rest: Option<f64>) -> Self {
        Self(solver::MovingBoundary { boundary: condition.0, at_rest })
    }
}
