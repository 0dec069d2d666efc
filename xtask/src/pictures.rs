//! Renders the pictures of the sample model: at decreasing face counts, as a chain of levels, with each
//! method at one count, and in every shading. They are rendered on the CPU: the same everywhere, without a driver. The
//! screenshots of the viewer need a graphics adapter; a software renderer suffices.

mod palette;
mod viewer;

use std::sync::Arc;

use anyhow::{Context, Result, bail};
use lodsmith::core::measure::{Prepared, vertex_distances};
use lodsmith::core::model::{Material, Sampler, TextureRef, Wrap};
use lodsmith::core::numbers::grouped;
use lodsmith::core::{Image, Model, Positions, TriMesh, VertexId};
use lodsmith::lod::error_of;
use lodsmith::{Levels, LodOptions, Measure, MethodKind, Screen, SimplifyOptions, Stop, lod};
use lodsmith_render::{
    Ambient, Background, Camera, ColorMap, DVec3, Ground, Legend, Lens, Light, LightKind, Lighting, Panel,
    Shading, Subject, View, render, sheet,
};

use crate::{root, sample};

/// The picture of docs/simplify.md, from the root of the repository.
const FINIAL: &str = "docs/pictures/finial.png";
/// One model in every shading.
const SHADINGS: &str = "docs/pictures/shadings.png";
/// A chain of levels of detail.
const LOD: &str = "docs/pictures/lod.png";
/// Number of levels below the original.
const LEVELS: usize = 6;
/// The folder for the pictures of methods.
const METHODS: &str = "docs/pictures/methods";
/// Face count of the pictures of methods: few enough to see each face, enough for the shape.
const METHOD_COUNT: usize = 1500;
/// Face counts of the panels after the first, which shows the original.
const COUNTS: [usize; 6] = [5000, 2500, 1500, 750, 300, 100];
/// Face count of the simplified model in the heat map.
const HEAT_COUNT: usize = 750;
/// Palette size of pictures that show one surface: a third of the file size, without visible difference (by eye).
const PALETTE_SIZE: usize = 256;

/// Pixels of a panel.
const PANEL: [usize; 2] = [212, 378];
/// Pixels of a panel in pictures with many colours, whose files are larger.
const SMALL_PANEL: [usize; 2] = [152, 268];
/// A neutral background, lighter towards the ground.
const BACKGROUND: Background = Background::Gradient([0.135, 0.160, 0.190], [0.270, 0.300, 0.335]);

/// Makes the named pictures (`finial`, `shadings`, `lod`, `viewer`, `methods`, or single methods), or all of them.
pub(crate) fn run(names: &[String]) -> Result<()> {
    let sample = sample::finial();
    let triangles = sample.triangles.iter().map(|t| t.map(|v| VertexId(v.into()))).collect();
    let original = TriMesh::new(Positions::F32(sample.positions), triangles)?;
    let is_named = |name: &str| names.is_empty() || names.iter().any(|n| n == name);
    let known = |name: &&String| {
        ["finial", "shadings", "lod", "viewer", "methods"].contains(&name.as_str()) || method(name).is_some()
    };
    if let Some(name) = names.iter().find(|n| !known(n)) {
        bail!("no picture {name}: finial, shadings, lod, viewer, methods, or the name of a method");
    }
    if is_named("finial") {
        finial(&original)?;
    }
    if is_named("shadings") {
        shadings(&original)?;
    }
    if is_named("lod") {
        levels(&original)?;
    }
    if is_named("viewer") {
        viewer::run()?;
    }
    let all = is_named("methods");
    for method in MethodKind::ALL.into_iter().filter(|m| all || is_named(m.name())) {
        method_picture(&original, method)?;
    }
    Ok(())
}

fn method(name: &str) -> Option<MethodKind> {
    MethodKind::ALL.into_iter().find(|m| m.name() == name)
}

/// Renders the sample at decreasing face counts.
fn finial(original: &TriMesh) -> Result<()> {
    let mut panels = vec![panel(original, vec!["original".to_owned()])?];
    for count in COUNTS {
        let (mesh, below) = simplified(original, MethodKind::default(), count)?;
        panels.push(panel(&mesh, vec![below])?);
    }
    write(&sheet(&panels, panels.len(), BACKGROUND, None), FINIAL)?;
    panels.iter().for_each(|p| println!("{}", p.caption.join("  ")));
    Ok(())
}

/// Renders the levels of `lodsmith lod`, each with its switching distance.
fn levels(original: &TriMesh) -> Result<()> {
    let mut options = LodOptions::new(Levels::Steps { count: LEVELS, factor: 0.5 });
    options.simplify.measure = Measure::Always;
    let chain = lod(original, &options)?;
    let screen = Screen::default();
    let mut panels = vec![panel(original, vec!["original".to_owned()])?];
    for level in &chain.levels {
        let error = error_of(&level.report).context("a run that nothing ends is measured")?;
        let share = 100.0 * error / level.report.error.diagonal;
        let distance = screen.distance(error);
        let below =
            vec![format!("max {} %", two_digits(share)), format!("from {} units", two_digits(distance))];
        panels.push(panel(&level.mesh, below)?);
    }
    write(&sheet(&panels, panels.len(), BACKGROUND, None), LOD)?;
    panels.iter().for_each(|p| println!("{}", p.caption.join("  ")));
    Ok(())
}

/// Renders the picture of a method.
fn method_picture(original: &TriMesh, method: MethodKind) -> Result<()> {
    let (mesh, below) = simplified(original, method, METHOD_COUNT).with_context(|| method.name())?;
    let panel = panel(&mesh, vec![below])?;
    println!("{}", panel.caption.join("  "));
    write(&sheet(&[panel], 1, BACKGROUND, None), &format!("{METHODS}/{}.png", method.name()))
}

/// Renders one model in every shading, with a legend for the heat map.
fn shadings(original: &TriMesh) -> Result<()> {
    let (lighter, _) = simplified(original, MethodKind::default(), HEAT_COUNT)?;
    let distances = vertex_distances(&lighter.surface(), &Prepared::new(&original.surface())?);
    let distances: Vec<f32> = distances.into_iter().map(|d| d as f32).collect();
    let hot = Subject::of_mesh(lighter)?.with_values(vec![distances])?;
    let range = hot.heat_range(None);
    let (colored, glazed) = (Subject::of_mesh(colored(original)?)?, Subject::new(&glazed(original)?)?);
    let mut panels = Vec::new();
    for shading in Shading::ALL {
        let subject = match shading {
            Shading::Heat => &hot,
            Shading::Textured => &glazed,
            _ => &colored,
        };
        let mut view = view(SMALL_PANEL);
        view.look.shading = shading;
        let picture = render(subject, &view)?;
        panels.push(Panel { picture, caption: vec![shading.name().to_owned()] });
    }
    let map = view(SMALL_PANEL).look.color_map;
    let title = "distance from the original in the units of the file".to_owned();
    let legend = Legend { map, range, title };
    write_in_full(&sheet(&panels, panels.len(), BACKGROUND, Some(&legend)), SHADINGS)
}

/// Returns the relative height of each vertex of the sample, from 0 to 1.
fn relative_heights(mesh: &TriMesh) -> Result<Vec<f32>> {
    let positions = mesh.positions().view();
    let bounds = positions.bounds().context("the sample has vertices")?;
    let [low, high] = [bounds.min[1], bounds.max[1]];
    Ok(positions.iter().map(|p| ((p[1] - low) / (high - low)) as f32).collect())
}

/// Returns the sample with colours by height.
fn colored(original: &TriMesh) -> Result<TriMesh> {
    let color = |height: f32| {
        let [r, g, b] = ColorMap::Viridis.color(height);
        [r, g, b, 1.0]
    };
    let mut mesh = original.clone();
    mesh.set_colors(Some(relative_heights(original)?.into_iter().map(color).collect()))?;
    Ok(mesh)
}

/// Returns the sample with a texture wrapped around it.
fn glazed(original: &TriMesh) -> Result<Model> {
    // A mirrored texture has no seam after a full turn.
    let turn = |p: [f64; 3]| (p[0].atan2(p[2]) / std::f64::consts::PI) as f32;
    let positions = original.positions().view();
    let uvs = positions
        .iter()
        .zip(relative_heights(original)?)
        .map(|(p, height)| [turn(p) * 4.0, height * 8.0])
        .collect();
    let mut mesh = original.clone();
    mesh.set_uvs(Some(uvs))?;
    let sampler = Sampler { wrap_u: Wrap::Mirror, ..Sampler::default() };
    let texture = TextureRef { image: 0, uv_set: 0, transform: TextureRef::PLAIN, sampler };
    let mut model = Model::of_mesh(mesh);
    model.meshes[0].materials = vec![Some(0)];
    model.materials.push(Material {
        base_color_texture: Some(texture),
        roughness: 0.35,
        metallic: 0.0,
        double_sided: true,
        ..Material::default()
    });
    model.images.push(Arc::new(glaze()));
    Ok(model)
}

/// Returns a texture of concentric rings in two glazes on clay.
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

/// Returns a simplified mesh, and its maximum distance as text.
fn simplified(original: &TriMesh, method: MethodKind, faces: usize) -> Result<(TriMesh, String)> {
    let mut options = SimplifyOptions::new(Stop::faces(faces));
    options.method = method.into();
    options.measure = Measure::Always;
    let done = lodsmith::simplify(original, &options)?;
    let error = &done.report.error;
    let measured = error.measured.as_ref().context("the result was not measured")?;
    let below = format!("max {} %", two_digits(100.0 * measured.hausdorff.symmetric / error.diagonal));
    Ok((done.mesh, below))
}

/// Renders a mesh with wireframe, its face count and a caption.
fn panel(mesh: &TriMesh, below: Vec<String>) -> Result<Panel> {
    let mut view = view(PANEL);
    view.look.shading = Shading::Flat;
    view.look.wireframe = true;
    view.look.wire = [0.05, 0.035, 0.02, 0.55];
    let picture = render(&Subject::of_mesh(mesh.clone())?, &view)?;
    let mut caption = vec![format!("{} faces", grouped(mesh.face_count()))];
    caption.extend(below);
    Ok(Panel { picture, caption })
}

/// Returns the view of all pictures: a warm light from the upper left, and a cool light from behind on the right.
fn view([width, height]: [usize; 2]) -> View {
    let target = DVec3::new(0.0, 1.31, 0.0);
    let (sin, cos) = 16f64.to_radians().sin_cos();
    let camera = Camera {
        eye: target + 11.0 * DVec3::new(0.0, sin, cos),
        target,
        up: DVec3::Y,
        lens: Lens::Perspective { fov_y_rad: 0.304 },
    };
    let mut view = View::new(camera, width, height);
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

/// Formats a number with two significant digits.
fn two_digits(x: f64) -> String {
    let places = if x >= 10.0 {
        0
    } else if x >= 1.0 {
        1
    } else if x >= 0.1 {
        2
    } else {
        3
    };
    format!("{x:.places$}")
}

/// Returns the colours of an opaque picture, rounded to even numbers: a file smaller by a sixth, without visible
/// difference.
fn opaque(picture: &Image) -> Vec<[u8; 3]> {
    picture.pixels().iter().map(|&[r, g, b, _]| [r, g, b].map(|c| c & !1)).collect()
}

/// Writes a picture to a path from the root, with a palette, and prints a line about it.
fn write(picture: &Image, path: &str) -> Result<()> {
    let (colours, index) = palette::indexed(&opaque(picture), PALETTE_SIZE);
    let mut bytes = Vec::new();
    let mut encoder = encoder(picture, &mut bytes);
    // Flat colours repeat: filtering by differences of neighbours would hide that.
    encoder.set_filter(png::Filter::NoFilter);
    encoder.set_color(png::ColorType::Indexed);
    encoder.set_palette(colours.as_flattened().to_vec());
    encoder.write_header()?.write_image_data(&index)?;
    put(picture, &bytes, path)
}

/// Writes a picture in full colour, for pictures with many colours.
fn write_in_full(picture: &Image, path: &str) -> Result<()> {
    let mut bytes = Vec::new();
    let mut encoder = encoder(picture, &mut bytes);
    encoder.set_filter(png::Filter::Adaptive);
    encoder.set_color(png::ColorType::Rgb);
    encoder.write_header()?.write_image_data(opaque(picture).as_flattened())?;
    put(picture, &bytes, path)
}

fn encoder<'a>(picture: &Image, bytes: &'a mut Vec<u8>) -> png::Encoder<'a, &'a mut Vec<u8>> {
    let mut encoder = png::Encoder::new(bytes, picture.width() as u32, picture.height() as u32);
    encoder.set_depth(png::BitDepth::Eight);
    encoder.set_compression(png::Compression::High);
    encoder
}

fn put(picture: &Image, bytes: &[u8], path: &str) -> Result<()> {
    let file = root().join(path);
    std::fs::create_dir_all(file.parent().context("the picture has no folder")?)?;
    std::fs::write(&file, bytes).with_context(|| format!("writing {path}"))?;
    println!("{path}: {} × {} pixels, {} bytes", picture.width(), picture.height(), bytes.len());
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn unknown_pictures_are_refused() {
        let error = run(&["magic".to_owned()]).unwrap_err().to_string();
        assert!(error.contains("no picture magic"), "{error}");
        assert_eq!(method("remesh"), Some(MethodKind::Remesh));
    }

    #[test]
    fn figures_have_two_significant_digits() {
        assert_eq!([0.0312, 0.312, 3.12, 31.2].map(two_digits), ["0.031", "0.31", "3.1", "31"]);
        assert_eq!([100, 16_192].map(grouped), ["100", "16,192"]);
    }
}
