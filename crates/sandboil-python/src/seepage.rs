//! Flow through ground at rest as a Python class, driven like a simulation.

use crate::{arrays::shaped, conditions::Condition, errors::CoreError, section::Section, stepping::repeat};
use numpy::{PyArray1, PyArray2, ToPyArray};
use pyo3::{
    prelude::*,
    types::{IntoPyDict, PyDict},
};
use sandboil_solver as solver;

/// Pore water of a section at rest. Arrays are copies, in the order of the nodes given.
#[pyclass(module = "sandboil._core")]
pub struct Seepage {
    inner: solver::Seepage,
    until: solver::Until,
    /// Whether pores hold air, or may lose water.
    holds_air: bool,
    is_complete: bool,
}

#[pymethods]
impl Seepage {
    /// Starts from the pore pressures of the section; without a duration (s) it finds the steady state. `tolerance` is
    /// the error of a step in time.
    #[new]
    #[pyo3(signature = (section, *, conditions, duration, tolerance))]
    fn new(
        py: Python<'_>,
        section: &Section,
        conditions: Vec<Condition>,
        duration: Option<f64>,
        tolerance: f64,
    ) -> PyResult<Self> {
        let model = &section.0;
        let boundaries = conditions.into_iter().map(|condition| condition.0).collect();
        let inner = py.detach(|| {
            let seepage = solver::Seepage::new(model, &model.pore_pressure, boundaries)?;
            if duration.is_none() {
                return Ok(seepage);
            }
            seepage.with_tolerance(tolerance)?.with_expanding_skeleton(model)
        });
        let inner = inner.map_err(CoreError)?;
        let until = duration.map_or(solver::Until::Steady, solver::Until::Time);
        let holds_air = model.saturation.iter().any(|share| *share < 1.0)
            || model.regions.iter().any(|region| region.retention.is_some());
        Ok(Self { inner, until, holds_air, is_complete: false })
    }

    /// Continues until `until` (s) or the end, or until `steps` are made or `seconds` have passed; returns whether the
    /// stage is complete.
    #[pyo3(signature = (*, steps, until, seconds))]
    fn advance(&mut self, py: Python<'_>, steps: u64, until: f64, seconds: f64) -> PyResult<bool> {
        let (inner, end) = (&mut self.inner, self.until);
        let target = inner.counters().steps.saturating_add(steps);
        let mut arrived = false;
        repeat(py, seconds, || {
            // Half a step of tolerance: output never changes the time step.
            let has_time = end == solver::Until::Steady || inner.time() + 0.5 * inner.time_step() < until;
            if arrived || inner.counters().steps >= target || !has_time {
                return Ok(true);
            }
            arrived = inner.advance(end, |_| false)?;
            Ok(false)
        })?;
        self.is_complete = arrived;
        Ok(arrived)
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

    /// Places (x, y) along a condition's line and the inflow through each, m3/s per m: rows of three.
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

    /// Names of the physics of such a stage, and whether this one computes it.
    fn physics<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        [("pore water", true), ("seepage", true), ("partial saturation", self.holds_air)].into_py_dict(py)
    }

    /// Bytes held by the section's tables, by name.
    fn arrays(&self) -> Vec<(&'static str, usize)> {
        self.inner.arrays()
    }

    fn counters<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let counters = self.inner.counters();
        [
            ("steps", counters.steps),
            ("rejected_steps", counters.rejected),
            ("iterations", counters.iterations),
            ("retention_calls", counters.retention_calls),
            ("factorings", counters.factorings),
        ]
        .into_py_dict(py)
    }
}
