//! Ranges of options.

use super::{Length, SimplifyOptions};
use crate::SimplifyError;
use crate::input::MeshData;

impl SimplifyOptions {
    /// Returns an error if a value is out of range, or an option or the data of the mesh are not for the method.
    pub(crate) fn check(&self, data: &MeshData<'_>) -> Result<(), SimplifyError> {
        let options = self;
        let bad = |option, wanted, got| Err(SimplifyError::BadOption { option, wanted, got });
        let length = |l: Length| match l {
            Length::Units(x) | Length::OfDiagonal(x) => x,
        };
        let stop = &options.stop;
        if let Some(r) = stop.ratio.filter(|r| !(*r > 0.0 && *r <= 1.0)) {
            return bad("ratio", "above 0 and at most 1", r);
        }
        if let Some(e) = stop.error.map(length).filter(|e| !(e.is_finite() && *e >= 0.0)) {
            return bad("error", "a distance of 0 or more", e);
        }
        let guards = &options.guards;
        if let Some(x) = guards.max_normal_deg.filter(|x| !(*x > 0.0 && *x <= 180.0)) {
            return bad("max-normal", "above 0 and at most 180 degrees", x);
        }
        if let Some(x) = guards.min_quality.filter(|x| !(*x >= 0.0 && *x <= 1.0)) {
            return bad("min-quality", "from 0 to 1", x);
        }
        if let Some(x) = guards.max_valence.filter(|x| *x < 3) {
            return bad("max-valence", "at least 3", x as f64);
        }
        if let Some(x) = guards.max_edge.map(length).filter(|x| !(x.is_finite() && *x > 0.0)) {
            return bad("max-edge", "a length above 0", x);
        }
        if let Some(x) = options.sharp_deg.filter(|x| !(*x > 0.0 && *x < 180.0)) {
            return bad("sharp", "above 0 and below 180 degrees", x);
        }
        if let Some(x) = options.prune.map(length).filter(|x| !(x.is_finite() && *x >= 0.0)) {
            return bad("prune", "a length of 0 or more", x);
        }
        let w = &options.weights;
        let weights = [w.normal, w.uv, w.color, w.morph, w.skin, w.other, w.border];
        if let Some(&x) = weights.iter().find(|x| !(x.is_finite() && **x >= 0.0)) {
            return bad("weight", "0 or more", x);
        }
        options.check_method(data)?;
        let own = &options.method_options;
        for (option, given) in [
            ("pairs", own.pairs),
            ("cell", own.cell),
            ("edge-length", own.edge_length),
            ("flat", own.flat),
            ("voxel", own.voxel),
        ] {
            if let Some(x) =
                given.map(length).filter(|x| !(x.is_finite() && (*x > 0.0 || *x == 0.0 && option == "flat")))
            {
                return bad(option, "a length above 0", x);
            }
        }
        if let Some(x) = own.angle_deg.filter(|x| !(*x >= 0.0 && *x < 90.0)) {
            return bad("angle", "from 0 to below 90 degrees", x);
        }
        if let Some(x) = options.weld.map(length).filter(|x| !(x.is_finite() && *x >= 0.0)) {
            return bad("weld", "a distance of 0 or more", x);
        }
        Ok(())
    }
}
