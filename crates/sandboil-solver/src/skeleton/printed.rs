//! The printed force (Eqs 6, 10 and 11).

use crate::{
    skeleton::{phases::Phases, point::StressPoint},
    weights::printed::PrintedTables,
};
use sandboil_soil::Stress;
use sandboil_sph::Vec2;

/// Stresses that the printed force needs besides those of the stress nodes.
#[derive(Debug, Clone, Default, serde::Serialize, serde::Deserialize)]
pub struct PrintedStress {
    /// Effective stress `(xx, yy, xy)` at velocity nodes, Eq. 10.
    node: Vec<[f64; 3]>,
    /// The same at the mirrored stress nodes beyond the edges, Eq. 11.
    ghost: Vec<[f64; 3]>,
}

impl PrintedStress {
    /// Bytes held.
    pub fn bytes(&self) -> usize {
        size_of_val(self.node.as_slice()) + size_of_val(self.ghost.as_slice())
    }

    /// Evaluates Eqs 10 and 11. Below a base whose only shear traction is that of the dashpots, the shear
    /// stress of the ghosts is mirrored with the opposite sign.
    pub fn update(&mut self, tables: &PrintedTables, points: &[StressPoint]) {
        self.node.clear();
        self.node.extend((0..tables.interpolation.rows()).map(|i| {
            tables.interpolation.iter_row(i).fold([0.0; 3], |sum, (s, &w)| {
                let Stress { xx, yy, xy, .. } = points[s].stress;
                [sum[0] + w * xx, sum[1] + w * yy, sum[2] + w * xy]
            })
        }));
        self.ghost.clear();
        let node = &self.node;
        self.ghost.extend((0..tables.ghost_stress.rows()).map(|b| {
            let fitted = |table: &sandboil_sph::Csr<f64>, component: usize| -> f64 {
                table.iter_row(b).map(|(j, w)| w * node[j][component]).sum()
            };
            let shear = if tables.odd_shear[b] {
                -fitted(&tables.mirror_stress, 2)
            } else {
                fitted(&tables.ghost_stress, 2)
            };
            [fitted(&tables.ghost_stress, 0), fitted(&tables.ghost_stress, 1), shear]
        }));
    }

    /// Skeleton force of Eq. 6 on velocity node `i`, kN/m; with the dry densities of the velocity nodes.
    #[inline]
    pub fn force(&self, tables: &PrintedTables, i: usize, points: &[StressPoint], phases: &Phases) -> Vec2 {
        let (own, rho_i) = (self.node[i], phases.dry_density(i));
        let mut force = Vec2::zeros();
        let mut add = |stress: [f64; 3], rho_j: f64, gradient: &Vec2| {
            let (from_i, from_j) = (rho_j / rho_i, rho_i / rho_j);
            let [xx, yy, xy] = [0, 1, 2].map(|c| from_i * own[c] + from_j * stress[c]);
            force.x += xx * gradient.x + xy * gradient.y;
            force.y += xy * gradient.x + yy * gradient.y;
        };
        for (s, gradient) in tables.kernel_gradient.iter_row(i) {
            let Stress { xx, yy, xy, .. } = points[s].stress;
            add([xx, yy, xy], phases.dry_density(s / crate::section::description::STRESS_NODES), gradient);
        }
        for (b, gradient) in tables.ghost_gradient.iter_row(i) {
            add(self.ghost[b], rho_i, gradient);
        }
        force * phases.volume()[i]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        section::{
            description::{Operators, Region, STRESS_NODES},
            outline::EdgesView,
        },
        testing::square_block,
        weights::geometry::Geometry,
    };
    use sandboil_soil::Stress;

    /// Eq. 6 term by term as printed, with masses and densities, at a contact of two soils.
    #[test]
    fn printed_force_is_equation_6() {
        const SIDE: usize = 6;
        let mut model = square_block(SIDE);
        model.numerics.operators = Operators::Printed;
        model.regions.push(Region { porosity: 0.2, ..model.regions[0].clone() });
        model.region = (0..model.nodes()).map(|node| u32::from(node >= 18)).collect();
        let phases = Phases::new(&model);
        let edges = EdgesView::statics(&model.outline);
        let geometry = Geometry::build(&model, &model.position, phases.volume(), edges);
        let points: Vec<StressPoint> = (0..STRESS_NODES * model.nodes())
            .map(|s| StressPoint {
                stress: Stress { xx: s as f64, yy: 2.0 * s as f64, xy: -0.5 * s as f64, zz: 0.0 },
                ..StressPoint::default()
            })
            .collect();
        let tables = geometry.printed.as_ref().unwrap();
        let mut stress = PrintedStress::default();
        stress.update(tables, &points);
        let i = 14;
        let own = tables.interpolation.iter_row(i).fold([0.0; 3], |sum, (s, w)| {
            let Stress { xx, yy, xy, .. } = points[s].stress;
            [sum[0] + w * xx, sum[1] + w * yy, sum[2] + w * xy]
        });
        let rho_i = phases.dry_density(i);
        let mut expected = Vec2::zeros();
        for (s, v_grad_w) in tables.kernel_gradient.iter_row(i) {
            let rho_j = phases.dry_density(s / STRESS_NODES);
            // The table holds V_j grad W; m_j = rho_j V_j.
            let m_grad_w = v_grad_w * rho_j;
            let Stress { xx, yy, xy, .. } = points[s].stress;
            let sum = |own: f64, other: f64| own / (rho_i * rho_i) + other / (rho_j * rho_j);
            let (xx, yy, xy) = (sum(own[0], xx), sum(own[1], yy), sum(own[2], xy));
            expected += Vec2::new(xx * m_grad_w.x + xy * m_grad_w.y, xy * m_grad_w.x + yy * m_grad_w.y);
        }
        expected *= rho_i * phases.volume()[i];
        let found = stress.force(tables, i, &points, &phases);
        assert!((found - expected).norm() < 1e-12 * expected.norm(), "{found} {expected}");
    }
}
