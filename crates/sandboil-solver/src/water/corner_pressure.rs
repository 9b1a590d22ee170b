//! Pore pressure at the corners of cells (dual lattice): Eq. 3 with the volume strain of the soil itself.
//!
//! Soil, porosity and water have one measure of volume: the strain by which the soil at a corner changes its volume presses
//! its water. An open surface is a zero excess at the corners that lie on it, and a head on an edge that of its corners.

use crate::{
    error::SolverError,
    linear::banded::BandedLu,
    parallel::{Rows, chunks, for_each_chunk},
    section::{
        description::{Model, Water},
        dual_lattice::{CORNERS, DualLattice},
        node_id::id,
        stress_layout::StressLayout,
    },
    skeleton::{phases::Phases, point::StressPoint, section_view::SectionView, soils::StressWork},
    water::{
        cell_conduction::{cell_conduction, driven_by_acceleration},
        corner_edges::{self, CornerEdges},
        corner_wetting::CornerWetting,
        moving_edges::MovingBoundary,
        pore_pressure::{FlowScheme, TimeStep},
        still_water::StillWater,
    },
    weights::{geometry::Geometry, points::point_weights},
};
use sandboil_sph::{Csr, Vec2};

/// Excess pore pressure at the places of corners.
#[derive(Debug, Clone, serde::Serialize, serde::Deserialize)]
pub struct CornerFlow {
    water: Water,
    /// Excess pore pressure at each place, kPa, compression positive.
    excess: Vec<f64>,
    /// Pressure rise of each place per volume of water pressed into it, kPa/m2; zero where pores hold air that stays.
    response: Vec<f64>,
    /// Volume of soil at each place times its degree of saturation, m2: what a volume strain presses.
    filled: Vec<f64>,
    /// Volume of soil at each place, m2.
    volume: Vec<f64>,
    /// Volume strain of the soil at each place at the end of the last step.
    strain: Vec<f64>,
    /// By how much the soil at each place has been compressed in the step, m2.
    pressed: Vec<f64>,
    /// Whether a place without a condition keeps its pressure: at an open surface, and beside soil that holds air, where
    /// the soil is permeable.
    is_open: Vec<bool>,
    /// Whether the excess of a place is prescribed.
    is_held: Vec<bool>,
    /// Whether every cell that touches a place holds air that stays.
    is_dry: Vec<bool>,
    /// Whether the pores of each cell hold air that stays, so that no water passes; empty if none does.
    closed: Vec<bool>,
    /// Inflow of each place per metre of head, m/s; none if undrained.
    exchange: Option<Csr<f64>>,
    /// Inflow of each place per acceleration of the nodes, m s; none without the acceleration term.
    driven: Option<Csr<Vec2>>,
    /// Places of each node.
    of_node: Vec<[u32; CORNERS]>,
    scheme: FlowScheme,
    conditions: Option<Box<Conditions>>,
    wetting: Option<Box<CornerWetting>>,
    still: Option<Still>,
    /// The excess at the end of a step while it is computed, kPa.
    next: Vec<f64>,
    /// Factors of the implicit matrix, and their time step (s). Not stored: they are computed again, with the same bits.
    #[serde(skip)]
    factors: Option<(f64, BandedLu)>,
}

/// Conditions on edges, and what they prescribe at the places.
#[derive(Debug, Clone, serde::Serialize, serde::Deserialize)]
struct Conditions {
    edges: CornerEdges,
    /// Excess of each place that is held, kPa.
    value: Vec<f64>,
    /// Inflow of each place beyond that at rest: through edges, and by the heads at rest in soil whose conductivity has
    /// changed, m2/s.
    inflow: Vec<f64>,
    /// What the heads at rest brought to each place at rest, m2/s; empty where conductivities do not change.
    brought_at_rest: Vec<f64>,
    /// The same at present, less that at rest.
    gained: Vec<f64>,
}

/// Still water around ground that flows: the excess counts from it.
#[derive(Debug, Clone, serde::Serialize, serde::Deserialize)]
struct Still {
    water: StillWater,
    /// Its pressure at the places, kPa.
    pressure: Vec<f64>,
    /// By how much the pressure of a place exceeds that of still water where its excess since rest is zero, kPa.
    at_rest: Vec<f64>,
}

/// The ground on which water acts.
#[derive(Clone, Copy)]
pub struct Pressed<'a> {
    /// Weights.
    pub geometry: &'a Geometry,
    /// Corners of cells.
    pub dual: &'a DualLattice,
    /// Stress points.
    pub points: &'a [StressPoint],
    /// Volumes and porosities.
    pub phases: &'a Phases,
}

/// What an exchange (m/s) brings to a place at heads or pressures.
#[inline]
fn brought(exchange: &Csr<f64>, value: &[f64], place: usize) -> f64 {
    exchange.iter_row(place).map(|(j, weight)| weight * value[j]).sum()
}

impl CornerFlow {
    /// Zero excess pressure everywhere, with the saturation of each node; none in a dry section, or without corners.
    ///
    /// # Errors
    /// Conditions that no corner is near.
    pub fn new(
        section: SectionView,
        scheme: FlowScheme,
        conditions: &[MovingBoundary],
        saturation: impl Fn(usize) -> f64,
    ) -> Result<Option<Self>, SolverError> {
        let (model, StressLayout::Dual(dual)) = (section.model, section.layout) else { return Ok(None) };
        let Some(water) = model.water else { return Ok(None) };
        let of_node: Vec<[u32; CORNERS]> =
            dual.of_node.iter().map(|points| points.map(|point| dual.place[point as usize])).collect();
        // Ground that flows keeps the water that it has above the water table.
        let is_flowing = section.free_surface.is_some();
        let mut is_permeable = vec![false; dual.places()];
        let (mut ends_below_air, mut is_dry) = (is_permeable.clone(), vec![true; dual.places()]);
        let mut closed = vec![false; of_node.len()];
        for (node, places) in of_node.iter().enumerate() {
            let region = &model.regions[model.region[node] as usize];
            let holds_air = saturation(node) < 1.0;
            let has_curve = region.retention.is_some();
            closed[node] = holds_air && (is_flowing || !has_curve);
            for &place in places {
                is_permeable[place as usize] |= region.hydraulic_conductivity.major > 0.0;
                // Suction does not end at a surface.
                ends_below_air[place as usize] |= holds_air && !has_curve;
                is_dry[place as usize] &= closed[node];
            }
        }
        let is_open: Vec<bool> = (0..dual.places())
            .map(|place| {
                is_permeable[place] && !is_dry[place] && (ends_below_air[place] || dual.is_free[place])
            })
            .collect();
        if !closed.contains(&true) {
            closed.clear();
        }
        let zeros = vec![0.0; dual.places()];
        let mut flow = Self {
            water,
            excess: zeros.clone(),
            response: zeros.clone(),
            filled: zeros.clone(),
            volume: zeros.clone(),
            strain: zeros.clone(),
            pressed: zeros.clone(),
            is_held: is_open.clone(),
            is_open,
            is_dry,
            closed,
            exchange: None,
            driven: None,
            of_node,
            scheme,
            conditions: None,
            wetting: None,
            still: None,
            next: zeros,
            factors: None,
        };
        if !is_flowing {
            flow.begin_conditions(&section, conditions)?;
        }
        flow.follow(section, 0.0);
        Ok(Some(flow))
    }

    /// Starts conditions and the water of partly saturated soil from the state at rest.
    fn begin_conditions(
        &mut self,
        section: &SectionView,
        conditions: &[MovingBoundary],
    ) -> Result<(), SolverError> {
        let model = section.model;
        let has_curve = model.regions.iter().any(|region| region.retention.is_some());
        if !has_curve && (self.scheme == FlowScheme::Undrained || conditions.is_empty()) {
            return Ok(());
        }
        // Conditions lie on the edges as they were drawn.
        let drawn = StressLayout::new(model);
        let Some(dual) = drawn.dual() else { return Ok(()) };
        let pressure = {
            let weights = point_weights(model, &model.position, &dual.place_positions());
            let of_place = |p| weights.iter_row(p).map(|(node, w)| w * model.pore_pressure[node]).sum();
            (0..dual.places()).map(of_place).collect::<Vec<f64>>()
        };
        let wetting = CornerWetting::new(model, &drawn, &pressure, !conditions.is_empty());
        if self.scheme == FlowScheme::Undrained || wetting.is_none() && conditions.is_empty() {
            self.wetting = wetting.map(Box::new);
            return Ok(());
        }
        let relative = |node| wetting.as_ref().map_or(1.0, |wetting| wetting.relative_at_rest(dual, node));
        let at_rest = cell_conduction(model, dual, relative);
        let may_dry = if wetting.is_some() {
            CornerWetting::may_dry(model, &drawn)
        } else {
            vec![false; dual.places()]
        };
        let ground = corner_edges::Ground { model, dual, at_rest: &at_rest, may_dry: &may_dry };
        let edges = CornerEdges::new(&ground, self.water, conditions)?;
        // The surface of soil with a curve is open where it is wet at rest: an excess there would leave.
        for (place, is_open) in self.is_open.iter_mut().enumerate() {
            *is_open &= !may_dry[place] || pressure[place] >= 0.0;
        }
        let brought_at_rest = if wetting.is_some() {
            (0..dual.places()).map(|p| brought(&at_rest, edges.head_at_rest(), p)).collect()
        } else {
            Vec::new()
        };
        let zeros = vec![0.0; dual.places()];
        self.conditions = Some(Box::new(Conditions {
            edges,
            value: zeros.clone(),
            inflow: zeros,
            gained: Vec::new(),
            brought_at_rest,
        }));
        self.wetting = wetting.map(Box::new);
        Ok(())
    }

    /// Takes over the volumes and places of a new geometry, at a time of the stage, s.
    pub fn follow(&mut self, section: SectionView, time: f64) {
        let (model, StressLayout::Dual(dual), points) = (section.model, section.layout, section.points)
        else {
            return;
        };
        let grains = dual.at_places(|s| {
            let porosity = model.regions[section.layout.region(model, s)].porosity;
            (1.0 - porosity) * dual.volume[s]
        });
        self.volume = dual.at_places(|s| points[s].volume);
        self.filled.copy_from_slice(&self.volume);
        for (place, response) in self.response.iter_mut().enumerate() {
            let pores = self.volume[place] - grains[place];
            *response = if self.is_dry[place] { 0.0 } else { self.water.bulk_modulus / pores };
        }
        for (strain, &s) in self.strain.iter_mut().zip(&dual.first) {
            *strain = volume_strain(&points[s as usize]);
        }
        if let Some(wetting) = &mut self.wetting {
            wetting.follow(model, section.layout, points);
            wetting.update(dual, &self.excess);
            wetting.storage(dual, &mut self.response, &mut self.filled);
            wetting.tabulate(dual);
        }
        if self.scheme != FlowScheme::Undrained {
            self.tabulate(model, dual);
            if let Some(conditions) = &mut self.conditions {
                conditions.edges.look_up(time);
            }
            self.switch();
        }
        self.factors = None;
        self.carry(dual);
    }

    /// The table of conduction for the present cells and conductivities.
    fn tabulate(&mut self, model: &Model, dual: &DualLattice) {
        let tabled = self.wetting.as_ref().map(|wetting| wetting.tabled());
        let relative = |node: usize| match (self.closed.get(node), tabled) {
            (Some(true), _) => 0.0,
            (_, tabled) => tabled.map_or(1.0, |tabled| tabled[node]),
        };
        let exchange = cell_conduction(model, dual, relative);
        self.driven =
            self.scheme.has_acceleration_term().then(|| driven_by_acceleration(model, dual, relative));
        if let Some(conditions) = &mut self.conditions {
            let Conditions { edges, brought_at_rest, gained, .. } = conditions.as_mut();
            let now = |(place, then): (usize, &f64)| brought(&exchange, edges.head_at_rest(), place) - then;
            *gained = brought_at_rest.iter().enumerate().map(now).collect();
        }
        self.exchange = Some(exchange);
        self.factors = None;
    }

    /// Switches conditions between a head and an inflow by the present pressures, and takes over what they prescribe.
    fn switch(&mut self) {
        let (Some(conditions), Some(exchange)) = (&mut self.conditions, &self.exchange) else { return };
        let Conditions { edges, gained, .. } = conditions.as_mut();
        edges.switch(exchange, gained, &self.excess);
        self.take_conditions();
    }

    /// Takes over what the conditions prescribe at present.
    fn take_conditions(&mut self) {
        let Some(conditions) = &mut self.conditions else { return };
        let Conditions { edges, value, inflow, gained, .. } = conditions.as_mut();
        if gained.is_empty() {
            inflow.fill(0.0);
        } else {
            inflow.copy_from_slice(gained);
        }
        let mut has_changed = false;
        for (place, held, brought) in edges.acting() {
            has_changed |= self.is_held[place] != held.is_some();
            self.is_held[place] = held.is_some();
            value[place] = held.unwrap_or(0.0);
            inflow[place] += brought;
        }
        if has_changed {
            self.factors = None;
        }
    }

    /// Makes a new table of conduction if conductivities have changed, and switches conditions: in soil that takes up air.
    /// In full soil the pressure of every wave would switch them; they change with the geometry alone.
    pub fn refresh(&mut self, model: &Model, dual: &DualLattice) {
        let Some(wetting) = &mut self.wetting else { return };
        if self.exchange.is_none() {
            return;
        }
        if wetting.is_stale(dual) {
            wetting.tabulate(dual);
            self.tabulate(model, dual);
        }
        self.switch();
    }

    /// Puts ground that flows into still water, from which its excess counts from now on. `neutral` is the stress `S_r p`
    /// that the water carries at rest at each node, kPa.
    pub fn stand_in(&mut self, water: StillWater, section: &SectionView, neutral: &[f64]) {
        let Some(dual) = section.layout.dual() else { return };
        let weights = point_weights(section.model, section.position, &dual.place_positions());
        self.still = Some(Still {
            water,
            pressure: vec![0.0; self.excess.len()],
            at_rest: (0..self.excess.len())
                .map(|place| weights.iter_row(place).map(|(node, w)| w * neutral[node]).sum())
                .collect(),
        });
        for (excess, rest) in self.excess.iter_mut().zip(self.still.iter().flat_map(|still| &still.at_rest)) {
            *excess += rest;
        }
        self.carry(dual);
    }

    /// Counts the excess from the still water at the present places.
    fn carry(&mut self, dual: &DualLattice) {
        let Some(Still { water, pressure, .. }) = &mut self.still else { return };
        for ((excess, rest), (at, is_dry)) in
            self.excess.iter_mut().zip(pressure).zip(dual.place_positions().iter().zip(&self.is_dry))
        {
            if !is_dry {
                let here = water.pressure(*at);
                *excess += *rest - here;
                *rest = here;
            }
        }
    }

    /// Force of the still water on every node, kN/m.
    pub fn buoyancy(&self, position: &[Vec2], volume: &[f64]) -> Option<Vec<Vec2>> {
        let Still { water, .. } = self.still.as_ref()?;
        Some(position.iter().zip(volume).map(|(at, volume)| water.gradient(*at) * -volume).collect())
    }

    /// Whether the water exerts forces on nodes besides its pressure at the stress points.
    pub fn has_nodal_force(&self) -> bool {
        self.conditions.is_some() || self.wetting.is_some()
    }

    /// Force on node `j` of what stands on the ground surface beyond that at rest, and of the weight of water gained, kN/m.
    /// The pressure at stress points is part of the stress there: uniform pressure, inside and out, moves nothing.
    #[inline]
    pub fn force(&self, ground: &Pressed, j: usize) -> Vec2 {
        let Pressed { geometry, dual, points, phases } = *ground;
        let outside = self.conditions.as_ref().map_or(0.0, |conditions| conditions.edges.at_surface(j));
        let mut force = Vec2::zeros();
        if outside != 0.0 {
            let pressed = |s: usize| {
                let StressPoint { deformation, volume, .. } = &points[s];
                deformation.cofactor().scaled(outside * volume)
            };
            for (s, weight) in geometry.gradient.transposed.iter_row(j) {
                let ([xx, xy, yx, yy], g) = (pressed(s), weight.gradient);
                force -= Vec2::new(xx * g.x + xy * g.y, yx * g.x + yy * g.y);
            }
            for (s, weight) in geometry.wall.transposed.iter_row(j) {
                force -= weight.contract(pressed(s));
            }
        }
        if let Some(wetting) = &self.wetting {
            let pores = phases.porosity(j) * phases.volume()[j];
            force.y -= self.water.unit_weight * wetting.gained(dual, j) * pores;
        }
        force
    }

    /// Advances the excess by a step from the accelerations of the nodes (m/s2) and the strain of the soil at its end. Returns the work on the water, kJ/m; none when
    /// the implicit matrix cannot be factored.
    #[must_use]
    pub fn step(
        &mut self,
        threaded: bool,
        dual: &DualLattice,
        points: &[StressPoint],
        acceleration: &[Vec2],
        time: TimeStep,
    ) -> Option<StressWork> {
        if let Some(conditions) = &mut self.conditions {
            conditions.edges.look_up(time.end);
            self.take_conditions();
        }
        self.take_volume_strain(threaded, dual, points);
        match self.scheme {
            FlowScheme::Undrained => {}
            FlowScheme::Implicit => {
                if !self.diffuse_implicitly(time.dt) {
                    return None;
                }
            }
            FlowScheme::Explicit | FlowScheme::ExplicitWithAcceleration => {
                self.diffuse_explicitly(threaded, acceleration, time.dt);
            }
        }
        Some(self.end_step(dual))
    }

    /// The excess that the volume strain of the step leaves: `dp = -(K_f / n) S_r d epsilon_v`.
    fn take_volume_strain(&mut self, threaded: bool, dual: &DualLattice, points: &[StressPoint]) {
        let Self { excess, response, filled, volume, .. } = self;
        let mut results = vec![(); chunks(excess.len())];
        let rows = Rows { a: &mut self.next, b: &mut self.strain, c: &mut self.pressed };
        for_each_chunk(threaded, rows, &mut results, |first, rows, ()| {
            for (k, (next, (strain, pressed))) in
                rows.a.iter_mut().zip(rows.b.iter_mut().zip(rows.c.iter_mut())).enumerate()
            {
                let place = first + k;
                let point = &points[dual.first[place] as usize];
                let now = volume_strain(point);
                let shortening = *strain - now;
                *strain = now;
                *next = excess[place] + response[place] * filled[place] * shortening;
                *pressed = shortening * volume[place] * point.deformation.volume_ratio();
            }
        });
    }

    /// Prescribed excess of a held place, kPa.
    fn prescribed(&self, place: usize) -> f64 {
        self.conditions.as_ref().map_or(0.0, |conditions| conditions.value[place])
    }

    /// Inflow of a place beyond that at rest, besides conduction of the excess, m2/s.
    fn inflow(&self, place: usize) -> f64 {
        self.conditions.as_ref().map_or(0.0, |conditions| conditions.inflow[place])
    }

    /// Forward Euler on what conduction and acceleration bring.
    fn diffuse_explicitly(&mut self, threaded: bool, acceleration: &[Vec2], dt: f64) {
        let mut next = std::mem::take(&mut self.next);
        let Some(exchange) = &self.exchange else { return };
        let scale = self.water.unit_weight.recip();
        let mut unit = (vec![(); next.len()], vec![(); next.len()], vec![(); chunks(next.len())]);
        let rows = Rows { a: &mut next, b: &mut unit.0, c: &mut unit.1 };
        for_each_chunk(threaded, rows, &mut unit.2, |first, rows, ()| {
            for (k, next) in rows.a.iter_mut().enumerate() {
                let place = first + k;
                if self.is_held[place] {
                    *next = self.prescribed(place);
                } else {
                    let mut rate = scale * brought(exchange, &self.excess, place) + self.inflow(place);
                    if let Some(driven) = &self.driven {
                        rate += driven.iter_row(place).map(|(j, w)| w.dot(&acceleration[j])).sum::<f64>();
                    }
                    *next += dt * self.response[place] * rate;
                }
            }
        });
        self.next = next;
    }

    /// Backward Euler on the change of the excess. The matrix may be older than the storage of partly saturated soil: the
    /// rates are those at the start of the step. Returns `false` when the matrix cannot be factored.
    fn diffuse_implicitly(&mut self, dt: f64) -> bool {
        let is_outgrown = self.wetting.as_ref().is_some_and(|wetting| wetting.is_outgrown(&self.response));
        let factors = self.factors.take().filter(|(of, _)| *of == dt && !is_outgrown);
        let factors = factors.or_else(|| {
            if let Some(wetting) = &mut self.wetting {
                wetting.factored_with(&self.response);
            }
            Some((dt, BandedLu::factor(&self.implicit_matrix(dt)?)?))
        });
        let (Some((_, mut lu)), Some(exchange)) = (factors, &self.exchange) else { return false };
        let mut change = std::mem::take(&mut self.next);
        let scale = self.water.unit_weight.recip();
        for (place, change) in change.iter_mut().enumerate() {
            let own = self.excess[place];
            *change = if self.is_held[place] {
                self.prescribed(place) - own
            } else {
                // Held neighbours have their pressure at the end of the step.
                let value = |j: usize| if self.is_held[j] { self.prescribed(j) } else { self.excess[j] };
                let flowing: f64 = exchange.iter_row(place).map(|(j, w)| w * value(j)).sum();
                *change - own + dt * self.response[place] * (scale * flowing + self.inflow(place))
            };
        }
        lu.solve(&mut change);
        for (change, excess) in change.iter_mut().zip(&self.excess) {
            *change += excess;
        }
        (self.next, self.factors) = (change, Some((dt, lu)));
        true
    }

    /// `I - dt (K_f / n) div (k / gamma_f grad)`; rows and columns of held places, whose change is known, are those of the
    /// identity.
    fn implicit_matrix(&self, dt: f64) -> Option<Csr<f64>> {
        let exchange = self.exchange.as_ref()?;
        let scale = dt / self.water.unit_weight;
        let mut matrix = Csr::with_capacity(exchange.rows(), exchange.entries());
        for (place, (is_held, response)) in self.is_held.iter().zip(&self.response).enumerate() {
            let mut entries = vec![(id(place), 1.0)];
            if !is_held {
                let flowing = exchange.iter_row(place).filter(|(j, _)| !self.is_held[*j]);
                entries.extend(flowing.map(|(j, w)| (id(j), -scale * response * w)));
            }
            matrix.push_row(&mut entries);
        }
        Some(matrix)
    }

    /// Takes over the new excess; returns the work of the pressure on the water in the volume strain of the step.
    fn end_step(&mut self, dual: &DualLattice) -> StressWork {
        let mut work = StressWork::default();
        let Some(wetting) = &mut self.wetting else {
            for ((excess, next), pressed) in self.excess.iter_mut().zip(&self.next).zip(&self.pressed) {
                work.mean += 0.5 * (*excess + next) * pressed;
                work.after += next * pressed;
                *excess = *next;
            }
            return work;
        };
        let neutral = |wetting: &CornerWetting, excess: &[f64]| -> Vec<f64> {
            let of_point = |s: usize| {
                let place = dual.place[s] as usize;
                let share = wetting.volume(s) / self.volume[place];
                share * self.pressed[place] * wetting.neutral(s, excess[place])
            };
            (0..dual.place.len()).map(of_point).collect()
        };
        let before: f64 = neutral(wetting, &self.excess).iter().sum();
        self.excess.copy_from_slice(&self.next);
        wetting.update(dual, &self.excess);
        work.after = neutral(wetting, &self.excess).iter().sum();
        work.mean = 0.5 * (before + work.after);
        wetting.storage(dual, &mut self.response, &mut self.filled);
        work
    }

    /// Total stress that the water of a point carries beyond that from which the flow counts, kPa.
    #[inline]
    pub fn neutral(&self, dual: &DualLattice, s: usize) -> f64 {
        let excess = self.excess[dual.place[s] as usize];
        self.wetting.as_ref().map_or(excess, |wetting| wetting.neutral(s, excess))
    }

    /// Excess since rest at a place, kPa.
    pub fn since_rest(&self, place: usize) -> f64 {
        let own = self.excess[place];
        self.still.as_ref().map_or(own, |still| own + still.pressure[place] - still.at_rest[place])
    }

    /// Mean excess since rest over the cell of a node, kPa.
    pub fn of_node(&self, node: usize) -> f64 {
        let sum: f64 = self.of_node[node].iter().map(|&place| self.since_rest(place as usize)).sum();
        sum / CORNERS as f64
    }

    /// Degree of saturation of a node, if it can change.
    pub fn saturation<'a>(&'a self, dual: &'a DualLattice) -> Option<impl Fn(usize) -> f64 + 'a> {
        self.wetting.as_ref().map(move |wetting| move |node: usize| wetting.saturation(dual, node))
    }

    /// Sets the excess from values at the nodes (kPa), by a linear fit.
    pub fn set_from_nodes(&mut self, model: &Model, position: &[Vec2], dual: &DualLattice, excess: &[f64]) {
        let weights = point_weights(model, position, &dual.place_positions());
        for (place, slot) in self.excess.iter_mut().enumerate() {
            *slot = weights.iter_row(place).map(|(node, w)| w * excess[node]).sum();
        }
        self.restart_moisture(dual);
    }

    /// Takes over the excess since rest of the stage before. Ground that flows takes over what its water carries.
    pub fn continue_from(&mut self, before: &Self, dual: &DualLattice) {
        for (place, excess) in self.excess.iter_mut().enumerate() {
            *excess = before.since_rest(place);
        }
        if let (Some(wetting), None) = (&before.wetting, &self.wetting) {
            let total = dual.at_places(|s| wetting.volume(s));
            let carried = dual.at_places(|s| wetting.volume(s) * before.neutral(dual, s));
            for ((excess, carried), total) in self.excess.iter_mut().zip(carried).zip(total) {
                *excess = carried / total;
            }
        }
        self.restart_moisture(dual);
        self.switch();
    }

    fn restart_moisture(&mut self, dual: &DualLattice) {
        if let Some(wetting) = &mut self.wetting {
            wetting.update(dual, &self.excess);
            wetting.storage(dual, &mut self.response, &mut self.filled);
        }
    }

    /// How the excess is advanced.
    pub fn scheme(&self) -> FlowScheme {
        self.scheme
    }

    /// Bytes held.
    pub fn bytes(&self) -> usize {
        let of_conditions = |conditions: &Conditions| {
            conditions.edges.bytes()
                + 2 * size_of_val(conditions.value.as_slice())
                + 2 * size_of_val(conditions.gained.as_slice())
        };
        7 * size_of_val(self.excess.as_slice())
            + 3 * self.is_held.len()
            + self.closed.len()
            + size_of_val(self.of_node.as_slice())
            + self.exchange.as_ref().map_or(0, Csr::bytes)
            + self.driven.as_ref().map_or(0, Csr::bytes)
            + self.factors.as_ref().map_or(0, |(_, lu)| lu.bytes())
            + self.conditions.as_deref().map_or(0, of_conditions)
            + self.wetting.as_ref().map_or(0, |wetting| wetting.bytes())
            + self
                .still
                .as_ref()
                .map_or(0, |still| still.water.bytes() + 2 * size_of_val(still.pressure.as_slice()))
    }
}

/// Volume strain of the soil at a point since the stage began, tension positive.
fn volume_strain(point: &StressPoint) -> f64 {
    point.strain[0] + point.strain[1]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        run::ground::Ground,
        section::{
            description::{Conductivity, Operators},
            outline::Outline,
            stress_layout::stress_positions,
        },
        testing::square_block,
    };

    const SIDE: usize = 4;

    /// Permeable ground drains at its surface; a layer that lets no water through does not, also above ground that does.
    #[test]
    fn only_a_permeable_surface_is_drained() {
        for (upper, drained) in [(1.0, true), (0.0, false)] {
            let mut model = square_block(SIDE);
            model.numerics.operators = Operators::Dual;
            model.outline = Outline::level(-0.5);
            model.water = Some(Water { unit_weight: 10.0, bulk_modulus: 1e6 });
            model.pore_pressure = model.position.iter().map(|x| 10.0 * (SIDE as f64 - x.y)).collect();
            model.regions.push(model.regions[0].clone());
            for (region, k) in model.regions.iter_mut().zip([1.0, upper]) {
                region.hydraulic_conductivity = Conductivity::isotropic(k);
            }
            model.region = (0..model.nodes()).map(|node| u32::from(node >= 2 * SIDE)).collect();
            model.vertical_effective_stress = vec![0.0; stress_positions(&model).len()];
            let ground = Ground::new(&model).unwrap();
            let outline = ground.outline();
            let flow = CornerFlow::new(ground.view(&outline), FlowScheme::Explicit, &[], |_| 1.0);
            let flow = flow.unwrap().unwrap();
            let places = ground.layout.dual().unwrap().place_positions();
            let at_top = |place: &usize| places[*place].y > SIDE as f64 - 1.0;
            let (top, below): (Vec<usize>, Vec<usize>) = (0..places.len()).partition(at_top);
            assert!(top.iter().all(|&place| flow.is_held[place] == drained), "{upper}");
            assert!(below.iter().any(|&place| !flow.is_held[place]));
        }
    }
}
