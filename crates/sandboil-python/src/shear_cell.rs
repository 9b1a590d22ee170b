//! The shear cell as a Python class.

use crate::{
    errors::CoreError,
    laboratory::columns,
    material::soil,
    simulation::{counted, get, numerics, pages, rows},
};
use numpy::{PyArray1, PyArray2, PyArray3, ToPyArray};
use pyo3::{prelude::*, types::PyDict};
use sandboil_soil::laboratory::Resolution;
use sandboil_solver as solver;
use std::time::{Duration, Instant};

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
    fn new(test: &Bound<'_, PyDict>, threads: usize) -> PyResult<Self> {
        let numerics_dict: Bound<'_, PyDict> = get(test, "numerics")?;
        let gap_memory = get(&numerics_dict, "gap_memory")?;
        let test = solver::CellTest {
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
            turn_limit: get(test, "turns")?,
            resolution: Resolution {
                stress: get(test, "stress_resolution")?,
                strain: get(test, "strain_resolution")?,
            },
            every_stress_node: get(test, "every_stress_node")?,
            numerics: numerics(&numerics_dict)?,
        };
        Ok(Self { inner: solver::ShearCell::new(test, threads).map_err(CoreError)? })
    }

    /// Makes steps until `seconds` have passed or the test is over; returns whether it is over.
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

    /// Means over the centre, with the columns of a specimen's record.
    fn record<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        columns(py, self.inner.record())
    }

    /// The largest departures from homogeneous shear, by name.
    fn departure<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let largest = self.inner.largest_departure();
        let dict = PyDict::new(py);
        for (name, value) in [
            ("gamma_spread", largest.gamma_spread),
            ("tau_spread", largest.tau_spread),
            ("sigma_v_spread", largest.vertical_spread),
            ("volume_strain", largest.volume_strain),
            ("velocity_deviation", largest.velocity_deviation / largest.edge_speed),
            ("overshoot", largest.overshoot),
        ] {
            dict.set_item(name, value)?;
        }
        Ok(dict)
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
