/// Counters of one or many updates: work done, and how often each numerical limit acted.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
pub struct UpdateReport {
    /// Accepted sub-steps of plastic integration.
    pub substeps: u64,
    /// Evaluations of the plastic rate equations.
    pub evaluations: u64,
    /// Committed parts that ended at the pressure floor.
    pub pressure_floors: u64,
    /// Committed parts whose stress was returned to the bounding surface.
    pub bounding_caps: u64,
    /// Updates that ended at the tension cut-off.
    pub tension_cutoffs: u64,
    /// Updates that ended at the apex of the strength surface.
    pub apex_returns: u64,
    /// Sub-steps of the smallest size that were accepted with an error above the tolerance.
    pub forced_acceptances: u64,
    /// Load reversals.
    pub reversals: u64,
    /// Reversals detected during nearly tangential loading, which may depend on the sub-step size.
    pub near_neutral_reversals: u64,
}

impl UpdateReport {
    /// Adds the counts of another report.
    pub fn merge(&mut self, other: &Self) {
        self.substeps += other.substeps;
        self.evaluations += other.evaluations;
        self.pressure_floors += other.pressure_floors;
        self.bounding_caps += other.bounding_caps;
        self.tension_cutoffs += other.tension_cutoffs;
        self.apex_returns += other.apex_returns;
        self.forced_acceptances += other.forced_acceptances;
        self.reversals += other.reversals;
        self.near_neutral_reversals += other.near_neutral_reversals;
    }

    /// Every counter with its name.
    pub fn named(&self) -> [(&'static str, u64); 9] {
        [
            ("substeps", self.substeps),
            ("evaluations", self.evaluations),
            ("pressure_floors", self.pressure_floors),
            ("bounding_caps", self.bounding_caps),
            ("tension_cutoffs", self.tension_cutoffs),
            ("apex_returns", self.apex_returns),
            ("forced_acceptances", self.forced_acceptances),
            ("reversals", self.reversals),
            ("near_neutral_reversals", self.near_neutral_reversals),
        ]
    }
}

impl std::ops::AddAssign for UpdateReport {
    fn add_assign(&mut self, other: Self) {
        self.merge(&other);
    }
}
