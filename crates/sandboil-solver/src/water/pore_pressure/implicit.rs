//! Backward Euler on diffusion, after the volume strain of the step.

use super::{Flow, Scheme, diffusion_rate};
use crate::{
    linear::banded::BandedLu,
    section::node_id::id,
    water::moving_edges::{RunningDrain, WaterEdges},
};
use sandboil_sph::Csr;

/// Factors of the implicit matrix.
#[derive(Debug, Clone)]
pub struct Factors {
    /// The time step that they belong to, s.
    dt: f64,
    lu: BandedLu,
}

impl Factors {
    /// Bytes held.
    pub fn bytes(&self) -> usize {
        self.lu.bytes()
    }
}

impl Flow {
    /// Diffuses the excess that volume strain has left by a step of `dt` s. Returns `false` when the matrix cannot be
    /// factored.
    pub(super) fn diffuse_implicitly(&mut self, dt: f64) -> bool {
        let Some(mut factors) = self.factors(dt) else { return false };
        self.add_drains(dt);
        if self.wetting.is_some() {
            self.solve_for_change(&mut factors.lu, dt);
        } else {
            self.solve_for_excess(&mut factors.lu);
        }
        self.scheme = Scheme::Implicit { factors: Some(factors) };
        true
    }

    /// The factors that are there, or new ones for another time step or stiffer water.
    fn factors(&mut self, dt: f64) -> Option<Factors> {
        let Scheme::Implicit { factors } = &mut self.scheme else { return None };
        let kept = factors.take().filter(|factors| factors.dt == dt);
        let is_outgrown = self.wetting.as_ref().is_some_and(|wetting| wetting.is_outgrown(&self.stiffness));
        if kept.is_some() && !is_outgrown {
            return kept;
        }
        if let Some(wetting) = &mut self.wetting {
            wetting.factored.clone_from(&self.stiffness);
        }
        let lu = BandedLu::factor(&self.implicit_matrix(self.diffusion.as_ref()?, dt))?;
        Some(Factors { dt, lu })
    }

    fn drains(&self) -> impl Iterator<Item = RunningDrain> {
        self.edges.iter().flat_map(WaterEdges::drains)
    }

    /// `I - dt (K_f / n) div (k / gamma_f grad)`, with what drains take. Rows of tied nodes hold their tie instead.
    pub(super) fn implicit_matrix(&self, diffusion: &Csr<f64>, dt: f64) -> Csr<f64> {
        let drains: Vec<RunningDrain> = self.drains().collect();
        let scale = dt / self.unit_weight;
        let mut matrix = Csr::with_capacity(diffusion.rows(), diffusion.entries());
        let mut ties = self.surface.iter().peekable();
        for (row, stiffness) in self.stiffness.iter().enumerate() {
            let own = id(row);
            let mut entries = vec![(own, 1.0)];
            if let Some(tie) = ties.next_if(|tie| tie.node == own) {
                entries.push((tie.inner, -tie.fraction));
            } else {
                let (columns, weights) = diffusion.row(row);
                entries.extend(columns.iter().zip(weights).map(|(&c, w)| (c, -scale * stiffness * w)));
                let taken = drains.iter().filter(|drain| drain.node == row);
                entries.extend(taken.map(|drain| (own, dt * stiffness * drain.conductance)));
            }
            matrix.push_row(&mut entries);
        }
        matrix
    }

    /// What drains bring at the pressures that they hold.
    fn add_drains(&mut self, dt: f64) {
        let Some(edges) = &self.edges else { return };
        for drain in edges.drains() {
            self.next[drain.node] += dt * self.stiffness[drain.node] * drain.conductance * drain.pressure;
        }
    }

    /// Solves for the excess at the end of the step.
    fn solve_for_excess(&mut self, lu: &mut BandedLu) {
        for tie in &self.surface {
            self.next[tie.node as usize] = (1.0 - tie.fraction) * self.outside(tie.node as usize);
        }
        lu.solve(&mut self.next);
        self.excess.copy_from_slice(&self.next);
    }

    /// Solves for the change of the excess. The matrix may be older than the storage of partly saturated soil: it acts on
    /// the change alone, the rates are those at the start of the step.
    fn solve_for_change(&mut self, lu: &mut BandedLu, dt: f64) {
        let Some(diffusion) = &self.diffusion else { return };
        let mut change = std::mem::take(&mut self.next);
        let scale = dt / self.unit_weight;
        for (node, change) in change.iter_mut().enumerate() {
            *change += scale * self.stiffness[node] * diffusion_rate(diffusion, &self.excess, node)
                - self.excess[node];
        }
        for drain in self.drains() {
            let taken = dt * self.stiffness[drain.node] * drain.conductance;
            change[drain.node] -= taken * self.excess[drain.node];
        }
        for tie in &self.surface {
            change[tie.node as usize] = self.tied(tie) - self.excess[tie.node as usize];
        }
        lu.solve(&mut change);
        for (excess, change) in self.excess.iter_mut().zip(&change) {
            *excess += *change;
        }
        self.next = change;
    }
}
