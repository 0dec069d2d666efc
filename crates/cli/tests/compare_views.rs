//! `lodsmith compare --views`, from end to end.

use lodsmith_render::decode;
use serde_json::Value;

use crate::sandbox::{CliSandbox, coloured_cube, hills};

fn image(sandbox: &CliSandbox, arguments: &str) -> Value {
    let outcome = sandbox.run(&format!("compare --json {arguments}")).with_status(0);
    outcome.objects().remove(0)["image"].clone()
}

#[test]
fn a_simplified_mesh_looks_different_and_an_equal_one_does_not() {
    let sandbox = CliSandbox::new();
    sandbox.put("hills.ply", &hills(30));
    for (ratio, name) in [("0.5", "half.ply"), ("0.02", "little.ply")] {
        sandbox.run(&format!("simplify hills.ply -o {name} --ratio {ratio} -q")).with_status(0);
    }
    let options = "--views 4 --size 96x64";
    let same = image(&sandbox, &format!("hills.ply hills.ply {options}"));
    assert_eq!((&same["flip"]["worst"], &same["silhouette"]["worst"]), (&0.0.into(), &0.0.into()));
    assert!(same["psnr_db"]["mean"].is_null() && same["ssim"]["worst"].as_f64().unwrap() > 0.9999);
    assert_eq!((&same["views"], &same["width"], &same["height"]), (&4.into(), &96.into(), &64.into()));

    let [half, little] =
        ["half.ply", "little.ply"].map(|n| image(&sandbox, &format!("hills.ply {n} {options}")));
    let figure = |of: &Value, key: &str, which: &str| of[key][which].as_f64().unwrap();
    for which in ["mean", "worst"] {
        assert!(figure(&half, "flip", which) < figure(&little, "flip", which), "{half} {little}");
        assert!(figure(&half, "ssim", which) > figure(&little, "ssim", which));
        assert!(figure(&half, "psnr_db", which) > figure(&little, "psnr_db", which));
    }
    // With any number of threads.
    let mut again = image(&sandbox, &format!("hills.ply little.ply {options} --threads 3"));
    again["draw_seconds"] = little["draw_seconds"].clone();
    assert_eq!(again, little);
    let text = sandbox.run(&format!("compare hills.ply half.ply {options}")).with_status(0);
    for word in ["4 of 96 × 64, smooth", "FLIP", "SSIM", "PSNR", "silhouette", "render time"] {
        assert!(text.text().contains(word), "{word}: {}", text.text());
    }
}

#[test]
fn pairs_of_images_are_written() {
    let sandbox = CliSandbox::new();
    sandbox.put("cube.ply", &coloured_cube());
    let seen = image(&sandbox, "cube.ply cube.ply --views 3 --size 40x40 --views-sheet pairs.png");
    assert_eq!(seen["shading"], "vertex-colors");
    let sheet = decode(&std::fs::read(sandbox.path("pairs.png")).unwrap()).unwrap();
    assert!(sheet.width() > 160 && sheet.height() > 80, "{sheet:?}");
    assert!(sandbox.run("compare cube.ply cube.ply --json").objects()[0]["image"].is_null());
}

#[test]
fn invalid_options_are_refused() {
    let sandbox = CliSandbox::new();
    sandbox.put("cube.ply", &coloured_cube());
    for arguments in [
        "--views 0",
        "--size 40x40",
        "--views 2 --size 0x9",
        "--views-sheet a.png",
        "--views 2 --views-sheet a.txt",
    ] {
        sandbox.run(&format!("compare cube.ply cube.ply {arguments}")).with_status(2);
    }
}
