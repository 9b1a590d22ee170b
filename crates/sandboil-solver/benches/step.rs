//! Cost of a step and of building a geometry, per node on one thread and on two.
//!
//! For a comparison of machines each figure is also given in yardsticks (one exponential, one power and one
//! square root), timed in alternation with it.
#![allow(clippy::unwrap_used)] // a failure ends the bench
#![allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // row counts of small columns

#[path = "../tests/validation/common.rs"]
mod common;
#[path = "../../sandboil-soil/benches/yardstick/mod.rs"]
mod yardstick;

use common::{column, dual, elastic, shaking};
use criterion::{BenchmarkId, Criterion, Throughput};
use sandboil_soil::{
    Soil,
    pm4sand::{Options, PM4Sand, Parameters},
};
use sandboil_solver::{Conductivity, Gravity, Model, Shaking, Side, Simulation, Support, UpgoingWave, Water};
use std::time::Instant;

const WATER: Water = Water { unit_weight: 10.0, bulk_modulus: 1e6 };
/// Height over spacing of the blocks.
const ROWS: usize = 100;
const SPACING: f64 = 0.2;
/// Gravity steps before a block of sand is shaken: for a bench it is then near enough to rest.
const RELAXATION: u64 = 300;
/// Steps of shaking before the timing starts: the wave has then crossed the block.
const LEAD: u64 = 2000;

/// The ground: elastic, dry or saturated, or sand close to liquefaction.
#[derive(Debug, Clone, Copy)]
enum Ground {
    Dry,
    Undrained,
    Sand,
}

fn model(ground: Ground, columns: usize) -> Model {
    let height = ROWS as f64 * SPACING;
    let mut region = elastic(8e4, 2.4e5);
    let water = (!matches!(ground, Ground::Dry)).then_some(WATER);
    if matches!(ground, Ground::Sand) {
        let parameters = Parameters { dr: 0.55, g0: 677.0, hpo: 0.4, ..Parameters::default() };
        region.soil = Soil::PM4Sand(Box::new(PM4Sand::new(parameters, Options::default()).unwrap()));
        region.hydraulic_conductivity = Conductivity::isotropic(1e-3);
    }
    column(height, SPACING, columns, region, water)
}

/// A running simulation, shaken by 0.2 m/s at 2 Hz.
fn under_way(model: &Model, threads: usize) -> Simulation {
    let mut simulation = Simulation::new(model, threads).unwrap();
    simulation.begin(Gravity { tolerance: 1e-4, max_steps: 20_000 }).unwrap();
    simulation.advance(RELAXATION, f64::INFINITY).unwrap();
    let velocity = (0..20_000).map(|k| 0.1 * (4e-3 * std::f64::consts::PI * f64::from(k)).sin()).collect();
    let stage = shaking(Some(UpgoingWave::shear(1e-3, velocity)), 1e3, Vec::new());
    simulation.begin(stage).unwrap();
    simulation.advance(LEAD, f64::INFINITY).unwrap();
    simulation
}

const CASES: [(&str, Ground, usize); 4] = [
    ("dry elastic", Ground::Dry, 5),
    ("dry elastic", Ground::Dry, 200),
    ("undrained elastic", Ground::Undrained, 200),
    ("liquefying sand", Ground::Sand, 5),
];

/// Cost of free-field sides in a step of a section of 20,000 nodes, compared with rigid walls.
#[expect(clippy::print_stdout, reason = "a bench reports")]
fn free_field_beside_walls() {
    const COLUMNS: usize = 200;
    const ROUNDS: usize = 7;
    const STEPS: u64 = 20;
    println!("section, nodes, threads, ms a step between walls, on free-field sides, more");
    for (name, ground) in [("dry elastic", Ground::Dry), ("undrained elastic", Ground::Undrained)] {
        for threads in [1, 2] {
            let mut section = model(ground, COLUMNS);
            let side =
                |x: f64| Some(Side { x, extent: [0.0, ROWS as f64 * SPACING], support: Support::FreeSlip });
            section.outline.sides = [side(0.0), side(COLUMNS as f64 * SPACING)];
            section.period = None;
            let mut both = [false, true].map(|free| {
                let mut simulation = Simulation::new(&section, threads).unwrap();
                let stage = Shaking { free_field: [free; 2], ..shaking(None, 1e3, Vec::new()) };
                simulation.begin(stage).unwrap();
                simulation
            });
            // The shortest of several rounds: other work of the machine only adds time.
            let mut least = [f64::INFINITY; 2];
            for _ in 0..ROUNDS {
                for (simulation, least) in both.iter_mut().zip(&mut least) {
                    let start = Instant::now();
                    simulation.advance(STEPS, f64::INFINITY).unwrap();
                    *least = least.min(start.elapsed().as_secs_f64() / STEPS as f64);
                }
            }
            let [walls, free] = least.map(|seconds| 1e3 * seconds);
            let (nodes, more) = (section.nodes(), 100.0 * (free / walls - 1.0));
            println!("{name}, {nodes}, {threads}, {walls:.2}, {free:.2}, {more:.1} %");
        }
    }
}

#[expect(clippy::print_stdout, reason = "a bench reports")]
fn compare_with_yardstick() {
    println!("work, nodes, threads, ns per node, yardsticks per node");
    for (name, ground, columns) in CASES {
        for threads in [1, 2] {
            let mut simulation = under_way(&model(ground, columns), threads);
            let steps = (100_000 / simulation.nodes()).max(2) as u64;
            let count = steps as f64 * simulation.nodes() as f64;
            let (seconds, ratio) =
                yardstick::compared(count, || simulation.advance(steps, f64::INFINITY).unwrap());
            println!("step, {name}, {}, {threads}, {:.0}, {ratio:.2}", simulation.nodes(), 1e9 * seconds);
        }
    }
    let wet = model(Ground::Undrained, 200);
    let (seconds, ratio) = yardstick::compared(wet.nodes() as f64, || Simulation::new(&wet, 1).unwrap());
    println!("build, undrained elastic, {}, 1, {:.0}, {ratio:.2}", wet.nodes(), 1e9 * seconds);
}

fn main() {
    let mut criterion = Criterion::default().sample_size(10).configure_from_args();
    let mut group = criterion.benchmark_group("step");
    for (name, ground, columns) in CASES {
        for (operators, model) in
            [("conservative", model(ground, columns)), ("dual", dual(model(ground, columns)))]
        {
            let mut simulation = under_way(&model, 1);
            group.throughput(Throughput::Elements(simulation.nodes() as u64));
            group.bench_function(
                BenchmarkId::new(format!("{name}, {operators}"), simulation.nodes()),
                |bencher| {
                    bencher.iter(|| simulation.advance(1, f64::INFINITY).unwrap());
                },
            );
        }
    }
    group.finish();
    compare_with_yardstick();
    free_field_beside_walls();
    criterion.final_summary();
}
