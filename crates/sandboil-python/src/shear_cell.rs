//! The shear cell as a Python class.

use crate::{
    errors::CoreError,
    material::soil,
    simulation::{counted, get, numerics, pages, rows, shaped},
};
use numpy::{PyArray1, PyArray2, PyArray3, ToPyArray};
use pyo3::{prelude::*, types::PyDict};
use sandboil_solver as solver;
use std::time::{Duration, Instant};

/// Steps between looks at the clock.
const STEPS_PER_LOOK: usize = 32;

/// A shear test under way. Arrays are copies; nodes row by row from the bottom.
#[pyclass(module = "sandboil._core")]
pub struct ShearCell {
    inner: solver::ShearCell,
}

#[pymethods]
impl ShearCell {
    #[new]
    fn new(test: &Bound<'_, PyDict>, threads: usize) -> PyResult<Self> {
        let numerics_dict: Bound<'_, PyDict> = get(test, "numerics")?;
        let gap_memory = get(&numerics_dict, "gap_memory")?;
        let test = solver::ShearTest {
            soil: soil(&get::<Bound<'_, PyDict>>(test, "material")?, gap_memory)?,
            void_ratio: get(test, "void_ratio")?,
            density: get(test, "density")?,
            vertical_stress: get(test, "sigma_v0")?,
            earth_pressure_coefficient: get(test, "K0")?,
            stress_ratio: get(test, "csr")?,
            size: get(test, "size")?,
            free_size: get(test, "free_size")?,
            spacing: get(test, "spacing")?,
            strain_step: get(test, "strain_step")?,
            inertia: get(test, "inertia")?,
            local_damping: get(test, "local_damping")?,
            strain_limit: get(test, "gamma_stop")?,
            cycle_limit: get(test, "max_cycles")?,
            every_stress_node: get(test, "every_stress_node")?,
            numerics: numerics(&numerics_dict)?,
        };
        Ok(Self { inner: solver::ShearCell::new(test, threads).map_err(CoreError)? })
    }

    /// Steps until `seconds` have passed or the test is over; returns whether it is.
    fn advance(&mut self, py: Python<'_>, seconds: f64) -> PyResult<bool> {
        let inner = &mut self.inner;
        let outcome = py.detach(|| -> Result<bool, solver::SolverError> {
            let budget = Duration::try_from_secs_f64(seconds).unwrap_or(Duration::MAX);
            let start = Instant::now();
            loop {
                if inner.advance(STEPS_PER_LOOK)? {
                    return Ok(true);
                }
                if start.elapsed() >= budget {
                    return Ok(false);
                }
            }
        });
        py.check_signals()?;
        Ok(outcome.map_err(CoreError)?)
    }

    /// Samples (m, channels) since the last call, tension positive; channels are the fields of the core's `Sample`.
    fn take_samples<'py>(&mut self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        let samples = self.inner.take_samples();
        let flat = samples.iter().flat_map(solver::Sample::values).collect();
        Ok(shaped(flat, (samples.len(), solver::Sample::CHANNELS))?.to_pyarray(py))
    }

    /// Steps after which the direction reversed.
    fn turns<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<u64>> {
        self.inner.turns().to_pyarray(py)
    }

    /// Present shear strain, and steps made.
    #[getter]
    fn progress(&self) -> (f64, u64) {
        (self.inner.now().gamma, self.inner.counters().steps)
    }

    /// Present time step, s.
    #[getter]
    fn time_step(&self) -> f64 {
        self.inner.time_step()
    }

    #[getter]
    fn time(&self) -> f64 {
        self.inner.time()
    }

    #[getter]
    fn computed_stress_nodes(&self) -> usize {
        self.inner.computed_stress_nodes()
    }

    /// Work done, by kind.
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
