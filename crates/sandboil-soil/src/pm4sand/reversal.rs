//! Load reversal and the family of initial back-stress ratios (manual, section 3.4.2; Chen and Arduino 2021).

use super::{State, state::Components};
use crate::{Deviator, UpdateReport};

/// A reversal is near neutral if the cosine between trial direction and travelled direction is above minus this value.
const NEAR_NEUTRAL_COSINE: f64 = 0.05;

/// Detects a reversal, where the trial direction points back towards the back-stress ratio of the last reversal, and
/// then updates the history variables.
pub(super) fn detect(state: &mut State, trial_direction: Deviator, report: &mut UpdateReport) {
    let travelled = state.alpha - state.alpha_in_true;
    let forward = travelled.contract(trial_direction);
    // NaN is no reversal; the update refuses its result later.
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

    // After a small unload-reload loop on one side of zero shear, the older, apparent origin is kept, so that the
    // response after the loop is not too stiff.
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
