//! Names for the enums of the libraries. The default of each is that of its enum.

use clap::ValueEnum;
use lodsmith::{BorderPolicy, Fit, Method, NonManifold, Placement, Preset, TopologyPolicy};
use lodsmith_io::Textures;

macro_rules! choice {
    ($name:ident of $engine:ident { $($variant:ident),+ }) => {
        #[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
        pub(crate) enum $name {
            $($variant),+
        }

        impl From<$name> for $engine {
            fn from(choice: $name) -> Self {
                match choice {
                    $($name::$variant => Self::$variant),+
                }
            }
        }

        // Clap uses this to show the default.
        impl std::fmt::Display for $name {
            fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
                f.write_str(self.to_possible_value().expect("no choice is skipped").get_name())
            }
        }

        impl Default for $name {
            fn default() -> Self {
                let is_default = |c: &Self| $engine::from(*c) == $engine::default();
                Self::value_variants().iter().copied().find(is_default).expect("the engine's default has a word")
            }
        }
    };
}

choice!(MethodChoice of Method { Memoryless, Quadric, LindstromTurk, Melax, ShortestEdge, Cluster, VertexRemoval, Planar, Unsubdivide, Remesh });
choice!(FitChoice of Fit { Auto, On, Off });
choice!(PlacementChoice of Placement { Optimal, Endpoint, Midpoint });
choice!(BorderChoice of BorderPolicy { Keep, Slide, Lock, Free });
choice!(TopologyChoice of TopologyPolicy { Relaxed, Preserve, Free });
choice!(PresetChoice of Preset { Auto, Scan, Cad, Visual, Print });
choice!(NonManifoldChoice of NonManifold { Keep, Cut, Merge });
choice!(TexturesChoice of Textures { Copy, Link, None });

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn words_of_methods_are_those_of_the_library() {
        let all = MethodChoice::value_variants();
        assert_eq!(all.len(), Method::ALL.len());
        for (choice, method) in all.iter().zip(Method::ALL) {
            assert_eq!(Method::from(*choice), method);
            assert_eq!(choice.to_possible_value().unwrap().get_name(), method.name());
        }
    }
}
