//! Rayleigh damping: a drag proportional to mass and a viscous stress proportional to the soil's elastic
//! stiffness.

use crate::{
    error::SolverError,
    parallel::{Rows, chunks, for_each_chunk},
    skeleton::{
        point::StressPoint,
        strain_and_force::{NodalShare, motion},
    },
    weights::geometry::Geometry,
};
use sandboil_soil::{StrainIncrement, Stress};
use sandboil_sph::Vec2;
use std::f64::consts::PI;

/// Largest damping ratio that is accepted.
const LARGEST_RATIO: f64 = 0.3;
/// A damping ratio that is exact at two frequencies: `xi(w) = a / (2 w) + b w / 2` is less between them and
/// more outside.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Rayleigh {
    /// Damping ratio at both frequencies, 1.
    pub ratio: f64,
    /// The two frequencies, ascending, Hz.
    pub frequencies: [f64; 2],
}

impl Rayleigh {
    /// Refuses values outside their range.
    ///
    /// # Errors
    /// A ratio outside (0, 0.3], or frequencies that are not positive and ascending.
    pub fn validate(&self) -> Result<(), SolverError> {
        let [low, high] = self.frequencies;
        for (name, value, allowed, expected) in [
            ("rayleigh.ratio", self.ratio, self.ratio > 0.0 && self.ratio <= LARGEST_RATIO, "in (0, 0.3]"),
            ("rayleigh.frequencies[0]", low, low > 0.0, "positive"),
            ("rayleigh.frequencies[1]", high, high > low && high.is_finite(), "above the first frequency"),
        ] {
            if !allowed {
                return Err(SolverError::InvalidInput { name, value, expected });
            }
        }
        Ok(())
    }

    /// Drag over mass `a = 4 pi xi / (1/f_1 + 1/f_2)`, 1/s.
    pub fn mass_coefficient(&self) -> f64 {
        let [low, high] = self.frequencies;
        4.0 * PI * self.ratio / (low.recip() + high.recip())
    }

    /// Viscosity over elastic modulus `b = xi / (pi (f_1 + f_2))`, s.
    pub fn stiffness_coefficient(&self) -> f64 {
        let [low, high] = self.frequencies;
        self.ratio / (PI * (low + high))
    }

    /// Decay rate of the velocity of a wave with a circular frequency (rad/s), `2 xi w = a + b w^2`, 1/s.
    pub fn rate(&self, frequency: f64) -> f64 {
        self.mass_coefficient() + self.stiffness_coefficient() * frequency * frequency
    }
}

/// Rayleigh damping in a stage.
#[derive(Debug, serde::Serialize, serde::Deserialize)]
pub struct RayleighDamping {
    law: Rayleigh,
    /// Volume times nominal viscous stress of every stress node, kN/m, for the weights by images.
    tensor: Vec<[f64; 4]>,
}

impl RayleighDamping {
    /// Damping of `points` stress nodes at rest.
    pub fn new(law: Rayleigh, points: usize) -> Self {
        Self { law, tensor: vec![[0.0; 4]; points] }
    }

    /// The ratio and frequencies it was made from.
    pub fn law(&self) -> &Rayleigh {
        &self.law
    }

    /// Adds the viscous stress of a velocity field to the shares that the force loop gathers. The effective
    /// stress, which is the soil model's state and an output, does not include it.
    pub fn add_stress(
        &mut self,
        threaded: bool,
        geometry: &Geometry,
        velocity: &[Vec2],
        points: &[StressPoint],
        shares: &mut [NodalShare],
    ) {
        let coefficient = self.law.stiffness_coefficient();
        let mut unit = (vec![(); points.len()], vec![(); chunks(points.len())]);
        let rows = Rows { a: shares, b: &mut self.tensor, c: &mut unit.0 };
        for_each_chunk(threaded, rows, &mut unit.1, |first, rows, ()| {
            for (k, (share, tensor)) in rows.a.iter_mut().zip(rows.b.iter_mut()).enumerate() {
                let point = &points[first + k];
                let rate = motion(geometry, first + k, velocity).increment(&point.deformation, 1.0);
                let stress = viscous_stress(point, &rate, coefficient);
                *tensor = point.deformation.cofactor().nominal(&stress).map(|p| point.volume * p);
                share.add(tensor);
            }
        });
    }

    /// Force on velocity node `j` that is not in the shares, kN/m: the viscous stress through the weights by
    /// images, and the drag `-a m v` against the absolute velocity.
    #[inline]
    pub fn force(&self, geometry: &Geometry, j: usize, mass: f64, velocity: Vec2) -> Vec2 {
        let mut force = velocity * (-self.law.mass_coefficient() * mass);
        for (s, weight) in geometry.wall.transposed.iter_row(j) {
            force -= weight.contract(self.tensor[s]);
        }
        force
    }

    /// Bytes held.
    pub fn bytes(&self) -> usize {
        size_of_val(self.tensor.as_slice())
    }
}

/// Stress `b C_e : d` of a strain rate `d` (1/s) with the point's present elastic moduli, kPa, tension
/// positive: it decreases as the soil softens.
fn viscous_stress(point: &StressPoint, rate: &StrainIncrement, coefficient: f64) -> Stress {
    let (confined, shear) = (coefficient * point.stiffness, coefficient * point.shear_modulus);
    let volumetric = (confined - 2.0 * shear) * (rate.xx + rate.yy);
    Stress {
        xx: volumetric + 2.0 * shear * rate.xx,
        yy: volumetric + 2.0 * shear * rate.yy,
        xy: shear * rate.xy,
        zz: volumetric,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        section::{
            description::STRESS_NODES,
            outline::{Condition, EdgesView, Outline, Walls},
        },
        skeleton::strain_and_force::conservative_force,
        testing::square_block,
    };

    const DAMPING: Rayleigh = Rayleigh { ratio: 0.05, frequencies: [1.0, 10.0] };

    #[test]
    fn the_ratio_holds_at_both_frequencies() {
        for (frequency, expected) in
            [(1.0, 0.05), (10.0, 0.05), (10.0_f64.sqrt(), 0.05 * 2.0 * 10.0_f64.sqrt() / 11.0)]
        {
            let w = 2.0 * PI * frequency;
            assert!((0.5 * DAMPING.rate(w) / w - expected).abs() < 1e-15, "{frequency}");
        }
    }

    #[test]
    fn invalid_damping_is_refused() {
        for (ratio, frequencies) in [
            (0.0, [1.0, 10.0]),
            (0.31, [1.0, 10.0]),
            (f64::NAN, [1.0, 10.0]),
            (0.05, [0.0, 10.0]),
            (0.05, [1.0, 1.0]),
            (0.05, [1.0, f64::INFINITY]),
        ] {
            assert!(Rayleigh { ratio, frequencies }.validate().is_err(), "{ratio} {frequencies:?}");
        }
        assert!(DAMPING.validate().is_ok());
    }

    /// The force of a velocity field is the drag, and `b` times the elastic force of a displacement field of
    /// the same shape, images included.
    #[test]
    fn the_force_is_in_proportion_to_stiffness_and_mass() {
        let mut model = square_block(6);
        model.outline = Outline::level(-0.5);
        let nodes = model.nodes();
        let edges = EdgesView {
            outline: &model.outline,
            walls: Walls::shaken(&model.outline, Condition::VerticalRoller, [false; 2]),
        };
        let geometry = Geometry::build(&model, &model.position, &vec![1.0; nodes], edges);
        let velocity: Vec<Vec2> =
            (0..nodes).map(|j| Vec2::new((1.3 * j as f64).sin(), (2.1 * j as f64).cos())).collect();
        let still = vec![Vec2::zeros(); nodes];
        let point = StressPoint {
            shear_modulus: 2.0,
            stiffness: 7.0,
            density: 1.0,
            volume: 0.5,
            ..StressPoint::default()
        };
        let strained: Vec<StressPoint> = (0..STRESS_NODES * nodes)
            .map(|s| {
                let strain = motion(&geometry, s, &velocity).increment(&point.deformation, 1.0);
                StressPoint { stress: viscous_stress(&point, &strain, 1.0), ..point }
            })
            .collect();
        let unstrained = vec![point; STRESS_NODES * nodes];
        let shares = |points: &[StressPoint]| -> Vec<NodalShare> {
            let share =
                |s: usize| motion(&geometry, s, &still).share(&points[s], geometry.covariance[s], 0.0);
            (0..points.len()).map(share).collect()
        };
        let mut damping = RayleighDamping::new(DAMPING, unstrained.len());
        let (elastic, mut damped) = (shares(&strained), shares(&unstrained));
        damping.add_stress(false, &geometry, &velocity, &unstrained, &mut damped);
        let (a, b) = (DAMPING.mass_coefficient(), DAMPING.stiffness_coefficient());
        for (j, &v) in velocity.iter().enumerate() {
            let zero = Vec2::zeros();
            let stiff = conservative_force(&geometry, j, zero, &elastic, &strained);
            let found = conservative_force(&geometry, j, zero, &damped, &unstrained)
                + damping.force(&geometry, j, 3.0, v);
            let expected = stiff * b - v * (3.0 * a);
            assert!((found - expected).norm() < 1e-12, "{j}: {found} {expected}");
        }
    }
}
