//! Benchmark: time to make and to draw levels, as a table that is filled row by row.

use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use lodsmith::Stop;
use lodsmith_asset::AssetError;
use lodsmith_core::Model;
use lodsmith_core::model::Pose;
use lodsmith_render::{Camera, Shading};
use web_time::Instant;

use crate::content::{Lighter, Original};
use crate::gpu::{Context, Frame, Gpu, PlacedModel};
use crate::job::JobControl;
use crate::numbers::{grouped, percent, seconds, significant};
use crate::settings::Settings;
use crate::settings::simplification::Simplification;
use crate::view::viewport;

/// Fractions of the triangles that are made; the original comes before them.
pub const BENCHMARK_RATIOS: [f64; 5] = [0.5, 0.25, 0.1, 0.05, 0.01];
/// Size of the picture that is drawn, in pixels.
const PICTURE_SIZE_PX: [u32; 2] = [1024, 768];
/// Pictures of each level. The fastest counts: other load on the machine only makes them slower.
const PICTURES_PER_LEVEL: usize = 5;

/// Times of a model and its levels.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct BenchmarkTable {
    /// File, method and adapter in one line.
    pub title: String,
    /// The original, then the levels.
    pub rows: Vec<TableRow>,
}

/// One row of the table: a level.
#[derive(Clone, Debug, PartialEq)]
pub struct TableRow {
    /// Fraction of the triangles that was asked for.
    pub share: f64,
    /// Measured values, or why there is no result.
    pub level: Result<LevelTimes, String>,
}

/// Times and error of a level.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct LevelTimes {
    /// Number of triangles.
    pub faces: usize,
    /// Time to make it in seconds; `None` for the original.
    pub simplify_secs: Option<f64>,
    /// RMS distance as a fraction of the diagonal; `None` for the original.
    pub error: Option<f64>,
    /// Upload time in seconds.
    pub upload_secs: Option<f64>,
    /// CPU time per picture in seconds.
    pub frame_secs: Option<f64>,
    /// GPU time per picture in seconds; `None` if the adapter has no timestamps.
    pub adapter_secs: Option<f64>,
}

/// Column headings.
pub const COLUMN_HEADINGS: [&str; 7] =
    ["level", "faces", "simplify", "RMS (% of diagonal)", "upload", "CPU frame", "GPU frame"];

impl TableRow {
    /// Returns the cells of the row, formatted for display.
    pub fn cells(&self) -> [String; 7] {
        let dash = || "–".to_owned();
        let name = if self.share < 1.0 { percent(self.share) } else { "original".to_owned() };
        let level = match &self.level {
            Ok(level) => level,
            Err(why) => return [name, dash(), why.clone(), dash(), dash(), dash(), dash()],
        };
        let time = |secs: Option<f64>| secs.map_or_else(dash, fine_seconds);
        [
            name,
            grouped(level.faces),
            time(level.simplify_secs),
            level.error.map_or_else(dash, |e| format!("{} %", significant(100.0 * e, 3))),
            time(level.upload_secs),
            time(level.frame_secs),
            time(level.adapter_secs),
        ]
    }
}

/// Formats seconds, with enough digits for drawing times.
fn fine_seconds(secs: f64) -> String {
    if secs < 1e-3 { format!("{} ms", significant(1e3 * secs, 2)) } else { seconds(secs) }
}

impl BenchmarkTable {
    /// Returns the table as Markdown below its title.
    pub fn markdown(&self) -> String {
        let line = |cells: &[String]| format!("| {} |\n", cells.join(" | "));
        let heads = COLUMN_HEADINGS.map(str::to_owned);
        let rule = "|---".to_owned() + &"|--:".repeat(COLUMN_HEADINGS.len() - 1) + "|\n";
        let rows: String = self.rows.iter().map(|row| line(&row.cells())).collect();
        format!("{}\n\n{}{rule}{rows}", self.title, line(&heads))
    }

    /// Returns the table as tab-separated numbers: seconds and fractions.
    pub fn tsv(&self) -> String {
        let heads = "share\tfaces\tsimplify_s\trms_of_diagonal\tupload_s\tframe_s\tadapter_s\n";
        let number = |x: Option<f64>| x.map(|x| x.to_string()).unwrap_or_default();
        let line = |row: &TableRow| match &row.level {
            Ok(l) => {
                let times =
                    [l.simplify_secs, l.error, l.upload_secs, l.frame_secs, l.adapter_secs].map(number);
                format!("{}\t{}\t{}\n", row.share, l.faces, times.join("\t"))
            }
            Err(_) => format!("{}\t\t\t\t\t\t\n", row.share),
        };
        heads.to_owned() + &self.rows.iter().map(line).collect::<String>()
    }
}

/// A table that is being filled by a job.
#[derive(Clone, Debug, Default)]
pub struct SharedTable(Arc<Mutex<BenchmarkTable>>);

impl SharedTable {
    /// Returns the rows so far.
    pub fn table(&self) -> BenchmarkTable {
        self.lock().clone()
    }

    fn lock(&self) -> MutexGuard<'_, BenchmarkTable> {
        // A row is pushed as a whole, so a poisoned lock holds a valid table.
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Makes and draws every level. Returns false if it was cancelled.
    pub fn fill(
        &self,
        original: &Original,
        settings: &Settings,
        context: Option<Context>,
        watch: &mut JobControl,
    ) -> bool {
        let mut how = settings.simplify.clone();
        how.options.stop = Stop::default();
        let mut gpu = context.map(|context| Gpu::on(context).with_timestamps());
        let title = title_of(original, &how, settings.look.look.shading, gpu.as_ref());
        *self.lock() = BenchmarkTable { title, rows: Vec::new() };
        let mut finish = |share: f64, model: &Model, level: LevelTimes| {
            let level = match &mut gpu {
                Some(gpu) => draw(gpu, original, settings, model, level),
                None => level,
            };
            self.lock().rows.push(TableRow { share, level: Ok(level) });
        };
        finish(1.0, original.model(), LevelTimes { faces: original.faces, ..LevelTimes::default() });
        for share in BENCHMARK_RATIOS {
            how.options.stop = Stop::ratio(share);
            if !watch.report(0.0) {
                return false;
            }
            match Lighter::make(original, &how, watch) {
                Ok(lighter) => {
                    let diagonal = lighter.report.as_ref().map_or(0.0, |r| r.error.diagonal);
                    let level = LevelTimes {
                        faces: lighter.faces,
                        simplify_secs: Some(lighter.seconds),
                        error: (diagonal > 0.0).then(|| lighter.error() / diagonal),
                        ..LevelTimes::default()
                    };
                    finish(share, &lighter.model, level);
                }
                Err(AssetError::Cancelled) => return false,
                Err(why) => self.lock().rows.push(TableRow { share, level: Err(why.to_string()) }),
            }
        }
        watch.report(1.0)
    }
}

/// Describes file, method and adapter in one line.
fn title_of(original: &Original, how: &Simplification, shading: Shading, gpu: Option<&Gpu>) -> String {
    let file = original.path.file_name().unwrap_or_default().to_string_lossy();
    let opened = seconds(original.read_secs);
    let mut words = how.words().join(" ");
    if !words.contains("--method") {
        words = format!("--method {} {words}", how.options.method.name()).trim_end().to_owned();
    }
    let adapter = gpu.map_or_else(|| "no adapter".to_owned(), Gpu::adapter_name);
    let ([width, height], shading) = (PICTURE_SIZE_PX, shading.name());
    format!(
        "{file}, opened in {opened}; {words}; drawn {shading} at {width} × {height} by {adapter}, best of \
         {PICTURES_PER_LEVEL}"
    )
}

/// Uploads a model and draws it as the window does. The first picture is not timed: it sets up shared
/// resources.
fn draw(
    gpu: &mut Gpu,
    original: &Original,
    settings: &Settings,
    model: &Model,
    level: LevelTimes,
) -> LevelTimes {
    let begin = Instant::now();
    let drawing = gpu.upload(model);
    let upload_secs = Some(begin.elapsed().as_secs_f64());
    let mut target = gpu.target(PICTURE_SIZE_PX);
    let look = &settings.look;
    let mut shown = look.look.clone();
    // The distances for the heat map come from another job.
    if shown.shading == Shading::Heat {
        shown.shading = Shading::Smooth;
    }
    let lighting = look.rig.lighting(look.brightness);
    let pose = Pose::default();
    let placed = [PlacedModel::new(&drawing, &pose)];
    let [width, height] = PICTURE_SIZE_PX.map(f64::from);
    let camera = Camera::fitting(&original.bounds, viewport::standard_view(0), width / height);
    let mut frame = Frame {
        background: look.backdrop.background(true),
        ground: look.ground,
        ..Frame::new(&placed, original.bounds, camera, &shown, &lighting)
    };
    let least = |before: Option<f64>, secs: f64| Some(before.map_or(secs, |before| before.min(secs)));
    let (mut frame_secs, mut adapter_secs) = (None, None);
    for k in 0..=PICTURES_PER_LEVEL {
        frame.camera.eye = camera.eye + (camera.eye - camera.target) * (1e-3 * k as f64);
        let begin = Instant::now();
        gpu.draw(&mut target, &frame);
        let own = begin.elapsed().as_secs_f64();
        let its = gpu.gpu_secs();
        if k > 0 {
            frame_secs = least(frame_secs, own);
            adapter_secs = its.and_then(|its| least(adapter_secs, its));
        }
    }
    LevelTimes { upload_secs, frame_secs, adapter_secs, ..level }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn table() -> BenchmarkTable {
        let level = LevelTimes {
            faces: 34_567,
            simplify_secs: Some(0.25),
            error: Some(0.00123),
            upload_secs: Some(0.004),
            frame_secs: Some(0.00005),
            adapter_secs: None,
        };
        let original = LevelTimes { simplify_secs: None, error: None, faces: 69_451, ..level.clone() };
        BenchmarkTable {
            title: "bunny.obj, opened in 0.50 s".to_owned(),
            rows: vec![
                TableRow { share: 1.0, level: Ok(original) },
                TableRow { share: 0.5, level: Ok(level) },
                TableRow { share: 0.01, level: Err("too few".to_owned()) },
            ],
        }
    }

    #[test]
    fn a_table_is_markdown_with_as_many_columns_in_every_line() {
        let text = table().markdown();
        let lines: Vec<_> = text.lines().skip(2).collect();
        assert!(text.starts_with("bunny.obj, opened in 0.50 s\n\n| level"));
        assert_eq!(lines.len(), 5);
        assert!(lines.iter().all(|l| l.matches('|').count() == COLUMN_HEADINGS.len() + 1), "{text}");
        assert_eq!(lines[2], "| original | 69,451 | – | – | 4.0 ms | 0.050 ms | – |");
        assert_eq!(lines[3], "| 50.0 % | 34,567 | 0.25 s | 0.123 % | 4.0 ms | 0.050 ms | – |");
        assert!(lines[4].starts_with("| 1.0 % | – | too few |"), "{}", lines[4]);
    }

    #[test]
    fn a_table_for_spreadsheets_has_numbers_alone() {
        let text = table().tsv();
        let lines: Vec<Vec<&str>> = text.lines().map(|l| l.split('\t').collect()).collect();
        assert!(lines.iter().all(|l| l.len() == 7), "{text}");
        assert_eq!(lines[2], ["0.5", "34567", "0.25", "0.00123", "0.004", "0.00005", ""]);
        let is_number = |cell: &&str| cell.is_empty() || cell.parse::<f64>().is_ok();
        assert!(lines[1..].iter().flatten().all(is_number), "{text}");
    }
}
