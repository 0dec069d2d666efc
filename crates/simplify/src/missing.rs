//! Missing values: attributes that are NaN or infinite.
//!
//! ```text
//! before a run   continue the known values into the gaps, so that these neither cost nor keep anything; note for each
//!                wedge which of its named values are missing, as labels, which are not blended
//! after it       the named values of a wedge with such a label are NaN
//! ```
//!
//! Texture coordinates, colours and the like keep the continued values, because formats have no NaN there.

use std::borrow::Cow;

use lodsmith_core::{Attribute, IntegerType, MeshError, Semantic, TriMesh, WedgeId};

use crate::input::Input;
use crate::run::Done;

/// Name of the attribute that says which values are missing. A progressive mesh and its file have it too.
const MASK_NAME: &str = "lodsmith:missing";
/// Bits in one value of a mask: single precision holds such numbers exactly.
const MASK_BITS: usize = 16;
/// Rounds of smoothing after the gaps were filled from their edges inwards. (Guessed: what matters are narrow gaps,
/// which need none.)
const SMOOTHING_ROUNDS: usize = 8;

/// A mesh without missing values, and how many it had.
pub(crate) struct Completed<'a> {
    pub(crate) mesh: Cow<'a, TriMesh>,
    pub(crate) count: usize,
}

impl<'a> Completed<'a> {
    /// Completes a mesh; one that misses nothing is borrowed. Cost: O(n).
    pub(crate) fn new(mesh: &'a TriMesh) -> Result<Self, MeshError> {
        let count = count(mesh);
        if count == 0 {
            return Ok(Self { mesh: Cow::Borrowed(mesh), count });
        }
        let gaps = Gaps::new(mesh);
        let mut completed = mesh.clone();
        completed.set_normals(mesh.normals().map(|all| {
            let mut all = all.to_vec();
            gaps.fill(all.as_flattened_mut(), 3);
            all
        }))?;
        completed.set_uvs(mesh.uvs().map(|all| {
            let mut all = all.to_vec();
            gaps.fill(all.as_flattened_mut(), 2);
            all
        }))?;
        completed.set_colors(mesh.colors().map(|all| {
            let mut all = all.to_vec();
            gaps.fill(all.as_flattened_mut(), 4);
            all
        }))?;
        for (i, a) in mesh.further_attributes().iter().enumerate().filter(|x| is_blended(&x.1.semantic)) {
            gaps.fill(completed.further_values_mut(i), a.width);
        }
        if let Some(mask) = mask(mesh) {
            completed.add_attribute(mask)?;
        }
        Ok(Self { mesh: Cow::Owned(completed), count })
    }

    /// Returns a result with its missing values, and their number in its report.
    pub(crate) fn finished(&self, (mut done, held): Done, own: &Input<'_>) -> Done {
        done.report.missing_values = self.count;
        done.mesh = restored(done.mesh);
        if let Some(own) = own.mesh {
            held.restore(&mut done.mesh, own);
        }
        (done, held)
    }

    /// Returns the input of a run with the completed mesh in place of its own.
    pub(crate) fn input<'b>(&'b self, own: &Input<'b>) -> Input<'b> {
        Input {
            surface: own.surface.clone(),
            mesh: own.mesh.map(|_| &*self.mesh),
            joined: own.joined.clone(),
        }
    }
}

/// Completes the mesh of an input; without one, or if nothing is missing, there is nothing to do.
pub(crate) fn completed<'a>(input: &Input<'a>) -> Result<Option<Completed<'a>>, MeshError> {
    let completed = input.mesh.map(Completed::new).transpose()?;
    Ok(completed.filter(|c| c.count > 0))
}

/// Makes the values NaN that the mask of a mesh says are missing, and removes the mask.
pub(crate) fn restored(mut mesh: TriMesh) -> TriMesh {
    let Some(mask) = mesh.further_attributes().iter().find(|a| is_mask(&a.semantic)).cloned() else {
        return mesh;
    };
    let mut bit = 0;
    for i in 0..mesh.further_attributes().len() {
        let a = &mesh.further_attributes()[i];
        let (is_named, width) = (is_named(&a.semantic), a.width);
        if !is_named {
            continue;
        }
        for (w, row) in mesh.further_values_mut(i).chunks_exact_mut(width).enumerate() {
            let words = mask.of(WedgeId::new(w));
            for (k, x) in row.iter_mut().enumerate() {
                let word = words.get((bit + k) / MASK_BITS).map_or(0, |x| *x as u32);
                if word >> ((bit + k) % MASK_BITS) & 1 == 1 {
                    *x = f32::NAN;
                }
            }
        }
        bit += width;
    }
    mesh.without_further(is_mask)
}

fn is_mask(semantic: &Semantic) -> bool {
    matches!(semantic, Semantic::Discrete { name, .. } if name == MASK_NAME)
}

/// True for an attribute whose missing values stay NaN.
fn is_named(semantic: &Semantic) -> bool {
    matches!(semantic, Semantic::Custom(_))
}

/// True for an attribute that is blended; joints and weights are read together.
fn is_blended(semantic: &Semantic) -> bool {
    !matches!(semantic, Semantic::Joints(_) | Semantic::Weights(_) | Semantic::Discrete { .. })
}

/// Number of missing values.
fn count(mesh: &TriMesh) -> usize {
    let of = |all: &[f32]| all.iter().filter(|x| !x.is_finite()).count();
    let further = mesh.further_attributes().iter().filter(|a| is_blended(&a.semantic));
    let [normals, uvs, colors] = [
        mesh.normals().map(<[_]>::as_flattened),
        mesh.uvs().map(<[_]>::as_flattened),
        mesh.colors().map(<[_]>::as_flattened),
    ]
    .map(|all| all.map_or(0, of));
    normals + uvs + colors + further.map(|a| of(&a.values)).sum::<usize>()
}

/// Returns for each wedge a bit for each of its named values; `None` if none of them is missing.
fn mask(mesh: &TriMesh) -> Option<Attribute> {
    let named = || mesh.further_attributes().iter().filter(|a| is_named(&a.semantic));
    if named().all(|a| a.values.iter().all(|x| x.is_finite())) {
        return None;
    }
    let width = named().map(|a| a.width).sum::<usize>().div_ceil(MASK_BITS);
    let mut values = vec![0f32; width * mesh.wedge_count()];
    for (w, words) in values.chunks_exact_mut(width).enumerate() {
        let row = named().flat_map(|a| a.of(WedgeId::new(w)));
        for (bit, _) in row.enumerate().filter(|(_, x)| !x.is_finite()) {
            words[bit / MASK_BITS] += f32::from(1u16 << (bit % MASK_BITS));
        }
    }
    let semantic = Semantic::Discrete { name: MASK_NAME.into(), of: IntegerType::U16 };
    Some(Attribute { semantic, width, values })
}

/// The neighbours of the wedges that miss any value.
struct Gaps {
    wedges: Vec<u32>,
    /// Start of the neighbours of each, and the end of the last.
    at: Vec<usize>,
    neighbours: Vec<u32>,
}

impl Gaps {
    fn new(mesh: &TriMesh) -> Self {
        const WHOLE: u32 = u32::MAX;
        let mut place = vec![WHOLE; mesh.wedge_count()];
        let mut look = |all: &[f32], width: usize| {
            for (place, row) in place.iter_mut().zip(all.chunks_exact(width)) {
                if row.iter().any(|x| !x.is_finite()) {
                    *place = 0;
                }
            }
        };
        look(mesh.normals().map_or(&[], <[_]>::as_flattened), 3);
        look(mesh.uvs().map_or(&[], <[_]>::as_flattened), 2);
        look(mesh.colors().map_or(&[], <[_]>::as_flattened), 4);
        mesh.further_attributes()
            .iter()
            .filter(|a| is_blended(&a.semantic))
            .for_each(|a| look(&a.values, a.width));
        let wedges: Vec<u32> = (0..place.len() as u32).filter(|&w| place[w as usize] != WHOLE).collect();
        wedges.iter().enumerate().for_each(|(i, &w)| place[w as usize] = i as u32);
        let corners = || {
            mesh.triangles().iter().flat_map(|t| [[0, 1, 2], [1, 2, 0], [2, 0, 1]].map(|k| k.map(|k| t[k])))
        };
        let gap = |w: WedgeId| place[w.index()] as usize;
        let mut at = vec![0; wedges.len() + 1];
        corners().filter(|c| place[c[0].index()] != WHOLE).for_each(|c| at[gap(c[0]) + 1] += 2);
        (0..wedges.len()).for_each(|i| at[i + 1] += at[i]);
        let mut neighbours = vec![0; at[wedges.len()]];
        let mut next = at.clone();
        for [w, a, b] in corners().filter(|c| place[c[0].index()] != WHOLE) {
            for other in [a, b] {
                neighbours[next[gap(w)]] = other.0;
                next[gap(w)] += 1;
            }
        }
        Self { wedges, at, neighbours }
    }

    /// Continues the known values of an attribute into its gaps: from their edges inwards, then smoothed.
    fn fill(&self, values: &mut [f32], width: usize) {
        for k in 0..width {
            self.fill_lane(values, width, k);
        }
    }

    fn fill_lane(&self, values: &mut [f32], width: usize, k: usize) {
        let lane = |w: u32| w as usize * width + k;
        let gaps: Vec<usize> =
            (0..self.wedges.len()).filter(|&i| !values[lane(self.wedges[i])].is_finite()).collect();
        if gaps.is_empty() {
            return;
        }
        let mean_of = |values: &[f32], i: usize| {
            let (mut sum, mut count) = (0.0, 0);
            for &n in &self.neighbours[self.at[i]..self.at[i + 1]] {
                let x = values[lane(n)];
                if x.is_finite() {
                    (sum, count) = (sum + f64::from(x), count + 1);
                }
            }
            (count > 0).then(|| (sum / f64::from(count)) as f32)
        };
        // Layer by layer: a wedge that got a value is one of the edge for the next.
        let mut open = gaps.clone();
        let mut is_asked: Vec<bool> = vec![true; self.wedges.len()];
        while !open.is_empty() {
            let found: Vec<(usize, f32)> =
                open.iter().filter_map(|&i| Some((i, mean_of(values, i)?))).collect();
            if found.is_empty() {
                break;
            }
            for &(i, x) in &found {
                values[lane(self.wedges[i])] = x;
                is_asked[i] = false;
            }
            open.retain(|&i| is_asked[i]);
        }
        if !open.is_empty() {
            // Nothing is known in these parts.
            let known = values.iter().skip(k).step_by(width).filter(|x| x.is_finite());
            let (sum, count) = known.fold((0.0, 0u32), |(sum, n), &x| (sum + f64::from(x), n + 1));
            let mean = if count > 0 { (sum / f64::from(count)) as f32 } else { 0.0 };
            open.iter().for_each(|&i| values[lane(self.wedges[i])] = mean);
        }
        for _ in 0..SMOOTHING_ROUNDS {
            for &i in &gaps {
                if let Some(mean) = mean_of(values, i) {
                    values[lane(self.wedges[i])] = mean;
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use lodsmith_core::shapes;

    use super::*;

    fn sheet_with(of: impl Fn(usize, [f64; 3]) -> f32) -> TriMesh {
        let mut mesh = shapes::grid(8);
        let values = mesh.positions().view().iter().enumerate().map(|(i, p)| of(i, p)).collect();
        mesh.add_attribute(Attribute { semantic: Semantic::Custom("heat".into()), width: 1, values })
            .unwrap();
        mesh
    }

    fn heat(mesh: &TriMesh) -> &[f32] {
        &mesh.further_attributes()[0].values
    }

    #[test]
    fn gaps_are_filled_from_their_edges_and_come_back() {
        let is_gap = |i: usize| i % 7 == 3;
        let mesh = sheet_with(|i, p| if is_gap(i) { f32::NAN } else { p[0] as f32 });
        let completed = Completed::new(&mesh).unwrap();
        assert_eq!(completed.count, (0..mesh.wedge_count()).filter(|&i| is_gap(i)).count());
        let full = sheet_with(|_, p| p[0] as f32);
        // Continued: off by less than the distance between neighbours, of which there are eight along the side.
        let range = heat(&full).iter().fold([f32::MAX, f32::MIN], |[a, b], &x| [a.min(x), b.max(x)]);
        let step = (range[1] - range[0]) / 8.0;
        assert!(heat(&completed.mesh).iter().zip(heat(&full)).all(|(a, b)| (a - b).abs() < step));
        let back = restored(completed.mesh.into_owned());
        assert_eq!(back.further_attributes().len(), 1);
        for i in 0..mesh.wedge_count() {
            assert!(heat(&back)[i].to_bits() == heat(&mesh)[i].to_bits(), "{i}");
        }
    }

    #[test]
    fn a_mesh_that_misses_nothing_is_left_alone() {
        let mesh = sheet_with(|i, _| i as f32);
        let completed = Completed::new(&mesh).unwrap();
        assert!(completed.count == 0 && matches!(completed.mesh, Cow::Borrowed(_)));
        assert_eq!(restored(mesh.clone()), mesh);
    }

    #[test]
    fn where_nothing_is_known_all_is_0_and_texture_coordinates_are_continued() {
        let mut mesh = sheet_with(|_, _| f32::INFINITY);
        let uvs = mesh.positions().view().iter().map(|p| [p[0] as f32, p[1] as f32]).collect();
        mesh.set_uvs(Some(uvs)).unwrap();
        let mut broken = mesh.clone();
        broken
            .set_uvs(mesh.uvs().map(|all| {
                let mut all = all.to_vec();
                all[40] = [f32::NAN, all[40][1]];
                all
            }))
            .unwrap();
        let completed = Completed::new(&broken).unwrap();
        assert_eq!(completed.count, mesh.wedge_count() + 1);
        assert!(heat(&completed.mesh).iter().all(|x| *x == 0.0));
        let (got, wanted) = (completed.mesh.uvs().unwrap()[40], mesh.uvs().unwrap()[40]);
        assert!((got[0] - wanted[0]).abs() < 1e-6 && got[1] == wanted[1], "{got:?} {wanted:?}");
        // Infinite values come back as NaN: what is known of them is that they are missing.
        assert!(heat(&restored(completed.mesh.into_owned())).iter().all(|x| x.is_nan()));
    }
}
