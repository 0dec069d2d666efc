//! Memory orders of vertices and faces: they alone change times by a factor of two or more on large meshes.

use lodsmith_core::sampling::Random;

use crate::Soup;

/// A memory order of vertices and faces.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Order {
    /// The order of the file.
    File,
    /// Vertices along a Morton curve, faces by their first vertex.
    Morton,
    /// Random, with a fixed seed.
    Shuffled,
}

impl Order {
    /// All orders.
    pub const ALL: [Self; 3] = [Self::File, Self::Morton, Self::Shuffled];

    /// The name of the order in tables and options.
    pub const fn name(self) -> &'static str {
        match self {
            Self::File => "file",
            Self::Morton => "morton",
            Self::Shuffled => "shuffled",
        }
    }

    /// Returns the same surface in this order.
    pub fn apply(self, soup: &Soup) -> Soup {
        match self {
            Self::File => soup.clone(),
            Self::Morton => {
                let mut order: Vec<u32> = (0..soup.positions.len() as u32).collect();
                let code = morton_codes(&soup.positions);
                order.sort_by_key(|&i| (code[i as usize], i));
                let mut sorted = renumbered(soup, &order);
                let mut faces: Vec<[u32; 3]> = bytemuck::cast_slice(&sorted.indices).to_vec();
                faces.sort_by_key(|t| t.iter().copied().min());
                sorted.indices = faces.into_flattened();
                sorted
            }
            Self::Shuffled => {
                let mut random = Random::new(0x10D5_3117);
                let mut order: Vec<u32> = (0..soup.positions.len() as u32).collect();
                shuffle(&mut order, &mut random);
                let mut shuffled = renumbered(soup, &order);
                let mut faces: Vec<[u32; 3]> = bytemuck::cast_slice(&shuffled.indices).to_vec();
                shuffle(&mut faces, &mut random);
                shuffled.indices = faces.into_flattened();
                shuffled
            }
        }
    }
}

/// Returns the surface with its vertices permuted; `order[new]` is the old number of a vertex.
fn renumbered(soup: &Soup, order: &[u32]) -> Soup {
    let mut new = vec![0u32; order.len()];
    for (n, &old) in order.iter().enumerate() {
        new[old as usize] = n as u32;
    }
    Soup {
        positions: order.iter().map(|&i| soup.positions[i as usize]).collect(),
        indices: soup.indices.iter().map(|&i| new[i as usize]).collect(),
    }
}

/// Returns Morton codes of the positions, 21 bits per axis, in a cube around all positions.
fn morton_codes(positions: &[[f32; 3]]) -> Vec<u64> {
    let mut low = [f32::INFINITY; 3];
    let mut high = [f32::NEG_INFINITY; 3];
    for p in positions {
        for k in 0..3 {
            low[k] = low[k].min(p[k]);
            high[k] = high[k].max(p[k]);
        }
    }
    let side = (0..3).map(|k| f64::from(high[k]) - f64::from(low[k])).fold(f64::MIN_POSITIVE, f64::max);
    let steps = f64::from((1u32 << 21) - 1);
    let spread = |x: u64| (0..21).fold(0u64, |code, bit| code | ((x >> bit & 1) << (3 * bit)));
    let code = |p: &[f32; 3]| {
        (0..3).fold(0, |code, k| {
            let x = ((f64::from(p[k]) - f64::from(low[k])) / side * steps) as u64;
            code | spread(x) << k
        })
    };
    positions.iter().map(code).collect()
}

fn shuffle<T>(items: &mut [T], random: &mut Random) {
    for i in (1..items.len()).rev() {
        items.swap(i, (random.next_u64() % (i as u64 + 1)) as usize);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Returns the corner positions of each face, in an order that does not depend on the numbering.
    fn faces(soup: &Soup) -> Vec<[[u32; 3]; 3]> {
        let corner = |&i: &u32| soup.positions[i as usize].map(f32::to_bits);
        let mut all: Vec<[[u32; 3]; 3]> =
            soup.indices.chunks_exact(3).map(|t| [corner(&t[0]), corner(&t[1]), corner(&t[2])]).collect();
        all.sort_unstable();
        all
    }

    #[test]
    fn an_order_changes_only_the_numbering() {
        let soup = crate::cases::torus(12, 7);
        for order in Order::ALL {
            let got = order.apply(&soup);
            assert_eq!(faces(&got), faces(&soup), "{}", order.name());
            assert_eq!(order.apply(&soup), got, "the same each time");
        }
        assert_ne!(Order::Shuffled.apply(&soup), soup);
        let codes = morton_codes(&Order::Morton.apply(&soup).positions);
        assert!(codes.is_sorted());
    }
}
