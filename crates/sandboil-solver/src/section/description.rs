//! What is solved: nodes, regions, water and numerical choices, checked once.

use crate::{error::SolverError, section::outline::Outline};
use sandboil_soil::{Soil, VanGenuchten};
use sandboil_sph::{Mat2, Period, Vec2};

/// Stress nodes of each velocity node.
pub const STRESS_NODES: usize = 2;
/// Tolerance on equal volumes, over that of a cell, and on a level base, over the spacing: far above
/// round-off and too small to matter.
const EVEN: f64 = 1e-3;
/// Distance of a stress node from its velocity node over the particle spacing, along the diagonal (Section 3).
const STRESS_NODE_DISTANCE: f64 = 1.0 / 3.0;
/// Hydraulic conductivity by its principal values, m/s.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Conductivity {
    /// Largest.
    pub major: f64,
    /// Smallest, perpendicular to the largest.
    pub minor: f64,
    /// Direction of the largest, a unit vector.
    pub direction: Vec2,
}

impl Conductivity {
    /// Isotropic conductivity; zero is undrained.
    pub fn isotropic(value: f64) -> Self {
        Self { major: value, minor: value, direction: Vec2::new(1.0, 0.0) }
    }

    /// Whether it is the same in all directions.
    pub fn is_isotropic(&self) -> bool {
        self.major == self.minor
    }

    /// The tensor `k` of Eq. 3, m/s.
    pub fn tensor(&self) -> Mat2 {
        Mat2::identity() * self.minor
            + self.direction * self.direction.transpose() * (self.major - self.minor)
    }

    fn validate(&self) -> Result<(), SolverError> {
        let allowed = self.minor >= 0.0 && self.major >= self.minor && self.major.is_finite();
        if !allowed || (self.minor == 0.0 && self.major > 0.0) {
            let (name, value) = ("hydraulic_conductivity", self.minor);
            let expected = "positive in every direction with the largest first, or zero in all";
            return Err(SolverError::InvalidInput { name, value, expected });
        }
        if !((self.direction.norm() - 1.0).abs() < DIRECTION_TOLERANCE) {
            let (name, value) = ("hydraulic_conductivity.direction", self.direction.norm());
            return Err(SolverError::InvalidInput { name, value, expected: "a unit vector" });
        }
        Ok(())
    }
}

/// Tolerance on the length of a direction, for rounding.
const DIRECTION_TOLERANCE: f64 = 1e-9;
/// One region: a soil with its densities and conductivity.
#[derive(Debug, Clone, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Region {
    /// The soil model.
    pub soil: Soil,
    /// Porosity at the start, in (0, 1).
    pub porosity: f64,
    /// Density of the solid grains, Mg/m3.
    pub solid_density: f64,
    /// Hydraulic conductivity; zero is undrained.
    pub hydraulic_conductivity: Conductivity,
    /// Water retention above the water table; `None`: always saturated.
    pub retention: Option<VanGenuchten>,
    /// Earth pressure coefficient of the initial geostatic stress.
    pub earth_pressure_coefficient: f64,
    /// Poisson's ratio of the static stage; `K0 / (1 + K0)` keeps the earth pressure coefficient.
    pub static_poisson_ratio: f64,
}

/// Pore water.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Water {
    /// Unit weight, kN/m3.
    pub unit_weight: f64,
    /// Bulk modulus, kPa.
    pub bulk_modulus: f64,
}

/// The two sets of spatial operators.
#[derive(Debug, Clone, Copy, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
pub enum Operators {
    /// Least-squares gradient at the stress nodes and its exact transpose as force.
    Conservative,
    /// The same with one stress point a node, at the corners of the cells, and one measure of volume for soil and
    /// water.
    Dual,
    /// The paper's Eqs 6 and 8 to 11 with the corrections named in the theory page.
    Printed,
}

/// How pore pressure diffuses in time.
#[derive(Debug, Clone, Copy, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
pub enum Diffusion {
    /// Implicit if that allows a longer time step, else explicit.
    Auto,
    /// Backward Euler on the pressure alone.
    Implicit,
    /// Forward Euler; limits the time step.
    Explicit,
}

/// The acceleration term of Eq. 7.
#[derive(Debug, Clone, Copy, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
pub enum AccelerationTerm {
    /// On with explicit diffusion and moderate conductivity.
    Auto,
    /// Always on (explicit diffusion only).
    On,
    /// Always off.
    Off,
}

/// Numerical choices.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Numerics {
    /// Spatial operators.
    pub operators: Operators,
    /// Smoothing length over particle spacing.
    pub smoothing_ratio: f64,
    /// Strength `xi` of the velocity filter.
    pub velocity_filter: f64,
    /// Pore-pressure diffusion.
    pub diffusion: Diffusion,
    /// Acceleration term of Eq. 7.
    pub acceleration_term: AccelerationTerm,
    /// Whether inertia is corrected so that short waves are as fast as long ones (conservative operators
    /// only).
    pub dispersion_correction: bool,
    /// Strain at which lists and weights are rebuilt; `None`: the default of the operators.
    pub geometry_strain_limit: Option<f64>,
    /// Integrator of the sand model.
    pub integrator: sandboil_soil::Integrator,
}

impl Numerics {
    /// Strain at which lists and weights are rebuilt. The conservative operators account for the deformation
    /// and need a rebuild only for new neighbours; the error of the printed ones is as large as the strain.
    pub fn geometry_strain_limit(&self) -> f64 {
        self.geometry_strain_limit.unwrap_or(match self.operators {
            Operators::Conservative | Operators::Dual => 0.2,
            Operators::Printed => 0.02,
        })
    }
}

/// A complete description of the section.
#[derive(Debug, Clone, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Model {
    /// Particle spacing in x and y, m.
    pub spacing: Vec2,
    /// Velocity nodes, m.
    pub position: Vec<Vec2>,
    /// Volume of each node per unit thickness, m2: a cell of the lattice, or what remains of it above a base
    /// that cuts it.
    pub volume: Vec<f64>,
    /// Region of each velocity node.
    pub region: Vec<u32>,
    /// The regions.
    pub regions: Vec<Region>,
    /// Elevation of the ground surface above each velocity node, m.
    pub surface_elevation: Vec<f64>,
    /// Vertical effective stress of the initial geostatic state at each stress point, kPa, compression
    /// positive, in the order of [`stress_positions`](crate::stress_positions).
    pub vertical_effective_stress: Vec<f64>,
    /// Pore pressure at rest at each velocity node, kPa, negative in suction; read only when there is water.
    pub pore_pressure: Vec<f64>,
    /// Degree of saturation at rest of each velocity node; empty if all pores are full.
    pub saturation: Vec<f64>,
    /// Pore water, if the section has any.
    pub water: Option<Water>,
    /// Gravity, m/s2.
    pub gravity: f64,
    /// Width of the periodic section, if its sides are periodic.
    pub period: Option<Period>,
    /// Base and sides.
    pub outline: Outline,
    /// Numerical choices.
    pub numerics: Numerics,
}

/// Offset of a node's first stress node; the second is on the opposite side (Section 3, Fig. 1).
pub fn stress_node_offset(spacing: Vec2) -> Vec2 {
    spacing * (STRESS_NODE_DISTANCE * std::f64::consts::FRAC_1_SQRT_2)
}

impl Model {
    /// Whether a base is level and half a row below the lowest nodes.
    pub fn is_even_on(&self, outline: &Outline) -> bool {
        let cell = self.cell();
        outline.relief() <= EVEN * self.spacing.y
            && self.volume.iter().all(|volume| (volume - cell).abs() <= EVEN * cell)
    }

    /// Whether pore water has its pressure at the nodes, and not at the corners of cells.
    pub fn has_nodal_water(&self) -> bool {
        self.water.is_some() && self.numerics.operators != Operators::Dual
    }

    /// Number of velocity nodes.
    pub fn nodes(&self) -> usize {
        self.position.len()
    }

    /// Particle spacing where a single value is needed, m: the side of a square as large as a cell.
    pub fn mean_spacing(&self) -> f64 {
        self.cell().sqrt()
    }

    /// Volume of a cell of the lattice per unit thickness, m2.
    pub fn cell(&self) -> f64 {
        self.spacing.x * self.spacing.y
    }

    /// Smoothing length, m.
    pub fn smoothing_length(&self) -> f64 {
        self.numerics.smoothing_ratio * self.mean_spacing()
    }

    /// Mixture density of a region, Mg/m3: `(1 - n) rho_s + n rho_f`, dry without water.
    pub fn mixture_density(&self, region: usize) -> f64 {
        let Region { porosity, solid_density, .. } = self.regions[region];
        let water = self.water.map_or(0.0, |water| porosity * water.unit_weight / self.gravity);
        (1.0 - porosity) * solid_density + water
    }

    /// Degree of saturation of a node.
    pub fn saturation(&self, node: usize) -> f64 {
        self.saturation.get(node).copied().unwrap_or(1.0)
    }

    /// Part of the pore pressure at rest that enters the effective stress by Bishop, `S_r p`, kPa.
    pub fn neutral_stress(&self) -> Vec<f64> {
        self.pore_pressure.iter().enumerate().map(|(node, p)| self.saturation(node) * p).collect()
    }

    /// Stiffness `K_f / n` of the pore water in undrained compression, kPa; zero without water.
    pub fn water_stiffness(&self, porosity: f64) -> f64 {
        self.water.map_or(0.0, |water| water.bulk_modulus / porosity)
    }

    /// Pressure diffusivity `kappa = k / C` of a region for one of its principal conductivities, m2/s, with
    /// the storage `C = n gamma_f / K_f` of Eq. 3.
    pub fn pressure_diffusivity(&self, region: usize, principal: impl Fn(Conductivity) -> f64) -> f64 {
        self.water.map_or(0.0, |water| {
            let Region { hydraulic_conductivity, porosity, .. } = self.regions[region];
            principal(hydraulic_conductivity) * self.water_stiffness(porosity) / water.unit_weight
        })
    }

    /// Checks every array and number, except the number of values at stress points.
    ///
    /// # Errors
    /// [`SolverError::Shape`] or [`SolverError::InvalidInput`] for the first error found.
    pub fn validate(&self) -> Result<(), SolverError> {
        let nodes = self.nodes();
        let shapes = [
            ("volume", self.volume.len(), nodes),
            ("region", self.region.len(), nodes),
            ("surface_elevation", self.surface_elevation.len(), nodes),
            ("pore_pressure", self.pore_pressure.len(), if self.water.is_some() { nodes } else { 0 }),
            ("saturation", self.saturation.len(), if self.saturation.is_empty() { 0 } else { nodes }),
        ];
        for (name, found, expected) in shapes {
            if found != expected {
                return Err(SolverError::Shape { name, found, expected });
            }
        }
        positive("nodes", nodes as f64)?;
        positive("spacing.x", self.spacing.x)?;
        positive("spacing.y", self.spacing.y)?;
        for &volume in &self.volume {
            positive("volume", volume)?;
        }
        positive("gravity", self.gravity)?;
        positive("smoothing_ratio", self.numerics.smoothing_ratio)?;
        positive("geometry_strain_limit", self.numerics.geometry_strain_limit())?;
        if self.numerics.dispersion_correction && self.numerics.operators == Operators::Printed {
            return Err(SolverError::InvalidInput {
                name: "dispersion_correction",
                value: 1.0,
                expected: "left out with the printed operators, whose force is not the transpose of their strain",
            });
        }
        if let Some(water) = self.water {
            positive("water.unit_weight", water.unit_weight)?;
            positive("water.bulk_modulus", water.bulk_modulus)?;
        }
        if let Some(period) = self.period {
            positive("period", period.width)?;
        }
        self.outline.validate()?;
        for region in &self.regions {
            // Dry soil that is given by its unit weight has porosity zero; a section with water needs pores.
            let least = if self.water.is_some() { f64::MIN_POSITIVE } else { 0.0 };
            if !(region.porosity >= least && region.porosity < 1.0) {
                let expected = "in (0, 1), zero only in a dry section";
                return Err(SolverError::InvalidInput { name: "porosity", value: region.porosity, expected });
            }
            positive("solid_density", region.solid_density)?;
            positive("earth_pressure_coefficient", region.earth_pressure_coefficient)?;
            region.hydraulic_conductivity.validate()?;
        }
        if let Some(&region) = self.region.iter().find(|&&region| region as usize >= self.regions.len()) {
            let (name, value) = ("region", f64::from(region));
            return Err(SolverError::InvalidInput { name, value, expected: "an index of the regions" });
        }
        finite("position", self.position.iter().flat_map(|x| [x.x, x.y]))?;
        finite("surface_elevation", self.surface_elevation.iter().copied())?;
        finite("vertical_effective_stress", self.vertical_effective_stress.iter().copied())?;
        finite("pore_pressure", self.pore_pressure.iter().copied())?;
        match self.saturation.iter().find(|share| !(0.0..=1.0).contains(*share)) {
            Some(&value) => {
                Err(SolverError::InvalidInput { name: "saturation", value, expected: "in [0, 1]" })
            }
            None => Ok(()),
        }
    }
}

/// Refuses a value that is not positive and finite.
pub(crate) fn positive(name: &'static str, value: f64) -> Result<(), SolverError> {
    if value.is_finite() && value > 0.0 {
        Ok(())
    } else {
        Err(SolverError::InvalidInput { name, value, expected: "positive" })
    }
}

fn finite(name: &'static str, mut values: impl Iterator<Item = f64>) -> Result<(), SolverError> {
    match values.find(|value| !value.is_finite()) {
        Some(value) => Err(SolverError::InvalidInput { name, value, expected: "finite" }),
        None => Ok(()),
    }
}
