//! Reflection, transmission and stability at base and sides: spectra of reflections, layers on other
//! half-spaces, obstacles in wider domains, segments, and extreme input.

use crate::{
    common::{column, elastic, shaking},
    free_field::block,
    waves::{amplitude, ricker, surface_velocity, weightless},
};
use sandboil_solver::{
    Base, BaseSegment, Gravity, HalfSpace, Model, Shaking, Simulation, UpgoingWave, Vertical, Water,
};
use sandboil_sph::Vec2;
use std::f64::consts::PI;

const DENSITY: f64 = 2.0;
const SPEED: f64 = 100.0;
const SHEAR_MODULUS: f64 = DENSITY * SPEED * SPEED;
const BULK_MODULUS: f64 = 2.0 * SHEAR_MODULUS;
const WATER: Water = Water { unit_weight: 10.0, bulk_modulus: 1e6 };
const AMPLITUDE: f64 = 0.01;
const INTERVAL: f64 = 1e-3;

fn pulse(frequency: f64) -> impl Fn(f64) -> f64 {
    move |time| AMPLITUDE * ricker(frequency, time - 1.5 / frequency)
}

fn sampled(duration: f64, velocity: impl Fn(f64) -> f64) -> UpgoingWave {
    let samples = (duration / INTERVAL) as usize;
    UpgoingWave::shear(INTERVAL, (0..samples).map(|k| velocity(k as f64 * INTERVAL)).collect())
}

fn dry_block(height: f64, spacing: f64, columns: usize) -> Model {
    weightless(block(height, spacing, columns, elastic(SHEAR_MODULUS, BULK_MODULUS), None))
}

/// Runs a stage between free-field sides to its end: the largest speed of any node in each half of it, m/s.
fn largest_speeds(model: &Model, base: Base, duration: f64) -> [f64; 2] {
    let mut simulation = Simulation::new(model, 1).unwrap();
    let stage = Shaking { base, free_field: [true; 2], ..shaking(None, duration, Vec::new()) };
    simulation.begin(stage).unwrap();
    let mut largest = [0.0_f64; 2];
    while !simulation.is_complete() {
        simulation.advance(1, f64::INFINITY).unwrap();
        let half = usize::from(simulation.time() > 0.5 * duration);
        for [x, y] in simulation.velocity() {
            // A maximum would ignore NaN.
            assert!(x.is_finite() && y.is_finite());
            largest[half] = largest[half].max(x.hypot(y));
        }
    }
    largest
}

/// The part of a wave that a base reflects, by wavelength. A pulse at mid-height splits in two: one half
/// reaches the surface at a quarter of the run; the other meets the base first, and its reflection reaches
/// the surface at three quarters. The ratio of their spectra at the surface is the reflection coefficient,
/// without dispersion on the way up.
fn reflection(water: Option<Water>, compression: bool, vertical: Vertical) -> [f64; 2] {
    const SPACING: f64 = 0.2;
    const HEIGHT: f64 = 20.0;
    const HALF_WIDTH: f64 = 2.5;
    let mut model = weightless(column(HEIGHT, SPACING, 1, elastic(SHEAR_MODULUS, BULK_MODULUS), water));
    model.numerics.smoothing_ratio = 1.4;
    let stiffness = if compression {
        BULK_MODULUS + 4.0 / 3.0 * SHEAR_MODULUS + model.water_stiffness(model.regions[0].porosity)
    } else {
        SHEAR_MODULUS
    };
    let speed = (stiffness / model.mixture_density(0)).sqrt();
    let mut simulation = Simulation::new(&model, 1).unwrap();
    let mut stage = shaking(None, 2.0 * HEIGHT / speed, vec![Vec2::new(0.5 * SPACING, HEIGHT)]);
    stage.base.vertical = vertical;
    stage.output.history_interval = 0.01 * HEIGHT / speed;
    simulation.begin(stage).unwrap();
    let direction = if compression { [0.0, 1.0] } else { [1.0, 0.0] };
    let field: Vec<[f64; 2]> = model
        .position
        .iter()
        .map(|x| direction.map(|d| d * AMPLITUDE * (-((x.y - 0.5 * HEIGHT) / HALF_WIDTH).powi(2)).exp()))
        .collect();
    simulation.set_velocity(&field).unwrap();
    assert!(simulation.advance(u64::MAX, f64::INFINITY).unwrap());
    let (times, values) = simulation.take_histories();
    let names = simulation.channel_names();
    let name = if compression { "velocity_y" } else { "velocity_x" };
    let place = names.iter().position(|found| *found == name).unwrap();
    let surface: Vec<f64> = values.chunks(names.len()).map(|row| row[place]).collect();
    let spectrum = |from: f64, to: f64, wavelength: f64| {
        let inside = |time: f64| (from..to).contains(&(time * speed / HEIGHT));
        let windowed: Vec<f64> =
            times.iter().zip(&surface).map(|(t, v)| if inside(*t) { *v } else { 0.0 }).collect();
        amplitude(&times, &windowed, speed / wavelength)
    };
    // Wavelengths of 500 to 20 m and to 10 m: shear waves of 0.2 to 5 Hz and to 10 Hz.
    [(2, 50), (50, 100)].map(|(from, to)| {
        (from..=to)
            .map(|tenths| SPEED / (0.1 * f64::from(tenths)))
            .map(|wavelength| spectrum(1.0, 2.0, wavelength) / spectrum(0.0, 1.0, wavelength))
            .fold(0.0, f64::max)
    })
}

#[test]
fn the_base_reflects_little_of_any_wavelength() {
    for (case, water, compression, vertical) in [
        ("S", None, false, Vertical::Roller),
        ("S, absorbing", None, false, Vertical::Absorbing),
        ("P, dry", None, true, Vertical::Absorbing),
        ("P, undrained", Some(WATER), true, Vertical::Absorbing),
    ] {
        let [long, short] = reflection(water, compression, vertical);
        println!(
            "{case}: {:.2} % of waves of 20 m and longer, {:.2} % of 10 to 20 m",
            100.0 * long,
            100.0 * short
        );
        assert!(long <= 0.01 && short <= 0.02, "{case}: {long} {short}");
    }
    let [long, _] = reflection(None, true, Vertical::Roller);
    println!("P on a roller: {:.1} %", 100.0 * long);
    assert!((long - 1.0).abs() < 0.05, "{long}");
}

/// Ground at rest stays at rest when base and sides are released: they keep the reactions of the static
/// stage.
#[test]
fn nothing_moves_without_a_wave() {
    for water in [None, Some(WATER)] {
        let model = block(10.0, 0.5, 12, elastic(SHEAR_MODULUS, BULK_MODULUS), water);
        let mut simulation = Simulation::new(&model, 1).unwrap();
        simulation.begin(Gravity { tolerance: 1e-6, max_steps: 40_000 }).unwrap();
        assert!(simulation.advance(u64::MAX, f64::INFINITY).unwrap());
        let mut stage = Shaking { free_field: [true; 2], ..shaking(None, 1.0, Vec::new()) };
        stage.base.vertical = Vertical::Absorbing;
        simulation.begin(stage).unwrap();
        let mut fastest = 0.0_f64;
        while !simulation.is_complete() {
            simulation.advance(1, f64::INFINITY).unwrap();
            fastest = simulation.velocity().iter().map(|v| v[0].hypot(v[1])).fold(fastest, f64::max);
        }
        println!("water {}: at most {fastest:.1e} m/s", water.is_some());
        assert!(fastest < 1e-9, "{fastest}");
    }
}

/// One layer on a half-space, impedance ratio `q` of layer to half-space: surface over outcrop is `1 / (cos
/// kH + i q sin kH)`. Taken at complex frequencies `omega - i s`, so that the vibration left at the end of
/// the record does not count.
#[test]
fn a_layer_on_any_half_space_has_its_transfer_function() {
    const HEIGHT: f64 = 10.0;
    const DECAY: f64 = 3.0;
    const DURATION: f64 = 4.0;
    let model = weightless(column(HEIGHT, 0.25, 1, elastic(SHEAR_MODULUS, BULK_MODULUS), None));
    for ratio in [1e-2, 1e-1, 1.0, 1e1, 1e2] {
        let upgoing = pulse(3.0);
        let (times, found) = surface_velocity(&model, &upgoing, DURATION, |stage| {
            let shear_speed = SPEED / ratio;
            stage.base.half_space =
                Some(HalfSpace { shear_speed, compression_speed: None, density: DENSITY });
        });
        let faded = |values: &mut dyn Iterator<Item = f64>| -> Vec<f64> {
            values.zip(&times).map(|(v, t)| v * (-DECAY * t).exp()).collect()
        };
        let surface = faded(&mut found.iter().copied());
        let outcrop = faded(&mut times.iter().map(|t| 2.0 * upgoing(*t)));
        let off = [1.0, 2.0, 2.5, 3.0, 4.0, 5.0].map(|frequency| {
            // sin and cos of a + i b.
            let (a, b) = (2.0 * PI * frequency * HEIGHT / SPEED, -DECAY * HEIGHT / SPEED);
            let cos = [a.cos() * b.cosh(), -a.sin() * b.sinh()];
            let sin = [a.sin() * b.cosh(), a.cos() * b.sinh()];
            let exact = 1.0 / (cos[0] - ratio * sin[1]).hypot(cos[1] + ratio * sin[0]);
            amplitude(&times, &surface, frequency) / amplitude(&times, &outcrop, frequency) / exact - 1.0
        });
        println!("impedance ratio {ratio}: error {:.2?} %", off.map(|off| 100.0 * off));
        assert!(off.iter().all(|off| off.abs() < 0.02), "{ratio}: {off:?}");
    }
}

/// Soft ground in the middle scatters waves to the sides. The reflection of the sides is the difference from
/// a domain three times as wide, whose sides are so far away that they have no effect for most of the run.
#[test]
fn the_width_of_the_domain_does_not_affect_an_obstacle() {
    const HEIGHT: f64 = 10.0;
    const SPACING: f64 = 0.5;
    const WIDTH: f64 = 40.0;
    const DURATION: f64 = 0.9;
    let run = |width: f64, obstacle: bool| {
        let mut model = dry_block(HEIGHT, SPACING, (width / SPACING).round() as usize);
        model.regions.push(elastic(0.25 * SHEAR_MODULUS, 0.25 * BULK_MODULUS));
        for (region, x) in model.region.iter_mut().zip(&model.position) {
            let inside = (x.x - 0.5 * width).abs() < 3.0 && x.y > HEIGHT - 3.0;
            *region = u32::from(obstacle && inside);
        }
        let probes = [-5.0, 0.0, 5.0].map(|from| Vec2::new(0.5 * width + from, HEIGHT)).to_vec();
        let mut simulation = Simulation::new(&model, 2).unwrap();
        let base =
            Base { vertical: Vertical::Absorbing, ..Base::shaken_by(Some(sampled(DURATION, pulse(5.0)))) };
        simulation.begin(Shaking { base, free_field: [true; 2], ..shaking(None, DURATION, probes) }).unwrap();
        assert!(simulation.advance(u64::MAX, f64::INFINITY).unwrap());
        simulation.take_histories().1
    };
    let largest = |values: &mut dyn Iterator<Item = f64>| values.map(f64::abs).fold(0.0, f64::max);
    let (narrow, wide, plain) = (run(WIDTH, true), run(3.0 * WIDTH, true), run(WIDTH, false));
    assert_eq!(narrow.len(), wide.len());
    let peak = largest(&mut wide.iter().copied());
    let apart = largest(&mut narrow.iter().zip(&wide).map(|(a, b)| a - b)) / peak;
    let scattered = largest(&mut narrow.iter().zip(&plain).map(|(a, b)| a - b)) / peak;
    println!("three times as wide: {:.2} % of the peak; scattered {:.0} %", 100.0 * apart, 100.0 * scattered);
    assert!(scattered > 0.2, "{scattered}");
    assert!(apart < 0.03, "{apart}");
}

/// Segments move with their own records at their own times, and so do the columns above them at the sides.
#[test]
fn segments_move_the_ground_above_them() {
    const HEIGHT: f64 = 10.0;
    const WIDTH: f64 = 60.0;
    const LATER: f64 = 0.15;
    const DURATION: f64 = 0.8;
    let model = dry_block(HEIGHT, 0.5, 120);
    let segment = |extent: [f64; 2], wave: usize, delay: f64| BaseSegment {
        extent,
        wave: Some(wave),
        delay,
        slowness: 0.0,
    };
    let base = Base {
        vertical: Vertical::Absorbing,
        waves: vec![sampled(DURATION, pulse(5.0)), sampled(DURATION, |t| -0.5 * pulse(5.0)(t))],
        segments: vec![segment([0.0, 0.5 * WIDTH], 0, 0.0), segment([0.5 * WIDTH, WIDTH], 1, LATER)],
        ..Base::shaken_by(None)
    };
    let probes = vec![Vec2::new(0.0, HEIGHT), Vec2::new(WIDTH, HEIGHT)];
    let mut simulation = Simulation::new(&model, 2).unwrap();
    simulation.begin(Shaking { base, free_field: [true; 2], ..shaking(None, DURATION, probes) }).unwrap();
    assert!(simulation.advance(u64::MAX, f64::INFINITY).unwrap());
    let (times, values) = simulation.take_histories();
    let names = simulation.channel_names();
    let place = names.iter().position(|name| *name == "velocity_x").unwrap();
    let off = [(1.0, 0.0), (-0.5, LATER)].iter().enumerate().map(|(probe, (factor, delay))| {
        let exact = |t: f64| 2.0 * factor * pulse(5.0)(t - HEIGHT / SPEED - delay);
        let apart = times
            .iter()
            .zip(values.chunks(2 * names.len()))
            .map(|(t, row)| (row[probe * names.len() + place] - exact(*t)).abs());
        apart.fold(0.0, f64::max) / (2.0 * AMPLITUDE)
    });
    let off: Vec<f64> = off.collect();
    println!(
        "left and right of the joint: off by {:.1?} %",
        off.iter().map(|o| 100.0 * o).collect::<Vec<_>>()
    );
    // Waves scattered at the joint, three depths away, arrive within the run.
    assert!(off.iter().all(|off| *off < 0.1), "{off:?}");
}

/// A record that begins with its full velocity: the front overshoots by the shortest waves of the lattice,
/// and settles.
#[test]
fn a_step_in_the_record_settles() {
    let model = weightless(column(10.0, 0.25, 1, elastic(SHEAR_MODULUS, BULK_MODULUS), None));
    let (times, found) = surface_velocity(&model, |_| AMPLITUDE, 1.5, |_| ());
    let share = |v: f64| v / (2.0 * AMPLITUDE);
    let overshoot = share(found.iter().copied().fold(0.0, f64::max)) - 1.0;
    let before = times.iter().zip(&found).filter(|(t, _)| **t < 0.05).map(|(_, v)| share(v.abs()));
    let before = before.fold(0.0, f64::max);
    let late = times.iter().zip(&found).filter(|(t, _)| (0.8..1.4).contains(*t));
    let late = late.map(|(_, v)| (share(*v) - 1.0).abs()).fold(0.0, f64::max);
    println!(
        "step: overshoot {:.1} %, ahead of the front {:.2} %, late {:.3} %",
        100.0 * overshoot,
        100.0 * before,
        100.0 * late
    );
    assert!(overshoot < 0.3 && before < 0.01 && late < 0.01, "{overshoot} {before} {late}");
}

/// Few rows above the base, few columns between the sides: the ground moves with twice the wave and comes to rest.
#[test]
fn shallow_and_narrow_ground_is_stable() {
    const SPACING: f64 = 0.2;
    for (rows, columns) in [(5, 10), (2, 10), (1, 10), (20, 3), (20, 2), (20, 1), (1, 1)] {
        for vertical in [Vertical::Roller, Vertical::Absorbing] {
            let model = dry_block(f64::from(rows) * SPACING, SPACING, columns);
            let base = Base { vertical, ..Base::shaken_by(Some(sampled(1.0, pulse(5.0)))) };
            let [first, second] = largest_speeds(&model, base, 2.0).map(|v| v / (2.0 * AMPLITUDE));
            println!(
                "{rows} rows, {columns} columns, {vertical:?}: {first:.3} of twice the wave, later {second:.1e}"
            );
            assert!((first - 1.0).abs() < 0.05 && second < 1e-3, "{first} {second}");
        }
    }
}

/// Dashpots ten thousand times as strong as those of the soil neither limit the time step nor add energy.
#[test]
fn strong_dashpots_are_stable() {
    let model = dry_block(4.0, 0.2, 10);
    for vertical in [Vertical::Roller, Vertical::Absorbing] {
        let half_space =
            HalfSpace { shear_speed: 1e4 * SPEED, compression_speed: Some(2e4 * SPEED), density: DENSITY };
        let base = Base {
            vertical,
            half_space: Some(half_space),
            ..Base::shaken_by(Some(sampled(1.0, pulse(5.0))))
        };
        let [first, second] = largest_speeds(&model, base, 4.0).map(|v| v / (2.0 * AMPLITUDE));
        println!("{vertical:?}: {first:.3} of twice the wave, later {second:.3}");
        // On a rigid base the columns vibrate near their first mode with little damping, and the section with
        // them.
        assert!(first < 10.0 && second < first, "{first} {second}");
    }
}

/// Free-field sides gather at each node: results have the same bits with any number of threads. Without
/// free-field sides their arrays do not exist.
#[test]
fn threads_change_no_bit_between_free_field_sides() {
    let model = block(10.0, 0.5, 20, elastic(SHEAR_MODULUS, BULK_MODULUS), Some(WATER));
    let run = |threads: usize, sides: bool| {
        let mut simulation = Simulation::new(&model, threads).unwrap();
        let mut stage =
            Shaking { free_field: [sides; 2], ..shaking(Some(sampled(0.5, pulse(5.0))), 0.5, Vec::new()) };
        stage.base.vertical = Vertical::Absorbing;
        simulation.begin(stage).unwrap();
        simulation.advance(u64::MAX, f64::INFINITY).unwrap();
        simulation
    };
    let bits = |simulation: &Simulation| -> Vec<u64> {
        simulation.velocity().iter().flatten().map(|v| v.to_bits()).collect()
    };
    let [one, two] = [1, 2].map(|threads| run(threads, true));
    assert!(bits(&one) == bits(&two));
    assert!(one.arrays().iter().any(|(name, _)| *name == "free_field"));
    assert!(one.counters().free_field_calls > 0);
    let walls = run(1, false);
    assert!(walls.arrays().iter().all(|(name, _)| *name != "free_field"));
    assert_eq!(walls.counters().free_field_calls, 0);
}
