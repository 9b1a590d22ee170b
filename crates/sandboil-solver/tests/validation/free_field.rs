//! Free-field sides: they stay at rest, move the section as the column moves, and let waves leave.

use crate::{
    common::{column, dual, elastic, shaking},
    stages::at_rest,
    waves::ricker,
};
use sandboil_solver::{
    Base, Conductivity, Gravity, Model, Region, Shaking, Side, SolverError, Support, UpgoingWave, Vec2,
    Water, column_identities,
};

const HEIGHT: f64 = 10.0;
const SPACING: f64 = 0.2;
const COLUMNS: usize = 25;
const WATER: Water = Water { unit_weight: 10.0, bulk_modulus: 1e6 };
/// Wave speed 100 m/s at 2 Mg/m3.
const SHEAR_MODULUS: f64 = 2e4;

/// A column's soil between two sides, rollers in statics.
pub fn block(height: f64, spacing: f64, columns: usize, region: Region, water: Option<Water>) -> Model {
    let mut model = column(height, spacing, columns, region, water);
    let side = |x: f64| Some(Side { x, extent: [0.0, height], support: Support::FreeSlip });
    model.outline.sides = [side(0.0), side(columns as f64 * spacing)];
    model.period = None;
    model
}

/// Name of a layout of stress points, and what puts a section on it.
pub type Layout = (&'static str, fn(Model) -> Model);
/// Both layouts.
pub const LAYOUTS: [Layout; 2] = [("diagonal", |model| model), ("dual", dual)];

fn pulse(frequency: f64, amplitude: f64) -> UpgoingWave {
    let velocity =
        (0..1000).map(|k| amplitude * ricker(frequency, f64::from(k) * 1e-3 - 1.5 / frequency)).collect();
    UpgoingWave::shear(1e-3, velocity)
}

fn on_free_field(stage: Shaking) -> Shaking {
    Shaking { free_field: [true, true], ..stage }
}

/// A block between free-field sides moves as its column, everywhere and at every time.
#[test]
fn a_block_moves_as_its_column() {
    let cases = [("dry", None, 0.0), ("undrained", Some(WATER), 0.0), ("draining", Some(WATER), 1e-3)];
    for (k, (case, water, conductivity)) in (0..2).flat_map(|k| cases.map(|case| (k, case))) {
        let (name, layout) = LAYOUTS[k];
        let mut region = elastic(SHEAR_MODULUS, 2.0 * SHEAR_MODULUS);
        region.hydraulic_conductivity = Conductivity::isotropic(conductivity);
        let mut wide = at_rest(&layout(block(HEIGHT, SPACING, COLUMNS, region.clone(), water)));
        let mut narrow = at_rest(&layout(column(HEIGHT, SPACING, 1, region, water)));
        let stage = shaking(Some(pulse(5.0, 0.1)), 0.8, Vec::new());
        wide.begin(on_free_field(stage.clone())).unwrap();
        narrow.begin(stage).unwrap();
        assert_eq!(wide.time_step().0, narrow.time_step().0);
        let (mut peak, mut apart) = (0.0_f64, vec![0.0_f64; wide.nodes()]);
        while !wide.is_complete() {
            wide.advance(1, f64::INFINITY).unwrap();
            narrow.advance(1, f64::INFINITY).unwrap();
            let (v, reference) = (wide.velocity(), narrow.velocity());
            for (k, v) in v.iter().enumerate() {
                let reference = reference[k / COLUMNS];
                peak = peak.max(reference[0].abs());
                apart[k] = apart[k].max((v[0] - reference[0]).hypot(v[1] - reference[1]));
            }
        }
        let at = |row: usize, column: usize| 100.0 * apart[row * COLUMNS + column] / peak;
        let worst = apart.iter().copied().fold(0.0, f64::max) / peak;
        println!(
            "{name}, {case}: peak {peak:.3} m/s, worst {:.3} %; corners {:.3} and {:.3} %, side {:.3} %, centre {:.3} %",
            100.0 * worst,
            at(0, 0),
            at(49, 0),
            at(25, 0),
            at(25, 12)
        );
        assert!(worst < 0.025, "{worst}");
    }
}

/// The stage with its columns recorded at an interval, s.
fn recorded(stage: &Shaking, interval: f64) -> Shaking {
    let mut stage = stage.clone();
    stage.output.record_columns = Some(interval);
    stage
}

/// A column that is read from the record of an earlier run moves the block as the computed column, up to the
/// interpolation error of the interval.
#[test]
fn a_recorded_column_acts_as_the_computed_one() {
    for (name, layout) in LAYOUTS {
        const INTERVAL: f64 = 2.5e-3;
        let mut region = elastic(SHEAR_MODULUS, 2.0 * SHEAR_MODULUS);
        region.hydraulic_conductivity = Conductivity::isotropic(1e-3);
        let model = layout(block(HEIGHT, SPACING, 10, region, Some(WATER)));
        let stage = on_free_field(shaking(Some(pulse(5.0, 0.1)), 0.5, Vec::new()));
        let mut solved = at_rest(&model);
        solved.begin(recorded(&stage, INTERVAL)).unwrap();
        let mut velocities = Vec::new();
        while !solved.is_complete() {
            solved.advance(1, f64::INFINITY).unwrap();
            velocities.push(solved.velocity());
        }
        let records = solved.take_column_records();
        assert!(records.iter().all(Option::is_some));
        let mut replayed = at_rest(&model);
        let short = Shaking { column_records: records.clone(), duration: 1.0, ..stage.clone() };
        assert!(replayed.begin(short).is_err());
        let mut replayed = at_rest(&model);
        replayed.begin(Shaking { column_records: records, ..stage.clone() }).unwrap();
        let (mut peak, mut apart) = (0.0_f64, 0.0_f64);
        for then in &velocities {
            replayed.advance(1, f64::INFINITY).unwrap();
            for (now, then) in replayed.velocity().iter().zip(then) {
                peak = peak.max(then[0].abs());
                apart = apart.max((now[0] - then[0]).hypot(now[1] - then[1]));
            }
        }
        // A second stage reads its own record, and is refused without one.
        let again = Shaking { base: Base::shaken_by(Some(pulse(5.0, -0.1))), ..stage.clone() };
        solved.begin(recorded(&again, INTERVAL)).unwrap();
        solved.advance(u64::MAX, f64::INFINITY).unwrap();
        let column_records = solved.take_column_records();
        let mut forgotten = at_rest(&model);
        forgotten.begin(Shaking { column_records: column_records.clone(), ..stage }).unwrap();
        assert!(forgotten.begin(again.clone()).is_err());
        replayed.begin(Shaking { column_records, ..again }).unwrap();
        replayed.advance(u64::MAX, f64::INFINITY).unwrap();
        let (then, now) = (solved.velocity(), replayed.velocity());
        let second = then.iter().zip(&now).map(|(a, b)| (a[0] - b[0]).hypot(a[1] - b[1])).fold(0.0, f64::max);
        println!("{name}, second stage: {:.3} % of the peak", 100.0 * second / peak);
        assert!(second < 0.005 * peak, "{second} {peak}");
        println!("{name}, frames every {INTERVAL} s: {:.3} % of the peak", 100.0 * apart / peak);
        assert!(apart < 0.005 * peak, "{apart} {peak}");
    }
}

/// The same shaking in one stage or in two: the forces of the columns are continuous between the stages and
/// at renewals of the geometry.
#[test]
fn stages_and_renewals_cause_no_shock() {
    for (name, layout) in LAYOUTS {
        const INTERVAL: f64 = 1e-3;
        let shake = |from: f64| {
            let velocity = |k: i32| {
                let t = from + f64::from(k) * INTERVAL;
                0.5 * t.min(0.1) / 0.1 * (2.0 * std::f64::consts::PI * 4.0 * t).sin()
            };
            UpgoingWave::shear(INTERVAL, (0..1000).map(velocity).collect())
        };
        let mut region = elastic(SHEAR_MODULUS, 2.0 * SHEAR_MODULUS);
        region.hydraulic_conductivity = Conductivity::isotropic(1e-4);
        let run = |stages: &[(f64, f64)], strain_limit: Option<f64>| {
            let mut model = layout(block(HEIGHT, 0.5, 8, region.clone(), Some(WATER)));
            model.numerics.geometry_strain_limit = strain_limit;
            let mut simulation = at_rest(&model);
            let mut builds = 0;
            for &(from, duration) in stages {
                let stage = on_free_field(shaking(Some(shake(from)), duration, Vec::new()));
                simulation.begin(stage).unwrap();
                assert!(simulation.advance(u64::MAX, f64::INFINITY).unwrap());
                builds += simulation.counters().geometry_builds;
            }
            (simulation.velocity(), builds)
        };
        // Stages end after whole steps.
        let half = {
            let mut simulation = at_rest(&layout(block(HEIGHT, 0.5, 8, region.clone(), Some(WATER))));
            simulation.begin(on_free_field(shaking(None, 1.0, Vec::new()))).unwrap();
            let (dt, _) = simulation.time_step();
            dt * (0.25 / dt).round()
        };
        let (one, builds) = run(&[(0.0, 2.0 * half)], None);
        let peak = one.iter().map(|v| v[0].abs()).fold(0.0, f64::max);
        for (case, stages, limit) in [
            ("two stages", vec![(0.0, half), (half, half)], None),
            ("renewals", vec![(0.0, 2.0 * half)], Some(2e-3)),
        ] {
            let (other, renewed) = run(&stages, limit);
            let apart =
                one.iter().zip(&other).map(|(a, b)| (a[0] - b[0]).hypot(a[1] - b[1])).fold(0.0, f64::max);
            println!(
                "{name}, {case}: {:.2} % of {peak:.3} m/s apart, {renewed} geometries",
                100.0 * apart / peak
            );
            assert!(renewed > builds);
            assert!(apart < 2e-3 * peak, "{apart}");
        }
    }
}

/// A diverged column drives the section: the error, with the column's node, is returned before the state can
/// be read or stored.
#[test]
fn a_diverged_column_is_reported_when_the_step_returns() {
    let soil = elastic(SHEAR_MODULUS, 2.0 * SHEAR_MODULUS);
    let mut section = at_rest(&block(HEIGHT, SPACING, 3, soil, None));
    let wave = UpgoingWave::shear(1e-3, vec![1e9; 1000]);
    section.begin(on_free_field(shaking(Some(wave), 0.8, Vec::new()))).unwrap();
    let Err(SolverError::Column { side: "left", source }) = section.advance(1, f64::INFINITY) else {
        panic!("not an error of the column")
    };
    assert!(matches!(*source, SolverError::Diverged { quantity: "velocity", node: 0, .. }), "{source}");
}

/// The identity of a column depends on its soil, its wave and the stage, and not on the ground between the
/// sides or on regions and waves that do not reach it.
#[test]
fn the_identity_of_a_column_depends_on_its_input_alone() {
    let model = block(HEIGHT, SPACING, 10, elastic(SHEAR_MODULUS, 2.0 * SHEAR_MODULUS), None);
    let stage = on_free_field(shaking(Some(pulse(5.0, 0.1)), 0.5, Vec::new()));
    let gravity = Gravity { tolerance: 1e-5, max_steps: 20_000 };
    let of = |model: &Model, stage: &Shaking| column_identities(model, Some(gravity), stage.clone()).unwrap();
    let [left, right] = of(&model, &stage);
    assert!(left.is_some() && left == right);
    let mut stiff_core = model.clone();
    stiff_core.regions.insert(0, elastic(9.0 * SHEAR_MODULUS, 18.0 * SHEAR_MODULUS));
    for (region, at) in stiff_core.region.iter_mut().zip(&model.position) {
        *region = u32::from((at.x - 0.5 * 10.0 * SPACING).abs() > 2.0 * SPACING);
    }
    assert_eq!(of(&stiff_core, &stage), [left.clone(), right.clone()]);
    let mut other_probes = stage.clone();
    other_probes.output.probes.push(Vec2::zeros());
    assert_eq!(of(&model, &other_probes)[0], left);
    let mut one_side = stage.clone();
    one_side.free_field[1] = false;
    assert_eq!(of(&model, &one_side), [left.clone(), None]);
    for changed in [
        Shaking { base: Base::shaken_by(Some(pulse(5.0, 0.2))), ..stage.clone() },
        Shaking { duration: 0.6, ..stage.clone() },
        Shaking { local_damping: 0.1, ..stage.clone() },
    ] {
        assert_ne!(of(&model, &changed)[0], left);
    }
    let mut softer = model.clone();
    softer.regions[0] = elastic(0.9 * SHEAR_MODULUS, 2.0 * SHEAR_MODULUS);
    assert_ne!(of(&softer, &stage)[0], left);
    assert_ne!(column_identities(&model, None, stage).unwrap()[0], left);
}
