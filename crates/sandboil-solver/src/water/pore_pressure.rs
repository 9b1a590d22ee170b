//! Pore pressure of the single-layer u-p formulation (Eq. 3, discretised by Eq. 7).
//!
//! The unknown is the excess over the pressure at the start of the stage, in kPa: its reference is carried by
//! the constant nodal forces, and only the increments meet the transposed operators.

use crate::{
    error::SolverError,
    linear::banded::BandedLu,
    parallel::{Rows, chunks, for_each_chunk},
    section::{
        description::{Model, STRESS_NODES, Water},
        node_id::id,
    },
    skeleton::{
        deformation::{Cofactor, Deformation},
        phases::Phases,
        point::StressPoint,
        section_view::SectionView,
    },
    water::{
        conduction::{Conduction, conduction},
        moving_edges::{MovingBoundary, WaterEdges, open_surface},
        partly_saturated::Wetting,
        still_water::StillWater,
    },
    weights::geometry::FlowTables,
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

/// Exchange of water in a section as it stands.
fn conduction_of(section: &SectionView) -> Conduction {
    let SectionView { model, geometry, position, phases, outline, walls, free_surface, .. } = *section;
    let has_profile = free_surface.is_none();
    conduction(model, geometry, position, phases.volume(), (outline, walls), has_profile)
}

/// Whether some soil of a model lets water pass.
fn drains(model: &Model) -> bool {
    model.regions.iter().any(|region| region.hydraulic_conductivity.major > 0.0)
}

/// Excess pore pressure and what moves it.
#[derive(Debug, Clone, serde::Serialize, serde::Deserialize)]
pub struct Flow {
    /// Excess pore pressure at velocity nodes, kPa, compression positive.
    excess: Vec<f64>,
    /// Pressure beyond that at rest that the grains feel, kPa: at a node tied to the surface what stands on that.
    felt: Vec<f64>,
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
    /// `div (k grad H)` at velocity nodes, 1/s per m of head (Eq. 3); none if undrained.
    diffusion: Option<Csr<f64>>,
    inverse_volume: Vec<f64>,
    edges: Option<WaterEdges>,
    wetting: Option<Wetting>,
    still: Option<Still>,
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

/// Still water that the ground flows through: excess counts from it.
#[derive(Debug, Clone, serde::Serialize, serde::Deserialize)]
struct Still {
    water: StillWater,
    /// Its pressure where the nodes are, kPa.
    pressure: Vec<f64>,
    /// Nodes whose pores hold air: their suction goes with them, and no water passes.
    holds_air: Vec<bool>,
    /// What the pressure in a node exceeds that of the still water by when its excess since rest is zero, kPa.
    at_rest: Vec<f64>,
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
    /// Zero excess pressure everywhere; none in a dry section.
    ///
    /// # Errors
    /// Conditions that no node is near.
    pub fn new(
        section: SectionView,
        scheme: FlowScheme,
        conditions: &[MovingBoundary],
    ) -> Result<Option<Self>, SolverError> {
        let SectionView { model, phases, geometry, walls, free_surface, .. } = section;
        let Some(water) = model.water else { return Ok(None) };
        let conductivity = |node: usize| model.regions[model.region[node] as usize].hydraulic_conductivity;
        let is_found = free_surface.is_some();
        // Ground that flows keeps the water it has above the water table.
        let wetting = if is_found { None } else { Wetting::new(model, phases, !conditions.is_empty()) };
        let drained = scheme != FlowScheme::Undrained;
        let edges = if drained && (wetting.is_some() || !conditions.is_empty()) {
            // Conditions lie on the edges as they were drawn.
            let drawn = (&model.outline, walls);
            let tables = conduction(model, geometry, &model.position, &model.volume, drawn, true);
            Some(WaterEdges::new(model, water, &tables, conditions)?)
        } else {
            None
        };
        let drains = |tie: &SurfaceNode| conductivity(tie.node as usize).major > 0.0;
        let is_sealed = |tie: &SurfaceNode| edges.as_ref().is_some_and(|edges| edges.seals(tie.node));
        // Nothing ties the surface of ground that flows but what crosses it.
        let ties = if is_found { Vec::new() } else { surface_nodes(model, water) };
        let surface: Vec<SurfaceNode> =
            ties.into_iter().filter(|tie| drains(tie) && !is_sealed(tie)).collect();
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
        let mut flow = Self {
            excess: vec![0.0; model.nodes()],
            felt: vec![0.0; model.nodes()],
            cofactor: vec![Deformation::default().cofactor(); model.nodes()],
            stiffness: (0..model.nodes()).map(|node| stiffness(model, phases, node)).collect(),
            mobility,
            unit_weight: water.unit_weight,
            surface,
            push,
            diffusion: None,
            inverse_volume: Vec::new(),
            edges,
            wetting,
            still: None,
            scheme: match scheme {
                FlowScheme::Undrained => Scheme::Undrained,
                FlowScheme::Explicit => Scheme::Explicit { acceleration_term: false },
                FlowScheme::ExplicitWithAcceleration => Scheme::Explicit { acceleration_term: true },
                FlowScheme::Implicit => Scheme::Implicit { factors: None },
            },
            right_hand_side: vec![0.0; model.nodes()],
        };
        flow.follow(section, 0.0);
        Ok(Some(flow))
    }

    /// Takes over the porosities and forgets factors made for another geometry. `time` of the stage, s.
    pub fn follow(&mut self, section: SectionView, time: f64) {
        let SectionView { model, phases, position, free_surface, .. } = section;
        for (node, stiffness) in self.stiffness.iter_mut().enumerate() {
            let holds_air = self.still.as_ref().is_some_and(|still| still.holds_air[node]);
            *stiffness = if holds_air { 0.0 } else { self::stiffness(model, phases, node) };
        }
        self.cofactor.fill(Deformation::default().cofactor());
        self.inverse_volume = phases.volume().iter().map(|volume| volume.recip()).collect();
        if let Some(wetting) = &mut self.wetting {
            wetting.follow(phases);
            wetting.update(false, &self.excess, &mut self.stiffness);
        }
        if matches!(self.scheme, Scheme::Undrained) || !drains(model) {
            return;
        }
        let conduction = conduction_of(&section);
        if let Some(edges) = &mut self.edges {
            let displacement = |node: u32| position[node as usize] - model.position[node as usize];
            edges.follow(&conduction, displacement);
        }
        self.switch(model, time);
        self.tabulate(model, &conduction, free_surface, time);
        if let Some(wetting) = &mut self.wetting {
            wetting.conduction = Some(conduction);
        }
    }

    /// Puts ground that flows into still water, from which its excess counts from now on. Its pores have the `neutral`
    /// stress `S_r p` and an excess since rest (kPa), and hold air or not.
    pub fn stand_in(
        &mut self,
        water: StillWater,
        section: SectionView,
        (neutral, excess): (Vec<f64>, &[f64]),
        holds_air: Vec<bool>,
    ) {
        let at_rest = neutral.iter().zip(excess).map(|(neutral, excess)| neutral - excess).collect();
        self.excess = neutral;
        self.still = Some(Still { water, pressure: vec![0.0; holds_air.len()], holds_air, at_rest });
        self.carry(section.position);
        self.follow(section, 0.0);
    }

    /// Counts the excess from the still water where the nodes have come to.
    pub fn carry(&mut self, position: &[Vec2]) {
        let Some(Still { water, pressure, holds_air, .. }) = &mut self.still else { return };
        for (node, (excess, rest)) in self.excess.iter_mut().zip(pressure).enumerate() {
            if !holds_air[node] {
                let here = water.pressure(position[node]);
                *excess += *rest - here;
                *rest = here;
            }
        }
        self.feel();
    }

    /// Force of the still water on every node, kN/m.
    pub fn buoyancy(&self, position: &[Vec2], volume: &[f64]) -> Option<Vec<Vec2>> {
        let Still { water, .. } = self.still.as_ref()?;
        Some(position.iter().zip(volume).map(|(at, volume)| water.gradient(*at) * -volume).collect())
    }

    /// Makes the tables of diffusion anew where conductivities or conditions have left them. Full soil keeps both.
    pub fn refresh(&mut self, model: &Model, time: f64) {
        let Some(wetting) = &mut self.wetting else { return };
        let Some(conduction) = wetting.conduction.take() else { return };
        let is_stale = wetting.is_stale();
        if self.switch(model, time) || is_stale {
            self.tabulate(model, &conduction, None, time);
        }
        if let Some(wetting) = &mut self.wetting {
            wetting.conduction = Some(conduction);
        }
    }

    /// Lets conditions hold and go by the present heads. Returns whether one did.
    fn switch(&mut self, model: &Model, time: f64) -> bool {
        let Some(edges) = &mut self.edges else { return false };
        edges.switch(time, &|node| head(model, &self.excess, self.unit_weight, node))
    }

    /// The table of diffusion for the present conditions and conductivities.
    fn tabulate(
        &mut self,
        model: &Model,
        conduction: &Conduction,
        free_surface: Option<&[Option<Vec2>]>,
        time: f64,
    ) {
        if let Scheme::Implicit { factors } = &mut self.scheme {
            *factors = None;
        }
        let mut table = match (&mut self.edges, free_surface) {
            (None, Some(normals)) => {
                let holds_air = self.still.as_ref().map_or(&[][..], |still| &still.holds_air);
                conduction.leaking(&leaks(model, normals), |node| holds_air.get(node) == Some(&true))
            }
            (None, None) => conduction.exchange(None, open_surface(conduction)),
            (Some(edges), _) => {
                let head = |node: usize| head(model, &self.excess, self.unit_weight, node);
                edges.look_up(time);
                let moisture = self.wetting.as_mut().map(Wetting::tabled);
                let relative = moisture.as_ref().map(|all| all.each_ref().map(Vec::as_slice));
                let (table, gained) = edges.tables(model, conduction, &self.inverse_volume, relative, &head);
                if let (Some(wetting), Some(gained)) = (&mut self.wetting, gained) {
                    wetting.inflow = gained.iter().zip(&self.inverse_volume).map(|(q, v)| q * v).collect();
                }
                table
            }
        };
        table.scale_by_row(&self.inverse_volume);
        self.diffusion = Some(table);
    }

    /// Excess pore pressure since rest of a node, kPa, compression positive.
    #[inline]
    pub fn excess(&self, node: usize) -> f64 {
        let own = self.excess[node];
        self.still.as_ref().map_or(own, |still| own + still.pressure[node] - still.at_rest[node])
    }

    /// Excess pore pressures from which the flow counts, kPa.
    pub fn own_excess(&self) -> &[f64] {
        &self.excess
    }

    /// Changes the excess pressures, kPa.
    pub fn set_excess(&mut self, change: impl FnOnce(&mut [f64])) {
        change(&mut self.excess);
        if let Some(wetting) = &mut self.wetting {
            wetting.update(false, &self.excess, &mut self.stiffness);
        }
        self.feel();
    }

    /// Total stress that water carries beyond that at rest in a node, kPa.
    pub fn neutral(&self, i: usize) -> f64 {
        self.wetting.as_ref().map_or(self.excess[i], |wetting| wetting.neutral(i, self.excess[i]))
    }

    /// Degree of saturation of a node, if it can change.
    pub fn saturation(&self) -> Option<impl Fn(usize) -> f64> {
        self.wetting.as_ref().map(|wetting| |node| wetting.saturation(node))
    }

    /// Whether pore water flows between nodes.
    pub fn is_drained(&self) -> bool {
        self.diffusion.is_some()
    }

    /// Whether the acceleration term of Eq. 7 is part of the flow.
    pub fn has_acceleration_term(&self) -> bool {
        matches!(self.scheme, Scheme::Explicit { acceleration_term: true })
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
        6 * size_of_val(self.excess.as_slice())
            + size_of_val(self.mobility.as_slice())
            + size_of_val(self.cofactor.as_slice())
            + self.diffusion.as_ref().map_or(0, Csr::bytes)
            + self.edges.as_ref().map_or(0, WaterEdges::bytes)
            + self.wetting.as_ref().map_or(0, Wetting::bytes)
            + self.still.as_ref().map_or(0, |still| {
                still.water.bytes() + 2 * size_of_val(still.pressure.as_slice()) + still.holds_air.len()
            })
            + factors
    }

    /// Nominal pressure beyond that at rest, `q J F^-T`, of node `i`, kPa.
    pub fn nominal(&self, i: usize) -> [f64; 4] {
        self.cofactor[i].scaled(self.felt[i])
    }

    /// Force on node `j` of the pressure that nodes tied to the surface have but do not push with, kN/m.
    pub fn held_back(&self, tables: &FlowTables, j: usize) -> Vec2 {
        let row = tables.divergence.transposed.iter_row(j);
        row.map(|(i, weight)| self.cofactor[i].carry(*weight) * (self.neutral(i) - self.felt[i])).sum()
    }

    /// Force of the water on node `j` beyond that at rest, kN/m: the exact transpose of the divergence, what stands on the
    /// ground surface against it, and the weight of water gained.
    #[inline]
    pub fn force(&self, tables: &FlowTables, j: usize) -> Vec2 {
        let row = tables.divergence.transposed.iter_row(j);
        let Some(edges) = &self.edges else {
            return row.map(|(i, weight)| self.cofactor[i].carry(*weight) * self.felt[i]).sum();
        };
        // What stands on the surface presses from outside: uniform pressure, inside and out, moves nothing.
        let outside = edges.at_surface(j);
        let force: Vec2 =
            row.map(|(i, weight)| self.cofactor[i].carry(*weight) * (self.felt[i] - outside)).sum();
        let weight = self.wetting.as_ref().map_or(0.0, |wetting| wetting.gained_weight(j));
        force - Vec2::new(0.0, weight)
    }

    /// Advances the excess pressure by one step from the velocity field at its middle (Eq. 7) and the deformation of
    /// the stress nodes at its end, the moment `end` of the stage, s.
    ///
    /// Returns `false` when the implicit matrix cannot be factored (not finite).
    #[must_use]
    pub fn step(
        &mut self,
        threaded: bool,
        tables: &FlowTables,
        points: &[StressPoint],
        (velocity, acceleration): (&[Vec2], &[Vec2]),
        (end, dt): (f64, f64),
    ) -> bool {
        let divergence = &tables.divergence.forward;
        if let Some(edges) = &mut self.edges {
            edges.look_up(end);
        }
        // Slices of nothing, which take no memory: the loops below write one array or two.
        let mut unit = vec![(); self.excess.len()];
        let mut results = vec![(); chunks(self.excess.len())];
        let (excess, stiffness) = (&self.excess, &self.stiffness);
        let (edges, wetting) = (self.edges.as_ref(), self.wetting.as_ref());
        // Nothing flows between nodes: no condition is felt either.
        let flows = self.diffusion.is_some();
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
                let mut water_rate = cofactor.contract(x, y) / deformation.volume_ratio();
                if let Some(wetting) = wetting {
                    water_rate *= wetting.saturation(node);
                    water_rate -= wetting.inflow[node];
                }
                if let Some(edges) = edges.filter(|_| flows) {
                    water_rate -= edges.inflow(node);
                }
                // dp = (gamma_f / C) dh-rate with C = n gamma_f / K_f.
                *right_hand_side = excess[node] - dt * stiffness[node] * water_rate;
            }
        });
        let scale = dt / self.unit_weight;
        match (&mut self.scheme, &self.diffusion) {
            (Scheme::Explicit { acceleration_term }, Some(diffusion)) => {
                let mobility = acceleration_term.then_some((&self.mobility, self.unit_weight));
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
                            // What air has left no way for does not move by inertia either.
                            let relative = wetting.map_or(1.0, |wetting| wetting.relative(node));
                            rate += carried * unit_weight * relative;
                        }
                        *right_hand_side += scale * stiffness[node] * rate;
                    }
                });
                if let Some(edges) = edges {
                    // A drain takes more in a step than a forward step bears: what it leaves follows at once.
                    for (node, asked, open) in edges.drains() {
                        let taken = dt * stiffness[node] * open;
                        let left = &mut self.right_hand_side[node];
                        *left = (*left + taken * asked) / (1.0 + taken);
                    }
                }
                self.excess.copy_from_slice(&self.right_hand_side);
                self.hold_surface();
            }
            (Scheme::Implicit { factors }, Some(diffusion)) => {
                let drains = || edges.into_iter().flat_map(WaterEdges::drains);
                let is_outgrown = wetting.is_some_and(|wetting| wetting.is_outgrown(stiffness));
                if is_outgrown || factors.as_ref().is_none_or(|(made_for, _)| *made_for != dt) {
                    if let Some(wetting) = &mut self.wetting {
                        wetting.factored.clone_from(stiffness);
                    }
                    let drains: Vec<_> = drains().collect();
                    let matrix = implicit_matrix(diffusion, &self.surface, stiffness, &drains, (dt, scale));
                    *factors = BandedLu::factor(&matrix).map(|lu| (dt, lu));
                }
                let Some((_, lu)) = factors else { return false };
                let right_hand_side = &mut self.right_hand_side;
                for (node, asked, open) in drains() {
                    right_hand_side[node] += dt * stiffness[node] * open * asked;
                }
                let outside = |node: u32| edges.map_or(0.0, |edges| edges.at_surface(node as usize));
                if self.wetting.is_some() {
                    // The matrix may be older than the storage: it takes what is left to the rates at the start.
                    for (node, left) in right_hand_side.iter_mut().enumerate() {
                        let rate: f64 = diffusion.iter_row(node).map(|(j, weight)| weight * excess[j]).sum();
                        *left += scale * stiffness[node] * rate - excess[node];
                    }
                    for (node, _, open) in drains() {
                        right_hand_side[node] -= dt * stiffness[node] * open * excess[node];
                    }
                    for tie in &self.surface {
                        let (own, inner) = (excess[tie.node as usize], excess[tie.inner as usize]);
                        let outside = outside(tie.node);
                        right_hand_side[tie.node as usize] = outside + tie.fraction * (inner - outside) - own;
                    }
                    lu.solve(right_hand_side);
                    for (excess, change) in self.excess.iter_mut().zip(right_hand_side) {
                        *excess += *change;
                    }
                } else {
                    for tie in &self.surface {
                        right_hand_side[tie.node as usize] = (1.0 - tie.fraction) * outside(tie.node);
                    }
                    lu.solve(right_hand_side);
                    self.excess.copy_from_slice(right_hand_side);
                }
            }
            // Nothing flows, so nothing drains at the surface either.
            _ => self.excess.copy_from_slice(&self.right_hand_side),
        }
        if let Some(wetting) = &mut self.wetting {
            wetting.update(threaded, &self.excess, &mut self.stiffness);
        }
        self.feel();
        true
    }

    /// Half-cell rule: the excess prescribed on the surface belongs there, not to the centre of the node below it.
    fn hold_surface(&mut self) {
        for tie in &self.surface {
            let outside = self.edges.as_ref().map_or(0.0, |edges| edges.at_surface(tie.node as usize));
            let inner = self.excess[tie.inner as usize];
            self.excess[tie.node as usize] = outside + tie.fraction * (inner - outside);
        }
    }

    /// What the grains feel of the present pressures.
    fn feel(&mut self) {
        for node in 0..self.felt.len() {
            let outside = self.edges.as_ref().map_or(0.0, |edges| edges.at_surface(node));
            self.felt[node] = outside + self.push[node] * (self.neutral(node) - outside);
        }
    }
}

/// Total head of a node at an excess pressure (kPa) over that at rest, m.
fn head(model: &Model, excess: &[f64], unit_weight: f64, node: usize) -> f64 {
    model.position[node].y + (model.pore_pressure[node] + excess[node]) / unit_weight
}

/// What leaves the nodes at a free surface per metre of head in them, m/s: half a spacing from the water outside, each
/// through a spacing of the surface.
fn leaks(model: &Model, free_surface: &[Option<Vec2>]) -> Vec<f64> {
    let open = |(region, normal): (&u32, &Option<Vec2>)| {
        let conductivity = model.regions[*region as usize].hydraulic_conductivity;
        normal.map_or(0.0, |normal| 2.0 * normal.dot(&(conductivity.tensor() * normal)))
    };
    model.region.iter().zip(free_surface).map(open).collect()
}

/// Pressure rise of a node per unit of volume strain, kPa. Above the water table air gives way.
fn stiffness(model: &Model, phases: &Phases, node: usize) -> f64 {
    if model.saturation(node) < 1.0 { 0.0 } else { model.water_stiffness(phases.porosity(node)) }
}

/// `I - dt/C div(k grad)` with the surface nodes' rows replaced by their tie, and what `drains` take; `scale` is the time step
/// over the unit weight of water.
fn implicit_matrix(
    diffusion: &Csr<f64>,
    surface: &[SurfaceNode],
    stiffness: &[f64],
    drains: &[(usize, f64, f64)],
    (dt, scale): (f64, f64),
) -> Csr<f64> {
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
            let taken = drains.iter().filter(|(node, _, _)| *node == row);
            entries.extend(taken.map(|(_, _, open)| (own, dt * stiffness * open)));
        }
        matrix.push_row(&mut entries);
    }
    matrix
}

/// Nodes within one spacing of the drained surface, each with the node below that it interpolates to. That surface is the
/// ground; or the water table where it lies deeper and soil above it holds no water that could move: no excess pressure
/// there.
fn surface_nodes(model: &Model, water: Water) -> Vec<SurfaceNode> {
    let is_partly_saturated = !model.saturation.is_empty();
    let has_curve = |node: usize| model.regions[model.region[node] as usize].retention.is_some();
    let depth = |node: usize| {
        let below_ground = model.surface_elevation[node] - model.position[node].y;
        if !is_partly_saturated || has_curve(node) {
            return below_ground;
        }
        if model.saturation(node) < 1.0 {
            0.0
        } else {
            below_ground.min(model.pore_pressure[node] / water.unit_weight)
        }
    };
    // Suction ends at no surface, and goes its own way.
    let is_held = |node: usize| !has_curve(node) || model.pore_pressure[node] >= 0.0;
    let near: Vec<usize> =
        (0..model.nodes()).filter(|&node| is_held(node) && depth(node) < model.spacing.y).collect();
    let below = |node: usize| Vec2::new(model.position[node].x, model.position[node].y - model.spacing.y);
    near.iter()
        .filter_map(|&node| {
            if is_partly_saturated && !has_curve(node) && depth(node) <= 0.0 {
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
        section::{
            description::Conductivity,
            edge_nodes::EdgeNodes,
            outline::{Condition, EdgesView, Outline, Walls},
        },
        testing::square_block,
        weights::geometry::Geometry,
    };
    use sandboil_soil::VanGenuchten;
    use sandboil_sph::Period;

    /// A section where it was drawn.
    fn drawn<'a>(
        model: &'a Model,
        phases: &'a Phases,
        geometry: &'a Geometry,
        walls: Walls,
    ) -> SectionView<'a> {
        const NO_EDGES: &EdgeNodes = &EdgeNodes { base: Vec::new(), sides: [Vec::new(), Vec::new()] };
        SectionView {
            model,
            outline: &model.outline,
            walls,
            edges: NO_EDGES,
            position: &model.position,
            phases,
            mass: &[],
            geometry,
            free_surface: None,
        }
    }

    fn flow_of(model: &Model, scheme: FlowScheme) -> (Flow, Geometry) {
        let phases = Phases::new(model);
        let walls = Walls::shaken(&model.outline, Condition::VerticalRoller, [false; 2]);
        let edges = EdgesView { outline: &model.outline, walls };
        let geometry = Geometry::build(model, &model.position, &model.volume, edges, None);
        let section = drawn(model, &phases, &geometry, walls);
        let flow = Flow::new(section, scheme, &[]).unwrap().unwrap();
        (flow, geometry)
    }

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
        let diffusion = flow_of(&model, FlowScheme::Explicit).0.diffusion.unwrap();
        // Storage so small that a step of one second is steady.
        let stiffness = vec![1e12; model.nodes()];
        let surface = surface_nodes(&model, model.water.unwrap());
        let mut head = vec![0.0; model.nodes()];
        head[..SIDE].fill(1e12);
        BandedLu::factor(&implicit_matrix(&diffusion, &surface, &stiffness, &[], (1.0, 1.0)))
            .unwrap()
            .solve(&mut head);
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
        let (mut flow, geometry) = flow_of(&model, FlowScheme::Undrained);
        assert_eq!(flow.stiffness[4], 8.0 / 0.5);
        let strained = StressPoint { strain: [0.0, -0.1, 0.0], ..StressPoint::default() };
        phases.update_volumes(&vec![strained; STRESS_NODES * model.nodes()]);
        let walls = Walls::shaken(&model.outline, Condition::VerticalRoller, [false; 2]);
        flow.follow(drawn(&model, &phases, &geometry, walls), 0.0);
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
        let (mut flow, geometry) = flow_of(&model, FlowScheme::ExplicitWithAcceleration);
        let acceleration: Vec<Vec2> =
            model.position.iter().map(|x| Vec2::new(0.2 * x.x, 0.5 * x.y)).collect();
        let still = vec![Vec2::zeros(); model.nodes()];
        let points = vec![StressPoint::default(); STRESS_NODES * model.nodes()];
        let dt = 1e-3;
        assert!(flow.step(false, &geometry.flow.unwrap(), &points, (&still, &acceleration), (dt, dt)));
        let expected = dt * (8.0 / 0.5) * CONDUCTIVITY / model.gravity * 0.7;
        assert!((flow.excess[40] - expected).abs() < 1e-12, "{} {expected}", flow.excess[40]);
    }

    /// In soil that holds air, volume strain presses water out by the share of it that is water, `S_r` in Eq. 3, and
    /// inertia drives it by what air leaves open, `k_r`.
    #[test]
    fn air_takes_its_part_of_strain_and_of_inertia() {
        const CONDUCTIVITY: f64 = 0.3;
        const TABLE: f64 = 3.5;
        let curve = VanGenuchten::new(2.0, 2.0, 0.0, 1.0).unwrap();
        let mut model = square_block(9);
        model.surface_elevation = vec![1e3; model.nodes()];
        model.water = Some(Water { unit_weight: 10.0, bulk_modulus: 8.0 });
        model.regions[0].hydraulic_conductivity = Conductivity::isotropic(CONDUCTIVITY);
        model.regions[0].retention = Some(curve);
        // Hydrostatic: no head drives anything.
        model.pore_pressure = model.position.iter().map(|at| 10.0 * (TABLE - at.y)).collect();
        model.saturation = model.position.iter().map(|at| curve.at(TABLE - at.y).saturation).collect();
        let moisture = curve.at(TABLE - model.position[40].y);
        assert!(moisture.saturation < 0.8 && moisture.relative_conductivity < 0.3);
        let spread = |x: f64, y: f64| -> Vec<Vec2> {
            model.position.iter().map(|at| Vec2::new(x * at.x, y * at.y)).collect()
        };
        let still = vec![Vec2::zeros(); model.nodes()];
        let points = vec![StressPoint::default(); STRESS_NODES * model.nodes()];
        let dt = 1e-6;
        let stiffness = 1.0 / (0.5 * (moisture.saturation / 8.0 + moisture.capacity / 10.0));
        for (velocity, acceleration, rate) in [
            (spread(0.1, 0.2), still.clone(), -moisture.saturation * 0.3),
            (still, spread(0.2, 0.5), moisture.relative_conductivity * CONDUCTIVITY / model.gravity * 0.7),
        ] {
            let (mut flow, geometry) = flow_of(&model, FlowScheme::ExplicitWithAcceleration);
            let motion = (velocity.as_slice(), acceleration.as_slice());
            assert!(flow.step(false, &geometry.flow.unwrap(), &points, motion, (dt, dt)));
            let found = flow.excess[40] / dt;
            assert!((found - stiffness * rate).abs() < 1e-6 * stiffness * rate.abs(), "{found} {rate}");
        }
    }
}
