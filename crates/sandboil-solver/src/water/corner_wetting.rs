//! Partly saturated soil at the corners of cells in motion (Eq. 3): what its pores hold, how it stores and conducts water,
//! and what it weighs. Air is passive.

use crate::{
    section::{
        description::{Model, Water},
        dual_lattice::{CORNERS, DualLattice},
        stress_layout::StressLayout,
    },
    skeleton::point::StressPoint,
};
use sandboil_soil::{Moisture, VanGenuchten};

/// Change of a relative conductivity above which the table of conduction is renewed.
const STALE_CONDUCTIVITY: f64 = 0.02;
/// Factor by which a place may stiffen over the stiffness in the implicit matrix before it is factored again: a mode whose
/// true rate is less than twice that of the matrix decays.
const STALE_STIFFNESS: f64 = 1.5;

/// Pores of a section that has a retention curve somewhere.
#[derive(Debug, Clone, serde::Serialize, serde::Deserialize)]
pub struct CornerWetting {
    water: Water,
    /// Retention curve of the soil of each point; none: it keeps its saturation.
    curve: Vec<Option<VanGenuchten>>,
    /// Pore pressure at rest of the point's place, kPa.
    pressure_at_rest: Vec<f64>,
    at_rest: Vec<Moisture>,
    present: Vec<Moisture>,
    /// Saturation of each node at rest.
    node_at_rest: Vec<f64>,
    /// Volume of each point and of its pores, m2.
    volumes: Vec<[f64; 2]>,
    /// Relative conductivity of each cell in the table.
    tabled: Vec<f64>,
    /// Response of each place in the factored matrix, kPa/m2.
    factored: Vec<f64>,
}

impl CornerWetting {
    /// The pores at rest under pressures (kPa) of the places; none if no soil has a retention curve, or if all pores are
    /// full and no condition could change that.
    pub fn new(model: &Model, layout: &StressLayout, pressure: &[f64], has_conditions: bool) -> Option<Self> {
        let dual = layout.dual()?;
        let has_curve = model.regions.iter().any(|region| region.retention.is_some());
        let may_hold_air = has_conditions || !model.saturation.is_empty();
        let water = model.water.filter(|_| has_curve && may_hold_air)?;
        let count = dual.place.len();
        let curve: Vec<_> = (0..count).map(|s| model.regions[layout.region(model, s)].retention).collect();
        let pressure_at_rest: Vec<f64> = dual.place.iter().map(|&place| pressure[place as usize]).collect();
        let moisture = |s: usize| match curve[s] {
            Some(curve) => curve.at(pressure_at_rest[s] / water.unit_weight),
            None => Moisture { saturation: model.saturation(layout.node(s)), ..Moisture::SATURATED },
        };
        let at_rest: Vec<Moisture> = (0..count).map(moisture).collect();
        let mut wetting = Self {
            water,
            present: at_rest.clone(),
            node_at_rest: (0..model.nodes()).map(|node| model.saturation(node)).collect(),
            volumes: vec![[0.0; 2]; count],
            tabled: Vec::new(),
            factored: Vec::new(),
            curve,
            pressure_at_rest,
            at_rest,
        };
        wetting.tabulate(dual);
        Some(wetting)
    }

    /// Takes over volumes and porosities: the grains are those at rest.
    pub fn follow(&mut self, model: &Model, layout: &StressLayout, points: &[StressPoint]) {
        let Some(dual) = layout.dual() else { return };
        for (s, [volume, pores]) in self.volumes.iter_mut().enumerate() {
            let grains = 1.0 - model.regions[layout.region(model, s)].porosity;
            (*volume, *pores) = (points[s].volume, points[s].volume - grains * dual.volume[s]);
        }
    }

    /// Volume of a point, m2.
    pub fn volume(&self, s: usize) -> f64 {
        self.volumes[s][0]
    }

    /// Whether the soil of each place takes up air.
    pub fn may_dry(model: &Model, layout: &StressLayout) -> Vec<bool> {
        let Some(dual) = layout.dual() else { return Vec::new() };
        let mut may_dry = vec![false; dual.places()];
        for (s, &place) in dual.place.iter().enumerate() {
            may_dry[place as usize] |= model.regions[layout.region(model, s)].retention.is_some();
        }
        may_dry
    }

    /// Updates moistures to the present excess pressures of the places, kPa.
    pub fn update(&mut self, dual: &DualLattice, excess: &[f64]) {
        for (s, moisture) in self.present.iter_mut().enumerate() {
            if let Some(curve) = self.curve[s] {
                let pressure = self.pressure_at_rest[s] + excess[dual.place[s] as usize];
                *moisture = curve.at(pressure / self.water.unit_weight);
            }
        }
    }

    /// Pressure rise of every place per volume of water pressed into it (kPa/m2), the inverse of Eq. 3's storage
    /// `n S_r / K_f + (n / gamma_f) dS_r/dh`; and the volume of its soil times its saturation (m2).
    pub fn storage(&self, dual: &DualLattice, response: &mut [f64], filled: &mut [f64]) {
        let Water { unit_weight, bulk_modulus } = self.water;
        response.fill(0.0);
        filled.fill(0.0);
        for (s, moisture) in self.present.iter().enumerate() {
            // Soil that holds air without a curve takes no water.
            if self.curve[s].is_none() && moisture.saturation < 1.0 {
                continue;
            }
            let (place, [volume, pores]) = (dual.place[s] as usize, self.volumes[s]);
            response[place] += pores * (moisture.saturation / bulk_modulus + moisture.capacity / unit_weight);
            filled[place] += volume * moisture.saturation;
        }
        for storage in response.iter_mut().filter(|storage| **storage > 0.0) {
            *storage = storage.recip();
        }
    }

    /// Total stress that the water of a point carries beyond that at rest, `S_r p` less its start (Bishop's stress), kPa.
    #[inline]
    pub fn neutral(&self, s: usize, excess: f64) -> f64 {
        let rest = self.pressure_at_rest[s];
        self.present[s].saturation * (rest + excess) - self.at_rest[s].saturation * rest
    }

    /// Mean over the cell of a node of a value of its soil's points.
    fn of_node(dual: &DualLattice, node: usize, value: impl Fn(usize) -> f64) -> f64 {
        dual.of_node[node].iter().map(|&s| value(s as usize)).sum::<f64>() / CORNERS as f64
    }

    /// Degree of saturation of a node: that at rest and what the corners of its cell have gained since.
    pub fn saturation(&self, dual: &DualLattice, node: usize) -> f64 {
        (self.node_at_rest[node] + self.gained(dual, node)).clamp(0.0, 1.0)
    }

    /// By how much the saturation of a node has grown since rest.
    #[inline]
    pub fn gained(&self, dual: &DualLattice, node: usize) -> f64 {
        Self::of_node(dual, node, |s| self.present[s].saturation - self.at_rest[s].saturation)
    }

    /// Conductivity of the cell of a node over that of the saturated soil, at present.
    pub fn relative(&self, dual: &DualLattice, node: usize) -> f64 {
        Self::of_node(dual, node, |s| self.present[s].relative_conductivity)
    }

    /// The same at rest.
    pub fn relative_at_rest(&self, dual: &DualLattice, node: usize) -> f64 {
        Self::of_node(dual, node, |s| self.at_rest[s].relative_conductivity)
    }

    /// Whether conductivities have left those of the table.
    pub fn is_stale(&self, dual: &DualLattice) -> bool {
        let changed =
            |(node, tabled): (usize, &f64)| (self.relative(dual, node) - tabled).abs() > STALE_CONDUCTIVITY;
        self.tabled.iter().enumerate().any(changed)
    }

    /// Takes the present relative conductivities over into the table.
    pub fn tabulate(&mut self, dual: &DualLattice) {
        self.tabled = (0..dual.of_node.len()).map(|node| self.relative(dual, node)).collect();
    }

    /// Relative conductivities of the cells in the table.
    pub fn tabled(&self) -> &[f64] {
        &self.tabled
    }

    /// Whether the factored matrix is too soft for the present responses, kPa/m2.
    pub fn is_outgrown(&self, response: &[f64]) -> bool {
        self.factored.len() != response.len()
            || response.iter().zip(&self.factored).any(|(now, factored)| *now > STALE_STIFFNESS * factored)
    }

    /// The factored matrix has these responses, kPa/m2.
    pub fn factored_with(&mut self, response: &[f64]) {
        self.factored.clear();
        self.factored.extend_from_slice(response);
    }

    /// Bytes held.
    pub fn bytes(&self) -> usize {
        size_of_val(self.curve.as_slice())
            + 2 * size_of_val(self.present.as_slice())
            + size_of_val(self.pressure_at_rest.as_slice())
            + size_of_val(self.node_at_rest.as_slice())
            + size_of_val(self.volumes.as_slice())
            + size_of_val(self.tabled.as_slice())
            + size_of_val(self.factored.as_slice())
    }
}
