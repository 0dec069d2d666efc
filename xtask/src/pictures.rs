//! The sample model in pictures: at falling counts of faces for the README, by each method at one count, in every shading.
//! Drawn on the CPU: the same everywhere, no driver needed.

mod palette;

use std::sync::Arc;

use anyhow::{Context, Result, bail};
use lodsmith::core::measure::{Prepared, vertex_distances};
use lodsmith::core::model::{Material, Sampler, TextureRef};
use lodsmith::core::{Image, Model, Positions, TriMesh, VertexId};
use lodsmith::{Measure, Method, NoControl, SimplifyOptions, Stop};
use lodsmith_render::{
    Ambient, Background, Camera, DVec3, Ground, Legend, Lens, Light, LightKind, Lighting, Panel, Shading,
    Subject, View, render, sheet,
};

use crate::{root, sample};

/// The picture of the README, from the root of the repository.
const FINIAL: &str = "docs/pictures/finial.png";
/// One model in every shading.
const SHADINGS: &str = "docs/pictures/shadings.png";
/// The folder of the pictures of methods.
const METHODS: &str = "docs/pictures/methods";
/// Faces of each of those: few enough to see each, many enough for the shape.
const METHOD_COUNT: usize = 1500;
/// Faces of the panels after the first, which is the whole model.
const COUNTS: [usize; 6] = [5000, 2500, 1500, 750, 300, 100];
/// Faces of the lighter model that the heat map shows.
const HEAT_COUNT: usize = 750;
/// Colours of a file: a third of the bytes of all of them, and nobody sees it. (By eye.)
const COLOURS: usize = 256;

/// Pixels of a panel.
const PANEL: [usize; 2] = [196, 378];
/// A quiet wall, lighter towards the ground.
const WALL: Background = Background::Gradient([0.135, 0.160, 0.190], [0.270, 0.300, 0.335]);

/// Draws what is named: nothing for all, `finial`, `shadings`, `methods`, or single methods.
pub(crate) fn run(names: &[String]) -> Result<()> {
    let sample = sample::finial();
    let triangles = sample.triangles.iter().map(|t| t.map(|v| VertexId(v.into()))).collect();
    let whole = TriMesh::new(Positions::F32(sample.positions), triangles)?;
    let is_named = |name: &str| names.is_empty() || names.iter().any(|n| n == name);
    let known =
        |name: &&String| ["finial", "shadings", "methods"].contains(&name.as_str()) || method(name).is_some();
    if let Some(name) = names.iter().find(|n| !known(n)) {
        bail!("no picture {name}: finial, shadings, methods, or the name of a method");
    }
    if is_named("finial") {
        finial(&whole)?;
    }
    if is_named("shadings") {
        shadings(&whole)?;
    }
    let all = is_named("methods");
    for method in Method::ALL.into_iter().filter(|m| all || is_named(m.name())) {
        of_method(&whole, method)?;
    }
    Ok(())
}

fn method(name: &str) -> Option<Method> {
    Method::ALL.into_iter().find(|m| m.name() == name)
}

/// The picture of the README.
fn finial(whole: &TriMesh) -> Result<()> {
    let mut panels = vec![panel(whole, "original".to_owned())?];
    for count in COUNTS {
        let (mesh, below) = simplified(whole, Method::default(), count)?;
        panels.push(panel(&mesh, below)?);
    }
    write(&sheet(&panels, panels.len(), WALL, None), FINIAL)?;
    panels.iter().for_each(|p| println!("{}", p.caption.join("  ")));
    Ok(())
}

/// The picture of a method.
fn of_method(whole: &TriMesh, method: Method) -> Result<()> {
    let (mesh, below) = simplified(whole, method, METHOD_COUNT).with_context(|| method.name())?;
    let panel = panel(&mesh, below)?;
    println!("{}", panel.caption.join("  "));
    write(&sheet(&[panel], 1, WALL, None), &format!("{METHODS}/{}.png", method.name()))
}

/// One model in every shading, with a legend for the last.
fn shadings(whole: &TriMesh) -> Result<()> {
    let dressed = dressed(whole)?;
    let (lighter, _) = simplified(whole, Method::default(), HEAT_COUNT)?;
    let distances = vertex_distances(&lighter.surface(), &Prepared::new(&whole.surface())?);
    let distances: Vec<f32> = distances.into_iter().map(|d| d as f32).collect();
    let hot = Subject::of_mesh(lighter)?.with_values(vec![distances])?;
    let range = hot.heat_range(None);
    let plain = Subject::new(&dressed)?;
    let mut panels = Vec::new();
    for shading in Shading::ALL {
        let subject = if shading == Shading::Heat { &hot } else { &plain };
        let mut view = view();
        view.look.shading = shading;
        let picture = render(subject, &view)?;
        panels.push(Panel { picture, caption: vec![shading.name().to_owned()] });
    }
    let map = view().look.color_map;
    let title = "distance from the original in the units of the file".to_owned();
    let legend = Legend { map, range, title };
    write(&sheet(&panels, panels.len(), WALL, Some(&legend)), SHADINGS)
}

/// The sample with colours that rise with height, and an image wound round it.
fn dressed(whole: &TriMesh) -> Result<Model> {
    let mut mesh = whole.clone();
    let places: Vec<[f64; 3]> = mesh.positions().view().iter().collect();
    let bounds = mesh.positions().view().bounds().context("the sample has vertices")?;
    let height = |p: &[f64; 3]| ((p[1] - bounds.min[1]) / (bounds.max[1] - bounds.min[1])) as f32;
    let color = |p: &[f64; 3]| {
        let [r, g, b] = lodsmith_render::ColorMap::Viridis.color(height(p));
        [r, g, b, 1.0]
    };
    mesh.set_colors(Some(places.iter().map(color).collect()))?;
    let mut textured = whole.clone();
    // Round and round: a mirrored image has no seam where the turn ends.
    let uv = |p: &[f64; 3]| [(p[0].atan2(p[2]) / std::f64::consts::PI) as f32 * 4.0, height(p) * 8.0];
    textured.set_uvs(Some(places.iter().map(uv).collect()))?;
    textured.set_colors(None)?;
    let sampler = Sampler { wrap_u: lodsmith::core::model::Wrap::Mirror, ..Sampler::default() };
    let texture = TextureRef { image: 0, uv_set: 0, transform: TextureRef::PLAIN, sampler };
    let material = Material { base_color_texture: Some(texture), roughness: 0.35, ..Material::default() };
    mesh.set_uvs(textured.uvs().map(<[[f32; 2]]>::to_vec))?;
    let mut model = Model::of_mesh(mesh);
    model.meshes[0].materials = vec![Some(0)];
    model.materials.push(Material { double_sided: true, ..material });
    model.images.push(Arc::new(glaze()));
    Ok(model)
}

/// Rings of two glazes on clay.
fn glaze() -> Image {
    const SIDE: usize = 64;
    let pixel = |i: usize| {
        let (x, y) = ((i % SIDE) as f32 / SIDE as f32 - 0.5, (i / SIDE) as f32 / SIDE as f32 - 0.5);
        match x.hypot(y) {
            r if r < 0.16 => [38, 84, 124, 255],
            r if r < 0.30 => [240, 226, 196, 255],
            r if r < 0.40 => [178, 74, 48, 255],
            _ => [240, 226, 196, 255],
        }
    };
    Image::new(SIDE, SIDE, (0..SIDE * SIDE).map(pixel).collect())
}

/// A lighter mesh, and the largest distance of it in words.
fn simplified(whole: &TriMesh, method: Method, faces: usize) -> Result<(TriMesh, String)> {
    let mut options = SimplifyOptions::new(Stop::faces(faces));
    options.method = method;
    options.measure = Measure::Always;
    let done = lodsmith::simplify(whole, &options, &mut NoControl)?;
    let error = &done.report.error;
    let measured = error.measured.as_ref().context("the result was not measured")?;
    let below = format!("max {} %", figure(100.0 * measured.hausdorff.symmetric / error.diagonal));
    Ok((done.mesh, below))
}

/// A mesh with lines along its edges, its count and a line below.
fn panel(mesh: &TriMesh, below: String) -> Result<Panel> {
    let mut view = view();
    view.look.shading = Shading::Flat;
    view.look.wireframe = true;
    view.look.wire = [0.05, 0.035, 0.02, 0.75];
    let picture = render(&Subject::of_mesh(mesh.clone())?, &view)?;
    Ok(Panel { picture, caption: vec![format!("{} faces", grouped(mesh.face_count())), below] })
}

/// How all of them are seen: a warm lamp from the upper left, a cool one from behind on the right.
fn view() -> View {
    let target = DVec3::new(0.0, 1.31, 0.0);
    let (sin, cos) = 16f64.to_radians().sin_cos();
    let camera = Camera {
        eye: target + 11.0 * DVec3::new(0.0, sin, cos),
        target,
        up: DVec3::Y,
        lens: Lens::Perspective { fov_y_rad: 0.294 },
    };
    let mut view = View::new(camera, PANEL[0], PANEL[1]);
    let light = |to_light: [f32; 3], color| Light {
        kind: LightKind::Directional { to_light: to_light.into() },
        color,
        in_world: false,
    };
    view.lighting = Lighting {
        ambient: Ambient { above: [0.26, 0.31, 0.38], below: [0.11, 0.095, 0.085] },
        lights: vec![
            light([-0.55, 0.62, 0.62], [1.06, 0.97, 0.86]),
            light([0.85, 0.25, -0.30], [0.22, 0.33, 0.46]),
        ],
    };
    view.background = Background::Transparent;
    view.ground = Ground { grid: false, shadow: true };
    view.fine = true;
    view
}

fn grouped(n: usize) -> String {
    if n < 1000 { n.to_string() } else { format!("{},{:03}", n / 1000, n % 1000) }
}

/// Two digits that say something.
fn figure(x: f64) -> String {
    let places = if x >= 1.0 {
        1
    } else if x >= 0.1 {
        2
    } else {
        3
    };
    format!("{x:.places$}")
}

/// Writes a picture without see-through parts to a path from the root, in few colours, and says so.
fn write(picture: &Image, path: &str) -> Result<()> {
    // Even numbers alone: a sixth smaller, and nobody sees it.
    let even = |c: u8| c & !1;
    let pixels: Vec<[u8; 3]> = picture.pixels().iter().map(|&[r, g, b, _]| [r, g, b].map(even)).collect();
    let (colours, index) = palette::indexed(&pixels, COLOURS);
    let mut bytes = Vec::new();
    let mut encoder = png::Encoder::new(&mut bytes, picture.width() as u32, picture.height() as u32);
    encoder.set_depth(png::BitDepth::Eight);
    encoder.set_compression(png::Compression::High);
    // Flat colours repeat: differences of neighbours would hide that.
    encoder.set_filter(png::Filter::NoFilter);
    encoder.set_color(png::ColorType::Indexed);
    encoder.set_palette(colours.as_flattened().to_vec());
    encoder.write_header()?.write_image_data(&index)?;
    let place = root().join(path);
    std::fs::create_dir_all(place.parent().context("the picture lies in a folder")?)?;
    std::fs::write(&place, &bytes).with_context(|| format!("writing {path}"))?;
    println!("{path}: {} × {} pixels, {} bytes", picture.width(), picture.height(), bytes.len());
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_what_is_known_is_drawn() {
        let error = run(&["magic".to_owned()]).unwrap_err().to_string();
        assert!(error.contains("no picture magic"), "{error}");
        assert_eq!(method("remesh"), Some(Method::Remesh));
    }

    #[test]
    fn figures_have_two_digits_that_say_something() {
        assert_eq!([0.0312, 0.312, 3.12].map(figure), ["0.031", "0.31", "3.1"]);
        assert_eq!([100, 16_192].map(grouped), ["100", "16,192"]);
    }
}
