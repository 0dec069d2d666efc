//! Table of the methods that each shared option applies to: setting an option that the method does not have is
//! an error.

use super::{
    BorderPolicy, Effort, Fit, Guards, Method, MethodKind, Placement, SimplifyOptions, TopologyPolicy,
};
use crate::SimplifyError;
use crate::input::MeshData;

use MethodKind::{
    Cluster, LindstromTurk, Melax, Memoryless, Planar, Quadric, Remesh, ShortestEdge, Unsubdivide,
    VertexRemoval,
};

/// Collapse methods whose merged vertex may be placed anywhere.
const PLACING_METHODS: &[MethodKind] = &[Memoryless, Quadric, LindstromTurk, ShortestEdge];
/// Methods that can place, or always place, all vertices at vertices of the input.
const SUBSET_METHODS: &[MethodKind] =
    &[Memoryless, Quadric, LindstromTurk, Melax, ShortestEdge, VertexRemoval, Planar, Unsubdivide];
/// Methods that remove vertices one at a time, and can refuse a removal.
const GUARDED_METHODS: &[MethodKind] =
    &[Memoryless, Quadric, LindstromTurk, Melax, ShortestEdge, VertexRemoval];
/// Edge-collapse methods: they contract one edge or pair at a time, and can be recorded.
pub(crate) const COLLAPSE_METHODS: &[MethodKind] = &[Memoryless, Quadric, LindstromTurk, Melax, ShortestEdge];
/// [`GUARDED_METHODS`], and `planar`, which limits the angle between a face and its region.
const NORMAL_GUARDED_METHODS: &[MethodKind] =
    &[Memoryless, Quadric, LindstromTurk, Melax, ShortestEdge, VertexRemoval, Planar];
/// Methods that detect borders.
const BORDER_METHODS: &[MethodKind] =
    &[Memoryless, Quadric, LindstromTurk, Melax, ShortestEdge, VertexRemoval, Planar, Unsubdivide, Remesh];

impl SimplifyOptions {
    /// Returns an error unless the method has all options and they are compatible with each other.
    pub(super) fn check_method(&self, data: &MeshData<'_>) -> Result<(), SimplifyError> {
        let method = self.method.kind();
        let not = |option, takers| Err(SimplifyError::NotOfMethod { option, takers, method });
        // A voxel surface keeps no elements of the input; a two-stage run ends with collapses.
        let is_voxel = self.method.makes_voxels();
        let takes = |takers: &[MethodKind]| match self.method {
            Method::Cluster { two_stage: true, .. } => takers.contains(&Memoryless),
            _ => takers.contains(&method),
        };
        for (option, is_given, takers) in self.shared(data) {
            if is_given && is_voxel {
                return Err(SimplifyError::NotTogether { first: "voxel", second: option });
            }
            if is_given && !takes(takers) {
                return not(option, takers);
            }
        }
        let clusters = method == Cluster;
        let keeps_topology = self.topology == TopologyPolicy::Preserve;
        for (option, is_unknown, takers) in [
            ("topology preserve", keeps_topology && clusters, BORDER_METHODS),
            ("importance", clusters && data.importance.is_some(), GUARDED_METHODS),
            ("error-map", clusters && data.error_map.is_some(), COLLAPSE_METHODS),
        ] {
            if is_unknown {
                return not(option, takers);
            }
        }
        if data.error_map.is_some() && self.stop.error.is_none() {
            return Err(SimplifyError::Needs { option: "error-map", other: "error" });
        }
        let second = match () {
            () if is_voxel && keeps_topology => "topology preserve",
            () if is_voxel && data.locked.is_some() => "lock",
            () => return Ok(()),
        };
        Err(SimplifyError::NotTogether { first: "voxel", second })
    }

    /// Returns the options that most methods share: name, whether the option is set, and the methods that have it.
    fn shared(&self, data: &MeshData<'_>) -> [(&'static str, bool, &'static [MethodKind]); 12] {
        let guards = &self.guards;
        let Guards { max_normal_deg, min_quality, max_valence, max_edge } = guards;
        [
            ("placement midpoint", self.placement == Placement::Midpoint, PLACING_METHODS),
            ("placement endpoint", self.placement == Placement::Endpoint, SUBSET_METHODS),
            ("fit on", self.fit == Fit::On, PLACING_METHODS),
            ("effort best", self.effort == Effort::Best, COLLAPSE_METHODS),
            ("border slide", self.border == BorderPolicy::Slide, BORDER_METHODS),
            ("border lock", self.border == BorderPolicy::Lock, BORDER_METHODS),
            ("max-normal", max_normal_deg.is_some(), NORMAL_GUARDED_METHODS),
            ("importance", data.importance.is_some(), GUARDED_METHODS),
            ("error-map", data.error_map.is_some(), COLLAPSE_METHODS),
            ("sharp", self.sharp_deg.is_some(), COLLAPSE_METHODS),
            ("min-quality or max-valence", min_quality.is_some() || max_valence.is_some(), GUARDED_METHODS),
            ("max-edge", max_edge.is_some(), GUARDED_METHODS),
        ]
    }

    /// Returns the options with the placement that the method prescribes, if any.
    pub(crate) fn with_own_placement(&self) -> Self {
        let placement = match (self.method.kind(), self.placement) {
            (Melax, _) => Placement::Endpoint,
            (ShortestEdge, Placement::Optimal) => Placement::Midpoint,
            (_, placement) => placement,
        };
        Self { placement, ..self.clone() }
    }
}
