//! Ground under deep water: a column and a slope, on a lattice and on disordered nodes.

use crate::common::{elastic, numerics, shaking};
use sandboil_soil::{Soil, elastic::Elastic};
use sandboil_solver::{
    Conductivity, Gravity, Model, Outline, Region, Side, Simulation, Support, Vec2, Water, stress_node_offset,
};

const GRAVITY: f64 = 9.81;
const WATER: Water = Water { unit_weight: 9.81, bulk_modulus: 1e5 };
const SPACING: f64 = 0.5;
/// Water over the highest ground, m.
const DEPTH: f64 = 25.0 * SPACING;
const ROWS: [usize; 2] = [8, 24];
const WIDTH: [usize; 2] = [4, 48];
/// The slope's run over its rise, and the columns of level ground in front of its toe.
const RUN: f64 = 2.5;
const TOE: f64 = 4.0;

/// Pseudo-random numbers in [-1, 1), the same on every machine (Lehmer's generator with Park and Miller's
/// constants).
fn scatter() -> impl FnMut() -> f64 {
    const MODULUS: u64 = (1 << 31) - 1;
    let mut state: u64 = 1;
    move || {
        state = state * 48_271 % MODULUS;
        state as f64 / MODULUS as f64 * 2.0 - 1.0
    }
}

/// Level ground, or a slope of 1:2.5 between level ground, on a rough base between smooth walls, with all
/// nodes displaced by up to `disorder` spacings.
fn ground(slope: bool, disorder: f64, region: Region) -> Model {
    let mut random = scatter();
    let [low, high] = ROWS.map(|rows| rows as f64 * SPACING);
    let surface = |x: f64| {
        if slope { (low + (x - TOE * SPACING) / RUN).clamp(low, high) } else { high }
    };
    let columns = WIDTH[usize::from(slope)];
    let mut position = Vec::new();
    for k in 0..ROWS[1] * columns {
        let at = Vec2::new((k % columns) as f64 + 0.5, (k / columns) as f64 + 0.5) * SPACING;
        if at.y < surface(at.x) {
            position.push(at + Vec2::new(random(), random()) * (disorder * SPACING));
        }
    }
    let surface_elevation: Vec<f64> = position.iter().map(|x| surface(x.x)).collect();
    let submerged = (1.0 - region.porosity) * (region.solid_density * GRAVITY - WATER.unit_weight);
    let offset = stress_node_offset(Vec2::repeat(SPACING));
    let effective = |x: Vec2| submerged * (surface(x.x) - x.y).max(0.0);
    let wall = |x: f64, top: f64| Some(Side { x, extent: [0.0, top], support: Support::FreeSlip });
    let end = columns as f64 * SPACING;
    Model {
        spacing: Vec2::repeat(SPACING),
        volume: vec![SPACING * SPACING; position.len()],
        region: vec![0; position.len()],
        surface_elevation,
        vertical_effective_stress: position
            .iter()
            .flat_map(|&x| [effective(x + offset), effective(x - offset)])
            .collect(),
        saturation: Vec::new(),
        pore_pressure: position.iter().map(|x| WATER.unit_weight * (high + DEPTH - x.y)).collect(),
        position,
        regions: vec![region],
        water: Some(WATER),
        gravity: GRAVITY,
        period: None,
        outline: Outline { sides: [wall(0.0, surface(0.0)), wall(end, high)], ..Outline::level(0.0) },
        numerics: numerics(),
    }
}

fn soil() -> Region {
    let soil = Soil::Elastic(Elastic::new(3e3, 6e3).unwrap());
    Region { soil, hydraulic_conductivity: Conductivity::isotropic(1e-8), ..elastic(3e3, 6e3) }
}

fn cases() -> impl Iterator<Item = (bool, f64)> {
    [(false, 0.0), (false, 0.1), (true, 0.0), (true, 0.1)].into_iter()
}

fn largest(vectors: &[[f64; 2]]) -> f64 {
    vectors.iter().map(|v| v[0].hypot(v[1])).fold(0.0, f64::max)
}

/// Grains with the density of water, without stress: weight and water pressure cancel.
#[test]
fn still_water_carries_ground_of_its_density() {
    for (slope, disorder) in cases() {
        let region = Region { solid_density: WATER.unit_weight / GRAVITY, ..soil() };
        let mut simulation = Simulation::new(&ground(slope, disorder, region), 1).unwrap();
        simulation.begin(Gravity { tolerance: 1e-10, max_steps: 0 }).unwrap();
        let rested = simulation.advance(1, f64::INFINITY);
        let residual = simulation.residual();
        println!("slope {slope}, disorder {disorder}: {residual:.1e} g, {rested:?}");
        assert!(rested.unwrap() && residual < 1e-10);
    }
}

/// Ground comes to rest to a millionth of gravity and stays at rest for 100 s; noise decays with the damping
/// of the filter alone. The pressure on the wetted surface stays that of the water above.
#[test]
fn ground_under_deep_water_rests() {
    const NOISE: f64 = 1e-4;
    for (slope, disorder) in cases() {
        let model = ground(slope, disorder, soil());
        let rested = || {
            let mut simulation = Simulation::new(&model, 1).unwrap();
            simulation.begin(Gravity { tolerance: 1e-6, max_steps: 20_000 }).unwrap();
            simulation.advance(u64::MAX, f64::INFINITY).unwrap();
            let (steps, residual) = (simulation.step(), simulation.residual());
            simulation.begin(shaking(None, 100.0, Vec::new())).unwrap();
            (simulation, steps, residual)
        };
        let (mut simulation, steps, residual) = rested();
        simulation.advance(u64::MAX, f64::INFINITY).unwrap();
        let moved = largest(&simulation.displacement());
        let mut random = scatter();
        let (mut simulation, ..) = rested();
        let noise: Vec<[f64; 2]> =
            model.position.iter().map(|_| [random() * NOISE, random() * NOISE]).collect();
        simulation.set_velocity(&noise).unwrap();
        simulation.advance(u64::MAX, 5.0).unwrap();
        let left = largest(&simulation.velocity()) / largest(&noise);
        let excess = simulation.excess_pore_pressure().unwrap();
        let face = model.position.iter().zip(&model.surface_elevation).enumerate();
        let on_face = face.filter(|(_, (x, surface))| *surface - x.y < SPACING);
        let share =
            on_face.map(|(node, _)| excess[node].abs() / model.pore_pressure[node]).fold(0.0, f64::max);
        println!(
            "slope {slope}, disorder {disorder}: {residual:.1e} g after {steps} steps, {moved:e} m in 100 s; noise falls to \
             {left:.1e}, pressure on the face within {share:.1e}"
        );
        assert!(residual <= 1e-6 && moved == 0.0);
        assert!(left < 0.1 && share < 0.01);
    }
}
