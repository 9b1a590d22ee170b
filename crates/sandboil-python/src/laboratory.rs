//! The laboratory's specimen: a material point under test, of a soil of the core or of a model written in Python.

use crate::{
    errors::refused,
    soil::{Soil, integrator},
};
use numpy::{PyArray1, PyArray2, PyArrayMethods, ToPyArray, ndarray::Array2};
use pyo3::{
    exceptions::PyValueError,
    prelude::*,
    types::{IntoPyDict, PyDict},
};
use sandboil_soil::{
    Integrator, Moduli, SoilError, SoilModel, StrainIncrement, Stress, UpdateReport,
    laboratory::{self as lab, Ending, Path, Point, Record, Resolution, Shear, Turn, Turns},
    with_model,
};
use std::sync::{Arc, Mutex, PoisonError};

/// An exception that a Python model raised while the core was driving it.
type Raised = Arc<Mutex<Option<PyErr>>>;

/// A model written in Python: an object with `initialise`, `update`, `stress` and `moduli` (`sandboil.lab`).
struct PythonPoint {
    model: Py<PyAny>,
    state: Py<PyAny>,
    marked: Py<PyAny>,
    /// Stress and moduli of the state, and of the marked one.
    read: (Stress, Moduli),
    marked_read: (Stress, Moduli),
    raised: Raised,
}

fn stress_of([xx, yy, xy, zz]: [f64; 4]) -> Stress {
    Stress { xx, yy, xy, zz }
}

fn components(stress: Stress) -> [f64; 4] {
    [stress.xx, stress.yy, stress.xy, stress.zz]
}

fn read(model: &Bound<'_, PyAny>, state: &Bound<'_, PyAny>) -> PyResult<(Stress, Moduli)> {
    let stress: [f64; 4] = model.call_method1("stress", (state,))?.extract()?;
    let (shear, bulk): (f64, f64) = model.call_method1("moduli", (state,))?.extract()?;
    let sum: f64 = stress.iter().sum::<f64>() + shear + bulk;
    if sum.is_finite() {
        Ok((stress_of(stress), Moduli { bulk, shear }))
    } else {
        Err(PyValueError::new_err(format!(
            "the model gave stress {stress:?} kPa, G {shear} kPa and K {bulk} kPa: all must be finite"
        )))
    }
}

impl PythonPoint {
    fn new(
        model: &Bound<'_, PyAny>,
        stress: [f64; 4],
        void_ratio: Option<f64>,
        raised: Raised,
    ) -> PyResult<Self> {
        let state = model.call_method1("initialise", (stress, void_ratio))?;
        let read = read(model, &state)?;
        let state = state.unbind();
        let marked = state.clone_ref(model.py());
        Ok(Self { model: model.clone().unbind(), state, marked, read, marked_read: read, raised })
    }
}

impl Point for PythonPoint {
    fn mark(&mut self) {
        Python::attach(|py| self.marked = self.state.clone_ref(py));
        self.marked_read = self.read;
    }

    fn back(&mut self) {
        Python::attach(|py| self.state = self.marked.clone_ref(py));
        self.read = self.marked_read;
    }

    fn update(&mut self, de: &StrainIncrement, _integrator: &Integrator) -> Result<UpdateReport, SoilError> {
        let outcome = Python::attach(|py| -> PyResult<()> {
            let model = self.model.bind(py);
            let state = model.call_method1("update", (self.state.bind(py), (de.xx, de.yy, de.xy)))?;
            self.read = read(model, &state)?;
            self.state = state.unbind();
            Ok(())
        });
        outcome.map_err(|error| {
            let message = error.to_string();
            *self.raised.lock().unwrap_or_else(PoisonError::into_inner) = Some(error);
            SoilError::Outside(message)
        })?;
        Ok(UpdateReport::default())
    }

    fn stress(&self) -> Stress {
        self.read.0
    }

    fn moduli(&self) -> Moduli {
        self.read.1
    }

    fn void_ratio(&self) -> Option<f64> {
        None
    }

    fn plastic_shear_strain(&self) -> Option<f64> {
        None
    }

    fn reconsolidate(&mut self) -> bool {
        false
    }

    fn copy(&self) -> Box<dyn Point> {
        Python::attach(|py| {
            Box::new(Self {
                model: self.model.clone_ref(py),
                state: self.state.clone_ref(py),
                marked: self.marked.clone_ref(py),
                raised: self.raised.clone(),
                ..*self
            })
        })
    }
}

/// A material point under test. Stresses in kPa, tension positive; strains tension positive, shear engineering.
#[pyclass(module = "sandboil._core")]
pub struct Specimen {
    inner: lab::Specimen,
    raised: Raised,
}

fn turn((kind, value): (String, f64)) -> PyResult<Turn> {
    match kind.as_str() {
        "stress" => Ok(Turn::Stress(value)),
        "strain" => Ok(Turn::Strain(value)),
        other => Err(PyValueError::new_err(format!("turn {other:?}: must be 'stress' or 'strain'"))),
    }
}

#[pymethods]
impl Specimen {
    /// `material` is a soil of the core or an object with the methods of a Python model.
    #[new]
    #[pyo3(signature = (material, stress, void_ratio, *, scheme, tolerance=None, max_increment=None))]
    fn new(
        material: &Bound<'_, PyAny>,
        stress: [f64; 4],
        void_ratio: Option<f64>,
        scheme: &str,
        tolerance: Option<f64>,
        max_increment: Option<f64>,
    ) -> PyResult<Self> {
        let integrator = integrator(scheme, tolerance, max_increment)?;
        let raised = Raised::default();
        let inner = if let Ok(soil) = material.cast::<Soil>() {
            let specimen = with_model!(&soil.get().0, model => {
                lab::Specimen::new(model, stress_of(stress), void_ratio, integrator)
            });
            specimen.map_err(|error| refused(&error))?
        } else {
            let point = PythonPoint::new(material, stress, void_ratio, raised.clone())?;
            lab::Specimen::of_point(Box::new(point), integrator)
        };
        Ok(Self { inner, raised })
    }

    /// Direct simple shear from turn to turn, each `("stress", kPa)` or `("strain", engineering)`; with `count` the
    /// first two alternate. Returns the record and how it ended.
    #[pyo3(signature = (turns, *, drained, count=None, strain_step, strain_limit, stress_resolution, strain_resolution))]
    #[expect(clippy::too_many_arguments, reason = "keywords of the Python call")]
    fn shear<'py>(
        &mut self,
        py: Python<'py>,
        turns: Vec<(String, f64)>,
        drained: bool,
        count: Option<usize>,
        strain_step: f64,
        strain_limit: f64,
        stress_resolution: f64,
        strain_resolution: f64,
    ) -> PyResult<(Bound<'py, PyDict>, String)> {
        let turns: Vec<Turn> = turns.into_iter().map(turn).collect::<PyResult<_>>()?;
        let turns = match (count, turns.as_slice()) {
            (None, _) => Turns::Each(turns),
            (Some(count), &[odd, even]) => Turns::Alternating { odd, even, count },
            _ => return Err(PyValueError::new_err("count needs two turns")),
        };
        let test = Shear { drained, turns, strain_step, strain_limit };
        let record = Record::new(Resolution { stress: stress_resolution, strain: strain_resolution });
        self.run(py, record, move |specimen, record, stop| specimen.shear(&test, record, stop))
    }

    /// Loads the specimen through rows of `(xx, yy, xy)`, each component a stress (kPa) if `by_stress` is true for it,
    /// else a total strain. Returns the record and how it ended.
    #[pyo3(signature = (rows, *, by_stress, strain_step, stress_resolution, strain_resolution))]
    fn path<'py>(
        &mut self,
        py: Python<'py>,
        rows: &Bound<'py, PyArray2<f64>>,
        by_stress: [bool; 3],
        strain_step: f64,
        stress_resolution: f64,
        strain_resolution: f64,
    ) -> PyResult<(Bound<'py, PyDict>, String)> {
        let rows = rows.readonly().as_array().outer_iter().map(|row| [row[0], row[1], row[2]]).collect();
        let path = Path { by_stress, rows, strain_step };
        let record = Record::new(Resolution { stress: stress_resolution, strain: strain_resolution });
        self.run(py, record, move |specimen, record, stop| specimen.path(&path, record, stop))
    }

    /// Another specimen in the same state.
    fn copy(&self) -> Self {
        Self { inner: self.inner.copy(), raised: self.raised.clone() }
    }

    /// Switches to reconsolidation after shaking; returns whether the model has another law for it.
    fn reconsolidate(&mut self) -> bool {
        self.inner.reconsolidate()
    }

    /// Effective stress `(xx, yy, xy, zz)`.
    #[getter]
    fn stress(&self) -> [f64; 4] {
        components(self.inner.stress())
    }

    /// Strain `(xx, yy, xy)` since the specimen was made.
    #[getter]
    fn strain(&self) -> [f64; 3] {
        self.inner.strain()
    }

    /// Present `(G, K)`, kPa.
    #[getter]
    fn moduli(&self) -> (f64, f64) {
        let Moduli { bulk, shear } = self.inner.point().moduli();
        (shear, bulk)
    }

    #[getter]
    fn void_ratio(&self) -> Option<f64> {
        self.inner.point().void_ratio()
    }

    #[getter]
    fn plastic_shear_strain(&self) -> Option<f64> {
        self.inner.point().plastic_shear_strain()
    }

    /// Counts of operations of the model by name, including trials that were given up.
    fn report<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        self.inner.report().named().into_py_dict(py)
    }
}

impl Specimen {
    fn run<'py>(
        &mut self,
        py: Python<'py>,
        mut record: Record,
        test: impl FnOnce(&mut lab::Specimen, &mut Record, &mut dyn FnMut() -> bool) -> Ending + Send,
    ) -> PyResult<(Bound<'py, PyDict>, String)> {
        let inner = &mut self.inner;
        let (ending, record, signal) = py.detach(move || {
            let mut signal = None;
            let mut stop = || {
                signal = Python::attach(|py: Python<'_>| py.check_signals()).err();
                signal.is_some()
            };
            let ending = test(inner, &mut record, &mut stop);
            (ending, record, signal)
        });
        if let Some(signal) = signal {
            return Err(signal);
        }
        if let Some(raised) = self.raised.lock().unwrap_or_else(PoisonError::into_inner).take() {
            // A trial that failed and was repeated with a smaller step is no failure of the test.
            if matches!(ending, Ending::Refused(SoilError::Outside(_))) {
                return Err(raised);
            }
        }
        Ok((columns(py, &record)?, message(&ending)))
    }
}

/// The columns of a record by name, tension positive.
pub fn columns<'py>(py: Python<'py>, record: &Record) -> PyResult<Bound<'py, PyDict>> {
    let rows = record.rows();
    let table = |width: usize, value: &dyn Fn(usize, usize) -> f64| -> Bound<'py, PyArray2<f64>> {
        Array2::from_shape_fn((rows.len(), width), |(row, column)| value(row, column)).to_pyarray(py)
    };
    let column = |value: &dyn Fn(usize) -> f64| -> Bound<'py, PyArray1<f64>> {
        (0..rows.len()).map(value).collect::<Vec<f64>>().to_pyarray(py)
    };
    let dict = PyDict::new(py);
    dict.set_item("strain", table(3, &|row, k| rows[row].strain[k]))?;
    dict.set_item("stress", table(4, &|row, k| components(rows[row].stress)[k]))?;
    dict.set_item("void_ratio", column(&|row| rows[row].void_ratio.unwrap_or(f64::NAN)))?;
    dict.set_item("cycle", column(&|row| rows[row].cycle))?;
    let turns: Vec<i64> = rows.iter().map(|row| i64::try_from(row.turns).unwrap_or(i64::MAX)).collect();
    dict.set_item("turns", turns.to_pyarray(py))?;
    Ok(dict)
}

/// How a test ended: `complete`, `strain limit`, or a reason in words.
fn message(ending: &Ending) -> String {
    match ending {
        Ending::Complete => "complete".into(),
        Ending::StrainLimit => "strain limit".into(),
        Ending::Interrupted => "interrupted".into(),
        Ending::Refused(error) => error.to_string(),
        Ending::StressNotCarried { wanted, reached } => format!(
            "the soil does not carry the effective stress (xx, yy, xy) = ({:.6}, {:.6}, {:.6}) kPa: \
             ({:.6}, {:.6}, {:.6}) kPa was reached",
            wanted.xx, wanted.yy, wanted.xy, reached.xx, reached.yy, reached.xy
        ),
    }
}

/// Shear and bulk modulus, kPa, of a soil at rest under the effective stress `(xx, yy, xy, zz)`, kPa, tension
/// positive.
#[pyfunction]
pub fn small_strain_moduli(soil: &Soil, stress: [f64; 4]) -> PyResult<(f64, f64)> {
    let moduli = soil.0.small_strain_moduli(stress_of(stress)).map_err(|error| refused(&error))?;
    Ok((moduli.shear, moduli.bulk))
}

/// Whether a soil can carry an effective stress `(xx, yy, xy, zz)`, kPa, tension positive, without a change.
#[pyfunction]
pub fn carries(soil: &Soil, stress: [f64; 4]) -> bool {
    with_model!(&soil.0, model => model.carries(&stress_of(stress)))
}

/// Every constant of PM4Sand at an initial effective stress `(xx, yy, xy, zz)`, kPa, tension positive: defaults filled
/// in, and what follows from the stress.
#[pyfunction]
pub fn pm4sand_constants<'py>(
    py: Python<'py>,
    soil: &Soil,
    stress: [f64; 4],
) -> PyResult<Bound<'py, PyDict>> {
    let sandboil_soil::Soil::PM4Sand(sand) = &soil.0 else {
        return Err(PyValueError::new_err("soil: must be PM4Sand"));
    };
    let state = sand.initialise(stress_of(stress), None).map_err(|error| refused(&error))?;
    let c = sand.parameters();
    let moduli = sand.moduli(&state);
    let surfaces = sand.surfaces_of(&state);
    [
        ("Dr", c.dr),
        ("G0", c.g0),
        ("hpo", c.hpo),
        ("p_atm", c.p_atm),
        ("ho", c.ho),
        ("e_max", c.e_max),
        ("e_min", c.e_min),
        ("nb", c.nb),
        ("nd", c.nd),
        ("Ado", state.dilatancy_scale()),
        ("z_max", state.fabric_limit()),
        ("cz", c.cz),
        ("ce", c.ce),
        ("C_GD", c.c_gd),
        ("C_DR", c.c_dr),
        ("C_kaf", c.c_kaf),
        ("Q", c.q),
        ("R", c.r),
        ("m", c.m),
        ("F_sed_min", c.f_sed_min),
        ("p_sed_o", c.p_sed_o),
        ("M", c.critical_ratio),
        ("xi_R", surfaces.state_index),
        ("Mb", surfaces.bounding),
        ("Md", surfaces.dilatancy),
        ("p_min", state.minimum_pressure()),
        ("e", c.initial_void_ratio()),
        ("G", moduli.shear),
        ("K", moduli.bulk),
    ]
    .into_py_dict(py)
}
