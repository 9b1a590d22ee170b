//! Direct simple shear between turning points: no lateral strain, and either constant volume or constant vertical
//! stress.

use super::{
    Ending, Record, Specimen, Watch,
    control::{Compliance, Failure, Prescribed},
    record::cycles,
};
use crate::{
    SoilError,
    error::{finite, positive},
};

/// Largest number of trials to end an increment exactly at a turn.
const TURN_TRIALS: usize = 60;
/// Allowed difference of the shear stress from its turning point, relative to the distance between turns.
const TURN_TOLERANCE: f64 = 1e-9;
/// Smallest increment that is tried where the vertical stress is not met, relative to the strain step.
const SMALLEST_STEP: f64 = 1e-5;

/// A turning point.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Turn {
    /// At this shear stress, kPa.
    Stress(f64),
    /// At this shear strain (engineering, total).
    Strain(f64),
}

impl Turn {
    fn value(self) -> f64 {
        match self {
            Self::Stress(value) | Self::Strain(value) => value,
        }
    }
}

/// The sequence of turning points.
#[derive(Debug, Clone, PartialEq)]
pub enum Turns {
    /// A list of turns, in order.
    Each(Vec<Turn>),
    /// Two alternating turns.
    Alternating {
        /// First, third, fifth turn and so on.
        odd: Turn,
        /// Second, fourth turn and so on.
        even: Turn,
        /// Total number of turns.
        count: usize,
    },
}

impl Turns {
    fn get(&self, index: usize) -> Option<Turn> {
        match self {
            Self::Each(turns) => turns.get(index).copied(),
            Self::Alternating { odd, even, count } => {
                (index < *count).then_some(if index.is_multiple_of(2) { *odd } else { *even })
            }
        }
    }
}

/// A direct simple shear test.
#[derive(Debug, Clone, PartialEq)]
pub struct Shear {
    /// True: vertical effective stress is constant (drained). False: volume is constant (undrained).
    pub drained: bool,
    /// The turning points.
    pub turns: Turns,
    /// Shear strain (engineering) of one increment.
    pub strain_step: f64,
    /// Largest change of the shear strain from its value at the start; the test ends beyond it.
    pub strain_limit: f64,
}

impl Shear {
    /// Refuses a step or limit that is not positive, and turns that are not finite.
    fn check(&self) -> Result<(), SoilError> {
        positive("strain_step", self.strain_step)?;
        if !(self.strain_limit > 0.0) {
            let (name, value) = ("strain_limit", self.strain_limit);
            return Err(SoilError::InvalidParameter { name, value, expected: "positive" });
        }
        let turns = match &self.turns {
            Turns::Each(turns) => turns.as_slice(),
            Turns::Alternating { odd, even, .. } => &[*odd, *even],
        };
        turns.iter().try_for_each(|turn| finite("turn", turn.value()).map(|_| ()))
    }
}

/// One leg, from the last turn to the next.
struct Leg {
    turn: Turn,
    /// Sign of the change of the cycled quantity.
    direction: f64,
    /// Value of the cycled quantity (shear stress or strain) at the last turn.
    from: f64,
    /// Number of turns before this leg.
    turns: usize,
}

impl Leg {
    /// Present value of the cycled quantity.
    fn value(&self, specimen: &Specimen) -> f64 {
        match self.turn {
            Turn::Stress(_) => specimen.stress().xy,
            Turn::Strain(_) => specimen.strain[2],
        }
    }

    fn target(&self) -> f64 {
        self.turn.value()
    }

    /// Number of cycles so far, at a value of the cycled quantity.
    fn cycle(&self, value: f64) -> f64 {
        cycles(self.turns, (self.from, self.target()), value)
    }
}

impl Specimen {
    /// Shears the specimen through all turns. An empty record first receives the present state; every turn is recorded.
    /// Calls `stop` at regular intervals; true ends the test.
    pub fn shear(&mut self, test: &Shear, record: &mut Record, stop: &mut dyn FnMut() -> bool) -> Ending {
        if let Err(error) = test.check() {
            return Ending::Refused(error);
        }
        if record.rows().is_empty() {
            record.keep(self.row(0.0, 0));
        }
        let mut watch = Watch::new(stop);
        let start = self.strain[2];
        let vertical = self.stress().yy;
        let prescribed = Prescribed { by_stress: [false, test.drained, false], stress: [0.0, vertical, 0.0] };
        let mut compliance = Compliance::elastic(self.point.moduli(), prescribed.by_stress);
        let mut turns = 0;
        while let Some(turn) = test.turns.get(turns) {
            let mut leg = Leg { turn, direction: 1.0, from: 0.0, turns };
            leg.from = leg.value(self);
            leg.direction = (leg.target() - leg.from).signum();
            let ending = self.shear_leg(test, &leg, start, &prescribed, &mut compliance, record, &mut watch);
            if ending != Ending::Complete {
                record.keep(self.row(leg.cycle(leg.value(self)), turns));
                return ending;
            }
            turns += 1;
            record.keep(self.row(leg.cycle(leg.target()), turns));
        }
        Ending::Complete
    }

    #[expect(clippy::too_many_arguments, reason = "the context of one leg")]
    fn shear_leg(
        &mut self,
        test: &Shear,
        leg: &Leg,
        start: f64,
        prescribed: &Prescribed,
        compliance: &mut Compliance,
        record: &mut Record,
        watch: &mut Watch<'_>,
    ) -> Ending {
        if test.drained {
            *compliance = Compliance::elastic(self.point.moduli(), prescribed.by_stress);
        }
        let tolerance = TURN_TOLERANCE * (leg.target() - leg.from).abs();
        let (mut step, mut vertical_slope) = (test.strain_step, 0.0);
        while leg.direction * (leg.target() - leg.value(self)) > tolerance {
            if watch.interrupts() {
                return Ending::Interrupted;
            }
            let size = match leg.turn {
                Turn::Strain(value) => step.min((value - self.strain[2]).abs()),
                Turn::Stress(_) => step,
            };
            let made = self.shear_increment(leg, size, tolerance, vertical_slope, prescribed, compliance);
            match made {
                Ok([_, vertical, shear]) => {
                    vertical_slope = vertical / shear;
                    step = (2.0 * step).min(test.strain_step);
                }
                Err(Failure::Refused(error)) if !test.drained => return Ending::Refused(error),
                Err(_) if step > SMALLEST_STEP * test.strain_step => {
                    step *= 0.25;
                    vertical_slope = 0.0;
                    *compliance = Compliance::elastic(self.point.moduli(), prescribed.by_stress);
                    continue;
                }
                Err(Failure::Refused(error)) => return Ending::Refused(error),
                Err(Failure::NotMet) => {
                    let reached = self.stress();
                    let wanted = crate::Stress { yy: prescribed.stress[1], ..reached };
                    return Ending::StressNotCarried { wanted, reached };
                }
            }
            let value = leg.value(self);
            if leg.direction * (leg.target() - value) > tolerance {
                record.offer(self.row(leg.cycle(value), leg.turns));
            }
            if (self.strain[2] - start).abs() > test.strain_limit {
                return Ending::StrainLimit;
            }
        }
        Ending::Complete
    }

    /// One increment towards the turn. An increment that passes a turning stress is shortened to end at that stress.
    fn shear_increment(
        &mut self,
        leg: &Leg,
        size: f64,
        tolerance: f64,
        vertical_slope: f64,
        prescribed: &Prescribed,
        compliance: &mut Compliance,
    ) -> Result<[f64; 3], Failure> {
        let before = (self.strain, leg.value(self));
        let guess = |share: f64| {
            let shear = leg.direction * share * size;
            [0.0, vertical_slope * shear, shear]
        };
        let mut made = self.increment(guess(1.0), prescribed, compliance)?;
        let Turn::Stress(target) = leg.turn else { return Ok(made) };
        let excess = |specimen: &Self| leg.direction * (leg.value(specimen) - target);
        let (mut low, mut excess_low) = (0.0, leg.direction * (before.1 - target));
        let (mut high, mut excess_high) = (1.0, excess(self));
        if excess_high <= tolerance {
            return Ok(made);
        }
        // Illinois variant of regula falsi on the share of the increment.
        let mut last_was_high = true;
        for _ in 0..TURN_TRIALS {
            let share = (low * excess_high - high * excess_low) / (excess_high - excess_low);
            self.point.back();
            self.strain = before.0;
            made = self.increment(guess(share), prescribed, compliance)?;
            let found = excess(self);
            if found.abs() <= tolerance {
                break;
            }
            let is_high = found > 0.0;
            if is_high {
                (high, excess_high) = (share, found);
            } else {
                (low, excess_low) = (share, found);
            }
            if is_high == last_was_high {
                *(if is_high { &mut excess_low } else { &mut excess_high }) *= 0.5;
            }
            last_was_high = is_high;
        }
        Ok(made)
    }
}
