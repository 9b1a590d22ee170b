//! What a bench's time is compared with, so that figures of different machines can be: one exponential, one power
//! and one square root.

use std::hint::black_box;
use std::time::Instant;

/// Yardsticks per timing: some 40 ms, as long as what is timed, so that a busy machine slows both alike.
const YARDSTICKS: u32 = 2_000_000;
/// Timings of which the fastest counts: others on the machine only slow it down.
const REPETITIONS: usize = 9;

/// One exponential, one power, one square root, each of numbers the compiler cannot foresee.
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

/// Seconds of one of `count` pieces of `work`, and the same in yardsticks timed in turn with it.
pub fn compared<T>(count: f64, mut work: impl FnMut() -> T) -> (f64, f64) {
    let (mut piece, mut yardstick) = (f64::INFINITY, f64::INFINITY);
    for _ in 0..REPETITIONS {
        piece = piece.min(seconds(&mut work) / count);
        yardstick = yardstick.min(seconds(yardsticks) / f64::from(YARDSTICKS));
    }
    (piece, piece / yardstick)
}
