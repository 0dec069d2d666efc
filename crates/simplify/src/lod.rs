//! Chains of levels of detail: one input, several lighter meshes, and from where to look at which.

mod geomorph;

use lodsmith_core::{Positions, TriMesh};

use crate::control::{Control, Share};
use crate::input::Input;
use crate::options::{Length, SimplifyOptions, Stop};
use crate::report::Report;
use crate::run;
use crate::scene::{self, Part, SimplifiedScene};
use crate::{Simplified, SimplifyError, simplify};

/// Which levels are made beside the original, each lighter than the one before.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub enum Levels {
    /// These parts of the triangles, falling.
    Ratios(Vec<f64>),
    /// These numbers of triangles, falling.
    Faces(Vec<usize>),
    /// So many levels, each with this part of the triangles of the one before.
    Steps {
        /// How many, the original not counted.
        count: usize,
        /// Above 0 and below 1.
        factor: f64,
    },
    /// The lightest meshes within these largest deviations, measured both ways, rising.
    Errors(Vec<Length>),
}

impl Levels {
    /// The stop of each level.
    fn stops(&self) -> Result<Vec<Stop>, SimplifyError> {
        let bad = |option, wanted, got| Err(SimplifyError::BadOption { option, wanted, got });
        let out_of_order = |all: &[f64], is_fine: fn(f64, f64) -> bool| {
            all.windows(2).find(|x| !is_fine(x[0], x[1])).map(|x| x[1])
        };
        let stops: Vec<Stop> = match self {
            Self::Ratios(ratios) => {
                if let Some(got) = out_of_order(ratios, |a, b| b < a) {
                    return bad("levels", "below the level before it", got);
                }
                ratios.iter().map(|r| Stop::ratio(*r)).collect()
            }
            Self::Faces(counts) => {
                let all: Vec<f64> = counts.iter().map(|n| *n as f64).collect();
                if let Some(got) = out_of_order(&all, |a, b| b < a) {
                    return bad("levels", "below the level before it", got);
                }
                counts.iter().map(|n| Stop::faces(*n)).collect()
            }
            Self::Steps { count, factor } => {
                if !(*factor > 0.0 && *factor < 1.0) {
                    return bad("factor", "above 0 and below 1", *factor);
                }
                let step =
                    |i: usize| factor.powi(i32::try_from(i).unwrap_or(i32::MAX)).max(f64::MIN_POSITIVE);
                (1..=(*count).min(MOST)).map(|i| Stop::ratio(step(i))).collect()
            }
            Self::Errors(errors) => {
                let share = |l: &Length| match l {
                    Length::Units(x) | Length::OfDiagonal(x) => *x,
                };
                let alike = |pair: &[Length]| {
                    std::mem::discriminant(&pair[0]) != std::mem::discriminant(&pair[1])
                        || share(&pair[0]) < share(&pair[1])
                };
                if let Some(pair) = errors.windows(2).find(|pair| !alike(pair)) {
                    return bad("levels", "an error above that of the level before it", share(&pair[1]));
                }
                errors.iter().map(|e| Stop::error(*e)).collect()
            }
        };
        match stops.len() {
            0 => bad("levels", "at least one", 0.0),
            n if n > MOST => bad("levels", "at most 64", n as f64),
            _ => Ok(stops),
        }
    }
}

/// More levels than this are a mistake: with each a tenth lighter than the one before, 64 lead from a billion triangles to
/// a million.
const MOST: usize = 64;

/// All that a chain can be told.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct LodOptions {
    /// Which levels.
    pub levels: Levels,
    /// How each is made. The stop is that of the level; one that stands here is an error.
    pub simplify: SimplifyOptions,
    /// Whether each level says where its vertices are in the next one.
    pub geomorph: bool,
}

impl LodOptions {
    /// Everything by default but for the levels.
    pub fn new(levels: Levels) -> Self {
        Self { levels, simplify: SimplifyOptions::default(), geomorph: false }
    }

    fn stops(&self) -> Result<Vec<Stop>, SimplifyError> {
        if self.simplify.stop != Stop::default() {
            return Err(SimplifyError::NotTogether { first: "levels", second: "a stop of the options" });
        }
        self.levels.stops()
    }

    fn of_level(&self, stop: Stop) -> SimplifyOptions {
        SimplifyOptions { stop, ..self.simplify.clone() }
    }
}

/// The levels of a mesh, from the finest.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct LodChain {
    /// All but level 0, which is the original. Fewer than asked for if the caller ended the run.
    pub levels: Vec<Simplified>,
    /// Where the vertices of each level are in the next one, from level 0 on; empty unless asked for. See
    /// [`LodChain::geomorph`].
    geomorphs: Vec<Positions>,
}

impl LodChain {
    /// For each vertex of a level, its place on the next coarser one, in the units of the mesh; level 0 is the original.
    ///
    /// Vertices at `p + t (q - p)`, with q from here, turn the level into the next one as t goes from 0 to 1: where one run
    /// made both, its faces at t = 1 are those of the coarser level, and others without area. A vertex of which that is not
    /// known has the nearest point of the coarser level. `None` for the last level, and where it was not asked for.
    pub fn geomorph(&self, level: usize) -> Option<&Positions> {
        self.geomorphs.get(level)
    }
}

/// Makes the levels of a mesh.
///
/// Where levels are counts, and the method is one of edge collapses, one run makes them all, and each level is fitted by
/// itself. Its sweeps are those of a run to that level alone, which leaves them before their end, so it is as near as
/// that (docs/decisions/0016). With [`LodOptions::geomorph`] the sweeps go on from level to level instead, and each level is
/// made of the one before by collapses alone, for about a percent more error. Other methods, levels by errors and
/// [`SimplifyOptions::escalate`] make each level from the original. The mesh is only looked at, so any number of chains
/// can be made of one. With [`BorderPolicy::Lock`](crate::BorderPolicy) borders are the same, to the bit, in all levels.
///
/// ```
/// use lodsmith::core::shapes;
/// use lodsmith::{Levels, LodOptions, NoControl, lod};
///
/// let mesh = shapes::icosphere(4);
/// let chain = lod(&mesh, &LodOptions::new(Levels::Ratios(vec![0.5, 0.1])), &mut NoControl)?;
/// assert!(chain.levels[0].mesh.face_count() > 4 * chain.levels[1].mesh.face_count());
/// # Ok::<(), lodsmith::SimplifyError>(())
/// ```
///
/// # Errors
/// As [`simplify`](crate::simplify()); [`SimplifyError::BadOption`] for levels that are out of order.
pub fn lod(
    mesh: &TriMesh,
    options: &LodOptions,
    control: &mut dyn Control,
) -> Result<LodChain, SimplifyError> {
    let stops = options.stops()?;
    let (levels, mergers) = if run::is_chained(&options.simplify, &stops) {
        let input = Input { surface: mesh.surface(), mesh: Some(mesh), joined: None };
        let (all, mergers) = run::run_chain(&input, &options.simplify, &stops, options.geomorph, control)?;
        (all.into_iter().map(|done| done.0).collect::<Vec<_>>(), mergers)
    } else {
        let one = |(i, stop): (usize, &Stop)| {
            simplify(mesh, &options.of_level(*stop), &mut Share::of(control, i, stops.len()))
        };
        (stops.iter().enumerate().map(one).collect::<Result<_, _>>()?, Vec::new())
    };
    let mut geomorphs = Vec::new();
    if options.geomorph {
        let mut own = mesh;
        for (k, level) in levels.iter().enumerate() {
            let view = level.mesh.positions().view();
            let merged = |v: usize| {
                let to = *mergers.get(k)?.get(v)?;
                (to.index() < view.len()).then(|| view.get(to))
            };
            geomorphs.push(geomorph::geomorph(own, &level.mesh, merged));
            own = &level.mesh;
        }
    }
    Ok(LodChain { levels, geomorphs })
}

/// The levels of a scene.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct SceneChain {
    /// All but level 0, which is the original.
    pub levels: Vec<SimplifiedScene>,
    geomorphs: Vec<Vec<Positions>>,
}

impl SceneChain {
    /// The same as [`LodChain::geomorph`], for each mesh in the order of the parts.
    pub fn geomorph(&self, level: usize) -> Option<&[Positions]> {
        self.geomorphs.get(level).map(Vec::as_slice)
    }
}

/// Makes the levels of a scene: in each the meshes share one budget, as with [`simplify_scene`](crate::simplify_scene).
///
/// One run makes them all, as with [`lod`], where every mesh stands in the scene equally often. Otherwise, and with
/// [`SimplifyOptions::per_mesh`], each level is made from the original.
///
/// # Errors
/// As [`lod`].
pub fn lod_scene(
    parts: &[Part<'_>],
    diagonal: f64,
    options: &LodOptions,
    control: &mut dyn Control,
) -> Result<SceneChain, SimplifyError> {
    let stops = options.stops()?;
    let made = scene::chain_of_scene(parts, diagonal, &options.simplify, &stops, options.geomorph, control)?;
    let (levels, merged): (Vec<SimplifiedScene>, Vec<_>) = match made {
        Some(all) => all.into_iter().unzip(),
        None => {
            let one = |(i, stop): (usize, &Stop)| {
                let control = &mut Share::of(control, i, stops.len());
                scene::simplify_scene(parts, diagonal, &options.of_level(*stop), control)
            };
            (stops.iter().enumerate().map(one).collect::<Result<_, _>>()?, Vec::new())
        }
    };
    let mut geomorphs = Vec::new();
    if options.geomorph {
        let mut own: Vec<&TriMesh> = parts.iter().map(|p| p.mesh).collect();
        for (k, level) in levels.iter().enumerate() {
            let of_part = |i: usize| {
                let merged = |v: usize| *merged.get(k)?.get(i)?.get(v)?;
                geomorph::geomorph(own[i], &level.meshes[i], merged)
            };
            geomorphs.push((0..parts.len()).map(of_part).collect());
            own = level.meshes.iter().collect();
        }
    }
    Ok(SceneChain { levels, geomorphs })
}

/// How far away something has to be so that a deviation shows no larger than wanted.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct Screen {
    /// Vertical field of view.
    pub fov_deg: f64,
    /// Height of the picture.
    pub height_px: f64,
    /// The largest deviation that may be seen.
    pub pixels: f64,
}

impl Default for Screen {
    /// One pixel of 1080, at 60 degrees.
    fn default() -> Self {
        Self { fov_deg: 60.0, height_px: 1080.0, pixels: 1.0 }
    }
}

impl Screen {
    /// A screen; `None` unless the angle lies between 0 and 180 degrees and both sizes are above 0.
    pub fn new(fov_deg: f64, height_px: f64, pixels: f64) -> Option<Self> {
        let is_size = |x: f64| x > 0.0 && x.is_finite();
        (is_size(fov_deg) && fov_deg < 180.0 && is_size(height_px) && is_size(pixels)).then_some(Self {
            fov_deg,
            height_px,
            pixels,
        })
    }

    /// The distance from the eye at which a deviation of `error`, seen from the side, is `pixels` high: from there on it
    /// shows no more. At a distance d the picture is 2 d tan(fov / 2) high, so one pixel is 2 d tan(fov / 2) / height.
    pub fn distance(&self, error: f64) -> f64 {
        error * self.height_px / (2.0 * (self.fov_deg.to_radians() / 2.0).tan() * self.pixels)
    }

    /// How much of the picture's height a ball of this diameter takes at a distance.
    pub fn coverage(&self, diameter: f64, distance: f64) -> f64 {
        diameter / (2.0 * distance * (self.fov_deg.to_radians() / 2.0).tan())
    }
}

/// The deviation of a level that is not to show: the bound that was proven both ways or the largest that was measured, if
/// that is more; else the estimate of the RMS.
pub fn error_of(report: &Report) -> f64 {
    let error = &report.error;
    let measured = error.measured.as_ref().map(|m| m.hausdorff.symmetric);
    // A bound of one way may be less than the other way is.
    measured.into_iter().chain(error.bound).reduce(f64::max).unwrap_or(error.estimate)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_deviation_is_as_high_as_wanted() {
        // At 90 degrees the picture is twice as high as it is far.
        let screen = Screen::new(90.0, 1000.0, 2.0).unwrap();
        let distance = screen.distance(0.01);
        let pixel = 2.0 * distance / 1000.0;
        assert!((0.01 / pixel - 2.0).abs() < 1e-12);
        assert!((screen.coverage(1.0, 2.0) - 0.25).abs() < 1e-12);
        assert!(Screen::new(180.0, 1.0, 1.0).is_none() && Screen::new(60.0, 0.0, 1.0).is_none());
    }

    #[test]
    fn levels_fall() {
        let stops = |levels: Levels| levels.stops();
        assert_eq!(
            stops(Levels::Steps { count: 2, factor: 0.5 }).unwrap(),
            [Stop::ratio(0.5), Stop::ratio(0.25)]
        );
        assert!(stops(Levels::Ratios(vec![0.5, 0.5])).is_err());
        assert!(stops(Levels::Faces(vec![10, 20])).is_err());
        assert!(stops(Levels::Faces(vec![])).is_err());
        assert!(stops(Levels::Steps { count: 3, factor: 1.0 }).is_err());
        let errors = [0.01, 0.001].map(Length::OfDiagonal).to_vec();
        assert!(stops(Levels::Errors(errors)).is_err());
        assert!(stops(Levels::Errors(vec![Length::Units(1.0), Length::OfDiagonal(0.1)])).is_ok());
    }
}
