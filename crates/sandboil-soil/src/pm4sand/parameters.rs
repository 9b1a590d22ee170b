//! Parameters given by the user, and the constants derived from them.

use crate::{
    SoilError,
    error::{check, positive},
};

/// Atmospheric pressure, kPa.
const P_ATM: f64 = 101.3;
/// Largest Poisson's ratio used, so that the bulk modulus stays finite.
const NU_MAX: f64 = 0.4999;
/// Largest critical-state friction angle, degrees, for which `M = 2 sin(phi_cv)` stays below 2.
const PHI_CV_MAX: f64 = 89.0;

/// Parameters given by the user; `None` means the default of the model, which each field states.
#[derive(Debug, Clone, Default, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Parameters {
    /// Apparent relative density `D_R`, fraction in (0, 1].
    pub dr: f64,
    /// Shear modulus coefficient `G_o`.
    pub g0: f64,
    /// Contraction rate `h_po`.
    pub hpo: f64,
    /// Atmospheric pressure, in the unit of stress; 101.3 kPa.
    pub p_atm: Option<f64>,
    /// Ratio of plastic to elastic modulus; from `D_R`.
    pub ho: Option<f64>,
    /// Largest void ratio; 0.8.
    pub e_max: Option<f64>,
    /// Smallest void ratio; 0.5.
    pub e_min: Option<f64>,
    /// Bounding surface exponent; 0.5.
    pub nb: Option<f64>,
    /// Dilatancy surface exponent; 0.1.
    pub nd: Option<f64>,
    /// Dilatancy scale; from the initial state.
    pub ado: Option<f64>,
    /// Fabric limit; from the initial state.
    pub z_max: Option<f64>,
    /// Fabric growth rate; 250.
    pub cz: Option<f64>,
    /// Strain accumulation rate after liquefaction; from `D_R`.
    pub ce: Option<f64>,
    /// Critical-state friction angle, degrees; 33.
    pub phi_cv: Option<f64>,
    /// Poisson's ratio; 0.3.
    pub nu: Option<f64>,
    /// Degradation of elastic moduli with fabric; 2.
    pub c_gd: Option<f64>,
    /// Factor of the rotated dilatancy surface; from `D_R`.
    pub c_dr: Option<f64>,
    /// Effect of sustained static shear on the plastic modulus; from `D_R`.
    pub c_kaf: Option<f64>,
    /// Q of Bolton (1986); 10.
    pub q: Option<f64>,
    /// R of Bolton (1986); 1.5.
    pub r: Option<f64>,
    /// Yield surface radius; 0.01.
    pub m: Option<f64>,
    /// Smallest post-shaking stiffness factor; from `D_R`.
    pub f_sed_min: Option<f64>,
    /// Post-shaking pressure scale, in the unit of stress; `p_atm/5`.
    pub p_sed_o: Option<f64>,
}

/// Options of the model that are not material parameters.
#[derive(Debug, Clone, Copy, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[expect(clippy::struct_excessive_bools, reason = "four independent switches, each of the published model")]
pub struct Options {
    /// Plastic modulus and hardening are zero outside the bounding surface, also during dilation: the rule of
    /// version 3.3. The reference integrator always follows version 3.1 as implemented.
    pub clamp_plastic_modulus: bool,
    /// Loading index with `K + G/3` in place of the published `K`. This is the exact consistency condition for the
    /// two-dimensional mean stress. It matters only for shear with expansion.
    pub consistent_loading_index: bool,
    /// Expansion at the pressure floor must be recovered by compression before stress can increase again.
    pub gap_memory: bool,
    /// Post-shaking reconsolidation: moduli are multiplied by `F_sed`. Only for the analysis of sedimentation.
    pub post_shaking: bool,
}

impl Default for Options {
    fn default() -> Self {
        Self {
            clamp_plastic_modulus: true,
            consistent_loading_index: false,
            gap_memory: false,
            post_shaking: false,
        }
    }
}

/// All constants of the model, including defaults (manual, section 3.5).
#[derive(Debug, Clone, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Constants {
    /// Apparent relative density, fraction.
    pub dr: f64,
    /// Shear modulus coefficient.
    pub g0: f64,
    /// Contraction rate.
    pub hpo: f64,
    /// Atmospheric pressure, kPa.
    pub p_atm: f64,
    /// Ratio of plastic to elastic modulus.
    pub ho: f64,
    /// Largest void ratio.
    pub e_max: f64,
    /// Smallest void ratio.
    pub e_min: f64,
    /// Bounding surface exponent.
    pub nb: f64,
    /// Dilatancy surface exponent.
    pub nd: f64,
    /// Dilatancy scale; `None`: from the initial state.
    pub ado: Option<f64>,
    /// Fabric limit; `None`: from the initial state.
    pub z_max: Option<f64>,
    /// Fabric growth rate.
    pub cz: f64,
    /// Strain accumulation rate after liquefaction.
    pub ce: f64,
    /// Critical-state stress ratio `M = 2 sin(phi_cv)`.
    pub critical_ratio: f64,
    /// K/G.
    pub bulk_to_shear: f64,
    /// Degradation of elastic moduli with fabric.
    pub c_gd: f64,
    /// Factor of the rotated dilatancy surface.
    pub c_dr: f64,
    /// Effect of sustained static shear.
    pub c_kaf: f64,
    /// Q of Bolton.
    pub q: f64,
    /// R of Bolton.
    pub r: f64,
    /// Yield surface radius.
    pub m: f64,
    /// Smallest post-shaking stiffness factor.
    pub f_sed_min: f64,
    /// Post-shaking pressure scale, kPa.
    pub p_sed_o: f64,
}

impl Constants {
    /// Void ratio at the given apparent relative density.
    pub fn initial_void_ratio(&self) -> f64 {
        self.e_max - (self.e_max - self.e_min) * self.dr
    }
}

/// A PM4Sand material with checked parameters.
#[derive(Debug, Clone, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct PM4Sand {
    pub(super) constants: Constants,
    pub(super) options: Options,
}

fn non_negative(name: &'static str, value: f64) -> Result<f64, SoilError> {
    check(name, value, "zero or positive, and finite", value >= 0.0)
}

impl PM4Sand {
    /// Checks the parameters and sets the defaults.
    ///
    /// # Errors
    /// [`SoilError::InvalidParameter`] for a parameter outside its range.
    pub fn new(parameters: Parameters, options: Options) -> Result<Self, SoilError> {
        let given = parameters;
        let dr = check("Dr", given.dr, "in (0, 1]", given.dr > 0.0 && given.dr <= 1.0)?;
        let p_atm = positive("p_atm", given.p_atm.unwrap_or(P_ATM))?;
        let e_min = positive("e_min", given.e_min.unwrap_or(0.5))?;
        let e_max = given.e_max.unwrap_or(0.8);
        check("e_max", e_max, "greater than e_min", e_max > e_min)?;
        let nu = given.nu.unwrap_or(0.3);
        check("nu", nu, "in [0, 0.5)", (0.0..0.5).contains(&nu))?;
        let phi_cv = given.phi_cv.unwrap_or(33.0);
        check("phi_cv", phi_cv, "in (0, 89] degrees", phi_cv > 0.0 && phi_cv <= PHI_CV_MAX)?;
        let f_sed_min = given.f_sed_min.unwrap_or_else(|| (0.03 * (2.6 * dr).exp()).min(0.99));
        check("F_sed_min", f_sed_min, "in (0, 1]", f_sed_min > 0.0 && f_sed_min <= 1.0)?;
        let critical_ratio = 2.0 * phi_cv.to_radians().sin();
        let m = positive("m", given.m.unwrap_or(0.01))?;
        check("m", m, "smaller than the critical stress ratio 2 sin(phi_cv)", m < critical_ratio)?;
        let c_gd = given.c_gd.unwrap_or(2.0);
        check("C_GD", c_gd, "at least 1", c_gd >= 1.0)?;
        let constants = Constants {
            dr,
            g0: positive("G0", given.g0)?,
            hpo: positive("hpo", given.hpo)?,
            p_atm,
            ho: positive("ho", given.ho.unwrap_or_else(|| (0.5 * (0.25 + dr)).max(0.3)))?,
            e_max,
            e_min,
            nb: non_negative("nb", given.nb.unwrap_or(0.5))?,
            nd: non_negative("nd", given.nd.unwrap_or(0.1))?,
            ado: given.ado.map(|value| positive("Ado", value)).transpose()?,
            z_max: given.z_max.map(|value| positive("z_max", value)).transpose()?,
            cz: non_negative("cz", given.cz.unwrap_or(250.0))?,
            ce: non_negative("ce", given.ce.unwrap_or_else(|| (0.5 - 1.5 * (dr - 0.55)).clamp(0.2, 0.5)))?,
            critical_ratio,
            bulk_to_shear: crate::bulk_to_shear(nu.min(NU_MAX)),
            c_gd,
            c_dr: positive(
                "C_DR",
                given.c_dr.unwrap_or_else(|| (5.0 + 25.0 * (dr - 0.35).max(0.0)).min(10.0)),
            )?,
            c_kaf: non_negative(
                "C_kaf",
                given.c_kaf.unwrap_or_else(|| (5.0 + 220.0 * (dr - 0.26).powi(3)).clamp(4.0, 35.0)),
            )?,
            q: positive("Q", given.q.unwrap_or(10.0))?,
            r: positive("R", given.r.unwrap_or(1.5))?,
            m,
            f_sed_min,
            p_sed_o: positive("p_sed_o", given.p_sed_o.unwrap_or(0.2 * p_atm))?,
        };
        Ok(Self { constants, options })
    }

    /// The same material with other options. After a change of `post_shaking`, call [`PM4Sand::refresh_moduli`] on each
    /// state.
    #[must_use]
    pub fn with_options(mut self, options: Options) -> Self {
        self.options = options;
        self
    }

    /// All constants, including defaults.
    pub fn parameters(&self) -> &Constants {
        &self.constants
    }

    /// Options of this material.
    pub fn options(&self) -> &Options {
        &self.options
    }
}
