//! Search for close vertices that may be worth joining, with a tree over their positions.

use glam::Vec3;

/// Maximum number of partners per vertex: only the nearest are kept.
const MAX_PARTNERS: usize = 4;
/// Maximum number of vertices visited per search. (Guessed; a sheet has that many within eleven edges. With
/// more, the distance is far too large for the mesh, and the nearest are still found.)
const MAX_VISITS: usize = 400;
/// Vertices in a leaf of the tree.
const LEAF_SIZE: usize = 8;
/// Minimum cosine between a direction and a normal at which the surface is open in that direction: 73
/// degrees. (Guessed; the corners of six triangles that have shrunk away from their common vertex face each
/// other at 60.)
const MIN_OPEN_COS: f32 = 0.3;

/// A vertex, and the directions in which its surface is open.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Site {
    pub(super) p: Vec3,
    /// The connected part that it belongs to.
    pub(super) part: u32,
    /// Unit normal, or zero.
    pub(super) normal: Vec3,
    /// On a border the unit vector that points away from the surface, in its plane; zero if the surface is
    /// open in all directions.
    pub(super) out: Option<Vec3>,
}

impl Site {
    fn is_open_to(&self, direction: Vec3, length: f32) -> bool {
        match self.out {
            Some(out) => out == Vec3::ZERO || out.dot(direction) > MIN_OPEN_COS * length,
            None => self.normal.dot(direction) > MIN_OPEN_COS * length,
        }
    }
    fn faces_away_from(&self, direction: Vec3, length: f32) -> bool {
        self.out.is_none() && self.normal.dot(direction) < -MIN_OPEN_COS * length
    }
    /// True if joining the two makes sense. Within a part they have to face each other across open space;
    /// neighbours on one sheet, or on the two sides of a thin wall, do not. Vertices of different parts only
    /// must not be back to back.
    #[inline(always)]
    fn is_compatible(&self, other: &Self, length: f32) -> bool {
        let direction = other.p - self.p;
        if self.part == other.part {
            self.is_open_to(direction, length) && other.is_open_to(-direction, length)
        } else {
            !(self.faces_away_from(direction, length) && other.faces_away_from(-direction, length))
        }
    }
}

/// Two sites by index, the lower one first, and their squared distance.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct NearPair {
    pub(super) ends: [u32; 2],
    pub(super) distance_sq: f32,
}

/// Returns pairs of compatible sites within `reach`, the nearest first: for each site its [`MAX_PARTNERS`] nearest,
/// found among the first [`MAX_VISITS`] visited. `should_continue` is called for every site; returns `None`
/// if it returns false. Cost: O(n log n).
pub(super) fn near_pairs(
    sites: &[Site],
    reach: f32,
    mut should_continue: impl FnMut() -> bool,
) -> Option<Vec<NearPair>> {
    let tree = Tree::new(sites);
    let mut pairs = Vec::new();
    for i in 0..sites.len() as u32 {
        if !should_continue() {
            return None;
        }
        let mut search = NearSearch {
            sites,
            of: i,
            reach_sq: reach * reach,
            found: [(0.0, 0); MAX_PARTNERS],
            count: 0,
            visits: 0,
        };
        tree.visit(0, sites.len(), &mut search);
        for &(distance_sq, j) in &search.found[..search.count] {
            pairs.push(NearPair { ends: [i.min(j), i.max(j)], distance_sq });
        }
    }
    pairs.sort_unstable_by(|a, b| a.distance_sq.total_cmp(&b.distance_sq).then(a.ends.cmp(&b.ends)));
    pairs.dedup_by_key(|p| p.ends);
    Some(pairs)
}

/// K-d tree: positions split recursively at the median along their longest extent.
struct Tree {
    points: Vec<(Vec3, u32)>,
    /// Split axis of a range, stored at its middle.
    axes: Vec<u8>,
}

struct NearSearch<'a> {
    sites: &'a [Site],
    of: u32,
    /// Search radius, squared; it shrinks to the farthest partner kept.
    reach_sq: f32,
    found: [(f32, u32); MAX_PARTNERS],
    count: usize,
    visits: usize,
}

impl NearSearch<'_> {
    #[inline(always)]
    fn visit_site(&mut self, &(p, j): &(Vec3, u32)) {
        self.visits += 1;
        let own = &self.sites[self.of as usize];
        let distance_sq = (p - own.p).length_squared();
        if distance_sq < self.reach_sq
            && j != self.of
            && own.is_compatible(&self.sites[j as usize], distance_sq.sqrt())
        {
            let at = self.found[..self.count].partition_point(|f| (f.0, f.1) < (distance_sq, j));
            self.count = (self.count + 1).min(MAX_PARTNERS);
            self.found[at..self.count].rotate_right(1);
            self.found[at] = (distance_sq, j);
            if self.count == MAX_PARTNERS {
                self.reach_sq = self.found[MAX_PARTNERS - 1].0;
            }
        }
    }
}

impl Tree {
    fn new(sites: &[Site]) -> Self {
        let points: Vec<(Vec3, u32)> = sites.iter().enumerate().map(|(i, s)| (s.p, i as u32)).collect();
        let mut tree = Self { axes: vec![0; points.len()], points };
        tree.part(0, sites.len());
        tree
    }

    fn part(&mut self, from: usize, to: usize) {
        if to - from <= LEAF_SIZE {
            return;
        }
        let range = &mut self.points[from..to];
        let none = (Vec3::splat(f32::INFINITY), Vec3::splat(f32::NEG_INFINITY));
        let (min, max) = range.iter().fold(none, |(min, max), x| (min.min(x.0), max.max(x.0)));
        let extent = max - min;
        let axis = (0..3).max_by(|&i, &j| extent[i].total_cmp(&extent[j]).then(j.cmp(&i))).unwrap_or(0);
        let middle = (from + to) / 2;
        range.select_nth_unstable_by(middle - from, |a, b| {
            a.0[axis].total_cmp(&b.0[axis]).then(a.1.cmp(&b.1))
        });
        self.axes[middle] = axis as u8;
        self.part(from, middle);
        self.part(middle + 1, to);
    }

    /// Visits a range of sites, starting with the half that contains the position.
    fn visit(&self, from: usize, to: usize, search: &mut NearSearch<'_>) {
        if search.visits >= MAX_VISITS {
            return;
        }
        if to - from <= LEAF_SIZE {
            self.points[from..to].iter().for_each(|x| search.visit_site(x));
            return;
        }
        let middle = (from + to) / 2;
        let axis = usize::from(self.axes[middle]);
        let beyond = search.sites[search.of as usize].p[axis] - self.points[middle].0[axis];
        let halves = [(from, middle), (middle + 1, to)];
        let own = usize::from(beyond > 0.0);
        self.visit(halves[own].0, halves[own].1, search);
        if beyond * beyond <= search.reach_sq {
            search.visit_site(&self.points[middle]);
            self.visit(halves[1 - own].0, halves[1 - own].1, search);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn random_sites(count: usize, part_count: u32) -> Vec<Site> {
        let mut x = 0x9E37_79B9u32;
        let mut random = move || {
            x ^= x << 13;
            x ^= x >> 17;
            x ^= x << 5;
            x as f32 / u32::MAX as f32
        };
        let mut site = |i: usize| Site {
            p: Vec3::new(random(), random(), random()),
            part: i as u32 % part_count,
            ..Site::default()
        };
        (0..count).map(&mut site).collect()
    }

    #[test]
    fn all_near_pairs_are_found() {
        let sites = random_sites(300, 300);
        let reach = 0.08f32;
        let found = near_pairs(&sites, reach, || true).unwrap();
        assert!(found.is_sorted_by(|a, b| a.distance_sq <= b.distance_sq));
        let mut wanted = 0;
        for i in 0..300u32 {
            for j in i + 1..300 {
                let near = sites[i as usize].p.distance_squared(sites[j as usize].p) < reach * reach;
                assert_eq!(near, found.iter().any(|f| f.ends == [i, j]), "{i} {j}");
                wanted += usize::from(near);
            }
        }
        assert!(wanted > 50, "{wanted}");
    }

    #[test]
    fn of_very_many_sites_the_nearest_are_found() {
        let sites = random_sites(5000, 5000);
        let found = near_pairs(&sites, 10.0, || true).unwrap();
        assert!(found.len() <= MAX_PARTNERS * sites.len());
        for i in 0..5000u32 {
            let own = sites[i as usize].p;
            let near = |j: &u32| own.distance_squared(sites[*j as usize].p);
            let nearest = (0..5000).filter(|j| *j != i).min_by(|a, b| near(a).total_cmp(&near(b))).unwrap();
            assert!(found.iter().any(|f| f.ends == [i.min(nearest), i.max(nearest)]), "{i}");
        }
    }

    #[test]
    fn many_sites_at_one_position_take_linear_time() {
        // All sites are at one position, in one part and without a normal: none are compatible, and no search
        // visits all the others.
        let sites = vec![Site::default(); 200_000];
        assert_eq!(near_pairs(&sites, 1.0, || true).unwrap(), []);
        assert_eq!(near_pairs(&sites, 1.0, || false), None);
    }

    #[test]
    fn sides_of_walls_and_neighbours_on_sheets_are_not_joined() {
        let at = |x: f32, y: f32, part, normal| Site { p: Vec3::new(x, y, 0.0), part, normal, out: None };
        let suits = |a: Site, b: Site| {
            a.is_compatible(&b, a.p.distance(b.p)) && b.is_compatible(&a, a.p.distance(b.p))
        };
        // Two sides of a gap, and of a wall.
        assert!(suits(at(0.0, 0.0, 0, Vec3::Y), at(0.0, 0.1, 0, -Vec3::Y)));
        assert!(!suits(at(0.0, 0.0, 0, -Vec3::Y), at(0.0, 0.1, 0, Vec3::Y)));
        assert!(!suits(at(0.0, 0.0, 0, -Vec3::Y), at(0.0, 0.1, 1, Vec3::Y)));
        // Side by side on one sheet, and on two.
        assert!(!suits(at(0.0, 0.0, 0, Vec3::Y), at(0.1, 0.0, 0, Vec3::Y)));
        assert!(suits(at(0.0, 0.0, 0, Vec3::Y), at(0.1, 0.0, 1, Vec3::Y)));
        // Across a crack, and along it.
        let border = |x, y, out| Site { out: Some(out), ..at(x, y, 0, Vec3::Z) };
        assert!(suits(border(0.0, 0.0, Vec3::Y), border(0.0, 0.1, -Vec3::Y)));
        assert!(!suits(border(0.0, 0.0, Vec3::Y), border(0.1, 0.0, Vec3::Y)));
    }
}
