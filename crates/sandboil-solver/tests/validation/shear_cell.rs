//! The shear cell of Section 6.1: its centre moves freely by the momentum equation, and stays homogeneous.

use crate::common::numerics;
use sandboil_soil::{
    Soil,
    elastic::Elastic,
    laboratory::{Resolution, Row},
    pm4sand::{Options, PM4Sand, Parameters},
};
use sandboil_solver::{CellTest, Numerics, ShearCell, SolverError};

const SHEAR_MODULUS: f64 = 2.0e4;
const TARGET: f64 = 0.2 * 100.0;

/// A small cell with 4 by 4 free nodes and stresses of 100 and 50 kPa.
fn test(soil: Soil) -> CellTest {
    CellTest {
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
        turn_limit: 5,
        resolution: Resolution::EVERY,
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

/// Runs to the end in one call.
fn finished(test: CellTest) -> ShearCell {
    let mut cell = ShearCell::new(test, 1).unwrap();
    while !cell.advance(1000).unwrap() {}
    cell
}

fn last(cell: &ShearCell) -> Row {
    *cell.record().rows().last().unwrap()
}

#[test]
fn an_elastic_centre_is_sheared_homogeneously_and_reversed_at_its_target() {
    let cell = finished(test(elastic()));
    // The only inhomogeneity is the stress profile by inertia, at most 0.002 of the mean stress.
    let inertia = 0.002 * 75.0;
    let largest = cell.largest_departure();
    assert!(largest.tau_spread < inertia);
    assert!(largest.gamma_spread < inertia / SHEAR_MODULUS);
    assert!(largest.volume_strain < inertia / SHEAR_MODULUS);
    let rows = cell.record().rows();
    assert_eq!(rows.len() as u64, cell.counters().steps + 1);
    let turns: Vec<&Row> =
        rows.windows(2).filter(|pair| pair[1].turns > pair[0].turns).map(|pair| &pair[1]).collect();
    assert_eq!(turns.len(), 5);
    // An overshoot of a thousandth is allowed; the inertia of the centre adds up to twice its static share,
    // as any sudden load does.
    let most = 1.001 * TARGET + 2.0 * inertia;
    for (k, row) in turns.into_iter().enumerate() {
        let sign = if k % 2 == 0 { 1.0 } else { -1.0 };
        let tau = sign * row.stress.xy;
        assert!((TARGET..most).contains(&tau), "{tau}");
        assert!((row.cycle - (0.25 + 0.5 * k as f64)).abs() < 1e-12, "{}", row.cycle);
    }
    let peak = (1.0 + largest.overshoot) * TARGET;
    assert!(peak < most, "{peak}");
}

/// At a constant rate the field stays linear to round-off at free nodes too: the edge of the block does not
/// affect them.
#[test]
fn at_a_constant_rate_the_field_is_linear_to_round_off() {
    // The largest rate is so slow that it is reached after a hundredth of the first loading.
    let test = CellTest { strain_step: 1e-8, inertia: 1e-6, ..test(elastic()) };
    let mut cell = ShearCell::new(test, 1).unwrap();
    cell.advance(400).unwrap();
    let (gamma, spread) = (last(&cell).strain[2], cell.departure().gamma_spread);
    assert!(gamma > 1e-7);
    assert!(spread < 1e-8 * gamma, "{spread} {gamma}");
}

/// A uniform stress of any size exerts no force on the free nodes: they do not move.
#[test]
fn a_uniform_stress_moves_nothing() {
    let mut cell = ShearCell::new(CellTest { strain_step: 1e-300, ..test(sand()) }, 1).unwrap();
    cell.advance(100).unwrap();
    let speed = cell.velocity().iter().flatten().map(|v| v.abs()).fold(0.0, f64::max);
    assert!(speed < 1e-13, "{speed}");
}

#[test]
fn sand_loses_its_confinement_and_its_centre_stays_homogeneous() {
    let cell = finished(test(sand()));
    let Row { stress, void_ratio, .. } = last(&cell);
    assert!(-stress.yy < 70.0, "{stress:?}");
    // The void ratio at D_r 0.35 between 0.8 and 0.5, at constant volume.
    assert!((void_ratio.unwrap() - 0.695).abs() < 1e-5, "{void_ratio:?}");
    let largest = cell.largest_departure();
    assert!(largest.tau_spread < 0.002 * 75.0 && largest.volume_strain < 2e-5, "{largest:?}");
}

#[test]
fn stress_nodes_that_do_not_act_on_free_nodes_change_no_bit() {
    let few = finished(test(sand()));
    let every = finished(CellTest { every_stress_node: true, ..test(sand()) });
    assert_eq!(few.record().rows(), every.record().rows());
    assert_eq!(few.position(), every.position());
    assert_eq!(every.computed_stress_nodes(), 2 * 14 * 14);
    assert!(few.computed_stress_nodes() < every.computed_stress_nodes());
    let counters = few.counters();
    assert_eq!(counters.plastic_updates, counters.steps * few.computed_stress_nodes() as u64);
}

#[test]
fn a_block_too_small_for_its_centre_is_refused() {
    let refused = ShearCell::new(CellTest { size: 0.24, ..test(sand()) }, 1);
    assert!(matches!(refused, Err(SolverError::InvalidInput { name: "size", .. })));
    let refused = ShearCell::new(CellTest { inertia: f64::NAN, ..test(sand()) }, 1);
    assert!(matches!(refused, Err(SolverError::InvalidInput { name: "inertia", .. })));
}
