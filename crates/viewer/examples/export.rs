//! What a user of the window does, without a window: opens a file, sets a target, bakes maps, exports, and prints the
//! report. `bindings/doors.py` compares it with the command.
#![allow(clippy::print_stdout, reason = "a program speaks on its standard streams")]

use std::path::PathBuf;
use std::time::Duration;

use lodsmith_asset::report_json;
use lodsmith_io::{Format, Textures};
use lodsmith_viewer::command::{Command, SimplifyTarget};
use lodsmith_viewer::content::export::Export;
use lodsmith_viewer::document::Document;
use lodsmith_viewer::settings::bake::BakeSettings;
use serde_json::Value;

fn main() {
    let words: Vec<String> = std::env::args().skip(1).collect();
    let [input, output, options] = &words[..] else { panic!("usage: export IN OUT OPTIONS") };
    let options: Value = serde_json::from_str(options).expect("options are JSON");
    let maps: Vec<&str> =
        options["bake"].as_array().into_iter().flatten().filter_map(Value::as_str).collect();
    let size = options["texture_size"].to_string();
    let bake = ["--bake", &maps.join(","), "--texture-size", &size, "--atlas", "keep"].map(str::to_owned);
    let bake = BakeSettings::parse(&bake).expect("maps of materials");

    let mut document = Document::new(None, || {});
    let go_on = |document: &mut Document| assert!(document.settle(Duration::from_secs(300)), "it never ends");
    document.run(Command::Open(vec![PathBuf::from(input)]));
    go_on(&mut document);
    document.run(Command::Target(SimplifyTarget::Ratio(options["ratio"].as_f64().expect("a ratio"))));
    document.run(Command::Bake(bake));
    document.seal();
    go_on(&mut document);
    document.bake();
    go_on(&mut document);
    let format = Format::Glb;
    let textures = Textures::default();
    document.export(Export { path: output.into(), format, ascii: false, textures, levels: Vec::new() }, 0.0);
    go_on(&mut document);
    let made = &document.lighter().expect("a result").content;
    let report = made.report.as_ref().expect("an exact run");
    println!("{}", report_json::run(report, &made.how.options));
}
