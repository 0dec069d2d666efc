//! Malformed text files: each error names the problem and its place.

use lodsmith_io::{Format, ReadOptions, read_bytes, read_path};

fn error_of(text: &str) -> String {
    read_bytes(text.as_bytes(), &ReadOptions::default()).unwrap_err().to_string()
}

const THREE: &str = "v 0 0 0\nv 1 0 0\nv 0 1 0\n";

#[test]
fn obj_errors_name_the_line_and_the_word() {
    for (lines, wanted) in [
        ("f 0 1 2", "line 4: the face refers to vertex 0, but OBJ counts from 1"),
        ("f 1 2 99", "line 4: the face refers to vertex 99, but the file has 3"),
        ("f 1 2 3\n\nf 1 2 -4", "line 6: the face refers to vertex -4, but only 3 come before it"),
        (
            "f 1 2 99999999999999999999",
            "line 4: the face refers to vertex 9223372036854775807, more than a mesh can have",
        ),
        ("f 1 2 x", "line 4: `x` is not a whole number"),
        ("f 1 2 3.5", "line 4: `.5` is not a corner of a face"),
        ("f 1/2/3/4 2 3", "line 4: `/4` is not a corner of a face"),
        ("v 1 2 3.1+e2", "line 4: `3.1+e2` is not a number"),
        ("v 1 2", "line 4: a position needs 3 numbers, but has 2"),
        ("vn 1 2", "line 4: a normal needs 3 numbers, but has 2"),
        ("vt", "line 4: a texture coordinate needs 1 number, but has 0"),
        ("v\r", "line 4: a position needs 3 numbers, but has 0"),
        ("f", "no faces in the file (3 vertices): nothing to work on"),
        ("vt \\\n", "line 5: a texture coordinate needs 1 number, but has 0"),
        ("v 1 2 \u{1b}[31m", "line 4: `\\u{1b}[31m` is not a number"),
        ("v 1,5 2 3", "line 4: `1,5` is not a number"),
    ] {
        assert_eq!(error_of(&format!("{THREE}{lines}\n")), wanted, "{lines}");
    }
}

#[test]
fn off_errors_name_the_line() {
    for (text, wanted) in [
        (
            "OFF\n353535235358 6 0\n0 0 0\n",
            "line 2: the header says 353535235358 vertices, but the file has room for 1 at most",
        ),
        (
            "OFF\n3 4\n0.1 0.2 0.3\n0.2 0.3 0.4\n",
            "line 5: the file ends at vertex 2 of the 3 declared in the header",
        ),
        (
            "OFF\n3 1 0\n0 0 0\n1 0 0\n# a comment to make room for one more\n",
            "line 6: the file ends at vertex 2 of the 3 declared in the header",
        ),
        (
            "OFF\n3 2 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n",
            "line 7: the file ends at face 1 of the 2 declared in the header",
        ),
        (
            "OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 3\n",
            "line 6: face 0 names vertex 3, but the file has 3, counted from 0",
        ),
        (
            "OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 -1\n",
            "line 6: face 0 names vertex -1, but the file has 3, counted from 0",
        ),
        (
            "OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n-3 0 1 2\n",
            "line 6: a face begins with the number of its corners",
        ),
        (
            "OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n4000000000 0 1 2\n",
            "line 7: the file ends at face 0 of the 1 declared in the header",
        ),
        ("OFF\n3 1 0\n0 0 x\n1 0 0\n0 1 0\n3 0 1 2\n", "line 3: `x` is not a number"),
        ("OFF\n-3 1 0\n", "line 2: the header says -3 vertices, which is impossible"),
        ("OFF\n3.5 1 0\n", "line 2: `.5` is not a whole number"),
        ("OFF\n", "line 2: the file ends before its number of vertices"),
        ("OFF BINARY\n", "binary OFF is not read; save it as text"),
        ("nOFF 5\n3 1 0\n", "OFF of 5 dimensions is not supported, only of 3"),
    ] {
        let got = error_of(text);
        assert!(got.starts_with(wanted), "{text}: {got}");
    }
}

#[test]
fn what_is_no_mesh_is_refused() {
    for (text, wanted) in [
        ("", "the file is empty"),
        (" \n\t\n", "it contains only white space"),
        (
            "Dear colleague,\nplease find the mesh attached.\n",
            "it is text, but no line looks like a mesh format",
        ),
        ("\u{1}\u{2}\u{3}", "its first bytes match none of them"),
    ] {
        let got = error_of(text);
        assert_eq!(
            got,
            format!(
                "not a mesh in any known format (OBJ, OFF, PLY, STL, glTF, GLB, 3MF, COLLADA, FBX, LPM): {wanted}"
            )
        );
    }
    assert_eq!(error_of(THREE), "no faces in the file (3 vertices): nothing to work on");
}

#[test]
fn errors_of_files_carry_their_path() {
    let folder = tempfile::tempdir().unwrap();
    let error = |path: &std::path::Path| read_path(path, &ReadOptions::default()).unwrap_err().to_string();
    let path = folder.path().join("a b.obj");
    assert_eq!(error(&path), format!("{}: cannot read: there is no such file", path.display()));
    std::fs::write(&path, format!("{THREE}f 1 2 4\n")).unwrap();
    assert_eq!(
        error(&path),
        format!("{}: line 4: the face refers to vertex 4, but the file has 3", path.display())
    );
    std::fs::write(&path, "# nothing here\n").unwrap();
    assert!(error(&path).ends_with("no faces in the file (0 vertices): nothing to work on"));
    let got = error(folder.path());
    assert_eq!(got, format!("{}: cannot read: it is a folder, not a file", folder.path().display()));
}

#[test]
fn a_wrong_ending_is_a_note() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.off");
    std::fs::write(&path, format!("{THREE}f 1 2 3\n")).unwrap();
    let got = read_path(&path, &ReadOptions::default()).unwrap();
    assert_eq!(got.format, Format::Obj);
    assert_eq!(got.warnings[0].text, "the extension says OFF, but the content is OBJ: read as OBJ");
    assert!(!got.warnings[0].data_lost);
}
