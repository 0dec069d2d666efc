//! Progress for a JavaScript function.

use js_sys::Function;
use lodsmith::{Control, Stage, Verdict};
use wasm_bindgen::JsValue;

/// The smallest progress that is reported.
const STEP: f64 = 0.01;

/// A control that calls a function with the progress of each stage, from 0 to 1, and the name of the stage. The run is
/// cancelled if the function returns `false` or throws.
pub(crate) struct Progress {
    function: Option<Function>,
    stage: &'static str,
    reported: f64,
}

impl Progress {
    /// Returns a control for a function, if there is one.
    pub(crate) fn new(function: Option<Function>) -> Self {
        Self { function, stage: "", reported: 0.0 }
    }
}

impl Control for Progress {
    fn stage(&mut self, stage: Stage) {
        (self.stage, self.reported) = (stage.name(), f64::NEG_INFINITY);
    }

    fn progress(&mut self, done: f64) -> Verdict {
        let Some(function) = &self.function else { return Verdict::Continue };
        if done < self.reported + STEP {
            return Verdict::Continue;
        }
        self.reported = done;
        match function.call2(&JsValue::NULL, &done.into(), &self.stage.into()) {
            Ok(answer) if answer != JsValue::FALSE => Verdict::Continue,
            _ => Verdict::Cancel,
        }
    }
}
