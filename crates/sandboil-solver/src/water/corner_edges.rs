//! Hydraulic conditions (Section 4.1) at the corners of cells while the ground moves.
//!
//! Corners lie on the edges themselves, so a head on an edge is the head of its corners, and an inflow goes into them. A
//! condition prescribes an inflow, or less where more would raise the head above a limit ([`Demand`]): a corner holds the
//! limiting head while less than the prescribed inflow passes under it. Excess counts from the state at rest, so what
//! crosses an edge counts from what crossed it at rest.

use crate::{
    error::SolverError,
    section::{
        bins::Bins,
        description::{Model, Water},
        dual_lattice::DualLattice,
        node_id::id,
    },
    water::{conditions::Demand, edge_law::HYSTERESIS, moving_edges::MovingBoundary},
    weights::points::point_weights,
};
use sandboil_sph::{Csr, Vec2, WendlandQuintic};
use std::collections::BTreeMap;

/// Samples of a line per spacing.
const SAMPLES: f64 = 8.0;
/// Distance from a line within which corners belong to it, in spacings: a sloping surface is a staircase of cells.
const ON_THE_LINE: f64 = 0.75;
/// Distance past the end of a line up to which a corner is still on it, in spacings: round-off.
const PAST_THE_END: f64 = 0.1;

/// Conditions at corners.
#[derive(Debug, Clone, serde::Serialize, serde::Deserialize)]
pub struct CornerEdges {
    conditions: Vec<MovingBoundary>,
    unit_weight: f64,
    spots: Vec<Spot>,
    /// Total head of the places at rest, m.
    head_at_rest: Vec<f64>,
    /// What each spot asks for.
    now: Vec<Demand>,
    /// Whether it holds a head.
    holds: Vec<bool>,
    /// Excess pressure of each spot that holds a head (kPa), or inflow beyond that at rest (m2/s).
    value: Vec<f64>,
    /// Nodes near the ground surface, and the spot on it above each.
    above: Vec<(u32, u32)>,
    /// Excess pressure on the ground surface above each node near it, kPa; empty without a condition there.
    surface: Vec<f64>,
}

/// A place at which a condition acts.
#[derive(Debug, Clone, Copy, serde::Serialize, serde::Deserialize)]
struct Spot {
    place: u32,
    /// Index of the condition; none where air alone stands on the ground.
    condition: Option<u32>,
    /// Length of the line that belongs to the place, m.
    length: f64,
    /// Horizontal length over length.
    slope: f64,
    /// Elevation of the line there, m.
    elevation: f64,
    /// What it asked for at rest.
    at_rest: Demand,
    /// Whether it held a head at rest.
    held_at_rest: bool,
    /// What crossed the edge at rest, m2/s, positive into the ground.
    inflow_at_rest: f64,
}

/// What the section has where conditions may act.
pub struct Ground<'a> {
    /// The section.
    pub model: &'a Model,
    /// Its corners at rest.
    pub dual: &'a DualLattice,
    /// Exchange between places at rest, m/s.
    pub at_rest: &'a Csr<f64>,
    /// Whether air may enter each place: the soil there has a retention curve.
    pub may_dry: &'a [bool],
}

/// A short piece of a line.
struct Sample {
    at: Vec2,
    direction: Vec2,
    length: f64,
    condition: usize,
}

fn samples(conditions: &[MovingBoundary], spacing: f64) -> Vec<Sample> {
    let mut all = Vec::new();
    for (condition, MovingBoundary { boundary, .. }) in conditions.iter().enumerate() {
        for pair in boundary.line.windows(2) {
            let along = pair[1] - pair[0];
            #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
            // a positive count far below 2^63
            let count = (along.norm() / spacing * SAMPLES).ceil() as usize;
            all.extend((0..count).map(|k| Sample {
                at: pair[0] + along * ((k as f64 + 0.5) / count as f64),
                direction: along.normalize(),
                length: along.norm() / count as f64,
                condition,
            }));
        }
    }
    all
}

/// The inflow that is prescribed where no head is held, m/s. A place with a head alone never needs it.
fn prescribed(demand: Demand) -> f64 {
    if demand.inflow.is_finite() { demand.inflow } else { 0.0 }
}

fn exchanged(table: &Csr<f64>, value: &[f64], place: usize) -> f64 {
    table.iter_row(place).map(|(j, weight)| weight * value[j]).sum()
}

/// What a unit of its own head brings to a place, m/s; negative.
fn of_own(table: &Csr<f64>, place: usize) -> f64 {
    table.iter_row(place).filter(|(j, _)| *j == place).map(|(_, weight)| *weight).sum()
}

impl CornerEdges {
    /// The conditions on a section at rest.
    ///
    /// # Errors
    /// A condition that is no series, or a line without corners beside it.
    pub fn new(ground: &Ground, water: Water, conditions: &[MovingBoundary]) -> Result<Self, SolverError> {
        let Ground { model, dual, at_rest, may_dry } = *ground;
        for MovingBoundary { boundary, .. } in conditions {
            boundary.condition.validate()?;
        }
        let places = dual.place_positions();
        let head: Vec<f64> = {
            let weights = point_weights(model, &model.position, &places);
            let of_node =
                |node: usize| model.position[node].y + model.pore_pressure[node] / water.unit_weight;
            (0..places.len()).map(|p| weights.iter_row(p).map(|(node, w)| w * of_node(node)).sum()).collect()
        };
        let mut edges = Self {
            conditions: conditions.to_vec(),
            unit_weight: water.unit_weight,
            spots: spots(model, dual, &places, conditions)?,
            head_at_rest: head,
            now: Vec::new(),
            holds: Vec::new(),
            value: Vec::new(),
            above: Vec::new(),
            surface: Vec::new(),
        };
        // Elsewhere water leaves ground that can dry where it rises to the surface.
        let claimed: Vec<u32> = edges.spots.iter().map(|spot| spot.place).collect();
        for (place, at) in places.iter().enumerate() {
            let stands_in_air = dual.is_free[place] && may_dry[place] && edges.head_at_rest[place] < at.y;
            if stands_in_air && !claimed.contains(&id(place)) {
                edges.spots.push(Spot::new(place, None, at.y));
            }
        }
        edges.find_state_at_rest(at_rest);
        edges.now = edges.spots.iter().map(|spot| spot.at_rest).collect();
        edges.holds = edges.spots.iter().map(|spot| spot.held_at_rest).collect();
        edges.value = vec![0.0; edges.spots.len()];
        edges.find_surface(model, dual, &places);
        Ok(edges)
    }

    fn find_state_at_rest(&mut self, at_rest: &Csr<f64>) {
        let Self { conditions, unit_weight, spots, head_at_rest, .. } = self;
        for spot in spots.iter_mut() {
            let place = spot.place as usize;
            let of_line = spot.condition.map(|k| &conditions[k as usize]);
            let was_there = of_line.map(|line| line.at_rest);
            spot.at_rest = match (of_line, was_there.flatten()) {
                (Some(line), Some(value)) => {
                    line.boundary.condition.demand(value, spot.elevation, spot.slope, *unit_weight)
                }
                _ => Demand { inflow: 0.0, head: head_at_rest[place] },
            };
            // What it would take if it held its head.
            let raised = spot.at_rest.head - head_at_rest[place];
            let taken = -exchanged(at_rest, head_at_rest, place) - of_own(at_rest, place) * raised;
            let was_there = was_there.is_some_and(|value| value.is_some());
            let margin = HYSTERESIS * of_own(at_rest, place);
            spot.held_at_rest = was_there && spot.at_rest.head.is_finite() && {
                spot.at_rest.inflow.is_infinite() || taken < spot.at_rest.inflow * spot.length + margin
            };
            spot.inflow_at_rest =
                if spot.held_at_rest { taken } else { prescribed(spot.at_rest) * spot.length };
        }
        for spot in spots.iter().filter(|spot| spot.held_at_rest) {
            head_at_rest[spot.place as usize] = spot.at_rest.head;
        }
    }

    /// The spot on the ground surface above every node whose stencils the surface may cut.
    fn find_surface(&mut self, model: &Model, dual: &DualLattice, places: &[Vec2]) {
        let on_surface: Vec<bool> = self
            .spots
            .iter()
            .map(|spot| spot.condition.is_some() && dual.is_free[spot.place as usize])
            .collect();
        if !on_surface.contains(&true) {
            return;
        }
        let at: Vec<Vec2> = self.spots.iter().map(|spot| places[spot.place as usize]).collect();
        let spacing = model.spacing.x.max(model.spacing.y);
        let bins = Bins::new(&at, 2.0 * spacing);
        let tops: Vec<Vec2> = (0..model.nodes())
            .map(|node| Vec2::new(model.position[node].x, model.surface_elevation[node]))
            .collect();
        let near = Bins::new(&tops, 2.0 * WendlandQuintic::new(model.smoothing_length()).support());
        self.above = (0..model.nodes())
            .filter_map(|node| {
                let top = near.nearest(&tops, model.position[node], |_| true)?;
                let spot = bins.nearest(&at, tops[top], |spot| on_surface[spot])?;
                Some((id(node), id(spot)))
            })
            .collect();
        self.surface = vec![0.0; model.nodes()];
    }

    /// Total heads of the places at rest, m.
    pub fn head_at_rest(&self) -> &[f64] {
        &self.head_at_rest
    }

    /// Sets what the conditions ask for at a time, s.
    pub fn look_up(&mut self, time: f64) {
        for (spot, now) in self.spots.iter().zip(&mut self.now) {
            *now = match spot.condition {
                Some(k) => {
                    let condition = &self.conditions[k as usize].boundary.condition;
                    condition.demand(condition.value(time), spot.elevation, spot.slope, self.unit_weight)
                }
                None => Demand { inflow: 0.0, head: spot.elevation },
            };
        }
        self.update_values();
    }

    fn update_values(&mut self) {
        for (k, spot) in self.spots.iter().enumerate() {
            self.value[k] = if self.holds[k] {
                self.held(spot, self.now[k])
            } else {
                prescribed(self.now[k]) * spot.length - spot.inflow_at_rest
            };
        }
        for &(node, spot) in &self.above {
            let (k, spot) = (spot as usize, &self.spots[spot as usize]);
            self.surface[node as usize] = if self.holds[k] {
                self.value[k]
            } else {
                -self.unit_weight * (spot.at_rest.head - spot.elevation).max(0.0)
            };
        }
    }

    /// Excess pressure of a spot that holds its head, kPa.
    fn held(&self, spot: &Spot, demand: Demand) -> f64 {
        self.unit_weight * (demand.head - self.head_at_rest[spot.place as usize])
    }

    /// Switches spots between their head and their inflow by the present excess pressures (kPa) and the exchange (m/s),
    /// which brings `gained` (m2/s) to each place beyond what it brought at rest, by the heads at rest. Returns whether one
    /// changed.
    pub fn switch(&mut self, exchange: &Csr<f64>, gained: &[f64], excess: &[f64]) -> bool {
        let mut switched = false;
        for k in 0..self.spots.len() {
            let (spot, demand) = (&self.spots[k], self.now[k]);
            let place = spot.place as usize;
            let wanted = if demand.inflow.is_infinite() {
                true
            } else if demand.head.is_infinite() {
                false
            } else {
                let held = self.held(spot, demand);
                let of_own = of_own(exchange, place);
                let flowing = exchanged(exchange, excess, place) + of_own * (held - excess[place]);
                let more = gained.get(place).copied().unwrap_or(0.0);
                let taken = spot.inflow_at_rest - flowing / self.unit_weight - more;
                // A head by which a place must miss its state before it changes it.
                let margin = HYSTERESIS * -of_own;
                let most = demand.inflow * spot.length + if self.holds[k] { margin } else { -margin };
                taken < most && of_own < 0.0
            };
            switched |= wanted != self.holds[k];
            self.holds[k] = wanted;
        }
        if switched {
            self.update_values();
        }
        switched
    }

    /// Places of the conditions: for each its excess pressure (kPa) if it holds a head, else none, and its inflow beyond that
    /// at rest (m2/s).
    pub fn acting(&self) -> impl Iterator<Item = (usize, Option<f64>, f64)> {
        self.spots.iter().enumerate().map(|(k, spot)| {
            let held = self.holds[k].then_some(self.value[k]);
            (spot.place as usize, held, if self.holds[k] { 0.0 } else { self.value[k] })
        })
    }

    /// Excess pressure on the ground surface above a node near it, kPa; zero elsewhere.
    #[inline]
    pub fn at_surface(&self, node: usize) -> f64 {
        self.surface.get(node).copied().unwrap_or(0.0)
    }

    /// Bytes held.
    pub fn bytes(&self) -> usize {
        size_of_val(self.spots.as_slice())
            + size_of_val(self.now.as_slice())
            + self.holds.len()
            + size_of_val(self.value.as_slice())
            + size_of_val(self.head_at_rest.as_slice())
            + size_of_val(self.above.as_slice())
            + size_of_val(self.surface.as_slice())
    }
}

impl Spot {
    fn new(place: usize, condition: Option<usize>, elevation: f64) -> Self {
        Self {
            place: id(place),
            condition: condition.map(id),
            length: 0.0,
            slope: 0.0,
            elevation,
            at_rest: Demand { inflow: 0.0, head: f64::INFINITY },
            held_at_rest: false,
            inflow_at_rest: 0.0,
        }
    }
}

/// The places on the lines of the conditions.
fn spots(
    model: &Model,
    dual: &DualLattice,
    places: &[Vec2],
    conditions: &[MovingBoundary],
) -> Result<Vec<Spot>, SolverError> {
    let spacing = model.spacing.x.max(model.spacing.y);
    let samples = samples(conditions, spacing);
    let at: Vec<Vec2> = samples.iter().map(|sample| sample.at).collect();
    let bins = Bins::new(&at, ON_THE_LINE * spacing);
    let is_inside = |sample: &Sample| conditions[sample.condition].boundary.condition.is_inside();
    let is_edge = |place: usize| {
        let on = dual.on[dual.first[place] as usize];
        dual.is_free[place] || on.base || on.side.is_some()
    };
    let mut claimed: BTreeMap<usize, Spot> = BTreeMap::new();
    for (place, &x) in places.iter().enumerate().filter(|(place, _)| is_edge(*place)) {
        let belongs = |k: usize| {
            let sample = &samples[k];
            let along = (x - sample.at).dot(&sample.direction).abs();
            !is_inside(sample) && along < 0.5 * sample.length + PAST_THE_END * spacing
        };
        if let Some(k) = bins.nearest(&at, x, belongs) {
            claimed.insert(place, Spot::new(place, Some(samples[k].condition), at[k].y));
        }
    }
    // The places at the left side are those at the right side of a periodic section, too.
    let mut everywhere = places.to_vec();
    if let Some(period) = model.period {
        everywhere.extend(places.iter().map(|x| x + Vec2::new(period.width, 0.0)));
    }
    let all = Bins::new(&everywhere, ON_THE_LINE * spacing);
    let nearest = |at: Vec2, allowed: &dyn Fn(usize) -> bool| {
        let found = all.nearest(&everywhere, at, |k| allowed(k % places.len()));
        found.map(|k| k % places.len())
    };
    // A drain takes water at the places nearest to its line.
    for sample in samples.iter().filter(|sample| is_inside(sample)) {
        if let Some(place) = nearest(sample.at, &|_| true) {
            claimed.entry(place).or_insert_with(|| Spot::new(place, Some(sample.condition), sample.at.y));
        }
    }
    // Each piece of a line belongs to the nearest of its places.
    let mut height: BTreeMap<usize, f64> = BTreeMap::new();
    for sample in &samples {
        let of_line = |place: usize| {
            claimed.get(&place).is_some_and(|spot| spot.condition == Some(id(sample.condition)))
        };
        let Some(place) = nearest(sample.at, &of_line) else { continue };
        if let Some(spot) = claimed.get_mut(&place) {
            spot.length += sample.length;
            spot.slope += sample.direction.x.abs() * sample.length;
            *height.entry(place).or_default() += sample.at.y * sample.length;
        }
    }
    for (place, spot) in &mut claimed {
        if spot.length > 0.0 {
            spot.slope /= spot.length;
            spot.elevation = height[place] / spot.length;
        }
    }
    let is_used = |condition: usize| claimed.values().any(|spot| spot.condition == Some(id(condition)));
    match (0..conditions.len()).find(|&condition| !is_used(condition)) {
        Some(condition) => Err(SolverError::InvalidInput {
            name: "hydraulic boundary",
            value: condition as f64,
            expected: "a line with nodes beside it",
        }),
        None => Ok(claimed.into_values().collect()),
    }
}
