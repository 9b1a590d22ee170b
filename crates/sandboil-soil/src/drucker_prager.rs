//! Drucker-Prager plasticity in plane strain: non-associated, with cohesion, a tension cut-off and softening
//! (Drucker and Prager 1952; plane-strain constants as in Bui, Fukagawa, Sako and Ohno 2008).
//!
//! Yield surface `sqrt(J2) + a I1 = k`, plastic flow along `(s/(2 sqrt(J2)) + b I)`. The return to the surface
//! follows the flow direction in closed form, so stress never lies outside the surface and does not drift.

use crate::{
    Integrator, Moduli, SoilError, SoilModel, StrainIncrement, Strength, Stress, UpdateReport,
    elastic::Elastic,
    error::{check, positive},
};

/// How the cone is fitted to the friction angle in plane strain.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
pub enum Matching {
    /// `a = tan(phi)/sqrt(9 + 12 tan^2(phi))`, as in most of the literature. Exact for associated flow; some percent
    /// too weak for `psi < phi`.
    #[default]
    Usual,
    /// Gives the Mohr-Coulomb strength at failure in plane strain for any dilation angle.
    General,
}

/// Loss of strength with plastic shear strain.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Softening {
    /// Residual strength; each component is at most that of the peak strength.
    pub residual: Strength,
    /// Plastic shear strain (engineering) over which the constants of the cone fall linearly to their residual values.
    pub strain: f64,
}

/// Strength parameters; the elastic constants are separate.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Parameters {
    /// Strength before any plastic shear strain.
    pub peak: Strength,
    /// Softening; `None`: perfectly plastic.
    pub softening: Option<Softening>,
    /// Largest mean stress, kPa, tension positive, at most that of the apex, `c cot(phi)`; `None`: the apex.
    pub tension_cutoff: Option<f64>,
    /// Fit of the cone.
    pub matching: Matching,
}

/// Constants of the yield cone and of the plastic potential.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize, serde::Deserialize)]
struct Cone {
    /// Slope `a` against the first invariant.
    friction: f64,
    /// Size `k` at zero mean stress, kPa.
    cohesion: f64,
    /// Slope `b` of the plastic potential.
    dilation: f64,
}

impl Cone {
    fn new(strength: &Strength, matching: Matching) -> Self {
        let (sin, cos) = strength.phi.to_radians().sin_cos();
        let (sin_psi, cos_psi) = strength.psi.to_radians().sin_cos();
        let dilation = sin_psi / (9.0 * cos_psi * cos_psi + 12.0 * sin_psi * sin_psi).sqrt();
        let width = match matching {
            // Both slopes are tan/sqrt(9 + 12 tan^2), in a form that is also finite at 90 degrees.
            Matching::Usual => (9.0 * cos * cos + 12.0 * sin * sin).sqrt(),
            // At failure the plastic strain along z is zero, so the deviator along z is `-2 b sqrt(J2)`. The slope
            // follows from comparing the yield surface at that deviator with Mohr-Coulomb's circle.
            Matching::General => 3.0 * ((1.0 - 3.0 * dilation * dilation).sqrt() + dilation * sin),
        };
        Self { friction: sin / width, cohesion: 3.0 * strength.c * cos / width, dilation }
    }

    /// Linear interpolation: `self` at `share = 0`, `other` at 1.
    fn between(&self, other: &Self, share: f64) -> Self {
        let mix = |a: f64, b: f64| a * (1.0 - share) + b * share;
        Self {
            friction: mix(self.friction, other.friction),
            cohesion: mix(self.cohesion, other.cohesion),
            dilation: mix(self.dilation, other.dilation),
        }
    }

    /// Admissible `sqrt(J2)` at a first invariant, kPa; negative beyond the apex.
    fn size_at(&self, first_invariant: f64) -> f64 {
        self.cohesion - self.friction * first_invariant
    }

    /// First invariant of the apex, kPa; infinite without friction.
    fn apex(&self) -> f64 {
        self.cohesion / self.friction
    }
}

/// Drucker-Prager material.
#[derive(Debug, Clone, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct DruckerPrager {
    elastic: Elastic,
    peak: Cone,
    residual: Cone,
    /// Infinite without softening.
    softening_strain: f64,
    /// Largest first invariant, kPa; infinite without a cut-off.
    largest_invariant: f64,
}

/// State of one point.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct State {
    stress: Stress,
    plastic_shear: f64,
}

impl DruckerPrager {
    /// Material with elastic constants and strength.
    ///
    /// # Errors
    /// [`SoilError::InvalidParameter`] for a parameter outside its range. Softening is also refused where the
    /// cohesion of the cone falls faster with plastic shear strain than the shear modulus `G`: stress then has no
    /// path to the residual strength.
    pub fn new(elastic: Elastic, parameters: Parameters) -> Result<Self, SoilError> {
        let Parameters { peak, softening, tension_cutoff, matching } = parameters;
        let strength = peak.checked(["c", "phi", "psi"])?;
        let largest_invariant = 3.0 * strength.tension_cutoff(tension_cutoff)?;
        let peak = Cone::new(&strength, matching);
        let (mut residual, mut softening_strain) = (peak, f64::INFINITY);
        if let Some(softening) = softening {
            let names = ["c_residual", "phi_residual", "psi_residual"];
            let lowest = softening.residual.checked(names)?;
            check(names[0], lowest.c, "at most c", lowest.c <= strength.c)?;
            check(names[1], lowest.phi, "at most phi", lowest.phi <= strength.phi)?;
            check(names[2], lowest.psi, "at most psi", lowest.psi <= strength.psi)?;
            residual = Cone::new(&lowest, matching);
            softening_strain = positive("softening_strain", softening.strain)?;
            let largest_loss = elastic.constants().shear * softening_strain;
            check(
                "softening_strain",
                softening_strain,
                "larger than the loss of cohesion divided by G, so that stress can follow the softening",
                largest_loss > peak.cohesion - residual.cohesion,
            )?;
        }
        Ok(Self { elastic, peak, residual, softening_strain, largest_invariant })
    }

    /// Largest first invariant before softening, kPa: the smaller of apex and cut-off.
    fn peak_invariant(&self) -> f64 {
        self.largest_invariant.min(self.peak.apex())
    }

    /// The cone after a plastic shear strain.
    fn cone(&self, plastic_shear: f64) -> Cone {
        self.peak.between(&self.residual, (plastic_shear / self.softening_strain).min(1.0))
    }

    /// Increment of plastic shear strain that returns a trial stress to the cone, where the first invariant falls by
    /// `fall` per unit of plastic shear strain. It is the first root of `f = 0` with the strength at the end of the
    /// step; zero for a trial stress inside the cone.
    ///
    /// The constants of the cone are linear in plastic shear strain, so the equation is quadratic during softening and
    /// linear after it. At high pressure, friction may fall faster than the stress unloads. The quadratic equation
    /// then has no root, and the strength drops to the residual one in this step.
    fn plastic_shear(&self, size: f64, first_invariant: f64, before: f64, fall: f64) -> f64 {
        let now = self.cone(before);
        let excess = size - now.size_at(first_invariant);
        if excess <= 0.0 {
            return 0.0;
        }
        let shear = self.elastic.constants().shear;
        let softening_left = self.softening_strain - before;
        if softening_left > 0.0 {
            let friction_rate = (self.residual.friction - self.peak.friction) / self.softening_strain;
            let cohesion_rate = (self.residual.cohesion - self.peak.cohesion) / self.softening_strain;
            let slope = shear + now.friction * fall + cohesion_rate - friction_rate * first_invariant;
            let discriminant = slope * slope + 4.0 * friction_rate * fall * excess;
            let divisor = slope + discriminant.max(0.0).sqrt();
            if discriminant >= 0.0 && divisor > 0.0 && 2.0 * excess <= softening_left * divisor {
                return 2.0 * excess / divisor;
            }
        }
        (size - self.residual.size_at(first_invariant)) / (shear + self.residual.friction * fall)
    }

    /// State after the return of a trial stress to the surface. The first invariant falls by `fall` per unit of
    /// plastic shear strain.
    fn returned(&self, trial: Stress, before: f64, fall: f64, report: &mut UpdateReport) -> State {
        let (size, first_invariant) = (trial.root_j2(), trial.first_invariant());
        let plastic = self.plastic_shear(size, first_invariant, before, fall);
        if plastic == 0.0 && first_invariant <= self.largest_invariant {
            return State { stress: trial, plastic_shear: before };
        }
        let state = |plastic: f64, first_invariant: f64, admissible: f64| State {
            stress: reduced(&trial, first_invariant, admissible),
            plastic_shear: before + plastic,
        };
        let on_cone = first_invariant - fall * plastic;
        let admissible = self.cone(before + plastic).size_at(on_cone);
        if on_cone <= self.largest_invariant && admissible >= 0.0 {
            return state(plastic, on_cone, admissible);
        }
        // Corner of cone and cut-off: the cut-off sets the mean stress, the cone reduces only the shear stress.
        if on_cone > self.largest_invariant {
            let plastic = self.plastic_shear(size, self.largest_invariant, before, 0.0);
            let admissible = self.cone(before + plastic).size_at(self.largest_invariant);
            if admissible >= 0.0 {
                report.tension_cutoffs += 1;
                return state(plastic, self.largest_invariant, admissible);
            }
        }
        report.apex_returns += 1;
        let plastic = size / self.elastic.constants().shear;
        state(plastic, self.cone(before + plastic).apex(), 0.0)
    }
}

/// The stress with the given first invariant, and with `sqrt(J2)` reduced to `admissible`, kPa, where it is larger.
/// The size is taken from the surface, not from a difference, so round-off cannot leave the stress outside.
fn reduced(stress: &Stress, first_invariant: f64, admissible: f64) -> Stress {
    let size = stress.root_j2();
    stress.with(first_invariant, if size > admissible { admissible / size } else { 1.0 })
}

impl SoilModel for DruckerPrager {
    type State = State;

    /// A stress outside the surface keeps its mean stress, limited to the largest admissible one; its deviator is
    /// reduced to the surface.
    fn initialise(&self, stress: Stress, _void_ratio: Option<f64>) -> Result<State, SoilError> {
        let stress = if self.carries(&stress) {
            stress
        } else {
            let first_invariant = stress.first_invariant().min(self.peak_invariant());
            reduced(&stress, first_invariant, self.peak.size_at(first_invariant).max(0.0))
        };
        Ok(State { stress: stress.finite("initial stress")?, plastic_shear: 0.0 })
    }

    fn update(
        &self,
        state: &mut State,
        de: &StrainIncrement,
        _integrator: &Integrator,
    ) -> Result<UpdateReport, SoilError> {
        de.bounded()?;
        let trial = self.elastic.moved(&state.stress, de);
        let fall = 9.0 * self.elastic.constants().bulk * self.cone(state.plastic_shear).dilation;
        let mut report = UpdateReport::default();
        let next = self.returned(trial, state.plastic_shear, fall, &mut report);
        next.stress.finite("stress")?;
        *state = next;
        Ok(report)
    }

    fn stress(&self, state: &State) -> Stress {
        state.stress
    }

    fn moduli(&self, _state: &State) -> Moduli {
        self.elastic.constants()
    }

    fn static_shear_modulus(&self) -> f64 {
        self.elastic.constants().shear
    }

    fn plastic_shear_strain(&self, state: &State) -> Option<f64> {
        Some(state.plastic_shear)
    }

    fn carries(&self, stress: &Stress) -> bool {
        let first_invariant = stress.first_invariant();
        first_invariant <= self.peak_invariant() && stress.root_j2() <= self.peak.size_at(first_invariant)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn cone(c: f64, phi: f64, psi: f64, matching: Matching) -> Cone {
        Cone::new(&Strength { c, phi, psi }, matching)
    }

    #[test]
    fn both_fits_agree_where_flow_is_associated() {
        for phi in [0.0, 1.0, 30.0, 60.0, 89.9] {
            let (usual, general) =
                (cone(7.0, phi, phi, Matching::Usual), cone(7.0, phi, phi, Matching::General));
            assert!((usual.friction - general.friction).abs() < 1e-12);
            assert!((usual.cohesion - general.cohesion).abs() < 1e-12);
            assert!((usual.friction - usual.dilation).abs() < 1e-15);
        }
    }

    #[test]
    fn the_general_fit_without_dilatancy_is_simple() {
        let (sin, cos) = 37.0_f64.to_radians().sin_cos();
        let general = cone(7.0, 37.0, 0.0, Matching::General);
        assert!((general.friction - sin / 3.0).abs() < 1e-15);
        assert!((general.cohesion - 7.0 * cos).abs() < 1e-14);
    }

    /// `sin(psi) = 3 b/sqrt(1 - 3 b^2)` in plane strain.
    #[test]
    fn the_potential_has_the_dilation_angle() {
        for psi in [0.0, 5.0, 30.0, 80.0_f64] {
            let b = cone(0.0, 85.0, psi, Matching::Usual).dilation;
            assert!((3.0 * b / (1.0 - 3.0 * b * b).sqrt() - psi.to_radians().sin()).abs() < 1e-12);
        }
    }

    /// On the cone, in the corner and at the apex; before, during and after softening, also where it is brittle:
    /// `sqrt(J2)` falls by `G` and `I1` by at least `9 K b` per unit of plastic shear strain.
    #[test]
    fn plastic_shear_balances_the_stress() {
        let (shear, bulk) = (9.1e4, 2.7e5);
        let residual = Strength { c: 2.0, phi: 20.0, psi: 0.0 };
        let parameters = Parameters {
            peak: Strength { c: 14.4, phi: 31.0, psi: 10.0 },
            softening: Some(Softening { residual, strain: 0.01 }),
            tension_cutoff: Some(8.0),
            matching: Matching::General,
        };
        let soil = DruckerPrager::new(Elastic::new(shear, bulk).unwrap(), parameters).unwrap();
        let (mut cones, mut corners, mut apices) = (0, 0, 0);
        for before in [0.0, 3e-3, 9.9e-3, 0.02] {
            for mean in [-1e5, -1000.0, -50.0, 0.0, 7.0, 9.0, 30.0, 1000.0] {
                for excess in [1e-6, 0.1, 5.0, 100.0, 3000.0] {
                    let now = soil.cone(before);
                    let size = now.size_at(3.0 * mean).max(0.0) + excess;
                    let trial = Stress { xx: mean, yy: mean, xy: size, zz: mean };
                    let fall = 9.0 * bulk * now.dilation;
                    let State { stress, plastic_shear } =
                        soil.returned(trial, before, fall, &mut UpdateReport::default());
                    let plastic = plastic_shear - before;
                    let (left, volume) = (stress.root_j2(), stress.first_invariant());
                    let context = format!("{before} {mean} {excess}: {stress:?} {plastic}");
                    assert!(
                        (size - left - shear * plastic).abs() <= 1e-11 * (size + mean.abs()),
                        "{context}"
                    );
                    let slack = 3.0 * mean - volume - fall * plastic;
                    assert!(slack >= -1e-11 * (size + mean.abs()), "{context}");
                    if left <= 1e-9 * size {
                        apices += 1;
                    } else if volume >= 24.0 - 1e-9 {
                        corners += 1;
                    } else {
                        assert!(slack <= 1e-11 * (size + mean.abs()), "{context}");
                        cones += 1;
                    }
                }
            }
        }
        assert!(cones > 30 && corners > 5 && apices > 5, "{cones} {corners} {apices}");
    }

    #[test]
    fn the_apex_is_that_of_mohr_coulomb() {
        for matching in [Matching::Usual, Matching::General] {
            let apex = cone(7.0, 37.0, 5.0, matching).apex() / 3.0;
            assert!((apex - 7.0 / 37.0_f64.to_radians().tan()).abs() < 1e-12);
        }
    }
}
