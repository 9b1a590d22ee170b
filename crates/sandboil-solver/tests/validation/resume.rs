//! A stored simulation continues with the same bits, and changed bytes are refused.

use crate::{
    common::{column, elastic, shaking},
    free_field::block,
};
use proptest::prelude::*;
use sandboil_soil::{
    Soil, Strength,
    drucker_prager::{DruckerPrager, Matching, Parameters as ConeParameters, Softening},
    elastic::Elastic,
    mohr_coulomb::MohrCoulomb,
    pm4sand::{Options, PM4Sand, Parameters},
    pressure_elastic::PressureElastic,
    total_stress::{Criterion, TotalStress},
};
use sandboil_solver::{
    Conductivity, Diffusion, Gravity, Model, Operators, Rayleigh, Region, Shaking, Simulation, SolverError,
    StateError, UpgoingWave, Water, checkpoint,
};
use sandboil_sph::Vec2;
use std::sync::LazyLock;

const WATER: Water = Water { unit_weight: 10.0, bulk_modulus: 1e5 };
const GRAVITY: Gravity = Gravity { tolerance: 1e-3, max_steps: 20_000 };
const SPACING: f64 = 0.4;
const HEIGHT: f64 = 8.0;
/// Nodes in a row: enough for several threads.
const COLUMNS: usize = 13;
const DURATION: f64 = 0.05;
/// Steps between the stops of a run.
const STEPS_BETWEEN: u64 = 37;

/// Soils of every kind, from the base upwards.
fn soils() -> Vec<Region> {
    let skeleton = Elastic::new(2e4, 4e4).unwrap();
    let strength = Strength { c: 2.0, phi: 30.0, psi: 5.0 };
    let cone = ConeParameters {
        peak: strength,
        softening: Some(Softening { residual: Strength { c: 1.0, phi: 25.0, psi: 0.0 }, strain: 0.05 }),
        tension_cutoff: None,
        matching: Matching::Usual,
    };
    let sand = Parameters { dr: 0.35, g0: 476.0, hpo: 0.5, ..Parameters::default() };
    [
        Soil::Elastic(skeleton),
        Soil::DruckerPrager(DruckerPrager::new(skeleton, cone).unwrap()),
        Soil::MohrCoulomb(MohrCoulomb::new(skeleton, strength, None).unwrap()),
        Soil::TotalStress(TotalStress::new(skeleton, Criterion::Tresca, 30.0, None).unwrap()),
        Soil::PressureElastic(PressureElastic::new(skeleton, 0.5, 50.0).unwrap()),
        Soil::PM4Sand(Box::new(PM4Sand::new(sand, Options::default()).unwrap())),
    ]
    .into_iter()
    .map(|soil| Region { soil, hydraulic_conductivity: Conductivity::isotropic(1e-3), ..elastic(1.0, 1.0) })
    .collect()
}

/// The model with its soils in layers, from the base upwards.
fn layered(mut model: Model) -> Model {
    let regions = soils();
    let layer = HEIGHT / regions.len() as f64;
    model.region = model.position.iter().map(|at| (at.y / layer) as u32).collect();
    Model { regions, ..model }
}

/// Shaken so that soils yield and the geometry is renewed.
fn shaken() -> Shaking {
    let velocity = (0..100).map(|k| 0.6 * (0.2 * f64::from(k)).sin()).collect();
    let probes = vec![Vec2::new(0.4, 0.5 * HEIGHT)];
    let mut stage = shaking(Some(UpgoingWave::shear(1e-3, velocity)), DURATION, probes);
    stage.output.pressure_envelope = true;
    stage.output.strain_envelope = true;
    stage.output.stress_histories = true;
    stage
}

/// A run of two shaking stages.
struct Case {
    name: &'static str,
    model: Model,
    stage: Shaking,
}

/// Cases that together include every part that a simulation may have.
fn cases() -> Vec<Case> {
    let case = |name, change: &dyn Fn(&mut Model, &mut Shaking)| {
        let mut model = layered(column(HEIGHT, SPACING, COLUMNS, elastic(1.0, 1.0), Some(WATER)));
        let mut stage = shaken();
        model.numerics.geometry_strain_limit = Some(1e-3);
        change(&mut model, &mut stage);
        Case { name, model, stage }
    };
    vec![
        case("implicit", &|model, _| model.numerics.diffusion = Diffusion::Implicit),
        case("explicit", &|model, stage| {
            model.numerics.diffusion = Diffusion::Explicit;
            stage.local_damping = 0.05;
        }),
        case("dry", &|model, _| (model.water, model.pore_pressure) = (None, Vec::new())),
        case("printed", &|model, _| model.numerics.operators = Operators::Printed),
        case("damped", &|_, stage| {
            stage.rayleigh = Some(Rayleigh { ratio: 0.02, frequencies: [1.0, 10.0] });
        }),
        case("corrected inertia", &|model, _| model.numerics.dispersion_correction = true),
        case("free field", &|model, stage| {
            *model = Model {
                numerics: model.numerics,
                ..layered(block(HEIGHT, SPACING, COLUMNS, elastic(1.0, 1.0), Some(WATER)))
            };
            stage.free_field = [true; 2];
            stage.output.record_columns = Some(0.0025);
        }),
    ]
}

/// The stages of a run after the static one.
const SHAKING_STAGES: usize = 2;

/// A stop in a run: the number of shaking stages begun, and the simulation as bytes.
type Stop = (usize, Vec<u8>);

fn stored(simulation: &Simulation) -> Vec<u8> {
    let mut bytes = Vec::new();
    simulation.store(b"note", &mut bytes).unwrap();
    bytes
}

/// Runs a simulation with `begun` shaking stages to the end of the last one, and calls `stop` at every stop.
fn run(case: &Case, mut simulation: Simulation, begun: usize, mut stop: impl FnMut(Stop)) -> Simulation {
    for stage in begun..=SHAKING_STAGES {
        if stage > begun {
            simulation.begin(case.stage.clone()).unwrap();
        }
        while !simulation.advance(STEPS_BETWEEN, f64::INFINITY).unwrap() {
            stop((stage, stored(&simulation)));
        }
        stop((stage, stored(&simulation)));
    }
    simulation
}

#[test]
fn a_stored_run_ends_with_the_same_bits() {
    for case in cases() {
        let mut stops = Vec::new();
        let mut simulation = Simulation::new(&case.model, 1).unwrap();
        simulation.begin(GRAVITY).unwrap();
        let whole = run(&case, simulation, 0, |stop| stops.push(stop));
        let (counters, expected) = (whole.counters(), stored(&whole));
        // The last stage begins with a geometry, and renews it during the run.
        assert!(counters.geometry_builds > 1, "{}: {counters:?}", case.name);
        assert!(counters.soil.substeps > 0, "{}: {counters:?}", case.name);
        // Some of the stops, spread over all stages, with these numbers of threads in turn.
        let chosen = stops.iter().step_by(stops.len().div_ceil(6)).zip([2, 1, 3, 8].into_iter().cycle());
        for ((begun, bytes), threads) in chosen {
            let simulation = Simulation::restore(&case.model, threads, bytes).unwrap();
            assert_eq!(
                stored(&simulation),
                *bytes,
                "{}: the restored bytes are those that were stored",
                case.name
            );
            let (time, step) = (simulation.time(), simulation.step());
            let resumed = run(&case, simulation, *begun, |_| ());
            let context = format!("{} from {time} s, step {step} with {threads} threads", case.name);
            assert!(stored(&resumed) == expected, "{context}");
            assert_eq!(resumed.counters(), counters, "{context}");
        }
        println!("{}: {} bytes, {} nodes", case.name, expected.len(), whole.nodes());
    }
}

/// A small running state.
static SMALL: LazyLock<(Model, Vec<u8>)> = LazyLock::new(|| {
    let mut model = column(2.0, SPACING, 1, soils().pop().unwrap(), Some(WATER));
    model.numerics.diffusion = Diffusion::Implicit;
    let mut simulation = Simulation::new(&model, 1).unwrap();
    simulation.begin(shaken()).unwrap();
    simulation.advance(20, f64::INFINITY).unwrap();
    let bytes = stored(&simulation);
    (model, bytes)
});

fn refusal(bytes: &[u8]) -> StateError {
    match Simulation::restore(&SMALL.0, 1, bytes) {
        Err(SolverError::State(error)) => error,
        other => panic!("{other:?}"),
    }
}

#[test]
fn a_state_of_something_else_is_refused() {
    let (model, bytes) = &*SMALL;
    assert_eq!(checkpoint::note(bytes).unwrap(), b"note");
    let mut other = model.clone();
    other.regions[0].porosity += 1e-12;
    let error = Simulation::restore(&other, 1, bytes).unwrap_err();
    assert!(matches!(error, SolverError::State(StateError::OtherModel)), "{error}");
    assert_eq!(refusal(b"a file of some other program"), StateError::Foreign);
    assert_eq!(refusal(b""), StateError::Foreign);
    let mut of_version_nine = bytes.clone();
    of_version_nine[8] = 9;
    assert_eq!(refusal(&of_version_nine), StateError::Version { found: 9, needed: 1 });
    let mut of_other_build = bytes.clone();
    of_other_build[12] ^= 1;
    assert_eq!(refusal(&with_correct_checksum(of_other_build)), StateError::Build);
}

/// The bytes with a correct checksum.
fn with_correct_checksum(mut bytes: Vec<u8>) -> Vec<u8> {
    bytes.truncate(bytes.len() - 4);
    let sum = crc32fast::hash(&bytes);
    bytes.extend(sum.to_le_bytes());
    bytes
}

/// Where the state itself begins: after magic, version, build, length of the note and the note.
const STATE_AT: usize = 8 + 4 + 4 + 8 + 4;

proptest! {
    #[test]
    fn flipped_bits_are_detected(flips in prop::collection::vec((any::<prop::sample::Index>(), 1_u8..), 1..4)) {
        let mut bytes = SMALL.1.clone();
        let mut places = Vec::new();
        for (index, mask) in flips {
            let place = index.index(bytes.len());
            // Two changes at the same byte may cancel.
            if !places.contains(&place) {
                bytes[place] ^= mask;
                places.push(place);
            }
        }
        let error = refusal(&bytes);
        let head = places.iter().any(|&place| place < 12);
        prop_assert!(head || matches!(error, StateError::Damaged(_)), "{error}");
        prop_assert!(checkpoint::note(&bytes).is_err());
    }

    #[test]
    fn missing_and_added_bytes_are_detected(index in any::<prop::sample::Index>(), added in prop::collection::vec(any::<u8>(), 1..9)) {
        let bytes = &SMALL.1;
        let length = index.index(bytes.len());
        let error = refusal(&bytes[..length]);
        prop_assert!(length < 8 || matches!(error, StateError::Damaged(_)), "{error}");
        let error = refusal(&[bytes.as_slice(), &added].concat());
        prop_assert!(matches!(error, StateError::Damaged(_)), "{error}");
    }

    /// Changed bytes with a correct checksum give an error or a simulation, but no panic and no excessive
    /// memory.
    #[test]
    fn forged_states_are_read_without_panic(flips in prop::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 1..8), cut in 0_usize..64) {
        let mut bytes = SMALL.1.clone();
        for (index, value) in flips {
            let place = STATE_AT + index.index(bytes.len() - STATE_AT - 4);
            bytes[place] = value;
        }
        bytes.truncate(bytes.len() - cut);
        let _ = Simulation::restore(&SMALL.0, 1, &with_correct_checksum(bytes));
    }

    #[test]
    fn any_bytes_are_refused(bytes in prop::collection::vec(any::<u8>(), 0..200)) {
        let magic = [b"SANDBOIL\x01\0\0\0".as_slice(), &bytes].concat();
        prop_assert_eq!(refusal(&bytes), StateError::Foreign);
        prop_assert!(matches!(refusal(&magic), StateError::Damaged(_)));
    }
}
