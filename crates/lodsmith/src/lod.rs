//! Chains of levels of detail: several lighter meshes of one input, and the distances to switch between them.

mod geomorph;

use lodsmith_core::{Positions, TriMesh};

use crate::control::{Control, NoControl, ProgressShare, Stage, has_time_for};
use crate::input::Input;
use crate::options::{Length, SimplifyOptions, Stop};
use crate::report::{Report, StoppedBy};
use crate::run::is_chained;
use crate::scene::{self, Part, SimplifiedScene};
use crate::{Simplified, SimplifyError, pipeline, simplify_with};

/// The levels to make besides the original, each lighter than the one before.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub enum Levels {
    /// Fractions of the triangles, descending.
    Ratios(Vec<f64>),
    /// Numbers of triangles, descending.
    Faces(Vec<usize>),
    /// A number of levels, each with the same fraction of the triangles of the level before.
    Steps {
        /// Number of levels, not counting the original.
        count: usize,
        /// Fraction of the triangles of the level before, above 0 and below 1.
        factor: f64,
    },
    /// Largest deviations, measured both ways, ascending; each level is the lightest mesh within its
    /// deviation.
    Errors(Vec<Length>),
}

impl Levels {
    /// Returns the number of levels, not counting the original; at most 64 of [`Levels::Steps`], which may not have more.
    pub fn count(&self) -> usize {
        match self {
            Self::Ratios(all) => all.len(),
            Self::Faces(all) => all.len(),
            Self::Steps { count, .. } => (*count).min(MAX_LEVELS),
            Self::Errors(all) => all.len(),
        }
    }

    /// Returns the stop of each level.
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
            Self::Steps { factor, count } => {
                if *count > MAX_LEVELS {
                    return bad("count", "at most 64", *count as f64);
                }
                if !(*factor > 0.0 && *factor < 1.0) {
                    return bad("factor", "above 0 and below 1", *factor);
                }
                let step =
                    |i: usize| factor.powi(i32::try_from(i).unwrap_or(i32::MAX)).max(f64::MIN_POSITIVE);
                (1..=self.count()).map(|i| Stop::ratio(step(i))).collect()
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
            n if n > MAX_LEVELS => bad("levels", "at most 64", n as f64),
            _ => Ok(stops),
        }
    }
}

/// Largest number of levels; more are considered a mistake: if each is a tenth lighter than the one before,
/// 64 lead from a billion triangles to a million.
const MAX_LEVELS: usize = 64;

/// Options of a chain.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct LodOptions {
    /// The levels to make.
    pub levels: Levels,
    /// Options of each level. The stop is the level's own; a stop set here is an error.
    pub simplify: SimplifyOptions,
    /// Records for each level the positions of its vertices on the next coarser one.
    pub geomorph: bool,
}

impl LodOptions {
    /// Returns the default options with these levels.
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
    /// All levels but level 0, which is the original. Fewer than requested if the caller ended the run.
    pub levels: Vec<Simplified>,
    /// Positions of the vertices of each level on the next coarser one, from level 0 on; empty unless
    /// requested. See [`LodChain::geomorph`].
    geomorphs: Vec<Positions>,
}

impl LodChain {
    /// Returns, for each vertex of a level, its position on the next coarser one, in the units of the mesh;
    /// level 0 is the original.
    ///
    /// Moving vertices to `p + t (q - p)`, with q from here, turns the level into the next one as t goes from
    /// 0 to 1: if one run made both, the faces at t = 1 are the faces of the coarser level, and all others
    /// have no area. If the target of a vertex is not known, it is the nearest point of the coarser level.
    /// Returns `None` for the last level, and if geomorphs were not requested.
    pub fn geomorph(&self, level: usize) -> Option<&Positions> {
        self.geomorphs.get(level)
    }
}

/// Makes a chain of levels of detail of a mesh.
///
/// If levels are given by counts and the method collapses edges, one run makes them all, and each level is
/// fitted separately. A level branches off the common sweeps before its last ones, so its sweeps are the same
/// as in a run to that level alone, and it is as close (docs/decisions/0016). With [`LodOptions::geomorph`]
/// the sweeps continue from level to level instead, and each level is made from the one before by collapses
/// alone, for about a percent more error. Other methods, levels by errors and [`SimplifyOptions::escalate`]
/// make each level from the original. The mesh is read only, so any number of chains can be made of one. With
/// [`BorderPolicy::Lock`](crate::BorderPolicy) borders are bit for bit the same in all levels.
///
/// ```
/// use lodsmith::core::shapes;
/// use lodsmith::{Levels, LodOptions, lod};
///
/// let mesh = shapes::icosphere(4);
/// let chain = lod(&mesh, &LodOptions::new(Levels::Ratios(vec![0.5, 0.1])))?;
/// assert!(chain.levels[0].mesh.face_count() > 4 * chain.levels[1].mesh.face_count());
/// # Ok::<(), lodsmith::SimplifyError>(())
/// ```
///
/// # Errors
/// Those of [`simplify`](crate::simplify()); [`SimplifyError::BadOption`] for levels that are out of order or
/// more than 64, [`SimplifyError::NotTogether`] for a stop among the options of the levels.
pub fn lod(mesh: &TriMesh, options: &LodOptions) -> Result<LodChain, SimplifyError> {
    lod_with(mesh, options, &mut NoControl)
}

/// [`lod`] with data of the mesh, and with a control; as [`simplify_with`].
///
/// # Errors
/// Those of [`lod`] and of [`simplify_with`].
pub fn lod_with<'a>(
    input: impl Into<Input<'a>>,
    options: &LodOptions,
    control: &mut dyn Control,
) -> Result<LodChain, SimplifyError> {
    chain(&input.into(), options, control)
}

fn chain(
    input: &Input<'_>,
    options: &LodOptions,
    control: &mut dyn Control,
) -> Result<LodChain, SimplifyError> {
    let stops = options.stops()?;
    let chain = if is_chained(&options.simplify, &stops) {
        pipeline::simplify_chain(input, &options.simplify, &stops, options.geomorph, control)?
    } else {
        None
    };
    let (levels, mergers) = match chain {
        Some((all, mergers)) => (all.into_iter().map(|done| done.0).collect::<Vec<_>>(), mergers),
        None => {
            let one =
                |stop, control: &mut dyn Control| simplify_with(input, &options.of_level(stop), control);
            (each_level(&stops, one, |level| level.report.stopped_by, control)?, Vec::new())
        }
    };
    let mut geomorphs = Vec::new();
    if options.geomorph {
        let whole = input.to_mesh()?;
        let mut own = &*whole;
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

/// Makes each level with a run of its own, until the caller ends one: the levels after it would hardly differ from the
/// original.
fn each_level<T>(
    stops: &[Stop],
    one: impl Fn(Stop, &mut dyn Control) -> Result<T, SimplifyError>,
    stopped_by: impl Fn(&T) -> StoppedBy,
    control: &mut dyn Control,
) -> Result<Vec<T>, SimplifyError> {
    let mut levels = Vec::with_capacity(stops.len());
    for (i, stop) in stops.iter().enumerate() {
        let control = &mut ProgressShare::of(control, i, stops.len());
        if i > 0 && !has_time_for(Stage::Prepare, control)? {
            break;
        }
        let level = one(*stop, control)?;
        let is_last = stopped_by(&level) == StoppedBy::Caller;
        levels.push(level);
        if is_last {
            break;
        }
    }
    Ok(levels)
}

/// The levels of a scene.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct SceneChain {
    /// All levels but level 0, which is the original. Fewer than requested if the caller ended the run.
    pub levels: Vec<SimplifiedScene>,
    geomorphs: Vec<Vec<Positions>>,
}

impl SceneChain {
    /// Returns [`LodChain::geomorph`] of each mesh, in the order of the parts.
    pub fn geomorph(&self, level: usize) -> Option<&[Positions]> {
        self.geomorphs.get(level).map(Vec::as_slice)
    }
}

/// Makes a chain of levels of detail of a scene: at each level the meshes share one budget, as in
/// [`simplify_scene`](crate::simplify_scene).
///
/// One run makes all levels, as in [`lod`], if every mesh has the same number of instances. Otherwise, and
/// with [`SimplifyOptions::per_mesh`], each level is made from the original.
///
/// # Errors
/// Those of [`lod`].
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
            let one = |stop, control: &mut dyn Control| {
                scene::simplify_scene(parts, diagonal, &options.of_level(stop), control)
            };
            (each_level(&stops, one, |level| level.report.stopped_by, control)?, Vec::new())
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

/// Viewing conditions: they give the smallest distance at which a deviation is small enough on the screen.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct Screen {
    /// Vertical field of view, in degrees.
    pub fov_deg: f64,
    /// Height of the picture, in pixels.
    pub height_px: f64,
    /// The largest deviation that may be visible, in pixels.
    pub pixels: f64,
}

impl Default for Screen {
    /// Returns one pixel of 1080, at 60 degrees.
    fn default() -> Self {
        Self { fov_deg: 60.0, height_px: 1080.0, pixels: 1.0 }
    }
}

impl Screen {
    /// Returns a screen; `None` unless the angle lies between 0 and 180 degrees and both sizes are above 0.
    pub fn new(fov_deg: f64, height_px: f64, pixels: f64) -> Option<Self> {
        let is_size = |x: f64| x > 0.0 && x.is_finite();
        (is_size(fov_deg) && fov_deg < 180.0 && is_size(height_px) && is_size(pixels)).then_some(Self {
            fov_deg,
            height_px,
            pixels,
        })
    }

    /// Returns the distance from the eye at which a deviation of `error`, seen from the side, is `pixels`
    /// high; farther away it is smaller. At a distance d the picture is 2 d tan(fov / 2) high, so one pixel
    /// is 2 d tan(fov / 2) / height.
    pub fn distance(&self, error: f64) -> f64 {
        error * self.height_px / (2.0 * libm::tan(self.fov_deg.to_radians() / 2.0) * self.pixels)
    }

    /// Returns the fraction of the picture's height that a sphere of this diameter covers at a distance.
    pub fn coverage(&self, diameter: f64, distance: f64) -> f64 {
        diameter / (2.0 * distance * libm::tan(self.fov_deg.to_radians() / 2.0))
    }
}

/// Returns the deviation of a level that must not become visible: the larger of the proven bound and the
/// largest measured distance in either direction; without these, the estimated RMS. `None` if it is not known, because
/// the caller ended the run before it was measured.
pub fn error_of(report: &Report) -> Option<f64> {
    let error = &report.error;
    if error.is_incomplete {
        return None;
    }
    let measured = error.measured.as_ref().map(|m| m.hausdorff.symmetric);
    // A one-sided bound may be less than the distance in the other direction.
    Some(measured.into_iter().chain(error.bound).reduce(f64::max).unwrap_or(error.estimate))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_deviation_has_the_requested_height_on_screen() {
        // At 90 degrees the height of the picture is twice the distance.
        let screen = Screen::new(90.0, 1000.0, 2.0).unwrap();
        let distance = screen.distance(0.01);
        let pixel = 2.0 * distance / 1000.0;
        assert!((0.01 / pixel - 2.0).abs() < 1e-12);
        assert!((screen.coverage(1.0, 2.0) - 0.25).abs() < 1e-12);
        assert!(Screen::new(180.0, 1.0, 1.0).is_none() && Screen::new(60.0, 0.0, 1.0).is_none());
    }

    #[test]
    fn levels_must_descend() {
        let stops = |levels: Levels| levels.stops();
        assert_eq!(
            stops(Levels::Steps { count: 2, factor: 0.5 }).unwrap(),
            [Stop::ratio(0.5), Stop::ratio(0.25)]
        );
        assert!(stops(Levels::Ratios(vec![0.5, 0.5])).is_err());
        assert!(stops(Levels::Faces(vec![10, 20])).is_err());
        assert!(stops(Levels::Faces(vec![])).is_err());
        assert!(stops(Levels::Steps { count: 3, factor: 1.0 }).is_err());
        // (65 levels silently became 64.)
        assert_eq!(stops(Levels::Steps { count: 64, factor: 0.9 }).unwrap().len(), 64);
        assert!(stops(Levels::Steps { count: 65, factor: 0.9 }).is_err());
        let errors = [0.01, 0.001].map(Length::OfDiagonal).to_vec();
        assert!(stops(Levels::Errors(errors)).is_err());
        assert!(stops(Levels::Errors(vec![Length::Units(1.0), Length::OfDiagonal(0.1)])).is_ok());
    }
}
