//! `lodsmith compare`: measures the distance between two meshes.

mod views;

use std::path::Path;
use std::sync::Arc;
use std::time::Instant;

use anyhow::Context as _;
use lodsmith::core::measure::{
    AttributeError, AttributeErrors, CompareOptions, Comparison, compare, compare_textured,
};
use lodsmith::core::spatial::{Bvh, Hint};
use lodsmith::core::{Image, TriMesh, VertexId};
use lodsmith_asset::memory_need::{self, Size};
use lodsmith_asset::report_json::{self, both_ways};
use lodsmith_asset::warnings::viewing_warnings;
use lodsmith_asset::{Sink, farthest, paths, picture};
use lodsmith_io::{Format, Loaded, Warning, WriteOptions};
use lodsmith_render::{Background, Panel, PictureFormat, Shading, Subject, View, render, sheet};
use rayon::prelude::*;
use serde_json::{Map, Value, json};

use crate::args::CompareArgs;
use crate::file;
use crate::in_order;
use crate::memory;
use crate::numbers::{grouped, seconds, significant};
use crate::output::Output;
use crate::progress::Progress;
use crate::status::{Status, usage};
use crate::warnings::show_warnings;

/// Measures, and writes the heat map if requested.
pub(super) fn run(args: &CompareArgs) -> anyhow::Result<Status> {
    paths::at_most_one_stream([&args.reference, &args.candidate])?;
    if let Some(path) = &args.heatmap {
        let sink = Sink::Path(path.clone());
        if PictureFormat::of_path(path).is_none() && paths::format_of(&sink, None).ok() != Some(Format::Ply) {
            let expected = "the file name must end in .ply, .png, .jpg or .webp";
            return Err(usage(format!("--heatmap {}: {expected}", path.display())));
        }
        paths::refuse_folder(&sink, "")?;
    }
    for path in args.heatmap.iter().chain(&args.views_sheet) {
        paths::refuse_inputs(&Sink::Path(path.clone()), [&args.reference, &args.candidate], args.force)?;
    }
    let sheet = views::sheet_format(args)?;
    let out = Output::new(args.run.loudness, args.json, false);
    let progress = Progress::new(1, args.run.loudness.quiet);
    let start = Instant::now();
    let measured = in_order::pool(args.run.threads())?.install(|| measure(args, sheet, &progress));
    progress.finish();
    let Measured { reference, candidate, comparison, attributes, red, views } = measured?;

    let mut warnings = Vec::new();
    for (source, loaded) in [(&args.reference, &reference), (&args.candidate, &candidate)] {
        show_warnings(&out, &source.to_string(), &viewing_warnings(&loaded.warnings), false);
        warnings.extend(loaded.warnings.iter().map(|warning| format!("{source}: {warning}")));
    }
    let mut object = report_json::comparison(&comparison);
    (object["attributes"], object["warnings"]) = (attributes_json(&attributes), warnings.into());
    if let Some(views) = &views {
        object["image"] = views.to_json();
    }
    out.object(&object);
    for line in table(&comparison, &reference, &candidate) {
        out.line(&line);
    }
    for (name, unit, error) in named(&attributes) {
        let [mean, rms, p95] = [error.mean, error.rms, error.p95].map(|x| significant(x.symmetric, 4));
        out.line(&format!("{name:<16}mean {mean}{unit}, rms {rms}{unit}, 95 % below {p95}{unit}"));
    }
    for line in views.iter().flat_map(views::ViewComparison::table) {
        out.line(&line);
    }
    if let (Some(red), Some(path)) = (red, &args.heatmap) {
        out.line(&format!("heat map        {}: blue 0, red {}", path.display(), significant(red, 3)));
    }
    out.detail(&format!("time            {}", seconds(start.elapsed().as_secs_f64())));
    out.finish(Status::Done)
}

/// Two files and the distances between them.
struct Measured {
    reference: Loaded,
    candidate: Loaded,
    comparison: Comparison,
    attributes: AttributeErrors,
    /// The distance that is red in the heat map, if one was written.
    red: Option<f64>,
    views: Option<views::ViewComparison>,
}

/// Reads both files, measures, and writes the requested images.
fn measure(
    args: &CompareArgs,
    sheet: Option<PictureFormat>,
    progress: &Progress,
) -> anyhow::Result<Measured> {
    let bar = progress.file("");
    bar.read();
    let load = |source| file::read(source, &args.reading).with_context(|| format!("{source}"));
    let (mut reference, mut candidate) = (load(&args.reference)?, load(&args.candidate)?);
    if let (Some(from), Some(to)) = (candidate.regions.frame(), reference.regions.frame())
        && from != to
    {
        // The coordinates of one model differ between formats if their units or axes differ.
        from.convert(Arc::make_mut(&mut candidate.mesh), to);
        let text = "converted to the unit and axes of the reference";
        candidate.warnings.push(Warning::note(text));
    }
    bar.stage(lodsmith::Stage::Measure);
    let mut options = CompareOptions::default();
    options.samples = args.samples;
    options.seed = args.seed;
    let sizes = [&reference, &candidate].map(|loaded| Size::of(&loaded.mesh));
    memory::check("compare", memory_need::compare(sizes[0], sizes[1], &options))?;
    if let Some(count) = args.views {
        let both = Size::of_all([&*reference.mesh, &*candidate.mesh]);
        memory::check("compare --views", memory_need::views(both, args.size, count, sheet.is_some()))?;
    }
    let comparison = compare(&reference.mesh.surface(), &candidate.mesh.surface(), &options)?;
    let (image_sizes, unknown) = match (reference.mesh.uvs(), candidate.mesh.uvs()) {
        (Some(_), Some(_)) => reference.regions.image_sizes(),
        _ => Default::default(),
    };
    reference.warnings.extend(unknown);
    let attributes = compare_textured(&reference.mesh, &candidate.mesh, &image_sizes, &options)?;
    let red = match &args.heatmap {
        None => None,
        Some(path) => {
            bar.write();
            Some(write_heatmap(&reference.mesh, &candidate.mesh, path, args.force)?)
        }
    };
    let views = match args.views {
        None => None,
        Some(count) => Some(views::compare_views(args, count, [&reference, &candidate], sheet)?),
    };
    Ok(Measured { reference, candidate, comparison, attributes, red, views })
}

/// Writes a heat map of the reference as an image or a mesh. Returns the distance that is shown in red.
fn write_heatmap(reference: &TriMesh, candidate: &TriMesh, path: &Path, force: bool) -> anyhow::Result<f64> {
    let (distances, red) = distances(reference, candidate);
    let sink = Sink::Path(path.to_owned());
    if let Some(format) = PictureFormat::of_path(path) {
        file::write_picture(&heat_picture(reference, distances, red)?, &sink, format, force)?;
    } else {
        let mut options = WriteOptions::default();
        options.format = Some(Format::Ply);
        options.force = force;
        let map = heatmap(reference, &distances, red)?;
        file::writer(|job| {
            job.put(
                &sink,
                |out| lodsmith_io::write_to(&map, Format::Ply, &options, out),
                |path| lodsmith_io::write_path(&map, path, &options),
            )
        })?;
    }
    Ok(red)
}

/// Returns the attributes that were compared: name, unit, errors.
fn named(errors: &AttributeErrors) -> Vec<(&'static str, &'static str, AttributeError)> {
    let all = [
        ("vertex normals", "°", errors.normals_deg),
        ("uvs", "", errors.uvs),
        ("uvs, in pixels", " texels", errors.uvs_texels),
        ("colors", "", errors.colors),
    ];
    all.into_iter().filter_map(|(name, unit, error)| Some((name, unit, error?))).collect()
}

fn attributes_json(errors: &AttributeErrors) -> Value {
    let json = |e: AttributeError| json!({ "mean": both_ways(&e.mean), "rms": both_ways(&e.rms), "p95": both_ways(&e.p95) });
    let all = [
        ("normals_deg", errors.normals_deg),
        ("uvs", errors.uvs),
        ("uvs_texels", errors.uvs_texels),
        ("colors", errors.colors),
    ];
    all.into_iter().filter_map(|(name, e)| Some((name.to_owned(), json(e?)))).collect::<Map<_, _>>().into()
}

/// Returns the figures as a table.
fn table(c: &Comparison, reference: &Loaded, candidate: &Loaded) -> Vec<String> {
    let figure = |x: f64| significant(x, 4);
    let percent =
        |x: f64| if c.diagonal > 0.0 { format!("{} %", figure(100.0 * x / c.diagonal)) } else { "-".into() };
    let mut lines = vec![
        format!(
            "faces           {} → {}",
            grouped(reference.mesh.face_count()),
            grouped(candidate.mesh.face_count())
        ),
        format!(
            "{:<16}{:>12} {:>12} {:>12} {:>14}",
            "distance", "forward", "backward", "symmetric", "of diagonal"
        ),
    ];
    for (name, x) in [("  largest", c.hausdorff), ("  mean", c.mean), ("  rms", c.rms), ("  p99", c.p99)] {
        lines.push(format!(
            "{name:<16}{:>12} {:>12} {:>12} {:>14}",
            figure(x.forward),
            figure(x.backward),
            figure(x.symmetric),
            percent(x.symmetric)
        ));
    }
    lines.extend(farthest::text(c, ["reference", "candidate"]).map(|text| format!("farthest point  {text}")));
    lines.push(format!("diagonal        {}", figure(c.diagonal)));
    lines.push(format!(
        "face normals    mean {}°, 95 % below {}°",
        significant(c.normal_mean_deg, 3),
        significant(c.normal_p95_deg, 3)
    ));
    lines.push(format!("samples         {} per direction, seed {}", grouped(c.samples), c.seed));
    lines
}

/// Returns the distance of every vertex of the reference from the candidate, and the distance that is shown
/// in red.
fn distances(reference: &TriMesh, candidate: &TriMesh) -> (Vec<f64>, f64) {
    // Large enough for neighbours to share a hint, small enough for threads to share the work.
    const DISTANCE_BLOCK_LEN: usize = 1024;
    let tree = Bvh::new(&candidate.surface());
    let surface = reference.surface();
    let positions = surface.positions();
    let mut distances = vec![0f64; positions.len()];
    distances.par_chunks_mut(DISTANCE_BLOCK_LEN).enumerate().for_each(|(block, distances)| {
        let mut hint = Hint::default();
        for (i, distance) in distances.iter_mut().enumerate() {
            let point = positions.get(VertexId::new(block * DISTANCE_BLOCK_LEN + i));
            *distance = tree.closest_from(point, &mut hint).map_or(0.0, |hit| hit.distance);
        }
    });
    let largest = distances.iter().fold(0f64, |m, &d| m.max(d));
    // Smaller distances are rounding errors and get one colour.
    let noise = 1e-9 * positions.bounds().map_or(0.0, |b| b.diagonal());
    (distances, largest.max(noise))
}

/// Returns the reference coloured by these distances.
fn heatmap(reference: &TriMesh, distances: &[f64], red: f64) -> anyhow::Result<TriMesh> {
    let part = |d: f64| if red > 0.0 { d / red } else { 0.0 };
    let mut map = TriMesh::new(reference.positions().clone(), reference.surface().triangles().to_vec())?;
    map.set_colors(Some(distances.iter().map(|&d| heat(part(d))).collect()))?;
    Ok(map)
}

/// Renders the reference coloured by these distances, with a legend.
fn heat_picture(reference: &TriMesh, distances: Vec<f64>, red: f64) -> anyhow::Result<Image> {
    let values = distances.into_iter().map(|d| d as f32).collect();
    let subject = Subject::of_mesh(reference.clone())?.with_values(vec![values])?;
    let mut view = View::new(picture::camera(&subject, HEAT_SIZE), HEAT_SIZE[0], HEAT_SIZE[1]);
    view.background = Background::Transparent;
    view.look.shading = Shading::Heat;
    let range = [0.0, red as f32];
    view.look.heat_range = Some(range);
    let legend = picture::heat_legend(view.look.color_map, range);
    let panel = Panel { picture: render(&subject, &view)?, caption: Vec::new() };
    Ok(sheet(&[panel], 1, Background::default(), Some(&legend)))
}

/// Size of a heat map, in pixels: the default size of rendered images.
const HEAT_SIZE: [usize; 2] = [1200, 800];

/// Returns the colour for a value from 0 to 1: blue, cyan, green, yellow, red.
fn heat(part: f64) -> [f32; 4] {
    let x = 4.0 * part.clamp(0.0, 1.0);
    // Each colour component is a trapezoid.
    let plateau = |centre: f64| (2.0 - (x - centre).abs()).clamp(0.0, 1.0) as f32;
    [plateau(4.0), plateau(2.0), plateau(0.0), 1.0]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn heat_goes_from_blue_to_red() {
        let rgb = |x| heat(x)[..3].to_vec();
        assert_eq!(rgb(0.0), [0.0, 0.0, 1.0]);
        assert_eq!(rgb(0.25), [0.0, 1.0, 1.0]);
        assert_eq!(rgb(0.5), [0.0, 1.0, 0.0]);
        assert_eq!(rgb(0.75), [1.0, 1.0, 0.0]);
        assert_eq!(rgb(1.0), [1.0, 0.0, 0.0]);
    }
}
