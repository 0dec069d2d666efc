//! Two-sided sheets in files of several formats: they keep as much area as sheets with one side.

use std::fmt::Write as _;

use crate::sandbox::CliSandbox;

/// An OBJ file of bent cards, with or without backs in another material.
struct Cards {
    text: String,
    vertices: usize,
    fronts: Vec<[usize; 3]>,
    backs: Vec<[usize; 3]>,
}

impl Cards {
    fn new() -> Self {
        Self { text: String::new(), vertices: 0, fronts: Vec::new(), backs: Vec::new() }
    }
    fn vertex(&mut self, [x, y, z]: [f64; 3]) -> usize {
        writeln!(self.text, "v {x:.6} {y:.6} {z:.6}").expect("writing to a string cannot fail");
        self.vertices += 1;
        self.vertices
    }
    /// Adds a card that stands on a row of vertices, which its two sides share.
    fn stand(&mut self, foot: &[(usize, [f64; 3])], rows: u32) {
        let add = |cards: &mut Self, is_back: bool| {
            let mut below: Vec<usize> = foot.iter().map(|(v, _)| *v).collect();
            for row in 1..=rows {
                let height = f64::from(row) / f64::from(rows);
                let above: Vec<usize> = foot
                    .iter()
                    .map(|(_, [x, y, z])| cards.vertex([*x, y + 0.15 * height * height, z + height]))
                    .collect();
                for i in 1..foot.len() {
                    let [a, b, c, d] = [below[i - 1], below[i], above[i], above[i - 1]];
                    for t in [[a, b, c], [a, c, d]] {
                        match is_back {
                            true => cards.backs.push([t[0], t[2], t[1]]),
                            false => cards.fronts.push(t),
                        }
                    }
                }
                below = above;
            }
        };
        add(self, false);
        add(self, true);
    }
    fn of(count: usize, [n, m]: [usize; 2]) -> Self {
        let mut cards = Self::new();
        for k in 0..count {
            let at = [1.5 * (k % 12) as f64, (k / 12) as f64, 0.3 * (k % 3) as f64];
            let foot: Vec<_> = (0..=n)
                .map(|i| {
                    let place = [at[0] + 0.4 * i as f64 / n as f64, at[1], at[2]];
                    (cards.vertex(place), place)
                })
                .collect();
            cards.stand(&foot, m as u32);
        }
        cards
    }
    /// A closed box with fins; the last faces are the backs of the fins.
    fn on_a_box() -> Self {
        let [single, both] = [false, true].map(lodsmith::core::shapes::box_with_fins);
        let mut cards = Self::new();
        let numbers: Vec<usize> = both.positions().view().iter().map(|p| cards.vertex(p)).collect();
        cards.fronts = both.triangles().iter().map(|t| t.map(|w| numbers[w.index()])).collect();
        cards.backs = cards.fronts.split_off(single.face_count());
        cards
    }
    fn obj(&self, has_backs: bool) -> String {
        let face = |[a, b, c]: &[usize; 3]| format!("f {a} {b} {c}\n");
        let fronts: String = self.fronts.iter().map(face).collect();
        let backs: String = self.backs.iter().filter(|_| has_backs).map(face).collect();
        format!("mtllib two.mtl\n{}usemtl front\n{fronts}usemtl back\n{backs}", self.text)
    }
}

#[test]
fn two_sided_sheets_keep_their_area_in_every_format() {
    let sandbox = CliSandbox::new();
    sandbox.put("two.mtl", "newmtl front\nKd 0 1 0\nnewmtl back\nKd 0 0.5 0\n");
    let models = [
        ("cards", Cards::of(20, [2, 6]), 0.0),
        ("many", Cards::of(150, [1, 6]), 0.0),
        ("fins", Cards::on_a_box(), 6.0),
    ];
    for (name, cards, solid) in models {
        sandbox.put(&format!("{name}_single.obj"), &cards.obj(false));
        sandbox.put(&format!("{name}_both.obj"), &cards.obj(true));
        for format in ["glb", "stl", "ply"] {
            for side in ["single", "both"] {
                sandbox.run(&format!("convert {name}_{side}.obj {name}_{side}.{format}")).with_status(0);
            }
            let two_sided = &sandbox.info(&format!("{name}_both.{format}"))["two_sided_faces"];
            assert_eq!(*two_sided, 2 * cards.backs.len(), "{name}.{format}");
            for ratio in [0.5, 0.25, 0.1] {
                let [single, both] = ["single", "both"].map(|side| {
                    let arguments =
                        format!("simplify {name}_{side}.{format} --ratio {ratio} -o out.{format}");
                    sandbox.run(&format!("{arguments} --strict")).with_status(0);
                    sandbox.info(&format!("out.{format}"))["area"].as_f64().expect("an area")
                });
                let expected = 2.0 * single - solid;
                assert!(
                    (both / expected - 1.0).abs() < 0.02,
                    "{name}.{format} at {ratio}: {both} for {expected}"
                );
            }
        }
    }
}
