/// What happened inside one or many updates: the guards that acted are counted, never silent.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
pub struct UpdateReport {
    /// Accepted sub-steps of plastic integration.
    pub substeps: u64,
    /// Evaluations of the plastic rate equations.
    pub evaluations: u64,
    /// Committed parts that ended at the pressure floor.
    pub pressure_floors: u64,
    /// Sub-steps accepted at the smallest size although their error was above the tolerance.
    pub forced_acceptances: u64,
    /// Load reversals.
    pub reversals: u64,
    /// Reversals declared while loading nearly tangentially, where another sub-step size may decide otherwise.
    pub near_neutral_reversals: u64,
}

impl UpdateReport {
    /// Adds the counts of another report.
    pub fn merge(&mut self, other: &Self) {
        self.substeps += other.substeps;
        self.evaluations += other.evaluations;
        self.pressure_floors += other.pressure_floors;
        self.forced_acceptances += other.forced_acceptances;
        self.reversals += other.reversals;
        self.near_neutral_reversals += other.near_neutral_reversals;
    }
}

impl std::ops::AddAssign for UpdateReport {
    fn add_assign(&mut self, other: Self) {
        self.merge(&other);
    }
}
