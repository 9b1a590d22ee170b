//! Flow through ground at rest as a Python class, with the calls of a simulation.

use crate::{
    errors::CoreError,
    simulation::{get, model, shaped, vectors},
};
use numpy::{PyArray1, PyArray2, PyReadonlyArray1, ToPyArray};
use pyo3::{exceptions::PyValueError, prelude::*, types::PyDict};
use sandboil_solver as solver;
use std::time::{Duration, Instant};

fn series(dict: &Bound<'_, PyDict>) -> PyResult<solver::Series> {
    let (time, value): (Vec<f64>, Vec<f64>) = get(dict, "series")?;
    Ok(solver::Series { time, value })
}

pub fn boundary(dict: &Bound<'_, PyDict>) -> PyResult<solver::HydraulicBoundary> {
    let condition = match get::<String>(dict, "kind")?.as_str() {
        "head" => solver::HydraulicCondition::Head(series(dict)?),
        "pressure" => solver::HydraulicCondition::Pressure(series(dict)?),
        "flux" => solver::HydraulicCondition::Flux(series(dict)?),
        "rain" => solver::HydraulicCondition::Rain(series(dict)?),
        "reservoir" => solver::HydraulicCondition::Reservoir(series(dict)?),
        "seepage-face" => solver::HydraulicCondition::SeepageFace,
        "drain" => solver::HydraulicCondition::Drain,
        other => return Err(PyValueError::new_err(format!("kind = {other:?} is no hydraulic condition"))),
    };
    Ok(solver::HydraulicBoundary { line: vectors(&get(dict, "line")?), condition })
}

/// Pore water of a section at rest. Arrays are copies, in the order of the nodes given.
#[pyclass(module = "sandboil._core")]
pub struct Seepage {
    inner: solver::Seepage,
    until: solver::Until,
    is_complete: bool,
}

#[pymethods]
impl Seepage {
    /// Starts from pore pressures (kPa); without a duration (s) it computes the steady state.
    #[new]
    #[allow(clippy::needless_pass_by_value)] // arguments come from Python by value
    #[pyo3(signature = (description, pore_pressure, conditions, duration))]
    fn new(
        description: &Bound<'_, PyDict>,
        pore_pressure: PyReadonlyArray1<'_, f64>,
        conditions: Vec<Bound<'_, PyDict>>,
        duration: Option<f64>,
    ) -> PyResult<Self> {
        let model = model(description)?;
        let boundaries = conditions.iter().map(boundary).collect::<PyResult<Vec<_>>>()?;
        let pressure = pore_pressure.as_slice()?.to_vec();
        let inner = description
            .py()
            .detach(|| solver::Seepage::new(&model, &pressure, boundaries))
            .map_err(CoreError)?;
        let until = duration.map_or(solver::Until::Steady, solver::Until::Time);
        Ok(Self { inner, until, is_complete: false })
    }

    /// Continues until the time `until` (s) or the end, or until `steps` steps have been made or `seconds`
    /// have passed; returns whether the stage is over.
    #[pyo3(signature = (*, steps, until, seconds))]
    fn advance(&mut self, py: Python<'_>, steps: u64, until: f64, seconds: f64) -> PyResult<bool> {
        let (inner, end) = (&mut self.inner, self.until);
        let outcome = py.detach(|| {
            let budget = Duration::try_from_secs_f64(seconds).unwrap_or(Duration::MAX);
            let start = Instant::now();
            let target = inner.counters().steps.saturating_add(steps);
            let mut arrived = false;
            // A tolerance of half a step: output does not change the time step.
            while !arrived
                && inner.counters().steps < target
                && (end == solver::Until::Steady || inner.time() + 0.5 * inner.time_step() < until)
            {
                arrived = inner.advance(end, |_| false)?;
                if start.elapsed() >= budget {
                    break;
                }
            }
            Ok(arrived)
        });
        py.check_signals()?;
        self.is_complete = outcome.map_err(CoreError)?;
        Ok(self.is_complete)
    }

    #[getter]
    fn time(&self) -> f64 {
        self.inner.time()
    }

    #[getter]
    fn step(&self) -> u64 {
        self.inner.counters().steps
    }

    #[getter]
    fn time_step(&self) -> f64 {
        self.inner.time_step()
    }

    #[getter]
    fn is_complete(&self) -> bool {
        self.is_complete
    }

    fn head<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        self.inner.head().to_pyarray(py)
    }

    fn pore_pressure<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        self.inner.pore_pressure().to_pyarray(py)
    }

    fn saturation<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        self.inner.saturation().to_pyarray(py)
    }

    /// Inflow through each condition's line at the end of the last step, m3/s per m.
    fn discharge<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        self.inner.discharge().to_pyarray(py)
    }

    /// Points (x, y) along a condition's line and the inflow at each, m3/s per m: rows of three.
    fn outlets<'py>(&self, py: Python<'py>, condition: usize) -> PyResult<Bound<'py, PyArray2<f64>>> {
        let outlets = self.inner.outlets(condition);
        let flat = outlets.iter().flat_map(|(at, flow)| [at.x, at.y, *flow]).collect();
        Ok(shaped(flat, (outlets.len(), 3))?.to_pyarray(py))
    }

    /// Since the start: inflow through each condition's line, and increase of the stored water, m3 per m.
    fn balance<'py>(&self, py: Python<'py>) -> (Bound<'py, PyArray1<f64>>, f64) {
        let balance = self.inner.balance();
        (balance.inflow.to_pyarray(py), balance.stored)
    }

    /// Bytes held by the section's tables, by name.
    fn arrays(&self) -> Vec<(&'static str, usize)> {
        self.inner.arrays()
    }

    fn counters<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let counters = self.inner.counters();
        let dict = PyDict::new(py);
        for (name, value) in [
            ("steps", counters.steps),
            ("rejected_steps", counters.rejected),
            ("iterations", counters.iterations),
            ("retention_calls", counters.retention_calls),
            ("factorings", counters.factorings),
        ] {
            dict.set_item(name, value)?;
        }
        Ok(dict)
    }
}
