//! The shear cell as a Python class.

use crate::{
    arrays::{pages, rows},
    errors::CoreError,
    laboratory::columns,
    section::Numerics,
    simulation::counted,
    soil::Soil,
    stepping::repeat,
};
use numpy::{PyArray1, PyArray2, PyArray3, ToPyArray};
use pyo3::{
    prelude::*,
    types::{IntoPyDict, PyDict},
};
use sandboil_soil::laboratory::Resolution;
use sandboil_solver as solver;

/// Steps between readings of the clock.
const STEPS_PER_LOOK: usize = 32;

/// A running shear test. Arrays are copies, with nodes row by row from the bottom.
#[pyclass(module = "sandboil._core")]
pub struct ShearCell {
    inner: solver::ShearCell,
}

#[pymethods]
impl ShearCell {
    #[new]
    #[pyo3(signature = (
        *,
        soil,
        void_ratio,
        density,
        vertical_stress,
        earth_pressure_coefficient,
        stress_ratio,
        size,
        free_size,
        spacing,
        strain_step,
        inertia,
        local_damping,
        strain_limit,
        turn_limit,
        stress_resolution,
        strain_resolution,
        every_stress_node,
        numerics,
        threads,
    ))]
    #[expect(clippy::too_many_arguments, reason = "keywords of Python")]
    fn new(
        soil: Soil,
        void_ratio: Option<f64>,
        density: f64,
        vertical_stress: f64,
        earth_pressure_coefficient: f64,
        stress_ratio: f64,
        size: f64,
        free_size: f64,
        spacing: f64,
        strain_step: f64,
        inertia: f64,
        local_damping: f64,
        strain_limit: f64,
        turn_limit: usize,
        stress_resolution: f64,
        strain_resolution: f64,
        every_stress_node: bool,
        numerics: &Numerics,
        threads: usize,
    ) -> PyResult<Self> {
        let test = solver::CellTest {
            soil: soil.0,
            void_ratio,
            density,
            vertical_stress,
            earth_pressure_coefficient,
            stress_ratio,
            size,
            free_size,
            spacing,
            strain_step,
            inertia,
            local_damping,
            strain_limit,
            turn_limit,
            resolution: Resolution { stress: stress_resolution, strain: strain_resolution },
            every_stress_node,
            numerics: numerics.0,
        };
        Ok(Self { inner: solver::ShearCell::new(test, threads).map_err(CoreError)? })
    }

    /// Makes steps until `seconds` have passed or the test is over; returns whether it is over.
    fn advance(&mut self, py: Python<'_>, seconds: f64) -> PyResult<bool> {
        let inner = &mut self.inner;
        let mut is_over = false;
        repeat(py, seconds, || {
            is_over = inner.advance(STEPS_PER_LOOK)?;
            Ok(is_over)
        })?;
        Ok(is_over)
    }

    /// Means over the centre, with the columns of a specimen's record.
    fn record<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        columns(py, self.inner.record())
    }

    /// The largest departures from homogeneous shear, by name.
    fn departure<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let largest = self.inner.largest_departure();
        [
            ("gamma_spread", largest.gamma_spread),
            ("tau_spread", largest.tau_spread),
            ("sigma_v_spread", largest.vertical_spread),
            ("volume_strain", largest.volume_strain),
            ("velocity_deviation", largest.velocity_deviation / largest.edge_speed),
            ("overshoot", largest.overshoot),
        ]
        .into_py_dict(py)
    }

    /// Cycles made, and present shear strain.
    #[getter]
    fn progress(&self) -> (f64, f64) {
        let now = self.inner.now();
        (now.cycle, now.strain[2])
    }

    /// Present time step, s.
    #[getter]
    fn time_step(&self) -> f64 {
        self.inner.time_step()
    }

    #[getter]
    fn computed_stress_nodes(&self) -> usize {
        self.inner.computed_stress_nodes()
    }

    /// Counts of the work done, by kind.
    fn counters<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        counted(py, &self.inner.counters())
    }

    fn is_free<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<bool>> {
        self.inner.is_free().to_pyarray(py)
    }

    fn position<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray2<f64>> {
        rows(py, &self.inner.position())
    }

    fn velocity<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray2<f64>> {
        rows(py, &self.inner.velocity())
    }

    /// Effective stress (n, 2, 4): `xx, yy, xy, zz` of both stress nodes, kPa, tension positive; NaN if not computed.
    fn stress<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray3<f64>>> {
        pages(py, &self.inner.stress())
    }

    /// Strain (n, 2, 3): `xx, yy`, engineering `xy` of both stress nodes; NaN if not computed.
    fn strain<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray3<f64>>> {
        pages(py, &self.inner.strain())
    }
}
