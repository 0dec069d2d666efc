//! A run whose changes are all recorded, for progressive meshes.
//!
//! There is one sequence of sweeps: first as far as possible with the topology kept; then, if the goal is not
//! reached, on the same engine with removal of parts and cuts in order of cost.

use super::context::Run;
use crate::SimplifyError;
use crate::collapse::cut::may_cut;
use crate::collapse::ordered_input::OriginalInput;
use crate::collapse::record::Record;
use crate::collapse::{Engine, StopReason};
use crate::control::{Control, Stage};
use crate::cost::metric::Metric;
use crate::options::TopologyPolicy;

impl Run<'_, '_> {
    /// Sweeps an engine to the goal, or as far as possible. Returns the record, and how many of its changes came
    /// before the engine got stuck for the first time.
    pub(crate) fn sweep_recorded<M: Metric>(
        &self,
        engine: &mut Engine<M>,
        record: Record,
        is_kept: bool,
        control: &mut dyn Control,
    ) -> Result<(Record, usize), SimplifyError> {
        engine.log_start(Box::new(record));
        control.stage(Stage::Collapse);
        let topology = self.options.topology;
        engine.mesh.constraints.keeps_parts = topology != TopologyPolicy::Free;
        if topology == TopologyPolicy::Free {
            engine.mesh.constraints.cuts_necks = true;
            engine.enable_part_removal();
        }
        let source = OriginalInput { surface: &self.input.surface, ordered: self.ordered, is_kept };
        let mut end = engine.sweep(&self.goal, &source, control);
        let in_order = engine.record.as_ref().map_or(0, |record| record.log.steps.len());
        if end == StopReason::Stuck && topology == TopologyPolicy::Relaxed {
            control.stage(Stage::Collapse);
            engine.resume(may_cut(self.options));
            end = engine.sweep(&self.goal, &source, control);
        }
        match engine.record.take() {
            Some(record) if end != StopReason::Cancel => Ok((*record, in_order)),
            _ => Err(SimplifyError::Cancelled),
        }
    }
}
