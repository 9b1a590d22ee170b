//! Error against part size and tolerance, as CSV: `cargo run --release -p sandboil-soil --example step_error`.
//!
//! Stress differences (rms, kPa) along the three reference strain paths, cycles to 3 % shear strain in the cyclic
//! test of the middle calibration, and evaluations of the rate equations per unit of shear strain. Every host step is
//! one part.

#[path = "../tests/point/mod.rs"]
mod point;

use point::{CALIBRATIONS, StrainPath, cyclic_shear, sand};
use sandboil_soil::Integrator;

const PARTS: [f64; 7] = [1e-6, 2.5e-6, 5e-6, 1e-5, 2e-5, 5e-5, 1e-4];
const TOLERANCES: [f64; 4] = [1e-6, 1e-5, 1e-4, 1e-3];
/// Cyclic stress ratio of the middle calibration.
const CSR: f64 = 0.147;

#[expect(clippy::print_stdout, reason = "the table is what this program is for")]
fn print_row(name: &str, tolerance: f64, part: f64, integrator: &Integrator) {
    let paths = StrainPath::all().map(|path| {
        let difference = path.compare(&sand(path.calibration), integrator, part);
        let report = difference.report;
        format!("{:.4},{},{}", difference.rms, report.reversals, report.near_neutral_reversals)
    });
    let test = cyclic_shear(&sand(CALIBRATIONS[1]), CSR, integrator, part);
    let evaluations = test.report.evaluations as f64 / test.travel;
    println!(
        "{name},{tolerance:e},{part:e},{},{:.3},{:.2},{evaluations:.2e},{}",
        paths.join(","),
        test.cycles,
        test.cumulative_fabric,
        test.report.forced_acceptances
    );
}

#[expect(clippy::print_stdout, reason = "the table is what this program is for")]
fn main() {
    println!(
        "integrator,tolerance,part,sp1_rms_kPa,sp1_reversals,sp1_near_neutral,sp2_rms_kPa,sp2_reversals,\
         sp2_near_neutral,sp3_rms_kPa,sp3_reversals,sp3_near_neutral,cycles_to_3_percent,cumulative_fabric,evaluations_per_strain,forced_acceptances"
    );
    for tolerance in TOLERANCES {
        for max_increment in PARTS {
            let integrator = Integrator::ModifiedEuler { tolerance, max_increment };
            print_row("modified Euler", tolerance, max_increment, &integrator);
        }
    }
    for max_increment in PARTS {
        print_row("Runge-Kutta", f64::NAN, max_increment, &Integrator::RungeKutta4 { max_increment });
    }
    print_row("reference", f64::NAN, Integrator::REFERENCE_INCREMENT, &Integrator::Reference);
}
