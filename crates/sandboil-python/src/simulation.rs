//! A section of moving ground as a Python class: arrays in, arrays out, chunks of steps in between.

use crate::{
    arrays::{pages, rows, shaped},
    columns::ColumnRecord,
    errors::{CoreError, state_error},
    section::Section,
    stages::AnyStage,
    stepping::repeat,
    stored,
};
use numpy::{PyArray1, PyArray2, PyArray3, ToPyArray};
use pyo3::{
    prelude::*,
    types::{IntoPyDict, PyDict},
};
use sandboil_solver as solver;
use std::{io, path::PathBuf};

/// Steps between looks at the clock.
const STEPS_PER_LOOK: u64 = 32;

/// Times and values of history samples.
type Histories<'py> = (Bound<'py, PyArray1<f64>>, Bound<'py, PyArray3<f64>>);

/// Times and values of samples of energy.
type Energies<'py> = (Bound<'py, PyArray1<f64>>, Bound<'py, PyArray2<f64>>);

/// A section under way. Arrays are copies, in the order of the nodes given.
#[pyclass(module = "sandboil._core")]
pub struct Simulation {
    inner: solver::Simulation,
}

#[pymethods]
impl Simulation {
    #[new]
    fn new(py: Python<'_>, section: &Section, threads: usize) -> PyResult<Self> {
        let inner = py.detach(|| solver::Simulation::new(&section.0, threads)).map_err(CoreError)?;
        Ok(Self { inner })
    }

    /// Writes the state and a note to a file, and returns when the disk has them.
    #[expect(clippy::needless_pass_by_value, reason = "PyO3 gives paths as owned values only")]
    fn store(&self, py: Python<'_>, path: PathBuf, note: &[u8]) -> PyResult<()> {
        Ok(py.detach(|| stored::write(&self.inner, &path, note))?)
    }

    /// The section as it was stored in a file.
    #[staticmethod]
    #[expect(clippy::needless_pass_by_value, reason = "PyO3 gives paths as owned values only")]
    fn restore(py: Python<'_>, section: &Section, path: PathBuf, threads: usize) -> PyResult<Self> {
        let restored = py.detach(|| -> io::Result<_> {
            Ok(solver::Simulation::restore(&section.0, threads, &stored::read(&path)?))
        });
        match restored? {
            Ok(inner) => Ok(Self { inner }),
            Err(solver::SolverError::State(error)) => Err(state_error(py, &path, &error)?),
            Err(other) => Err(CoreError(other).into()),
        }
    }

    /// Begins a stage.
    fn begin(&mut self, stage: AnyStage<'_>) -> PyResult<()> {
        Ok(self.inner.begin(stage).map_err(CoreError)?)
    }

    /// Steps until `until` (s), `steps` are made or `seconds` have passed; returns whether the stage is complete.
    #[pyo3(signature = (*, steps, until, seconds))]
    fn advance(&mut self, py: Python<'_>, steps: u64, until: f64, seconds: f64) -> PyResult<bool> {
        let inner = &mut self.inner;
        let target = inner.step().saturating_add(steps);
        let mut is_complete = false;
        repeat(py, seconds, || {
            let before = inner.step();
            is_complete = inner.advance(STEPS_PER_LOOK.min(target - before), until)?;
            Ok(is_complete || inner.step() == before || inner.step() >= target)
        })?;
        Ok(is_complete)
    }

    /// Names of the physics that a stage may compute, and whether the present stage does.
    fn physics<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        self.inner.physics().into_py_dict(py)
    }

    #[getter]
    fn time(&self) -> f64 {
        self.inner.time()
    }

    #[getter]
    fn step(&self) -> u64 {
        self.inner.step()
    }

    /// Present time step (s) and the name of what limits it.
    #[getter]
    fn time_step(&self) -> (f64, &'static str) {
        let (dt, criterion) = self.inner.time_step();
        (dt, criterion.name())
    }

    /// Time step (s) that the stage would have without its Rayleigh damping; None if it has none.
    #[getter]
    fn undamped_time_step(&self) -> Option<f64> {
        self.inner.undamped_time_step()
    }

    #[getter]
    fn is_complete(&self) -> bool {
        self.inner.is_complete()
    }

    #[getter]
    fn residual(&self) -> f64 {
        self.inner.residual()
    }

    /// Number of stress points.
    #[getter]
    fn stress_points(&self) -> usize {
        self.inner.stress_points()
    }

    #[getter]
    fn pairs(&self) -> usize {
        self.inner.pairs()
    }

    #[getter]
    fn base_impedance(&self) -> Vec<f64> {
        self.inner.base_impedances()
    }

    #[getter]
    fn flow_scheme(&self) -> &'static str {
        self.inner.flow_scheme_name()
    }

    /// Names and bytes of the arrays that exist.
    fn arrays(&self) -> Vec<(&'static str, usize)> {
        self.inner.arrays()
    }

    /// Counts of operations by name.
    fn counters<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        counted(py, &self.inner.counters())
    }

    fn position<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray2<f64>> {
        rows(py, &self.inner.position())
    }

    fn displacement<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray2<f64>> {
        rows(py, &self.inner.displacement())
    }

    fn velocity<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray2<f64>> {
        rows(py, &self.inner.velocity())
    }

    fn acceleration<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray2<f64>> {
        rows(py, &self.inner.acceleration())
    }

    fn excess_pore_pressure<'py>(&self, py: Python<'py>) -> Option<Bound<'py, PyArray1<f64>>> {
        self.inner.excess_pore_pressure().map(|values| values.to_pyarray(py))
    }

    /// Degree of saturation (n,); None where it cannot change.
    fn saturation<'py>(&self, py: Python<'py>) -> Option<Bound<'py, PyArray1<f64>>> {
        self.inner.saturation().map(|values| values.to_pyarray(py))
    }

    fn largest_excess_pore_pressure<'py>(&self, py: Python<'py>) -> Option<Bound<'py, PyArray1<f64>>> {
        self.inner.largest_excess_pore_pressure().map(|values| values.to_pyarray(py))
    }

    fn largest_shear_strain<'py>(&self, py: Python<'py>) -> Option<Bound<'py, PyArray1<f64>>> {
        self.inner.largest_shear_strain().map(|values| values.to_pyarray(py))
    }

    /// Effective stress (n, points, 4): `xx, yy, xy, zz` at the stress points of each node, kPa, tension positive.
    fn stress<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray3<f64>>> {
        pages(py, &self.inner.stress())
    }

    /// Strain (n, points, 3): `xx, yy`, engineering `xy` at the stress points of each node.
    fn strain<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray3<f64>>> {
        pages(py, &self.inner.strain())
    }

    /// What the columns of the left and the right side did in the stage, if it is recorded; once.
    fn take_column_records(&mut self) -> [Option<ColumnRecord>; 2] {
        self.inner.take_column_records().map(|record| record.map(ColumnRecord))
    }

    /// Samples of energy and masses since the last call: times (m,) and values (m, names).
    fn take_energy<'py>(&mut self, py: Python<'py>) -> PyResult<Energies<'py>> {
        let (times, values) = self.inner.take_energy();
        let shape = (times.len(), solver::ENERGY_NAMES.len());
        Ok((times.to_pyarray(py), shaped(values, shape)?.to_pyarray(py)))
    }

    fn channel_names(&self) -> Vec<&'static str> {
        self.inner.channel_names()
    }

    /// Closes the samples still collecting: the run ends here.
    fn finish_histories(&mut self) {
        self.inner.finish_histories();
    }

    /// History samples since the last call: times (m,) and values (m, probes, channels).
    fn take_histories<'py>(&mut self, py: Python<'py>) -> PyResult<Histories<'py>> {
        let (times, values) = self.inner.take_histories();
        let channels = self.inner.channel_names().len();
        let samples = times.len();
        let probes = if samples == 0 || channels == 0 { 0 } else { values.len() / (samples * channels) };
        Ok((times.to_pyarray(py), shaped(values, (samples, probes, channels))?.to_pyarray(py)))
    }
}

/// Counts of operations by name.
pub fn counted<'py>(py: Python<'py>, counters: &solver::Counters) -> PyResult<Bound<'py, PyDict>> {
    [
        ("steps", counters.steps),
        ("flow_calls", counters.flow_calls),
        ("base_calls", counters.base_calls),
        ("free_field_calls", counters.free_field_calls),
        ("inertia_corrections", counters.inertia_corrections),
        ("plastic_updates", counters.plastic_updates),
        ("geometry_builds", counters.geometry_builds),
        ("porosity_clips", counters.porosity_clips),
        ("inadmissible_starts", counters.inadmissible_starts),
        ("time_step_changes", counters.time_step_changes),
        ("edge_contacts", counters.edge_contacts),
    ]
    .into_iter()
    .chain(counters.soil.named())
    .into_py_dict(py)
}
