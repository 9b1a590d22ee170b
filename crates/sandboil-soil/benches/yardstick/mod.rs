//! The yardstick: one exponential, one power and one square root. Times in units of it can be compared between
//! machines.

use std::hint::black_box;
use std::time::Instant;

/// Yardsticks per timing, about 40 ms: as long as the timed work, so that other load slows both equally.
const YARDSTICKS: u32 = 2_000_000;
/// Number of timings. The fastest is used, because other load on the machine can only slow a timing.
const REPETITIONS: usize = 9;

/// Computes [`YARDSTICKS`] yardsticks. `black_box` prevents evaluation by the compiler.
fn yardsticks() -> f64 {
    let mut sum = 0.0;
    for i in 0..YARDSTICKS {
        let x = black_box(1.0 + 1e-6 * f64::from(i));
        sum += (-x).exp() + x.powf(black_box(0.3)) + x.sqrt();
    }
    sum
}

fn seconds<T>(work: impl FnOnce() -> T) -> f64 {
    let start = Instant::now();
    black_box(work());
    start.elapsed().as_secs_f64()
}

/// Time of one of `count` pieces of `work`: in seconds, and in units of the yardstick, timed alternately with it.
pub fn compared<T>(count: f64, mut work: impl FnMut() -> T) -> (f64, f64) {
    let (mut piece, mut yardstick) = (f64::INFINITY, f64::INFINITY);
    for _ in 0..REPETITIONS {
        piece = piece.min(seconds(&mut work) / count);
        yardstick = yardstick.min(seconds(yardsticks) / f64::from(YARDSTICKS));
    }
    (piece, piece / yardstick)
}
