use super::*;
use crate::{
    linear::banded::BandedLu,
    section::{
        description::{Conductivity, Water},
        edge_nodes::EdgeNodes,
        outline::{Condition, EdgesView, Outline, Side, Support, Walls},
        stress_layout::StressLayout,
    },
    testing::square_block,
    water::{
        conditions::{HydraulicBoundary, HydraulicCondition, Series},
        seepage::{Seepage, Until},
    },
    weights::geometry::Geometry,
};
use sandboil_soil::VanGenuchten;
use sandboil_sph::Period;

/// A section where it was drawn.
fn drawn<'a>(model: &'a Model, phases: &'a Phases, geometry: &'a Geometry, walls: Walls) -> SectionView<'a> {
    const NO_EDGES: &EdgeNodes = &EdgeNodes { base: Vec::new(), sides: [Vec::new(), Vec::new()] };
    SectionView {
        model,
        outline: &model.outline,
        walls,
        edges: NO_EDGES,
        position: &model.position,
        phases,
        layout: &StressLayout::Diagonal,
        points: &[],
        mass: &[],
        geometry,
        free_surface: None,
    }
}

fn flow_of(model: &Model, scheme: FlowScheme, conditions: &[MovingBoundary]) -> (Flow, Geometry) {
    let phases = Phases::new(model);
    let walls = Walls::shaken(&model.outline, Condition::VerticalRoller, [false; 2]);
    let edges = EdgesView { outline: &model.outline, walls };
    let geometry = Geometry::build(model, &model.position, &model.volume, edges);
    let section = drawn(model, &phases, &geometry, walls);
    let flow = Flow::new(section, scheme, conditions).unwrap().unwrap();
    (flow, geometry)
}

/// Steady flow up through two layers whose conductivities differ a thousandfold: the head falls in each by
/// Darcy's law for the flux that is fed in below.
#[test]
fn a_contact_of_two_soils_passes_the_flux() {
    const SIDE: usize = 20;
    const CONTRAST: f64 = 1e3;
    let mut model = square_block(SIDE);
    model.period = Some(Period { width: SIDE as f64 });
    model.outline = Outline::level(-0.5);
    model.surface_elevation = vec![SIDE as f64 - 0.5; model.nodes()];
    model.water = Some(Water { unit_weight: 1.0, bulk_modulus: 1.0 });
    model.pore_pressure = model.position.iter().map(|x| SIDE as f64 - 0.5 - x.y).collect();
    model.regions.push(model.regions[0].clone());
    for (region, conductivity) in model.regions.iter_mut().zip([1.0, 1.0 / CONTRAST]) {
        region.hydraulic_conductivity = Conductivity::isotropic(conductivity);
    }
    model.region = (0..model.nodes()).map(|node| u32::from(node >= model.nodes() / 2)).collect();
    let mut flow = flow_of(&model, FlowScheme::Explicit, &[]).0;
    // Storage so small that a step of one second is steady.
    flow.stiffness = vec![1e12; model.nodes()];
    let mut head = vec![0.0; model.nodes()];
    head[..SIDE].fill(1e12);
    let matrix = flow.implicit_matrix(flow.diffusion.as_ref().unwrap(), 1.0);
    BandedLu::factor(&matrix).unwrap().solve(&mut head);
    let fall = |from: usize, to: usize| (head[SIDE * from] - head[SIDE * to]) / (to - from) as f64;
    let (below, above) = (fall(2, 7), fall(12, 17));
    println!("gradients {below:.5} and {above:.3}, exact 1 and {CONTRAST}");
    assert!((below - 1.0).abs() < 5e-3 && (above / CONTRAST - 1.0).abs() < 5e-3);
    let exact = CONTRAST * (SIDE as f64 - 10.0) + (10.0 - 2.5);
    // The contact lies where it should to a tenth of a spacing.
    assert!((head[SIDE * 2] - exact).abs() < 0.1 * CONTRAST, "{} {exact}", head[SIDE * 2]);
}

/// A soil that is pressed together stiffens its pore water: `K_f / n` follows the porosity of a new geometry.
#[test]
fn water_stiffens_as_pores_close() {
    let mut model = square_block(3);
    model.water = Some(Water { unit_weight: 10.0, bulk_modulus: 8.0 });
    let mut phases = Phases::new(&model);
    let (mut flow, geometry) = flow_of(&model, FlowScheme::Undrained, &[]);
    assert_eq!(flow.stiffness[4], 8.0 / 0.5);
    let strained = StressPoint { strain: [0.0, -0.1, 0.0], ..StressPoint::default() };
    phases.update_volumes(&StressLayout::Diagonal, &vec![strained; STRESS_NODES * model.nodes()]);
    let walls = Walls::shaken(&model.outline, Condition::VerticalRoller, [false; 2]);
    flow.follow(drawn(&model, &phases, &geometry, walls), 0.0);
    let porosity = 1.0 - 0.5 * 0.1_f64.exp();
    assert!((flow.stiffness[4] - 8.0 / porosity).abs() < 1e-12);
}

/// Acceleration that spreads draws water apart: `dp/dt = (K_f/n) (k/g) div a`, where k is uniform.
#[test]
fn spreading_acceleration_raises_the_pressure() {
    const CONDUCTIVITY: f64 = 0.3;
    let mut model = square_block(9);
    model.surface_elevation = vec![1e3; model.nodes()];
    model.water = Some(Water { unit_weight: 10.0, bulk_modulus: 8.0 });
    model.regions[0].hydraulic_conductivity = Conductivity::isotropic(CONDUCTIVITY);
    let (mut flow, geometry) = flow_of(&model, FlowScheme::ExplicitWithAcceleration, &[]);
    let acceleration: Vec<Vec2> = model.position.iter().map(|x| Vec2::new(0.2 * x.x, 0.5 * x.y)).collect();
    let still = vec![Vec2::zeros(); model.nodes()];
    let points = vec![StressPoint::default(); STRESS_NODES * model.nodes()];
    let dt = 1e-3;
    assert!(flow.step(
        false,
        &geometry.flow.unwrap(),
        &points,
        SkeletonMotion { velocity: &still, acceleration: &acceleration },
        TimeStep { end: dt, dt }
    ));
    let expected = dt * (8.0 / 0.5) * CONDUCTIVITY / model.gravity * 0.7;
    assert!((flow.excess[40] - expected).abs() < 1e-12, "{} {expected}", flow.excess[40]);
}

/// In soil that holds air, volume strain presses water out by the share of it that is water, `S_r` in Eq. 3, and
/// inertia drives it by what air leaves open, `k_r`.
#[test]
fn air_takes_its_part_of_strain_and_of_inertia() {
    const CONDUCTIVITY: f64 = 0.3;
    const TABLE: f64 = 3.5;
    let curve = VanGenuchten::new(2.0, 2.0, 0.0, 1.0).unwrap();
    let mut model = square_block(9);
    model.surface_elevation = vec![1e3; model.nodes()];
    model.water = Some(Water { unit_weight: 10.0, bulk_modulus: 8.0 });
    model.regions[0].hydraulic_conductivity = Conductivity::isotropic(CONDUCTIVITY);
    model.regions[0].retention = Some(curve);
    // Hydrostatic: no head drives anything.
    model.pore_pressure = model.position.iter().map(|at| 10.0 * (TABLE - at.y)).collect();
    model.saturation = model.position.iter().map(|at| curve.at(TABLE - at.y).saturation).collect();
    let moisture = curve.at(TABLE - model.position[40].y);
    assert!(moisture.saturation < 0.8 && moisture.relative_conductivity < 0.3);
    let spread = |x: f64, y: f64| -> Vec<Vec2> {
        model.position.iter().map(|at| Vec2::new(x * at.x, y * at.y)).collect()
    };
    let still = vec![Vec2::zeros(); model.nodes()];
    let points = vec![StressPoint::default(); STRESS_NODES * model.nodes()];
    let dt = 1e-6;
    let stiffness = 1.0 / (0.5 * (moisture.saturation / 8.0 + moisture.capacity / 10.0));
    for (velocity, acceleration, rate) in [
        (spread(0.1, 0.2), still.clone(), -moisture.saturation * 0.3),
        (still, spread(0.2, 0.5), moisture.relative_conductivity * CONDUCTIVITY / model.gravity * 0.7),
    ] {
        let (mut flow, geometry) = flow_of(&model, FlowScheme::ExplicitWithAcceleration, &[]);
        let motion = SkeletonMotion { velocity: &velocity, acceleration: &acceleration };
        assert!(flow.step(false, &geometry.flow.unwrap(), &points, motion, TimeStep { end: dt, dt }));
        let found = flow.excess[40] / dt;
        assert!((found - stiffness * rate).abs() < 1e-6 * stiffness * rate.abs(), "{found} {rate}");
    }
}

const SIDE: usize = 8;
const TOP: f64 = SIDE as f64 - 0.5;
const CONDUCTIVITY: f64 = 0.1;

/// Silt between smooth sides on a level base, its water table at `table`.
fn silt(table: f64) -> Model {
    let curve = VanGenuchten::new(0.5, 2.0, 0.1, 1.0).unwrap();
    let mut model = square_block(SIDE);
    model.outline = Outline {
        sides: [-0.5, TOP].map(|x| Some(Side { x, extent: [-0.5, TOP], support: Support::FreeSlip })),
        ..Outline::level(-0.5)
    };
    model.surface_elevation = vec![TOP; model.nodes()];
    model.water = Some(Water { unit_weight: 10.0, bulk_modulus: 1e4 });
    model.regions[0].hydraulic_conductivity = Conductivity::isotropic(CONDUCTIVITY);
    model.regions[0].retention = Some(curve);
    model.pore_pressure = model.position.iter().map(|at| 10.0 * (table - at.y)).collect();
    model
}

fn on(from: [f64; 2], to: [f64; 2], condition: HydraulicCondition) -> HydraulicBoundary {
    HydraulicBoundary { line: vec![from.into(), to.into()], condition }
}

/// Water that enters on the left, as much rain as given on the ground, and a seepage face on the right.
fn rained(rate: Series) -> Vec<HydraulicBoundary> {
    let level = HydraulicCondition::Reservoir(Series::constant(4.2));
    vec![
        on([-0.5, -0.5], [-0.5, TOP], level),
        on([-0.5, TOP], [TOP, TOP], HydraulicCondition::Rain(rate)),
        on([TOP, -0.5], [TOP, TOP], HydraulicCondition::SeepageFace),
    ]
}

/// Sets the state of a model to that of steady seepage. Returns the set of cells that hold a head.
fn rest(model: &mut Model, boundaries: Vec<HydraulicBoundary>) -> Vec<bool> {
    let mut seepage = Seepage::new(model, &model.pore_pressure, boundaries).unwrap();
    seepage.advance(Until::Steady, |_| true).unwrap();
    model.pore_pressure = seepage.pore_pressure();
    model.saturation = seepage.saturation();
    seepage.holds().to_vec()
}

/// Steps without motion. Returns in how many of them a cell changed its state.
fn stand(model: &Model, flow: &mut Flow, geometry: &Geometry, steps: usize, dt: f64) -> Vec<usize> {
    let still = vec![Vec2::zeros(); model.nodes()];
    let points = vec![StressPoint::default(); STRESS_NODES * model.nodes()];
    let motion = SkeletonMotion { velocity: &still, acceleration: &still };
    let mut switched = Vec::new();
    for step in 0..steps {
        let time = TimeStep { end: dt * (step + 1) as f64, dt };
        assert!(flow.step(false, geometry.flow.as_ref().unwrap(), &points, motion, time));
        let before = flow.edges.as_ref().unwrap().holds().to_vec();
        flow.refresh(model);
        if flow.edges.as_ref().unwrap().holds() != before {
            switched.push(step);
        }
    }
    switched
}

/// A stage that continues a steady state under the same conditions holds its heads on the same cells and keeps its
/// pressures: with rain that the soil takes as a whole, and with rain that ponds.
#[test]
fn a_steady_state_continues_with_its_cells() {
    for share in [0.01, 3.0] {
        let rate = share * CONDUCTIVITY;
        let mut model = silt(4.2);
        let held = rest(&mut model, rained(Series::constant(rate)));
        let at_rest = [4.2, rate, 0.0];
        let conditions: Vec<MovingBoundary> = rained(Series::constant(rate))
            .into_iter()
            .zip(at_rest)
            .map(|(boundary, value)| MovingBoundary { boundary, at_rest: Some(value) })
            .collect();
        for scheme in [FlowScheme::Explicit, FlowScheme::Implicit] {
            let (mut flow, geometry) = flow_of(&model, scheme, &conditions);
            let edges = flow.edges.as_ref().unwrap();
            println!("{share}: {held:?}");
            assert!(held.contains(&true) && held.contains(&false));
            assert_eq!(edges.holds(), held, "{share}");
            assert!(stand(&model, &mut flow, &geometry, 200, 1e-4).is_empty());
            assert!(flow.excess.iter().all(|excess| excess.abs() < 1e-9));
            assert_eq!(flow.edges.as_ref().unwrap().holds(), held, "{share}");
        }
    }
}

/// A storm over ground at rest ends in the steady state that seepage finds under it: the soil takes no more than it can,
/// and its cells do not switch to and fro.
#[test]
fn a_storm_ends_in_the_steady_state_of_seepage() {
    let rates = [0.01, 3.0].map(|share| share * CONDUCTIVITY);
    let mut model = silt(4.2);
    rest(&mut model, rained(Series::constant(rates[0])));
    let mut under_storm = model.clone();
    let held = rest(&mut under_storm, rained(Series::constant(rates[1])));
    let at_rest = [4.2, rates[0], 0.0];
    let storm = Series { time: vec![0.0, 1.0], value: rates.to_vec() };
    let conditions: Vec<MovingBoundary> = rained(storm)
        .into_iter()
        .zip(at_rest)
        .map(|(boundary, value)| MovingBoundary { boundary, at_rest: Some(value) })
        .collect();
    let (mut flow, geometry) = flow_of(&model, FlowScheme::Implicit, &conditions);
    let switched = stand(&model, &mut flow, &geometry, 20_000, 0.05);
    let misses = (0..model.nodes())
        .map(|i| (model.pore_pressure[i] + flow.excess[i] - under_storm.pore_pressure[i]).abs())
        .fold(0.0, f64::max);
    println!(
        "cells switched in {} steps, last {:?}; off by {misses:.1e} kPa",
        switched.len(),
        switched.last()
    );
    assert_eq!(flow.edges.as_ref().unwrap().holds(), held);
    assert!(misses < 0.05 && switched.len() < 2 * held.len());
}
