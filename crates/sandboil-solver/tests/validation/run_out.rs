//! Run-out: a heap is released, dry, wet and under water, until it comes to rest.
//!
//! The heap is that of Bui et al. (2008, Int. J. Numer. Anal. Meth. Geomech. 32, 1537-1570), 0.2 m wide and 0.1 m high:
//! phi 19.8 degrees, no cohesion, a Young's modulus of 840 kPa and Poisson's ratio 0.3.

use crate::common::{column, elastic, shaking};
use sandboil_soil::{
    Soil, Strength,
    drucker_prager::{DruckerPrager, Matching, Parameters},
    elastic::Elastic,
};
use sandboil_solver::{
    Conductivity, ENERGY_NAMES, MOVING_FACTOR, Model, Outline, Output, RunOut, Side, SideEdge, Simulation,
    Stage, Support, Vec2, Water,
};

const HEIGHT: f64 = 0.1;
const WIDTH: f64 = 0.2;
const WATER: Water = Water { unit_weight: 9.81, bulk_modulus: 1e4 };

fn heap(spacing: f64, water: Option<Water>, conductivity: f64) -> Model {
    let (young, poisson) = (840.0, 0.3);
    let elasticity =
        Elastic::new(young / (2.0 * (1.0 + poisson)), young / (3.0 * (1.0 - 2.0 * poisson))).unwrap();
    let peak = Strength { c: 0.0, phi: 19.8, psi: 0.0 };
    let parameters = Parameters { peak, softening: None, tension_cutoff: None, matching: Matching::General };
    let mut region = elastic(1e3, 1e3);
    region.soil = Soil::DruckerPrager(DruckerPrager::new(elasticity, parameters).unwrap());
    region.solid_density = 2.65;
    region.hydraulic_conductivity = Conductivity::isotropic(conductivity);
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // tens of columns
    let columns = (WIDTH / spacing).round() as usize;
    let mut model = column(HEIGHT, spacing, columns, region, water);
    model.period = None;
    model.gravity = 9.81;
    model.outline.sides[0] =
        Some(Side { x: 0.0, extent: [-HEIGHT, 2.0 * HEIGHT], support: Support::FreeSlip });
    model
}

fn run_out(duration: f64, still_water: Option<Vec<Vec2>>) -> RunOut {
    RunOut {
        duration,
        viscosity: 0.1,
        open: [false; 2],
        still_water,
        local_damping: 0.0,
        time_step_factor: MOVING_FACTOR,
        output: Output { history_interval: 0.01, ..Output::default() },
    }
}

/// Largest x of the nodes that are connected with the heap by distances of at most two spacings, m.
fn front(simulation: &Simulation, spacing: f64) -> f64 {
    let places = simulation.position();
    let mut reached = vec![false; places.len()];
    let mut open = vec![0];
    reached[0] = true;
    while let Some(i) = open.pop() {
        for (j, place) in places.iter().enumerate() {
            if !reached[j] && (place[0] - places[i][0]).hypot(place[1] - places[i][1]) < 2.0 * spacing {
                reached[j] = true;
                open.push(j);
            }
        }
    }
    places.iter().zip(&reached).filter(|(_, reached)| **reached).map(|(at, _)| at[0]).fold(0.0, f64::max)
}

/// One column of an energy history.
fn history(rows: &[f64], name: &str) -> Vec<f64> {
    let k = ENERGY_NAMES.iter().position(|known| *known == name).unwrap();
    rows.chunks(ENERGY_NAMES.len()).map(|row| row[k]).collect()
}

/// Runs a heap until at most a share `rest` of the peak of its kinetic energy is left. The energy taken by
/// the skeleton's forces never decreases: the sum of kinetic energy and energy of weight, stress and water
/// never increases. No node is lost.
fn comes_to_rest(
    name: &str,
    model: &Model,
    still_water: Option<Vec<Vec2>>,
    duration: f64,
    rest: f64,
) -> (Simulation, String) {
    let mut simulation = Simulation::new(model, 2).unwrap();
    simulation.begin(run_out(duration, still_water)).unwrap();
    assert!(simulation.advance(u64::MAX, f64::INFINITY).unwrap());
    let (_, rows) = simulation.take_energy();
    let (kinetic, taken) = (history(&rows, "kinetic"), history(&rows, "damping"));
    let (renewal, solid) = (history(&rows, "renewal"), history(&rows, "solid_mass"));
    let peak = kinetic.iter().copied().fold(0.0, f64::max);
    let falls = |values: &[f64]| -> f64 { values.windows(2).map(|pair| (pair[0] - pair[1]).max(0.0)).sum() };
    let grown: Vec<f64> = renewal.iter().map(|gain| -gain).collect();
    let given = falls(&taken).max(falls(&grown));
    let left = kinetic.last().unwrap() / peak;
    let report = format!(
        "{name}: front {:.3} m, kinetic energy left {left:.1e} of its peak, energy given {given:.1e} kJ/m, {} geometries",
        front(&simulation, model.spacing.x),
        simulation.counters().geometry_builds
    );
    assert!(solid.iter().all(|mass| mass == &solid[0]), "{name}");
    assert!(left < rest, "{name}: {left}");
    assert!(given < 1e-9 * peak, "{name}: {given}");
    (simulation, report)
}

#[test]
fn dry_heap_comes_to_rest() {
    let spacing = 0.005;
    let (simulation, report) = comes_to_rest("dry", &heap(spacing, None, 0.0), None, 0.9, 1e-5);
    let front = front(&simulation, spacing);
    let top = simulation.position().iter().map(|at| at[1]).fold(0.0, f64::max);
    println!("{report}, top {top:.4} m");
    assert!((0.36..0.41).contains(&front) && (top - 0.0975).abs() < 1e-3, "{front} {top}");
}

/// Wet and submerged heaps, undrained, poorly drained and quickly drained: drained heaps run further.
#[test]
fn saturated_heaps_come_to_rest() {
    let spacing = 0.01;
    for (name, depth) in [("wet", 0.0), ("submerged", 0.2)] {
        let fronts = [0.0, 1e-3, 1e-2].map(|conductivity| {
            let mut model = heap(spacing, Some(WATER), conductivity);
            let level = HEIGHT + depth;
            let pressure = |at: &Vec2| WATER.unit_weight * (level - at.y);
            model.pore_pressure =
                model.position.iter().map(|at| if depth > 0.0 { pressure(at) } else { 0.0 }).collect();
            let report = format!("{name}, k {conductivity} m/s");
            let (simulation, report) = comes_to_rest(&report, &model, None, 3.0, 1e-4);
            println!("{report}");
            front(&simulation, spacing)
        });
        assert!(fronts[1..].iter().all(|drained| *drained > fronts[0] + 2.0 * spacing), "{fronts:?}");
    }
}

/// The depth of the water above a heap has no effect.
#[test]
fn depth_of_still_water_has_no_effect() {
    let place = |level: f64| {
        let mut model = heap(0.01, Some(WATER), 1e-3);
        model.pore_pressure = model.position.iter().map(|at| WATER.unit_weight * (level - at.y)).collect();
        let mut simulation = Simulation::new(&model, 1).unwrap();
        simulation.begin(run_out(0.1, None)).unwrap();
        simulation.advance(u64::MAX, f64::INFINITY).unwrap();
        simulation.position()
    };
    let (shallow, deep) = (place(0.3), place(30.0));
    let apart = |(a, b): (&[f64; 2], &[f64; 2])| (a[0] - b[0]).hypot(a[1] - b[1]);
    let apart = shallow.iter().zip(&deep).map(apart).fold(0.0, f64::max);
    let moved = shallow.iter().map(|at| at[0]).fold(0.0, f64::max) - WIDTH;
    println!("apart {apart:.1e} m, the front moved {moved:.3} m");
    assert!(moved > 0.005 && apart < 1e-9, "{apart} {moved}");
}

/// Excess pressure in a column drains through the free surface by Terzaghi's series, to first order: water
/// leaves from the centre of the node below the surface.
#[test]
fn excess_pressure_drains_through_the_free_surface() {
    const DEPTH: f64 = 10.0;
    const EXCESS: f64 = 20.0;
    let (shear, bulk) = (4e3, 1e4);
    for (rows, bar) in [(10.0, 0.035), (20.0, 0.018), (40.0, 0.01)] {
        let spacing = DEPTH / rows;
        let mut region = elastic(shear, bulk);
        region.hydraulic_conductivity = Conductivity::isotropic(1e-3);
        let water = Water { unit_weight: 10.0, bulk_modulus: 1e6 };
        let mut model = column(DEPTH, spacing, 5, region, Some(water));
        // At rest the excess carries a part of the effective stress, as after an earthquake.
        model.pore_pressure.iter_mut().for_each(|pressure| *pressure += EXCESS);
        model.vertical_effective_stress.iter_mut().for_each(|stress| *stress -= EXCESS);
        model.regions[0].earth_pressure_coefficient = 0.5;
        let surface = vec![Vec2::new(0.0, DEPTH), Vec2::new(1.0, DEPTH)];
        let mut simulation = Simulation::new(&model, 1).unwrap();
        let stiffness = bulk + 4.0 / 3.0 * shear;
        let storage = 1.0 / stiffness + 0.4 / water.bulk_modulus;
        let consolidation = 1e-3 / (water.unit_weight * storage);
        let time = |factor: f64| factor * DEPTH * DEPTH / consolidation;
        let mut stage = run_out(time(0.5), Some(surface));
        stage.local_damping = 0.2;
        simulation.begin(stage).unwrap();
        for factor in [0.05, 0.2, 0.5] {
            simulation.advance(u64::MAX, time(factor)).unwrap();
            let exact = |y: f64| -> f64 {
                (0..200)
                    .map(|m| {
                        let wave = std::f64::consts::PI * (f64::from(m) + 0.5);
                        2.0 / wave * (wave * (1.0 - y / DEPTH)).sin() * (-wave * wave * factor).exp()
                    })
                    .sum()
            };
            let found = simulation.excess_pore_pressure().unwrap();
            let places = simulation.position();
            // Excess counts from the state at rest, which includes the initial excess.
            let error: Vec<f64> = found
                .iter()
                .zip(&places)
                .map(|(since, at)| (EXCESS + since) / EXCESS - exact(at[1]))
                .collect();
            let rms = (error.iter().map(|e| e * e).sum::<f64>() / error.len() as f64).sqrt();
            println!("{rows} rows, T {factor}: rms {rms:.4}");
            assert!(rms < bar, "{rows} {factor} {rms}");
        }
    }
}

/// Stable ground does not move when it is released, after statics and after shaking. The new geometry of its
/// settled nodes causes an imbalance by their strain, 3e-4 of gravity in a row.
#[test]
fn stable_ground_stays() {
    let mut region = elastic(2e4, 4e4);
    region.hydraulic_conductivity = Conductivity::isotropic(1e-4);
    let water = Water { unit_weight: 10.0, bulk_modulus: 1e6 };
    let mut model = column(10.0, 0.5, 20, region, Some(water));
    model.period = None;
    let side = |x: f64| Some(Side { x, extent: [0.0, 10.0], support: Support::FreeSlip });
    model.outline = Outline { sides: [side(0.0), side(10.0)], ..model.outline };
    for shaken in [false, true] {
        let mut simulation = Simulation::new(&model, 1).unwrap();
        simulation.begin(sandboil_solver::Gravity { tolerance: 1e-6, max_steps: 100_000 }).unwrap();
        while !simulation.advance(10_000, f64::INFINITY).unwrap() {}
        if shaken {
            simulation.begin(shaking(None, 0.5, Vec::new())).unwrap();
            simulation.advance(u64::MAX, f64::INFINITY).unwrap();
        }
        let before = simulation.displacement();
        simulation.begin(run_out(1.0, None)).unwrap();
        simulation.advance(u64::MAX, f64::INFINITY).unwrap();
        let moved = simulation.displacement();
        let moved = moved.iter().zip(&before).map(|(a, b)| (a[0] - b[0]).hypot(a[1] - b[1]));
        let moved = moved.fold(0.0, f64::max);
        println!("shaken {shaken}: moved {moved:.1e} m");
        assert!(moved < 1e-5, "{moved}");
    }
}

/// The same bits with any number of threads, and from a state stored during the run.
#[test]
fn run_outs_have_the_same_bits() {
    let model = heap(0.005, Some(WATER), 1e-3);
    let begun = |threads: usize| {
        let mut simulation = Simulation::new(&model, threads).unwrap();
        simulation.begin(run_out(0.06, Some(Vec::new()))).unwrap();
        simulation
    };
    let mut whole = begun(1);
    whole.advance(u64::MAX, f64::INFINITY).unwrap();
    assert!(whole.counters().geometry_builds > 3);
    let mut first = begun(3);
    first.advance(300, f64::INFINITY).unwrap();
    let mut bytes = Vec::new();
    first.store(&[], &mut bytes).unwrap();
    let mut second = Simulation::restore(&model, 2, &bytes).unwrap();
    second.advance(u64::MAX, f64::INFINITY).unwrap();
    assert_eq!(whole.position(), second.position());
    assert_eq!(whole.excess_pore_pressure(), second.excess_pore_pressure());
    assert_eq!(whole.counters(), second.counters());
}

/// Choices that exclude large displacements are refused, and so is any stage after one of large
/// displacements.
#[test]
fn exclusive_choices_are_refused() {
    let model = heap(0.01, None, 0.0);
    let begin = |stage: Stage| Simulation::new(&model, 1).unwrap().begin(stage);
    let braked = |viscosity: f64| begin(RunOut { viscosity, ..run_out(0.01, None) }.into());
    assert!(braked(0.0).is_ok());
    for value in [-0.1, f64::NAN, f64::INFINITY] {
        assert!(braked(value).is_err());
    }
    let mut beside_columns = Stage::from(run_out(0.01, None));
    beside_columns.edges.sides[0] = SideEdge::FreeField(None);
    assert!(begin(beside_columns).is_err());
    let mut simulation = Simulation::new(&model, 1).unwrap();
    simulation.begin(run_out(0.01, None)).unwrap();
    assert!(simulation.begin(run_out(0.01, None)).is_err());
    let wet = heap(0.01, Some(WATER), 0.0);
    let mut simulation = Simulation::new(&wet, 1).unwrap();
    simulation.begin(run_out(0.01, None)).unwrap();
    assert!(simulation.set_excess_pore_pressure(&vec![1.0; wet.nodes()]).is_err());
}
