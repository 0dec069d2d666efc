//! A document whose jobs are done by an engine behind a page, as in a browser: here the engine is in the same
//! process, and all that passes between both are text and bytes.

use std::cell::RefCell;
use std::collections::VecDeque;
use std::path::{Path, PathBuf};
use std::rc::Rc;
use std::sync::{Arc, Mutex};

use glam::DMat4;
use lodsmith_core::shapes;
use lodsmith_io::{Format, Textures};
use lodsmith_render::{Camera, StandardView};
use lodsmith_viewer::command::{Command, SimplifyTarget};
use lodsmith_viewer::content::difference::{DifferenceSettings, DifferenceView};
use lodsmith_viewer::content::export::Export;
use lodsmith_viewer::document::{Document, Engine};
use lodsmith_viewer::page::{BrowserPage, PageWorker, WorkerMessage};
use lodsmith_viewer::settings::{HeatOf, Layout, Pose, Sides};

use crate::documents::{TIMEOUT, folder_with};

/// A page without a browser. Its workers answer when they are asked for messages.
#[derive(Default)]
struct TestPage {
    workers_started: RefCell<usize>,
    workers_ended: Rc<RefCell<usize>>,
}

struct TestWorker {
    engine: RefCell<Engine>,
    requests: RefCell<VecDeque<String>>,
    messages: RefCell<VecDeque<WorkerMessage>>,
    ended: Rc<RefCell<usize>>,
}

impl BrowserPage for TestPage {
    fn start_worker(&self, _: Box<dyn Fn()>) -> Box<dyn PageWorker> {
        *self.workers_started.borrow_mut() += 1;
        Box::new(TestWorker {
            engine: RefCell::default(),
            requests: RefCell::default(),
            messages: RefCell::default(),
            ended: self.workers_ended.clone(),
        })
    }
    fn choose_files(&self, _: &[&str], _: bool) {}
    fn put_file(&self, _: &str, _: &[u8]) {}
    fn take_opened(&self) -> Vec<PathBuf> {
        Vec::new()
    }
    fn save_written(&self, _: &Path) {}
    fn save(&self, _: &str, _: &[u8]) {}
    fn save_all(&self, _: &str, _: &[(&str, &[u8])]) {}
}

impl PageWorker for TestWorker {
    fn post(&self, request: &str) {
        self.requests.borrow_mut().push_back(request.to_owned());
    }

    fn poll(&self) -> Option<WorkerMessage> {
        if let Some(request) = self.requests.borrow_mut().pop_front() {
            let progress = Arc::new(Mutex::new(Vec::new()));
            let its = progress.clone();
            let report = move |done, stage: &'static str| {
                its.lock().unwrap().push(WorkerMessage::Progress(done, stage.to_owned()));
            };
            let answer = self.engine.borrow_mut().run(&request, report);
            let mut messages = self.messages.borrow_mut();
            messages.extend(progress.lock().unwrap().drain(..));
            messages.push_back(WorkerMessage::Answer(answer));
        }
        self.messages.borrow_mut().pop_front()
    }
}

impl Drop for TestWorker {
    fn drop(&mut self) {
        *self.ended.borrow_mut() += 1;
    }
}

fn folder() -> tempfile::TempDir {
    folder_with([("sphere.ply", shapes::icosphere(4)), ("torus.glb", shapes::torus(96, 48))])
}

/// Returns documents with an engine behind a page, and with one in the same process.
fn both() -> (Rc<TestPage>, [Document; 2]) {
    let page = Rc::new(TestPage::default());
    let behind: Rc<dyn BrowserPage> = page.clone();
    (page, [Document::on_page(None, &behind, || {}), Document::new(None, || {})])
}

fn run(document: &mut Document, command: Command) {
    document.run(command);
    document.seal();
    assert!(document.settle(TIMEOUT), "the work never ends");
}

#[test]
fn a_document_behind_a_page_shows_what_one_in_the_same_process_shows() {
    let folder = folder();
    for name in ["sphere.ply", "torus.glb"] {
        let (_, mut documents) = both();
        for document in &mut documents {
            document.set_wanted_results(true, true);
            run(document, Command::Open(vec![folder.path().join(name)]));
            assert!(document.has_preview(), "{:?}", document.problem);
            run(document, Command::Target(SimplifyTarget::Faces(700)));
        }
        let [page, here] = &documents;
        assert_eq!(
            page.original_size().map(|o| (o.faces, o.vertices)),
            here.original_size().map(|o| (o.faces, o.vertices))
        );
        let [one, two] = [page, here].map(|d| d.lighter().unwrap().content.clone());
        assert_eq!(one.model.meshes[0].mesh, two.model.meshes[0].mesh);
        assert_eq!((&one.report, &one.counts), (&two.report, &two.counts));
        let [one, two] = [page, here].map(|d| d.distances().unwrap().clone());
        assert_eq!(
            (&one.of_result, &one.of_original, one.largest),
            (&two.of_result, &two.of_original, two.largest)
        );
        assert_eq!(page.topologies(), here.topologies());
        for document in &mut documents {
            let mut look = document.settings().look.clone();
            look.heat_of = HeatOf::Normals;
            run(document, Command::Look(look));
        }
        let angles = documents.map(|d| {
            let distances = d.distances().expect("normals were compared").clone();
            assert_eq!(distances.quantity, HeatOf::Normals);
            distances.of_result.iter().flatten().map(|angle| angle.to_bits()).collect::<Vec<_>>()
        });
        assert!(!angles[0].is_empty() && angles[0] == angles[1]);
    }
}

fn difference_view(document: &Document) -> DifferenceView {
    let (original, lighter) = (document.original().unwrap(), document.lighter().unwrap());
    let camera = Camera::fitting(&original.content.bounds, StandardView::Iso, 1.25);
    let seen = DifferenceSettings {
        pose: lodsmith_core::model::Pose::default(),
        world_from_model: DMat4::IDENTITY,
        camera: Pose::of(&camera),
        size: [100, 80],
        scale: 1.0,
        look: document.settings().look.clone(),
    };
    DifferenceView { original: original.content.clone(), lighter: lighter.content.clone(), seen }
}

fn show(document: &mut Document, sides: Sides) {
    let layout = Layout { sides, ..document.settings().layout };
    run(document, Command::Layout(layout));
}

#[test]
fn the_difference_picture_is_drawn_behind_a_page_too() {
    let folder = folder();
    let (_, mut documents) = both();
    for document in &mut documents {
        run(document, Command::Open(vec![folder.path().join("torus.glb")]));
        run(document, Command::Target(SimplifyTarget::Faces(300)));
        show(document, Sides::Difference);
        document.want_difference(difference_view(document));
        assert!(document.settle(TIMEOUT), "the work never ends");
    }
    let [one, two] = documents.each_ref().map(|d| &d.difference().expect("it is drawn").drawn);
    assert!(one.mean > 0.005 && one.picture.pixels().iter().any(|p| p[3] > 0), "{}", one.mean);
    assert_eq!((one.mean.to_bits(), &one.values), (two.mean.to_bits(), &two.values));
    assert!(one.picture == two.picture);
}

#[test]
fn a_difference_picture_that_comes_too_late_is_not_kept() {
    let folder = folder();
    let (_, mut documents) = both();
    for document in &mut documents {
        run(document, Command::Open(vec![folder.path().join("sphere.ply")]));
        run(document, Command::Target(SimplifyTarget::Faces(300)));
        show(document, Sides::Difference);
        document.want_difference(difference_view(document));
        show(document, Sides::Both);
        assert!(document.difference().is_none());
        // No view shows it now.
        document.want_difference(difference_view(document));
        assert!(document.settle(TIMEOUT) && document.difference().is_none());
    }
}

#[test]
fn the_slider_shows_levels_of_the_engine_behind_a_page() {
    let folder = folder();
    let (_, mut documents) = both();
    let mut shown = Vec::new();
    for document in &mut documents {
        run(document, Command::Open(vec![folder.path().join("torus.glb")]));
        let mut meshes = Vec::new();
        for faces in [5000, 900, 300, 4000] {
            // No exact run follows while the slider is held.
            document.run(Command::Target(SimplifyTarget::Faces(faces)));
            let level = loop {
                document.poll();
                let level = document.lighter().unwrap().content.clone();
                if level.how == document.settings().simplify {
                    break level;
                }
            };
            assert!(level.report.is_none() && level.faces <= faces, "{} for {faces}", level.faces);
            meshes.push((level.faces, level.model.meshes[0].mesh.clone()));
        }
        shown.push(meshes);
    }
    assert_eq!(shown[0], shown[1]);
}

/// The page holds no progressive mesh, and the level within an error is found by its worker.
#[test]
fn the_slider_of_an_error_shows_the_same_level_behind_a_page() {
    let folder = folder();
    let (_, documents) = both();
    let shown = documents.map(|mut document| {
        run(&mut document, Command::Open(vec![folder.path().join("torus.glb")]));
        document.run(Command::Target(SimplifyTarget::Error(0.01)));
        while document.lighter().is_none() {
            document.poll();
        }
        let level = document.lighter().unwrap().content.clone();
        assert!(document.shows_preview(), "a run was begun");
        let limit = document.error_limit().unwrap();
        assert!(level.largest_estimate.is_some_and(|d| d > 0.0 && d <= limit * (1.0 + 1e-9)), "{limit}");
        assert!(document.settle(TIMEOUT) && !document.shows_preview());
        (level.faces, level.largest_estimate)
    });
    assert_eq!(shown[0], shown[1]);
}

/// The worker of the slider has read the first file and does not know that another file has its name.
#[test]
fn the_slider_follows_a_file_that_is_opened_again() {
    let folder = folder();
    let path = folder.path().join("changed.ply");
    lodsmith_io::write_path(&shapes::icosphere(4), &path, &Default::default()).unwrap();
    let (_, [mut document, _]) = both();
    run(&mut document, Command::Open(vec![path.clone()]));
    assert!(document.has_preview());
    lodsmith_io::write_path(&shapes::torus(96, 48), &path, &Default::default()).unwrap();
    document.reload();
    assert!(document.settle(TIMEOUT) && document.has_preview());
    document.run(Command::Target(SimplifyTarget::Faces(900)));
    let bounds = loop {
        document.poll();
        if let Some(level) = document.lighter() {
            break level.content.model.meshes[0].mesh.positions().view().bounds().unwrap();
        }
    };
    assert!(bounds.max[2] < 0.5, "{bounds:?}: a torus is flat");
}

#[test]
fn an_export_behind_a_page_has_the_same_bytes() {
    let folder = folder();
    let (_, mut documents) = both();
    let mut written = Vec::new();
    for (number, document) in documents.iter_mut().enumerate() {
        run(document, Command::Open(vec![folder.path().join("torus.glb")]));
        run(document, Command::Target(SimplifyTarget::Ratio(0.1)));
        let path = folder.path().join(format!("out{number}.glb"));
        let export = Export {
            path: path.clone(),
            format: Format::Glb,
            ascii: false,
            textures: Textures::default(),
            levels: Vec::new(),
        };
        document.export(export, 0.0);
        assert!(document.settle(TIMEOUT) && document.problem.is_none(), "{:?}", document.problem);
        written.push(std::fs::read(path).unwrap());
    }
    assert!(written[0] == written[1]);
}

#[test]
fn a_file_that_cannot_be_read_and_a_cancelled_run_leave_what_is_shown() {
    let folder = folder();
    std::fs::write(folder.path().join("broken.ply"), "ply\nnonsense").unwrap();
    let (page, [mut document, _]) = both();
    run(&mut document, Command::Open(vec![folder.path().join("sphere.ply")]));
    document.run(Command::Open(vec![folder.path().join("broken.ply")]));
    assert!(document.settle(TIMEOUT));
    assert!(document.problem.as_ref().is_some_and(|p| p.contains("broken.ply")), "{:?}", document.problem);
    assert_eq!(document.original().unwrap().content.faces, 5120);
    // A reading worker ends with its job; the next job gets another worker.
    let ended = *page.workers_ended.borrow();
    document.run(Command::Open(vec![folder.path().join("torus.glb")]));
    document.cancel();
    assert_eq!(*page.workers_ended.borrow(), ended + 1);
    assert!(document.is_idle());
    run(&mut document, Command::Target(SimplifyTarget::Faces(500)));
    assert!(document.lighter().unwrap().content.faces <= 500);
    assert_eq!(*page.workers_started.borrow(), 3);
}
