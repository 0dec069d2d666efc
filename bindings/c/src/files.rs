//! `lodsmith_run_file_job`: jobs on whole files, like those of the command.

use std::ffi::{CString, c_char, c_void};
use std::path::{Path, PathBuf};
use std::ptr;
use std::sync::mpsc::{Receiver, Sender, channel};

use lodsmith::{Control, SimplifyError, Stage, Verdict};
use lodsmith_asset::request::{Answer, Request, Verb};
use lodsmith_asset::warnings::Spelling;
use lodsmith_asset::{AssetError, JobProgress, Sink, Source, Step, Watch};
use lodsmith_bake::BakeError;
use lodsmith_io::ReadError;
use rayon::ThreadPoolBuilder;
use serde_json::{Map, Value, json};

use crate::calls::{
    LODSMITH_STAGE_BAKE, LODSMITH_STAGE_CLEAN, LODSMITH_STAGE_INSPECT, LODSMITH_STAGE_READ,
    LODSMITH_STAGE_WRITE, LodsmithProgress, stage_number, verdict_of,
};
use crate::fault::{
    Fault, LODSMITH_ERROR_CANCELLED, LODSMITH_ERROR_FILE, LODSMITH_ERROR_LIMIT, LODSMITH_ERROR_MESH,
    LODSMITH_ERROR_OPTION, LODSMITH_ERROR_STRICT, code, guarded,
};
use crate::memory::{self, CStructure};

/// A job on files. Fill it with zeros, then set `size` and the fields that the job needs. Texts are UTF-8 and end with
/// a zero byte.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct LodsmithFileJob {
    /// `sizeof(lodsmith_file_job)` of the caller's header.
    pub size: usize,
    /// The job: `simplify`, `lod`, `clean`, `convert`, `bake` or `info`, like the subcommands of the command.
    pub verb: *const c_char,
    /// Path of the file to read.
    pub input: *const c_char,
    /// For `bake`: path of the high-poly file that maps are baked from; `input` is the low-poly file. Else null.
    pub detailed: *const c_char,
    /// Path of the file to write; its extension determines the format. Null for `info`; with `simplify`, `lod` and
    /// `clean`, null writes nothing, and only the report is returned.
    pub output: *const c_char,
    /// For `lod`, instead of `output`: path of a folder, created if missing, for one file per level and the list
    /// `lods.json`. Else null.
    pub out_dir: *const c_char,
    /// Options of the subcommand as a JSON object, such as `{"ratio": 0.1, "bake": ["normal"]}`. Names have
    /// underscores or dashes; flags are true or false. Null for none.
    pub options: *const c_char,
}

// SAFETY: `repr(C)`, all fields are numbers and pointers, and the first is a `usize`.
unsafe impl CStructure for LodsmithFileJob {
    const NAME: &'static str = "lodsmith_file_job";
}

/// A text from the library. Free it with `lodsmith_text_free`. Several threads may read it at the same time.
pub struct LodsmithText {
    text: CString,
}

/// A job with its arguments checked.
struct FileJob {
    request: Request,
    inputs: Vec<Source>,
    output: Option<Sink>,
    out_dir: Option<PathBuf>,
}

impl LodsmithFileJob {
    /// A job with the defaults: all fields but `size` are zero.
    const EMPTY: Self = Self {
        size: size_of::<Self>(),
        verb: ptr::null(),
        input: ptr::null(),
        detailed: ptr::null(),
        output: ptr::null(),
        out_dir: ptr::null(),
        options: ptr::null(),
    };

    /// Returns the requested job.
    ///
    /// # Safety
    /// Texts must be null or end with a zero byte.
    unsafe fn get(&self) -> Result<FileJob, Fault> {
        // SAFETY: promised by the caller.
        let text = |name, text| unsafe { memory::text(name, text) };
        let given = |name, from: *const c_char| (!from.is_null()).then(|| text(name, from)).transpose();
        let name = text("verb", self.verb)?;
        let verb = Verb::ALL.into_iter().find(|verb| verb.name() == name).ok_or_else(|| {
            let names = Verb::ALL.map(Verb::name).join(", ");
            Fault::argument(format!("verb: one of {names} is expected, not {name:?}"))
        })?;
        let path = |name, from| given(name, from).map(|path| path.map(PathBuf::from));
        let input = text("input", self.input)?.into();
        let (detailed, output) = (path("detailed", self.detailed)?, path("output", self.output)?);
        let out_dir = path("out_dir", self.out_dir)?;
        let inputs = match (verb, detailed) {
            (Verb::Bake, Some(detailed)) => vec![detailed, input],
            (Verb::Bake, None) => return Err(Fault::argument("detailed is null: bake needs two files")),
            (_, Some(_)) => return Err(Fault::argument("detailed: only for bake")),
            (_, None) => vec![input],
        };
        match (verb, &output, &out_dir) {
            (_, Some(_), Some(_)) => return Err(Fault::argument("output and out_dir: only one can be set")),
            (Verb::Info, Some(_), _) => return Err(Fault::argument("output: info writes no file")),
            (Verb::Lod, ..) | (_, _, None) => {}
            (_, _, Some(_)) => return Err(Fault::argument("out_dir: only for lod")),
        }
        let options = match given("options", self.options)? {
            Some(text) => match serde_json::from_str(&text) {
                Ok(Value::Object(options)) => options,
                Ok(_) => return Err(Fault::argument("options: a JSON object is expected")),
                Err(why) => return Err(Fault::argument(format!("options: not JSON: {why}"))),
            },
            None => Map::new(),
        };
        Ok(FileJob {
            request: Request::new(verb, &options, Spelling::Keyword)?,
            inputs: inputs.into_iter().map(Source::Path).collect(),
            output: output.map(Sink::Path),
            out_dir,
        })
    }
}

impl FileJob {
    /// Does the job in the current thread pool; `ask` receives the stage and the fraction that is done.
    fn run_here(&self, ask: impl FnMut(i32, f64) -> Verdict) -> Result<Answer, Fault> {
        let mut watch = FileWatch::new(ask);
        let made = self.request.run(&self.inputs, self.output.as_ref(), self.out_dir.as_deref(), &mut watch);
        match (made, watch.verdict) {
            // No step was left that could be cancelled.
            (Ok(_), Verdict::Cancel) if !watch.has_written => Err(AssetError::Cancelled.into()),
            (Err(AssetError::Input { problem, .. }), Verdict::Finish)
                if matches!(*problem, AssetError::BakeTimeout) =>
            {
                Err(Fault {
                    code: LODSMITH_ERROR_CANCELLED,
                    text: "the progress function ended baking, which has no partial result".to_owned(),
                })
            }
            (made, _) => Ok(made?),
        }
    }

    /// Does the job with the number of threads in its options. This thread calls `ask`.
    fn run(&self, mut ask: impl FnMut(i32, f64) -> Verdict) -> Result<Answer, Fault> {
        let Some(threads) = self.request.threads() else { return self.run_here(ask) };
        let pool = ThreadPoolBuilder::new().num_threads(threads).build();
        let pool = pool.map_err(|why| Fault::internal(format!("cannot start threads: {why}")))?;
        let (question, questions): (Sender<(i32, f64)>, Receiver<_>) = channel();
        let (answer, answers) = channel();
        let mut made = Err(AssetError::Cancelled.into());
        pool.in_place_scope(|scope| {
            let made = &mut made;
            scope.spawn(move |_| {
                *made = self.run_here(|stage, done| match question.send((stage, done)) {
                    Ok(()) => answers.recv().unwrap_or(Verdict::Cancel),
                    Err(_) => Verdict::Cancel,
                });
            });
            // The end of the job drops the sender.
            for (stage, done) in questions {
                if answer.send(ask(stage, done)).is_err() {
                    break;
                }
            }
        });
        made
    }
}

/// The caller of a job.
struct FileWatch<F> {
    ask: F,
    stage: i32,
    /// False while a step has no stages of the engine.
    has_stages: bool,
    progress: JobProgress,
    /// The last answer of the progress function.
    verdict: Verdict,
    has_written: bool,
}

impl<F: FnMut(i32, f64) -> Verdict> FileWatch<F> {
    fn new(ask: F) -> Self {
        let (stage, verdict) = (LODSMITH_STAGE_READ, Verdict::Continue);
        Self { ask, stage, has_stages: false, progress: JobProgress::default(), verdict, has_written: false }
    }

    /// Reports the progress to the caller. After a finish or cancel, does not ask again: the job may have several runs.
    fn report_progress(&mut self) -> Verdict {
        if self.verdict != Verdict::Cancel {
            match (self.ask)(self.stage, self.progress.done()) {
                Verdict::Continue => {}
                end => self.verdict = end,
            }
        }
        self.verdict
    }
}

impl<F: FnMut(i32, f64) -> Verdict> Control for FileWatch<F> {
    fn stage(&mut self, stage: Stage) {
        if self.has_stages {
            self.stage = stage_number(stage);
            self.progress.stage(stage);
            self.report_progress();
        }
    }
    fn progress(&mut self, done: f64) -> Verdict {
        self.progress.within(done);
        self.report_progress()
    }
}

impl<F: FnMut(i32, f64) -> Verdict> Watch for FileWatch<F> {
    fn enter(&mut self, step: Step) {
        self.has_stages = step == Step::Prepare;
        self.stage = match step {
            Step::Read => LODSMITH_STAGE_READ,
            Step::Clean => LODSMITH_STAGE_CLEAN,
            Step::Inspect => LODSMITH_STAGE_INSPECT,
            Step::Bake => LODSMITH_STAGE_BAKE,
            Step::Write => LODSMITH_STAGE_WRITE,
            _ => stage_number(Stage::Prepare),
        };
        self.progress.step(step);
        self.report_progress();
    }
    fn while_writing(&mut self, _: &Path, write: &mut dyn FnMut()) -> bool {
        let may_write = self.verdict != Verdict::Cancel;
        if may_write {
            write();
            self.has_written = true;
        }
        may_write
    }
}

/// Returns the code of an error of a job.
fn code_of(error: &AssetError) -> i32 {
    match error {
        AssetError::Input { problem, .. } => code_of(problem),
        AssetError::Cancelled => LODSMITH_ERROR_CANCELLED,
        AssetError::Name(_) | AssetError::Bake(BakeError::Option { .. }) => LODSMITH_ERROR_OPTION,
        AssetError::Memory(_)
        | AssetError::BakeTimeout
        | AssetError::Bake(BakeError::Memory(_))
        | AssetError::Read(ReadError::Memory(_) | ReadError::Limit { .. } | ReadError::Ratio { .. }) => {
            LODSMITH_ERROR_LIMIT
        }
        AssetError::Simplify(SimplifyError::NoFaces { .. })
        | AssetError::Read(ReadError::NoFaces { .. })
        | AssetError::Bake(_)
        | AssetError::Mesh(_) => LODSMITH_ERROR_MESH,
        error if error.is_usage() => LODSMITH_ERROR_OPTION,
        _ => LODSMITH_ERROR_FILE,
    }
}

impl From<AssetError> for Fault {
    fn from(error: AssetError) -> Self {
        Self { code: code_of(&error), text: Spelling::Keyword.apply(&error.to_string()) }
    }
}

/// Does a job on files like the command: with the same options, the same bytes and the same report.
///
/// Returns `LODSMITH_OK` and a new text in `*outcome`, which the caller frees with `lodsmith_text_free`; or an error
/// code, with a text in `lodsmith_error_message` and null in `*outcome`. The text is a JSON object: `report` is the
/// output of the command with `--json`, `warnings` and `faults` are lists of texts. With the option `strict`, warnings
/// about lost data and missed targets are faults; if there are any, the code is `LODSMITH_ERROR_STRICT`, and the files
/// are written and the outcome is returned nevertheless.
///
/// `progress` may be null; `user` is passed to it. It receives the fraction of the whole job that is done, which never
/// decreases. After `LODSMITH_CANCEL`, no further file is written. After `LODSMITH_FINISH`, the best meshes so far are
/// written; baking, which has no partial result, is cancelled instead. No file is written in part.
///
/// The job uses the shared thread pool of the process, or `threads` new threads if that option is set.
///
/// # Safety
/// The structure must have the size that it states, and its texts must be null or end with a zero byte.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn lodsmith_run_file_job(
    job: *const LodsmithFileJob,
    progress: LodsmithProgress,
    user: *mut c_void,
    outcome: *mut *mut LodsmithText,
) -> i32 {
    code(&guarded(|| {
        if outcome.is_null() {
            return Err(Fault::argument("outcome is null"));
        }
        // SAFETY: the caller promises a pointer that may be written, and a structure of its size with texts.
        let job = unsafe {
            outcome.write_unaligned(ptr::null_mut());
            memory::sized(job, LodsmithFileJob::EMPTY)?.get()?
        };
        let Answer { report, warnings, faults, .. } = job.run(|stage, done| match progress {
            // SAFETY: the caller promises a function of this type that may be called with its pointer.
            Some(call) => verdict_of(unsafe { call(user, stage, done) }),
            None => Verdict::Continue,
        })?;
        let text = json!({ "report": report, "warnings": warnings, "faults": faults }).to_string();
        let text = CString::new(text).map_err(|_| Fault::internal("the outcome has a zero byte"))?;
        let made = Box::into_raw(Box::new(LodsmithText { text }));
        // SAFETY: the caller promises a pointer that may be written.
        unsafe { outcome.write_unaligned(made) };
        if faults.is_empty() {
            Ok(())
        } else {
            Err(Fault { code: LODSMITH_ERROR_STRICT, text: faults.join("; ") })
        }
    }))
}

/// Returns the characters of a text, in UTF-8 with a zero byte at the end; they are valid until the text is freed. Null
/// for null.
///
/// # Safety
/// `text` must be null or a text that was not freed.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn lodsmith_text_get(text: *const LodsmithText) -> *const c_char {
    // SAFETY: promised by the caller.
    unsafe { text.as_ref() }.map_or(ptr::null(), |text| text.text.as_ptr())
}

/// Frees a text; null is allowed.
///
/// # Safety
/// `text` must come from this library, and is not valid afterwards.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn lodsmith_text_free(text: *mut LodsmithText) {
    if !text.is_null() {
        // SAFETY: the pointer comes from `Box::into_raw`, and the caller returns it.
        drop(unsafe { Box::from_raw(text) });
    }
}
