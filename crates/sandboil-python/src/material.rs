//! Materials and integrators from the plain dictionaries that `sandboil.materials` makes.

use crate::errors::CoreError;
use pyo3::{exceptions::PyValueError, prelude::*, types::PyDict};
use sandboil_soil::{
    Integrator, Soil, SoilError, Stress,
    elastic::Elastic,
    pm4sand::{Options, PM4Sand, Parameters},
};
use sandboil_solver::SolverError;

/// A refusal of the soil crate as the exception that tells it.
pub fn refused(error: &SoilError) -> PyErr {
    match *error {
        SoilError::InvalidParameter { name, value, expected } => {
            CoreError(SolverError::InvalidInput { name, value, expected }).into()
        }
        ref other => PyValueError::new_err(other.to_string()),
    }
}

/// PM4Sand parameters; keys are those of `sandboil.PM4Sand`, `None` takes the default.
pub fn pm4sand_parameters(dict: &Bound<'_, PyDict>) -> PyResult<Parameters> {
    let optional = |key: &str| -> PyResult<Option<f64>> {
        dict.get_item(key)?.map_or(Ok(None), |value| value.extract())
    };
    let required =
        |key: &str| optional(key)?.ok_or_else(|| PyValueError::new_err(format!("PM4Sand needs {key}")));
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

/// A soil from its dictionary; `kind` says which.
pub fn soil(dict: &Bound<'_, PyDict>, gap_memory: bool) -> PyResult<Soil> {
    let value = |key: &str| -> PyResult<Bound<'_, PyAny>> {
        dict.get_item(key)?.ok_or_else(|| PyValueError::new_err(format!("material needs {key}")))
    };
    let kind: String = value("kind")?.extract()?;
    match kind.as_str() {
        "elastic" => {
            let elastic = Elastic::new(value("G")?.extract()?, value("K")?.extract()?);
            Ok(Soil::Elastic(elastic.map_err(|error| refused(&error))?))
        }
        "pm4sand" => Ok(Soil::PM4Sand(Box::new(pm4sand(dict, gap_memory)?))),
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

/// An integrator by its name, with what the user changed of it.
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
