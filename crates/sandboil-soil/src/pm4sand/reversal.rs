//! Load reversal and the family of initial back-stress ratios (manual, section 3.4.2; Chen and Arduino 2021).

use super::{State, state::Components};
use crate::{Deviator, UpdateReport};

/// A reversal is near neutral while the trial direction is within this cosine of the tangent.
const NEAR_NEUTRAL_COSINE: f64 = 0.05;

/// Declares a reversal when the trial direction points back from the last one, and renews what a reversal renews.
pub(super) fn detect(state: &mut State, trial_direction: Deviator, report: &mut UpdateReport) {
    let travelled = state.alpha - state.alpha_in_true;
    let forward = travelled.contract(trial_direction);
    // A direction that is not a number declares nothing; the update refuses the result afterwards.
    if !(forward < 0.0) {
        return;
    }
    report.reversals += 1;
    if forward > -NEAR_NEUTRAL_COSINE * travelled.norm() {
        report.near_neutral_reversals += 1;
    }

    state.alpha_in_previous = state.alpha_in;
    state.alpha_in_true = state.alpha;
    state.fabric_in = state.fabric;

    let p = state.mean.max(state.p_min);
    let zp = state.fabric.norm() * p;
    if state.before_first_reversal || (zp > state.zp_max && p > state.p_zp) {
        state.zp_max = zp;
        state.p_zp = p;
        state.before_first_reversal = false;
    }

    let alpha = Components::of(state.alpha);
    for i in 0..3 {
        if state.alpha_in.0[i] > 0.0 {
            state.alpha_min.0[i] = state.alpha_min.0[i].min(alpha.0[i]);
        } else {
            state.alpha_max.0[i] = state.alpha_max.0[i].max(alpha.0[i]);
        }
    }

    // A small unload-reload loop on one side keeps the older, apparent origin: no over-stiff response after it.
    let small_loop = state.alpha.xy * state.alpha_in_previous.0[2] > 0.0;
    state.alpha_in = alpha;
    if small_loop {
        let direction = Components::of(trial_direction);
        for i in 0..3 {
            state.alpha_in.0[i] = if direction.0[i] > 0.0 {
                state.alpha_min.0[i].max(0.0)
            } else {
                state.alpha_max.0[i].min(0.0)
            };
        }
    }
}
