//! Stages in which grains may move: gravity, shaking and run-out.

use crate::{
    arrays::{Points, Values, one_of},
    columns::ColumnRecord,
    conditions::MovingCondition,
    errors::serialised,
};
use pyo3::{exceptions::PyValueError, prelude::*, types::PyBytes};
use sandboil_solver as solver;

/// An upgoing wave.
#[pyclass(module = "sandboil._core", frozen, eq, from_py_object)]
#[derive(Clone, PartialEq)]
pub struct Wave(solver::UpgoingWave);

#[pymethods]
impl Wave {
    #[new]
    #[pyo3(signature = (*, interval, horizontal, vertical))]
    fn new(interval: f64, horizontal: Values, vertical: Option<Values>) -> Self {
        let vertical = vertical.map(|samples| samples.0).unwrap_or_default();
        Self(solver::UpgoingWave { interval, horizontal: horizontal.0, vertical })
    }
}

/// A half-space given by its own properties.
#[pyclass(module = "sandboil._core", frozen, eq, from_py_object)]
#[derive(Clone, PartialEq)]
pub struct HalfSpace(solver::HalfSpace);

#[pymethods]
impl HalfSpace {
    #[new]
    #[pyo3(signature = (*, shear_speed, compression_speed, density))]
    fn new(shear_speed: f64, compression_speed: Option<f64>, density: f64) -> Self {
        Self(solver::HalfSpace { shear_speed, compression_speed, density })
    }
}

/// A stretch of the base and the wave that arrives there.
#[pyclass(module = "sandboil._core", frozen, eq, from_py_object)]
#[derive(Clone, PartialEq)]
pub struct BaseSegment(solver::BaseSegment);

#[pymethods]
impl BaseSegment {
    #[new]
    #[pyo3(signature = (*, extent, wave, delay, slowness))]
    fn new(extent: [f64; 2], wave: Option<usize>, delay: f64, slowness: f64) -> Self {
        Self(solver::BaseSegment { extent, wave, delay, slowness })
    }
}

const VERTICAL: [(&str, solver::Vertical); 2] =
    [("roller", solver::Vertical::Roller), ("absorbing", solver::Vertical::Absorbing)];

/// A compliant base and the waves that arrive through it.
#[pyclass(module = "sandboil._core", frozen, eq, from_py_object)]
#[derive(Clone, PartialEq)]
pub struct Base(solver::Base);

#[pymethods]
impl Base {
    #[new]
    #[pyo3(signature = (*, vertical, half_space, waves, segments))]
    fn new(
        vertical: &str,
        half_space: Option<HalfSpace>,
        waves: Vec<Wave>,
        segments: Vec<BaseSegment>,
    ) -> PyResult<Self> {
        if let Some(wave) = segments.iter().filter_map(|each| each.0.wave).find(|&wave| wave >= waves.len()) {
            return Err(PyValueError::new_err(format!("segments: there is no wave {wave}")));
        }
        Ok(Self(solver::Base {
            vertical: one_of("vertical", vertical, &VERTICAL)?,
            half_space: half_space.map(|below| below.0),
            waves: waves.into_iter().map(|wave| wave.0).collect(),
            segments: segments.into_iter().map(|segment| segment.0).collect(),
            datum: None,
        }))
    }
}

/// Rayleigh damping.
#[pyclass(module = "sandboil._core", frozen, eq, from_py_object)]
#[derive(Clone, PartialEq)]
pub struct Rayleigh(solver::Rayleigh);

#[pymethods]
impl Rayleigh {
    #[new]
    #[pyo3(signature = (*, ratio, frequencies))]
    fn new(ratio: f64, frequencies: [f64; 2]) -> Self {
        Self(solver::Rayleigh { ratio, frequencies })
    }
}

/// What is recorded of a stage.
#[pyclass(module = "sandboil._core", frozen, eq, from_py_object)]
#[derive(Clone, PartialEq)]
pub struct Output(solver::Output);

#[pymethods]
impl Output {
    #[new]
    #[pyo3(signature = (*, probes, history_interval, stress_histories, pressure_envelope, strain_envelope))]
    fn new(
        probes: Points,
        history_interval: f64,
        stress_histories: bool,
        pressure_envelope: bool,
        strain_envelope: bool,
    ) -> Self {
        Self(solver::Output {
            probes: probes.0,
            history_interval,
            stress_histories,
            pressure_envelope,
            strain_envelope,
            record_columns: None,
        })
    }
}

/// The static stage.
#[pyclass(module = "sandboil._core", frozen, eq)]
#[derive(PartialEq)]
pub struct Gravity(pub solver::Gravity);

#[pymethods]
impl Gravity {
    #[new]
    #[pyo3(signature = (*, tolerance, max_steps))]
    fn new(tolerance: f64, max_steps: u64) -> Self {
        Self(solver::Gravity { tolerance, max_steps })
    }

    fn __bytes__<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyBytes>> {
        bytes_of(py, self.0)
    }
}

/// A dynamic stage on a compliant base.
#[pyclass(module = "sandboil._core", frozen, eq)]
#[derive(PartialEq)]
pub struct Shaking(pub solver::Shaking);

#[pymethods]
impl Shaking {
    #[new]
    #[pyo3(signature = (
        *,
        duration,
        base,
        free_field,
        local_damping,
        rayleigh,
        conditions,
        time_step_factor,
        output,
    ))]
    #[expect(clippy::too_many_arguments, reason = "keywords of Python")]
    fn new(
        duration: f64,
        base: Base,
        free_field: [bool; 2],
        local_damping: f64,
        rayleigh: Option<Rayleigh>,
        conditions: Vec<MovingCondition>,
        time_step_factor: Option<f64>,
        output: Output,
    ) -> Self {
        Self(solver::Shaking {
            duration,
            base: base.0,
            free_field,
            column_records: [None, None],
            local_damping,
            rayleigh: rayleigh.map(|law| law.0),
            conditions: conditions.into_iter().map(|condition| condition.0).collect(),
            time_step_factor: time_step_factor.unwrap_or(solver::MOVING_FACTOR),
            output: output.0,
        })
    }

    /// The same stage, which reads the records of its columns, or records them at an interval in s.
    #[pyo3(signature = (*, records, record_interval))]
    fn with_columns(&self, records: [Option<ColumnRecord>; 2], record_interval: Option<f64>) -> Self {
        Self(solver::Shaking {
            column_records: records.map(|record| record.map(|record| record.0)),
            output: solver::Output { record_columns: record_interval, ..self.0.output.clone() },
            ..self.0.clone()
        })
    }

    fn __bytes__<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyBytes>> {
        bytes_of(py, self.0.clone())
    }
}

/// A stage of large displacements on held edges.
#[pyclass(module = "sandboil._core", frozen, eq)]
#[derive(PartialEq)]
pub struct RunOut(pub solver::RunOut);

#[pymethods]
impl RunOut {
    #[new]
    #[pyo3(signature = (*, duration, viscosity, open, still_water, local_damping, time_step_factor, output))]
    fn new(
        duration: f64,
        viscosity: f64,
        open: [bool; 2],
        still_water: Option<Points>,
        local_damping: f64,
        time_step_factor: Option<f64>,
        output: Output,
    ) -> Self {
        Self(solver::RunOut {
            duration,
            viscosity,
            open,
            still_water: still_water.map(|line| line.0),
            local_damping,
            time_step_factor: time_step_factor.unwrap_or(solver::MOVING_FACTOR),
            output: output.0,
        })
    }

    fn __bytes__<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyBytes>> {
        bytes_of(py, self.0.clone())
    }
}

/// A stage that can be begun.
#[derive(FromPyObject)]
pub enum AnyStage<'py> {
    Gravity(PyRef<'py, Gravity>),
    Shaking(PyRef<'py, Shaking>),
    RunOut(PyRef<'py, RunOut>),
}

impl From<AnyStage<'_>> for solver::Stage {
    fn from(stage: AnyStage<'_>) -> Self {
        match stage {
            AnyStage::Gravity(stage) => stage.0.into(),
            AnyStage::Shaking(stage) => stage.0.clone().into(),
            AnyStage::RunOut(stage) => stage.0.clone().into(),
        }
    }
}

/// All of a stage as bytes: equal stages have equal bytes.
fn bytes_of(py: Python<'_>, stage: impl Into<solver::Stage>) -> PyResult<Bound<'_, PyBytes>> {
    Ok(PyBytes::new(py, &serialised(&stage.into())?))
}
