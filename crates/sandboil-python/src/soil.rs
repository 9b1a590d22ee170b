//! Soils and integrators.

use crate::{arrays::one_of, errors::refused};
use pyo3::{exceptions::PyValueError, prelude::*};
use sandboil_soil::{
    Integrator, Strength,
    drucker_prager::{self, DruckerPrager, Matching},
    elastic::Elastic,
    mohr_coulomb::MohrCoulomb,
    pm4sand::{Options, PM4Sand, Parameters},
    pressure_elastic::PressureElastic,
    total_stress::{self, Criterion, Decay, TotalStress},
};

const MATCHING: [(&str, Matching); 2] = [("usual", Matching::Usual), ("general", Matching::General)];
const CRITERIA: [(&str, Criterion); 2] = [("tresca", Criterion::Tresca), ("von_mises", Criterion::VonMises)];
const DECAYS: [(&str, Decay); 2] = [("exponential", Decay::Exponential), ("linear", Decay::Linear)];

/// A soil with its parameters, under the names that users give them.
#[pyclass(module = "sandboil._core", frozen, eq, from_py_object)]
#[derive(Clone, PartialEq)]
pub struct Soil(pub sandboil_soil::Soil);

fn elastic(shear: f64, bulk: f64) -> PyResult<Elastic> {
    Elastic::new(shear, bulk).map_err(|error| refused(&error))
}

#[pymethods]
#[expect(non_snake_case, reason = "the field's names")]
impl Soil {
    #[staticmethod]
    #[pyo3(signature = (*, G, K))]
    fn elastic(G: f64, K: f64) -> PyResult<Self> {
        Ok(Self(sandboil_soil::Soil::Elastic(elastic(G, K)?)))
    }

    #[staticmethod]
    #[pyo3(signature = (*, G, K, exponent, p_ref))]
    fn pressure_elastic(G: f64, K: f64, exponent: f64, p_ref: f64) -> PyResult<Self> {
        let soil = PressureElastic::new(elastic(G, K)?, exponent, p_ref).map_err(|error| refused(&error))?;
        Ok(Self(sandboil_soil::Soil::PressureElastic(soil)))
    }

    #[staticmethod]
    #[pyo3(signature = (*, G, K, c, phi, psi, tension_cutoff=None))]
    fn mohr_coulomb(
        G: f64,
        K: f64,
        c: f64,
        phi: f64,
        psi: f64,
        tension_cutoff: Option<f64>,
    ) -> PyResult<Self> {
        let strength = Strength { c, phi, psi };
        let soil =
            MohrCoulomb::new(elastic(G, K)?, strength, tension_cutoff).map_err(|error| refused(&error))?;
        Ok(Self(sandboil_soil::Soil::MohrCoulomb(soil)))
    }

    /// Without `softening_strain` strength stays; a residual value that is left out is that of the peak.
    #[staticmethod]
    #[pyo3(signature = (
        *,
        G,
        K,
        c,
        phi,
        psi,
        matching,
        tension_cutoff=None,
        c_residual=None,
        phi_residual=None,
        psi_residual=None,
        softening_strain=None,
    ))]
    #[expect(clippy::too_many_arguments, reason = "keywords of Python")]
    fn drucker_prager(
        G: f64,
        K: f64,
        c: f64,
        phi: f64,
        psi: f64,
        matching: &str,
        tension_cutoff: Option<f64>,
        c_residual: Option<f64>,
        phi_residual: Option<f64>,
        psi_residual: Option<f64>,
        softening_strain: Option<f64>,
    ) -> PyResult<Self> {
        let residual = Strength {
            c: c_residual.unwrap_or(c),
            phi: phi_residual.unwrap_or(phi),
            psi: psi_residual.unwrap_or(psi),
        };
        let parameters = drucker_prager::Parameters {
            peak: Strength { c, phi, psi },
            softening: softening_strain.map(|strain| drucker_prager::Softening { residual, strain }),
            tension_cutoff,
            matching: one_of("matching", matching, &MATCHING)?,
        };
        let soil = DruckerPrager::new(elastic(G, K)?, parameters).map_err(|error| refused(&error))?;
        Ok(Self(sandboil_soil::Soil::DruckerPrager(soil)))
    }

    /// Without `Sr` strength stays; with it, `softening_strain` is needed.
    #[staticmethod]
    #[pyo3(signature = (*, G, K, Su, criterion, softening, Sr=None, softening_strain=None))]
    fn total_stress(
        G: f64,
        K: f64,
        Su: f64,
        criterion: &str,
        softening: &str,
        Sr: Option<f64>,
        softening_strain: Option<f64>,
    ) -> PyResult<Self> {
        let criterion = one_of("criterion", criterion, &CRITERIA)?;
        let decay = one_of("softening", softening, &DECAYS)?;
        let softening = match (Sr, softening_strain) {
            (Some(residual), Some(strain)) => Some(total_stress::Softening { residual, strain, decay }),
            (None, _) => None,
            (Some(_), None) => return Err(PyValueError::new_err("Sr needs softening_strain")),
        };
        let soil =
            TotalStress::new(elastic(G, K)?, criterion, Su, softening).map_err(|error| refused(&error))?;
        Ok(Self(sandboil_soil::Soil::TotalStress(soil)))
    }

    /// A parameter that is left out, or `None`, takes the model's default.
    #[staticmethod]
    #[pyo3(signature = (
        *,
        Dr,
        G0,
        hpo,
        p_atm=None,
        ho=None,
        e_max=None,
        e_min=None,
        nb=None,
        nd=None,
        Ado=None,
        z_max=None,
        cz=None,
        ce=None,
        phi_cv=None,
        nu=None,
        C_GD=None,
        C_DR=None,
        C_kaf=None,
        Q=None,
        R=None,
        m=None,
        F_sed_min=None,
        p_sed_o=None,
        gap_memory=false,
    ))]
    #[expect(clippy::too_many_arguments, reason = "keywords of Python")]
    fn pm4sand(
        Dr: f64,
        G0: f64,
        hpo: f64,
        p_atm: Option<f64>,
        ho: Option<f64>,
        e_max: Option<f64>,
        e_min: Option<f64>,
        nb: Option<f64>,
        nd: Option<f64>,
        Ado: Option<f64>,
        z_max: Option<f64>,
        cz: Option<f64>,
        ce: Option<f64>,
        phi_cv: Option<f64>,
        nu: Option<f64>,
        C_GD: Option<f64>,
        C_DR: Option<f64>,
        C_kaf: Option<f64>,
        Q: Option<f64>,
        R: Option<f64>,
        m: Option<f64>,
        F_sed_min: Option<f64>,
        p_sed_o: Option<f64>,
        gap_memory: bool,
    ) -> PyResult<Self> {
        let parameters = Parameters {
            dr: Dr,
            g0: G0,
            hpo,
            p_atm,
            ho,
            e_max,
            e_min,
            nb,
            nd,
            ado: Ado,
            z_max,
            cz,
            ce,
            phi_cv,
            nu,
            c_gd: C_GD,
            c_dr: C_DR,
            c_kaf: C_kaf,
            q: Q,
            r: R,
            m,
            f_sed_min: F_sed_min,
            p_sed_o,
        };
        let options = Options { gap_memory, ..Options::default() };
        let soil = PM4Sand::new(parameters, options).map_err(|error| refused(&error))?;
        Ok(Self(sandboil_soil::Soil::PM4Sand(Box::new(soil))))
    }
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
