//! Steps allocate no memory: their arrays are made when a stage begins.
#![allow(clippy::unwrap_used)] // a failure is the test's own report
#![allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // row counts of small columns

#[allow(dead_code, unused_imports)] // only a part of the shared helpers is used here
#[path = "validation/common.rs"]
mod common;

use allocation_counter::measure;
use common::{column, elastic, shaking};
use sandboil_soil::{
    Soil, VanGenuchten,
    pm4sand::{Options, PM4Sand, Parameters},
};
use sandboil_solver::{
    Conductivity, Diffusion, Gravity, HydraulicBoundary, HydraulicCondition, Model, MovingBoundary, Output,
    Rayleigh, Series, Shaking, Simulation, UpgoingWave, Vec2, Water,
};

const WATER: Water = Water { unit_weight: 10.0, bulk_modulus: 1e6 };
const WIDTH: f64 = 0.6;
const HEIGHT: f64 = 6.0;
/// Steps after which all arrays of the stage have been made.
const LEAD: u64 = 40;
/// Steps in which allocations are counted; they include several checks of the stability limit.
const COUNTED: u64 = 64;

fn sand(diffusion: Diffusion) -> Model {
    let mut region = elastic(8e4, 2.4e5);
    let parameters = Parameters { dr: 0.55, g0: 677.0, hpo: 0.4, ..Parameters::default() };
    region.soil = Soil::PM4Sand(Box::new(PM4Sand::new(parameters, Options::default()).unwrap()));
    region.hydraulic_conductivity = Conductivity::isotropic(1e-3);
    let mut model = column(HEIGHT, 0.2, 3, region, Some(WATER));
    model.numerics.diffusion = diffusion;
    model
}

fn stage() -> Shaking {
    let velocity = (0..2000).map(|k| 0.05 * (0.02 * f64::from(k)).sin()).collect();
    let stage = shaking(Some(UpgoingWave::shear(1e-3, velocity)), 10.0, vec![Vec2::new(0.3, 5.0)]);
    // Finished samples are stored: with this interval none is finished in the counted steps.
    let output = Output { history_interval: 1.0, ..stage.output };
    Shaking { output, ..stage }
}

fn allocations(model: &Model, stage: Shaking) -> u64 {
    let mut simulation = Simulation::new(model, 1).unwrap();
    simulation.begin(Gravity { tolerance: 1e-4, max_steps: 20_000 }).unwrap();
    simulation.advance(LEAD, f64::INFINITY).unwrap();
    let in_gravity = measure(|| drop(simulation.advance(COUNTED, f64::INFINITY))).count_total;
    simulation.begin(stage).unwrap();
    simulation.advance(LEAD, f64::INFINITY).unwrap();
    let shaken = measure(|| drop(simulation.advance(COUNTED, f64::INFINITY))).count_total;
    assert!(simulation.step() == LEAD + COUNTED);
    in_gravity + shaken
}

#[test]
fn steps_allocate_no_memory() {
    let drain = MovingBoundary {
        boundary: HydraulicBoundary {
            line: vec![Vec2::new(0.0, 3.0), Vec2::new(WIDTH, 3.0)],
            condition: HydraulicCondition::Drain,
        },
        at_rest: Some(0.0),
    };
    let pond = MovingBoundary {
        boundary: HydraulicBoundary {
            line: vec![Vec2::new(0.0, HEIGHT), Vec2::new(WIDTH, HEIGHT)],
            condition: HydraulicCondition::Reservoir(Series { time: vec![0.0, 1.0], value: vec![6.0, 7.0] }),
        },
        at_rest: Some(6.0),
    };
    let mut moist = sand(Diffusion::Explicit);
    let curve = VanGenuchten::new(3.0, 2.0, 0.1, 1.0).unwrap();
    moist.regions[0].retention = Some(curve);
    moist.pore_pressure = moist.position.iter().map(|x| WATER.unit_weight * (4.0 - x.y)).collect();
    moist.saturation =
        moist.pore_pressure.iter().map(|p| curve.at(p / WATER.unit_weight).saturation).collect();
    let mut corrected = sand(Diffusion::Explicit);
    corrected.numerics.dispersion_correction = true;
    let rayleigh = Some(Rayleigh { ratio: 0.01, frequencies: [1.0, 10.0] });
    let with = |conditions: Vec<MovingBoundary>| Shaking { conditions, ..stage() };
    for (name, model, stage) in [
        ("explicit", sand(Diffusion::Explicit), stage()),
        ("implicit", sand(Diffusion::Implicit), stage()),
        (
            "all histories",
            sand(Diffusion::Implicit),
            Shaking {
                output: Output {
                    stress_histories: true,
                    pressure_envelope: true,
                    strain_envelope: true,
                    ..stage().output
                },
                local_damping: 0.05,
                ..stage()
            },
        ),
        ("conditions", sand(Diffusion::Explicit), with(vec![drain.clone(), pond.clone()])),
        ("conditions, implicit", sand(Diffusion::Implicit), with(vec![drain, pond])),
        ("partly saturated", moist, stage()),
        ("Rayleigh damping", sand(Diffusion::Explicit), Shaking { rayleigh, ..stage() }),
        ("corrected inertia", corrected, stage()),
    ] {
        let counted = allocations(&model, stage);
        assert_eq!(counted, 0, "{name}");
    }
}
