//! Mohr-Coulomb plasticity in plane strain: elastic, perfectly plastic, non-associated, with a tension cut-off.
//!
//! All three principal stresses are considered: two lie in the plane; the third is the out-of-plane stress, which may
//! be the largest, the intermediate or the smallest. The return to the surface is exact, in principal stresses, to a
//! plane, an edge or the apex of the pyramid (de Souza Neto, Peric and Owen 2008, chapter 8).

use crate::{
    Integrator, Moduli, SoilError, SoilModel, StrainIncrement, Strength, Stress, UpdateReport,
    elastic::Elastic,
};

/// Mohr-Coulomb material.
#[derive(Debug, Clone, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct MohrCoulomb {
    elastic: Elastic,
    sin_phi: f64,
    sin_psi: f64,
    /// `2 c cos(phi)`, kPa.
    cohesion: f64,
    /// Largest admissible principal stress, kPa, tension positive. Without a cut-off it is that of the apex, which is
    /// infinite without friction.
    tension: f64,
}

/// Principal stresses in descending order, tension positive, kPa.
type Principal = [f64; 3];

impl MohrCoulomb {
    /// Material with elastic constants, strength, and the largest principal tension, kPa (`None`: that of the apex,
    /// `c cot(phi)`).
    ///
    /// # Errors
    /// [`SoilError::InvalidParameter`] for a parameter outside its range.
    pub fn new(elastic: Elastic, strength: Strength, tension_cutoff: Option<f64>) -> Result<Self, SoilError> {
        let strength = strength.checked(["c", "phi", "psi"])?;
        let (sin_phi, cos_phi) = strength.phi.to_radians().sin_cos();
        let tension = strength.tension_cutoff(tension_cutoff)?.min(strength.c * cos_phi / sin_phi);
        let sin_psi = strength.psi.to_radians().sin();
        Ok(Self { elastic, sin_phi, sin_psi, cohesion: 2.0 * strength.c * cos_phi, tension })
    }

    /// Yield function `(s1 - s3) + (s1 + s3) sin(phi) - 2 c cos(phi)`, kPa.
    fn excess(&self, largest: f64, smallest: f64) -> f64 {
        (largest - smallest) + (largest + smallest) * self.sin_phi - self.cohesion
    }

    /// Largest principal stress on the yield surface for a smallest principal stress, kPa.
    fn largest_with(&self, smallest: f64) -> f64 {
        (smallest * (1.0 - self.sin_phi) + self.cohesion) / (1.0 + self.sin_phi)
    }

    /// Mean stress of the apex, kPa; infinite without friction.
    fn apex(&self) -> f64 {
        self.cohesion / (2.0 * self.sin_phi)
    }

    /// Principal stresses after the return of the trial ones to the surface, with plastic flow at a dilation angle.
    fn admissible(&self, trial: Principal, sin_psi: f64, report: &mut UpdateReport) -> Principal {
        let [s1, s2, s3] = trial;
        let excess = self.excess(s1, s3);
        if excess <= 0.0 {
            return trial;
        }
        let Moduli { bulk, shear } = self.elastic.constants();
        // Decrease of the principal stresses per unit of plastic flow on the plane of the largest and the smallest
        // one: `along` acts on all three; `on_largest` and `on_smallest` are added to those two.
        let along = 2.0 * (bulk - 2.0 / 3.0 * shear) * sin_psi;
        let (on_largest, on_smallest) = (2.0 * shear * (1.0 + sin_psi), -2.0 * shear * (1.0 - sin_psi));
        // Decrease of the yield function of a plane by its own flow (`own`), by flow of the plane that has the same
        // largest stress (`shares_largest`), and by flow of the plane that has the same smallest stress
        // (`shares_smallest`).
        let (plus, minus) = (1.0 + self.sin_phi, 1.0 - self.sin_phi);
        let common = 2.0 * along * self.sin_phi;
        let shares_largest = common + on_largest * plus;
        let shares_smallest = common - on_smallest * minus;
        let own = common + on_largest * plus - on_smallest * minus;

        let flow = excess / own;
        let smallest = s3 - flow * (along + on_smallest);
        let middle = s2 - flow * along;
        let largest = self.largest_with(smallest);
        if smallest <= middle && middle <= largest {
            return [largest, middle, smallest];
        }
        // Flow `x` and `y` of two planes together: `own x + shared y = f_x`, `shared x + own y = f_y`.
        let both = |other: f64, shared: f64| (excess + other) / (own + shared);
        if (1.0 - sin_psi) * s1 - 2.0 * s2 + (1.0 + sin_psi) * s3 > 0.0 {
            // The edge where the intermediate stress equals the smallest.
            let sum = both(self.excess(s1, s2), shares_largest);
            let smallest = 0.5 * (s2 + s3) - sum * (along + 0.5 * on_smallest);
            let largest = self.largest_with(smallest);
            if smallest <= largest {
                return [largest, smallest, smallest];
            }
        } else {
            // The edge where the intermediate stress equals the largest.
            let sum = both(self.excess(s2, s3), shares_smallest);
            let smallest = s3 - sum * (along + on_smallest);
            let largest = self.largest_with(smallest);
            if smallest <= largest {
                return [largest, largest, smallest];
            }
        }
        report.apex_returns += 1;
        [self.apex(); 3]
    }

    /// Stress after the return of a trial stress to the surface. Each principal stress is then limited to the tension
    /// cut-off separately.
    fn returned(&self, trial: &Stress, sin_psi: f64, report: &mut UpdateReport) -> Stress {
        let (mean, radius, zz) = (trial.plane_mean(), trial.radius(), trial.zz);
        let (upper, lower) = (mean + radius, mean - radius);
        // Position of the out-of-plane stress in the descending order.
        let place = if zz > upper {
            0
        } else if zz >= lower {
            1
        } else {
            2
        };
        let ordered = match place {
            0 => [zz, upper, lower],
            1 => [upper, zz, lower],
            _ => [upper, lower, zz],
        };
        let on_surface = self.admissible(ordered, sin_psi, report);
        let admitted = on_surface.map(|stress| stress.min(self.tension));
        // Without a cut-off, `tension` is the apex and removes only round-off.
        if self.tension < self.apex() && admitted != on_surface {
            // Count the cut-off only, not also a return to the apex before it.
            *report = UpdateReport { tension_cutoffs: 1, ..UpdateReport::default() };
        }
        if admitted == ordered {
            return *trial;
        }
        let (upper, lower) = match place {
            0 => (admitted[1], admitted[2]),
            1 => (admitted[0], admitted[2]),
            _ => (admitted[0], admitted[1]),
        };
        let factor = if radius > 0.0 { 0.5 * (upper - lower) / radius } else { 0.0 };
        Stress::of_plane(0.5 * (upper + lower), trial.plane_deviator() * factor, admitted[place])
    }
}

impl SoilModel for MohrCoulomb {
    type State = Stress;

    /// A stress outside the surface is returned to it without dilatancy, so it keeps its mean stress except at the apex
    /// and above the tension cut-off.
    fn initialise(&self, stress: Stress, _void_ratio: Option<f64>) -> Result<Stress, SoilError> {
        self.returned(&stress.finite("initial stress")?, 0.0, &mut UpdateReport::default())
            .finite("initial stress")
    }

    fn update(
        &self,
        state: &mut Stress,
        de: &StrainIncrement,
        _integrator: &Integrator,
    ) -> Result<UpdateReport, SoilError> {
        de.bounded()?;
        let trial = self.elastic.moved(state, de);
        let mut report = UpdateReport::default();
        *state = self.returned(&trial, self.sin_psi, &mut report).finite("stress")?;
        Ok(report)
    }

    fn stress(&self, state: &Stress) -> Stress {
        *state
    }

    fn moduli(&self, _state: &Stress) -> Moduli {
        self.elastic.constants()
    }

    fn static_shear_modulus(&self) -> f64 {
        self.elastic.constants().shear
    }

    fn carries(&self, stress: &Stress) -> bool {
        self.returned(stress, 0.0, &mut UpdateReport::default()) == *stress
    }
}
