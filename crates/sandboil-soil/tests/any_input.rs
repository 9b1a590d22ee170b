//! For any finite input, a model either returns an error or finite results: no NaN and no panic. An update that fails
//! leaves the state unchanged.

use proptest::prelude::*;
use sandboil_soil::elastic::Elastic;
use sandboil_soil::pm4sand::{Options, PM4Sand, Parameters};
use sandboil_soil::{Integrator, Moduli, SoilError, SoilModel, StrainIncrement, Stress};

/// Largest number of parts of an increment: enough for several commits, few enough for a short test.
const MOST_PARTS: f64 = 3.0;

/// Any finite number, with all exponents equally probable.
fn any_number() -> impl Strategy<Value = f64> {
    use prop::num::f64::{NEGATIVE, NORMAL, POSITIVE, SUBNORMAL, ZERO};
    POSITIVE | NEGATIVE | NORMAL | SUBNORMAL | ZERO
}

/// Any finite number, or one near a usual value for soil.
fn number(usual: f64) -> impl Strategy<Value = f64> {
    prop_oneof![any_number(), -usual..usual, (0.0..1.0).prop_map(move |share: f64| usual * share)]
}

fn option(usual: f64) -> impl Strategy<Value = Option<f64>> {
    prop_oneof![8 => Just(None), 1 => number(usual).prop_map(|value| Some(value.abs()))]
}

/// Parameter sets with mostly usual values, so that many are accepted.
fn parameters() -> impl Strategy<Value = Parameters> {
    let required = (
        prop_oneof![0.0..1.0, number(1.0).prop_map(f64::abs)],
        prop_oneof![Just(677.0), number(1e3).prop_map(f64::abs)],
        prop_oneof![Just(0.4), number(1.0).prop_map(f64::abs)],
    );
    let usual = [
        100.0, 0.5, 0.8, 0.5, 0.5, 0.1, 1.2, 10.0, 250.0, 0.5, 33.0, 0.5, 2.0, 10.0, 10.0, 10.0, 1.5, 0.01,
        0.1, 20.0,
    ];
    (required, usual.map(option)).prop_map(|((dr, g0, hpo), given)| {
        let [
            p_atm,
            ho,
            e_max,
            e_min,
            nb,
            nd,
            ado,
            z_max,
            cz,
            ce,
            phi_cv,
            nu,
            c_gd,
            c_dr,
            c_kaf,
            q,
            r,
            m,
            f_sed_min,
            p_sed_o,
        ] = given;
        Parameters {
            dr,
            g0,
            hpo,
            p_atm,
            ho,
            e_max,
            e_min,
            nb,
            nd,
            ado,
            z_max,
            cz,
            ce,
            phi_cv,
            nu,
            c_gd,
            c_dr,
            c_kaf,
            q,
            r,
            m,
            f_sed_min,
            p_sed_o,
        }
    })
}

fn options() -> impl Strategy<Value = Options> {
    any::<[bool; 4]>().prop_map(
        |[clamp_plastic_modulus, consistent_loading_index, gap_memory, post_shaking]| Options {
            clamp_plastic_modulus,
            consistent_loading_index,
            gap_memory,
            post_shaking,
        },
    )
}

fn stress() -> impl Strategy<Value = Stress> {
    [number(200.0), number(200.0), number(100.0), number(200.0)].prop_map(|[xx, yy, xy, zz]| Stress {
        xx,
        yy,
        xy,
        zz,
    })
}

fn increment() -> impl Strategy<Value = StrainIncrement> {
    let usual = || prop_oneof![number(10.0), number(1e-3), number(1e-5)];
    (usual(), usual(), usual(), number(1.0)).prop_map(|(xx, yy, xy, spin)| StrainIncrement {
        xx,
        yy,
        xy,
        spin,
    })
}

/// The three integrators, with parts no smaller than a share of the increment, to limit the time of the test.
fn integrator_for(kind: usize, de: &StrainIncrement, tolerance: f64) -> Integrator {
    let largest = de.xx.abs().max(de.yy.abs()).max(de.xy.abs());
    let max_increment = Integrator::DEFAULT_INCREMENT.max(largest / MOST_PARTS);
    match kind {
        0 => Integrator::ModifiedEuler { tolerance, max_increment },
        1 => Integrator::RungeKutta4 { max_increment },
        _ if largest <= MOST_PARTS * Integrator::REFERENCE_INCREMENT => Integrator::Reference,
        _ => Integrator::ModifiedEuler { tolerance: Integrator::DEFAULT_TOLERANCE, max_increment },
    }
}

fn all_finite(numbers: impl IntoIterator<Item = f64>) -> bool {
    numbers.into_iter().all(f64::is_finite)
}

/// Applies increments to a model from an initial stress and checks all outputs after each.
fn drive<M: SoilModel>(
    model: &M,
    (stress, void_ratio): (Stress, Option<f64>),
    path: &[(StrainIncrement, usize, f64)],
) -> Result<(), TestCaseError> {
    let Ok(mut state) = model.initialise(stress, void_ratio) else { return Ok(()) };
    let check = |state: &M::State, context: &dyn std::fmt::Debug| {
        let (stress, Moduli { bulk, shear }) = (model.stress(state), model.moduli(state));
        prop_assert!(
            all_finite([stress.xx, stress.yy, stress.xy, stress.zz]),
            "{stress:?} after {context:?}"
        );
        prop_assert!(all_finite([bulk, shear]), "K {bulk}, G {shear} after {context:?}");
        prop_assert!(model.void_ratio(state).is_none_or(f64::is_finite), "void ratio after {context:?}");
        Ok(())
    };
    check(&state, &"initialise")?;
    for (de, kind, tolerance) in path {
        let before = format!("{state:?}");
        if model.update(&mut state, de, &integrator_for(*kind, de, *tolerance)).is_err() {
            prop_assert_eq!(&before, &format!("{state:?}"));
        }
        prop_assert!(!format!("{state:?}").contains("NaN"), "{state:?} after {de:?}");
        check(&state, de)?;
    }
    Ok(())
}

fn path() -> impl Strategy<Value = Vec<(StrainIncrement, usize, f64)>> {
    prop::collection::vec((increment(), 0..3_usize, any_number()), 1..8)
}

/// An increment with too many parts would take too long.
#[test]
fn an_increment_with_too_many_parts_is_refused() {
    let sand = Parameters { dr: 0.55, g0: 677.0, hpo: 0.4, ..Parameters::default() };
    let sand = PM4Sand::new(sand, Options::default()).unwrap();
    let start = Stress { xx: -50.0, yy: -100.0, xy: 0.0, zz: -50.0 };
    for max_increment in [1e-300, 0.0, -1.0] {
        let mut state = sand.initialise(start, None).unwrap();
        let de = StrainIncrement { xy: 1e-3, ..StrainIncrement::default() };
        let refusal = sand.update(&mut state, &de, &Integrator::RungeKutta4 { max_increment });
        assert!(matches!(refusal, Err(SoilError::StrainIncrementTooLarge { .. })), "{refusal:?}");
    }
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::with_cases(1000) })]

    #[test]
    fn pm4sand_of_any_parameters(
        parameters in parameters(),
        options in options(),
        stress in stress(),
        void_ratio in prop::option::of(number(1.0)),
        path in path(),
    ) {
        if let Ok(sand) = PM4Sand::new(parameters, options) {
            drive(&sand, (stress, void_ratio), &path)?;
        }
    }

    #[test]
    fn usual_sand_at_any_stress(options in options(), stress in stress(), path in path()) {
        let sand = Parameters { dr: 0.55, g0: 677.0, hpo: 0.4, ..Parameters::default() };
        drive(&PM4Sand::new(sand, options).unwrap(), (stress, None), &path)?;
    }

    #[test]
    fn elastic_of_any_moduli(
        shear in number(1e5),
        bulk in number(1e5),
        stress in stress(),
        path in path(),
    ) {
        if let Ok(rock) = Elastic::new(shear.abs(), bulk.abs()) {
            drive(&rock, (stress, None), &path)?;
        }
    }
}
