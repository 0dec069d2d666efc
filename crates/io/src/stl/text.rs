//! STL as text: `facet`, `outer loop`, three times `vertex x y z`, `endloop`, `endfacet`.

use super::soup::Soup;
use crate::error::{ReadError, Warning};
use crate::excerpt::excerpt_of_bytes;
use crate::numbers::parse_non_number;

/// Reads all solids of a text. Keywords may be in any case, normals may be missing.
pub(super) fn read(bytes: &[u8]) -> Result<Soup, ReadError> {
    let mut soup = Soup::with_capacity(0);
    let mut words = Words { bytes, at: if bytes.starts_with(b"\xef\xbb\xbf") { 3 } else { 0 } };
    let mut facet: Vec<u32> = Vec::new();
    // State: inside a solid, inside a loop.
    let (mut solid_open, mut loop_open) = (false, false);
    while let Some(word) = words.next() {
        let keyword = match Keyword::of(word) {
            Some(Keyword::End) => Some(words.end_of()),
            other => other,
        };
        match keyword {
            Some(Keyword::Solid) => {
                words.skip_line();
                soup.solids += 1;
                solid_open = true;
            }
            Some(Keyword::EndSolid) => {
                words.skip_line();
                solid_open = false;
            }
            Some(Keyword::Normal) => {
                // Zero to three words, which are ignored: the positions define the normal, and programs write what is
                // no number for facets without area.
                for _ in 0..3 {
                    let before = words.at;
                    if words.next().is_none_or(|w| Keyword::of(w).is_some()) {
                        words.at = before;
                        break;
                    }
                }
            }
            Some(Keyword::Outer) => {
                loop_open = true;
                facet.clear();
            }
            Some(Keyword::Vertex) => {
                let mut position = [0f32; 3];
                for x in &mut position {
                    let Some(word) = words.next() else {
                        return Err(words.error("the file ends within a vertex: it is cut off"));
                    };
                    *x = number(word).ok_or_else(|| {
                        words.error(format!("`{}` is not a coordinate", excerpt_of_bytes(word)))
                    })?;
                }
                facet.push(soup.corner(position));
            }
            Some(Keyword::EndLoop) => {
                if facet.len() < 3 {
                    return Err(
                        words.error(format!("the facet has {} corners; three are needed", facet.len()))
                    );
                }
                // Some programs write polygons as one loop; those seen so far are convex.
                for k in 1..facet.len() - 1 {
                    soup.triangles.push([facet[0], facet[k], facet[k + 1]]);
                }
                facet.clear();
                loop_open = false;
            }
            Some(Keyword::Facet | Keyword::Loop | Keyword::End | Keyword::Other) => {}
            None => {
                return Err(words.error(format!("`{}` is not an STL keyword", excerpt_of_bytes(word))));
            }
        }
    }
    if loop_open || !facet.is_empty() {
        return Err(words.error("the file ends within a facet: it is cut off"));
    }
    if solid_open {
        soup.warnings.push(Warning::note("the last solid has no end: the file may be cut off"));
    }
    Ok(soup)
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Keyword {
    Solid,
    EndSolid,
    Facet,
    Normal,
    Outer,
    Loop,
    Vertex,
    EndLoop,
    /// The first half of `end loop`, `end facet` and `end solid`.
    End,
    /// Keywords without effect.
    Other,
}

impl Keyword {
    const NAMES: [(&'static str, Self); 10] = [
        ("vertex", Self::Vertex),
        ("facet", Self::Facet),
        ("normal", Self::Normal),
        ("outer", Self::Outer),
        ("loop", Self::Loop),
        ("endloop", Self::EndLoop),
        ("endfacet", Self::Other),
        ("solid", Self::Solid),
        ("endsolid", Self::EndSolid),
        ("end", Self::End),
    ];

    fn of(word: &[u8]) -> Option<Self> {
        let found = Self::NAMES.iter().find(|(name, _)| word.eq_ignore_ascii_case(name.as_bytes()));
        found.map(|(_, keyword)| *keyword)
    }
}

fn number(word: &[u8]) -> Option<f32> {
    let plain = std::str::from_utf8(word).ok().and_then(|text| text.parse().ok());
    plain.or_else(|| parse_non_number(word).map(|x| x as f32))
}

/// An iterator over words separated by blanks, which tracks its position.
struct Words<'a> {
    bytes: &'a [u8],
    at: usize,
}

impl<'a> Words<'a> {
    #[inline]
    fn next(&mut self) -> Option<&'a [u8]> {
        let rest = &self.bytes[self.at..];
        let from = rest.iter().position(|b| !b.is_ascii_whitespace())?;
        let rest = &rest[from..];
        let length = rest.iter().position(u8::is_ascii_whitespace).unwrap_or(rest.len());
        self.at += from + length;
        Some(&rest[..length])
    }

    /// Returns what ends after a word `end`; takes the next word with it if it is on the same line.
    #[cold]
    fn end_of(&mut self) -> Keyword {
        let before = self.at;
        let next = self.next().filter(|_| !self.bytes[before..self.at].contains(&b'\n'));
        match next.and_then(Keyword::of) {
            Some(Keyword::Solid) => Keyword::EndSolid,
            Some(Keyword::Facet) => Keyword::Other,
            Some(Keyword::Loop) => Keyword::EndLoop,
            _ => {
                self.at = before;
                Keyword::Other
            }
        }
    }

    fn skip_line(&mut self) {
        let rest = &self.bytes[self.at..];
        self.at += rest.iter().position(|&b| b == b'\n' || b == b'\r').unwrap_or(rest.len());
    }

    /// Creates an error about the previous word.
    fn error(&self, problem: impl Into<String>) -> ReadError {
        let before = &self.bytes[..self.at];
        let ends = before.iter().filter(|&&b| b == b'\n').count();
        ReadError::line(1 + ends, problem)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn faces(text: &str) -> Result<usize, String> {
        read(text.as_bytes()).map(|s| s.triangles.len()).map_err(|e| e.to_string())
    }

    #[test]
    fn solids_in_any_case_without_normals() {
        let text = "SOLID one facet\r\n  FACET NORMAL\r\n OUTER LOOP\r\n VERTEX 0 0 0\r\n Vertex 1.0E+0 0 0\r\n\
            vertex 0 1e0 0\r\nENDLOOP\r\nENDFACET\r\nENDSOLID one\r\nsolid\nfacet normal 0 0 1 outer loop \
            vertex 0 0 0 vertex 1 0 0 vertex 1 1 0 vertex 0 1 0 endloop endfacet\nendsolid\n";
        let got = read(text.as_bytes()).unwrap();
        assert_eq!((got.solids, got.triangles.len(), got.warnings.len()), (2, 3, 0));
        assert_eq!(got.corners.into_keys().len(), 4);
    }

    #[test]
    fn ends_may_be_two_words_and_normals_no_numbers() {
        let facet = |normal: &str| {
            format!(
                "facet normal {normal}\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nvertex 0 1 0\nend loop\nend facet\n"
            )
        };
        for normal in
            ["-nan(ind) -nan(ind) -nan(ind)", "1.#QNAN 1.#QNAN 1.#QNAN", "-1.#IND 0 0", "0,5 0 1", "nan"]
        {
            let text = format!(
                "solid a\n{}{}end solid a facet\nsolid b\n{0}end solid",
                facet(normal),
                facet("0 0 1")
            );
            let got = read(text.as_bytes()).unwrap();
            assert_eq!((got.solids, got.triangles.len(), got.warnings.len()), (2, 3, 0), "{normal}");
        }
        assert_eq!(
            faces("solid\nfacet normal x y z hello"),
            Err("line 2: `hello` is not an STL keyword".into())
        );
    }

    #[test]
    fn errors_name_the_line() {
        let start = "solid\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\n";
        assert_eq!(faces(&format!("{start}vertex 1 x 0")), Err("line 5: `x` is not a coordinate".into()));
        assert_eq!(
            faces(&format!("{start}vertex 1")),
            Err("line 5: the file ends within a vertex: it is cut off".into())
        );
        assert_eq!(faces(start), Err("line 4: the file ends within a facet: it is cut off".into()));
        assert_eq!(
            faces(&format!("{start}endloop")),
            Err("line 5: the facet has 1 corners; three are needed".into())
        );
        assert_eq!(faces("solid\nhello"), Err("line 2: `hello` is not an STL keyword".into()));
    }
}
