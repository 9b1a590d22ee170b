//! Strain at the stress nodes and force at the velocity nodes: the mechanics of the soil skeleton.

use crate::{
    skeleton::{deformation::Deformation, point::StressPoint},
    weights::geometry::Geometry,
};
use sandboil_soil::StrainIncrement;
use sandboil_sph::Vec2;

/// The share of a stress node in the nodal forces, which the force loop gathers.
#[derive(Debug, Clone, Copy, PartialEq, Default, serde::Serialize, serde::Deserialize)]
pub struct NodalShare {
    /// Volume times nominal stress, less the linear part of the velocity filter, kN/m: its rows are
    /// multiplied by the gradient weights.
    tensor: [f64; 4],
    /// Kernel-weighted mean velocity around the stress node, m/s.
    mean_velocity: Vec2,
    /// Filter coefficient `xi rho_m C_s / dx V_s`, kN s/m2.
    filter: f64,
}

impl NodalShare {
    /// Adds a volume times nominal stress, kN/m.
    #[inline]
    pub fn add(&mut self, tensor: &[f64; 4]) {
        for (sum, term) in self.tensor.iter_mut().zip(tensor) {
            *sum += term;
        }
    }
}

/// Least shear-wave speed of the filter, m/s: short waves need damping in liquefied soil too.
pub const LEAST_FILTER_SPEED: f64 = 20.0;
/// Velocity gradient rows `grad v_x` and `grad v_y` at a stress node in the geometry's frame, images
/// included; for the filter the mean velocity and the gradient without images (Eq. 8 in least-squares form).
pub struct Motion {
    x: Vec2,
    y: Vec2,
    free_x: Vec2,
    free_y: Vec2,
    mean_velocity: Vec2,
}

/// Gathers the velocity field at stress node `s`.
#[inline]
pub fn motion(geometry: &Geometry, s: usize, velocity: &[Vec2]) -> Motion {
    let (mut x, mut y, mut mean_velocity) = (Vec2::zeros(), Vec2::zeros(), Vec2::zeros());
    for (j, weight) in geometry.gradient.forward.iter_row(s) {
        let v_j = velocity[j];
        x += weight.gradient * v_j.x;
        y += weight.gradient * v_j.y;
        mean_velocity += v_j * weight.share;
    }
    let (free_x, free_y) = (x, y);
    for (j, weight) in geometry.wall.forward.iter_row(s) {
        let v_j = velocity[j];
        let (added_x, added_y) = weight.gradients(v_j);
        x += added_x;
        y += added_y;
    }
    Motion { x, y, free_x, free_y, mean_velocity }
}

impl Motion {
    /// Gradient in the geometry's frame, rows `x` and `y`.
    #[inline]
    pub fn gradient(&self) -> (Vec2, Vec2) {
        (self.x, self.y)
    }

    /// Strain and spin over a step (Eq. 4), and the deformation at its end.
    #[inline]
    pub fn advance(&self, deformation: &mut Deformation, dt: f64) -> StrainIncrement {
        let (x, y) = (self.x * dt, self.y * dt);
        let increment = self.increment(&deformation.moved(0.5 * x, 0.5 * y), dt);
        *deformation = deformation.moved(x, y);
        increment
    }

    /// Strain and spin over a time at a given deformation.
    #[inline]
    pub fn increment(&self, deformation: &Deformation, dt: f64) -> StrainIncrement {
        let (x, y) = (deformation.in_space(self.x) * dt, deformation.in_space(self.y) * dt);
        StrainIncrement { xx: x.x, yy: y.y, xy: x.y + y.x, spin: 0.5 * (x.y - y.x) }
    }

    /// Share of the stress node in the nodal forces: its stress, and the filter's linear part.
    ///
    /// The filter damps the residual of every velocity node from the linear fit, `v_j - v_s - grad v (x_j -
    /// x_s)`. Summed over a stencil, the linear part is `grad v . c` times the gradient weights, so it is
    /// added to the stress; the rest needs only the mean velocity. The sum is symmetric, and zero for linear
    /// fields. `filter` is its strength `xi / dx`, 1/m.
    #[inline]
    pub fn share(&self, point: &StressPoint, covariance: [f64; 3], filter: f64) -> NodalShare {
        let speed = (point.shear_modulus / point.density).sqrt().max(LEAST_FILTER_SPEED);
        let coefficient = filter * point.density * speed * point.volume;
        let [c_xx, c_xy, c_yy] = covariance;
        let linear = |g: Vec2| [g.x * c_xx + g.y * c_xy, g.x * c_xy + g.y * c_yy];
        let (f_x, f_y) = (linear(self.free_x), linear(self.free_y));
        let [xx, xy, yx, yy] = point.deformation.cofactor().nominal(&point.total_stress());
        NodalShare {
            tensor: [
                point.volume * xx - coefficient * f_x[0],
                point.volume * xy - coefficient * f_x[1],
                point.volume * yx - coefficient * f_y[0],
                point.volume * yy - coefficient * f_y[1],
            ],
            mean_velocity: self.mean_velocity,
            filter: coefficient,
        }
    }
}

/// Force of the skeleton on velocity node `j`, kN/m: the exact transpose of the gradient.
#[inline]
pub fn conservative_force(
    geometry: &Geometry,
    j: usize,
    velocity: Vec2,
    shares: &[NodalShare],
    points: &[StressPoint],
) -> Vec2 {
    let mut force = Vec2::zeros();
    for (s, weight) in geometry.gradient.transposed.iter_row(j) {
        let share = &shares[s];
        let [xx, xy, yx, yy] = share.tensor;
        let g = weight.gradient;
        force.x -= xx * g.x + xy * g.y;
        force.y -= yx * g.x + yy * g.y;
        force += (share.mean_velocity - velocity) * (share.filter * weight.share);
    }
    for (s, weight) in geometry.wall.transposed.iter_row(j) {
        let point = &points[s];
        force -= weight.contract(point.deformation.cofactor().nominal(&point.total_stress())) * point.volume;
    }
    force
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;
    use crate::{
        section::{
            description::{Model, STRESS_NODES},
            outline::{Condition, EdgesView, Side, Support, Walls},
        },
        testing::{block, square_block},
    };
    use proptest::prelude::*;
    use sandboil_soil::Stress;
    use sandboil_sph::Period;

    const COLUMNS: usize = 5;
    const ROWS: usize = 6;
    const NODES: usize = COLUMNS * ROWS;

    /// A block of unit spacing with disordered nodes; free unless a period is given.
    fn disordered(disorder: &[(f64, f64)], period: Option<Period>) -> Model {
        let place = |(k, (a, b)): (usize, &(f64, f64))| {
            Vec2::new((k % COLUMNS) as f64 + 0.1 * a, (k / COLUMNS) as f64 + 0.1 * b)
        };
        block(disorder.iter().enumerate().map(place).collect(), period)
    }

    fn forces(geometry: &Geometry, points: &[StressPoint], velocity: &[Vec2], filter: f64) -> Vec<Vec2> {
        let shares: Vec<NodalShare> = (0..points.len())
            .map(|s| motion(geometry, s, velocity).share(&points[s], geometry.covariance[s], filter))
            .collect();
        let force = |j| conservative_force(geometry, j, velocity[j], &shares, points);
        (0..velocity.len()).map(force).collect()
    }

    fn vectors(range: f64, count: usize) -> impl Strategy<Value = Vec<(f64, f64)>> {
        prop::collection::vec((-range..range, -range..range), count)
    }

    /// Nodes that move with `dx/dt = A X` strain the soil at the rate `A F^-1`, which decreases as the soil
    /// gets longer.
    #[test]
    fn strain_is_measured_in_the_deformed_frame() {
        const STEPS: u32 = 200;
        let model = square_block(6);
        let edges = EdgesView::statics(&model.outline);
        let geometry = Geometry::build(&model, &model.position, &[1.0; 36], edges);
        let velocity: Vec<Vec2> = model.position.iter().map(|x| Vec2::new(0.3 * x.x, 0.0)).collect();
        let mut deformation = Deformation::default();
        let strain: f64 = (0..STEPS)
            .map(|_| motion(&geometry, 30, &velocity).advance(&mut deformation, 1.0 / f64::from(STEPS)).xx)
            .sum();
        assert!((deformation.xx - 1.3).abs() < 1e-12 && (strain - 1.3_f64.ln()).abs() < 1e-6, "{strain}");
    }

    /// Images continue the motions that a sloping base allows. Motion along a smooth base causes no strain;
    /// motion in proportion to the distance from a rough base has the exact gradient at every stress node.
    #[test]
    fn images_at_a_slope_continue_allowed_motions() {
        for slope in [0.1_f64, 0.5, 1.0] {
            let mut model = square_block(6);
            let base = [-3.0, 9.0].map(|x| Vec2::new(x, -0.5 - 5.0 * slope + slope * x));
            model.outline.base = base.to_vec();
            let along = (base[1] - base[0]).normalize();
            let away = Vec2::new(-along.y, along.x);
            let distance = |x: &Vec2| (x - base[0]).dot(&away);
            for (condition, rate) in [(Condition::FreeSlip, 0.0), (Condition::NoSlip, 0.3)] {
                let edges = EdgesView {
                    outline: &model.outline,
                    walls: Walls::shaken(&model.outline, condition, [false; 2]),
                };
                let geometry = Geometry::build(&model, &model.position, &[1.0; 36], edges);
                assert!(geometry.wall.forward.entries() > 0);
                let speed = |x: &Vec2| if rate == 0.0 { 1.0 } else { rate * distance(x) };
                let velocity: Vec<Vec2> = model.position.iter().map(|x| along * speed(x)).collect();
                for s in 0..STRESS_NODES * model.nodes() {
                    let (x, y) = motion(&geometry, s, &velocity).gradient();
                    let error = (x - away * (rate * along.x)).norm() + (y - away * (rate * along.y)).norm();
                    assert!(error < 1e-12, "{condition:?} {slope}: {error}");
                }
            }
        }
    }

    /// Simple shear to the right turns the soil clockwise: engineering shear and positive spin.
    #[test]
    fn simple_shear_has_positive_spin() {
        let model = square_block(6);
        let edges = EdgesView::statics(&model.outline);
        let geometry = Geometry::build(&model, &model.position, &[1.0; 36], edges);
        let velocity: Vec<Vec2> = model.position.iter().map(|x| Vec2::new(0.2 * x.y, 0.0)).collect();
        let rate = motion(&geometry, 30, &velocity).increment(&Deformation::default(), 1.0);
        let expected = StrainIncrement { xx: 0.0, yy: 0.0, xy: 0.2, spin: 0.1 };
        let close = |a: f64, b: f64| (a - b).abs() < 1e-13;
        assert!(close(rate.xx, expected.xx) && close(rate.yy, expected.yy), "{rate:?}");
        assert!(close(rate.xy, expected.xy) && close(rate.spin, expected.spin), "{rate:?}");
    }

    proptest! {
        #[test]
        fn force_is_the_transpose_of_strain_and_conserves_momentum(
            disorder in vectors(1.0, NODES), v in vectors(1.0, NODES), normal in vectors(9.0, STRESS_NODES * NODES),
            shear in vectors(9.0, STRESS_NODES * NODES), wall in 0_u8..4, tilt in prop_oneof![Just(0.0), 0.0_f64..0.6], strain in prop_oneof![Just(0.0), Just(0.2)],
        ) {
            let wall_at_base = wall > 0;
            let mut model = disordered(&disorder, None);
            if wall_at_base {
                // Level, sloping or curved, with a side or without.
                let at = |x: f64, y: f64| Vec2::new(x, -0.5 + tilt * y);
                model.outline.base = vec![at(-1.0, -1.0), at(1.5, 0.3), at(5.0, 1.0)];
                let side = Side { x: -0.5, extent: [-9.0, 9.0], support: Support::FreeSlip };
                model.outline.sides[0] = (tilt > 0.1).then_some(side);
            }
            let base = [
                Condition::NoSlip, Condition::NoSlip, Condition::VerticalRoller, Condition::FreeSlip,
            ][wall as usize];
            let edges = EdgesView { outline: &model.outline, walls: Walls::shaken(&model.outline, base, [false; 2]) };
            let geometry = Geometry::build(&model, &model.position, &[1.0; NODES], edges);
            let velocity: Vec<Vec2> = v.iter().map(|&(x, y)| Vec2::new(x, y)).collect();
            let points: Vec<StressPoint> = normal.iter().zip(&shear).map(|(n, s)| StressPoint {
                stress: Stress { xx: n.0, yy: n.1, xy: s.0, zz: 0.0 },
                density: 1.0,
                volume: 0.5,
                // Any deformation with a positive volume ratio.
                deformation: Deformation::default().moved(
                    Vec2::new(strain * s.1, -strain * n.0) / 9.0, Vec2::new(strain * n.1, strain * s.0) / 9.0,
                ),
                ..StressPoint::default()
            }).collect();
            let force = forces(&geometry, &points, &velocity, 0.0);
            let power: f64 = force.iter().zip(&velocity).map(|(f, v)| f.dot(v)).sum();
            let stored: f64 = points.iter().enumerate().map(|(s, point)| {
                let rate = motion(&geometry, s, &velocity).increment(&point.deformation, 1.0);
                point.volume * point.deformation.volume_ratio() * (point.stress.xx * rate.xx + point.stress.yy * rate.yy + point.stress.xy * rate.xy)
            }).sum();
            prop_assert!((power + stored).abs() < 1e-12 * (1.0 + stored.abs()) * 100.0, "{} {}", power, stored);
            if !wall_at_base {
                let linear: Vec2 = force.iter().sum();
                let angular: f64 = force.iter().zip(&model.position).map(|(f, x)| x.x * f.y - x.y * f.x).sum();
                prop_assert!(linear.norm() < 1e-11, "{}", linear);
                // The nodes do not move with the deformation, so the moment is meaningful only without it.
                prop_assert!(strain > 0.0 || angular.abs() < 1e-10, "{}", angular);
            }
        }

        #[test]
        fn filter_takes_energy_from_rough_fields_and_leaves_linear_ones(
            disorder in vectors(1.0, NODES), v in vectors(1.0, NODES), periodic in any::<bool>(),
            (a, b, c, d) in (-1.0_f64..1.0, -1.0_f64..1.0, -1.0_f64..1.0, -1.0_f64..1.0),
        ) {
            let period = periodic.then_some(Period { width: COLUMNS as f64 });
            let model = disordered(&disorder, period);
            let edges = EdgesView::statics(&model.outline);
            let geometry = Geometry::build(&model, &model.position, &[1.0; NODES], edges);
            let points = vec![StressPoint { shear_modulus: 1e4, density: 1.0, volume: 0.5, ..StressPoint::default() }; STRESS_NODES * NODES];
            let rough: Vec<Vec2> = v.iter().map(|&(x, y)| Vec2::new(x, y)).collect();
            let force = forces(&geometry, &points, &rough, 0.1);
            let power: f64 = force.iter().zip(&rough).map(|(f, v)| f.dot(v)).sum();
            prop_assert!(power < 0.0, "{}", power);
            // Largest eigenvalue of the filter: 1.05 xi C_s / dx, so no more power than that.
            let bound = 1.1 * 0.1 * 100.0 * rough.iter().map(Vec2::norm_squared).sum::<f64>();
            prop_assert!(-power < 2.0 * bound, "{} {}", power, bound);
            if !periodic {
                let linear: Vec<Vec2> =
                    model.position.iter().map(|x| Vec2::new(a + b * x.x + c * x.y, d - c * x.x + a * x.y)).collect();
                let force = forces(&geometry, &points, &linear, 0.1);
                prop_assert!(force.iter().all(|f| f.norm() < 1e-9), "{:?}", force);
            }
        }
    }
}
