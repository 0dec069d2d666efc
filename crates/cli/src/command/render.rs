//! `lodsmith render`: renders a picture without a window.

mod outputs;

use std::sync::Arc;
use std::time::Instant;

use anyhow::Context as _;
use lodsmith::core::measure::{MeasureError, Prepared, vertex_distances};
use lodsmith::core::model::{Instance, Node, Pose, Transform};
use lodsmith::core::{Bounds, Image, Model, Positions, TriMesh, VertexId};
use lodsmith::{SimplifyOptions, Stop};
use lodsmith_io::{ModelFile, Warning};
use lodsmith_render::{
    Background, Camera, DMat4, DQuat, DVec3, Environment, Ground, Legend, Lens, Light, LightKind, Panel,
    Shading, StandardView, Subject, View, decode, render, sheet,
};
use serde_json::{Value, json};

use crate::args::{LookArgs, MomentArgs, PlaceArgs, RenderArgs, Surroundings};
use crate::file;
use crate::in_order;
use crate::memory;
use crate::numbers::{counted, grouped, micros, seconds, short};
use crate::output::Output;
use crate::picture::MARGIN;
use crate::progress::{FileProgress, Progress};
use crate::run_control::{BarWatch, not_interrupted};
use crate::status::{Status, usage};
use crate::warnings::show_warnings;
use lodsmith_asset::Job;
use lodsmith_asset::memory_need;
use lodsmith_asset::memory_need::Size;
use lodsmith_asset::warnings::viewing_warnings;
use lodsmith_asset::{Asset, PartNames};
use lodsmith_asset::{Source, Up, paths};
use outputs::Outputs;

/// Reads, renders and writes.
pub(super) fn run(args: &RenderArgs) -> anyhow::Result<Status> {
    paths::at_most_one_stream(args.inputs.iter().chain(&args.compare))?;
    let outputs = Outputs::new(args)?;
    let is_heat = args.look.shading == Some(Shading::Heat);
    if is_heat && args.compare.is_none() && args.levels.is_empty() {
        return Err(usage("--shading heat shows a distance: say from what, with --compare or --levels"));
    }
    let is_moving = args.moment.clip.is_some() || args.moment.time.is_some();
    if is_moving && Drawing::is_measured(args) {
        return Err(usage(
            "--time and --clip show a scene as it moves; --levels and --shading heat show one mesh at rest: leave out \
             one of them",
        ));
    }
    let out = Output::new(args.run.loudness, args.json, outputs.is_stdout());
    let progress = Progress::new(1, args.run.loudness.quiet);
    let begin = Instant::now();
    let drawn = in_order::pool(args.run.threads())?.install(|| {
        let bar = progress.file("");
        let drawing = Drawing::new(args, &bar)?;
        let shown = drawing.prepare()?;
        let mut rows = Vec::new();
        let size = outputs.write(args, &bar, &mut |turn_rad| drawing.draw(&shown, turn_rad, &mut rows))?;
        let (range, warnings) = (drawing.heat_range(), drawing.warnings.clone());
        anyhow::Ok(RenderResult { size, rows, range, warnings })
    });
    progress.finish();
    let drawn = drawn?;
    let total = begin.elapsed().as_secs_f64();

    for (path, warnings) in &drawn.warnings {
        show_warnings(&out, path, &viewing_warnings(warnings), false);
    }
    let [width, height] = drawn.size;
    out.object(&json!({
        "output": outputs.to_json(drawn.size),
        "pictures": drawn.rows.iter().map(PictureRow::to_json).collect::<Vec<_>>(),
        "heat_range": drawn.range,
        "threads": args.run.threads(),
        "seconds": micros(total),
        "warnings": drawn.warnings.iter().flat_map(|(path, all)| {
            all.iter().map(move |w| format!("{path}: {w}"))
        }).collect::<Vec<_>>(),
    }));
    let faces: usize = drawn.rows.iter().map(|r| r.faces).sum();
    out.line(&format!(
        "{outputs}: {width} × {height} pixels, {}, {}",
        counted(faces, "face", "faces"),
        seconds(total)
    ));
    for row in &drawn.rows {
        out.detail(&format!(
            "  {}: {}, drawn in {:.3} s",
            row.path,
            counted(row.faces, "face", "faces"),
            row.seconds
        ));
    }
    out.finish(Status::Done)
}

/// The picture to render, with all inputs read.
struct Drawing<'a> {
    args: &'a RenderArgs,
    items: Vec<Item>,
    matcap: Option<Arc<Image>>,
    environment: Option<Arc<Environment>>,
    warnings: Vec<(String, Vec<Warning>)>,
}

/// One item of the picture.
struct Item {
    path: String,
    model: Model,
    /// File of the item; `None` for a level.
    asset: Option<Asset>,
    /// The target count of a level.
    level: Option<usize>,
    /// Index of the item that it is a level of, or compared with.
    reference: Option<usize>,
    /// Distance of each vertex of each mesh from the reference.
    distances: Option<Vec<Vec<f32>>>,
    /// Diagonal of the reference's bounding box, if distances are needed.
    diagonal: f64,
    moment: Option<Moment>,
}

/// Number of moments of an animation that the camera is fitted to.
const CAMERA_MOMENTS: usize = 17;

/// A moment of an animation.
struct Moment {
    clip: usize,
    name: String,
    seconds: f64,
}

impl Moment {
    /// Returns the moment asked for; `None` at rest.
    fn of(args: &MomentArgs, model: &Model) -> anyhow::Result<Option<Self>> {
        if args.clip.is_none() && args.time.is_none() {
            return Ok(None);
        }
        let names: Vec<String> = model.animations.iter().map(|a| a.name.clone()).collect();
        if names.is_empty() {
            return Err(usage("has no animation: --time and --clip are for glTF files that have one"));
        }
        let clip = match &args.clip {
            None => Some(0),
            Some(word) => {
                let by_number = || word.parse::<usize>().ok()?.checked_sub(1).filter(|n| *n < names.len());
                names.iter().position(|n| n == word).or_else(by_number)
            }
        };
        let Some(clip) = clip else {
            let all: Vec<_> = names.iter().enumerate().map(|(i, n)| format!("{} {n:?}", i + 1)).collect();
            let wanted = args.clip.as_deref().unwrap_or_default();
            return Err(usage(format!("has no animation {wanted:?}, but {}", all.join(", "))));
        };
        let (seconds, length) = (args.time.unwrap_or(0.0), model.animations[clip].duration());
        if seconds > length {
            return Err(usage(format!("animation {:?} is over after {} s", names[clip], short(length))));
        }
        Ok(Some(Self { clip, name: names[clip].clone(), seconds }))
    }
}

/// An item prepared for rendering.
struct ShownItem<'a> {
    item: &'a Item,
    subject: Subject,
    shading: Shading,
    camera: Camera,
}

/// Result of rendering.
struct RenderResult {
    /// Width and height of the picture, or of each if there are several.
    size: [usize; 2],
    rows: Vec<PictureRow>,
    range: Option<[f32; 2]>,
    warnings: Vec<(String, Vec<Warning>)>,
}

/// Report data of one item.
struct PictureRow {
    path: String,
    faces: usize,
    /// Where the faces are drawn.
    bounds: Option<Bounds>,
    level: Option<usize>,
    largest: Option<f64>,
    shading: Shading,
    /// The animation and its time.
    moment: Option<(String, f64)>,
    seconds: f64,
}

impl PictureRow {
    fn to_json(&self) -> Value {
        json!({
            "path": self.path,
            "faces": self.faces,
            "bounds": self.bounds.map(|b| json!({ "min": b.min, "max": b.max })),
            "level": self.level,
            "shading": self.shading.name(),
            "clip": self.moment.as_ref().map(|m| &m.0),
            "time": self.moment.as_ref().map(|m| m.1),
            "largest_distance": self.largest,
            "seconds": micros(self.seconds),
        })
    }
}

impl<'a> Drawing<'a> {
    fn new(args: &'a RenderArgs, bar: &FileProgress<'_>) -> anyhow::Result<Self> {
        let matcap = match &args.look.matcap {
            None => None,
            Some(path) => {
                let read = || anyhow::Ok(decode(&std::fs::read(path)?)?);
                Some(Arc::new(read().with_context(|| format!("{}", path.display()))?))
            }
        };
        let environment = match &args.look.environment {
            Surroundings::Auto | Surroundings::None => None,
            Surroundings::Studio => Some(Arc::new(Environment::studio())),
            Surroundings::File(path) => {
                let read = || anyhow::Ok(Environment::decode(&std::fs::read(path)?)?);
                Some(Arc::new(read().with_context(|| format!("{}", path.display()))?))
            }
        };
        let mut drawing = Self { args, items: Vec::new(), matcap, environment, warnings: Vec::new() };
        bar.read();
        if let Some(reference) = &args.compare {
            drawing.add(reference, None)?;
        }
        for input in &args.inputs {
            drawing.add(input, args.compare.as_ref().map(|_| 0))?;
            let original = drawing.items.len() - 1;
            for &count in &args.levels {
                let mut options = SimplifyOptions::new(Stop::faces(count));
                options.method = args.method.into();
                let mut watch = BarWatch::new(bar);
                let mut job = Job::new(&mut watch, None, memory::limit());
                let whole = &drawing.items[original];
                let size = Size::of_all(whole.model.meshes.iter().map(|m| &*m.mesh));
                memory::check("render --levels", memory_need::lod(size, &options))?;
                let model = lighter(whole, &options, &mut job).with_context(|| input.to_string())?;
                drawing.items.push(Item {
                    path: input.to_string(),
                    model,
                    asset: None,
                    level: Some(count),
                    reference: Some(original),
                    distances: None,
                    diagonal: 0.0,
                    moment: None,
                });
            }
        }
        let has_metal = || drawing.items.iter().any(|item| item.model.has_metal());
        let is_behind = matches!(args.look.background, Background::Environment { .. });
        if args.look.environment == Surroundings::Auto && (is_behind || has_metal()) {
            drawing.environment = Some(Arc::new(Environment::studio()));
        }
        drawing.check()?;
        drawing.measure()?;
        Ok(drawing)
    }

    /// Returns true if distances are needed.
    fn is_measured(args: &RenderArgs) -> bool {
        args.look.shading == Some(Shading::Heat) || !args.levels.is_empty()
    }

    fn add(&mut self, source: &Source, reference: Option<usize>) -> anyhow::Result<()> {
        let path = source.to_string();
        let read = file::read_model(source, &self.args.reading).with_context(|| path.clone())?;
        let asset = Asset::of_model(&read, source.clone());
        let ModelFile { mut model, warnings, .. } = read;
        if self.args.place.up == Up::Z {
            rotate_z_up(&mut model);
        }
        let moment = Moment::of(&self.args.moment, &model).with_context(|| path.clone())?;
        self.warnings.push((path.clone(), warnings));
        let (level, distances) = (None, None);
        self.items.push(Item { path, model, asset, level, reference, distances, diagonal: 0.0, moment });
        Ok(())
    }

    /// Computes the distances of vertices from their reference, for heat maps and captions. If a reference has a
    /// single candidate, its own distances from that are computed too; otherwise it is shown as it is.
    fn measure(&mut self) -> anyhow::Result<()> {
        if !Self::is_measured(self.args) {
            return Ok(());
        }
        for of in 0..self.items.len() {
            let candidates: Vec<usize> =
                (0..self.items.len()).filter(|i| self.items[*i].reference == Some(of)).collect();
            if candidates.is_empty() {
                continue;
            }
            let reference = whole(&self.items[of].model)?;
            self.items[of].diagonal = reference.positions().view().bounds().map_or(0.0, |b| b.diagonal());
            let reference =
                Prepared::new(&reference.surface()).with_context(|| self.items[of].path.clone())?;
            for &i in &candidates {
                self.items[i].distances = Some(distances_to(&reference, &self.items[i].model)?);
            }
            if let [only] = candidates[..] {
                self.items[of].distances = match Prepared::new(&whole(&self.items[only].model)?.surface()) {
                    Ok(candidate) => Some(distances_to(&candidate, &self.items[of].model)?),
                    // Nothing is left to measure from.
                    Err(MeasureError::Empty { .. }) => None,
                    Err(error) => return Err(error).with_context(|| self.items[only].path.clone()),
                };
            }
        }
        Ok(())
    }

    /// Returns an error if the pictures would need more memory than the limit.
    fn check(&self) -> anyhow::Result<()> {
        let meshes = self.items.iter().flat_map(|item| &item.model.meshes).map(|m| &*m.mesh);
        let occlusion = self.args.look.occlusion;
        let size = Size::of_all(meshes);
        let mut need = memory_need::render(size, self.args.size(), self.items.len(), occlusion);
        if Self::is_measured(self.args) {
            need = need.saturating_add(memory_need::distances(size));
        }
        memory::check("render", need)
    }

    /// Prepares all items for rendering, with their cameras.
    fn prepare(&self) -> anyhow::Result<Vec<ShownItem<'_>>> {
        let mut all: Vec<ShownItem<'_>> = Vec::new();
        for item in &self.items {
            let mut subject = match &item.moment {
                Some(moment) => Subject::posed(&item.model, &item.model.pose(moment.clip, moment.seconds))?,
                None => Subject::new(&item.model)?,
            };
            let shading = self.shading(item);
            if let Some(distances) = item.distances.as_ref().filter(|_| shading == Shading::Heat) {
                subject = subject.with_values(distances.clone())?;
            }
            // Items that are compared have the same camera, and edges that are sharp in the same cases.
            let camera = match item.reference {
                Some(of) => {
                    subject = subject.with_creases(all[of].subject.creases());
                    all[of].camera
                }
                None => self.camera(&subject, item),
            };
            all.push(ShownItem { item, subject, shading, camera });
        }
        Ok(all)
    }

    /// Returns the values at the ends of the colour scale, if there is one.
    fn heat_range(&self) -> Option<[f32; 2]> {
        (self.args.look.shading == Some(Shading::Heat)).then(|| self.range())
    }

    /// Renders all items, after the cameras went around them by an angle. The time of each is added to its row.
    fn draw(
        &self,
        shown: &[ShownItem<'_>],
        turn_rad: f64,
        rows: &mut Vec<PictureRow>,
    ) -> anyhow::Result<Image> {
        let args = self.args;
        let range = self.heat_range();
        let is_sheet = shown.len() > 1 || range.is_some();
        let mut panels = Vec::new();
        for (i, ShownItem { item, subject, shading, camera }) in shown.iter().enumerate() {
            let axis = shown[item.reference.unwrap_or(i)].subject.centre();
            let camera = if turn_rad == 0.0 { *camera } else { camera.turned_around(axis, turn_rad) };
            let mut view = self.view(camera, *shading, range);
            if is_sheet {
                view.background = Background::Transparent;
            }
            let begin = Instant::now();
            let picture = render(subject, &view).with_context(|| item.path.clone())?;
            if rows.len() == i {
                rows.push(PictureRow {
                    path: item.path.clone(),
                    faces: item.model.face_count(),
                    bounds: subject.exact_bounds(),
                    level: item.level,
                    largest: item.distances.as_ref().map(|d| largest(d)),
                    shading: *shading,
                    moment: item.moment.as_ref().map(|m| (m.name.clone(), m.seconds)),
                    seconds: 0.0,
                });
            }
            rows[i].seconds += begin.elapsed().as_secs_f64();
            let caption = if args.sheet.no_captions { Vec::new() } else { self.caption(item, &rows[i]) };
            panels.push(Panel { picture, caption });
        }
        if !is_sheet {
            return Ok(panels.remove(0).picture);
        }
        let columns = args.sheet.columns.unwrap_or_else(|| columns(panels.len()));
        let legend = range.map(|range| Legend {
            map: args.look.colors,
            range,
            title: "distance in the units of the file".to_owned(),
        });
        Ok(sheet(&panels, columns, args.look.background, legend.as_ref()))
    }

    fn shading(&self, item: &Item) -> Shading {
        let model = &item.model;
        let usual = if !model.materials.is_empty() {
            Shading::Textured
        } else if model.meshes.iter().any(|m| m.mesh.colors().is_some()) {
            Shading::VertexColors
        } else {
            Shading::Smooth
        };
        // A heat map needs distances: a reference with several candidates has none.
        let has_values = |shading: &Shading| *shading != Shading::Heat || item.distances.is_some();
        self.args.look.shading.filter(has_values).unwrap_or(usual)
    }

    /// Returns the values at the ends of the colour scale: those asked for, or 0 and the largest of all.
    fn range(&self) -> [f32; 2] {
        let all = self.items.iter().filter_map(|item| item.distances.as_ref().map(|d| largest(d)));
        self.args.look.range.unwrap_or_else(|| [0.0, all.fold(0f64, f64::max) as f32])
    }

    /// Returns two lines: the number of faces; then the file, or the distance from the original.
    fn caption(&self, item: &Item, row: &PictureRow) -> Vec<String> {
        let faces = format!("{} {}", grouped(row.faces), if row.faces == 1 { "face" } else { "faces" });
        let name = item.path.rsplit(['/', '\\']).next().unwrap_or_default().to_owned();
        let diagonal = item.reference.map(|of| self.items[of].diagonal);
        let below = match (item.level, row.largest, diagonal) {
            (Some(_), Some(largest), Some(diagonal)) if diagonal > 0.0 => {
                // Below the resolution of single precision it counts as 0.
                let part = Some(largest / diagonal).filter(|part| *part >= 1e-7).unwrap_or(0.0);
                format!("max {} %", short(100.0 * part))
            }
            _ => match &row.moment {
                Some((_, seconds)) => format!("{name} at {seconds} s"),
                None => name,
            },
        };
        vec![faces, below]
    }

    /// Returns the camera asked for, at a distance that shows everything; it is the same for all moments of a
    /// clip.
    fn camera(&self, subject: &Subject, item: &Item) -> Camera {
        let [width, height] = self.args.size();
        let is_still = self.args.turntable.frames.is_none();
        let moving = item.moment.as_ref().filter(|_| is_still);
        let clip = moving.map(|m| item.model.bounds_over(m.clip, CAMERA_MOMENTS));
        let bounds = clip.unwrap_or_else(|| subject.bounds());
        let bounds = bounds.unwrap_or(Bounds { min: [0.0; 3], max: [1.0; 3] });
        let aspect = width as f64 / height as f64;
        let camera = camera(&self.args.place, &bounds, aspect);
        // Leave space for the shadow, which lies beside the model.
        let has_floor = self.args.look.shadow || self.args.look.grid;
        let margin = if has_floor { 2.0 * MARGIN } else { MARGIN };
        match (clip, self.args.turntable.frames) {
            (_, Some(_)) => subject.framed_all_round(camera, aspect, margin),
            (Some(_), None) => camera,
            (None, None) => subject.framed(camera, aspect, margin),
        }
    }

    fn view(&self, camera: Camera, shading: Shading, range: Option<[f32; 2]>) -> View {
        let (look, [width, height]) = (&self.args.look, self.args.size());
        let mut view = View::new(camera, width, height);
        view.background = look.background;
        view.matcap = self.matcap.clone();
        view.environment = self.environment.clone();
        view.ground = Ground { grid: look.grid, shadow: look.shadow };
        view.occlusion = look.occlusion;
        view.fine = self.args.sheet.fine;
        view.look.shading = shading;
        view.look.wireframe = look.wireframe;
        view.look.borders = look.borders;
        view.look.defects = look.defects;
        view.look.cull_back = look.cull;
        view.look.color_map = look.colors;
        view.look.heat_range = range;
        if let Some(color) = look.color {
            view.look.surface = color;
        }
        if let Some(width) = look.wire_width {
            view.look.wire_width_px = width as f32;
        }
        if !look.light.is_empty() {
            view.lighting.lights = lights(look);
        }
        view
    }
}

/// Returns the model with fewer faces; materials and placements are not changed.
fn lighter(item: &Item, options: &SimplifyOptions, job: &mut Job<'_>) -> anyhow::Result<Model> {
    let mut meshes: Vec<Arc<TriMesh>> = item.model.meshes.iter().map(|m| m.mesh.clone()).collect();
    if let Some(asset) = &item.asset {
        let (data, _) = asset.data(&PartNames::default())?;
        let done = not_interrupted(asset.simplify(options, &data, job))?;
        for (mesh, lighter) in meshes.iter_mut().zip(done.meshes) {
            if let Some(lighter) = lighter {
                *mesh = Arc::new(lighter);
            }
        }
    }
    Ok(item.model.with_meshes(meshes))
}

/// Returns a mesh at its placement, positions and faces alone.
fn placed(model: &Model, instance: &Instance) -> anyhow::Result<TriMesh> {
    let mesh = &model.meshes[instance.mesh].mesh;
    let faces = mesh.surface().triangles().to_vec();
    if instance.world_from_mesh == DMat4::IDENTITY {
        return Ok(TriMesh::new(mesh.positions().clone(), faces)?);
    }
    let place = |p| instance.world_from_mesh.transform_point3(DVec3::from(p)).to_array();
    Ok(TriMesh::new(Positions::F64(mesh.positions().view().iter().map(place).collect()), faces)?)
}

/// Returns all instances as one mesh.
fn whole(model: &Model) -> anyhow::Result<TriMesh> {
    let instances = model.instances(&Pose::default());
    if let [one] = &instances[..] {
        return placed(model, one);
    }
    let (mut positions, mut faces) = (Vec::new(), Vec::new());
    for instance in &instances {
        let mesh = placed(model, instance)?;
        let first = positions.len() as u32;
        faces.extend(mesh.surface().triangles().iter().map(|t| t.map(|v| VertexId(first + v.0))));
        positions.extend(mesh.positions().view().iter());
    }
    Ok(TriMesh::new(Positions::F64(positions), faces)?)
}

/// Returns the distance of each vertex of each mesh from the reference; for a mesh with several instances the
/// largest one.
fn distances_to(reference: &Prepared, model: &Model) -> anyhow::Result<Vec<Vec<f32>>> {
    let mut all: Vec<Vec<f32>> = model.meshes.iter().map(|m| vec![0.0; m.mesh.vertex_count()]).collect();
    for instance in model.instances(&Pose::default()) {
        let own = vertex_distances(&placed(model, &instance)?.surface(), reference);
        let known = &mut all[instance.mesh];
        known.iter_mut().zip(own).for_each(|(known, d)| *known = known.max(d as f32));
    }
    Ok(all)
}

/// Rotates a model whose z axis points up.
fn rotate_z_up(model: &mut Model) {
    let (rotation, children) = (DQuat::from_rotation_x(-std::f64::consts::FRAC_PI_2), model.roots.clone());
    let transform = Transform::Parts { translation: DVec3::ZERO, rotation, scale: DVec3::ONE };
    model.roots = vec![model.nodes.len()];
    model.nodes.push(Node { transform, children, ..Node::default() });
}

fn lights(look: &LookArgs) -> Vec<Light> {
    // Light of near lights falls off with the square of the distance in radii: it has the given strength at
    // one radius from the centre.
    let as_strong = |light: &Light| match light.kind {
        LightKind::Point { at } | LightKind::Spot { at, .. } => {
            Light { color: light.color.map(|c| c * (at.length() - 1.0).max(0.5).powi(2)), ..*light }
        }
        LightKind::Directional { .. } => *light,
    };
    look.light.iter().map(as_strong).collect()
}

/// Returns the camera asked for, at a distance that shows everything.
fn camera(place: &PlaceArgs, bounds: &Bounds, aspect: f64) -> Camera {
    let mut camera = Camera::fitting(bounds, place.view, aspect);
    if place.azimuth.is_some() || place.elevation.is_some() {
        // Angles that are not set are those of the default view.
        let usual = StandardView::Iso.directions().0;
        let azimuth = place.azimuth.map_or(usual.x.atan2(usual.z), f64::to_radians);
        let elevation = place.elevation.map_or(usual.y.asin(), f64::to_radians);
        let ((sin_a, cos_a), (sin_e, cos_e)) = (azimuth.sin_cos(), elevation.sin_cos());
        let to_eye = [sin_a * cos_e, sin_e, cos_a * cos_e];
        let up = [-sin_a * sin_e, cos_e, -cos_a * sin_e];
        let distance = camera.distance();
        camera.eye = camera.target + distance * DVec3::from(to_eye);
        camera.up = up.into();
    }
    if let Some(fov) = place.fov {
        camera.lens = Lens::Perspective { fov_y_rad: fov.to_radians() };
    }
    if place.parallel {
        camera.lens = Lens::Parallel { height: 1.0 };
    }
    camera.framing(bounds, aspect)
}

/// Returns the number of pictures in a row: at most four, and no nearly empty last row.
fn columns(count: usize) -> usize {
    let free = |columns: usize| count.div_ceil(columns) * columns - count;
    if count <= 4 {
        count
    } else if free(3) < free(4) {
        3
    } else {
        4
    }
}

fn largest(distances: &[Vec<f32>]) -> f64 {
    distances.iter().flatten().filter(|d| d.is_finite()).fold(0f64, |m, &d| m.max(f64::from(d)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rows_are_full_where_they_can_be() {
        assert_eq!([1, 2, 3, 4, 6, 7, 8].map(columns), [1, 2, 3, 4, 3, 4, 4]);
    }

    #[test]
    fn angles_are_those_of_the_standard_views() {
        let bounds = Bounds { min: [-1.0; 3], max: [1.0; 3] };
        let place = |azimuth, elevation| PlaceArgs {
            view: StandardView::Iso,
            azimuth,
            elevation,
            up: Up::Y,
            fov: None,
            parallel: false,
        };
        let near = |place: &PlaceArgs, view| {
            let (a, b) = (camera(place, &bounds, 1.0), Camera::fitting(&bounds, view, 1.0));
            (a.eye - b.eye).length() < 1e-9 && (a.up_square() - b.up_square()).length() < 1e-9
        };
        assert!(near(&place(Some(0.0), Some(0.0)), StandardView::Front));
        assert!(near(&place(Some(90.0), Some(0.0)), StandardView::Right));
        assert!(near(&place(Some(0.0), Some(90.0)), StandardView::Top));
        assert!(near(&place(Some(0.0), Some(-90.0)), StandardView::Bottom));
        assert!(near(&place(None, None), StandardView::Iso));
    }
}
