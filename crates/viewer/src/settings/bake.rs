//! Options of a bake as command-line words, for copying and for sessions.

#[cfg(feature = "window")]
use lodsmith_asset::Baking;
use lodsmith_bake::{AtlasMode, BakeOptions, MapKind};
use serde::{Deserialize, Serialize};

/// Maps that are baked for the result, and how.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(try_from = "Vec<String>", into = "Vec<String>")]
pub struct BakeSettings {
    /// The maps; only those that materials hold.
    pub maps: Vec<MapKind>,
    /// Width and height of the maps in texels; `None` chooses them by the detail of the original.
    pub size: Option<usize>,
    /// Texture coordinates.
    pub atlas: AtlasMode,
}

impl Default for BakeSettings {
    fn default() -> Self {
        Self { maps: vec![MapKind::Normal, MapKind::Color], size: None, atlas: AtlasMode::default() }
    }
}

impl BakeSettings {
    /// Returns the words of `lodsmith simplify` that bake these maps.
    pub fn words(&self) -> Vec<String> {
        let names: Vec<&str> = self.maps.iter().map(|kind| kind.name()).collect();
        let mut words = vec!["--bake".to_owned(), names.join(",")];
        if let Some(size) = self.size {
            words.extend(["--texture-size".to_owned(), size.to_string()]);
        }
        if self.atlas != AtlasMode::default() {
            words.extend(["--atlas".to_owned(), self.atlas.name().to_owned()]);
        }
        words
    }

    /// Parses command-line words.
    ///
    /// # Errors
    /// The unknown word, or the invalid value.
    pub fn parse(words: &[String]) -> Result<Self, String> {
        let mut done = Self { maps: Vec::new(), size: None, atlas: AtlasMode::default() };
        for pair in words.chunks(2) {
            let [option, value] = pair else { return Err(format!("{} needs a value", pair[0])) };
            let wrong = || format!("{option}: invalid value {value}");
            match option.as_str() {
                "--bake" => {
                    let kind = |name: &str| MapKind::ALL.into_iter().find(|kind| kind.name() == name);
                    let names = value.split(',').filter(|name| !name.is_empty());
                    let maps: Option<Vec<MapKind>> = names.map(kind).collect();
                    done.maps =
                        maps.filter(|all| all.iter().all(|k| k.is_of_material())).ok_or_else(wrong)?;
                }
                "--texture-size" => {
                    let size = value.parse().ok().filter(|size| BakeOptions::SIZES.contains(size));
                    done.size = Some(size.ok_or_else(wrong)?);
                }
                "--atlas" => {
                    let mode = AtlasMode::ALL.into_iter().find(|mode| mode.name() == value);
                    done.atlas = mode.ok_or_else(wrong)?;
                }
                _ => return Err(format!("{option}: unknown option")),
            }
        }
        Ok(done)
    }

    /// Returns the recipe for baking a result from its original.
    #[cfg(feature = "window")]
    pub(crate) fn baking(&self) -> Baking {
        let mut options = BakeOptions::new(self.maps.iter().copied());
        (options.size, options.atlas) = (self.size, self.atlas);
        Baking { options, map_files: false }
    }
}

impl From<BakeSettings> for Vec<String> {
    fn from(of: BakeSettings) -> Self {
        of.words()
    }
}

impl TryFrom<Vec<String>> for BakeSettings {
    type Error = String;

    fn try_from(words: Vec<String>) -> Result<Self, String> {
        Self::parse(&words)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn words_come_back_as_the_settings_that_they_were() {
        let all = BakeSettings {
            maps: vec![MapKind::Normal, MapKind::Occlusion],
            size: Some(512),
            atlas: AtlasMode::New,
        };
        let none = BakeSettings { maps: Vec::new(), ..BakeSettings::default() };
        for settings in [all, none, BakeSettings::default()] {
            assert_eq!(BakeSettings::parse(&settings.words()), Ok(settings));
        }
        let parse = |text: &str| {
            let words: Vec<_> = text.split(' ').map(str::to_owned).collect();
            BakeSettings::parse(&words).unwrap_err()
        };
        assert!(parse("--bake normal,shine").contains("shine"));
        assert!(parse("--bake height").contains("height"), "it has no place in a material");
        assert!(parse("--texture-size 7000000").contains("7000000"));
        assert!(parse("--atlas").contains("needs a value"));
        assert!(parse("--colour red").contains("unknown"));
    }
}
