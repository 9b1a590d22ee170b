//! The limit of the time step against steps that are really made: elastic ground that starts with random
//! velocities is stable just below the limit, and unstable well above it.

use crate::{
    error::SolverError,
    run::{neighbour::Alone, simulation::Driver},
    section::{
        description::{AccelerationTerm, Conductivity, Diffusion, Model, Operators, Water},
        outline::{Outline, Side, Support},
        stress_layout::stress_positions,
    },
    skeleton::spectrum_tests::disordered,
    testing::{held_stage, square_block},
};
use sandboil_soil::{Soil, elastic::Elastic};
use sandboil_sph::Period;

/// Steps in which a growing mode becomes visible.
const STEPS: u64 = 3000;
/// Factors of the limit at which ground must be stable and unstable.
const STABLE: f64 = 0.97;
/// See [`STABLE`].
const UNSTABLE: f64 = 1.45;
/// Speed that ground that starts at 1 mm/s reaches only by growing modes, m/s.
const BOUND: f64 = 0.1;
const SIDE: usize = 8;

/// Where a section is held.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Held {
    /// Nowhere.
    Free,
    /// On a rough base.
    Base,
    /// On a rough base and between smooth sides.
    Sides,
    /// On a smooth base between periodic sides.
    Periodic,
}

#[derive(Debug, Clone, Copy)]
struct Case {
    held: Held,
    disorder: f64,
    poisson: f64,
    /// `K_f / n` over the confined modulus of the soil; zero: dry.
    water: f64,
    /// Diffusivity of the pore pressure, in spacings times wave speeds.
    diffusivity: f64,
    diffusion: Diffusion,
    acceleration_term: AccelerationTerm,
    ratio: f64,
    filter: f64,
    /// Whether inertia is corrected for dispersion.
    is_corrected: bool,
}

const DRY: Case = Case {
    held: Held::Free,
    disorder: 0.0,
    poisson: 0.3,
    water: 0.0,
    diffusivity: 0.0,
    diffusion: Diffusion::Auto,
    acceleration_term: AccelerationTerm::Off,
    ratio: 1.2,
    filter: 0.0,
    is_corrected: false,
};

fn section(case: Case) -> Model {
    let mut model = if case.disorder > 0.0 { disordered(SIDE, case.disorder) } else { square_block(SIDE) };
    model.numerics.operators = Operators::Dual;
    model.numerics.smoothing_ratio = case.ratio;
    model.numerics.velocity_filter = case.filter;
    model.numerics.dispersion_correction = case.is_corrected;
    model.numerics.diffusion = case.diffusion;
    model.numerics.acceleration_term = case.acceleration_term;
    model.regions[0].soil = Soil::Elastic(Elastic::from_poisson(1e4, case.poisson).unwrap());
    let end = SIDE as f64 - 0.5;
    model.surface_elevation = vec![end; SIDE * SIDE];
    if case.held != Held::Free {
        model.outline = Outline::level(-0.5);
    }
    if case.held == Held::Sides {
        let side = |x: f64| Some(Side { x, extent: [-0.5, end], support: Support::FreeSlip });
        model.outline.sides = [side(-0.5), side(end)];
    }
    if case.held == Held::Periodic {
        model.outline.base_support = Support::FreeSlip;
        model.period = Some(Period { width: SIDE as f64 });
    }
    let confined = 2e4 * (1.0 - case.poisson) / (1.0 - 2.0 * case.poisson);
    if case.water > 0.0 {
        let bulk_modulus = 0.5 * case.water * confined;
        model.water = Some(Water { unit_weight: 10.0, bulk_modulus });
        model.pore_pressure = model.position.iter().map(|x| 10.0 * (end - x.y)).collect();
        // kappa = k K_f / (n gamma_f), in units of the spacing times the compression-wave speed of the skeleton.
        let speed = (confined / model.mixture_density(0)).sqrt();
        let conductivity = case.diffusivity * speed * 10.0 / (2.0 * bulk_modulus);
        model.regions[0].hydraulic_conductivity = Conductivity::isotropic(conductivity);
    }
    model.vertical_effective_stress = vec![0.0; stress_positions(&model).len()];
    model
}

/// Largest speed after a number of steps at a factor of the limit, from random velocities of 1 mm/s; infinite if the run
/// diverges.
fn speed_after(case: Case, factor: f64) -> f64 {
    let model = section(case);
    let mut driver = Driver::<Alone>::new(&model, 1).unwrap();
    driver.begin(held_stage(0.0, factor)).unwrap();
    let random = |k: usize| 1e-3 * (1e4 * (0.618_034 * k as f64 + 0.1).sin()).sin();
    let velocity: Vec<[f64; 2]> = (0..model.nodes()).map(|k| [random(2 * k), random(2 * k + 1)]).collect();
    driver.set_velocity(&velocity).unwrap();
    match driver.advance(STEPS, f64::INFINITY) {
        Ok(_) => driver.velocity().iter().flatten().fold(0.0, |most, v| v.abs().max(most)),
        Err(SolverError::Diverged { .. } | SolverError::Soil { .. }) => f64::INFINITY,
        Err(other) => panic!("{other}"),
    }
}

/// Stable just below the limit, unstable well above it.
fn is_sharp(case: Case) {
    let [stable, unstable] = [STABLE, UNSTABLE].map(|factor| speed_after(case, factor));
    println!("{case:?}: {stable:.1e} m/s at {STABLE}, {unstable:.1e} m/s at {UNSTABLE}");
    assert!(stable < BOUND, "{case:?}: {stable}");
    assert!(unstable > BOUND, "{case:?}: {unstable}");
}

const HELD: [Held; 4] = [Held::Free, Held::Base, Held::Sides, Held::Periodic];

/// Elastic ground, dry and undrained, free and held, of ordered and of disordered nodes, with and without filter.
#[test]
fn waves() {
    for held in HELD {
        for disorder in [0.0, 0.1] {
            for poisson in [0.0, 0.3, 0.48] {
                for water in [0.0, 20.0] {
                    let case = Case { held, disorder, poisson, water, ..DRY };
                    is_sharp(case);
                    is_sharp(Case { filter: 0.5, disorder: 0.0, ..case });
                }
            }
        }
    }
}

/// Other smoothing lengths are stable; the limit of the widest is shorter than it could be.
#[test]
fn smoothing_lengths() {
    for ratio in [1.0, 1.4, 1.6] {
        for held in [Held::Free, Held::Sides] {
            for water in [0.0, 20.0] {
                let case = Case { ratio, held, water, poisson: 0.48, ..DRY };
                let speed = speed_after(case, STABLE);
                assert!(speed < BOUND, "{case:?}: {speed}");
            }
        }
    }
}

/// With corrected inertia, which ground that moves far does not have, ground is stable, too, with and without the filter,
/// also on a wide kernel.
#[test]
fn corrected_inertia() {
    for held in HELD {
        for disorder in [0.0, 0.02] {
            for (poisson, water) in [(0.0, 0.0), (0.3, 0.0), (0.48, 0.0), (0.3, 20.0)] {
                for (ratio, filter) in [(1.0, 0.0), (1.2, 0.0), (1.2, 0.5), (1.4, 0.0)] {
                    let case =
                        Case { held, disorder, poisson, water, ratio, filter, is_corrected: true, ..DRY };
                    let speed = speed_after(case, STABLE);
                    assert!(speed < BOUND, "{case:?}: {speed}");
                }
            }
        }
    }
}

/// With the acceleration term of Eq. 7 ground is stable up to the conductivities for which the numerics choose it.
#[test]
fn acceleration_term() {
    for diffusivity in [0.01, 0.1, 1.0, 10.0] {
        for held in HELD {
            for disorder in [0.0, 0.1] {
                let (diffusion, acceleration_term) = (Diffusion::Explicit, AccelerationTerm::On);
                let case =
                    Case { held, disorder, diffusion, diffusivity, acceleration_term, water: 20.0, ..DRY };
                let speed = speed_after(case, STABLE);
                println!("{case:?}: {speed:.1e}");
                assert!(speed < BOUND, "{case:?}: {speed}");
            }
        }
    }
}

/// Water that drains within a million steps and within a hundredth of one.
#[test]
fn drainage() {
    for diffusion in [Diffusion::Explicit, Diffusion::Implicit] {
        for diffusivity in [0.01, 0.1, 1.0, 10.0, 100.0, 1e4] {
            for held in HELD {
                for disorder in [0.0, 0.1] {
                    is_sharp(Case { held, disorder, diffusion, diffusivity, water: 20.0, ..DRY });
                }
            }
        }
    }
}
