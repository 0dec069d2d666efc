//! Names of option values, as on the command line.

use super::{BorderPolicy, Bound, Effort, Fit, MethodKind, Placement, Preset, TopologyPolicy};

/// Implements `ALL` and `name` for enums.
macro_rules! name_values {
    ($($choice:ident { $($value:ident = $name:literal),+ $(,)? })+) => {$(
        impl $choice {
            /// All values, in the order in which they are listed.
            pub const ALL: [Self; [$($name),+].len()] = [$(Self::$value),+];

            /// Returns the name of the value, as on the command line.
            pub const fn name(self) -> &'static str {
                match self {
                    $(Self::$value => $name),+
                }
            }
        }
    )+};
}
pub(crate) use name_values;

name_values! {
    MethodKind {
        Memoryless = "memoryless",
        Quadric = "quadric",
        LindstromTurk = "lindstrom-turk",
        Melax = "melax",
        ShortestEdge = "shortest-edge",
        Cluster = "cluster",
        VertexRemoval = "vertex-removal",
        Planar = "planar",
        Unsubdivide = "unsubdivide",
        Remesh = "remesh",
    }
    Fit { Auto = "auto", On = "on", Off = "off" }
    Effort { Default = "default", Best = "best", Auto = "auto" }
    Placement { Optimal = "optimal", Endpoint = "endpoint", Midpoint = "midpoint" }
    BorderPolicy { Keep = "keep", Slide = "slide", Lock = "lock", Free = "free" }
    TopologyPolicy { Relaxed = "relaxed", Preserve = "preserve", Free = "free" }
    Preset { Auto = "auto", Scan = "scan", Cad = "cad", Visual = "visual", Print = "print" }
    Bound { Auto = "auto", Estimate = "estimate", OneSided = "one-sided", TwoSided = "two-sided" }
}
