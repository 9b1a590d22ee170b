//! Switches between stages: the state after gravity, the start of the compliant base without motion, and
//! further stages of shaking.

use crate::common::{column, elastic, shaking};
use sandboil_soil::{
    Soil, Strength,
    elastic::Elastic,
    mohr_coulomb::MohrCoulomb,
    pm4sand::{Options, PM4Sand, Parameters},
};
use sandboil_solver::{
    Conductivity, Gravity, HalfSpace, Model, Operators, Rayleigh, Simulation, SolverError, UpgoingWave, Water,
};
use std::f64::consts::PI;

const HEIGHT: f64 = 10.0;
const SPACING: f64 = 0.4;
const GRAVITY_STAGE: Gravity = Gravity { tolerance: 1e-5, max_steps: 20_000 };
const WATER: Water = Water { unit_weight: 10.0, bulk_modulus: 1e6 };

fn sand_column(operators: Operators) -> Model {
    let mut region = elastic(1.0, 1.0);
    let parameters = Parameters { dr: 0.55, g0: 677.0, hpo: 0.4, ..Parameters::default() };
    region.soil = Soil::PM4Sand(Box::new(PM4Sand::new(parameters, Options::default()).unwrap()));
    region.hydraulic_conductivity = Conductivity::isotropic(1e-3);
    let mut model = column(HEIGHT, SPACING, 1, region, Some(WATER));
    model.numerics.operators = operators;
    model
}

/// The same column between an elastic crust and an elastic subsoil, with corrected inertia and hence sharp
/// contacts.
fn layered_sand_column(crust: f64) -> Model {
    let mut model = sand_column(Operators::Conservative);
    for (region, x) in model.region.iter_mut().zip(&model.position) {
        *region = if x.y > 0.7 * HEIGHT { 1 } else { 2 * u32::from(x.y < 0.3 * HEIGHT) };
    }
    for shear_modulus in [crust, 2e5] {
        model.regions.push(elastic(shear_modulus, 2.0 * shear_modulus));
    }
    model.numerics.dispersion_correction = true;
    model
}

/// The section after the gravity stage.
pub fn at_rest(model: &Model) -> Simulation {
    let mut simulation = Simulation::new(model, 1).unwrap();
    simulation.begin(GRAVITY_STAGE).unwrap();
    assert!(simulation.advance(u64::MAX, f64::INFINITY).unwrap());
    simulation
}

/// The column does not move on dashpots for 100 s: stored reactions include the whole residual, to the last
/// bit.
#[test]
fn nothing_moves_after_the_switch_to_the_compliant_base() {
    const DAMPING: Rayleigh = Rayleigh { ratio: 0.005, frequencies: [1.0, 10.0] };
    for (name, model, rayleigh) in [
        ("conservative", sand_column(Operators::Conservative), None),
        ("damped", sand_column(Operators::Conservative), Some(DAMPING)),
        ("layered, corrected", layered_sand_column(5e3), Some(DAMPING)),
        ("printed", sand_column(Operators::Printed), None),
    ] {
        let mut simulation = at_rest(&model);
        let before = simulation.displacement();
        let mut stage = shaking(None, 100.0, Vec::new());
        stage.rayleigh = rayleigh;
        simulation.begin(stage).unwrap();
        assert!(simulation.advance(u64::MAX, f64::INFINITY).unwrap());
        let moved = simulation
            .displacement()
            .iter()
            .zip(&before)
            .map(|(now, then)| (now[0] - then[0]).hypot(now[1] - then[1]))
            .fold(0.0, f64::max);
        println!("{name}: {moved:e} m after 100 s, {} steps", simulation.step());
        assert!(moved < 1e-9, "{moved}");
    }
}

/// Geostatic stress relaxes to a state that differs from the exact one only by the weights of the outer rows.
#[test]
fn gravity_keeps_the_geostatic_state() {
    let mut model = column(20.0, 0.2, 1, elastic(8e4, 2.4e5), Some(WATER));
    for region in &mut model.regions {
        region.static_poisson_ratio = 1.0 / 3.0;
    }
    let simulation = at_rest(&model);
    // Unit weight under water times spacing: the stress step from row to row.
    let step = (model.mixture_density(0) * model.gravity - WATER.unit_weight) * model.spacing.y;
    let exact = &model.vertical_effective_stress;
    let errors: Vec<f64> =
        simulation.stress().iter().flatten().zip(exact).map(|(s, e)| (-s[1] - e) / step).collect();
    let rms = (errors.iter().map(|e| e * e).sum::<f64>() / errors.len() as f64).sqrt();
    println!("rms {rms:.3} rho' g dx, {} steps", simulation.step());
    assert!(rms < 0.15, "{rms}");
    assert!(simulation.step() < 600);
}

/// The same shaking in one stage or in two gives the same result.
#[test]
fn a_second_shaking_stage_continues_the_first() {
    const INTERVAL: f64 = 1e-3;
    const HALF: f64 = 1.0;
    let wave = |from: f64| {
        let velocity = |k: u32| 0.2 * (4.0 * PI * (from + f64::from(k) * INTERVAL)).sin();
        UpgoingWave::shear(INTERVAL, (0..1000).map(velocity).collect())
    };
    let whole = UpgoingWave::shear(INTERVAL, [wave(0.0).horizontal, wave(HALF).horizontal].concat());
    let shaken = |stages: &[(UpgoingWave, f64)]| {
        let mut simulation = at_rest(&sand_column(Operators::Conservative));
        for (wave, duration) in stages {
            let mut stage = shaking(Some(wave.clone()), *duration, Vec::new());
            stage.base.half_space =
                Some(HalfSpace { shear_speed: 200.0, compression_speed: None, density: 2.0 });
            simulation.begin(stage).unwrap();
            assert!(simulation.advance(u64::MAX, f64::INFINITY).unwrap());
        }
        simulation
    };
    let one = shaken(&[(whole, 2.0 * HALF)]);
    let two = shaken(&[(wave(0.0), HALF), (wave(HALF), HALF)]);
    let (p, q) = (one.excess_pore_pressure().unwrap(), two.excess_pore_pressure().unwrap());
    let largest = p.iter().copied().fold(0.0, f64::max);
    let apart = p.iter().zip(&q).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
    println!("excess pore pressure up to {largest:.1} kPa, difference {apart:.2} kPa");
    assert!(largest > 10.0 && apart < 0.02 * largest, "{largest} {apart}");
}

/// Sand that liquefies under a soft or stiff crust becomes softer than its sharp contacts assume: waves stay
/// bounded, and pore pressure is that without sharp contacts.
#[test]
fn sharp_contacts_are_stable_in_liquefaction() {
    for crust in [5e3, 1e5] {
        let shaken = |corrected: bool| {
            let mut model = layered_sand_column(crust);
            model.numerics.dispersion_correction = corrected;
            let mut simulation = at_rest(&model);
            let velocity = |k: u32| 0.2 * (4.0 * PI * 1e-3 * f64::from(k)).sin();
            let wave = UpgoingWave::shear(1e-3, (0..3000).map(velocity).collect());
            let mut stage = shaking(Some(wave), 5.0, Vec::new());
            stage.rayleigh = Some(Rayleigh { ratio: 0.005, frequencies: [1.0, 10.0] });
            simulation.begin(stage).unwrap();
            let mut speed = 0.0_f64;
            while !simulation.advance(50, f64::INFINITY).unwrap() {
                speed = simulation.velocity().iter().fold(speed, |a, v| a.max(v[0].hypot(v[1])));
            }
            let left = simulation.velocity().iter().fold(0.0_f64, |a, v| a.max(v[0].hypot(v[1])));
            let excess = simulation.excess_pore_pressure().unwrap().into_iter().fold(0.0, f64::max);
            (speed, left, excess)
        };
        let (plain, sharp) = (shaken(false), shaken(true));
        println!("crust of {crust} kPa: {plain:.4?} plain, {sharp:.4?} sharp (m/s, m/s at the end, kPa)");
        assert!(sharp.0 < 1.3 * plain.0 && sharp.1 < 0.02 * sharp.0, "{plain:?} {sharp:?}");
        assert!((sharp.2 / plain.2 - 1.0).abs() < 0.05, "{plain:?} {sharp:?}");
    }
}

/// A step that is far too long is reported at the first excessive strain.
#[test]
fn a_diverging_sand_column_is_reported_at_once() {
    let mut simulation = at_rest(&sand_column(Operators::Conservative));
    let velocity = (0..2000).map(|k| 0.5 * (0.03 * f64::from(k)).sin()).collect();
    let mut stage = shaking(Some(UpgoingWave::shear(1e-3, velocity)), 2.0, Vec::new());
    stage.time_step_factor = 3.0;
    simulation.begin(stage).unwrap();
    let error = simulation.advance(u64::MAX, f64::INFINITY).unwrap_err();
    assert!(matches!(error, SolverError::Diverged { .. }), "{error}");
}

/// A state that is not finite is reported before it can be read or stored, also between the regular checks.
#[test]
fn a_state_that_is_not_finite_is_not_returned() {
    for lost in [f64::NAN, 1e5] {
        let region = elastic(4e4, 8e4);
        let mut simulation = at_rest(&column(HEIGHT, SPACING, 1, region, Some(WATER)));
        simulation.begin(shaking(None, 1.0, Vec::new())).unwrap();
        let mut velocity = vec![[0.0; 2]; simulation.nodes()];
        velocity[7][0] = lost;
        simulation.set_velocity(&velocity).unwrap();
        let error = simulation.advance(1, f64::INFINITY).unwrap_err();
        let SolverError::Diverged { quantity, step: 1, .. } = error else { panic!("{error}") };
        assert_eq!(quantity, "velocity");
    }
}

/// Envelopes hold the largest value over all steps, not only over steps with output.
#[test]
fn envelopes_include_every_step() {
    let mut simulation = at_rest(&sand_column(Operators::Conservative));
    let velocity = (0..500).map(|k| 0.3 * (0.02 * f64::from(k)).sin()).collect();
    let mut stage = shaking(Some(UpgoingWave::shear(1e-3, velocity)), 0.5, Vec::new());
    stage.output.pressure_envelope = true;
    stage.output.strain_envelope = true;
    simulation.begin(stage).unwrap();
    let mut pressure = simulation.excess_pore_pressure().unwrap();
    let mut strain = vec![0.0_f64; pressure.len()];
    while !simulation.is_complete() {
        // An envelope takes the state at the start of a step.
        for (largest, now) in pressure.iter_mut().zip(simulation.excess_pore_pressure().unwrap()) {
            *largest = largest.max(now);
        }
        for (largest, now) in strain.iter_mut().zip(simulation.strain()) {
            for [xx, yy, xy] in now {
                *largest = largest.max((xx - yy).hypot(xy));
            }
        }
        simulation.advance(1, f64::INFINITY).unwrap();
    }
    assert_eq!(simulation.largest_excess_pore_pressure().unwrap(), pressure);
    assert_eq!(simulation.largest_shear_strain().unwrap(), strain);
}

/// Low permeability: in a wide section, noise only decays. The node below the surface is tied to the one
/// under it; if its pressure exerted a force, waves would grow.
#[test]
fn noise_decays_in_a_wide_section_of_low_permeability() {
    const NOISE: f64 = 1e-4;
    for conductivity in [1e-9, 1e-6, 1e-4] {
        for smoothing_ratio in [1.2, 1.4] {
            let mut region = elastic(4e4, 8e4);
            region.hydraulic_conductivity = Conductivity::isotropic(conductivity);
            let mut model = column(6.0, 1.0, 24, region, Some(WATER));
            model.numerics.smoothing_ratio = smoothing_ratio;
            let mut simulation = at_rest(&model);
            simulation.begin(shaking(None, 4.0, Vec::new())).unwrap();
            // A fixed sequence of irregular values.
            let noise = |k: usize| NOISE * (12.9898 * (k as f64) + 78.233).sin();
            let velocity: Vec<[f64; 2]> =
                (0..model.nodes()).map(|k| [noise(2 * k), noise(2 * k + 1)]).collect();
            simulation.set_velocity(&velocity).unwrap();
            assert!(simulation.advance(u64::MAX, f64::INFINITY).unwrap());
            let size = |v: [f64; 2]| v[0].hypot(v[1]);
            let largest = simulation.velocity().into_iter().map(size).fold(0.0, f64::max);
            println!("k {conductivity} m/s, h/dx {smoothing_ratio}: {largest:.1e} m/s remain of {NOISE}");
            assert!(largest < 0.2 * NOISE, "{largest}");
        }
    }
}

/// Frictional ground at rest with a horizontal stress below the active one: at the start of shaking every
/// stress node takes the nearest stress that it can carry, and is counted.
#[test]
fn stresses_at_rest_that_the_soil_cannot_carry_are_counted() {
    for (phi, share) in [(35.0, 0.0), (10.0, 1.0)] {
        let mut region = elastic(1e4, 2e4);
        let strength = Strength { c: 0.0, phi, psi: 0.0 };
        let skeleton = Elastic::new(1e4, 2e4).unwrap();
        region.soil = Soil::MohrCoulomb(MohrCoulomb::new(skeleton, strength, None).unwrap());
        let model = column(HEIGHT, SPACING, 1, region, None);
        let mut simulation = at_rest(&model);
        assert_eq!(simulation.counters().inadmissible_starts, 0);
        simulation.begin(shaking(None, 1.0, Vec::new())).unwrap();
        let stress_nodes = 2.0 * model.position.len() as f64;
        assert_eq!(simulation.counters().inadmissible_starts as f64, share * stress_nodes, "{phi}");
    }
}

/// A soil that refuses the stress at the start of a stage is reported with the node in the user's order, which is not that of
/// the solver: the column below is numbered from above.
#[test]
fn a_refused_stress_is_reported_with_the_users_node() {
    let mut model = sand_column(Operators::Conservative);
    model.position.reverse();
    model.vertical_effective_stress.reverse();
    model.pore_pressure.reverse();
    model.regions[0].earth_pressure_coefficient = 1e10;
    let wrong = 3;
    model.vertical_effective_stress[2 * wrong] = 1e300;
    let mut simulation = Simulation::new(&model, 1).unwrap();
    let Err(SolverError::Soil { region: 0, node, .. }) = simulation.begin(shaking(None, 1.0, Vec::new()))
    else {
        panic!("the stress is not refused")
    };
    assert_eq!(node, wrong);
}
