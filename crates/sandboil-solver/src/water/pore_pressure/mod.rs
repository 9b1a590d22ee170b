//! Pore pressure of the single-layer u-p formulation (Eq. 3, discretised by Eq. 7).
//!
//! The unknown is the excess over the pressure at the start of the stage, in kPa: its reference is carried by
//! the constant nodal forces, and only the increments meet the transposed operators.

mod explicit;
mod implicit;
mod surface;
#[cfg(test)]
mod tests;

use self::{
    implicit::Factors,
    surface::{SurfaceNode, surface_nodes},
};
use crate::{
    error::SolverError,
    parallel::{Rows, chunks, for_each_chunk},
    section::description::{Model, STRESS_NODES},
    skeleton::{
        deformation::{Cofactor, Deformation},
        phases::Phases,
        point::StressPoint,
        section_view::SectionView,
    },
    water::{
        conduction::{Conduction, conduction},
        edge_law::Nodes,
        moving_edges::{MovingBoundary, Relative, WaterEdges, open_surface},
        partly_saturated::Wetting,
        still_water::StillWater,
    },
    weights::geometry::FlowTables,
};
use sandboil_sph::{Csr, Mat2, Vec2};

/// Exchange of water in a section as it stands.
fn conduction_of(section: &SectionView) -> Conduction {
    let SectionView { model, geometry, position, phases, outline, walls, free_surface, .. } = *section;
    let has_profile = free_surface.is_none();
    conduction(model, geometry, position, phases.volume(), (outline, walls), has_profile)
}

/// Whether some soil of a model is permeable.
fn drains(model: &Model) -> bool {
    model.regions.iter().any(|region| region.hydraulic_conductivity.major > 0.0)
}

/// Excess pore pressure and what moves it.
#[derive(Debug, Clone, serde::Serialize, serde::Deserialize)]
pub struct Flow {
    /// Excess pore pressure at velocity nodes, kPa, compression positive.
    excess: Vec<f64>,
    /// Pressure beyond that at rest that acts on the grains, kPa: at a node tied to the surface, that on the surface.
    felt: Vec<f64>,
    /// `J F^-T` at velocity nodes: the mean deformation of their stress nodes.
    cofactor: Vec<Cofactor>,
    /// `K_f / n`: pressure rise per unit of volume strain, kPa.
    stiffness: Vec<f64>,
    /// Hydraulic conductivity over gravity, s: what a unit of acceleration drives.
    mobility: Vec<Mat2>,
    unit_weight: f64,
    /// Nodes that the surface can tie.
    ties: Vec<SurfaceNode>,
    /// Those that are tied: where an edge condition takes its inflow, water does not drain at the surface.
    surface: Vec<SurfaceNode>,
    /// Whether a node's excess pressure acts in the force: not that of a node that has been tied to the surface.
    pushes: Vec<bool>,
    /// `div (k grad H)` at velocity nodes, 1/s per m of head (Eq. 3); none if undrained.
    diffusion: Option<Csr<f64>>,
    inverse_volume: Vec<f64>,
    edges: Option<WaterEdges>,
    wetting: Option<Wetting>,
    still: Option<Still>,
    scheme: Scheme,
    /// The excess at the end of a step while that is computed, kPa; the right-hand side of implicit diffusion.
    next: Vec<f64>,
}

#[derive(Debug, Clone, serde::Serialize, serde::Deserialize)]
enum Scheme {
    /// No conductivity: pressure changes by volume strain alone.
    Undrained,
    /// Forward Euler, with or without the acceleration term.
    Explicit { acceleration_term: bool },
    /// Backward Euler; factors belong to a time step.
    Implicit {
        // Not stored: they are computed again, with the same bits.
        #[serde(skip)]
        factors: Option<Factors>,
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
#[derive(Debug, Clone, Copy, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
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

impl FlowScheme {
    /// Whether pore water flows.
    pub fn is_drained(self) -> bool {
        self != Self::Undrained
    }

    /// Whether the acceleration term of Eq. 7 is part of the flow.
    pub fn has_acceleration_term(self) -> bool {
        self == Self::ExplicitWithAcceleration
    }

    /// Name in reports.
    pub fn name(self) -> &'static str {
        match self {
            Self::Undrained => "undrained",
            Self::Explicit => "explicit",
            Self::ExplicitWithAcceleration => "explicit with acceleration term",
            Self::Implicit => "implicit",
        }
    }
}

/// Motion of the skeleton at the middle of a step, at every node.
#[derive(Debug, Clone, Copy)]
pub struct SkeletonMotion<'a> {
    /// Velocity, m/s.
    pub velocity: &'a [Vec2],
    /// Acceleration, m/s2.
    pub acceleration: &'a [Vec2],
}

/// A step in time.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TimeStep {
    /// Time of the stage at its end, s.
    pub end: f64,
    /// Its length, s.
    pub dt: f64,
}

/// Pores of every node of ground that comes into still water.
#[derive(Debug, Clone)]
pub struct Pores<'a> {
    /// Neutral stress `S_r p`, kPa.
    pub neutral: Vec<f64>,
    /// Excess pressure since rest, kPa.
    pub excess: &'a [f64],
    /// Whether they hold air.
    pub holds_air: Vec<bool>,
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
        let mut wetting = if is_found { None } else { Wetting::new(model, phases, !conditions.is_empty()) };
        wetting.iter_mut().for_each(Wetting::tabulate);
        let drained = scheme != FlowScheme::Undrained;
        let edges = if drained && (wetting.is_some() || !conditions.is_empty()) {
            // Conditions lie on the edges as they were drawn.
            let drawn = (&model.outline, walls);
            let tables = conduction(model, geometry, &model.position, &model.volume, drawn, true);
            let relative = wetting.as_ref().map(Wetting::tabled);
            Some(WaterEdges::new(model, water, &tables, conditions, relative)?)
        } else {
            None
        };
        let drains = |tie: &SurfaceNode| conductivity(tie.node as usize).major > 0.0;
        // Nothing ties a surface that is found but what crosses it.
        let ties = if is_found { Vec::new() } else { surface_nodes(model, water) };
        let ties = ties.into_iter().filter(drains).collect();
        // Only the acceleration term reads them.
        let mobility = if scheme == FlowScheme::ExplicitWithAcceleration {
            (0..model.nodes()).map(|node| conductivity(node).tensor() / model.gravity).collect()
        } else {
            Vec::new()
        };
        let mut flow = Self {
            excess: vec![0.0; model.nodes()],
            felt: vec![0.0; model.nodes()],
            cofactor: vec![Deformation::default().cofactor(); model.nodes()],
            stiffness: (0..model.nodes()).map(|node| stiffness(model, phases, node)).collect(),
            mobility,
            unit_weight: water.unit_weight,
            ties,
            surface: Vec::new(),
            pushes: vec![true; model.nodes()],
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
            next: vec![0.0; model.nodes()],
        };
        flow.update_ties();
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
            edges.look_up(time);
        }
        self.wetting.iter_mut().for_each(Wetting::tabulate);
        self.switch(model, &conduction);
        self.tabulate(model, &conduction, free_surface);
        self.keep(conduction);
    }

    /// Puts ground that flows into still water, from which its excess counts from now on. Its pores have the `neutral`
    /// stress `S_r p` and an excess since rest (kPa), and hold air or not.
    pub fn stand_in(&mut self, water: StillWater, section: SectionView, pores: Pores) {
        let Pores { neutral, excess, holds_air } = pores;
        let at_rest = neutral.iter().zip(excess).map(|(neutral, excess)| neutral - excess).collect();
        self.excess = neutral;
        self.still = Some(Still { water, pressure: vec![0.0; holds_air.len()], holds_air, at_rest });
        self.carry(section.position);
        self.follow(section, 0.0);
    }

    /// Computes the excess over the still water at the present places of the nodes.
    pub fn carry(&mut self, position: &[Vec2]) {
        let Some(Still { water, pressure, holds_air, .. }) = &mut self.still else { return };
        for (node, (excess, rest)) in self.excess.iter_mut().zip(pressure).enumerate() {
            if !holds_air[node] {
                let here = water.pressure(position[node]);
                *excess += *rest - here;
                *rest = here;
            }
        }
        self.update_felt();
    }

    /// Force of the still water on every node, kN/m.
    pub fn buoyancy(&self, position: &[Vec2], volume: &[f64]) -> Option<Vec<Vec2>> {
        let Still { water, .. } = self.still.as_ref()?;
        Some(position.iter().zip(volume).map(|(at, volume)| water.gradient(*at) * -volume).collect())
    }

    /// Keeps the exchange of water where conductivities or cells can change between renewals: in soil that can take up air.
    /// In full soil the pressure of every wave would switch cells; they change with the geometry alone.
    fn keep(&mut self, conduction: Conduction) {
        if let Some(edges) = self.edges.as_mut().filter(|_| self.wetting.is_some()) {
            edges.conduction = Some(conduction);
        }
    }

    /// Makes new tables of diffusion if conductivities or conditions have changed.
    pub fn refresh(&mut self, model: &Model) {
        let Some(conduction) = self.edges.as_mut().and_then(|edges| edges.conduction.take()) else { return };
        let is_stale = self.wetting.as_ref().is_some_and(Wetting::is_stale);
        if is_stale {
            self.wetting.iter_mut().for_each(Wetting::tabulate);
        }
        if self.switch(model, &conduction) || is_stale {
            self.tabulate(model, &conduction, None);
        }
        self.keep(conduction);
    }

    /// Switches conditions between a head and an inflow by the present heads. Returns whether one changed.
    fn switch(&mut self, model: &Model, conduction: &Conduction) -> bool {
        let Some(edges) = &mut self.edges else { return false };
        set_heads(&mut self.next, model, &self.excess, self.unit_weight);
        let relative = self.wetting.as_ref().map(Wetting::tabled);
        let switched = edges.switch(conduction, Nodes { head: &self.next, relative });
        if switched {
            self.update_ties();
        }
        switched
    }

    /// The table of diffusion for the present conditions and conductivities.
    fn tabulate(&mut self, model: &Model, conduction: &Conduction, free_surface: Option<&[Option<Vec2>]>) {
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
                set_heads(&mut self.next, model, &self.excess, self.unit_weight);
                let at_rest = self.wetting.as_ref().map(Wetting::relative_at_rest);
                let relative = self.wetting.as_ref().zip(at_rest.as_ref());
                let relative =
                    relative.map(|(wetting, at_rest)| Relative { tabled: wetting.tabled(), at_rest });
                edges.tabulate(conduction, &self.inverse_volume, &self.next, relative)
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
        self.update_wetting(false);
        self.update_felt();
    }

    /// Total stress that water carries beyond that at rest in a node, kPa.
    pub fn neutral(&self, i: usize) -> f64 {
        self.wetting.as_ref().map_or(self.excess[i], |wetting| wetting.neutral(i, self.excess[i]))
    }

    /// Degree of saturation of a node, if it can change.
    pub fn saturation(&self) -> Option<impl Fn(usize) -> f64> {
        self.wetting.as_ref().map(|wetting| |node| wetting.saturation(node))
    }

    /// How the excess is advanced.
    pub fn scheme(&self) -> FlowScheme {
        match self.scheme {
            Scheme::Undrained => FlowScheme::Undrained,
            Scheme::Explicit { acceleration_term: false } => FlowScheme::Explicit,
            Scheme::Explicit { acceleration_term: true } => FlowScheme::ExplicitWithAcceleration,
            Scheme::Implicit { .. } => FlowScheme::Implicit,
        }
    }

    /// Bytes held.
    pub fn bytes(&self) -> usize {
        let factors = match &self.scheme {
            Scheme::Implicit { factors: Some(factors) } => factors.bytes(),
            _ => 0,
        };
        5 * size_of_val(self.excess.as_slice())
            + self.pushes.len()
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

    /// Advances the excess pressure by one step, from the motion at its middle (Eq. 7) and the deformation of the stress
    /// nodes at its end.
    ///
    /// Returns `false` when the implicit matrix cannot be factored (not finite).
    #[must_use]
    pub fn step(
        &mut self,
        threaded: bool,
        tables: &FlowTables,
        points: &[StressPoint],
        motion: SkeletonMotion,
        time: TimeStep,
    ) -> bool {
        if let Some(edges) = &mut self.edges {
            edges.look_up(time.end);
        }
        self.take_volume_strain(threaded, tables, points, motion.velocity, time.dt);
        match (&self.scheme, &self.diffusion) {
            (Scheme::Explicit { acceleration_term }, Some(_)) => {
                let acceleration = acceleration_term.then_some(motion.acceleration);
                self.diffuse_explicitly(threaded, tables, acceleration, time.dt);
            }
            (Scheme::Implicit { .. }, Some(_)) => {
                if !self.diffuse_implicitly(time.dt) {
                    return false;
                }
            }
            // Without diffusion no water drains at the surface either.
            _ => self.excess.copy_from_slice(&self.next),
        }
        self.update_wetting(threaded);
        self.update_felt();
        true
    }

    /// The excess that volume strain and the inflow through edges leave: `dp = -(K_f / n) (div v - inflow) dt`.
    fn take_volume_strain(
        &mut self,
        threaded: bool,
        tables: &FlowTables,
        points: &[StressPoint],
        velocity: &[Vec2],
        dt: f64,
    ) {
        let divergence = &tables.divergence.forward;
        let (excess, stiffness, wetting) = (&self.excess, &self.stiffness, self.wetting.as_ref());
        // Without diffusion no condition acts.
        let edges = self.edges.as_ref().filter(|_| self.diffusion.is_some());
        // Slices of nothing, which take no memory: the loop writes two arrays.
        let mut unit = vec![(); excess.len()];
        let mut results = vec![(); chunks(excess.len())];
        let rows = Rows { a: &mut self.next, b: &mut self.cofactor, c: &mut unit };
        for_each_chunk(threaded, rows, &mut results, |first, rows, ()| {
            for (k, (next, cofactor)) in rows.a.iter_mut().zip(rows.b).enumerate() {
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
                }
                if let Some(edges) = edges {
                    water_rate -= edges.gained(node);
                    water_rate -= edges.inflow(node);
                }
                // dp = (gamma_f / C) dh-rate with C = n gamma_f / K_f.
                *next = excess[node] - dt * stiffness[node] * water_rate;
            }
        });
    }

    /// Saturations and stiffnesses of partly saturated soil at the present pressures.
    fn update_wetting(&mut self, threaded: bool) {
        if let Some(wetting) = &mut self.wetting {
            wetting.update(threaded, &self.excess, &mut self.stiffness);
        }
    }

    /// Computes the part of the present pressures that acts on the grains.
    fn update_felt(&mut self) {
        for node in 0..self.felt.len() {
            let outside = self.outside(node);
            self.felt[node] =
                if self.pushes[node] { outside + (self.neutral(node) - outside) } else { outside };
        }
    }
}

/// `div (k grad)` of the excess at a node, kPa/s per unit of `K_f / n` over the unit weight of water.
#[inline]
fn diffusion_rate(diffusion: &Csr<f64>, excess: &[f64], node: usize) -> f64 {
    diffusion.iter_row(node).map(|(j, weight)| weight * excess[j]).sum()
}

/// Total heads of the nodes at excess pressures (kPa) over those at rest, m.
fn set_heads(head: &mut [f64], model: &Model, excess: &[f64], unit_weight: f64) {
    for (node, head) in head.iter_mut().enumerate() {
        *head = model.position[node].y + (model.pore_pressure[node] + excess[node]) / unit_weight;
    }
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

/// Pressure rise of a node per unit of volume strain, kPa. Zero above the water table, where pores hold air.
fn stiffness(model: &Model, phases: &Phases, node: usize) -> f64 {
    if model.saturation(node) < 1.0 { 0.0 } else { model.water_stiffness(phases.porosity(node)) }
}
