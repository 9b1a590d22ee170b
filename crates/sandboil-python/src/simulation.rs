//! The solver as a Python class: arrays in, arrays out, chunks of steps in between.

use crate::{
    errors::{CoreError, state_error},
    material::{integrator, retention, soil},
    seepage::boundary,
};
use numpy::{PyArray1, PyArray2, PyArray3, PyReadonlyArray1, PyReadonlyArray2, ToPyArray, ndarray::Array};
use pyo3::{
    exceptions::PyValueError,
    prelude::*,
    types::{PyBytes, PyDict},
};
use sandboil_solver as solver;
use std::{
    fs::File,
    io::{self, BufWriter, Read},
    path::{Path, PathBuf},
    time::{Duration, Instant},
};

/// Steps between looks at the clock.
const STEPS_PER_LOOK: u64 = 32;

/// Times and values of history samples.
type Histories<'py> = (Bound<'py, PyArray1<f64>>, Bound<'py, PyArray3<f64>>);

/// Times and values of samples of energy.
type Energies<'py> = (Bound<'py, PyArray1<f64>>, Bound<'py, PyArray2<f64>>);

pub fn get<'py, T>(dict: &Bound<'py, PyDict>, key: &str) -> PyResult<T>
where
    T: for<'a> FromPyObject<'a, 'py>,
    for<'a> <T as FromPyObject<'a, 'py>>::Error: Into<PyErr>,
{
    let value = dict.get_item(key)?.ok_or_else(|| PyValueError::new_err(format!("{key} is missing")))?;
    value.extract().map_err(Into::into)
}

fn one_of<T: Copy>(key: &str, value: &str, choices: &[(&str, T)]) -> PyResult<T> {
    choices.iter().find(|(name, _)| *name == value).map(|(_, choice)| *choice).ok_or_else(|| {
        let names: Vec<&str> = choices.iter().map(|(name, _)| *name).collect();
        PyValueError::new_err(format!("{key} = {value:?}: must be one of {names:?}"))
    })
}

pub fn vectors(rows: &PyReadonlyArray2<'_, f64>) -> Vec<solver::Vec2> {
    rows.as_array().outer_iter().map(|row| solver::Vec2::new(row[0], row[1])).collect()
}

pub fn numerics(dict: &Bound<'_, PyDict>) -> PyResult<solver::Numerics> {
    let text = |key| get::<String>(dict, key);
    Ok(solver::Numerics {
        operators: one_of(
            "operators",
            &text("operators")?,
            &[("conservative", solver::Operators::Conservative), ("printed", solver::Operators::Printed)],
        )?,
        smoothing_ratio: get(dict, "smoothing_ratio")?,
        velocity_filter: get(dict, "velocity_filter")?,
        diffusion: one_of(
            "diffusion",
            &text("diffusion")?,
            &[
                ("auto", solver::Diffusion::Auto),
                ("implicit", solver::Diffusion::Implicit),
                ("explicit", solver::Diffusion::Explicit),
            ],
        )?,
        acceleration_term: one_of(
            "acceleration_term",
            &text("acceleration_term")?,
            &[
                ("auto", solver::AccelerationTerm::Auto),
                ("on", solver::AccelerationTerm::On),
                ("off", solver::AccelerationTerm::Off),
            ],
        )?,
        dispersion_correction: get(dict, "dispersion_correction")?,
        geometry_strain_limit: get(dict, "geometry_strain_limit")?,
        integrator: integrator(&text("integrator")?, get(dict, "integrator_tolerance")?, None)?,
    })
}

/// Largest and smallest conductivity, m/s, and the direction of the largest.
fn conductivity(dict: &Bound<'_, PyDict>) -> PyResult<solver::Conductivity> {
    let (major, minor, (x, y)): (f64, f64, (f64, f64)) = get(dict, "hydraulic_conductivity")?;
    Ok(solver::Conductivity { major, minor, direction: solver::Vec2::new(x, y) })
}

fn region(dict: &Bound<'_, PyDict>, gap_memory: bool) -> PyResult<solver::Region> {
    Ok(solver::Region {
        soil: soil(&get::<Bound<'_, PyDict>>(dict, "material")?, gap_memory)?,
        porosity: get(dict, "porosity")?,
        solid_density: get(dict, "solid_density")?,
        hydraulic_conductivity: conductivity(dict)?,
        retention: get::<Option<(f64, f64, f64, f64)>>(dict, "retention")?.map(retention).transpose()?,
        earth_pressure_coefficient: get(dict, "earth_pressure_coefficient")?,
        static_poisson_ratio: get(dict, "static_poisson_ratio")?,
    })
}

const SUPPORTS: [(&str, solver::Support); 4] = [
    ("no-slip", solver::Support::NoSlip),
    ("fixed", solver::Support::NoSlip),
    ("free-slip", solver::Support::FreeSlip),
    ("roller", solver::Support::FreeSlip),
];

fn side(dict: &Bound<'_, PyDict>) -> PyResult<solver::Side> {
    Ok(solver::Side {
        x: get(dict, "x")?,
        extent: [get(dict, "bottom")?, get(dict, "top")?],
        support: one_of("support", &get::<String>(dict, "support")?, &SUPPORTS)?,
    })
}

fn outline(dict: &Bound<'_, PyDict>) -> PyResult<solver::Outline> {
    let sides = ["left", "right"]
        .map(|key| get::<Option<Bound<'_, PyDict>>>(dict, key)?.as_ref().map(side).transpose());
    let [left, right] = sides;
    Ok(solver::Outline {
        base: vectors(&get(dict, "base")?),
        base_support: one_of("base_support", &get::<String>(dict, "base_support")?, &SUPPORTS)?,
        sides: [left?, right?],
    })
}

fn moving_boundary(dict: &Bound<'_, PyDict>) -> PyResult<solver::MovingBoundary> {
    Ok(solver::MovingBoundary { boundary: boundary(dict)?, at_rest: get(dict, "at_rest")? })
}

/// Interval, horizontal and vertical velocities of an upgoing wave.
type WaveArrays<'py> = (f64, PyReadonlyArray1<'py, f64>, Option<PyReadonlyArray1<'py, f64>>);

fn base(stage: &Bound<'_, PyDict>) -> PyResult<solver::Base> {
    let dict: Bound<'_, PyDict> = get(stage, "base")?;
    let waves = get::<Vec<WaveArrays<'_>>>(stage, "waves")?
        .into_iter()
        .map(|(interval, horizontal, vertical)| -> PyResult<_> {
            let vertical = vertical.map(|samples| samples.as_slice().map(<[f64]>::to_vec)).transpose()?;
            Ok(solver::UpgoingWave {
                interval,
                horizontal: horizontal.as_slice()?.to_vec(),
                vertical: vertical.unwrap_or_default(),
            })
        })
        .collect::<PyResult<Vec<_>>>()?;
    let half_space: Option<(f64, Option<f64>, f64)> = get(&dict, "half_space")?;
    let segments: Vec<(f64, f64, Option<usize>, f64, f64)> = get(&dict, "segments")?;
    let segment = |(from, to, wave, delay, slowness): (f64, f64, Option<usize>, f64, f64)| match wave {
        Some(wave) if wave >= waves.len() => {
            Err(PyValueError::new_err(format!("segments: there is no wave {wave}")))
        }
        _ => Ok(solver::BaseSegment { extent: [from, to], wave, delay, slowness }),
    };
    Ok(solver::Base {
        vertical: one_of(
            "vertical",
            &get::<String>(&dict, "vertical")?,
            &[("roller", solver::Vertical::Roller), ("absorbing", solver::Vertical::Absorbing)],
        )?,
        half_space: half_space.map(|(shear_speed, compression_speed, density)| solver::HalfSpace {
            shear_speed,
            compression_speed,
            density,
        }),
        segments: segments.into_iter().map(segment).collect::<PyResult<_>>()?,
        datum: None,
        waves,
    })
}

fn output(stage: &Bound<'_, PyDict>) -> PyResult<solver::Output> {
    Ok(solver::Output {
        probes: vectors(&get(stage, "probes")?),
        history_interval: get(stage, "history_interval")?,
        stress_histories: get(stage, "stress_histories")?,
        pressure_envelope: get(stage, "pressure_envelope")?,
        strain_envelope: get(stage, "strain_envelope")?,
        record_columns: get(stage, "record_columns")?,
    })
}

fn time_step_factor(stage: &Bound<'_, PyDict>) -> PyResult<f64> {
    Ok(get::<Option<f64>>(stage, "time_step_factor")?.unwrap_or(solver::MOVING_FACTOR))
}

fn run_out(stage: &Bound<'_, PyDict>, dict: &Bound<'_, PyDict>) -> PyResult<solver::RunOut> {
    let line: Option<PyReadonlyArray2<f64>> = get(dict, "still_water")?;
    Ok(solver::RunOut {
        duration: get(stage, "duration")?,
        viscosity: get(dict, "viscosity")?,
        open: get(dict, "open")?,
        still_water: line.as_ref().map(vectors),
        local_damping: get(stage, "local_damping")?,
        time_step_factor: time_step_factor(stage)?,
        output: output(stage)?,
    })
}

fn shaking(stage: &Bound<'_, PyDict>) -> PyResult<solver::Shaking> {
    let [left, right] = get::<[String; 2]>(stage, "sides")?;
    let is_free = |side: &str| one_of("sides", side, &[("free-field", true), ("wall", false)]);
    let rayleigh: Option<(f64, [f64; 2])> = get(stage, "rayleigh")?;
    Ok(solver::Shaking {
        duration: get(stage, "duration")?,
        base: base(stage)?,
        free_field: [is_free(&left)?, is_free(&right)?],
        column_records: column_records(stage)?,
        local_damping: get(stage, "local_damping")?,
        rayleigh: rayleigh.map(|(ratio, frequencies)| solver::Rayleigh { ratio, frequencies }),
        time_step_factor: time_step_factor(stage)?,
        conditions: get::<Vec<Bound<'_, PyDict>>>(stage, "conditions")?
            .iter()
            .map(moving_boundary)
            .collect::<PyResult<_>>()?,
        output: output(stage)?,
    })
}

pub fn model(dict: &Bound<'_, PyDict>) -> PyResult<solver::Model> {
    let numerics_dict: Bound<'_, PyDict> = get(dict, "numerics")?;
    let gap_memory = get(&numerics_dict, "gap_memory")?;
    let regions: Vec<Bound<'_, PyDict>> = get(dict, "regions")?;
    let water: Option<(f64, f64)> = get(dict, "water")?;
    let (dx, dy): (f64, f64) = get(dict, "spacing")?;
    let floats =
        |key| -> PyResult<Vec<f64>> { Ok(get::<PyReadonlyArray1<'_, f64>>(dict, key)?.as_slice()?.to_vec()) };
    Ok(solver::Model {
        spacing: solver::Vec2::new(dx, dy),
        position: vectors(&get(dict, "position")?),
        volume: floats("volume")?,
        region: get::<PyReadonlyArray1<'_, u32>>(dict, "region")?.as_slice()?.to_vec(),
        regions: regions.iter().map(|entry| region(entry, gap_memory)).collect::<PyResult<_>>()?,
        surface_elevation: floats("surface_elevation")?,
        vertical_effective_stress: floats("vertical_effective_stress")?,
        pore_pressure: floats("pore_pressure")?,
        saturation: floats("saturation")?,
        water: water.map(|(unit_weight, bulk_modulus)| solver::Water { unit_weight, bulk_modulus }),
        gravity: get(dict, "gravity")?,
        period: get::<Option<f64>>(dict, "period")?.map(|width| solver::Period { width }),
        outline: outline(dict)?,
        numerics: numerics(&numerics_dict)?,
    })
}

fn column_record(dict: &Bound<'_, PyDict>) -> PyResult<solver::ColumnRecord> {
    let impedance: PyReadonlyArray2<'_, f64> = get(dict, "impedance")?;
    let row = |row: numpy::ndarray::ArrayView1<'_, f64>| solver::Impedance {
        density: row[0],
        shear_speed: row[1],
        compression_speed: row[2],
    };
    Ok(solver::ColumnRecord {
        interval: get(dict, "interval")?,
        impedance: impedance.as_array().outer_iter().map(row).collect(),
        wet: get(dict, "wet")?,
        values: get::<PyReadonlyArray1<'_, f64>>(dict, "values")?.as_slice()?.to_vec(),
    })
}

fn column_records(stage: &Bound<'_, PyDict>) -> PyResult<[Option<solver::ColumnRecord>; 2]> {
    let [left, right] = get::<[Option<Bound<'_, PyDict>>; 2]>(stage, "column_records")?;
    let read = |record: Option<Bound<'_, PyDict>>| record.as_ref().map(column_record).transpose();
    Ok([read(left)?, read(right)?])
}

/// Offset of a node's first stress node, m; the second lies opposite.
#[pyfunction]
pub fn stress_node_offset(dx: f64, dy: f64) -> (f64, f64) {
    let offset = solver::stress_node_offset(solver::Vec2::new(dx, dy));
    (offset.x, offset.y)
}

/// Most bytes of a state that are read: a section of ten million nodes, the largest that a scene may have, takes some
/// 5 kB for each.
const MAX_STATE_BYTES: u64 = 1 << 36;

/// The bytes of a stored state; the first ones alone if they are not those of one, before memory is taken for the rest.
fn stored(path: &Path) -> io::Result<Vec<u8>> {
    let file = File::open(path)?;
    let mut bytes = Vec::new();
    (&file).take(solver::checkpoint::MAGIC.len() as u64).read_to_end(&mut bytes)?;
    if bytes == solver::checkpoint::MAGIC {
        let rest = file.metadata()?.len().min(MAX_STATE_BYTES);
        bytes.reserve_exact(usize::try_from(rest).unwrap_or_default());
        (&file).take(MAX_STATE_BYTES).read_to_end(&mut bytes)?;
    }
    Ok(bytes)
}

/// The note that was stored with a state in a file, whichever build wrote it.
#[pyfunction]
#[allow(clippy::needless_pass_by_value)] // PyO3 gives paths as owned values only
pub fn stored_note(py: Python<'_>, path: PathBuf) -> PyResult<Bound<'_, PyBytes>> {
    let bytes = py.detach(|| stored(&path))?;
    match py.detach(|| solver::checkpoint::note(&bytes)) {
        Ok(note) => Ok(PyBytes::new(py, note)),
        Err(error) => Err(state_error(py, &path, &error)?),
    }
}

/// A section under way. Arrays are copies, in the order of the nodes given.
#[pyclass(module = "sandboil._core")]
pub struct Simulation {
    inner: solver::Simulation,
}

#[pymethods]
impl Simulation {
    #[new]
    fn new(description: &Bound<'_, PyDict>, threads: usize) -> PyResult<Self> {
        let model = model(description)?;
        let inner =
            description.py().detach(|| solver::Simulation::new(&model, threads)).map_err(CoreError)?;
        Ok(Self { inner })
    }

    /// Writes the state and a note to a file, and returns when the disk has them.
    fn store(&self, py: Python<'_>, path: PathBuf, note: &[u8]) -> PyResult<()> {
        let inner = &self.inner;
        let written = py.detach(move || -> io::Result<()> {
            let file = File::create(&path)?;
            inner.store(note, BufWriter::new(&file))?;
            file.sync_all()
        });
        Ok(written?)
    }

    /// The section of the description as it was stored in a file.
    #[staticmethod]
    #[allow(clippy::needless_pass_by_value)] // PyO3 gives paths as owned values only
    fn restore(
        py: Python<'_>,
        description: &Bound<'_, PyDict>,
        path: PathBuf,
        threads: usize,
    ) -> PyResult<Self> {
        let model = model(description)?;
        let restored = py.detach(|| -> io::Result<_> {
            Ok(solver::Simulation::restore(&model, threads, &stored(&path)?))
        });
        match restored? {
            Ok(inner) => Ok(Self { inner }),
            Err(solver::SolverError::State(error)) => Err(state_error(py, &path, &error)?),
            Err(other) => Err(CoreError(other).into()),
        }
    }

    #[pyo3(signature = (*, tolerance, max_steps))]
    fn begin_gravity(&mut self, tolerance: f64, max_steps: u64) -> PyResult<()> {
        Ok(self.inner.begin(solver::Gravity { tolerance, max_steps }).map_err(CoreError)?)
    }

    fn begin_shaking(&mut self, stage: &Bound<'_, PyDict>) -> PyResult<()> {
        let begun = match get::<Option<Bound<'_, PyDict>>>(stage, "run_out")? {
            Some(dict) => self.inner.begin(run_out(stage, &dict)?),
            None => self.inner.begin(shaking(stage)?),
        };
        Ok(begun.map_err(CoreError)?)
    }

    /// Steps until `until` (s), `steps` are made or `seconds` have passed; returns whether the stage is over.
    #[pyo3(signature = (*, steps, until, seconds))]
    fn advance(&mut self, py: Python<'_>, steps: u64, until: f64, seconds: f64) -> PyResult<bool> {
        let inner = &mut self.inner;
        let outcome = py.detach(|| -> Result<bool, solver::SolverError> {
            let budget = Duration::try_from_secs_f64(seconds).unwrap_or(Duration::MAX);
            let start = Instant::now();
            let target = inner.step().saturating_add(steps);
            loop {
                let before = inner.step();
                let done = inner.advance(STEPS_PER_LOOK.min(target - before), until)?;
                if done || inner.step() == before || inner.step() >= target || start.elapsed() >= budget {
                    return Ok(done);
                }
            }
        });
        py.check_signals()?;
        Ok(outcome.map_err(CoreError)?)
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

    /// Work done, by kind.
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

    /// Effective stress (n, 2, 4): `xx, yy, xy, zz` of both stress nodes, kPa, tension positive.
    fn stress<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray3<f64>>> {
        pages(py, &self.inner.stress())
    }

    /// Strain (n, 2, 3): `xx, yy`, engineering `xy` of both stress nodes.
    fn strain<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray3<f64>>> {
        pages(py, &self.inner.strain())
    }

    /// What the columns of the left and the right side did in the stage, if it is recorded; once.
    fn take_column_records<'py>(&mut self, py: Python<'py>) -> PyResult<[Option<Bound<'py, PyDict>>; 2]> {
        let told = |record: solver::ColumnRecord| -> PyResult<Bound<'py, PyDict>> {
            let dict = PyDict::new(py);
            let rows = record.impedance.len();
            let speeds = record.impedance.iter();
            let impedance: Vec<f64> =
                speeds.flat_map(|row| [row.density, row.shear_speed, row.compression_speed]).collect();
            dict.set_item("interval", record.interval)?;
            dict.set_item("impedance", shaped(impedance, (rows, 3))?.to_pyarray(py))?;
            dict.set_item("wet", record.wet)?;
            dict.set_item("width", solver::ColumnRecord::width(rows, record.wet))?;
            dict.set_item("values", record.values.to_pyarray(py))?;
            Ok(dict)
        };
        let [left, right] = self.inner.take_column_records();
        Ok([left.map(told).transpose()?, right.map(told).transpose()?])
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

/// Work done, by kind, as a dictionary.
pub fn counted<'py>(py: Python<'py>, counters: &solver::Counters) -> PyResult<Bound<'py, PyDict>> {
    let dict = PyDict::new(py);
    for (name, value) in [
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
    {
        dict.set_item(name, value)?;
    }
    Ok(dict)
}

pub fn shaped<D: numpy::ndarray::Dimension>(
    values: Vec<f64>,
    shape: impl numpy::ndarray::IntoDimension<Dim = D>,
) -> PyResult<Array<f64, D>> {
    Array::from_shape_vec(shape.into_dimension(), values)
        .map_err(|error| PyValueError::new_err(error.to_string()))
}

pub fn rows<'py>(py: Python<'py>, values: &[[f64; 2]]) -> Bound<'py, PyArray2<f64>> {
    numpy::ndarray::arr2(values).to_pyarray(py)
}

pub fn pages<'py, const N: usize>(
    py: Python<'py>,
    values: &[[[f64; N]; 2]],
) -> PyResult<Bound<'py, PyArray3<f64>>> {
    let flat = values.iter().flatten().flatten().copied().collect();
    Ok(shaped(flat, (values.len(), 2, N))?.to_pyarray(py))
}
