//! Solid and water in the volume of a node (Eqs 1 and 5).
//!
//! Grains neither compress nor leave their node, so porosity, density and volume are one unknown: with `d ln
//! V / dt = div v` for the volume `V`, `n = 1 - V_s / V` is the exact integral of Eq. 1, at any jump of
//! porosity between layers. The divergence is that of the stress nodes: their accumulated strain gives `ln
//! V`.

use crate::{
    section::{description::Model, stress_layout::StressLayout},
    skeleton::point::StressPoint,
};
use std::ops::RangeInclusive;

/// Range of porosities for which a grain packing is a valid description.
const POROSITY_RANGE: RangeInclusive<f64> = 0.05..=0.95;
/// Volumes, porosities and masses of the velocity nodes.
#[derive(Debug, Clone, serde::Serialize, serde::Deserialize)]
pub struct Phases {
    /// Volume per unit thickness, m2.
    volume: Vec<f64>,
    /// Volume when the strains were last set to zero, m2.
    unstrained: Vec<f64>,
    /// Volume of the grains, m2: constant.
    solid: Vec<f64>,
    /// Density of the grains, Mg/m3.
    solid_density: Vec<f64>,
    /// Mass of water per volume of pores, Mg/m3; zero in a dry section.
    water_density: Vec<f64>,
}

impl Phases {
    /// Phases of the undeformed section.
    pub fn new(model: &Model) -> Self {
        let volume = model.volume.clone();
        let of_region = |value: &dyn Fn(&crate::section::description::Region) -> f64| -> Vec<f64> {
            model.region.iter().map(|&region| value(&model.regions[region as usize])).collect()
        };
        let solidity = of_region(&|region| 1.0 - region.porosity);
        Self {
            solid: volume.iter().zip(solidity).map(|(v, share)| v * share).collect(),
            solid_density: of_region(&|region| region.solid_density),
            water_density: (0..model.nodes())
                .map(|node| {
                    model
                        .water
                        .map_or(0.0, |water| model.saturation(node) * water.unit_weight / model.gravity)
                })
                .collect(),
            unstrained: volume.clone(),
            volume,
        }
    }

    /// Volumes per unit thickness, m2.
    pub fn volume(&self) -> &[f64] {
        &self.volume
    }

    /// Porosity `n`.
    pub fn porosity(&self, node: usize) -> f64 {
        1.0 - self.solid[node] / self.volume[node]
    }

    /// Dry density `rho = (1 - n) rho_s`, Mg/m3.
    pub fn dry_density(&self, node: usize) -> f64 {
        self.solid[node] * self.solid_density[node] / self.volume[node]
    }

    /// Mass of grains and pore water, Mg/m.
    pub fn mass(&self, node: usize) -> f64 {
        let pores = self.volume[node] - self.solid[node];
        self.solid[node] * self.solid_density[node] + pores * self.water_density[node]
    }

    /// Masses of all grains and of the water in all pores, Mg/m.
    pub fn total_masses(&self) -> [f64; 2] {
        (0..self.volume.len()).fold([0.0; 2], |[solid, water], node| {
            let grains = self.solid[node] * self.solid_density[node];
            [solid + grains, water + self.mass(node) - grains]
        })
    }

    /// Updates the volumes from the strain of the stress nodes. Returns how many porosities were clipped to
    /// their range.
    pub fn update_volumes(&mut self, layout: &StressLayout, points: &[StressPoint]) -> u64 {
        let mut clipped = 0;
        for (node, volume) in self.volume.iter_mut().enumerate() {
            let of_point = |(point, share): (usize, f64)| {
                let [xx, yy, _] = points[point].strain;
                share * (xx + yy)
            };
            let strain: f64 = layout.of_node(node).map(of_point).sum();
            let wanted = self.unstrained[node] * strain.exp();
            let least = self.solid[node] / (1.0 - POROSITY_RANGE.start());
            let most = self.solid[node] / (1.0 - POROSITY_RANGE.end());
            // A soil that starts outside the range may keep its porosity.
            let (least, most) = (least.min(self.unstrained[node]), most.max(self.unstrained[node]));
            *volume = wanted.clamp(least, most);
            clipped += u64::from(*volume != wanted);
        }
        clipped
    }

    /// Makes the present volumes those of zero strain: strains count from the start of a stage.
    pub fn restart_strain(&mut self) {
        self.unstrained.copy_from_slice(&self.volume);
    }

    /// Bytes held.
    pub fn bytes(&self) -> usize {
        5 * size_of_val(self.volume.as_slice())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{section::description::STRESS_NODES, testing::square_block};

    #[test]
    fn porosity_conserves_the_volume_of_the_grains() {
        let model = square_block(2);
        let mut phases = Phases::new(&model);
        let mut points = vec![StressPoint::default(); STRESS_NODES * model.nodes()];
        let mass = phases.mass(0);
        for point in &mut points[..STRESS_NODES] {
            point.strain = [0.06, -0.16, 0.3];
        }
        assert_eq!(phases.update_volumes(&StressLayout::Diagonal, &points), 0);
        // Eq. 1 integrated: (1 - n) V is constant, V = V_0 exp(volume strain).
        assert!((phases.volume()[0] - (-0.1_f64).exp()).abs() < 1e-15);
        assert!((1.0 - phases.porosity(0) - 0.5 * 0.1_f64.exp()).abs() < 1e-15);
        assert!((phases.dry_density(0) * phases.volume()[0] - 1.0).abs() < 1e-15);
        assert_eq!((phases.mass(0), phases.volume()[1]), (mass, 1.0));
    }

    #[test]
    fn porosity_stays_that_of_a_packing() {
        let model = square_block(2);
        let mut phases = Phases::new(&model);
        let mut points = vec![StressPoint::default(); STRESS_NODES * model.nodes()];
        for point in &mut points {
            point.strain = [-5.0, 0.0, 0.0];
        }
        assert_eq!(phases.update_volumes(&StressLayout::Diagonal, &points), model.nodes() as u64);
        assert!((phases.porosity(0) - 0.05).abs() < 1e-14);
    }
}
