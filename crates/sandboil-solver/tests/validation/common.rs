//! Columns that several test files use.

use sandboil_soil::{Integrator, Soil, elastic::Elastic};
use sandboil_solver::{
    AccelerationTerm, Base, Conductivity, Diffusion, MOVING_FACTOR, Model, Numerics, Operators, Outline,
    Output, Region, Shaking, UpgoingWave, Water, stress_node_offset, stress_positions,
};
use sandboil_sph::{Period, Vec2};

/// Numerical choices of the default set.
pub fn numerics() -> Numerics {
    Numerics {
        operators: Operators::Conservative,
        smoothing_ratio: 1.4,
        velocity_filter: 0.2,
        diffusion: Diffusion::Auto,
        acceleration_term: AccelerationTerm::Auto,
        dispersion_correction: false,
        geometry_strain_limit: None,
        integrator: Integrator::default(),
    }
}

/// A uniform column on periodic sides, `columns` nodes wide, surface at `height`, base at zero.
pub fn column(height: f64, spacing: f64, columns: usize, region: Region, water: Option<Water>) -> Model {
    let rows = (height / spacing).round() as usize;
    let position: Vec<Vec2> = (0..rows * columns)
        .map(|k| Vec2::new((k % columns) as f64 + 0.5, (k / columns) as f64 + 0.5) * spacing)
        .collect();
    let gravity = 9.81;
    let unit_weight = water.map_or(0.0, |w| w.unit_weight);
    let bulk = (1.0 - region.porosity) * region.solid_density * gravity + region.porosity * unit_weight;
    let offset = stress_node_offset(Vec2::repeat(spacing));
    let effective = |x: Vec2| (bulk - unit_weight) * (height - x.y);
    Model {
        spacing: Vec2::repeat(spacing),
        volume: vec![spacing * spacing; position.len()],
        region: vec![0; position.len()],
        surface_elevation: vec![height; position.len()],
        vertical_effective_stress: position
            .iter()
            .flat_map(|&x| [effective(x + offset), effective(x - offset)])
            .collect(),
        saturation: Vec::new(),
        pore_pressure: match water {
            Some(water) => position.iter().map(|x| water.unit_weight * (height - x.y)).collect(),
            None => Vec::new(),
        },
        position,
        regions: vec![region],
        water,
        gravity,
        period: Some(Period { width: columns as f64 * spacing }),
        outline: Outline::level(0.0),
        numerics: numerics(),
    }
}

/// The same column, or another section of one soil under level ground, on the dual lattice with its default numerics.
pub fn dual(mut model: Model) -> Model {
    let Region { porosity, solid_density, .. } = model.regions[0];
    // Under water the soil weighs its buoyant weight.
    let density = model.water.map_or(0.0, |water| water.unit_weight / model.gravity);
    let weight = (1.0 - porosity) * (solid_density - density) * model.gravity;
    model.numerics.operators = Operators::Dual;
    model.numerics.smoothing_ratio = 1.2;
    model.numerics.velocity_filter = 0.5;
    let surface = model.surface_elevation[0];
    model.vertical_effective_stress =
        stress_positions(&model).iter().map(|at| weight * (surface - at.y)).collect();
    model
}

/// Linear elastic soil of mixture density 2 Mg/m3 when dry.
pub fn elastic(shear_modulus: f64, bulk_modulus: f64) -> Region {
    Region {
        soil: Soil::Elastic(Elastic::new(shear_modulus, bulk_modulus).unwrap()),
        porosity: 0.4,
        solid_density: 2.0 / 0.6,
        hydraulic_conductivity: Conductivity::isotropic(0.0),
        retention: None,
        earth_pressure_coefficient: 0.5,
        static_poisson_ratio: 1.0 / 3.0,
    }
}

/// A shaking stage without damping, envelopes or stress histories; histories at `probes` every millisecond.
pub fn shaking(wave: Option<UpgoingWave>, duration: f64, probes: Vec<Vec2>) -> Shaking {
    Shaking {
        duration,
        base: Base::shaken_by(wave),
        free_field: [false; 2],
        column_records: [None, None],
        local_damping: 0.0,
        rayleigh: None,
        time_step_factor: MOVING_FACTOR,
        conditions: Vec::new(),
        output: Output { probes, history_interval: 0.001, ..Output::default() },
    }
}
