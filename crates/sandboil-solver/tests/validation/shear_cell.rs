//! The shear cell of Section 6.1: its centre is as free as the momentum equation leaves it, and stays homogeneous.

use crate::common::numerics;
use sandboil_soil::{
    Soil,
    elastic::Elastic,
    pm4sand::{Options, PM4Sand, Parameters},
};
use sandboil_solver::{Numerics, Sample, ShearCell, ShearTest, SolverError};

const SHEAR_MODULUS: f64 = 2.0e4;
const TARGET: f64 = 0.2 * 100.0;

/// Small: 4 by 4 free nodes. Stresses 100 and 50 kPa.
fn test(soil: Soil) -> ShearTest {
    ShearTest {
        soil,
        void_ratio: None,
        density: 2.0,
        vertical_stress: 100.0,
        earth_pressure_coefficient: 0.5,
        stress_ratio: 0.2,
        size: 0.28,
        free_size: 0.08,
        spacing: 0.02,
        strain_step: 2e-5,
        inertia: 0.002,
        local_damping: 0.0,
        strain_limit: 0.05,
        cycle_limit: 2.0,
        every_stress_node: false,
        numerics: Numerics { velocity_filter: 1.0, ..numerics() },
    }
}

fn elastic() -> Soil {
    Soil::Elastic(Elastic::new(SHEAR_MODULUS, 2.0 * SHEAR_MODULUS).unwrap())
}

fn sand() -> Soil {
    let parameters = Parameters { dr: 0.35, g0: 476.0, hpo: 0.53, ..Parameters::default() };
    Soil::PM4Sand(Box::new(PM4Sand::new(parameters, Options::default()).unwrap()))
}

/// Runs to the end in one go.
fn finished(test: ShearTest) -> (ShearCell, Vec<Sample>) {
    let mut cell = ShearCell::new(test, 1).unwrap();
    while !cell.advance(1000).unwrap() {}
    let samples = cell.take_samples();
    (cell, samples)
}

/// Largest of a quantity over a test.
fn largest(samples: &[Sample], value: impl Fn(&Sample) -> f64) -> f64 {
    samples.iter().map(value).fold(0.0, f64::max)
}

#[test]
fn an_elastic_centre_is_sheared_homogeneously_and_reversed_at_its_target() {
    let (cell, samples) = finished(test(elastic()));
    // The inertial stress profile, of 0.002 of the mean stress at most, is all that is not homogeneous.
    let inertia = 0.002 * 75.0;
    assert!(largest(&samples, |s| s.tau_spread) < inertia);
    assert!(largest(&samples, |s| s.gamma_spread) < inertia / SHEAR_MODULUS);
    assert!(largest(&samples, |s| s.volume_strain) < inertia / SHEAR_MODULUS);
    assert_eq!(cell.turns().len(), 5);
    // A thousandth may be passed; the centre's inertia adds to it, and like any sudden load up to twice its share.
    let most = 1.001 * TARGET + 2.0 * inertia;
    for (k, &turn) in cell.turns().iter().enumerate() {
        let sign = if k % 2 == 0 { 1.0 } else { -1.0 };
        let tau = sign * samples[turn as usize].tau;
        assert!((TARGET..most).contains(&tau), "{tau}");
    }
    let peak = largest(&samples, |s| s.tau.abs());
    assert!(peak < most, "{peak}");
}

/// Nodes that are pushed no further keep a linear field to round-off, free ones included: the operators see no edge.
#[test]
fn at_a_steady_rate_the_centre_follows_to_round_off() {
    // So slow a largest rate that it is reached after a hundredth of the first loading.
    let test = ShearTest { strain_step: 1e-8, inertia: 1e-6, ..test(elastic()) };
    let mut cell = ShearCell::new(test, 1).unwrap();
    cell.advance(400).unwrap();
    let samples = cell.take_samples();
    let last = samples[samples.len() - 1];
    assert!(last.gamma > 1e-7);
    assert!(last.gamma_spread < 1e-8 * last.gamma, "{} {}", last.gamma_spread, last.gamma);
}

/// Uniform stress puts no force on the free nodes, whatever its size: they stay where they are.
#[test]
fn a_uniform_stress_moves_nothing() {
    let mut cell = ShearCell::new(ShearTest { strain_step: 1e-300, ..test(sand()) }, 1).unwrap();
    cell.advance(100).unwrap();
    let speed = cell.velocity().iter().flatten().map(|v| v.abs()).fold(0.0, f64::max);
    assert!(speed < 1e-13, "{speed}");
}

#[test]
fn sand_loses_its_confinement_and_its_centre_stays_homogeneous() {
    let (_, samples) = finished(test(sand()));
    let last = samples[samples.len() - 1];
    assert!(-last.vertical < 70.0, "{}", last.vertical);
    assert!(largest(&samples, |s| s.tau_spread) < 0.002 * 75.0);
    assert!(largest(&samples, |s| s.volume_strain) < 1e-5);
}

#[test]
fn soil_that_no_free_node_feels_changes_no_bit() {
    let (few, ours) = finished(test(sand()));
    let (every, theirs) = finished(ShearTest { every_stress_node: true, ..test(sand()) });
    assert_eq!(ours, theirs);
    assert_eq!(few.position(), every.position());
    assert_eq!(every.computed_stress_nodes(), 2 * 14 * 14);
    assert!(few.computed_stress_nodes() < every.computed_stress_nodes());
    let counters = few.counters();
    assert_eq!(counters.plastic_updates, counters.steps * few.computed_stress_nodes() as u64);
}

#[test]
fn a_block_whose_edge_the_centre_feels_is_refused() {
    let refused = ShearCell::new(ShearTest { size: 0.24, ..test(sand()) }, 1);
    assert!(matches!(refused, Err(SolverError::InvalidInput { name: "size", .. })));
    let refused = ShearCell::new(ShearTest { inertia: f64::NAN, ..test(sand()) }, 1);
    assert!(matches!(refused, Err(SolverError::InvalidInput { name: "inertia", .. })));
}
