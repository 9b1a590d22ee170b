//! Reflection of outgoing waves by base and sides.

use crate::{
    common::{elastic, shaking},
    free_field::{LAYOUTS, block},
    waves::{ricker, weightless},
};
use sandboil_solver::{Base, BaseSegment, Model, Shaking, Simulation, UpgoingWave, Vertical, Water};
use sandboil_sph::Vec2;

const DENSITY: f64 = 2.0;
const SHEAR_SPEED: f64 = 100.0;
const SHEAR_MODULUS: f64 = DENSITY * SHEAR_SPEED * SHEAR_SPEED;
const BULK_MODULUS: f64 = 2.0 * SHEAR_MODULUS;
const WATER: Water = Water { unit_weight: 10.0, bulk_modulus: 1e6 };
/// Half-width of the pulses over the spacing: they contain almost no waves shorter than 18 spacings.
const PULSE: f64 = 8.0;

fn speed(model: &Model, compression: bool) -> f64 {
    let region = &model.regions[0];
    let stiffness = if compression {
        BULK_MODULUS + 4.0 / 3.0 * SHEAR_MODULUS + model.water_stiffness(region.porosity)
    } else {
        SHEAR_MODULUS
    };
    (stiffness / model.mixture_density(0)).sqrt()
}

/// Weightless ground with absorbing edges on all sides and an initial velocity field.
fn with_initial_velocity(model: &Model, velocity: impl Fn(Vec2) -> Vec2, probes: Vec<Vec2>) -> Simulation {
    let mut simulation = Simulation::new(model, 2).unwrap();
    let mut stage = Shaking { free_field: [true; 2], ..shaking(None, 10.0, probes) };
    stage.base.vertical = Vertical::Absorbing;
    simulation.begin(stage).unwrap();
    let field: Vec<[f64; 2]> = model.position.iter().map(|&x| velocity(x).into()).collect();
    simulation.set_velocity(&field).unwrap();
    simulation
}

/// Pulses that run to both sides at normal incidence: the reflection at a point half-way, over the pulse.
#[test]
fn sides_absorb_waves_at_normal_incidence() {
    const SPACING: f64 = 0.25;
    const WIDTH: f64 = 20.0;
    for (case, water, compression, bound) in [
        ("P, dry", None, true, 0.02),
        ("S, dry", None, false, 0.02),
        ("P, undrained", Some(WATER), true, 0.02),
    ] {
        let region = elastic(SHEAR_MODULUS, BULK_MODULUS);
        let dry = weightless(block(1.0, SPACING, 1, region.clone(), water));
        let (c, fastest) = (speed(&dry, compression), speed(&dry, true));
        // Tall enough that waves scattered at the ends of the pulse do not reach the middle.
        let height = 2.0 * SPACING * ((0.9 * WIDTH + 2.0 * PULSE * SPACING) * fastest / c / SPACING).ceil();
        let columns = (WIDTH / SPACING).round() as usize;
        let model = weightless(block(height, SPACING, columns, region, water));
        let direction = if compression { Vec2::x() } else { Vec2::y() };
        let shape = |x: Vec2| direction * (-((x.x - 0.5 * WIDTH) / (PULSE * SPACING)).powi(2)).exp();
        let mut simulation =
            with_initial_velocity(&model, shape, vec![Vec2::new(0.25 * WIDTH, 0.5 * height)]);
        simulation.advance(u64::MAX, 0.9 * WIDTH / c).unwrap();
        simulation.finish_histories();
        let (times, values) = simulation.take_histories();
        let names = simulation.channel_names();
        let name = if compression { "velocity_x" } else { "velocity_y" };
        let place = names.iter().position(|found| *found == name).unwrap();
        let largest = |from: f64, to: f64| {
            let inside = times.iter().zip(values.chunks(names.len()));
            let inside = inside.filter(|(t, _)| (from * WIDTH / c..to * WIDTH / c).contains(*t));
            inside.map(|(_, row)| row[place].abs()).fold(0.0, f64::max)
        };
        // The pulse passes at a quarter of the width, its reflection at three quarters.
        let (out, back) = (largest(0.0, 0.5), largest(0.6, 0.9));
        println!("{case}: {:.2} % of {out:.3} reflected, {} nodes", 100.0 * back / out, model.nodes());
        assert!((out - 0.5).abs() < 0.02, "{out}");
        assert!(back < bound * out, "{back} {out}");
    }
}

/// Beams that meet the sides at 45 degrees: the amplitude that stays in the section. Dashpots are exact for
/// normal incidence; here they reflect 7.0 % of plane P waves and 17.1 % of plane S waves, converted waves
/// included.
#[test]
#[ignore = "half a minute"]
fn sides_at_45_degrees() {
    const SPACING: f64 = 0.25;
    const WIDTH: f64 = 40.0;
    const HEIGHT: f64 = 160.0;
    // Several wavelengths wide, so that little of the beam travels in other directions.
    const BEAM: f64 = 16.0;
    for (case, compression, theory) in [("P", true, 0.070), ("S", false, 0.171)] {
        let region = elastic(SHEAR_MODULUS, BULK_MODULUS);
        let columns = (WIDTH / SPACING) as usize;
        let model = weightless(block(HEIGHT, SPACING, columns, region, None));
        let c = speed(&model, compression);
        let along = Vec2::new(1.0, 1.0).normalize();
        let across = Vec2::new(-along.y, along.x);
        // The gradient of a potential for P, its curl for S: neither contains the other.
        let beam = |x: Vec2| {
            let from = x - Vec2::new(0.5 * WIDTH, 0.5 * HEIGHT);
            let place = Vec2::new(from.dot(&along) / (PULSE * SPACING), from.dot(&across) / BEAM);
            let slope = place * (-place.norm_squared()).exp();
            let (slope_along, slope_across) = (slope.x, slope.y * PULSE * SPACING / BEAM);
            if compression {
                along * slope_along + across * slope_across
            } else {
                across * slope_along - along * slope_across
            }
        };
        let mut simulation = with_initial_velocity(&model, beam, Vec::new());
        let energy = |simulation: &Simulation| -> f64 {
            simulation.velocity().iter().map(|v| v[0] * v[0] + v[1] * v[1]).sum()
        };
        let before = energy(&simulation);
        // The beams' centres meet the sides after `0.5 sqrt 2 WIDTH`, their far edges two half-widths later.
        let way = 0.5 * 2.0_f64.sqrt() * WIDTH + 2.0 * (BEAM + PULSE * SPACING);
        simulation.advance(u64::MAX, way / c).unwrap();
        // Half of the energy is strain energy at this time.
        let amplitude = (2.0 * energy(&simulation) / before).sqrt();
        println!("{case} at 45 degrees: {:.1} % of the amplitude stays", 100.0 * amplitude);
        assert!((amplitude - theory).abs() < 0.05, "{amplitude}");
    }
}

const HEIGHT: f64 = 10.0;
const FREQUENCY: f64 = 5.0;
const AMPLITUDE: f64 = 0.01;

fn upgoing(time: f64) -> f64 {
    AMPLITUDE * ricker(FREQUENCY, time - 1.5 / FREQUENCY)
}

fn samples() -> Vec<f64> {
    (0..800).map(|k| upgoing(f64::from(k) * 1e-3)).collect()
}

/// Weightless ground of level surface on a base that rises to the right by an angle, between free-field sides.
fn on_inclined_base(angle: f64, spacing: f64, width: f64) -> Model {
    let slope = angle.to_radians().tan();
    let columns = (width / spacing).round() as usize;
    let mut model = weightless(block(HEIGHT, spacing, columns, elastic(SHEAR_MODULUS, BULK_MODULUS), None));
    // As in scenes, the three lowest cells of a column are stretched down to the base.
    model.position.retain(|x| x.y > slope * x.x);
    model.volume = vec![spacing * spacing; model.nodes()];
    for (x, volume) in model.position.iter_mut().zip(&mut model.volume) {
        let base = slope * x.x;
        let top = spacing * ((base / spacing - 0.5).ceil() + 3.0);
        if x.y < top {
            let height = (top - base) / 3.0;
            x.y = top - (top - x.y) / spacing * height;
            *volume = spacing * height;
        }
    }
    model.region = vec![0; model.nodes()];
    model.surface_elevation = vec![HEIGHT; model.nodes()];
    model.vertical_effective_stress = vec![0.0; 2 * model.nodes()];
    model.outline.base = vec![Vec2::zeros(), Vec2::new(width, slope * width)];
    if let [_, Some(right)] = &mut model.outline.sides {
        right.extent[0] = slope * width;
    }
    model
}

/// Times and one channel at every probe of a stage on free-field sides.
fn shaken(
    model: &Model,
    base: Base,
    duration: f64,
    probes: Vec<Vec2>,
    channel: &str,
) -> (Vec<f64>, Vec<Vec<f64>>) {
    let count = probes.len();
    let mut simulation = Simulation::new(model, 2).unwrap();
    let stage = Shaking { base, free_field: [true; 2], ..shaking(None, duration, probes) };
    simulation.begin(stage).unwrap();
    assert!(simulation.advance(u64::MAX, f64::INFINITY).unwrap());
    let (times, values) = simulation.take_histories();
    let names = simulation.channel_names();
    let place = names.iter().position(|name| *name == channel).unwrap();
    let of = |probe: usize| {
        values.chunks(count * names.len()).map(|row| row[probe * names.len() + place]).collect()
    };
    (times, (0..count).map(of).collect())
}

/// An upgoing shear wave passes an inclined base of matching impedance without reflection: the surface moves
/// by twice the wave, delayed by the height over the base's lowest point. The remaining error has two causes:
/// the stepped nodes above the base, and the wave on its way down, which meets the dashpots at the angle of
/// the base.
#[test]
fn an_inclined_matched_base_is_transparent() {
    const WIDTH: f64 = 16.0;
    let cases = [(0.0, 2.5), (10.0, 6.0), (20.0, 9.0)]
        .into_iter()
        .flat_map(|case| LAYOUTS.map(|layout| (case, layout)));
    for ((angle, bound), (name, layout)) in cases {
        for vertical in [Vertical::Roller, Vertical::Absorbing] {
            let model = layout(on_inclined_base(angle, 0.25, WIDTH));
            let base = Base { vertical, ..Base::shaken_by(Some(UpgoingWave::shear(1e-3, samples()))) };
            let probes = [0.1, 0.3, 0.5, 0.7, 0.9].map(|share| Vec2::new(share * WIDTH, HEIGHT)).to_vec();
            let (times, found) = shaken(&model, base, 0.6, probes, "velocity_x");
            let exact = |t: f64| 2.0 * upgoing(t - HEIGHT / SHEAR_SPEED);
            let misfit = |probe: &Vec<f64>| {
                let apart = times.iter().zip(probe).map(|(t, v)| (v - exact(*t)).abs());
                apart.fold(0.0, f64::max) / (2.0 * AMPLITUDE)
            };
            let worst: Vec<f64> = found.iter().map(|probe| 100.0 * misfit(probe)).collect();
            println!(
                "{name}, {angle} degrees, {vertical:?}: error {worst:.1?} % of the peak along the surface"
            );
            assert!(worst.iter().all(|off| *off < bound), "{worst:?}");
        }
    }
}

/// A vertical motion enters through an absorbing base and leaves again: twice the wave at the surface, then
/// rest.
#[test]
fn a_compression_wave_enters_and_leaves() {
    for water in [None, Some(WATER)] {
        let model = weightless(block(HEIGHT, 0.25, 16, elastic(SHEAR_MODULUS, BULK_MODULUS), water));
        let c = speed(&model, true);
        let wave = UpgoingWave { interval: 1e-3, horizontal: vec![0.0], vertical: samples() };
        let base = Base { vertical: Vertical::Absorbing, ..Base::shaken_by(Some(wave)) };
        let probes = vec![Vec2::new(2.0, HEIGHT), Vec2::new(0.0, HEIGHT)];
        let (times, found) = shaken(&model, base, 0.8, probes, "velocity_y");
        for probe in &found {
            let exact = |t: f64| 2.0 * upgoing(t - HEIGHT / c);
            let apart = times.iter().zip(probe).map(|(t, v)| (v - exact(*t)).abs()).fold(0.0, f64::max);
            let late =
                times.iter().zip(probe).filter(|(t, _)| **t > 0.7).map(|(_, v)| v.abs()).fold(0.0, f64::max);
            let share = |v: f64| 100.0 * v / (2.0 * AMPLITUDE);
            println!(
                "{}: off by {:.2} %, late {:.2} %",
                if water.is_some() { "saturated" } else { "dry" },
                share(apart),
                share(late)
            );
            assert!(share(apart) < 3.0 && share(late) < 1.0);
        }
    }
}

/// A wave that travels along the base travels along the surface at the same apparent velocity, as an inclined
/// shear wave does. The columns beyond the sides are shaken vertically at their own times, which causes a
/// small error.
#[test]
fn a_travelling_wave_keeps_its_apparent_velocity() {
    const WIDTH: f64 = 40.0;
    for apparent in [500.0, -500.0, 1000.0] {
        let model = on_inclined_base(0.0, 0.5, WIDTH);
        let start = if apparent > 0.0 { 0.0 } else { -WIDTH / apparent };
        let segment =
            BaseSegment { extent: [0.0, WIDTH], wave: Some(0), delay: start, slowness: 1.0 / apparent };
        let base = Base {
            vertical: Vertical::Absorbing,
            segments: vec![segment],
            ..Base::shaken_by(Some(UpgoingWave::shear(1e-3, samples())))
        };
        let probes = vec![Vec2::new(0.25 * WIDTH, HEIGHT), Vec2::new(0.75 * WIDTH, HEIGHT)];
        let (times, found) = shaken(&model, base, 0.8, probes, "velocity_x");
        let arrival = |probe: &Vec<f64>| {
            let at = (0..probe.len()).max_by(|&a, &b| probe[a].total_cmp(&probe[b])).unwrap();
            (times[at], probe[at] / (2.0 * AMPLITUDE))
        };
        let [(t0, first), (t1, second)] = [arrival(&found[0]), arrival(&found[1])];
        let surface_speed = 0.5 * WIDTH / (t1 - t0);
        println!(
            "apparent {apparent} m/s: {surface_speed:.0} m/s at the surface, peaks {first:.3} and {second:.3} of twice the wave"
        );
        assert!((surface_speed / apparent - 1.0).abs() < 0.1, "{surface_speed}");
    }
}
