//! Partly saturated soil in motion (Eq. 3): what its pores hold, how it stores and conducts water, and what it weighs, as
//! its pressure changes from that at rest. Air is passive.

use crate::{
    parallel::{Rows, chunks, for_each_chunk},
    section::description::{Model, Water},
    skeleton::phases::Phases,
};
use sandboil_soil::{Moisture, VanGenuchten};

/// Change of a relative conductivity above which the tables of conduction are renewed.
const STALE_CONDUCTIVITY: f64 = 0.02;
/// Factor by which a node may stiffen over the stiffness in the implicit matrix before it is factored again: a mode whose
/// true rate is less than twice that of the matrix decays.
const STALE_STIFFNESS: f64 = 1.5;
/// Pores of a section that has a retention curve somewhere.
#[derive(Debug, Clone, serde::Serialize, serde::Deserialize)]
pub struct Wetting {
    water: Water,
    /// Retention curve of each node; none: it keeps its saturation.
    curve: Vec<Option<VanGenuchten>>,
    /// Pore pressure at rest, kPa.
    pressure_at_rest: Vec<f64>,
    at_rest: Vec<Moisture>,
    present: Vec<Moisture>,
    porosity: Vec<f64>,
    volume: Vec<f64>,
    /// Relative conductivities of the tables.
    tabled: Vec<f64>,
    /// Stiffness of the water in the factored matrix, kPa.
    pub factored: Vec<f64>,
}

impl Wetting {
    /// The pores at rest; none if no soil has a retention curve, or if all pores are full and no condition could change that.
    pub fn new(model: &Model, phases: &Phases, has_conditions: bool) -> Option<Self> {
        let has_curve = model.regions.iter().any(|region| region.retention.is_some());
        let may_hold_air = has_conditions || !model.saturation.is_empty();
        let water = model.water.filter(|_| has_curve && may_hold_air)?;
        let nodes = model.nodes();
        let curve: Vec<_> =
            model.region.iter().map(|&region| model.regions[region as usize].retention).collect();
        let moisture = |node: usize| match curve[node] {
            Some(curve) => curve.at(model.pore_pressure[node] / water.unit_weight),
            None => Moisture { saturation: model.saturation(node), ..Moisture::SATURATED },
        };
        let at_rest: Vec<Moisture> = (0..nodes).map(moisture).collect();
        let mut wetting = Self {
            water,
            curve,
            pressure_at_rest: model.pore_pressure.clone(),
            present: at_rest.clone(),
            at_rest,
            porosity: Vec::new(),
            volume: Vec::new(),
            tabled: Vec::new(),
            factored: Vec::new(),
        };
        wetting.follow(phases);
        Some(wetting)
    }

    /// Takes over porosities and volumes.
    pub fn follow(&mut self, phases: &Phases) {
        self.porosity = (0..self.curve.len()).map(|node| phases.porosity(node)).collect();
        self.volume = phases.volume().to_vec();
    }

    /// Bytes held.
    pub fn bytes(&self) -> usize {
        size_of_val(self.curve.as_slice())
            + 2 * size_of_val(self.present.as_slice())
            + 6 * size_of_val(self.pressure_at_rest.as_slice())
    }

    /// Degree of saturation.
    #[inline]
    pub fn saturation(&self, node: usize) -> f64 {
        self.present[node].saturation
    }

    /// Conductivity over that of the saturated soil.
    #[inline]
    pub fn relative(&self, node: usize) -> f64 {
        self.present[node].relative_conductivity
    }

    /// Total stress that the water carries beyond that at rest, `S_r p` less its start (Bishop's stress), kPa.
    #[inline]
    pub fn neutral(&self, node: usize, excess: f64) -> f64 {
        let rest = self.pressure_at_rest[node];
        self.present[node].saturation * (rest + excess) - self.at_rest[node].saturation * rest
    }

    /// Weight of the water that a node has gained since rest, kN/m.
    #[inline]
    pub fn gained_weight(&self, node: usize) -> f64 {
        let gained = self.present[node].saturation - self.at_rest[node].saturation;
        gained * self.porosity[node] * self.volume[node] * self.water.unit_weight
    }

    /// Pressure rise of a node per volume of water pressed into a unit of its volume, kPa: the inverse of Eq. 3's storage
    /// `n S_r / K_f + (n / gamma_f) dS_r/dh`. Zero stiffness in soil that holds air without a retention curve.
    fn stiffness(&self, node: usize, moisture: &Moisture) -> f64 {
        if self.curve[node].is_none() && moisture.saturation < 1.0 {
            return 0.0;
        }
        let Water { unit_weight, bulk_modulus } = self.water;
        1.0 / (self.porosity[node] * (moisture.saturation / bulk_modulus + moisture.capacity / unit_weight))
    }

    /// Moistures at the present excess pressures (kPa), and the stiffnesses that follow, kPa.
    pub fn update(&mut self, threaded: bool, excess: &[f64], stiffness: &mut [f64]) {
        let mut present = std::mem::take(&mut self.present);
        let mut unit = vec![(); excess.len()];
        let mut results = vec![(); chunks(excess.len())];
        let rows = Rows { a: &mut present, b: stiffness, c: &mut unit };
        for_each_chunk(threaded, rows, &mut results, |first, rows, ()| {
            for (k, (moisture, stiffness)) in rows.a.iter_mut().zip(rows.b).enumerate() {
                let node = first + k;
                if let Some(curve) = self.curve[node] {
                    let pressure = self.pressure_at_rest[node] + excess[node];
                    *moisture = curve.at(pressure / self.water.unit_weight);
                }
                *stiffness = self.stiffness(node, moisture);
            }
        });
        self.present = present;
    }

    /// Whether conductivities have left those of the tables.
    pub fn is_stale(&self) -> bool {
        let changed = |(moisture, tabled): (&Moisture, &f64)| {
            (moisture.relative_conductivity - tabled).abs() > STALE_CONDUCTIVITY
        };
        self.present.iter().zip(&self.tabled).any(changed)
    }

    /// Whether the factored matrix is too soft for the present stiffnesses, kPa.
    pub fn is_outgrown(&self, stiffness: &[f64]) -> bool {
        self.factored.len() != stiffness.len()
            || stiffness.iter().zip(&self.factored).any(|(now, factored)| *now > STALE_STIFFNESS * factored)
    }

    /// Takes the present relative conductivities over into the tables.
    pub fn tabulate(&mut self) {
        self.tabled.clear();
        self.tabled.extend(self.present.iter().map(|moisture| moisture.relative_conductivity));
    }

    /// Relative conductivities of the tables.
    pub fn tabled(&self) -> &[f64] {
        &self.tabled
    }

    /// Relative conductivities at rest.
    pub fn relative_at_rest(&self) -> Vec<f64> {
        self.at_rest.iter().map(|moisture| moisture.relative_conductivity).collect()
    }
}
