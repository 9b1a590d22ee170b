//! Groups of stress points at a free surface that share one volume strain.
//!
//! A corner at a free surface strains by the motion of as few nodes as its neighbour inside. Two volume constraints for the
//! freedoms of one would lock nearly incompressible ground. The points of a group therefore have the mean volume strain of
//! the group, weighted with their volumes, and carry its mean stress: the transpose.

use crate::{
    parallel::{Rows, chunks, for_each_chunk},
    section::dual_lattice::DualLattice,
    skeleton::{
        deformation::Deformation,
        point::StressPoint,
        strain_and_force::{NodalShare, motion},
    },
    weights::geometry::Geometry,
};
use sandboil_soil::StrainIncrement;
use sandboil_sph::Vec2;

/// Volume strains of the groups in a step.
#[derive(Debug, Clone, Default, serde::Serialize, serde::Deserialize)]
pub struct SharedStrain {
    /// Group of each point.
    group: Vec<Option<u32>>,
    /// Volume strain of each group in the step.
    strain: Vec<f64>,
}

impl SharedStrain {
    /// No strain yet.
    pub fn new(dual: &DualLattice) -> Self {
        Self { group: dual.group.clone(), strain: vec![0.0; dual.groups.len()] }
    }

    /// Computes the volume strain of every group from the motion over a step of `dt` (s): `theta_g = sum V J tr L / sum V J`.
    pub fn gather(
        &mut self,
        dual: &DualLattice,
        geometry: &Geometry,
        points: &[StressPoint],
        velocity: &[Vec2],
        dt: f64,
    ) {
        for (strain, group) in self.strain.iter_mut().zip(&dual.groups) {
            *strain = mean(group, points, |s| {
                let mut deformation: Deformation = points[s].deformation;
                let increment = motion(geometry, s, velocity).advance(&mut deformation, dt);
                increment.xx + increment.yy
            });
        }
    }

    /// The strain of a point with the volume strain of its group.
    #[inline]
    pub fn applied(&self, point: usize, increment: StrainIncrement) -> StrainIncrement {
        let Some(group) = self.group[point] else { return increment };
        let missing = 0.5 * (self.strain[group as usize] - (increment.xx + increment.yy));
        StrainIncrement { xx: increment.xx + missing, yy: increment.yy + missing, ..increment }
    }

    /// Sets what the forces take beside the effective stress: the `pressure` (kPa) of the pore water at each point, and the
    /// difference of the group's mean stress from the point's own. Corrects the shares in the nodal forces.
    pub fn carry(
        &self,
        threaded: bool,
        dual: &DualLattice,
        points: &mut [StressPoint],
        shares: &mut [NodalShare],
        pressure: impl Fn(usize) -> f64 + Sync,
    ) {
        let carried = carried(dual, points, &pressure);
        let mut unit = (vec![(); points.len()], vec![(); chunks(points.len())]);
        let rows = Rows { a: points, b: shares, c: &mut unit.0 };
        for_each_chunk(threaded, rows, &mut unit.1, |first, rows, ()| {
            for (k, (point, share)) in rows.a.iter_mut().zip(rows.b.iter_mut()).enumerate() {
                let neutral = match self.group[first + k] {
                    Some(group) => mean_stress(point) + carried[group as usize],
                    None => pressure(first + k),
                };
                take_neutral(point, share, neutral);
            }
        });
    }

    /// Bytes held.
    pub fn bytes(&self) -> usize {
        size_of_val(self.group.as_slice()) + size_of_val(self.strain.as_slice())
    }
}

/// The same as [`SharedStrain::carry`] in dry ground, where only groups carry something, after a step in which nothing else
/// has changed it.
pub fn carry_dry(dual: &DualLattice, points: &mut [StressPoint], shares: &mut [NodalShare]) {
    for (group, carried) in dual.groups.iter().zip(carried(dual, points, |_| 0.0)) {
        for &s in group {
            let point = &mut points[s as usize];
            take_neutral(point, &mut shares[s as usize], mean_stress(point) + carried);
        }
    }
}

/// What every group carries beside the mean stress of its points, kPa, compression positive.
fn carried(dual: &DualLattice, points: &[StressPoint], pressure: impl Fn(usize) -> f64) -> Vec<f64> {
    let of_group = |group: &Vec<u32>| mean(group, points, |s| pressure(s) - mean_stress(&points[s]));
    dual.groups.iter().map(of_group).collect()
}

/// Changes the neutral stress of a point, and its share in the nodal forces.
fn take_neutral(point: &mut StressPoint, share: &mut NodalShare, neutral: f64) {
    let change = point.volume * (point.neutral - neutral);
    share.add(&point.deformation.cofactor().scaled(change));
    point.neutral = neutral;
}

/// Mean of a value over the points of a group, weighted with their present volumes.
fn mean(group: &[u32], points: &[StressPoint], value: impl Fn(usize) -> f64) -> f64 {
    let (mut sum, mut total) = (0.0, 0.0);
    for &s in group {
        let point = &points[s as usize];
        let volume = point.volume * point.deformation.volume_ratio();
        sum += volume * value(s as usize);
        total += volume;
    }
    sum / total
}

/// Mean of the in-plane effective stresses of a point, kPa, tension positive.
fn mean_stress(point: &StressPoint) -> f64 {
    0.5 * (point.stress.xx + point.stress.yy)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        section::{description::Operators, outline::EdgesView},
        skeleton::{spectrum_tests::disordered, strain_and_force::conservative_force},
    };
    use sandboil_soil::Stress;

    const SIDE: usize = 5;

    fn random(k: usize) -> f64 {
        (1e4 * (0.618_034 * k as f64 + 0.3).sin()).sin()
    }

    /// The power of the forces on any motion is minus that of the effective stress in the strain of the soil plus that of
    /// the pore pressure in its volume strain; the sum of the forces is zero.
    #[test]
    fn the_force_is_the_transpose_of_the_shared_strain() {
        let mut model = disordered(SIDE, 0.1);
        model.numerics.operators = Operators::Dual;
        model.numerics.smoothing_ratio = 1.2;
        let edges = EdgesView::statics(&model.outline);
        let geometry = Geometry::build(&model, &model.position, &model.volume, edges);
        let dual = DualLattice::new(&model);
        assert!(dual.groups.len() > 3);
        let velocity: Vec<Vec2> =
            (0..model.nodes()).map(|j| Vec2::new(random(2 * j), random(2 * j + 1))).collect();
        let mut points: Vec<StressPoint> = (0..dual.position.len())
            .map(|s| StressPoint {
                stress: Stress { xx: random(5 * s), yy: random(5 * s + 1), xy: random(5 * s + 2), zz: 0.0 },
                density: 1.0,
                volume: dual.volume[s],
                deformation: Deformation::default()
                    .moved(Vec2::new(0.1 * random(7 * s), 0.05), Vec2::new(-0.05, 0.1 * random(7 * s + 1))),
                ..StressPoint::default()
            })
            .collect();
        let pressure = |s: usize| 3.0 * random(11 * s);
        let mut shared = SharedStrain::new(&dual);
        let still = vec![Vec2::zeros(); model.nodes()];
        let mut shares: Vec<NodalShare> = (0..points.len())
            .map(|s| motion(&geometry, s, &still).share(&points[s], geometry.covariance[s], 0.0))
            .collect();
        shared.carry(false, &dual, &mut points, &mut shares, pressure);

        // A rate: the deformation does not change.
        let rate = |s: usize| motion(&geometry, s, &velocity).increment(&points[s].deformation, 1.0);
        for (strain, group) in shared.strain.iter_mut().zip(&dual.groups) {
            *strain = mean(group, &points, |s| rate(s).xx + rate(s).yy);
        }
        let stored: f64 = (0..points.len())
            .map(|s| {
                let strain = shared.applied(s, rate(s));
                let StressPoint { stress, volume, deformation, .. } = &points[s];
                let of_stress = stress.xx * strain.xx + stress.yy * strain.yy + stress.xy * strain.xy;
                volume * deformation.volume_ratio() * (of_stress - pressure(s) * (strain.xx + strain.yy))
            })
            .sum();
        let forces: Vec<Vec2> = (0..model.nodes())
            .map(|j| conservative_force(&geometry, j, Vec2::zeros(), &shares, &points))
            .collect();
        let power: f64 = forces.iter().zip(&velocity).map(|(f, v)| f.dot(v)).sum();
        assert!((power + stored).abs() < 1e-12 * stored.abs().max(1.0) * 100.0, "{power} {stored}");
        assert!(forces.iter().sum::<Vec2>().norm() < 1e-12);
    }
}
