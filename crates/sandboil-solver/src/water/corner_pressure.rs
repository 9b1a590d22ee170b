//! Pore pressure at the corners of cells (dual lattice): Eq. 3 with the volume strain of the soil itself.
//!
//! Soil, porosity and water have one measure of volume: the strain by which the soil at a corner changes its volume presses
//! its water. An open surface is a zero excess at the corners that lie on it.

use crate::{
    linear::banded::BandedLu,
    parallel::{Rows, chunks, for_each_chunk},
    section::{
        description::{Model, Water},
        dual_lattice::{CORNERS, DualLattice},
        node_id::id,
        stress_layout::StressLayout,
    },
    skeleton::{point::StressPoint, section_view::SectionView, soils::StressWork},
    water::{cell_conduction::cell_conduction, pore_pressure::FlowScheme, still_water::StillWater},
    weights::points::point_weights,
};
use sandboil_sph::{Csr, Vec2};

/// Excess pore pressure at the places of corners.
#[derive(Debug, Clone, serde::Serialize, serde::Deserialize)]
pub struct CornerFlow {
    water: Water,
    /// Excess pore pressure at each place, kPa, compression positive.
    excess: Vec<f64>,
    /// `K_f / n`: pressure rise per unit of volume strain, kPa; zero where pores hold air.
    stiffness: Vec<f64>,
    /// Volume strain of the soil at each place at the end of the last step.
    strain: Vec<f64>,
    /// By how much the soil at each place has pressed its water together in the step, m2.
    pressed: Vec<f64>,
    /// Volume of each place, m2.
    volume: Vec<f64>,
    /// Whether the excess of a place stays zero: at an open surface, and beside soil that holds air, where the soil is
    /// permeable.
    is_held: Vec<bool>,
    /// Whether every cell that touches a place holds air.
    is_dry: Vec<bool>,
    /// Inflow of each place per metre of head over its volume, 1/(m s); none if undrained.
    exchange: Option<Csr<f64>>,
    /// Places of each node.
    of_node: Vec<[u32; CORNERS]>,
    scheme: FlowScheme,
    still: Option<Still>,
    /// The excess at the end of a step while it is computed, kPa.
    next: Vec<f64>,
    /// Factors of the implicit matrix, and their time step (s). Not stored: they are computed again, with the same bits.
    #[serde(skip)]
    factors: Option<(f64, BandedLu)>,
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

impl CornerFlow {
    /// Zero excess pressure everywhere; none in a dry section, or without corners.
    pub fn new(section: SectionView, scheme: FlowScheme) -> Option<Self> {
        let (model, StressLayout::Dual(dual)) = (section.model, section.layout) else { return None };
        let water = model.water?;
        let of_node: Vec<[u32; CORNERS]> =
            dual.of_node.iter().map(|points| points.map(|point| dual.place[point as usize])).collect();
        let mut is_permeable = vec![false; dual.places()];
        let (mut holds_air, mut is_dry) = (is_permeable.clone(), vec![true; dual.places()]);
        for (node, places) in of_node.iter().enumerate() {
            let is_dry_cell = model.saturation(node) < 1.0;
            let region = &model.regions[model.region[node] as usize];
            for &place in places {
                is_permeable[place as usize] |= region.hydraulic_conductivity.major > 0.0;
                holds_air[place as usize] |= is_dry_cell;
                is_dry[place as usize] &= is_dry_cell;
            }
        }
        let is_held = (0..dual.places())
            .map(|place| is_permeable[place] && (holds_air[place] || dual.is_free[place]))
            .collect();
        let mut flow = Self {
            water,
            excess: vec![0.0; dual.places()],
            stiffness: vec![0.0; dual.places()],
            strain: vec![0.0; dual.places()],
            pressed: vec![0.0; dual.places()],
            volume: Vec::new(),
            is_held,
            is_dry,
            exchange: None,
            of_node,
            scheme,
            still: None,
            next: vec![0.0; dual.places()],
            factors: None,
        };
        flow.follow(section);
        Some(flow)
    }

    /// Takes over the volumes and places of a new geometry.
    pub fn follow(&mut self, section: SectionView) {
        let (model, StressLayout::Dual(dual), points) = (section.model, section.layout, section.points)
        else {
            return;
        };
        let grains = dual.at_places(|s| {
            let porosity = model.regions[section.layout.region(model, s)].porosity;
            (1.0 - porosity) * dual.volume[s]
        });
        self.volume = dual.at_places(|s| points[s].volume);
        for (place, stiffness) in self.stiffness.iter_mut().enumerate() {
            let porosity = 1.0 - grains[place] / self.volume[place];
            *stiffness = if self.is_dry[place] { 0.0 } else { self.water.bulk_modulus / porosity };
        }
        for (strain, &s) in self.strain.iter_mut().zip(&dual.first) {
            *strain = volume_strain(&points[s as usize]);
        }
        if self.scheme != FlowScheme::Undrained {
            let mut exchange = cell_conduction(model, dual);
            let inverse: Vec<f64> = self.volume.iter().map(|volume| volume.recip()).collect();
            exchange.scale_by_row(&inverse);
            self.exchange = Some(exchange);
        }
        self.factors = None;
        self.carry(dual);
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

    /// Advances the excess by a step of `dt` (s) from the strain of the soil at its end. Returns the work on the water,
    /// kJ/m; none when the implicit matrix cannot be factored.
    #[must_use]
    pub fn step(
        &mut self,
        threaded: bool,
        dual: &DualLattice,
        points: &[StressPoint],
        dt: f64,
    ) -> Option<StressWork> {
        self.take_volume_strain(threaded, dual, points);
        match self.scheme {
            FlowScheme::Undrained => {}
            FlowScheme::Implicit => {
                if !self.diffuse_implicitly(dt) {
                    return None;
                }
            }
            FlowScheme::Explicit | FlowScheme::ExplicitWithAcceleration => {
                self.diffuse_explicitly(threaded, dt);
            }
        }
        Some(self.end_step())
    }

    /// The excess that the volume strain of the step leaves: `dp = -(K_f / n) d epsilon_v`.
    fn take_volume_strain(&mut self, threaded: bool, dual: &DualLattice, points: &[StressPoint]) {
        let (excess, stiffness, volume) = (&self.excess, &self.stiffness, &self.volume);
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
                *next = excess[place] + stiffness[place] * shortening;
                *pressed = shortening * volume[place] * point.deformation.volume_ratio();
            }
        });
    }

    /// Forward Euler on what conduction brings.
    fn diffuse_explicitly(&mut self, threaded: bool, dt: f64) {
        let Some(exchange) = &self.exchange else { return };
        let (excess, stiffness, is_held) = (&self.excess, &self.stiffness, &self.is_held);
        let scale = dt / self.water.unit_weight;
        let mut unit = (vec![(); excess.len()], vec![(); excess.len()], vec![(); chunks(excess.len())]);
        let rows = Rows { a: &mut self.next, b: &mut unit.0, c: &mut unit.1 };
        for_each_chunk(threaded, rows, &mut unit.2, |first, rows, ()| {
            for (k, next) in rows.a.iter_mut().enumerate() {
                let place = first + k;
                if is_held[place] {
                    *next = 0.0;
                } else {
                    let rate: f64 = exchange.iter_row(place).map(|(j, weight)| weight * excess[j]).sum();
                    *next += scale * stiffness[place] * rate;
                }
            }
        });
    }

    /// Backward Euler. Returns `false` when the matrix cannot be factored.
    fn diffuse_implicitly(&mut self, dt: f64) -> bool {
        let factors = self.factors.take().filter(|(of, _)| *of == dt);
        let Some((_, mut lu)) = factors.or_else(|| Some((dt, BandedLu::factor(&self.implicit_matrix(dt)?)?)))
        else {
            return false;
        };
        for (next, is_held) in self.next.iter_mut().zip(&self.is_held) {
            if *is_held {
                *next = 0.0;
            }
        }
        lu.solve(&mut self.next);
        self.factors = Some((dt, lu));
        true
    }

    /// `I - dt (K_f / n) div (k / gamma_f grad)`; rows and columns of held places, whose excess is zero, are those of the
    /// identity.
    fn implicit_matrix(&self, dt: f64) -> Option<Csr<f64>> {
        let exchange = self.exchange.as_ref()?;
        let scale = dt / self.water.unit_weight;
        let mut matrix = Csr::with_capacity(exchange.rows(), exchange.entries());
        for (place, (is_held, stiffness)) in self.is_held.iter().zip(&self.stiffness).enumerate() {
            let mut entries = vec![(id(place), 1.0)];
            if !is_held {
                let flowing = exchange.iter_row(place).filter(|(j, _)| !self.is_held[*j]);
                entries.extend(flowing.map(|(j, w)| (id(j), -scale * stiffness * w)));
            }
            matrix.push_row(&mut entries);
        }
        Some(matrix)
    }

    /// Takes over the new excess; returns the work of the pressure on the water in the volume strain of the step.
    fn end_step(&mut self) -> StressWork {
        let mut work = StressWork::default();
        for ((excess, next), pressed) in self.excess.iter_mut().zip(&self.next).zip(&self.pressed) {
            work.mean += 0.5 * (*excess + next) * pressed;
            work.after += next * pressed;
            *excess = *next;
        }
        work
    }

    /// Excess at a place, from which the flow counts, kPa.
    #[inline]
    pub fn at_place(&self, place: usize) -> f64 {
        self.excess[place]
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

    /// Sets the excess from values at the nodes (kPa), by a linear fit.
    pub fn set_from_nodes(&mut self, model: &Model, position: &[Vec2], dual: &DualLattice, excess: &[f64]) {
        let weights = point_weights(model, position, &dual.place_positions());
        for (place, slot) in self.excess.iter_mut().enumerate() {
            *slot = weights.iter_row(place).map(|(node, w)| w * excess[node]).sum();
        }
    }

    /// Takes over the excess since rest of the stage before.
    pub fn continue_from(&mut self, before: &Self) {
        for (place, excess) in self.excess.iter_mut().enumerate() {
            *excess = before.since_rest(place);
        }
    }

    /// How the excess is advanced.
    pub fn scheme(&self) -> FlowScheme {
        self.scheme
    }

    /// Bytes held.
    pub fn bytes(&self) -> usize {
        6 * size_of_val(self.excess.as_slice())
            + 2 * self.is_held.len()
            + size_of_val(self.of_node.as_slice())
            + self.exchange.as_ref().map_or(0, Csr::bytes)
            + self.factors.as_ref().map_or(0, |(_, lu)| lu.bytes())
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
            let flow = CornerFlow::new(ground.view(&outline), FlowScheme::Explicit).unwrap();
            let places = ground.layout.dual().unwrap().place_positions();
            let at_top = |place: &usize| places[*place].y > SIDE as f64 - 1.0;
            let (top, below): (Vec<usize>, Vec<usize>) = (0..places.len()).partition(at_top);
            assert!(top.iter().all(|&place| flow.is_held[place] == drained), "{upper}");
            assert!(below.iter().any(|&place| !flow.is_held[place]));
        }
    }
}
