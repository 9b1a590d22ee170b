//! Updates of PM4Sand per second on one core, along the reference path sp1 (simple shear at constant volume to
//! liquefaction) and in ground that has liquefied.
//!
//! The last table is for comparison between machines: it also gives the time of an update in units of a yardstick (one
//! exponential, one power and one square root). Both are timed within the same second.

#[path = "../tests/point/mod.rs"]
mod point;
mod yardstick;

use criterion::{BenchmarkId, Criterion, Throughput};
use point::{CALIBRATIONS, StrainPath, advance, consolidated, parts, sand, shear};
use sandboil_soil::pm4sand::{PM4Sand, State};
use sandboil_soil::{Integrator, SoilModel, StrainIncrement};

/// Largest strain component of an increment.
const HOST_INCREMENTS: [f64; 3] = [1e-6, 2.5e-6, 1e-5];
/// A material, its initial state and the strain increments.
struct Walk {
    name: &'static str,
    sand: PM4Sand,
    start: State,
    steps: Vec<StrainIncrement>,
}

impl Walk {
    fn along_sp1(increment: f64) -> Self {
        let [path, ..] = StrainPath::all();
        let sand = sand(path.calibration);
        let steps = path.legs().flat_map(|(leg, _)| {
            let (count, part) = parts(&leg, increment);
            std::iter::repeat_n(part, count as usize)
        });
        Self { name: "sp1", start: path.start(&sand), steps: steps.collect(), sand }
    }

    /// Shear cycles of 0.1 % at a mean stress of about `2 p_min`.
    fn liquefied(increment: f64) -> Self {
        let sand = sand(CALIBRATIONS[1]);
        let mut start = consolidated(&sand);
        let mut sign = 1.0;
        while start.mean_stress() > 2.2 * start.minimum_pressure() {
            advance(&sand, &mut start, &shear(sign * 1e-5), &Integrator::default());
            if sign * sand.stress(&start).xy > 0.147 * point::SIGMA_V0 {
                sign = -sign;
            }
        }
        let (count, part) = parts(&shear(1e-3), increment);
        let steps = [1.0, -1.0, -1.0, 1.0]
            .into_iter()
            .cycle()
            .take(40)
            .flat_map(|sign| std::iter::repeat_n(shear(sign * part.xy), count as usize));
        Self { name: "liquefied", start, steps: steps.collect(), sand }
    }

    fn run(&self, integrator: &Integrator) -> State {
        let mut state = self.start;
        for step in &self.steps {
            advance(&self.sand, &mut state, step, integrator);
        }
        state
    }

    fn updates(&self) -> f64 {
        self.steps.len() as f64
    }
}

fn integrators() -> [(&'static str, Integrator); 3] {
    let rk4 = Integrator::RungeKutta4 { max_increment: Integrator::DEFAULT_INCREMENT };
    [("modified Euler", Integrator::default()), ("Runge-Kutta", rk4), ("reference", Integrator::Reference)]
}

#[expect(clippy::print_stdout, reason = "the bench prints its results")]
fn compare_with_yardstick() {
    println!("walk, integrator, increment, updates per second, yardsticks per update");
    for increment in HOST_INCREMENTS {
        for walk in [Walk::along_sp1(increment), Walk::liquefied(increment)] {
            for (name, integrator) in integrators() {
                let (update, ratio) = yardstick::compared(walk.updates(), || walk.run(&integrator));
                println!("{}, {name}, {increment:e}, {:.3e}, {:.2}", walk.name, 1.0 / update, ratio);
            }
        }
    }
}

fn main() {
    let mut criterion = Criterion::default().sample_size(10).configure_from_args();
    for increment in HOST_INCREMENTS {
        for walk in [Walk::along_sp1(increment), Walk::liquefied(increment)] {
            let mut group = criterion.benchmark_group(walk.name);
            group.throughput(Throughput::Elements(walk.steps.len() as u64));
            group.bench_function(BenchmarkId::from_parameter(increment), |bencher| {
                bencher.iter(|| walk.run(&Integrator::default()));
            });
        }
    }
    criterion.final_summary();
    compare_with_yardstick();
}
