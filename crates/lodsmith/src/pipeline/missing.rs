//! Missing values: attributes that are NaN or infinite.
//!
//! ```text
//! before a run   extend the known values into the gaps, so that gaps neither add to costs nor block collapses
//! after it       set the named values of a vertex to NaN where the values of the nearest corner of the input are
//! ```
//!
//! Texture coordinates, colours and the like keep the extended values, because formats have no NaN there.

use std::borrow::Cow;

use lodsmith_core::spatial::{Bvh, Hint};
use lodsmith_core::{MeshError, Semantic, TriMesh, VertexId, WedgeId};

use crate::input::Input;
use crate::run::Done;

/// Rounds of smoothing after the gaps were filled from their edges inwards. (Guessed: most gaps are narrow
/// and need none.)
const SMOOTHING_ROUNDS: usize = 8;

/// A mesh without missing values, and how many it had.
pub(crate) struct Completed<'a> {
    pub(crate) mesh: Cow<'a, TriMesh>,
    pub(crate) count: usize,
}

impl<'a> Completed<'a> {
    /// Completes a mesh; a mesh without missing values is borrowed. Cost: O(n).
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
        Ok(Self { mesh: Cow::Owned(completed), count })
    }

    /// Returns a result with its missing values.
    pub(crate) fn finished(&self, (mut done, held): Done, own: &Input<'_>) -> Done {
        if let Some(own) = own.mesh {
            restore(&mut done.mesh, own);
            held.restore(&mut done.mesh, own);
        }
        (done, held)
    }

    /// Returns the input of a run with the completed mesh in place of its own.
    pub(crate) fn input<'b>(&'b self, own: &Input<'b>) -> Input<'b> {
        Input { mesh: own.mesh.map(|_| &*self.mesh), ..own.clone() }
    }
}

/// Completes the mesh of an input; without one, or if nothing is missing, there is nothing to do.
pub(crate) fn completed<'a>(input: &Input<'a>) -> Result<Option<Completed<'a>>, MeshError> {
    let completed = input.mesh.map(Completed::new).transpose()?;
    Ok(completed.filter(|c| c.count > 0))
}

/// Makes the named values of a result NaN where the values of the nearest corner of the input are missing.
fn restore(result: &mut TriMesh, input: &TriMesh) {
    let named = |mesh: &TriMesh| -> Vec<usize> {
        let all = mesh.further_attributes().iter().enumerate();
        all.filter(|(_, a)| is_named(&a.semantic)).map(|(i, _)| i).collect()
    };
    let has_gaps = |i: &usize| input.further_attributes()[*i].values.iter().any(|x| !x.is_finite());
    let with_gaps: Vec<usize> = named(input).into_iter().filter(has_gaps).collect();
    if with_gaps.is_empty() {
        return;
    }
    let nearest = nearest_corners(result, input);
    let vertices: Vec<VertexId> =
        (0..result.wedge_count()).map(|w| result.vertex_of(WedgeId::new(w))).collect();
    for i in with_gaps {
        let source = &input.further_attributes()[i];
        let same = |j: &usize| {
            let a = &result.further_attributes()[*j];
            a.semantic == source.semantic && a.width == source.width
        };
        let Some(own) = named(result).into_iter().find(same) else { continue };
        let rows = result.further_values_mut(own).chunks_exact_mut(source.width);
        for (row, v) in rows.zip(&vertices) {
            let Some(corner) = nearest[v.index()] else { continue };
            for (x, from) in row.iter_mut().zip(source.of(corner)) {
                if !from.is_finite() {
                    *x = f32::NAN;
                }
            }
        }
    }
}

/// Returns for each vertex of a result the nearest corner of the nearest face of the input.
fn nearest_corners(result: &TriMesh, input: &TriMesh) -> Vec<Option<WedgeId>> {
    let (surface, view) = (input.surface(), input.positions().view());
    let tree = Bvh::new(&surface);
    let mut hint = Hint::default();
    let of = |p: [f64; 3]| {
        let hit = tree.closest_from(p, &mut hint)?;
        let distance = |w: &WedgeId| {
            let q = view.get(input.vertex_of(*w));
            (0..3).map(|k| (p[k] - q[k]).powi(2)).sum::<f64>()
        };
        input.triangles()[hit.face.index()].into_iter().min_by(|a, b| distance(a).total_cmp(&distance(b)))
    };
    result.positions().view().iter().map(of).collect()
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

/// The neighbours of the wedges with any missing value.
struct Gaps {
    wedges: Vec<u32>,
    /// Start of the neighbours of each wedge, and the end of the last.
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

    /// Extends the known values of an attribute into its gaps, from their edges inwards, and smooths them.
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
        // Layer by layer: a wedge that got a value belongs to the edge of the gap for the next layer.
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
            // These parts have no known values.
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
    use lodsmith_core::{Attribute, shapes};

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
    fn gaps_are_filled_from_their_edges_and_restored() {
        let is_gap = |i: usize| i % 7 == 3;
        let mesh = sheet_with(|i, p| if is_gap(i) { f32::NAN } else { p[0] as f32 });
        let completed = Completed::new(&mesh).unwrap();
        assert_eq!(completed.count, (0..mesh.wedge_count()).filter(|&i| is_gap(i)).count());
        let full = sheet_with(|_, p| p[0] as f32);
        // Extended values are off by less than the distance between neighbours; there are eight along the
        // side.
        let range = heat(&full).iter().fold([f32::MAX, f32::MIN], |[a, b], &x| [a.min(x), b.max(x)]);
        let step = (range[1] - range[0]) / 8.0;
        assert!(heat(&completed.mesh).iter().zip(heat(&full)).all(|(a, b)| (a - b).abs() < step));
        let mut back = completed.mesh.into_owned();
        restore(&mut back, &mesh);
        assert_eq!(back.further_attributes().len(), 1);
        for i in 0..mesh.wedge_count() {
            assert!(heat(&back)[i].to_bits() == heat(&mesh)[i].to_bits(), "{i}");
        }
    }

    #[test]
    fn a_mesh_without_missing_values_is_unchanged() {
        let mesh = sheet_with(|i, _| i as f32);
        let completed = Completed::new(&mesh).unwrap();
        assert!(completed.count == 0 && matches!(completed.mesh, Cow::Borrowed(_)));
    }

    #[test]
    fn values_are_0_where_none_is_known_and_texture_coordinates_are_extended() {
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
        // Infinite values come back as NaN: only the fact that they are missing is kept.
        let mut back = completed.mesh.into_owned();
        restore(&mut back, &broken);
        assert!(heat(&back).iter().all(|x| x.is_nan()));
    }
}
