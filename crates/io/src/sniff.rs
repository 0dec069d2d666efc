//! Detection of file formats.

use std::path::Path;

use crate::format::Format;

/// Returns the format of a file by its content; the hint from its extension decides only ambiguous cases.
///
/// Ambiguous are damaged binary files, files with only comments, and text whose meaning depends on the
/// extension. Text without any line of a mesh format is `None`, whatever the hint. Examines the first 64 kB.
pub fn sniff(bytes: &[u8], hint: Option<Format>) -> Option<Format> {
    let bytes = bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes);
    if bytes.starts_with(b"glTF") {
        return Some(Format::Glb);
    }
    if bytes.starts_with(&crate::lpm::MAGIC) {
        return Some(Format::Lpm);
    }
    if bytes.starts_with(b"Kaydara FBX Binary") {
        return Some(Format::Fbx);
    }
    if is_three_mf(bytes, hint) {
        return Some(Format::ThreeMf);
    }
    if is_ply(bytes) {
        return Some(Format::Ply);
    }
    if is_binary_stl(bytes) {
        return Some(Format::Stl);
    }
    if !looks_like_text(bytes) {
        // Text formats with a stray control byte are still text; the rest is damaged, and its reader reports
        // how.
        return text_format(bytes, None).or(hint);
    }
    text_format(bytes, hint)
}

/// Advice for a file that Blender reads.
const BLENDER_ADVICE: &str = "open it in Blender and export glTF";
/// Advice for a CAD file.
const CAD_ADVICE: &str = "open it in FreeCAD or another CAD program and export a mesh as STL, OBJ or glTF";

/// Returns the name of a known but unsupported format, and advice on how to convert it.
pub(crate) fn unsupported_format(bytes: &[u8]) -> Option<(&'static str, &'static str)> {
    let front = front(bytes);
    let has = |word: &[u8]| memchr::memmem::find(front, word).is_some();
    let begins = |word: &[u8]| front.trim_ascii_start().starts_with(word);
    Some(match () {
        () if begins(b"<") && has(b"<X3D") => ("X3D", BLENDER_ADVICE),
        () if begins(b"#VRML") => ("VRML", "open it in MeshLab and export PLY or OBJ"),
        () if begins(b"PXR-USDC") || begins(b"#usda") => ("USD", BLENDER_ADVICE),
        () if begins(b"BLENDER") => ("a Blender project", BLENDER_ADVICE),
        () if begins(b"Ogawa") => ("Alembic", BLENDER_ADVICE),
        () if begins(b"ISO-10303-21") => ("STEP", CAD_ADVICE),
        () if begins(b"PK") && has(b".usd") => ("USDZ", BLENDER_ADVICE),
        () if begins(b"PK") => ("a ZIP archive", "unpack it and name the model in it"),
        () => return None,
    })
}

/// Returns the format that the extension of a path names, ignoring `.gz`.
pub fn hint_of(path: &Path) -> Option<Format> {
    let ending = |p: &Path| p.extension().map(|e| e.to_string_lossy().into_owned());
    let last = ending(path)?;
    if last.eq_ignore_ascii_case("gz") {
        return Format::from_name(&ending(Path::new(path.file_stem()?))?);
    }
    Format::from_name(&last)
}

/// Returns true if the size matches a binary STL with its number of triangles, or is slightly larger after a
/// header that is not text. The header may begin with `solid`.
pub(crate) fn is_binary_stl(bytes: &[u8]) -> bool {
    let Some(count) = bytes.get(80..84) else { return false };
    let count = u32::from_le_bytes([count[0], count[1], count[2], count[3]]);
    let wanted = 84 + 50 * u64::from(count);
    let size = bytes.len() as u64;
    // Some exporters pad the end; guessed: by at most 1 % of the size or 512 bytes, whichever is larger.
    size == wanted
        || (count > 0 && size > wanted && size - wanted <= (wanted / 100).max(512) && !looks_like_text(bytes))
        || (count == 0 && has_facets(&bytes[84..]))
}

/// Returns true if bytes are facets of a binary STL, whose count was left as 0.
fn has_facets(bytes: &[u8]) -> bool {
    let (facets, []) = bytes.as_chunks::<50>() else { return false };
    // Bytes of other formats make numbers of any size. Guessed: no mesh is that large or that fine.
    let is_likely = |x: f32| x == 0.0 || (1e-20..1e20).contains(&x.abs());
    let numbers =
        |facet: &[u8; 50]| facet[12..48].as_chunks().0.iter().all(|b| is_likely(f32::from_le_bytes(*b)));
    !facets.is_empty() && facets.iter().take(16).all(numbers)
}

/// Returns true if the first bytes have no control characters except white space.
pub(crate) fn looks_like_text(bytes: &[u8]) -> bool {
    !front(bytes).iter().any(|&b| b < 9 || (14..32).contains(&b) || b == 127)
}

/// Number of bytes to examine. Guessed: longer than the comments at the start of a file.
pub(crate) const SNIFFED_BYTES: usize = 1 << 16;

fn front(bytes: &[u8]) -> &[u8] {
    &bytes[..bytes.len().min(SNIFFED_BYTES)]
}

/// Returns true for a ZIP archive with a part of 3MF among its first names, or with the extension of 3MF.
fn is_three_mf(bytes: &[u8], hint: Option<Format>) -> bool {
    let has = |word: &[u8]| memchr::memmem::find(front(bytes), word).is_some();
    let ends_with_names = || {
        // A large part may come first; the list of all names is at the end.
        let end = &bytes[bytes.len().saturating_sub(SNIFFED_BYTES)..];
        memchr::memmem::find(end, b"3D/").is_some()
    };
    bytes.starts_with(b"PK\x03\x04") && (hint == Some(Format::ThreeMf) || has(b"3D/") || ends_with_names())
}

fn is_ply(bytes: &[u8]) -> bool {
    bytes.strip_prefix(b"ply").is_some_and(|rest| rest.first().is_some_and(u8::is_ascii_whitespace))
}

fn text_format(bytes: &[u8], hint: Option<Format>) -> Option<Format> {
    let front = front(bytes);
    let start = front.trim_ascii_start();
    if start.starts_with(b"; FBX") || memchr::memmem::find(front, b"FBXHeaderExtension:").is_some() {
        return Some(Format::Fbx);
    }
    if start.first() == Some(&b'<') {
        return memchr::memmem::find(front, b"<COLLADA").map(|_| Format::Dae);
    }
    if start.first() == Some(&b'{') {
        let named = memchr::memmem::find(front, b"\"asset\"").is_some();
        // A writer may put the buffers first, which are long.
        let far = || memchr::memmem::find(bytes, b"\"asset\"").is_some();
        return (named || hint == Some(Format::Gltf) || far()).then_some(Format::Gltf);
    }
    if start.get(..5).is_some_and(|w| w.eq_ignore_ascii_case(b"solid"))
        && (hint == Some(Format::Stl) || has_facet(front))
    {
        return Some(Format::Stl);
    }
    let mut lines = front.split(|&b| b == b'\n').map(<[u8]>::trim_ascii);
    let is_blank = |line: &[u8]| line.is_empty() || line[0] == b'#';
    let Some(first) = lines.clone().find(|l| !is_blank(l)) else {
        // Comments only: both formats have them, and the reader will report that there are no faces.
        let comments = start.first() == Some(&b'#');
        return hint.filter(|h| comments && matches!(h, Format::Obj | Format::Off));
    };
    if is_off_header(first) || (hint == Some(Format::Off) && is_three_counts(first)) {
        return Some(Format::Off);
    }
    let (mut strong, mut known, mut strange) = (0usize, 0usize, 0usize);
    for line in lines.by_ref().filter(|l| !is_blank(l)).take(2000) {
        match obj_line(line) {
            Some(true) => strong += 1,
            Some(false) => known += 1,
            None => strange += 1,
        }
    }
    let is_obj = strong + known > strange && (strong > 0 || hint == Some(Format::Obj));
    // For a damaged OBJ, the error of its reader is better, as it names the line.
    (is_obj || (strong > 0 && hint == Some(Format::Obj))).then_some(Format::Obj)
}

fn has_facet(front: &[u8]) -> bool {
    front.to_ascii_lowercase().windows(6).any(|w| w == b"facet " || w == b"facet\t")
}

/// `OFF` with any of its prefixes: `[ST][C][N][4][n]OFF`, alone or followed by more.
pub(crate) fn is_off_header(line: &[u8]) -> bool {
    let word = line.split(|b| b.is_ascii_whitespace() || *b == b'#').next().unwrap_or_default();
    off_prefix(word).is_some()
}

/// Returns the text before `OFF` in a header word, if it is a valid prefix.
pub(crate) fn off_prefix(word: &[u8]) -> Option<&[u8]> {
    let prefix = word.strip_suffix(b"OFF")?;
    let mut rest = prefix.strip_prefix(b"ST").unwrap_or(prefix);
    for letter in [b"C", b"N", b"4", b"n"] {
        rest = rest.strip_prefix(letter).unwrap_or(rest);
    }
    rest.is_empty().then_some(prefix)
}

fn is_three_counts(line: &[u8]) -> bool {
    let mut words = line.split(u8::is_ascii_whitespace).filter(|w| !w.is_empty());
    let mut count = || words.next().is_some_and(|w| w.iter().all(u8::is_ascii_digit));
    count() && count() && count()
}

/// Returns `Some(true)` for a line that is almost certainly OBJ, `Some(false)` for one with an OBJ keyword.
fn obj_line(line: &[u8]) -> Option<bool> {
    let mut words = line.split(u8::is_ascii_whitespace).filter(|w| !w.is_empty());
    let keyword = words.next()?;
    let is_number =
        |w: &[u8]| w.iter().any(u8::is_ascii_digit) && w.iter().all(|b| b"0123456789+-.eE/".contains(b));
    match keyword {
        b"v" | b"vt" | b"vn" | b"f" => Some(words.next().is_some_and(is_number)),
        b"mtllib" | b"usemtl" => Some(true),
        b"o" | b"g" | b"s" | b"l" | b"p" | b"vp" => Some(false),
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn by_content(text: &str) -> Option<Format> {
        sniff(text.as_bytes(), None)
    }

    #[test]
    fn content_names_the_format() {
        assert_eq!(by_content("# hello\nmtllib a.mtl\nv 1 2 3\n"), Some(Format::Obj));
        for header in [
            "OFF",
            "COFF",
            "NOFF",
            "CNOFF",
            "STOFF",
            "STCN4nOFF",
            "4OFF",
            "# c\n\nOFF # header",
            "OFF 8 12 0",
        ] {
            assert_eq!(by_content(&format!("{header}\n3 1 0\n")), Some(Format::Off), "{header}");
        }
        assert_eq!(by_content("ply\nformat ascii 1.0\n"), Some(Format::Ply));
        assert_eq!(by_content("ply\r\nformat ascii 1.0\r\n"), Some(Format::Ply));
        assert_eq!(by_content("solid x\n facet normal 0 0 1\n"), Some(Format::Stl));
        assert_eq!(by_content("\u{feff}{ \"asset\": {} }"), Some(Format::Gltf));
        assert_eq!(by_content("glTF\u{2}\0\0\0"), Some(Format::Glb));
    }

    #[test]
    fn prose_has_no_format_whatever_its_name() {
        let prose = "Dear colleague,\nplease find the mesh attached.\n";
        assert_eq!(by_content(prose), None);
        for hint in Format::ALL {
            assert_eq!(sniff(prose.as_bytes(), Some(hint)), None, "{hint:?}");
        }
        assert_eq!(by_content("solid advice is rare\n"), None);
        assert_eq!(by_content("SHOFF\n1 2 3\n"), None);
    }

    #[test]
    fn the_hint_decides_what_content_leaves_open() {
        assert_eq!(sniff(b"# nothing here\n", Some(Format::Obj)), Some(Format::Obj));
        assert_eq!(sniff(b"8 12 0\n0 0 0\n", Some(Format::Off)), Some(Format::Off));
        assert_eq!(sniff(b"v 1 2 3\nf 1 1 1\n", Some(Format::Off)), Some(Format::Obj));
        assert_eq!(sniff(b"\0\x01garbage", Some(Format::Glb)), Some(Format::Glb));
        assert_eq!(sniff(b"\0\x01garbage", None), None);
    }

    #[test]
    fn a_binary_stl_may_begin_with_solid() {
        let mut stl = b"solid facet ".to_vec();
        stl.resize(80, b' ');
        stl.extend(1u32.to_le_bytes());
        stl.resize(84 + 50, 0);
        assert_eq!(sniff(&stl, Some(Format::Obj)), Some(Format::Stl));
        assert!(is_binary_stl(&stl));
        assert!(!is_binary_stl(&stl[..133]));
    }

    #[test]
    fn endings_are_hints() {
        assert_eq!(hint_of(Path::new("a.OBJ")), Some(Format::Obj));
        assert_eq!(hint_of(Path::new("a.ply.gz")), Some(Format::Ply));
        assert_eq!(hint_of(Path::new("a.gz")), None);
        assert_eq!(hint_of(Path::new("a")), None);
    }
}
