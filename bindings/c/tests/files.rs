//! Jobs on whole files: what they write and report, and what they refuse.
#![cfg(feature = "files")]
#![allow(unsafe_code, reason = "the functions of the C interface take pointers")]

use std::ffi::{CStr, CString, c_void};
use std::fs;
use std::path::{Path, PathBuf};
use std::ptr;
use std::thread::ThreadId;

use lodsmith::{NoControl, SimplifyOptions, Stop};
use lodsmith_asset::{Baking, Destination, Job, Recipe, Sink, Source, Writing};
use lodsmith_bake::{BakeOptions, MapKind};
use lodsmith_c::*;
use lodsmith_io::{Format, ReadOptions};
use serde_json::{Value, json};

/// A job as Rust types.
#[derive(Default)]
struct FileJob<'a> {
    verb: &'a str,
    input: PathBuf,
    detailed: Option<PathBuf>,
    output: Option<PathBuf>,
    out_dir: Option<PathBuf>,
    options: Value,
}

/// A call of the progress function: the stage, the fraction and the thread.
type ProgressCall = (i32, f64, ThreadId);

/// The user data of a progress function: the calls so far, and the answer that it gives to each.
struct Listener {
    calls: Vec<ProgressCall>,
    answer: fn(&ProgressCall) -> i32,
}

unsafe extern "C" fn listen(user: *mut c_void, stage: i32, done: f64) -> i32 {
    // SAFETY: the jobs below pass a listener that nothing else uses during the call.
    let listener = unsafe { &mut *user.cast::<Listener>() };
    let call = (stage, done, std::thread::current().id());
    listener.calls.push(call);
    (listener.answer)(&call)
}

fn c_text(text: impl Into<Vec<u8>>) -> CString {
    CString::new(text).unwrap()
}

fn c_path(path: &Path) -> CString {
    c_text(path.to_str().unwrap())
}

fn last_error() -> Option<String> {
    let text = lodsmith_error_message();
    // SAFETY: it is null, or a text that is valid until the next call on this thread.
    (!text.is_null()).then(|| unsafe { CStr::from_ptr(text) }.to_string_lossy().into_owned())
}

fn pointer(text: Option<&CString>) -> *const std::ffi::c_char {
    text.map_or(ptr::null(), |text| text.as_ptr())
}

/// Calls the function, and returns the code, the text of the error and the outcome.
fn call(job: &LodsmithFileJob, listener: Option<&mut Listener>) -> (i32, Option<String>, Option<Value>) {
    let mut outcome = ptr::null_mut();
    let (progress, user): (LodsmithProgress, _) = match listener {
        Some(listener) => (Some(listen), ptr::from_mut(listener).cast()),
        None => (None, ptr::null_mut()),
    };
    // SAFETY: the texts of the job end with a zero byte and live until the end of the call, as the listener does.
    let code = unsafe { lodsmith_run_file_job(job, progress, user, &raw mut outcome) };
    let error = last_error();
    assert_eq!(code == LODSMITH_OK, error.is_none());
    // SAFETY: the text is null or new, is read once, and then freed.
    let text = unsafe {
        let text = lodsmith_text_get(outcome);
        let copy = (!text.is_null()).then(|| CStr::from_ptr(text).to_str().unwrap().to_owned());
        lodsmith_text_free(outcome);
        copy
    };
    (code, error, text.map(|text| serde_json::from_str(&text).unwrap()))
}

impl FileJob<'_> {
    fn run_with(&self, listener: Option<&mut Listener>) -> (i32, Option<String>, Option<Value>) {
        let texts = [&self.detailed, &self.output, &self.out_dir].map(|path| path.as_deref().map(c_path));
        let options = (!self.options.is_null()).then(|| c_text(self.options.to_string()));
        let (verb, input) = (c_text(self.verb), c_path(&self.input));
        let job = LodsmithFileJob {
            size: size_of::<LodsmithFileJob>(),
            verb: verb.as_ptr(),
            input: input.as_ptr(),
            detailed: pointer(texts[0].as_ref()),
            output: pointer(texts[1].as_ref()),
            out_dir: pointer(texts[2].as_ref()),
            options: pointer(options.as_ref()),
        };
        call(&job, listener)
    }

    /// Runs the job, which must succeed, and returns its outcome.
    fn done(&self) -> Value {
        let (code, error, outcome) = self.run_with(None);
        assert_eq!((code, error), (LODSMITH_OK, None));
        outcome.unwrap()
    }

    /// Runs the job, which must fail, and returns the code and the text.
    fn refused(&self) -> (i32, String) {
        let (code, error, outcome) = self.run_with(None);
        assert_eq!(outcome, None);
        (code, error.unwrap())
    }
}

fn testdata(name: &str) -> PathBuf {
    Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../../testdata")).join(name)
}

/// Simplifies `testdata/wave.glb` with the functions of Rust.
fn simplified(output: &Path, baking: Option<Baking>) -> Vec<u8> {
    let recipe = Recipe { options: SimplifyOptions::new(Stop::ratio(0.3)), baking, ..Recipe::default() };
    let to = Destination {
        sink: Sink::Path(output.to_owned()),
        format: Format::Glb,
        writing: Writing::default(),
        dry_run: false,
    };
    let mut watch = NoControl;
    let mut job = Job::new(&mut watch, None, u64::MAX);
    let input = Source::Path(testdata("wave.glb"));
    lodsmith_asset::simplify(&input, &ReadOptions::default(), &recipe, Some(&to), &mut job).unwrap();
    fs::read(output).unwrap()
}

fn simplify(output: PathBuf, options: Value) -> FileJob<'static> {
    let (input, output) = (testdata("wave.glb"), Some(output));
    FileJob { verb: "simplify", input, output, options, ..FileJob::default() }
}

#[test]
fn files_have_the_same_bytes_as_from_the_library() {
    let folder = tempfile::tempdir().unwrap();
    let place = |name: &str| folder.path().join(name);
    let plain = simplified(&place("plain.glb"), None);
    let mut maps = BakeOptions::new([MapKind::Normal]);
    maps.size = Some(64);
    let baked = simplified(&place("baked.glb"), Some(Baking { options: maps, map_files: false }));
    assert_ne!(plain, baked);
    let bake = json!({ "ratio": 0.3, "bake": ["normal"], "texture_size": 64 });
    for (options, expected) in [(json!({ "ratio": 0.3 }), plain), (bake, baked)] {
        for threads in [None, Some(1), Some(3)] {
            let mut options = options.clone();
            options["threads"] = threads.into();
            let output = place("by_job.glb");
            let outcome = simplify(output.clone(), options).done();
            assert!(fs::read(&output).unwrap() == expected, "{threads:?}: other bytes");
            let report = &outcome["report"];
            assert_eq!(report["reached"], true);
            assert_eq!(report["output"]["path"], output.to_str().unwrap());
            assert_eq!((&outcome["warnings"], &outcome["faults"]), (&json!([]), &json!([])));
            if let Some(threads) = threads {
                assert_eq!(report["threads"], threads);
            }
        }
    }
}

#[test]
fn every_verb_has_its_report() {
    let folder = tempfile::tempdir().unwrap();
    let place = |name: &str| folder.path().join(name);
    let job = |verb, output: Option<&str>, options| FileJob {
        verb,
        input: testdata("wave.glb"),
        output: output.map(place),
        options,
        ..FileJob::default()
    };
    let faces = |outcome: &Value| outcome["report"]["output"]["faces"].as_u64().unwrap();
    let dry = job("simplify", None, json!({ "ratio": 0.3 })).done();
    assert_eq!(dry["report"]["output"]["path"], Value::Null);
    assert!(faces(&job("clean", Some("clean.obj"), Value::Null).done()) >= faces(&dry));
    job("convert", Some("wave.ply"), json!({ "ascii": true })).done();
    assert!(fs::read(place("wave.ply")).unwrap().starts_with(b"ply\nformat ascii"));
    let info = job("info", None, Value::Null).done();
    assert_eq!(info["report"]["path"], testdata("wave.glb").to_str().unwrap());

    job("lod", Some("levels.glb"), json!({ "levels": [0.5, 0.25] })).done();
    assert!(place("levels.glb").is_file());
    let out_dir = Some(place("new/folder"));
    let levels = FileJob { out_dir, ..job("lod", None, json!({ "count": 2, "to": "ply" })) };
    assert_eq!(levels.done()["report"]["levels"].as_array().map(Vec::len), Some(2));
    let mut names: Vec<_> = fs::read_dir(place("new/folder"))
        .unwrap()
        .map(|file| file.unwrap().file_name().into_string().unwrap())
        .collect();
    names.sort();
    assert_eq!(names, ["lods.json", "wave_lod0.ply", "wave_lod1.ply", "wave_lod2.ply"]);

    simplify(place("low.glb"), json!({ "ratio": 0.3 })).done();
    let bake = FileJob {
        input: place("low.glb"),
        detailed: Some(testdata("wave.glb")),
        ..job("bake", Some("baked.glb"), json!({ "maps": "normal", "texture-size": 64 }))
    };
    let report = &bake.done()["report"];
    assert!(place("baked.glb").is_file() && report.to_string().contains("wave.glb"), "{report}");
}

#[test]
fn errors_have_a_code_and_a_text() {
    let folder = tempfile::tempdir().unwrap();
    let place = |name: &str| folder.path().join(name);
    let job = |options| simplify(place("low.glb"), options);
    let ratio = || json!({ "ratio": 0.3 });
    let lod = |output: Option<&str>| FileJob {
        verb: "lod",
        output: output.map(place),
        ..job(json!({ "count": 2 }))
    };
    fs::write(place("broken.glb"), b"glTF, but no more of it").unwrap();
    let cases = [
        (
            job(json!({ "rato": 0.3 })),
            LODSMITH_ERROR_OPTION,
            "there is no option rato; a similar one is ratio",
        ),
        (job(json!({ "ratio": 3 })), LODSMITH_ERROR_OPTION, "ratio"),
        (job(json!({ "ratio": 0.3, "texture_size": 64 })), LODSMITH_ERROR_OPTION, "needs bake"),
        (job(json!({ "ratio": 0.3, "lock": ["nothing"] })), LODSMITH_ERROR_OPTION, "nothing"),
        (job(json!([0.3])), LODSMITH_ERROR_ARGUMENT, "a JSON object"),
        (FileJob { input: place("none.glb"), ..job(ratio()) }, LODSMITH_ERROR_FILE, "none.glb: "),
        (FileJob { input: place("broken.glb"), ..job(ratio()) }, LODSMITH_ERROR_FILE, "broken.glb: "),
        (FileJob { output: Some(place("no/low.glb")), ..job(ratio()) }, LODSMITH_ERROR_FILE, "low.glb"),
        (FileJob { output: Some(place("low.xyz")), ..job(ratio()) }, LODSMITH_ERROR_OPTION, "low.xyz"),
        (job(json!({ "ratio": 0.3, "max_memory": "9M" })), LODSMITH_ERROR_OPTION, "at least 32M"),
        (
            job(json!({ "ratio": 0.3, "bake": "normal", "texture_size": 8192, "max_memory": "32M" })),
            LODSMITH_ERROR_LIMIT,
            "memory",
        ),
        (FileJob { verb: "lighten", ..job(ratio()) }, LODSMITH_ERROR_ARGUMENT, "one of simplify, lod"),
        (FileJob { verb: "bake", ..job(Value::Null) }, LODSMITH_ERROR_ARGUMENT, "two files"),
        (FileJob { detailed: Some(place("a")), ..job(ratio()) }, LODSMITH_ERROR_ARGUMENT, "only for bake"),
        (FileJob { verb: "info", ..job(Value::Null) }, LODSMITH_ERROR_ARGUMENT, "writes no file"),
        (FileJob { verb: "convert", output: None, ..job(Value::Null) }, LODSMITH_ERROR_OPTION, "an output"),
        (FileJob { out_dir: Some(place("")), ..lod(Some("low.glb")) }, LODSMITH_ERROR_ARGUMENT, "only one"),
        (
            FileJob { out_dir: Some(place("")), output: None, ..job(ratio()) },
            LODSMITH_ERROR_ARGUMENT,
            "only for lod",
        ),
        (lod(Some("low.ply")), LODSMITH_ERROR_OPTION, "use a folder (out_dir) for PLY"),
    ];
    for (job, code, part) in cases {
        let (got, text) = job.refused();
        assert!(got == code && text.contains(part), "{code} {part:?}: {got} {text:?}");
        assert!(!place("low.glb").exists(), "{part:?}");
    }
}

#[test]
fn strict_faults_come_with_the_outcome() {
    let folder = tempfile::tempdir().unwrap();
    let output = folder.path().join("low.glb");
    // The run ends before the target.
    let mut finishing = Listener { calls: Vec::new(), answer: |_| LODSMITH_FINISH };
    let options = json!({ "ratio": 0.01, "strict": true });
    let (code, error, outcome) = simplify(output.clone(), options).run_with(Some(&mut finishing));
    assert_eq!(code, LODSMITH_ERROR_STRICT, "{error:?}");
    let outcome = outcome.unwrap();
    let faults = outcome["faults"].as_array().unwrap();
    assert!(faults[0].as_str().unwrap().contains("target not reached"), "{faults:?}");
    assert_eq!(outcome["report"]["reached"], false);
    assert!(error.unwrap().contains("target not reached") && output.is_file());
}

#[test]
fn progress_is_reported_on_the_calling_thread_and_can_cancel() {
    let folder = tempfile::tempdir().unwrap();
    let output = folder.path().join("low.glb");
    let here = std::thread::current().id();
    for threads in [Value::Null, json!(2)] {
        let options = json!({ "ratio": 0.3, "threads": threads });
        let mut all = Listener { calls: Vec::new(), answer: |_| LODSMITH_CONTINUE };
        let (code, _, outcome) = simplify(output.clone(), options.clone()).run_with(Some(&mut all));
        assert!(code == LODSMITH_OK && outcome.is_some());
        fs::remove_file(&output).unwrap();
        assert!(all.calls.iter().all(|(.., thread)| *thread == here));
        assert!(all.calls.is_sorted_by(|a, b| a.1 <= b.1), "{:?}", all.calls);
        assert!(all.calls.iter().all(|(_, done, _)| (0.0..=1.0).contains(done)));
        let stages: Vec<i32> = all.calls.iter().map(|(stage, ..)| *stage).collect();
        assert_eq!((stages[0], stages[stages.len() - 1]), (LODSMITH_STAGE_READ, LODSMITH_STAGE_WRITE));
        assert!(stages.contains(&LODSMITH_STAGE_SIMPLIFY));

        // At the first call, in the engine, and just before the file is written.
        for answer in [
            (|_| LODSMITH_CANCEL) as fn(&ProgressCall) -> i32,
            |call| if call.0 == LODSMITH_STAGE_SIMPLIFY { LODSMITH_CANCEL } else { LODSMITH_CONTINUE },
            |call| if call.0 == LODSMITH_STAGE_WRITE { LODSMITH_CANCEL } else { LODSMITH_CONTINUE },
        ] {
            let mut cancelling = Listener { calls: Vec::new(), answer };
            let (code, error, outcome) =
                simplify(output.clone(), options.clone()).run_with(Some(&mut cancelling));
            assert_eq!((code, error.as_deref()), (LODSMITH_ERROR_CANCELLED, Some("cancelled")));
            assert_eq!(outcome, None);
            let last = cancelling.calls.last().unwrap();
            assert_eq!((cancelling.answer)(last), LODSMITH_CANCEL, "it is not asked again");
            assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 0, "no file is left");
        }
    }
    let info = FileJob { verb: "info", input: testdata("wave.glb"), ..FileJob::default() };
    let mut cancelling = Listener { calls: Vec::new(), answer: |_| LODSMITH_CANCEL };
    assert_eq!(info.run_with(Some(&mut cancelling)).0, LODSMITH_ERROR_CANCELLED);
}

#[test]
fn finish_writes_the_best_mesh_so_far_but_cancels_baking() {
    let folder = tempfile::tempdir().unwrap();
    let output = folder.path().join("low.glb");
    let mut finishing = Listener { calls: Vec::new(), answer: |_| LODSMITH_FINISH };
    let (code, _, outcome) =
        simplify(output.clone(), json!({ "ratio": 0.01 })).run_with(Some(&mut finishing));
    assert_eq!(code, LODSMITH_OK);
    assert_eq!(outcome.unwrap()["report"]["reached"], false);
    fs::remove_file(&output).unwrap();
    let bake = json!({ "ratio": 0.3, "bake": "normal", "texture_size": 64 });
    let (code, error, _) = simplify(output.clone(), bake).run_with(Some(&mut finishing));
    assert!(code == LODSMITH_ERROR_CANCELLED && error.unwrap().contains("baking") && !output.exists());
}

#[test]
fn pointers_are_checked() {
    let verb = c_text("info");
    let input = c_path(&testdata("wave.glb"));
    let job = LodsmithFileJob {
        size: size_of::<LodsmithFileJob>(),
        verb: verb.as_ptr(),
        input: input.as_ptr(),
        detailed: ptr::null(),
        output: ptr::null(),
        out_dir: ptr::null(),
        options: ptr::null(),
    };
    assert_eq!(call(&job, None).0, LODSMITH_OK);
    let refused = |job| {
        let (code, error, outcome) = call(&job, None);
        assert!(code == LODSMITH_ERROR_ARGUMENT && outcome.is_none());
        error.unwrap()
    };
    assert_eq!(refused(LodsmithFileJob { verb: ptr::null(), ..job }), "verb is null");
    assert_eq!(refused(LodsmithFileJob { input: ptr::null(), ..job }), "input is null");
    assert!(refused(LodsmithFileJob { size: 0, ..job }).contains("sizeof"));
    assert!(refused(LodsmithFileJob { size: job.size + 1, ..job }).contains("sizeof"));
    let odd = c_text(*b"wave\xff.glb");
    assert_eq!(refused(LodsmithFileJob { input: odd.as_ptr(), ..job }), "input is not UTF-8");
    assert_eq!(refused(LodsmithFileJob { options: odd.as_ptr(), ..job }), "options is not UTF-8");
    let open = c_text("{");
    assert!(refused(LodsmithFileJob { options: open.as_ptr(), ..job }).starts_with("options: not JSON"));

    let mut outcome = ptr::NonNull::<LodsmithText>::dangling().as_ptr();
    // SAFETY: nulls are errors, and the outcome may be written.
    unsafe {
        let code = lodsmith_run_file_job(ptr::null(), None, ptr::null_mut(), &raw mut outcome);
        assert_eq!(code, LODSMITH_ERROR_ARGUMENT);
        assert!(outcome.is_null());
        let code = lodsmith_run_file_job(&raw const job, None, ptr::null_mut(), ptr::null_mut());
        assert_eq!(code, LODSMITH_ERROR_ARGUMENT);
        assert!(lodsmith_text_get(ptr::null()).is_null());
        lodsmith_text_free(ptr::null_mut());
    }
}
