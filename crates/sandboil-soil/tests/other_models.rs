//! Properties of every model except PM4Sand for any state and strain, and comparison with closed-form solutions.

#![allow(clippy::unwrap_used, reason = "a failure here is a failure of the test")]

mod point;

use point::rotated;
use proptest::prelude::*;
use sandboil_soil::drucker_prager::{DruckerPrager, Matching, Parameters, Softening};
use sandboil_soil::elastic::Elastic;
use sandboil_soil::mohr_coulomb::MohrCoulomb;
use sandboil_soil::pressure_elastic::PressureElastic;
use sandboil_soil::total_stress::{self, Criterion, Decay, TotalStress};
use sandboil_soil::{
    Integrator, Moduli, Soil, SoilError, SoilModel, StrainIncrement, Strength, Stress, with_model,
};

/// Allowed round-off, relative to the numbers that it comes from.
const ROUND_OFF: f64 = 1e-12;

const G: f64 = 9.1e4;
const K: f64 = 2.7e5;

fn skeleton() -> Elastic {
    Elastic::new(G, K).unwrap()
}

fn strength(c: f64, phi: f64, psi: f64) -> Strength {
    Strength { c, phi, psi }
}

fn cone(peak: Strength, matching: Matching) -> Parameters {
    Parameters { peak, softening: None, tension_cutoff: None, matching }
}

fn drucker_prager(peak: Strength, matching: Matching) -> DruckerPrager {
    DruckerPrager::new(skeleton(), cone(peak, matching)).unwrap()
}

fn softening_cone() -> DruckerPrager {
    let softening = Softening { residual: strength(2.0, 20.0, 0.0), strain: 0.05 };
    let parameters = Parameters {
        softening: Some(softening),
        tension_cutoff: Some(3.0),
        ..cone(strength(14.4, 31.0, 10.0), Matching::General)
    };
    DruckerPrager::new(skeleton(), parameters).unwrap()
}

/// Slope and size of the usual and of the general cone, by their textbook formulas.
fn cone_constants(Strength { c, phi, psi }: Strength, matching: Matching) -> (f64, f64) {
    let (tan, sin) = (phi.to_radians().tan(), phi.to_radians().sin());
    let slope = |angle: f64| {
        let tan = angle.to_radians().tan();
        tan / (9.0 + 12.0 * tan * tan).sqrt()
    };
    let b = slope(psi);
    match matching {
        Matching::Usual => (slope(phi), 3.0 * c / (9.0 + 12.0 * tan * tan).sqrt()),
        Matching::General => {
            let a = sin / (3.0 * (1.0 - 3.0 * b * b).sqrt() + 3.0 * b * sin);
            (a, if phi == 0.0 { c } else { 3.0 * a * c / tan })
        }
    }
}

fn cone_excess(stress: &Stress, (a, k): (f64, f64)) -> f64 {
    stress.root_j2() + a * stress.first_invariant() - k
}

/// Yield function of a stress after a plastic shear strain, kPa.
type Excess = Box<dyn Fn(&Stress, f64) -> f64>;

struct Case {
    soil: Soil,
    excess: Excess,
}

const STRENGTHS: [Strength; 5] = [
    Strength { c: 14.4, phi: 31.0, psi: 0.0 },
    Strength { c: 0.0, phi: 37.0, psi: 5.0 },
    Strength { c: 5.0, phi: 30.0, psi: 30.0 },
    Strength { c: 20.0, phi: 0.0, psi: 0.0 },
    Strength { c: 1.0, phi: 89.0, psi: 0.0 },
];

fn cases() -> Vec<Case> {
    let mut cases = Vec::new();
    for matching in [Matching::Usual, Matching::General] {
        for peak in STRENGTHS {
            cases.push(Case {
                soil: Soil::DruckerPrager(drucker_prager(peak, matching)),
                excess: Box::new(move |stress, _| cone_excess(stress, cone_constants(peak, matching))),
            });
        }
    }
    cases.push(Case {
        soil: Soil::DruckerPrager(softening_cone()),
        excess: Box::new(|stress, plastic| {
            let (a0, k0) = cone_constants(strength(14.4, 31.0, 10.0), Matching::General);
            let (a1, k1) = cone_constants(strength(2.0, 20.0, 0.0), Matching::General);
            let share = (plastic / 0.05).min(1.0);
            let on_cone = cone_excess(stress, (a0 + share * (a1 - a0), k0 + share * (k1 - k0)));
            on_cone.max(stress.first_invariant() - 9.0)
        }),
    });
    // Elasticity has no surface.
    cases.push(Case { soil: Soil::Elastic(skeleton()), excess: Box::new(|_, _| f64::NEG_INFINITY) });
    cases.push(Case {
        soil: Soil::PressureElastic(pressure_elastic()),
        excess: Box::new(|_, _| f64::NEG_INFINITY),
    });
    for tension_cutoff in [None, Some(0.0)] {
        for strength in STRENGTHS {
            cases.push(Case {
                soil: Soil::MohrCoulomb(MohrCoulomb::new(skeleton(), strength, tension_cutoff).unwrap()),
                excess: Box::new(move |stress, _| pyramid_excess(stress, strength, tension_cutoff)),
            });
        }
    }
    for criterion in [Criterion::Tresca, Criterion::VonMises] {
        for decay in [None, Some(Decay::Exponential), Some(Decay::Linear)] {
            cases.push(Case {
                soil: Soil::TotalStress(clay(criterion, decay)),
                excess: Box::new(move |stress, plastic| {
                    size_in(criterion, stress) - clay_strength(decay, plastic)
                }),
            });
        }
    }
    cases
}

/// Its moduli at 100 kPa are those of the other models.
fn pressure_elastic() -> PressureElastic {
    PressureElastic::new(skeleton(), 0.5, 100.0).unwrap()
}

/// Principal stresses in descending order, kPa.
fn principal(stress: &Stress) -> [f64; 3] {
    let mut principal =
        [stress.plane_mean() + stress.radius(), stress.plane_mean() - stress.radius(), stress.zz];
    principal.sort_by(|a, b| b.total_cmp(a));
    principal
}

fn pyramid_excess(stress: &Stress, Strength { c, phi, .. }: Strength, tension_cutoff: Option<f64>) -> f64 {
    let [largest, _, smallest] = principal(stress);
    let phi = phi.to_radians();
    let shear = 0.5 * (largest - smallest) + 0.5 * (largest + smallest) * phi.sin() - c * phi.cos();
    shear.max(tension_cutoff.map_or(f64::NEG_INFINITY, |tension| largest - tension))
}

fn pyramid(strength: Strength) -> MohrCoulomb {
    MohrCoulomb::new(skeleton(), strength, None).unwrap()
}

/// Undrained strength of 25 kPa that decreases to 5 kPa, with a plastic shear strain scale of 5 %.
fn clay(criterion: Criterion, decay: Option<Decay>) -> TotalStress {
    let softening = decay.map(|decay| total_stress::Softening { residual: 5.0, strain: 0.05, decay });
    TotalStress::new(skeleton(), criterion, 25.0, softening).unwrap()
}

fn clay_strength(decay: Option<Decay>, plastic: f64) -> f64 {
    match decay {
        None => 25.0,
        Some(Decay::Exponential) => 5.0 + 20.0 * (-plastic / 0.05).exp(),
        Some(Decay::Linear) => (25.0 - 20.0 * plastic / 0.05).max(5.0),
    }
}

fn size_in(criterion: Criterion, stress: &Stress) -> f64 {
    match criterion {
        Criterion::Tresca => (0.25 * (stress.xx - stress.yy).powi(2) + stress.xy.powi(2)).sqrt(),
        Criterion::VonMises => {
            let mean = stress.first_invariant() / 3.0;
            let squares = [stress.xx, stress.yy, stress.zz].map(|normal| 0.5 * (normal - mean).powi(2));
            (squares.iter().sum::<f64>() + stress.xy.powi(2)).sqrt()
        }
    }
}

fn size_of(stress: &Stress) -> f64 {
    stress.root_j2() + stress.first_invariant().abs()
}

fn is_finite(stress: &Stress) -> bool {
    [stress.xx, stress.yy, stress.xy, stress.zz].into_iter().all(f64::is_finite)
}

fn advance<M: SoilModel>(model: &M, state: &mut M::State, de: &StrainIncrement) {
    model.update(state, de, &Integrator::default()).unwrap();
}

fn strain_of(xx: f64, yy: f64, xy: f64) -> StrainIncrement {
    StrainIncrement { xx, yy, xy, spin: 0.0 }
}

fn isotropic(pressure: f64) -> Stress {
    Stress { xx: -pressure, yy: -pressure, xy: 0.0, zz: -pressure }
}

fn difference(a: &Stress, b: &Stress) -> f64 {
    [a.xx - b.xx, a.yy - b.yy, a.xy - b.xy, a.zz - b.zz].into_iter().fold(0.0, |most, d| most.max(d.abs()))
}

/// Work per volume over a strain increment from one stress to another, kJ/m3.
fn work(from: &Stress, to: &Stress, de: &StrainIncrement) -> f64 {
    0.5 * ((from.xx + to.xx) * de.xx + (from.yy + to.yy) * de.yy + (from.xy + to.xy) * de.xy)
}

fn increment(exponents: std::ops::Range<f64>) -> impl Strategy<Value = StrainIncrement> {
    (exponents, -1.0..1.0, -1.0..1.0, -1.0..1.0).prop_map(|(exponent, xx, yy, xy): (f64, f64, f64, f64)| {
        let size = 10.0_f64.powf(exponent);
        strain_of(size * xx, size * yy, size * xy)
    })
}

fn any_stress() -> impl Strategy<Value = Stress> {
    (-2.0..4.0, -1.0..1.0, -1.0..1.0, -1.0..1.0, -1.0..1.0).prop_map(
        |(exponent, xx, yy, xy, zz): (f64, f64, f64, f64, f64)| {
            let size = 10.0_f64.powf(exponent);
            Stress { xx: size * xx, yy: size * yy, xy: size * xy, zz: size * zz }
        },
    )
}

/// Fails unless every state of the path is finite and not outside the surface.
fn stays_inside<M: SoilModel>(
    model: &M,
    excess: &dyn Fn(&Stress, f64) -> f64,
    start: Stress,
    path: &[StrainIncrement],
) -> Result<(), TestCaseError> {
    let mut state = model.initialise(start, None).unwrap();
    let mut largest = size_of(&start);
    let mut path = path.iter();
    let mut before = 0.0;
    loop {
        let stress = model.stress(&state);
        let plastic = model.plastic_shear_strain(&state).unwrap_or(0.0);
        let f = excess(&stress, plastic);
        prop_assert!(f <= ROUND_OFF * (largest + 1.0), "{model:?}: f = {f} kPa at {stress:?}");
        prop_assert!(plastic >= before, "{model:?}: plastic shear strain falls from {before} to {plastic}");
        before = plastic;
        let Some(de) = path.next() else { return Ok(()) };
        largest = size_of(&stress) + K * (de.xx.abs() + de.yy.abs() + de.xy.abs());
        advance(model, &mut state, de);
    }
}

/// Fails unless an additional spin rotates the stress and changes nothing else. Strain is given in the axes at the end
/// of a step.
fn is_indifferent<M: SoilModel>(
    model: &M,
    start: Stress,
    path: &[(StrainIncrement, f64)],
) -> Result<(), TestCaseError> {
    let mut still = model.initialise(start, None).unwrap();
    let mut turning = still;
    let mut clockwise = 0.0;
    let mut largest = 1.0_f64;
    for (de, spin) in path {
        clockwise += 2.0 * (0.5 * spin).atan();
        advance(model, &mut still, de);
        let [xx, yy, xy] = rotated([de.xx, de.yy, 0.5 * de.xy], -clockwise);
        advance(model, &mut turning, &StrainIncrement { xx, yy, xy: 2.0 * xy, spin: *spin });
        let (a, b) = (model.stress(&still), model.stress(&turning));
        let [xx, yy, xy] = rotated([a.xx, a.yy, a.xy], -clockwise);
        largest = largest.max(size_of(&a)).max(K * (de.xx.abs() + de.yy.abs() + de.xy.abs()));
        let off = difference(&b, &Stress { xx, yy, xy, zz: a.zz });
        prop_assert!(off <= 1e-9 * largest, "{model:?}: {off} kPa of {largest}");
    }
    Ok(())
}

/// Fails unless NaN, infinity and too large increments are refused and the state is unchanged.
fn refuses<M: SoilModel>(model: &M) {
    let mut state = model.initialise(isotropic(50.0), None).unwrap();
    advance(model, &mut state, &strain_of(1e-4, -2e-4, 3e-4));
    let before = format!("{state:?}");
    for bad in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
        for component in 0..4 {
            let mut de = StrainIncrement { spin: 1e-3, ..strain_of(1e-5, 1e-5, 1e-5) };
            *[&mut de.xx, &mut de.yy, &mut de.xy, &mut de.spin][component] = bad;
            let refusal = model.update(&mut state, &de, &Integrator::default());
            assert!(matches!(refusal, Err(SoilError::NonFinite { .. })), "{model:?}: {refusal:?}");
            let mut stress = isotropic(50.0);
            *[&mut stress.xx, &mut stress.yy, &mut stress.xy, &mut stress.zz][component] = bad;
            assert!(matches!(model.initialise(stress, None), Err(SoilError::NonFinite { .. })), "{model:?}");
        }
    }
    for de in [strain_of(10.01, 0.0, 0.0), strain_of(0.0, -10.01, 0.0), strain_of(0.0, 0.0, 1e300)] {
        let refusal = model.update(&mut state, &de, &Integrator::default());
        assert!(matches!(refusal, Err(SoilError::StrainIncrementTooLarge { .. })), "{model:?}: {refusal:?}");
    }
    // A finite increment gives a finite stress or an error.
    let de = strain_of(1e-5, 1e-5, 1e-5);
    for size in [1e150, 1e300, f64::MAX] {
        for sign in [1.0, -1.0] {
            let stress = Stress { xx: sign * size, yy: -sign * size, xy: size, zz: size };
            if let Ok(state) = model.initialise(stress, None) {
                assert!(is_finite(&model.stress(&state)), "{model:?}");
            }
        }
        let mut spun = state;
        match model.update(&mut spun, &StrainIncrement { spin: size, ..de }, &Integrator::default()) {
            Ok(_) => assert!(is_finite(&model.stress(&spun)), "{model:?}"),
            Err(_) => assert_eq!(format!("{spun:?}"), before),
        }
    }
    assert_eq!(format!("{state:?}"), before);
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::with_cases(256) })]

    #[test]
    fn carries_is_true_exactly_where_initialise_keeps_the_stress(stress in any_stress()) {
        for Case { soil, .. } in cases() {
            with_model!(&soil, model => {
                let kept = model.stress(&model.initialise(stress, None).unwrap()) == stress;
                prop_assert_eq!(model.carries(&stress), kept, "{:?}", model);
            });
        }
    }

    #[test]
    fn no_path_leaves_the_surface(
        start in any_stress(),
        path in prop::collection::vec(increment(-9.0..1.0), 60),
    ) {
        for Case { soil, excess } in cases() {
            with_model!(&soil, model => stays_inside(model, &excess, start, &path)?);
        }
    }

    #[test]
    fn spin_rotates_the_stress_and_changes_nothing_else(
        start in any_stress(),
        path in prop::collection::vec((increment(-6.0..-2.0), -0.5..0.5), 40),
    ) {
        for Case { soil, .. } in cases() {
            with_model!(&soil, model => is_indifferent(model, start, &path)?);
        }
    }
}

/// The net work of a closed strain path is zero, relative to the work exchanged along it, also where pressure changes.
#[test]
fn closed_loops_inside_the_surface_cost_no_energy() {
    for Case { soil, .. } in cases() {
        with_model!(&soil, model => {
            let mut state = model.initialise(isotropic(100.0), None).unwrap();
            let (mut spent, mut exchanged) = (0.0, 0.0);
            // In compression, far from any surface.
            let corners = [(-3.0, -3.0, 0.0), (-3.0, -3.0, 1.0), (-1.0, -1.0, 0.5), (0.0, 0.0, 0.0)];
            let mut at = (0.0, 0.0, 0.0);
            for corner in corners {
                let de = strain_of(1e-5 * (corner.0 - at.0), 1e-5 * (corner.1 - at.1), 1e-5 * (corner.2 - at.2));
                let before = model.stress(&state);
                advance(model, &mut state, &de);
                let done = work(&before, &model.stress(&state), &de);
                spent += done;
                exchanged += done.abs();
                at = corner;
            }
            assert!(spent.abs() <= 1e-13 * exchanged && exchanged > 1e-3, "{model:?}: {spent} {exchanged}");
        });
    }
}

#[test]
fn numbers_that_are_not_finite_or_too_large_are_refused() {
    for Case { soil, .. } in cases() {
        with_model!(&soil, model => refuses(model));
    }
}

#[test]
fn steps_from_1e_9_to_10_reversed_every_time_stay_inside() {
    for Case { soil, excess } in cases() {
        for start in [Stress::default(), isotropic(100.0)] {
            for exponent in -9..=1 {
                let size = 10.0_f64.powi(exponent);
                let path: Vec<_> = [1.0, -1.0]
                    .into_iter()
                    .cycle()
                    .take(40)
                    .map(|sign| strain_of(0.3 * sign * size, -0.2 * sign * size, sign * size))
                    .collect();
                with_model!(&soil, model => stays_inside(model, &excess, start, &path).unwrap());
            }
        }
    }
}

#[test]
fn inside_the_surface_the_stress_is_elastic() {
    for Case { soil, .. } in cases() {
        with_model!(&soil, model => {
            let mut state = model.initialise(isotropic(100.0), None).unwrap();
            let start = model.stress(&state);
            let mut expected = start;
            let small = 1e-6;
            let turns = [(1.0, -1.0, 1.0), (-2.0, 1.0, -1.0), (1.0, 0.0, 0.0)];
            for (xx, yy, xy) in turns {
                let de = strain_of(small * xx, small * yy, small * xy);
                advance(model, &mut state, &de);
                expected = Elastic::new(model.moduli(&state).shear, model.moduli(&state).bulk)
                    .unwrap()
                    .moved(&expected, &de);
                assert_eq!(model.stress(&state), expected, "{model:?}");
            }
            assert!(difference(&model.stress(&state), &start) <= ROUND_OFF * size_of(&start));
            assert_eq!(model.plastic_shear_strain(&state).unwrap_or(0.0), 0.0);
        });
    }
}

/// On a straight strain path from an isotropic stress, the flow direction is constant, so the return is exact.
#[test]
fn perfect_plasticity_is_independent_of_the_step_on_a_straight_path() {
    let direction = strain_of(1e-3, -3e-3, 2e-3);
    for Case { soil, .. } in cases() {
        let ends = [1, 7, 64].map(|parts| {
            with_model!(&soil, model => {
                let mut state = model.initialise(isotropic(100.0), None).unwrap();
                let part = 1.0 / f64::from(parts);
                for _ in 0..parts {
                    let de = strain_of(part * direction.xx, part * direction.yy, part * direction.xy);
                    advance(model, &mut state, &de);
                }
                (model.stress(&state), model.plastic_shear_strain(&state).unwrap_or(0.0))
            })
        });
        // Softening with dilatancy uses the flow direction at the beginning of the step; all other cases are exact.
        let dilates_less = matches!(&soil, Soil::DruckerPrager(model) if *model == softening_cone());
        let allowed = if dilates_less { 0.02 } else { 1e-11 };
        for (stress, plastic) in &ends[1..] {
            assert!(difference(stress, &ends[0].0) <= allowed * size_of(&ends[0].0), "{soil:?}: {ends:?}");
            assert!((plastic - ends[0].1).abs() <= allowed * ends[0].1.max(1e-3), "{soil:?}: {ends:?}");
        }
    }
}

/// Radius of Mohr's circle at failure, kPa, in shear at constant in-plane mean stress.
fn radius_at_failure<M: SoilModel>(model: &M, mean: f64) -> f64 {
    let mut state = model.initialise(isotropic(-mean), None).unwrap();
    for _ in 0..4000 {
        let mut volume = 0.0;
        let mut next = state;
        for _ in 0..100 {
            next = state;
            advance(model, &mut next, &strain_of(0.5 * volume, 0.5 * volume, 1e-5));
            let off = mean - model.stress(&next).plane_mean();
            if off.abs() < 1e-12 * mean.abs() {
                break;
            }
            volume += off / (K + G / 3.0);
        }
        state = next;
    }
    model.stress(&state).radius()
}

fn mohr_coulomb_radius(Strength { c, phi, .. }: Strength, mean: f64) -> f64 {
    c * phi.to_radians().cos() - phi.to_radians().sin() * mean
}

#[test]
fn strength_at_failure_in_plane_strain() {
    for (peak, matching, radius) in [
        (strength(5.0, 30.0, 30.0), Matching::Usual, 29.3301),
        (strength(5.0, 30.0, 10.0), Matching::Usual, 28.837),
        (strength(5.0, 30.0, 0.0), Matching::Usual, 28.180),
        (strength(0.0, 37.0, 5.0), Matching::Usual, 28.864),
        (strength(5.0, 30.0, 30.0), Matching::General, 29.3301),
        (strength(5.0, 30.0, 10.0), Matching::General, 29.3301),
        (strength(5.0, 30.0, 0.0), Matching::General, 29.3301),
        (strength(0.0, 37.0, 5.0), Matching::General, 30.091),
    ] {
        let measured = radius_at_failure(&drucker_prager(peak, matching), -50.0);
        assert!((measured - radius).abs() < 6e-4, "{peak:?} {matching:?}: {measured} {radius}");
        if matching == Matching::General {
            assert!((measured / mohr_coulomb_radius(peak, -50.0) - 1.0).abs() < 1e-9, "{measured}");
        }
    }
}

#[test]
fn the_general_cone_has_the_mohr_coulomb_strength_at_failure_for_any_dilatancy() {
    for peak in [strength(5.0, 30.0, 0.0), strength(5.0, 30.0, 30.0), strength(0.0, 37.0, 5.0)] {
        let (pyramid, cone) = (pyramid(peak), drucker_prager(peak, Matching::General));
        let expected = mohr_coulomb_radius(peak, -50.0);
        for measured in [radius_at_failure(&pyramid, -50.0), radius_at_failure(&cone, -50.0)] {
            assert!((measured / expected - 1.0).abs() < 1e-9, "{peak:?}: {measured} {expected}");
        }
    }
}

/// Stress at failure, kPa, in compression along y at constant lateral stress.
fn compressed<M: SoilModel>(model: &M, lateral: f64) -> Stress {
    let mut state = model.initialise(isotropic(-lateral), None).unwrap();
    for _ in 0..4000 {
        let mut xx = 0.0;
        let mut next = state;
        for _ in 0..400 {
            next = state;
            advance(model, &mut next, &strain_of(xx, -1e-5, 0.0));
            let off = lateral - model.stress(&next).xx;
            if off.abs() < 1e-12 * lateral.abs() {
                break;
            }
            xx += off / (K + 4.0 / 3.0 * G);
        }
        state = next;
    }
    model.stress(&state)
}

/// `sigma_1 = N sigma_3 + 2 c sqrt(N)`, `N = tan^2(45 + phi/2)`.
fn passive_strength(Strength { c, phi, .. }: Strength, lateral: f64) -> f64 {
    let n = (45.0 + 0.5 * phi).to_radians().tan().powi(2);
    n * lateral - 2.0 * c * n.sqrt()
}

#[test]
fn strength_in_plane_strain_compression() {
    for peak in [strength(5.0, 30.0, 10.0), strength(14.4, 31.0, 0.0), strength(0.0, 37.0, 37.0)] {
        let expected = passive_strength(peak, -50.0);
        for stress in
            [compressed(&drucker_prager(peak, Matching::General), -50.0), compressed(&pyramid(peak), -50.0)]
        {
            assert!((stress.yy / expected - 1.0).abs() < 1e-8, "{peak:?}: {} {expected}", stress.yy);
        }
    }
}

/// Without dilatancy, `I1 = 3 K e_v` throughout; `sqrt(J2)` is elastic up to the cone and then lies on the cone.
#[test]
fn oedometric_compression() {
    let bulk = 0.8 * G;
    let peak = strength(14.4, 31.0, 0.0);
    let skeleton = Elastic::new(G, bulk).unwrap();
    let soil = DruckerPrager::new(skeleton, cone(peak, Matching::Usual)).unwrap();
    let (a, k) = cone_constants(peak, Matching::Usual);
    let mut state = soil.initialise(Stress::default(), None).unwrap();
    for step in 1..=200 {
        advance(&soil, &mut state, &strain_of(0.0, -5e-5, 0.0));
        let strain = -5e-5 * f64::from(step);
        let (first_invariant, elastic) = (3.0 * bulk * strain, -2.0 / 3.0_f64.sqrt() * G * strain);
        let expected = elastic.min(k - a * first_invariant);
        let stress = soil.stress(&state);
        assert!((stress.first_invariant() - first_invariant).abs() <= 1e-10 * first_invariant.abs());
        assert!((stress.root_j2() - expected).abs() <= 1e-10 * expected, "{step}");
        assert!((stress.xx - stress.zz).abs() <= 1e-10 * stress.xx.abs());
        assert_eq!(expected < elastic, step > 3, "the soil must yield in the fourth step");
    }
}

#[test]
fn without_dilatancy_plastic_flow_keeps_volume() {
    let soil = drucker_prager(strength(14.4, 31.0, 0.0), Matching::Usual);
    let mut state = soil.initialise(isotropic(100.0), None).unwrap();
    for _ in 0..100 {
        advance(&soil, &mut state, &strain_of(0.0, 0.0, 1e-3));
    }
    let stress = soil.stress(&state);
    assert!(soil.plastic_shear_strain(&state).unwrap() > 0.09);
    assert!((stress.first_invariant() + 300.0).abs() < 1e-9, "{stress:?}");
}

/// Dilatancy angle in plane strain: `sin(psi) = -d(e_v)/d(gamma)` of plastic strain, compression positive.
#[test]
fn plastic_flow_has_the_dilation_angle() {
    let psi = 10.0;
    for matching in [Matching::Usual, Matching::General] {
        let soil = drucker_prager(strength(5.0, 30.0, psi), matching);
        let mut state = soil.initialise(isotropic(50.0), None).unwrap();
        let (mut total, mut last) = (0.0, 0.0);
        for _ in 0..2000 {
            let mut volume = 0.0;
            let mut next = state;
            for _ in 0..100 {
                next = state;
                advance(&soil, &mut next, &strain_of(0.5 * volume, 0.5 * volume, 1e-5));
                volume += (-50.0 - soil.stress(&next).plane_mean()) / (K + G / 3.0);
            }
            state = next;
            total += volume;
            last = volume;
        }
        assert!(total > 0.0 && (last / 1e-5 - psi.to_radians().sin()).abs() < 1e-6, "{}", last / 1e-5);
    }
}

#[test]
fn hydrostatic_tension_ends_at_the_apex() {
    let peak = strength(14.4, 31.0, 0.0);
    let apex = 14.4 / 31.0_f64.to_radians().tan();
    for (tension_cutoff, tension) in [(None, apex), (Some(10.0), 10.0), (Some(0.0), 0.0)] {
        let parameters = Parameters { tension_cutoff, ..cone(peak, Matching::Usual) };
        let soil = DruckerPrager::new(skeleton(), parameters).unwrap();
        let mut state = soil.initialise(isotropic(20.0), None).unwrap();
        advance(&soil, &mut state, &strain_of(0.01, 0.01, 0.0));
        let stress = soil.stress(&state);
        assert!((stress.first_invariant() / 3.0 - tension).abs() <= 1e-11 * apex, "{stress:?}");
        let corner = {
            let (a, k) = cone_constants(peak, Matching::Usual);
            k - 3.0 * a * tension
        };
        assert!((stress.root_j2() - corner).abs() <= 1e-9, "{stress:?} {corner}");
        let again = soil.initialise(isotropic(-1000.0), None).unwrap();
        assert!((soil.stress(&again).first_invariant() / 3.0 - tension).abs() <= 1e-11 * apex);
        assert_eq!(soil.stress(&again).root_j2(), 0.0);
    }
}

/// `int k d(gamma) = (k_p + k_r)/2 kappa_s` during softening; after it, `k_r` per unit of shear strain.
#[test]
fn softening_ends_at_the_residual_strength_and_dissipates_the_area_under_the_curve() {
    let softening = Softening { residual: strength(8.0, 0.0, 0.0), strain: 0.02 };
    let parameters =
        Parameters { softening: Some(softening), ..cone(strength(20.0, 0.0, 0.0), Matching::Usual) };
    let soil = DruckerPrager::new(skeleton(), parameters).unwrap();
    let mut state = soil.initialise(isotropic(30.0), None).unwrap();
    let mut spent = 0.0;
    for _ in 0..10_000 {
        let before = soil.stress(&state);
        let de = strain_of(0.0, 0.0, 5e-6);
        advance(&soil, &mut state, &de);
        spent += work(&before, &soil.stress(&state), &de);
    }
    let stress = soil.stress(&state);
    assert!((stress.xy - 8.0).abs() < 1e-10);
    let plastic = soil.plastic_shear_strain(&state).unwrap();
    assert!((plastic - (0.05 - 8.0 / G)).abs() < 1e-12);
    let stored = 0.5 * 8.0 * 8.0 / G;
    let expected = 14.0 * 0.02 + 8.0 * (plastic - 0.02) + stored;
    assert!((spent / expected - 1.0).abs() < 1e-6, "{spent} {expected}");
}

/// The end state of softening converges with the step size; the strength at the end of each step is implicit.
#[test]
fn softening_converges_with_the_step() {
    let soil = softening_cone();
    let end = |parts: u32| {
        let mut state = soil.initialise(isotropic(100.0), None).unwrap();
        for _ in 0..parts {
            advance(&soil, &mut state, &strain_of(0.0, 0.0, 0.03 / f64::from(parts)));
        }
        soil.stress(&state)
    };
    let exact = end(6400);
    let errors = [25, 50, 100, 200].map(|parts| difference(&end(parts), &exact));
    for pair in errors.windows(2) {
        assert!(pair[1] < 0.6 * pair[0], "{errors:?}");
    }
    assert!(errors[3] < 1e-2 * size_of(&exact), "{errors:?}");
}

/// At a pressure where frictional strength falls faster than `G`, the point drops to its residual strength in one step.
#[test]
fn brittle_softening_drops_to_the_residual_strength() {
    let softening = Softening { residual: strength(1.0, 10.0, 0.0), strain: 1e-3 };
    let parameters =
        Parameters { softening: Some(softening), ..cone(strength(1.0, 40.0, 0.0), Matching::General) };
    let soil = DruckerPrager::new(skeleton(), parameters).unwrap();
    let pressure = 2000.0;
    let mut state = soil.initialise(isotropic(pressure), None).unwrap();
    let mut radii = Vec::new();
    for _ in 0..4000 {
        advance(&soil, &mut state, &strain_of(0.0, 0.0, 1e-5));
        radii.push(soil.stress(&state).radius());
    }
    let (a, k) = cone_constants(strength(1.0, 10.0, 0.0), Matching::General);
    assert!((radii[3999] - (k + 3.0 * a * pressure)).abs() < 1e-6);
    let drops = radii.windows(2).filter(|pair| pair[1] < pair[0] - 1.0).count();
    assert_eq!(drops, 1);
}

/// With associated flow plastic work is never negative.
#[test]
fn associated_flow_dissipates() {
    let peak = strength(5.0, 30.0, 30.0);
    dissipates(&drucker_prager(peak, Matching::Usual));
    dissipates(&pyramid(peak));
    dissipates(&clay(Criterion::Tresca, Some(Decay::Linear)));
    dissipates(&clay(Criterion::VonMises, Some(Decay::Exponential)));
}

fn dissipates<M: SoilModel>(soil: &M) {
    let inverse = |s: &Stress| {
        let mean = s.first_invariant() / 3.0;
        let strain = |component: f64| (component - mean) / (2.0 * G) + mean / (3.0 * K);
        [strain(s.xx), strain(s.yy), s.xy / G, strain(s.zz)]
    };
    let mut state = soil.initialise(isotropic(20.0), None).unwrap();
    let mut total = 0.0;
    for step in 0..2000 {
        let at = f64::from(step);
        let de = strain_of(1e-4 * (0.7 * at).cos(), -1e-4 * (0.91 * at).cos(), 3e-4 * (0.11 * at).sin());
        let before = soil.stress(&state);
        advance(soil, &mut state, &de);
        let after = soil.stress(&state);
        let (e0, e1) = (inverse(&before), inverse(&after));
        let plastic = [de.xx, de.yy, de.xy, 0.0];
        let stress = [after.xx, after.yy, after.xy, after.zz];
        let spent: f64 = (0..4).map(|i| stress[i] * (plastic[i] - (e1[i] - e0[i]))).sum();
        assert!(spent >= -1e-12, "{soil:?}: {spent} kPa in step {step}");
        total += spent;
    }
    assert!(total > 0.01, "{soil:?}: {total} kPa");
}

/// The return has a unique solution: admissible stress, non-negative flow on the active planes, no flow on the others.
/// A search over all combinations of planes must find the same solution.
#[test]
fn the_return_to_the_pyramid_is_the_unique_solution() {
    let mut generator = 1_u64;
    let mut random = move || {
        generator = generator.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (generator >> 11) as f64 / (1_u64 << 53) as f64 * 2.0 - 1.0
    };
    let mut edges = 0;
    for peak in STRENGTHS {
        let soil = pyramid(peak);
        for _ in 0..2000 {
            let start = Stress {
                xx: 100.0 * random(),
                yy: 100.0 * random(),
                xy: 50.0 * random(),
                zz: 100.0 * random(),
            };
            let mut state = soil.initialise(start, None).unwrap();
            let de = strain_of(2e-3 * random(), 2e-3 * random(), 2e-3 * random());
            let trial = skeleton().moved(&state, &de);
            advance(&soil, &mut state, &de);
            let expected = searched(principal(&trial), peak);
            let found = principal(&state);
            let size = size_of(&trial);
            for (ours, theirs) in found.into_iter().zip(expected) {
                assert!((ours - theirs).abs() <= 1e-9 * size, "{peak:?} {trial:?}: {found:?} {expected:?}");
            }
            let [largest, middle, smallest] = found;
            let on_edge =
                (largest - middle).min(middle - smallest) < 1e-9 * size && largest - smallest > 1e-6;
            edges += i32::from(on_edge);
            // The principal directions in the plane do not change.
            let (before, after) = (trial.plane_deviator(), state.plane_deviator());
            let cross = before.half_difference * after.xy - before.xy * after.half_difference;
            assert!(cross.abs() <= 1e-9 * size * size);
        }
    }
    assert!(edges > 500, "{edges} returns to an edge");
}

/// Principal stresses after the return of ordered trial ones, found from the flow rule by trial: one plane, two planes,
/// or the apex.
fn searched(trial: [f64; 3], Strength { c, phi, psi }: Strength) -> [f64; 3] {
    let (sin, cos) = phi.to_radians().sin_cos();
    let dilation = psi.to_radians().sin();
    let planes = [(0, 2), (0, 1), (1, 2)];
    let excess = |s: &[f64; 3], (i, j): (usize, usize)| s[i] - s[j] + (s[i] + s[j]) * sin - 2.0 * c * cos;
    let fall = |(i, j): (usize, usize)| {
        let mut flow = [0.0; 3];
        flow[i] = 1.0 + dilation;
        flow[j] = dilation - 1.0;
        let volume: f64 = flow.iter().sum();
        flow.map(|share| 2.0 * G * share + (K - 2.0 / 3.0 * G) * volume)
    };
    let size = trial.iter().fold(1.0_f64, |most, s| most.max(s.abs()));
    let inside = |s: &[f64; 3]| {
        planes.iter().chain(&[(1, 0), (2, 0), (2, 1)]).all(|plane| excess(s, *plane) <= 1e-10 * size)
    };
    if inside(&trial) {
        return trial;
    }
    let moved = |flows: &[((usize, usize), f64)]| {
        let mut s = trial;
        for (plane, share) in flows {
            for (stress, fall) in s.iter_mut().zip(fall(*plane)) {
                *stress -= share * fall;
            }
        }
        s
    };
    let effect =
        |on: (usize, usize), of: (usize, usize)| excess(&trial, on) - excess(&moved(&[(of, 1.0)]), on);
    for plane in planes {
        let share = excess(&trial, plane) / effect(plane, plane);
        let s = moved(&[(plane, share)]);
        if share >= 0.0 && inside(&s) {
            return s;
        }
    }
    for (a, b) in [(planes[0], planes[1]), (planes[0], planes[2])] {
        let determinant = effect(a, a) * effect(b, b) - effect(a, b) * effect(b, a);
        let (fa, fb) = (excess(&trial, a), excess(&trial, b));
        let x = (fa * effect(b, b) - fb * effect(a, b)) / determinant;
        let y = (fb * effect(a, a) - fa * effect(b, a)) / determinant;
        let s = moved(&[(a, x), (b, y)]);
        if x >= 0.0 && y >= 0.0 && inside(&s) {
            return s;
        }
    }
    [c * cos / sin; 3]
}

/// Flow is the same for an out-of-plane smallest principal stress as for an in-plane one.
#[test]
fn the_out_of_plane_stress_may_govern_failure() {
    let peak = strength(5.0, 30.0, 0.0);
    let soil = pyramid(peak);
    let start = Stress { xx: -50.0, yy: -50.0, xy: 0.0, zz: passive_strength(peak, -50.0) };
    let mut state = soil.initialise(start, None).unwrap();
    assert!(difference(&state, &start) < 1e-10);
    // Stretching in the plane unloads the in-plane stresses; the out-of-plane stress must follow.
    advance(&soil, &mut state, &strain_of(2e-5, 2e-5, 0.0));
    assert!(state.xx > -50.0 && (state.zz - passive_strength(peak, state.xx)).abs() < 1e-9, "{state:?}");
    assert!((state.xx - state.yy).abs() < 1e-10);
}

#[test]
fn hydrostatic_tension_of_the_pyramid_ends_at_its_apex_or_cut_off() {
    let peak = strength(14.4, 31.0, 10.0);
    let apex = 14.4 / 31.0_f64.to_radians().tan();
    for (cutoff, tension) in [(None, apex), (Some(10.0), 10.0), (Some(0.0), 0.0)] {
        let soil = MohrCoulomb::new(skeleton(), peak, cutoff).unwrap();
        let mut state = soil.initialise(isotropic(20.0), None).unwrap();
        advance(&soil, &mut state, &strain_of(0.01, 0.01, 0.001));
        assert!(difference(&state, &isotropic(-tension)) < 1e-10, "{state:?}");
    }
    for tension in [-1.0, apex + 0.1, f64::NAN] {
        assert!(MohrCoulomb::new(skeleton(), peak, Some(tension)).is_err());
    }
}

#[test]
fn undrained_strength_is_the_radius_at_failure() {
    let tresca = clay(Criterion::Tresca, None);
    let von_mises = clay(Criterion::VonMises, None);
    // The out-of-plane stress starts far from the in-plane mean; von Mises has its full strength only at that mean.
    let start = Stress { zz: -80.0, ..isotropic(100.0) };
    let (mut a, mut b) =
        (tresca.initialise(start, None).unwrap(), von_mises.initialise(start, None).unwrap());
    let mut least = f64::INFINITY;
    for step in 0..400 {
        let de = strain_of(2e-5, -2e-5, 3e-5);
        advance(&tresca, &mut a, &de);
        advance(&von_mises, &mut b, &de);
        if step > 6 {
            assert!((tresca.stress(&a).radius() - 25.0).abs() < 1e-12);
            assert!(von_mises.stress(&b).radius() <= 25.0 * (1.0 + ROUND_OFF));
            least = least.min(von_mises.stress(&b).radius());
        }
    }
    assert!(least < 24.99, "{least}: the out-of-plane stress must reduce the strength");
    let end = von_mises.stress(&b);
    assert!((end.radius() - 25.0).abs() < 1e-9 && (end.zz - end.plane_mean()).abs() < 1e-6, "{end:?}");
    assert_eq!(tresca.stress(&a).zz, -80.0);
}

#[test]
fn undrained_flow_keeps_volume() {
    for criterion in [Criterion::Tresca, Criterion::VonMises] {
        let clay = clay(criterion, Some(Decay::Linear));
        let mut state = clay.initialise(isotropic(100.0), None).unwrap();
        for _ in 0..100 {
            advance(&clay, &mut state, &strain_of(1e-3, -1e-3, 1e-3));
        }
        advance(&clay, &mut state, &strain_of(-1e-3, 0.0, 0.0));
        let expected = -300.0 - 3.0 * K * 1e-3;
        assert!((clay.stress(&state).first_invariant() - expected).abs() < 1e-9);
    }
}

/// Closed form of the area under the strength curve: above the residual strength it is `S_u - S_r` times `kappa_s`
/// (exponential) or times half of it (linear).
#[test]
fn undrained_softening_dissipates_the_area_under_the_strength_curve() {
    for criterion in [Criterion::Tresca, Criterion::VonMises] {
        for decay in [Decay::Exponential, Decay::Linear] {
            let clay = clay(criterion, Some(decay));
            let mut state = clay.initialise(isotropic(100.0), None).unwrap();
            let mut spent = 0.0;
            for _ in 0..20_000 {
                let before = clay.stress(&state);
                let de = strain_of(0.0, 0.0, 2.5e-5);
                advance(&clay, &mut state, &de);
                spent += work(&before, &clay.stress(&state), &de);
            }
            let plastic = clay.plastic_shear_strain(&state).unwrap();
            let strength = clay_strength(Some(decay), plastic);
            assert!((clay.stress(&state).xy - strength).abs() < 1e-10 && strength < 5.01);
            assert!((plastic - (0.5 - strength / G)).abs() < 1e-12);
            let above = match decay {
                Decay::Exponential => 20.0 * 0.05 * (1.0 - (-plastic / 0.05).exp()),
                Decay::Linear => 20.0 * 0.05 / 2.0,
            };
            let expected = above + 5.0 * plastic + 0.5 * strength * strength / G;
            assert!((spent / expected - 1.0).abs() < 1e-6, "{criterion:?} {decay:?}: {spent} {expected}");
        }
    }
}

#[test]
fn moduli_are_the_elastic_ones() {
    for Case { soil, .. } in cases() {
        assert_eq!(soil.static_shear_modulus(), G);
        assert_eq!(soil.small_strain_moduli(isotropic(100.0)).unwrap(), Moduli { bulk: K, shear: G });
    }
}

#[test]
fn impossible_strengths_are_refused() {
    let refused = |parameters: Parameters, which: &str| {
        let refusal = DruckerPrager::new(skeleton(), parameters);
        let Err(SoilError::InvalidParameter { name, .. }) = refusal else {
            panic!("{which}: {refusal:?}");
        };
        assert_eq!(name, which);
    };
    let sound = strength(10.0, 30.0, 5.0);
    for (peak, which) in [
        (strength(10.0, 90.0, 0.0), "phi"),
        (strength(10.0, -1.0, 0.0), "phi"),
        (strength(10.0, f64::NAN, 0.0), "phi"),
        (strength(10.0, 30.0, 31.0), "psi"),
        (strength(10.0, 30.0, -1.0), "psi"),
        (strength(-1.0, 30.0, 0.0), "c"),
        (strength(f64::INFINITY, 30.0, 0.0), "c"),
        (strength(0.0, 0.0, 0.0), "c"),
    ] {
        refused(cone(peak, Matching::Usual), which);
    }
    for tension in [-1.0, 10.0 / 30.0_f64.to_radians().tan() + 0.1, f64::NAN, f64::INFINITY] {
        let parameters = Parameters { tension_cutoff: Some(tension), ..cone(sound, Matching::Usual) };
        refused(parameters, "tension_cutoff");
    }
    for (residual, strain, which) in [
        (strength(11.0, 30.0, 5.0), 0.1, "c_residual"),
        (strength(10.0, 31.0, 5.0), 0.1, "phi_residual"),
        (strength(10.0, 30.0, 6.0), 0.1, "psi_residual"),
        (strength(0.0, 0.0, 0.0), 0.1, "c_residual"),
        (strength(1.0, 30.0, 5.0), 0.0, "softening_strain"),
        (strength(1.0, 30.0, 5.0), 1e-5, "softening_strain"),
        (strength(1.0, 30.0, 5.0), f64::INFINITY, "softening_strain"),
    ] {
        let softening = Some(Softening { residual, strain });
        refused(Parameters { softening, ..cone(sound, Matching::Usual) }, which);
    }
}

/// Only updates that end at an apex or a cut-off are counted, not those inside or on the rest of the surface.
#[test]
fn returns_to_an_apex_or_a_cut_off_are_counted() {
    let peak = strength(14.4, 31.0, 10.0);
    let apex = 14.4 / 31.0_f64.to_radians().tan();
    let counted = |soil: &Soil, pressure: f64, de: &StrainIncrement| {
        let report = with_model!(soil, model => {
            let mut state = model.initialise(isotropic(pressure), None).unwrap();
            model.update(&mut state, de, &Integrator::default()).unwrap()
        });
        let counts = (report.tension_cutoffs, report.apex_returns);
        assert_eq!(report.named().iter().map(|(_, count)| count).sum::<u64>(), counts.0 + counts.1);
        counts
    };
    let tension = strain_of(0.01, 0.01, 0.0);
    for (tension_cutoff, in_tension) in
        [(None, (0, 1)), (Some(0.99 * apex), (1, 0)), (Some(3.0), (1, 0)), (Some(0.0), (1, 0))]
    {
        let parameters = Parameters { tension_cutoff, ..cone(peak, Matching::General) };
        let cone = Soil::DruckerPrager(DruckerPrager::new(skeleton(), parameters).unwrap());
        let pyramid = Soil::MohrCoulomb(MohrCoulomb::new(skeleton(), peak, tension_cutoff).unwrap());
        for soil in [cone, pyramid] {
            assert_eq!(counted(&soil, 100.0, &strain_of(1e-6, 1e-6, 1e-6)), (0, 0), "{soil:?}");
            assert_eq!(counted(&soil, 100.0, &strain_of(-1e-4, 0.0, 0.01)), (0, 0), "{soil:?}");
            assert_eq!(counted(&soil, 20.0, &tension), in_tension, "{soil:?}");
        }
    }
    // Without friction there is no apex, and tension is unlimited.
    let clay = strength(20.0, 0.0, 0.0);
    let cone = Soil::DruckerPrager(drucker_prager(clay, Matching::Usual));
    for soil in [cone, Soil::MohrCoulomb(pyramid(clay))] {
        assert_eq!(counted(&soil, 20.0, &tension), (0, 0), "{soil:?}");
    }
}
