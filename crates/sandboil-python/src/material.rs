//! Materials and integrators from the plain dictionaries that `sandboil.materials` makes.

use crate::errors::CoreError;
use pyo3::{exceptions::PyValueError, prelude::*, types::PyDict};
use sandboil_soil::{
    Integrator, Soil, SoilError, Strength, Stress, VanGenuchten,
    drucker_prager::{self, DruckerPrager, Matching},
    elastic::Elastic,
    mohr_coulomb::MohrCoulomb,
    pm4sand::{Options, PM4Sand, Parameters},
    pressure_elastic::PressureElastic,
    total_stress::{self, Criterion, Decay, TotalStress},
};
use sandboil_solver::SolverError;

/// An error of the soil crate as a Python exception.
pub fn refused(error: &SoilError) -> PyErr {
    match *error {
        SoilError::InvalidParameter { name, value, expected } => {
            CoreError(SolverError::InvalidInput { name, value, expected }).into()
        }
        ref other => PyValueError::new_err(other.to_string()),
    }
}

/// The value of a key; `None` if it is absent or is Python's `None`.
fn optional<'py, T: FromPyObjectOwned<'py>>(dict: &Bound<'py, PyDict>, key: &str) -> PyResult<Option<T>> {
    match dict.get_item(key)? {
        Some(value) if !value.is_none() => Ok(Some(value.extract().map_err(Into::into)?)),
        _ => Ok(None),
    }
}

fn required<'py, T: FromPyObjectOwned<'py>>(dict: &Bound<'py, PyDict>, key: &str) -> PyResult<T> {
    optional(dict, key)?.ok_or_else(|| PyValueError::new_err(format!("material needs {key}")))
}

/// PM4Sand parameters; keys are those of `sandboil.PM4Sand`, `None` takes the default.
pub fn pm4sand_parameters(dict: &Bound<'_, PyDict>) -> PyResult<Parameters> {
    let optional = |key: &str| optional(dict, key);
    let required = |key: &str| required(dict, key);
    Ok(Parameters {
        dr: required("Dr")?,
        g0: required("G0")?,
        hpo: required("hpo")?,
        p_atm: optional("p_atm")?,
        ho: optional("ho")?,
        e_max: optional("e_max")?,
        e_min: optional("e_min")?,
        nb: optional("nb")?,
        nd: optional("nd")?,
        ado: optional("Ado")?,
        z_max: optional("z_max")?,
        cz: optional("cz")?,
        ce: optional("ce")?,
        phi_cv: optional("phi_cv")?,
        nu: optional("nu")?,
        c_gd: optional("C_GD")?,
        c_dr: optional("C_DR")?,
        c_kaf: optional("C_kaf")?,
        q: optional("Q")?,
        r: optional("R")?,
        m: optional("m")?,
        f_sed_min: optional("F_sed_min")?,
        p_sed_o: optional("p_sed_o")?,
    })
}

/// PM4Sand from its dictionary.
pub fn pm4sand(dict: &Bound<'_, PyDict>, gap_memory: bool) -> PyResult<PM4Sand> {
    let options = Options { gap_memory, ..Options::default() };
    PM4Sand::new(pm4sand_parameters(dict)?, options).map_err(|error| refused(&error))
}

fn strength(dict: &Bound<'_, PyDict>) -> PyResult<Strength> {
    Ok(Strength { c: required(dict, "c")?, phi: required(dict, "phi")?, psi: required(dict, "psi")? })
}

fn drucker_prager(dict: &Bound<'_, PyDict>, elastic: Elastic) -> PyResult<DruckerPrager> {
    let peak = strength(dict)?;
    let softening = match optional(dict, "softening_strain")? {
        Some(strain) => {
            let residual = Strength {
                c: optional(dict, "c_residual")?.unwrap_or(peak.c),
                phi: optional(dict, "phi_residual")?.unwrap_or(peak.phi),
                psi: optional(dict, "psi_residual")?.unwrap_or(peak.psi),
            };
            Some(drucker_prager::Softening { residual, strain })
        }
        None => None,
    };
    let matching = match required::<String>(dict, "matching")?.as_str() {
        "usual" => Matching::Usual,
        "general" => Matching::General,
        other => return Err(PyValueError::new_err(format!("unknown matching {other:?}"))),
    };
    let tension_cutoff = optional(dict, "tension_cutoff")?;
    let parameters = drucker_prager::Parameters { peak, softening, tension_cutoff, matching };
    DruckerPrager::new(elastic, parameters).map_err(|error| refused(&error))
}

fn total_stress(dict: &Bound<'_, PyDict>, elastic: Elastic) -> PyResult<TotalStress> {
    let criterion = match required::<String>(dict, "criterion")?.as_str() {
        "tresca" => Criterion::Tresca,
        "von_mises" => Criterion::VonMises,
        other => return Err(PyValueError::new_err(format!("unknown criterion {other:?}"))),
    };
    let decay = match required::<String>(dict, "softening")?.as_str() {
        "exponential" => Decay::Exponential,
        "linear" => Decay::Linear,
        other => return Err(PyValueError::new_err(format!("unknown softening {other:?}"))),
    };
    let softening = match optional(dict, "Sr")? {
        Some(residual) => {
            let strain = required(dict, "softening_strain")?;
            Some(total_stress::Softening { residual, strain, decay })
        }
        None => None,
    };
    TotalStress::new(elastic, criterion, required(dict, "Su")?, softening).map_err(|error| refused(&error))
}

/// A soil from its dictionary; `kind` names the model.
pub fn soil(dict: &Bound<'_, PyDict>, gap_memory: bool) -> PyResult<Soil> {
    let elastic = || -> PyResult<Elastic> {
        Elastic::new(required(dict, "G")?, required(dict, "K")?).map_err(|error| refused(&error))
    };
    let kind: String = required(dict, "kind")?;
    match kind.as_str() {
        "elastic" => Ok(Soil::Elastic(elastic()?)),
        "drucker_prager" => Ok(Soil::DruckerPrager(drucker_prager(dict, elastic()?)?)),
        "mohr_coulomb" => MohrCoulomb::new(elastic()?, strength(dict)?, optional(dict, "tension_cutoff")?)
            .map(Soil::MohrCoulomb)
            .map_err(|error| refused(&error)),
        "pm4sand" => Ok(Soil::PM4Sand(Box::new(pm4sand(dict, gap_memory)?))),
        "pressure_elastic" => {
            PressureElastic::new(elastic()?, required(dict, "exponent")?, required(dict, "p_ref")?)
                .map(Soil::PressureElastic)
                .map_err(|error| refused(&error))
        }
        "total_stress" => Ok(Soil::TotalStress(total_stress(dict, elastic()?)?)),
        other => Err(PyValueError::new_err(format!("unknown material kind {other:?}"))),
    }
}

/// Shear and bulk modulus, kPa, of a soil at rest under the effective stress `(xx, yy, xy, zz)`, kPa, tension
/// positive.
#[pyfunction]
pub fn small_strain_moduli(material: &Bound<'_, PyDict>, stress: [f64; 4]) -> PyResult<(f64, f64)> {
    let [xx, yy, xy, zz] = stress;
    let moduli = soil(material, false)?.small_strain_moduli(Stress { xx, yy, xy, zz });
    let moduli = moduli.map_err(|error| refused(&error))?;
    Ok((moduli.shear, moduli.bulk))
}

/// Degree of saturation at pressure heads (m) by a retention curve `(alpha, n, residual, full)`.
#[pyfunction]
#[allow(clippy::needless_pass_by_value)] // arguments come from Python by value
pub fn saturation<'py>(
    py: Python<'py>,
    curve: (f64, f64, f64, f64),
    pressure_head: numpy::PyReadonlyArray1<'py, f64>,
) -> PyResult<Bound<'py, numpy::PyArray1<f64>>> {
    let curve = retention(curve)?;
    let heads = pressure_head.as_array();
    Ok(numpy::PyArray1::from_iter(py, heads.iter().map(|&head| curve.at(head).saturation)))
}

/// A retention curve by `(alpha, n, residual, full)`.
pub fn retention((alpha, n, residual, full): (f64, f64, f64, f64)) -> PyResult<VanGenuchten> {
    VanGenuchten::new(alpha, n, residual, full).map_err(|error| refused(&error))
}

/// An integrator by its name, with the values that the user has changed.
pub fn integrator(name: &str, tolerance: Option<f64>, max_increment: Option<f64>) -> PyResult<Integrator> {
    let max_increment = max_increment.unwrap_or(Integrator::DEFAULT_INCREMENT);
    match name {
        "default" => Ok(Integrator::ModifiedEuler {
            tolerance: tolerance.unwrap_or(Integrator::DEFAULT_TOLERANCE),
            max_increment,
        }),
        "rk4" => Ok(Integrator::RungeKutta4 { max_increment }),
        "reference" => Ok(Integrator::Reference),
        other => Err(PyValueError::new_err(format!(
            "integrator = {other:?}: must be 'default', 'rk4' or 'reference'"
        ))),
    }
}
