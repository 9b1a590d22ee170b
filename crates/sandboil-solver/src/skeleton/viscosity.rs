//! Artificial viscosity of Monaghan (1983, J. Comput. Phys. 52, 374-389): slows nodes that approach each
//! other, so that they do not form pairs. The forces act along the line between two nodes, conserve linear
//! and angular momentum, and dissipate energy.

use crate::{
    parallel::{Rows, chunks, for_each_chunk},
    section::{
        description::{Model, STRESS_NODES},
        stress_layout::StressLayout,
    },
    skeleton::point::StressPoint,
    weights::geometry::Geometry,
};
use sandboil_sph::{Vec2, WendlandQuintic};

/// Softening of the squared distance, over the squared smoothing length: the force stays finite when two
/// nodes meet (Monaghan 1983).
pub const SOFTENING: f64 = 0.01;

/// The present motion of all nodes.
#[derive(Clone, Copy)]
pub struct MovingNodes<'a> {
    /// Positions, m.
    pub position: &'a [Vec2],
    /// Velocities, m/s.
    pub velocity: &'a [Vec2],
    /// Volumes per unit thickness, m2.
    pub volume: &'a [f64],
}

/// Viscous forces of the present motion.
#[derive(Debug, Clone, serde::Serialize, serde::Deserialize)]
pub struct Viscosity {
    coefficient: f64,
    force: Vec<Vec2>,
}

impl Viscosity {
    /// No forces yet.
    pub fn new(coefficient: f64, nodes: usize) -> Self {
        Self { coefficient, force: vec![Vec2::zeros(); nodes] }
    }

    /// Bytes held.
    pub fn bytes(&self) -> usize {
        size_of_val(self.force.as_slice())
    }

    /// Coefficient `alpha`.
    pub fn coefficient(&self) -> f64 {
        self.coefficient
    }

    /// Force on node `j`, kN/m.
    #[inline]
    pub fn force(&self, j: usize) -> Vec2 {
        self.force[j]
    }

    /// Gathers the forces on all nodes.
    pub fn update(
        &mut self,
        threaded: bool,
        (model, layout): (&Model, &StressLayout),
        geometry: &Geometry,
        points: &[StressPoint],
        MovingNodes { position, velocity, volume }: MovingNodes,
    ) {
        let kernel = WendlandQuintic::new(model.smoothing_length());
        let h = kernel.smoothing_length();
        let least = SOFTENING * h * h;
        // Impedance of the skeleton alone: water adds no viscosity.
        let impedance = |node: usize| {
            let of_point = |s: usize| (points[s].stiffness * points[s].density).sqrt();
            match layout.dual() {
                None => of_point(STRESS_NODES * node),
                Some(_) => layout.of_node(node).map(|(s, share)| share * of_point(s)).sum(),
            }
        };
        let strength = 0.5 * self.coefficient * h;
        let mut unit = [vec![(); position.len()], vec![(); position.len()]];
        let [b, c] = &mut unit;
        let rows = Rows { a: &mut self.force, b, c };
        for_each_chunk(threaded, rows, &mut vec![(); chunks(position.len())], |first, rows, ()| {
            for (k, force) in rows.a.iter_mut().enumerate() {
                let i = first + k;
                *force = Vec2::zeros();
                for (j, shift) in geometry.lists().nodes_near(i) {
                    let mut offset = position[j] - position[i];
                    offset.x += shift * model.period.map_or(0.0, |period| period.width);
                    let approach = (velocity[j] - velocity[i]).dot(&offset);
                    if i == j || approach >= 0.0 {
                        continue;
                    }
                    let rate = approach / (offset.norm_squared() + least);
                    let pair = volume[i] * volume[j] * strength * (impedance(i) + impedance(j));
                    *force += kernel.gradient(offset) * (pair * rate);
                }
            }
        });
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{section::outline::EdgesView, testing::square_block};
    use proptest::prelude::*;

    const SIDE: usize = 5;

    proptest! {
        /// Viscous forces conserve linear and angular momentum, only take energy, and are zero between nodes
        /// that move apart.
        #[test]
        fn viscosity_only_takes_energy(
            places in prop::collection::vec((-0.3_f64..0.3, -0.3_f64..0.3), SIDE * SIDE),
            velocities in prop::collection::vec((-1.0_f64..1.0, -1.0_f64..1.0), SIDE * SIDE),
        ) {
            let mut model = square_block(SIDE);
            for (at, (x, y)) in model.position.iter_mut().zip(places) {
                *at += Vec2::new(x, y);
            }
            let velocity: Vec<Vec2> = velocities.into_iter().map(|(x, y)| Vec2::new(x, y)).collect();
            let volume = vec![1.0; SIDE * SIDE];
            let edges = EdgesView::statics(&model.outline);
            let geometry = Geometry::build(&model, &model.position, &volume, edges);
            let points = vec![StressPoint { stiffness: 4.0, density: 1.0, ..StressPoint::default() }; 2 * SIDE * SIDE];
            let mut viscosity = Viscosity::new(0.1, SIDE * SIDE);
            let mut forces = |velocity: &[Vec2]| {
                let nodes = MovingNodes { position: &model.position, velocity, volume: &volume };
                viscosity.update(false, (&model, &StressLayout::Diagonal), &geometry, &points, nodes);
                viscosity.force.clone()
            };
            let force = forces(&velocity);
            let total: Vec2 = force.iter().sum();
            let moment: f64 = force.iter().zip(&model.position).map(|(f, x)| x.perp(f)).sum();
            let power: f64 = force.iter().zip(&velocity).map(|(f, v)| f.dot(v)).sum();
            prop_assert!(total.norm() < 1e-12 && moment.abs() < 1e-12, "{total} {moment}");
            prop_assert!(power < 0.0, "{power}");
            prop_assert!(forces(&model.position).iter().all(|force| force.norm() == 0.0));
        }
    }
}
