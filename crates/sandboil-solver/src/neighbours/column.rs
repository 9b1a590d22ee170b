//! The ground beyond a free-field side: a column one node wide between periodic sides. It is solved together with the
//! section, step by step, or read from the record of an earlier run.

use crate::{
    edges::base::Impedance,
    error::SolverError,
    run::{neighbour::Alone, simulation::Driver},
    section::description::{Model, STRESS_NODES},
    stages::{
        column_record::{COMPONENTS, ColumnRecord},
        gravity::Gravity,
        stage::Stage,
    },
};
use sandboil_sph::Vec2;

/// State and motion of a column in a step, for the section beside it. Rows are numbered from below.
#[derive(Debug, Clone, Default, serde::Serialize, serde::Deserialize)]
pub struct Present {
    /// Nominal stress of two stress points of each row at the start of the step, kPa: of its stress nodes, or of the lower
    /// and the upper corner of its cell, with the excess pore pressure there.
    pub stress: Vec<[f64; COMPONENTS]>,
    /// Nominal excess pore pressure of each row, `q J F^-T`, kPa; empty without water at the nodes.
    pub water: Vec<[f64; COMPONENTS]>,
    /// Velocity of each row half a step before the start of the step, m/s.
    pub velocity_before: Vec<Vec2>,
    /// Velocity of each row half a step after the start of the step, m/s.
    pub velocity: Vec<Vec2>,
    /// Acceleration of each row, m/s2.
    pub acceleration: Vec<Vec2>,
    /// Mean traction of the compliant base over the step, kPa.
    pub base_traction: Vec2,
}

impl Present {
    fn of_rows(rows: usize, wet: bool) -> Self {
        let still = vec![Vec2::zeros(); rows];
        Self {
            stress: vec![[0.0; COMPONENTS]; STRESS_NODES * rows],
            water: vec![[0.0; COMPONENTS]; if wet { rows } else { 0 }],
            velocity_before: still.clone(),
            velocity: still.clone(),
            acceleration: still,
            base_traction: Vec2::zeros(),
        }
    }
}

/// A column beside a section, solved or read from a record.
#[derive(Debug, serde::Serialize, serde::Deserialize)]
pub struct Column {
    source: Source,
    present: Present,
    recorder: Option<Recorder>,
}

#[derive(Debug, serde::Serialize, serde::Deserialize)]
enum Source {
    Solved {
        simulation: Box<Driver<Alone>>,
        /// Internal index of the node of each row, from below.
        rows: Vec<usize>,
    },
    Recorded {
        record: ColumnRecord,
        time: f64,
        frame: Vec<f64>,
    },
}

impl Column {
    /// A column at rest.
    ///
    /// # Errors
    /// A column that does not come to rest.
    pub fn at_rest(model: &Model, gravity: Option<Gravity>) -> Result<Self, SolverError> {
        let mut simulation = Driver::new(model, 1)?;
        if let Some(gravity) = gravity {
            simulation.begin(gravity)?;
            simulation.advance(u64::MAX, f64::INFINITY)?;
        }
        let rows = simulation.internal_order();
        let present = Present::of_rows(rows.len(), model.has_nodal_water());
        let source = Source::Solved { simulation: Box::new(simulation), rows };
        Ok(Self { source, present, recorder: None })
    }

    /// A column that is read from a record.
    pub fn recorded(record: ColumnRecord) -> Self {
        let (rows, wet) = (record.rows(), record.wet);
        let frame = vec![0.0; ColumnRecord::width(rows, wet)];
        let source = Source::Recorded { record, time: 0.0, frame };
        Self { source, present: Present::of_rows(rows, wet), recorder: None }
    }

    /// Begins a stage. A column that is solved is recorded if there is an interval (s). A column that is read needs the
    /// `record` of this stage.
    ///
    /// # Errors
    /// Soil that refuses its stress, or a record that is missing, too short or of another column.
    pub fn begin(
        &mut self,
        stage: Stage,
        record: Option<&ColumnRecord>,
        record_interval: Option<f64>,
    ) -> Result<(), SolverError> {
        let (rows, wet) = (self.rows(), !self.present.water.is_empty());
        match &mut self.source {
            Source::Solved { simulation, .. } => simulation.begin(stage)?,
            Source::Recorded { record: read, time, .. } => {
                let Some(record) = record else {
                    return Err(SolverError::Order {
                        call: "begin",
                        needs: "a record of this stage, because the column is read from records",
                    });
                };
                record.validate(rows, wet, stage.duration())?;
                (*read, *time) = (record.clone(), 0.0);
            }
        }
        self.observe();
        self.recorder = match (record_interval, &self.source) {
            (Some(interval), Source::Solved { .. }) => {
                Some(Recorder::new(interval, self.impedance()?, &self.present))
            }
            _ => None,
        };
        Ok(())
    }

    /// State and motion in the present step.
    pub fn present(&self) -> &Present {
        &self.present
    }

    /// Number of rows.
    pub fn rows(&self) -> usize {
        self.present.velocity.len()
    }

    /// Density and small-strain wave speeds of each row, from below.
    ///
    /// # Errors
    /// Soil that refuses its stress.
    pub fn impedance(&self) -> Result<Vec<Impedance>, SolverError> {
        match &self.source {
            Source::Solved { simulation, rows } => {
                rows.iter().map(|&row| simulation.small_strain_impedance(row)).collect()
            }
            Source::Recorded { record, .. } => Ok(record.impedance.clone()),
        }
    }

    /// The simulation of a column that is solved.
    pub fn simulation(&self) -> Option<&Driver<Alone>> {
        match &self.source {
            Source::Solved { simulation, .. } => Some(simulation),
            Source::Recorded { .. } => None,
        }
    }

    /// Sets the excess pore pressure of each row, kPa. Constant forces keep the balance.
    pub fn set_excess(&mut self, excess: impl Iterator<Item = f64>) {
        if let Source::Solved { simulation, rows } = &mut self.source {
            let mut own = vec![0.0; rows.len()];
            for (&node, value) in rows.iter().zip(excess) {
                own[node] = value;
            }
            simulation.hold_excess(&own);
        }
        self.observe();
    }

    /// Renews the geometry of the column at the present positions of its nodes.
    pub fn renew_geometry(&mut self) {
        self.observe();
        let before = self.present.clone();
        if let Source::Solved { simulation, .. } = &mut self.source {
            simulation.renew_beside();
        }
        self.observe();
        if let Some(recorder) = &mut self.recorder {
            recorder.carry_over(&before, &self.present);
        }
    }

    /// Updates stress and pressure to those at the start of a step.
    pub fn observe(&mut self) {
        let Present { stress, water, .. } = &mut self.present;
        match &mut self.source {
            Source::Solved { simulation, rows } => {
                for (row, &node) in rows.iter().enumerate() {
                    stress[STRESS_NODES * row..][..STRESS_NODES]
                        .copy_from_slice(&simulation.nominal_stress(node));
                    if let Some(water) = water.get_mut(row) {
                        *water = simulation.nominal_water(node);
                    }
                }
            }
            Source::Recorded { record, time, frame } => {
                record.at(*time, frame);
                let mut values = frame.chunks_exact(COMPONENTS);
                for (slot, value) in stress.iter_mut().chain(water).zip(&mut values) {
                    slot.copy_from_slice(value);
                }
            }
        }
    }

    /// Makes a step of `dt` seconds, after [`Self::observe`] at its start.
    ///
    /// # Errors
    /// A column that has diverged.
    pub fn step(&mut self, dt: f64) -> Result<(), SolverError> {
        let Present { velocity_before, velocity, acceleration, base_traction, stress, water } =
            &mut self.present;
        std::mem::swap(velocity_before, velocity);
        match &mut self.source {
            Source::Solved { simulation, rows } => {
                let time = simulation.time();
                simulation.step_beside(dt)?;
                for (row, &node) in rows.iter().enumerate() {
                    velocity[row] = simulation.velocity_of(node);
                    acceleration[row] = simulation.acceleration_of(node);
                }
                *base_traction = simulation.base_traction();
                if let Some(recorder) = &mut self.recorder {
                    recorder.push(time, &self.present);
                }
            }
            Source::Recorded { record, time, frame } => {
                // Stress, pressure and traction are those at the start of the step, the motion is that half a
                // step later.
                let motion = COMPONENTS * (stress.len() + water.len());
                *base_traction = Vec2::new(frame[frame.len() - 2], frame[frame.len() - 1]);
                record.at(*time + 0.5 * dt, frame);
                for (row, value) in frame[motion..].chunks_exact(2).take(velocity.len()).enumerate() {
                    velocity[row] = Vec2::new(value[0], value[1]);
                    acceleration[row] = (velocity[row] - velocity_before[row]) / dt;
                }
                *time += dt;
            }
        }
        Ok(())
    }

    /// Takes out the record of the stage up to the present step, if the column is recorded.
    pub fn take_record(&mut self) -> Option<ColumnRecord> {
        self.recorder.take().map(Recorder::closed)
    }

    /// Bytes held.
    pub fn bytes(&self) -> usize {
        let source = match &self.source {
            Source::Solved { simulation, .. } => simulation.arrays().iter().map(|(_, bytes)| bytes).sum(),
            Source::Recorded { record, .. } => size_of_val(record.values.as_slice()),
        };
        let recorded = self.recorder.as_ref().map_or(0, |r| size_of_val(r.record.values.as_slice()));
        source + recorded
    }
}

/// Frames of the present stage of a column.
#[derive(Debug, serde::Serialize, serde::Deserialize)]
struct Recorder {
    record: ColumnRecord,
    /// Values at which the recorded increments are zero. A renewal of the geometry changes them by its change
    /// of the nominal values.
    origin: Vec<f64>,
    /// Time (s) and values of the last step.
    last: (f64, Vec<f64>),
    sample: Vec<f64>,
    frames: usize,
}

impl Recorder {
    fn new(interval: f64, impedance: Vec<Impedance>, present: &Present) -> Self {
        let (rows, wet) = (impedance.len(), !present.water.is_empty());
        let width = ColumnRecord::width(rows, wet);
        let mut origin = vec![0.0; width];
        flatten(present, &mut origin);
        // Motion and traction are recorded as they are.
        origin[COMPONENTS * (present.stress.len() + present.water.len())..].fill(0.0);
        let record = ColumnRecord { interval, impedance, wet, values: Vec::new() };
        Self { record, origin, last: (0.0, vec![0.0; width]), sample: vec![0.0; width], frames: 0 }
    }

    fn carry_over(&mut self, before: &Present, after: &Present) {
        let count = COMPONENTS * (before.stress.len() + before.water.len());
        let parts = |present: &Present| -> Vec<f64> {
            present.stress.iter().chain(&present.water).flatten().copied().collect()
        };
        for ((origin, before), after) in self.origin[..count].iter_mut().zip(parts(before)).zip(parts(after))
        {
            *origin += after - before;
        }
    }

    /// Adds the frames up to `time`, the start of the last step, s.
    fn push(&mut self, time: f64, present: &Present) {
        flatten(present, &mut self.sample);
        for (value, origin) in self.sample.iter_mut().zip(&self.origin) {
            *value -= origin;
        }
        let (before, last) = &mut self.last;
        while self.frames as f64 * self.record.interval <= time {
            let at = self.frames as f64 * self.record.interval;
            let fraction = if time > *before { (at - *before) / (time - *before) } else { 1.0 };
            let between = last.iter().zip(&self.sample).map(|(last, now)| last + fraction * (now - last));
            self.record.values.extend(between);
            self.frames += 1;
        }
        *before = time;
        last.copy_from_slice(&self.sample);
    }

    /// The record, with two more frames, extrapolated linearly from the last frame through the values of the
    /// last step. Two are enough, because a stage ends at most half a step after these values.
    fn closed(mut self) -> ColumnRecord {
        let width = self.sample.len();
        let (time, values) = &self.last;
        if let Some(from) = self.record.values.len().checked_sub(width) {
            let frame = self.record.values[from..].to_vec();
            let since = time - (self.frames - 1) as f64 * self.record.interval;
            for ahead in [1.0, 2.0] {
                let factor = if since > 0.0 { ahead * self.record.interval / since } else { 0.0 };
                let further = frame.iter().zip(values).map(|(frame, value)| frame + factor * (value - frame));
                self.record.values.extend(further);
            }
        }
        self.record
    }
}

/// Writes a frame: stress, pore pressure, velocity at the start of the step, traction.
fn flatten(present: &Present, into: &mut [f64]) {
    let tensors = present.stress.iter().chain(&present.water).flatten().copied();
    let motion = present.velocity_before.iter().zip(&present.velocity);
    let motion = motion.flat_map(|(before, after)| {
        let mean = 0.5 * (before + after);
        [mean.x, mean.y]
    });
    let traction = [present.base_traction.x, present.base_traction.y];
    for (slot, value) in into.iter_mut().zip(tensors.chain(motion).chain(traction)) {
        *slot = value;
    }
}
