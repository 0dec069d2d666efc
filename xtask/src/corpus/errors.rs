//! Compares the errors in the reports with measured errors, over all models.

use anyhow::{Result, ensure};
use serde_json::Value;

/// Minimum share of printed errors within [`FACTOR`] of the measured ones.
const MIN_TRUE_SHARE: f64 = 0.95;
/// Maximum share of reports without an error.
const MAX_ABSENT_SHARE: f64 = 0.05;
/// A printed error is correct within this factor of the measured one.
const FACTOR: f64 = 2.0;
/// Errors below this share of the diagonal count as equal: they are within the rounding of single precision.
const ROUNDING_SHARE: f64 = 1e-6;

/// The printed errors of all results, compared with the measured ones.
#[derive(Default)]
pub(super) struct PrintedErrors {
    measured: usize,
    absent: usize,
    /// Errors that differ by more than [`FACTOR`].
    off: Vec<String>,
}

impl PrintedErrors {
    /// Adds the report of a run with a measured result. Returns a problem that shows in this report alone.
    pub(super) fn add(&mut self, what: &str, report: &Value) -> Option<String> {
        let error = &report["error"];
        let measured = error["measured"]["rms"]["symmetric"].as_f64()?;
        let rounding = ROUNDING_SHARE * error["diagonal"].as_f64().unwrap_or(0.0);
        self.measured += 1;
        let Some(printed) = error["estimate"].as_f64() else {
            self.absent += 1;
            return None;
        };
        let (low, high) = (printed.min(measured), printed.max(measured));
        if high > (FACTOR * low).max(rounding) {
            self.off.push(format!("{what}: rms {printed:.3e} printed, {measured:.3e} measured"));
        }
        (printed == 0.0 && measured > rounding).then(|| format!("rms 0 printed, {measured:.3e} measured"))
    }

    /// Prints the result. Returns an error if too many errors are off or absent.
    pub(super) fn conclude(&self) -> Result<()> {
        if self.measured == 0 {
            return Ok(());
        }
        let share = |n: usize| n as f64 / self.measured as f64;
        println!(
            "\nPrinted errors of {} results: {:.1} % within a factor of {FACTOR} of the measured one, {:.1} % absent",
            self.measured,
            100.0 * (1.0 - share(self.off.len() + self.absent)),
            100.0 * share(self.absent),
        );
        self.off.iter().for_each(|line| println!("  {line}"));
        ensure!(share(self.absent) <= MAX_ABSENT_SHARE, "too many reports have no error");
        let printed = self.measured - self.absent;
        ensure!(
            self.off.len() as f64 <= (1.0 - MIN_TRUE_SHARE) * printed as f64,
            "{} of {printed} printed errors are farther than a factor of {FACTOR} from the measured ones",
            self.off.len()
        );
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;

    fn report(printed: Option<f64>, measured: f64) -> Value {
        json!({ "error": {
            "estimate": printed, "diagonal": 10.0, "measured": { "rms": { "symmetric": measured } },
        } })
    }

    #[test]
    fn errors_far_off_are_listed_and_zero_is_wrong() {
        let mut all = PrintedErrors::default();
        for _ in 0..38 {
            assert_eq!(all.add("near", &report(Some(0.3), 0.2)), None);
        }
        assert_eq!(all.add("rounding", &report(Some(0.0), 9e-6)), None);
        all.add("low", &report(Some(0.1), 0.21));
        assert_eq!(all.off.len(), 1);
        assert!(all.conclude().is_ok());
        assert!(all.add("zero", &report(Some(0.0), 0.2)).is_some());
        all.add("high", &report(Some(0.5), 0.2));
        assert!(all.conclude().is_err());
        let mut absent = PrintedErrors::default();
        absent.add("absent", &report(None, 0.1));
        assert!(absent.conclude().is_err());
    }
}
