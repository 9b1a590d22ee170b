//! Ground that flows: what a stage of large displacements asks for beside strain and force.
//!
//! Nodes that approach each other are braked by Monaghan's artificial viscosity (1983, J. Comput. Phys. 52, 374-389),
//! so that they do not pair up: forces along the line between two nodes, which keep both momenta and only take
//! energy. Grains that fly alone have no strain, and so no stress that would stop them at an edge: they stick to it.

use crate::{
    boundary::{Hand, Outline},
    error::SolverError,
    geometry::Geometry,
    model::{Model, Operators, STRESS_NODES},
    parallel::{Rows, chunks, for_each_chunk},
    simulation::Shaking,
    skeleton::StressPoint,
};
use sandboil_sph::{Vec2, WendlandQuintic};

/// Keeps the approach of two nodes that meet finite, in squares of the smoothing length (Monaghan 1983).
const SOFTENING: f64 = 0.01;
/// Least distance of a node from an edge, in spacings: a bed of nodes has half of one.
const LEAST_DISTANCE: f64 = 0.2;

/// How ground is let go to flow: on the base and between the walls of statics, under its own weight.
#[derive(Debug, Clone, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct RunOut {
    /// Coefficient `alpha` of the artificial viscosity.
    pub viscosity: f64,
    /// Whether the left and the right side are taken away.
    pub open: [bool; 2],
    /// Surface of the still water around the ground, from left to right, m; empty: none. Left out: as it stood at rest.
    pub still_water: Option<Vec<Vec2>>,
}

impl RunOut {
    /// Refuses what no ground flows by, as part of a stage.
    ///
    /// # Errors
    /// A viscosity that is negative or not finite, and what the stage or the model asks for that ground which flows does not
    /// know: the printed operators, free-field sides and hydraulic conditions.
    pub fn validate(&self, model: &Model, stage: &Shaking) -> Result<(), SolverError> {
        let is_viscosity = self.viscosity >= 0.0 && self.viscosity.is_finite();
        let is_conservative = model.numerics.operators == Operators::Conservative;
        for (name, value, allowed, expected) in [
            ("run_out.viscosity", self.viscosity, is_viscosity, "zero or a positive number"),
            (
                "run_out",
                1.0,
                is_conservative,
                "left out with the printed operators, which small strains alone bear",
            ),
            (
                "run_out",
                1.0,
                stage.free_field == [false; 2],
                "left out beside free-field sides: ground leaves them",
            ),
            (
                "run_out",
                1.0,
                stage.conditions.is_empty(),
                "without hydraulic conditions, whose edges flow away",
            ),
        ] {
            if !allowed {
                return Err(SolverError::InvalidInput { name, value, expected });
            }
        }
        Ok(())
    }
}

/// Ground that flows.
#[derive(Debug, Clone, serde::Serialize, serde::Deserialize)]
pub struct Flowing {
    /// Forces that brake nodes which approach each other.
    pub viscosity: Viscosity,
    /// The edges, held where they stood when the ground was let go.
    pub outline: Outline,
    /// Sharpness of the weights of the lattice, 1/m2, for which the limits of the time step hold.
    pub lattice: [f64; 2],
    /// Factor on those limits where nodes have come closer than in the lattice.
    pub pace: f64,
    /// Outward normals of the nodes at a free surface, if water crosses it; else empty.
    pub free_surface: Vec<Option<Vec2>>,
}

impl Flowing {
    /// Bytes held.
    pub fn bytes(&self) -> usize {
        size_of_val(self.viscosity.force.as_slice()) + size_of_val(self.free_surface.as_slice())
    }

    /// Goes to weights of another sharpness, 1/m2.
    pub fn follow(&mut self, sharpness: [f64; 2]) {
        let squared = |(now, lattice): (f64, f64)| if lattice > 0.0 { now / lattice } else { 1.0 };
        let sharper = sharpness.into_iter().zip(self.lattice).map(squared).fold(1.0, f64::max);
        self.pace = sharper.sqrt().recip();
    }
}

/// Viscous forces of the present motion.
#[derive(Debug, Clone, serde::Serialize, serde::Deserialize)]
pub struct Viscosity {
    coefficient: f64,
    force: Vec<Vec2>,
}

impl Viscosity {
    /// None yet.
    pub fn new(coefficient: f64, nodes: usize) -> Self {
        Self { coefficient, force: vec![Vec2::zeros(); nodes] }
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

    /// Gathers the forces of all nodes at `position` (m) moving at `velocity` (m/s), with volumes in m2.
    pub fn update(
        &mut self,
        threaded: bool,
        (model, geometry): (&Model, &Geometry),
        points: &[StressPoint],
        (position, velocity, volume): (&[Vec2], &[Vec2], &[f64]),
    ) {
        let kernel = WendlandQuintic::new(model.smoothing_length());
        let h = kernel.smoothing_length();
        let least = SOFTENING * h * h;
        // Of the skeleton: water does not make it more viscous.
        let impedance = |node: usize| {
            let point = &points[STRESS_NODES * node];
            (point.stiffness * point.density).sqrt()
        };
        let strength = 0.5 * self.coefficient * h;
        let mut unit = [vec![(); position.len()], vec![(); position.len()]];
        let [b, c] = &mut unit;
        let rows = Rows { a: &mut self.force, b, c };
        for_each_chunk(threaded, rows, &mut vec![(); chunks(position.len())], |first, rows, ()| {
            for (k, force) in rows.a.iter_mut().enumerate() {
                let i = first + k;
                *force = Vec2::zeros();
                for (j, shift) in geometry.nodes_near(i) {
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

/// Stops nodes that would come too near an edge in the step. Returns how many.
pub fn stick_to_edges(
    (model, outline): (&Model, &Outline),
    position: &[Vec2],
    velocity: &mut [Vec2],
    acceleration: &mut [Vec2],
    dt: f64,
) -> u64 {
    let least = LEAST_DISTANCE * model.mean_spacing();
    let comes_near = |from: Vec2, to: Vec2| {
        let nears_base = outline.nearest_on_base(to).is_some_and(|(foot, _)| {
            let beyond = outline.base_elevation(to.x) > to.y;
            (beyond || (to - foot).norm() < least) && (to - from).dot(&outline.base_normal(to.x)) > 0.0
        });
        let nears_side = |(hand, side): (Hand, &Option<crate::Side>)| {
            side.is_some_and(|side| {
                let out = hand.normal().x;
                (side.extent[0]..=side.extent[1]).contains(&to.y)
                    && out * (side.x - to.x) < least
                    && out * (to.x - from.x) > 0.0
            })
        };
        nears_base || Hand::BOTH.into_iter().zip(&outline.sides).any(nears_side)
    };
    let mut stopped = 0;
    for ((at, v), a) in position.iter().zip(velocity).zip(acceleration) {
        if *v != Vec2::zeros() && comes_near(*at, at + *v * dt) {
            *a -= *v / dt;
            *v = Vec2::zeros();
            stopped += 1;
        }
    }
    stopped
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{boundary::Walls, skeleton::tests::square_block};
    use proptest::prelude::*;

    const SIDE: usize = 5;

    proptest! {
        /// Viscous forces keep both momenta, take energy and never give any, and leave alone what parts.
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
            let edges = (&model.outline, Walls::statics(&model.outline));
            let geometry = Geometry::build(&model, &model.position, &volume, edges, None);
            let points = vec![StressPoint { stiffness: 4.0, density: 1.0, ..StressPoint::default() }; 2 * SIDE * SIDE];
            let mut viscosity = Viscosity::new(0.1, SIDE * SIDE);
            let mut forces = |velocity: &[Vec2]| {
                viscosity.update(false, (&model, &geometry), &points, (&model.position, velocity, &volume));
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

    /// A grain that flies to the base or to a wall stops before it; one that leaves goes on.
    #[test]
    fn grains_stick_to_edges() {
        let mut model = square_block(1);
        model.outline = Outline::level(0.0);
        model.outline.sides[1] =
            Some(crate::Side { x: 5.0, extent: [0.0, 3.0], support: crate::Support::FreeSlip });
        let stopped = |at: Vec2, velocity: Vec2| {
            let (mut v, mut a) = ([velocity], [Vec2::zeros()]);
            let count = stick_to_edges((&model, &model.outline), &[at], &mut v, &mut a, 0.1);
            assert_eq!(count == 1, v[0] == Vec2::zeros());
            assert!((a[0] * 0.1 + velocity - v[0]).norm() < 1e-15);
            count == 1
        };
        assert!(stopped(Vec2::new(1.0, 0.3), Vec2::new(1.0, -2.0)));
        assert!(stopped(Vec2::new(1.0, 0.3), Vec2::new(1.0, -9.0)));
        assert!(!stopped(Vec2::new(1.0, 0.3), Vec2::new(1.0, 0.1)));
        assert!(!stopped(Vec2::new(1.0, 0.9), Vec2::new(1.0, -2.0)));
        assert!(stopped(Vec2::new(4.7, 1.0), Vec2::new(2.0, 0.0)));
        assert!(!stopped(Vec2::new(4.7, 4.0), Vec2::new(2.0, 0.0)));
    }
}
