//! A test along a path that is given row by row.

use super::{
    Ending, Record, Specimen, Watch,
    control::{Compliance, Failure, Prescribed, components},
};
use crate::{
    SoilError, Stress,
    error::{finite, positive},
};

/// Smallest part of a leg that is tried where the prescribed stress is not met, relative to the usual part.
const SMALLEST_PART: f64 = 1e-6;

/// A path of prescribed strains and stresses, linear between rows.
#[derive(Debug, Clone)]
pub struct Path {
    /// Which components of `(xx, yy, xy)` are prescribed by stress; the others are prescribed by strain.
    pub by_stress: [bool; 3],
    /// Values at the end of each leg: total strain since the specimen was made, or stress in kPa; tension positive.
    pub rows: Vec<[f64; 3]>,
    /// Largest component of a strain increment, or of the elastic strain of a stress increment.
    pub strain_step: f64,
}

impl Path {
    /// Refuses a step that is not positive and values that are not finite.
    fn check(&self) -> Result<(), SoilError> {
        positive("strain_step", self.strain_step)?;
        self.rows.iter().flatten().try_for_each(|value| finite("path", *value).map(|_| ()))
    }
}

impl Specimen {
    /// Takes the specimen along a path. An empty record first receives the present state; every row adds one line.
    /// Calls `stop` at regular intervals; true ends the test.
    pub fn path(&mut self, path: &Path, record: &mut Record, stop: &mut dyn FnMut() -> bool) -> Ending {
        if let Err(error) = path.check() {
            return Ending::Refused(error);
        }
        if record.rows().is_empty() {
            record.keep(self.row(0.0, 0));
        }
        let mut watch = Watch::new(stop);
        for (index, row) in path.rows.iter().enumerate() {
            let ending = self.leg(path, *row, index, record, &mut watch);
            let legs = if ending == Ending::Complete { index + 1 } else { index };
            record.keep(self.row(0.0, legs));
            if ending != Ending::Complete {
                return ending;
            }
        }
        Ending::Complete
    }

    fn leg(
        &mut self,
        path: &Path,
        target: [f64; 3],
        legs: usize,
        record: &mut Record,
        watch: &mut Watch<'_>,
    ) -> Ending {
        let by_stress = path.by_stress;
        let begin_strain = self.strain;
        let begin_stress = components(&self.stress());
        let moduli = self.point.moduli();
        let strains = |k: usize| match (by_stress[k], k) {
            (false, _) => (target[k] - begin_strain[k]).abs(),
            (true, 2) => (target[k] - begin_stress[k]).abs() / moduli.shear,
            (true, _) => (target[k] - begin_stress[k]).abs() / (2.0 * moduli.shear),
        };
        let largest = (0..3).map(strains).fold(0.0, f64::max);
        let usual = 1.0 / (largest / path.strain_step).ceil().max(1.0);
        let mut compliance = Compliance::elastic(moduli, by_stress);
        let (mut done, mut part, mut slope) = (0.0_f64, usual, [0.0; 3]);
        while done < 1.0 {
            if watch.interrupts() {
                return Ending::Interrupted;
            }
            // The last part ends exactly at the target, so round-off does not accumulate.
            let end = if done + part * (1.0 + SMALLEST_PART) >= 1.0 { 1.0 } else { done + part };
            let mut strain = [0.0; 3];
            let mut stress = [0.0; 3];
            for k in 0..3 {
                if by_stress[k] {
                    stress[k] = begin_stress[k] + end * (target[k] - begin_stress[k]);
                    strain[k] = slope[k] * (end - done);
                } else {
                    let at = if end < 1.0 {
                        begin_strain[k] + end * (target[k] - begin_strain[k])
                    } else {
                        target[k]
                    };
                    strain[k] = at - self.strain[k];
                }
            }
            match self.increment(strain, &Prescribed { by_stress, stress }, &mut compliance) {
                Ok(made) => {
                    slope = made.map(|strain| strain / (end - done));
                    done = end;
                    part = (2.0 * part).min(usual);
                    if done < 1.0 {
                        record.offer(self.row(0.0, legs));
                    }
                }
                Err(Failure::Refused(error)) if !by_stress.contains(&true) => return Ending::Refused(error),
                Err(_) if part > SMALLEST_PART * usual => {
                    part *= 0.25;
                    slope = [0.0; 3];
                    compliance = Compliance::elastic(self.point.moduli(), by_stress);
                }
                Err(Failure::Refused(error)) => return Ending::Refused(error),
                Err(Failure::NotMet) => {
                    let reached = self.stress();
                    let pick = |k: usize, reached: f64| if by_stress[k] { target[k] } else { reached };
                    let wanted = Stress {
                        xx: pick(0, reached.xx),
                        yy: pick(1, reached.yy),
                        xy: pick(2, reached.xy),
                        zz: reached.zz,
                    };
                    return Ending::StressNotCarried { wanted, reached };
                }
            }
        }
        Ending::Complete
    }
}
