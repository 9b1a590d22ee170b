//! Pore pressure of the single-layer u-p formulation (Eq. 3, discretised by Eq. 7), saturated.
//!
//! The unknown is the excess over the pressure at the start of the stage, in kPa: its reference is carried by
//! the constant nodal forces, and only the increments meet the transposed operators.

use crate::{
    banded::BandedLu,
    boundary::id,
    deformation::{Cofactor, Deformation},
    geometry::FlowTables,
    model::{Model, STRESS_NODES, Water},
    parallel::{Rows, chunks, for_each_chunk},
    phases::Phases,
    skeleton::StressPoint,
};
use sandboil_sph::{Csr, Mat2, Vec2};

/// A node whose pressure follows from the prescribed value on the free surface (half-cell rule): only where the
/// soil lets water out.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize, serde::Deserialize)]
struct SurfaceNode {
    node: u32,
    inner: u32,
    /// Depth of the node over the depth of the inner node.
    fraction: f64,
}

/// Excess pore pressure and what moves it.
#[derive(Debug, Clone, serde::Serialize, serde::Deserialize)]
pub struct Flow {
    /// Excess pore pressure at velocity nodes, kPa, compression positive.
    pub excess: Vec<f64>,
    /// `J F^-T` at velocity nodes: the mean deformation of their stress nodes.
    cofactor: Vec<Cofactor>,
    /// `K_f / n`: pressure rise per unit of volume strain, kPa.
    stiffness: Vec<f64>,
    /// Hydraulic conductivity over gravity, s: what a unit of acceleration drives.
    mobility: Vec<Mat2>,
    unit_weight: f64,
    surface: Vec<SurfaceNode>,
    /// Share of each node's excess pressure in the force: none of a node tied to the surface, all of the others.
    push: Vec<f64>,
    scheme: Scheme,
    right_hand_side: Vec<f64>,
}

#[derive(Debug, Clone, serde::Serialize, serde::Deserialize)]
enum Scheme {
    /// No conductivity: pressure changes by volume strain alone.
    Undrained,
    /// Forward Euler, with or without the acceleration term.
    Explicit { acceleration_term: bool },
    /// Backward Euler; factors belong to a time step.
    Implicit {
        // Not stored: they are made anew, the same, from what is.
        #[serde(skip)]
        factors: Option<(f64, BandedLu)>,
    },
}

/// What the caller chose for a stage.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum FlowScheme {
    /// No diffusion.
    Undrained,
    /// Forward Euler without the acceleration term.
    Explicit,
    /// Forward Euler with the acceleration term.
    ExplicitWithAcceleration,
    /// Backward Euler.
    Implicit,
}

impl Flow {
    /// Zero excess pressure everywhere.
    pub fn new(model: &Model, phases: &Phases, scheme: FlowScheme) -> Option<Self> {
        let water = model.water?;
        let conductivity = |node: usize| model.regions[model.region[node] as usize].hydraulic_conductivity;
        let drains = |tie: &SurfaceNode| conductivity(tie.node as usize).major > 0.0;
        let surface: Vec<SurfaceNode> = surface_nodes(model, water).into_iter().filter(drains).collect();
        // Only the acceleration term reads them.
        let mobility = if scheme == FlowScheme::ExplicitWithAcceleration {
            (0..model.nodes()).map(|node| conductivity(node).tensor() / model.gravity).collect()
        } else {
            Vec::new()
        };
        let mut push = vec![1.0; model.nodes()];
        for tie in &surface {
            push[tie.node as usize] = 0.0;
        }
        Some(Self {
            excess: vec![0.0; model.nodes()],
            cofactor: vec![Deformation::default().cofactor(); model.nodes()],
            stiffness: (0..model.nodes()).map(|node| stiffness(model, phases, node)).collect(),
            mobility,
            unit_weight: water.unit_weight,
            surface,
            push,
            scheme: match scheme {
                FlowScheme::Undrained => Scheme::Undrained,
                FlowScheme::Explicit => Scheme::Explicit { acceleration_term: false },
                FlowScheme::ExplicitWithAcceleration => Scheme::Explicit { acceleration_term: true },
                FlowScheme::Implicit => Scheme::Implicit { factors: None },
            },
            right_hand_side: vec![0.0; model.nodes()],
        })
    }

    /// Takes over the porosities and forgets factors made for another geometry.
    pub fn geometry_changed(&mut self, model: &Model, phases: &Phases) {
        for (node, stiffness) in self.stiffness.iter_mut().enumerate() {
            *stiffness = self::stiffness(model, phases, node);
        }
        self.cofactor.fill(Deformation::default().cofactor());
        if let Scheme::Implicit { factors } = &mut self.scheme {
            *factors = None;
        }
    }

    /// The scheme in the user's words.
    pub fn scheme_name(&self) -> &'static str {
        match self.scheme {
            Scheme::Undrained => "undrained",
            Scheme::Explicit { acceleration_term: false } => "explicit",
            Scheme::Explicit { acceleration_term: true } => "explicit with acceleration term",
            Scheme::Implicit { .. } => "implicit",
        }
    }

    /// Bytes held.
    pub fn bytes(&self) -> usize {
        let factors = match &self.scheme {
            Scheme::Implicit { factors: Some((_, lu)) } => lu.bytes(),
            _ => 0,
        };
        4 * size_of_val(self.excess.as_slice())
            + size_of_val(self.mobility.as_slice())
            + size_of_val(self.cofactor.as_slice())
            + factors
    }

    /// Nominal excess pressure `q J F^-T` of node `i`, kPa.
    pub fn nominal(&self, i: usize) -> [f64; 4] {
        self.cofactor[i].scaled(self.excess[i] * self.push[i])
    }

    /// Force of the excess pressure on node `j`, kN/m: the exact transpose of the divergence.
    #[inline]
    pub fn force(&self, tables: &FlowTables, j: usize) -> Vec2 {
        let row = tables.divergence.transposed.iter_row(j);
        row.map(|(i, weight)| self.cofactor[i].carry(*weight) * (self.excess[i] * self.push[i])).sum()
    }

    /// Advances the excess pressure by one step from the velocity field at its middle (Eq. 7) and the deformation of
    /// the stress nodes at its end.
    ///
    /// Returns `false` when the implicit matrix cannot be factored (not finite).
    #[must_use]
    pub fn step(
        &mut self,
        threaded: bool,
        tables: &FlowTables,
        points: &[StressPoint],
        velocity: &[Vec2],
        acceleration: &[Vec2],
        dt: f64,
    ) -> bool {
        let divergence = &tables.divergence.forward;
        // Slices of nothing, which take no memory: the loops below write one array or two.
        let mut unit = vec![(); self.excess.len()];
        let mut results = vec![(); chunks(self.excess.len())];
        let (excess, stiffness) = (&self.excess, &self.stiffness);
        let rows = Rows { a: &mut self.right_hand_side, b: &mut self.cofactor, c: &mut unit };
        for_each_chunk(threaded, rows, &mut results, |first, rows, ()| {
            for (k, (right_hand_side, cofactor)) in rows.a.iter_mut().zip(rows.b).enumerate() {
                let node = first + k;
                let (mut x, mut y) = (Vec2::zeros(), Vec2::zeros());
                for (j, weight) in divergence.iter_row(node) {
                    x += weight * velocity[j].x;
                    y += weight * velocity[j].y;
                }
                let [one, other] = [0, 1].map(|s| &points[STRESS_NODES * node + s].deformation);
                let deformation = one.mean(other);
                *cofactor = deformation.cofactor();
                let volume_rate = cofactor.contract(x, y) / deformation.volume_ratio();
                // dp = (gamma_f / C) dh-rate with C = n gamma_f / K_f.
                *right_hand_side = excess[node] - dt * stiffness[node] * volume_rate;
            }
        });
        match (&mut self.scheme, &tables.diffusion) {
            (Scheme::Explicit { acceleration_term }, Some(diffusion)) => {
                let mobility = acceleration_term.then_some((&self.mobility, self.unit_weight));
                let scale = dt / self.unit_weight;
                let mut other = vec![(); excess.len()];
                let rows = Rows { a: &mut self.right_hand_side, b: &mut unit, c: &mut other };
                for_each_chunk(threaded, rows, &mut results, |first, rows, ()| {
                    for (k, right_hand_side) in rows.a.iter_mut().enumerate() {
                        let node = first + k;
                        let mut rate: f64 =
                            diffusion.iter_row(node).map(|(j, weight)| weight * excess[j]).sum();
                        if let Some((mobility, unit_weight)) = mobility {
                            let carried: f64 = divergence
                                .iter_row(node)
                                .map(|(j, weight)| {
                                    // Beyond a free-field side the soil is the node's own.
                                    let mobility = mobility.get(j).unwrap_or(&mobility[node]);
                                    weight.dot(&(mobility * acceleration[j]))
                                })
                                .sum();
                            rate += carried * unit_weight;
                        }
                        *right_hand_side += scale * stiffness[node] * rate;
                    }
                });
                self.excess.copy_from_slice(&self.right_hand_side);
                self.hold_surface();
            }
            (Scheme::Implicit { factors }, Some(diffusion)) => {
                if factors.as_ref().is_none_or(|(made_for, _)| *made_for != dt) {
                    let matrix =
                        implicit_matrix(diffusion, &self.surface, &self.stiffness, dt / self.unit_weight);
                    *factors = BandedLu::factor(&matrix).map(|lu| (dt, lu));
                }
                let Some((_, lu)) = factors else { return false };
                for tie in &self.surface {
                    self.right_hand_side[tie.node as usize] = 0.0;
                }
                lu.solve(&mut self.right_hand_side);
                self.excess.copy_from_slice(&self.right_hand_side);
            }
            // Nothing flows, so nothing drains at the surface either.
            _ => self.excess.copy_from_slice(&self.right_hand_side),
        }
        true
    }

    /// Half-cell rule: zero excess belongs to the surface, not to the centre of the node below it.
    fn hold_surface(&mut self) {
        for tie in &self.surface {
            self.excess[tie.node as usize] = tie.fraction * self.excess[tie.inner as usize];
        }
    }
}

/// Pressure rise of a node per unit of volume strain, kPa. Above the water table air gives way.
fn stiffness(model: &Model, phases: &Phases, node: usize) -> f64 {
    if model.saturation(node) < 1.0 { 0.0 } else { model.water_stiffness(phases.porosity(node)) }
}

/// `I - dt/C div(k grad)` with the surface nodes' rows replaced by their tie.
fn implicit_matrix(diffusion: &Csr<f64>, surface: &[SurfaceNode], stiffness: &[f64], scale: f64) -> Csr<f64> {
    let mut matrix = Csr::with_capacity(diffusion.rows(), diffusion.entries());
    let mut ties = surface.iter().peekable();
    for (row, stiffness) in stiffness.iter().enumerate() {
        let own = u32::try_from(row).unwrap_or(u32::MAX);
        let mut entries = vec![(own, 1.0)];
        if let Some(tie) = ties.next_if(|tie| tie.node == own) {
            entries.push((tie.inner, -tie.fraction));
        } else {
            let (columns, weights) = diffusion.row(row);
            entries.extend(columns.iter().zip(weights).map(|(&c, w)| (c, -scale * stiffness * w)));
        }
        matrix.push_row(&mut entries);
    }
    matrix
}

/// Nodes within one spacing of the drained surface, each with the node below that it interpolates to. That surface is the
/// ground, or the water table where it lies deeper; what is above it has no excess pressure.
fn surface_nodes(model: &Model, water: Water) -> Vec<SurfaceNode> {
    let is_partly_saturated = !model.saturation.is_empty();
    let depth = |node: usize| {
        let below_ground = model.surface_elevation[node] - model.position[node].y;
        if !is_partly_saturated {
            return below_ground;
        }
        if model.saturation(node) < 1.0 {
            0.0
        } else {
            below_ground.min(model.pore_pressure[node] / water.unit_weight)
        }
    };
    let near: Vec<usize> = (0..model.nodes()).filter(|&node| depth(node) < model.spacing.y).collect();
    let below = |node: usize| Vec2::new(model.position[node].x, model.position[node].y - model.spacing.y);
    near.iter()
        .filter_map(|&node| {
            if is_partly_saturated && depth(node) <= 0.0 {
                return Some(SurfaceNode { node: id(node), inner: id(node), fraction: 0.0 });
            }
            let wanted = below(node);
            let miss = |other: usize| {
                let mut offset = model.position[other] - wanted;
                if let Some(period) = model.period {
                    offset.x -= period.width * (offset.x / period.width).round();
                }
                offset.norm_squared()
            };
            let inner = (0..model.nodes())
                .filter(|&other| depth(other) > depth(node))
                .min_by(|&a, &b| miss(a).total_cmp(&miss(b)))?;
            Some(SurfaceNode { node: id(node), inner: id(inner), fraction: depth(node) / depth(inner) })
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        boundary::{Condition, Outline, Walls},
        geometry::Geometry,
        model::Conductivity,
        skeleton::tests::square_block,
    };
    use sandboil_sph::Period;

    /// Steady flow up through two layers whose conductivities differ a thousandfold: the head falls in each by
    /// Darcy's law for the flux that is fed in below.
    #[test]
    fn a_contact_of_two_soils_passes_the_flux() {
        const SIDE: usize = 20;
        const CONTRAST: f64 = 1e3;
        let mut model = square_block(SIDE);
        model.period = Some(Period { width: SIDE as f64 });
        model.outline = Outline::level(-0.5);
        model.surface_elevation = vec![SIDE as f64 - 0.5; model.nodes()];
        model.water = Some(Water { unit_weight: 1.0, bulk_modulus: 1.0 });
        model.pore_pressure = model.position.iter().map(|x| SIDE as f64 - 0.5 - x.y).collect();
        model.regions.push(model.regions[0].clone());
        for (region, conductivity) in model.regions.iter_mut().zip([1.0, 1.0 / CONTRAST]) {
            region.hydraulic_conductivity = Conductivity::isotropic(conductivity);
        }
        model.region = (0..model.nodes()).map(|node| u32::from(node >= model.nodes() / 2)).collect();
        let volume = vec![1.0; model.nodes()];
        let walls = (&model.outline, Walls::shaken(&model.outline, Condition::VerticalRoller, [false; 2]));
        let geometry = Geometry::build(&model, &model.position, &volume, walls, None);
        let diffusion = geometry.flow.unwrap().diffusion.unwrap();
        // Storage so small that a step of one second is steady.
        let stiffness = vec![1e12; model.nodes()];
        let surface = surface_nodes(&model, model.water.unwrap());
        let mut head = vec![0.0; model.nodes()];
        head[..SIDE].fill(1e12);
        BandedLu::factor(&implicit_matrix(&diffusion, &surface, &stiffness, 1.0)).unwrap().solve(&mut head);
        let fall = |from: usize, to: usize| (head[SIDE * from] - head[SIDE * to]) / (to - from) as f64;
        let (below, above) = (fall(2, 7), fall(12, 17));
        println!("gradients {below:.5} and {above:.3}, exact 1 and {CONTRAST}");
        assert!((below - 1.0).abs() < 5e-3 && (above / CONTRAST - 1.0).abs() < 5e-3);
        let exact = CONTRAST * (SIDE as f64 - 10.0) + (10.0 - 2.5);
        // The contact lies where it should to a tenth of a spacing.
        assert!((head[SIDE * 2] - exact).abs() < 0.1 * CONTRAST, "{} {exact}", head[SIDE * 2]);
    }

    /// A soil that is pressed together stiffens its pore water: `K_f / n` follows the porosity of a new geometry.
    #[test]
    fn water_stiffens_as_pores_close() {
        let mut model = square_block(3);
        model.water = Some(Water { unit_weight: 10.0, bulk_modulus: 8.0 });
        let mut phases = Phases::new(&model);
        let mut flow = Flow::new(&model, &phases, FlowScheme::Undrained).unwrap();
        assert_eq!(flow.stiffness[4], 8.0 / 0.5);
        let strained = StressPoint { strain: [0.0, -0.1, 0.0], ..StressPoint::default() };
        phases.follow(&vec![strained; STRESS_NODES * model.nodes()]);
        flow.geometry_changed(&model, &phases);
        let porosity = 1.0 - 0.5 * 0.1_f64.exp();
        assert!((flow.stiffness[4] - 8.0 / porosity).abs() < 1e-12);
    }

    /// Acceleration that spreads draws water apart: `dp/dt = (K_f/n) (k/g) div a`, where k is uniform.
    #[test]
    fn spreading_acceleration_raises_the_pressure() {
        const CONDUCTIVITY: f64 = 0.3;
        let mut model = square_block(9);
        model.surface_elevation = vec![1e3; model.nodes()];
        model.water = Some(Water { unit_weight: 10.0, bulk_modulus: 8.0 });
        model.regions[0].hydraulic_conductivity = Conductivity::isotropic(CONDUCTIVITY);
        let volume = vec![1.0; model.nodes()];
        let walls = (&model.outline, Walls::shaken(&model.outline, Condition::VerticalRoller, [false; 2]));
        let geometry = Geometry::build(&model, &model.position, &volume, walls, None);
        let mut flow = Flow::new(&model, &Phases::new(&model), FlowScheme::ExplicitWithAcceleration).unwrap();
        let acceleration: Vec<Vec2> =
            model.position.iter().map(|x| Vec2::new(0.2 * x.x, 0.5 * x.y)).collect();
        let still = vec![Vec2::zeros(); model.nodes()];
        let points = vec![StressPoint::default(); STRESS_NODES * model.nodes()];
        let dt = 1e-3;
        assert!(flow.step(false, &geometry.flow.unwrap(), &points, &still, &acceleration, dt));
        let expected = dt * (8.0 / 0.5) * CONDUCTIVITY / model.gravity * 0.7;
        assert!((flow.excess[40] - expected).abs() < 1e-12, "{} {expected}", flow.excess[40]);
    }
}
