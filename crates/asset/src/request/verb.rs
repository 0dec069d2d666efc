//! The jobs by name.

/// A job on files.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Verb {
    /// [`simplify()`](crate::simplify()).
    Simplify,
    /// [`lod()`](crate::lod()).
    Lod,
    /// [`convert()`](crate::convert()).
    Convert,
    /// [`clean()`](crate::clean()).
    Clean,
    /// [`bake()`](crate::bake()).
    Bake,
    /// [`info()`](crate::info()).
    Info,
    /// [`picture::render`](crate::picture::render).
    #[cfg(feature = "pictures")]
    Render,
}

impl Verb {
    /// All jobs.
    pub const ALL: [Self; 6 + cfg!(feature = "pictures") as usize] = [
        Self::Simplify,
        Self::Lod,
        Self::Convert,
        Self::Clean,
        Self::Bake,
        Self::Info,
        #[cfg(feature = "pictures")]
        Self::Render,
    ];

    /// Returns the name, as of the subcommand.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Simplify => "simplify",
            Self::Lod => "lod",
            Self::Convert => "convert",
            Self::Clean => "clean",
            Self::Bake => "bake",
            Self::Info => "info",
            #[cfg(feature = "pictures")]
            Self::Render => "render",
        }
    }
}
