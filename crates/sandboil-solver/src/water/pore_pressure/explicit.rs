//! Forward Euler, with or without the acceleration term.

use super::{Flow, diffusion_rate};
use crate::{
    parallel::{Rows, chunks, for_each_chunk},
    weights::geometry::FlowTables,
};
use sandboil_sph::Vec2;

impl Flow {
    /// Diffuses the excess that volume strain has left by a step of `dt` s. `acceleration` of the nodes, m/s2, if its term
    /// takes part.
    pub(super) fn diffuse_explicitly(
        &mut self,
        threaded: bool,
        tables: &FlowTables,
        acceleration: Option<&[Vec2]>,
        dt: f64,
    ) {
        self.add_rates(threaded, tables, acceleration, dt);
        self.draw_to_drains(dt);
        self.excess.copy_from_slice(&self.next);
        self.hold_surface();
    }

    /// Adds what diffusion and acceleration bring.
    fn add_rates(&mut self, threaded: bool, tables: &FlowTables, acceleration: Option<&[Vec2]>, dt: f64) {
        let Some(diffusion) = &self.diffusion else { return };
        let mut next = std::mem::take(&mut self.next);
        let scale = dt / self.unit_weight;
        let (mut unit, mut other) = (vec![(); next.len()], vec![(); next.len()]);
        let mut results = vec![(); chunks(next.len())];
        let rows = Rows { a: &mut next, b: &mut unit, c: &mut other };
        for_each_chunk(threaded, rows, &mut results, |first, rows, ()| {
            for (k, next) in rows.a.iter_mut().enumerate() {
                let node = first + k;
                let mut rate = diffusion_rate(diffusion, &self.excess, node);
                if let Some(acceleration) = acceleration {
                    rate += self.inertial_rate(tables, acceleration, node);
                }
                *next += scale * self.stiffness[node] * rate;
            }
        });
        self.next = next;
    }

    /// What the acceleration of the soil drives into a node, kPa/m2 times the conductivity (m/s).
    fn inertial_rate(&self, tables: &FlowTables, acceleration: &[Vec2], node: usize) -> f64 {
        let driven: f64 = tables
            .divergence
            .forward
            .iter_row(node)
            .map(|(j, weight)| {
                // Beyond a free-field side the soil is the node's own.
                let mobility = self.mobility.get(j).unwrap_or(&self.mobility[node]);
                weight.dot(&(mobility * acceleration[j]))
            })
            .sum();
        // Air leaves no way for this flow either.
        let relative = self.wetting.as_ref().map_or(1.0, |wetting| wetting.relative(node));
        driven * self.unit_weight * relative
    }

    /// Backward Euler on drains: in a step they can take more than a forward step allows.
    fn draw_to_drains(&mut self, dt: f64) {
        let Some(edges) = &self.edges else { return };
        for drain in edges.drains() {
            let taken = dt * self.stiffness[drain.node] * drain.conductance;
            let left = &mut self.next[drain.node];
            *left = (*left + taken * drain.pressure) / (1.0 + taken);
        }
    }
}
