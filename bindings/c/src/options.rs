//! `lodsmith_options`, and its conversion.

use std::ffi::c_char;

use lodsmith::options::by_name::{self, OptionValue};
use lodsmith::{
    AttributeWeights, BorderPolicy, Bound, Effort, Fit, Guards, Length, Measure, MethodKind, OwnedMeshData,
    Placement, Preset, SimplifyOptions, Stop, Texture, Textures, TopologyPolicy,
};
use lodsmith_core::{Image, RegionId};

use crate::fault::{Fault, LODSMITH_ERROR_OPTION, code, guarded};
use crate::memory::{self, CStructure};

/// A length that is not set.
pub const LODSMITH_UNIT_NONE: i32 = 0;
/// A length in the units of the positions.
pub const LODSMITH_UNIT_MESH: i32 = 1;
/// A length as a fraction of the diagonal of the bounding box.
pub const LODSMITH_UNIT_DIAGONAL: i32 = 2;

/// Edge collapse by the tensors of the current star, and a final fit: the default.
pub const LODSMITH_METHOD_MEMORYLESS: i32 = 0;
/// Edge collapse by accumulated quadrics.
pub const LODSMITH_METHOD_QUADRIC: i32 = 1;
/// Edge collapse that preserves volume and borders.
pub const LODSMITH_METHOD_LINDSTROM_TURK: i32 = 2;
/// Half-edge collapse by length times curvature.
pub const LODSMITH_METHOD_MELAX: i32 = 3;
/// Edge collapse in order of edge length.
pub const LODSMITH_METHOD_SHORTEST_EDGE: i32 = 4;
/// Vertex clustering: one vertex for each cell of a grid.
pub const LODSMITH_METHOD_CLUSTER: i32 = 5;
/// Removal of vertices; the holes are retriangulated.
pub const LODSMITH_METHOD_VERTEX_REMOVAL: i32 = 6;
/// Coplanar regions with as few triangles as their outlines need.
pub const LODSMITH_METHOD_PLANAR: i32 = 7;
/// Reversal of 4:1 subdivision.
pub const LODSMITH_METHOD_UNSUBDIVIDE: i32 = 8;
/// A new mesh on the same surface.
pub const LODSMITH_METHOD_REMESH: i32 = 9;

/// The final fit is used where it helps.
pub const LODSMITH_FIT_AUTO: i32 = 0;
/// The final fit is always used.
pub const LODSMITH_FIT_ON: i32 = 1;
/// The final fit is never used.
pub const LODSMITH_FIT_OFF: i32 = 2;
/// One run.
pub const LODSMITH_EFFORT_DEFAULT: i32 = 0;
/// Several runs to the same count, for a smaller largest distance.
pub const LODSMITH_EFFORT_BEST: i32 = 1;
/// `LODSMITH_EFFORT_BEST` for small meshes: the effort of the presets for parts and prints.
pub const LODSMITH_EFFORT_AUTO: i32 = 2;

/// Merged vertices lie at the point of least cost.
pub const LODSMITH_PLACEMENT_OPTIMAL: i32 = 0;
/// Merged vertices lie at the better end of the edge: the vertices of the result are vertices of the input.
pub const LODSMITH_PLACEMENT_ENDPOINT: i32 = 1;
/// Merged vertices lie at the midpoint of the edge.
pub const LODSMITH_PLACEMENT_MIDPOINT: i32 = 2;

/// Borders are held in place by their cost.
pub const LODSMITH_BORDER_KEEP: i32 = 0;
/// Border vertices move along the border only.
pub const LODSMITH_BORDER_SLIDE: i32 = 1;
/// Border vertices do not change.
pub const LODSMITH_BORDER_LOCK: i32 = 2;
/// Borders are not considered.
pub const LODSMITH_BORDER_FREE: i32 = 3;

/// Handles are cut and parts removed only if the target cannot be met otherwise, or only with a much larger error.
pub const LODSMITH_TOPOLOGY_RELAXED: i32 = 0;
/// Holes, handles and parts are kept.
pub const LODSMITH_TOPOLOGY_PRESERVE: i32 = 1;
/// Handles are cut and parts removed wherever that is cheapest.
pub const LODSMITH_TOPOLOGY_FREE: i32 = 2;

/// With a stop at an error, the bound is guaranteed in both directions; otherwise not at all.
pub const LODSMITH_BOUND_AUTO: i32 = 0;
/// No bound is guaranteed.
pub const LODSMITH_BOUND_ESTIMATE: i32 = 1;
/// No point of the result is farther from the input than the bound.
pub const LODSMITH_BOUND_ONE_SIDED: i32 = 2;
/// No point of either mesh is farther from the other mesh than the bound.
pub const LODSMITH_BOUND_TWO_SIDED: i32 = 3;

/// The result is measured if there is a stop at an error or a guaranteed bound.
pub const LODSMITH_MEASURE_AUTO: i32 = 0;
/// The result is always measured.
pub const LODSMITH_MEASURE_ALWAYS: i32 = 1;

/// All options at their defaults.
pub const LODSMITH_PRESET_AUTO: i32 = 0;
/// Noisy scans.
pub const LODSMITH_PRESET_SCAN: i32 = 1;
/// Machine parts.
pub const LODSMITH_PRESET_CAD: i32 = 2;
/// For display: more weight on normals.
pub const LODSMITH_PRESET_VISUAL: i32 = 3;
/// For 3D printing.
pub const LODSMITH_PRESET_PRINT: i32 = 4;

/// A length with its unit; `LODSMITH_UNIT_NONE` if it is not set.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct LodsmithLength {
    /// The number.
    pub value: f64,
    /// One of `LODSMITH_UNIT_...`.
    pub unit: i32,
}

/// A base-colour image. Rows from the top, four bytes for each pixel: red, green, blue, alpha.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct LodsmithTexture {
    /// `width * height` pixels; null for a region without an image.
    pub pixels: *const u8,
    /// Pixels in a row.
    pub width: usize,
    /// Number of rows.
    pub height: usize,
}

/// Options of `lodsmith_simplify`. Initialise them with `lodsmith_options_init`, then change fields.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct LodsmithOptions {
    /// `sizeof(lodsmith_options)` of the caller's header.
    pub size: usize,
    /// Stop at this number of triangles; 0 if not set. If several stops are set, the first one met ends the run.
    pub target_faces: usize,
    /// Stop at this number of vertices (positions); 0 if not set.
    pub target_vertices: usize,
    /// Stop at this fraction of the triangles, up to 1; 0 if not set.
    pub target_ratio: f64,
    /// Stop before the measured distance exceeds this, in the sense of `bound`.
    pub target_error: LodsmithLength,
    /// One of `LODSMITH_METHOD_...`.
    pub method: i32,
    /// One of `LODSMITH_FIT_...`.
    pub fit: i32,
    /// One of `LODSMITH_PLACEMENT_...`.
    pub placement: i32,
    /// One of `LODSMITH_BORDER_...`.
    pub border: i32,
    /// One of `LODSMITH_TOPOLOGY_...`.
    pub topology: i32,
    /// One of `LODSMITH_BOUND_...`.
    pub bound: i32,
    /// One of `LODSMITH_MEASURE_...`.
    pub measure: i32,
    /// Not 0: try pairs and looser topology policies if the target is not reached.
    pub escalate: i32,
    /// Not 0: use the normals of the shape in the cost if the mesh has no normals.
    pub shape_normals: i32,
    /// Methods memoryless, quadric: vertices closer than this that share no edge are contracted too.
    pub pairs: LodsmithLength,
    /// Method cluster: edge length of a cell.
    pub cell: LodsmithLength,
    /// Method cluster: not 0 to continue with edge collapses.
    pub two_stage: i32,
    /// Method remesh: not 0 for shorter edges where the surface is curved.
    pub adaptive: i32,
    /// Methods shortest edge, remesh: edge length.
    pub edge_length: LodsmithLength,
    /// Methods planar, vertex removal, remesh: largest angle in degrees; negative if not set.
    pub angle_deg: f64,
    /// Method planar: largest distance from the plane of a region.
    pub flat: LodsmithLength,
    /// Method unsubdivide: number of levels; method remesh: number of iterations; 0 if not set.
    pub iterations: usize,
    /// Method remesh: edge length of a voxel.
    pub voxel: LodsmithLength,
    /// Method remesh: number of subdivisions of a semi-regular mesh; 0 if not set.
    pub subdivisions: usize,
    /// Largest rotation of a face normal in degrees; 0 for no limit.
    pub max_normal_deg: f64,
    /// Minimum quality of a new face, up to 1; 0 for no limit.
    pub min_quality: f64,
    /// Largest number of edges at a vertex; 0 for no limit.
    pub max_valence: usize,
    /// Largest length of an edge.
    pub max_edge: LodsmithLength,
    /// Edges with a larger dihedral angle in degrees are features; 0 for no features.
    pub sharp_deg: f64,
    /// Weight of normals; 1 is the default, 0 ignores them.
    pub weight_normal: f64,
    /// Weight of texture coordinates.
    pub weight_uv: f64,
    /// Weight of colours.
    pub weight_color: f64,
    /// Weight of morph targets.
    pub weight_morph: f64,
    /// Weight of skins.
    pub weight_skin: f64,
    /// Weight of all other attributes.
    pub weight_other: f64,
    /// Weight of open borders.
    pub weight_border: f64,
    /// Vertices closer than this are merged first.
    pub weld: LodsmithLength,
    /// Parts with a smaller bounding box are removed first.
    pub prune: LodsmithLength,
    /// Class of each region of the mesh, given by the first region of the class; null if each region is its own class.
    pub region_classes: *const u32,
    /// Number of `region_classes`.
    pub region_class_count: usize,
    /// Base-colour image of each region; null for none.
    pub textures: *const LodsmithTexture,
    /// Number of `textures`.
    pub texture_count: usize,
    /// Seed of all random choices.
    pub seed: u64,
    /// Options by name, as the command has them, with a field or without: `name=value`, or the name of a flag,
    /// separated by blanks, such as `max-edge=2% per-mesh`. They count more than fields. Null for none.
    pub named: *const c_char,
    /// One of `LODSMITH_EFFORT_...`.
    pub effort: i32,
}

// SAFETY: `repr(C)`, all fields are numbers and pointers, and the first is a `usize`.
unsafe impl CStructure for LodsmithOptions {
    const NAME: &'static str = "lodsmith_options";
}

impl Default for LodsmithOptions {
    fn default() -> Self {
        of_options(&SimplifyOptions::default())
    }
}

fn of_length(length: Option<Length>) -> LodsmithLength {
    match length {
        None => LodsmithLength::default(),
        Some(Length::Units(value)) => LodsmithLength { value, unit: LODSMITH_UNIT_MESH },
        Some(Length::OfDiagonal(value)) => LodsmithLength { value, unit: LODSMITH_UNIT_DIAGONAL },
    }
}

/// Returns the constant of a choice in C: its index in the list of all choices.
fn number<T: PartialEq>(all: &[T], choice: &T) -> i32 {
    all.iter().position(|x| x == choice).unwrap_or(0) as i32
}

const MEASURES: [Measure; 2] = [Measure::Auto, Measure::Always];

/// Converts options to C. (Lists are left out.)
fn of_options(o: &SimplifyOptions) -> LodsmithOptions {
    let (guards, w) = (&o.guards, &o.weights);
    let value = |name: &str| by_name::find(name).and_then(|option| option.get(o));
    let length = |name: &str| match value(name) {
        Some(OptionValue::Length(length)) => of_length(Some(length)),
        _ => of_length(None),
    };
    let count = |name: &str| match value(name) {
        Some(OptionValue::Whole(n)) => n as usize,
        _ => 0,
    };
    LodsmithOptions {
        size: size_of::<LodsmithOptions>(),
        target_faces: o.stop.faces.unwrap_or(0),
        target_vertices: o.stop.vertices.unwrap_or(0),
        target_ratio: o.stop.ratio.unwrap_or(0.0),
        target_error: of_length(o.stop.error),
        method: number(&MethodKind::ALL, &o.method.kind()),
        fit: number(&Fit::ALL, &o.fit),
        placement: number(&Placement::ALL, &o.placement),
        border: number(&BorderPolicy::ALL, &o.border),
        topology: number(&TopologyPolicy::ALL, &o.topology),
        bound: number(&Bound::ALL, &o.bound),
        measure: number(&MEASURES, &o.measure),
        escalate: i32::from(o.escalate),
        shape_normals: i32::from(o.shape_normals),
        pairs: length("pairs"),
        cell: length("cell"),
        two_stage: i32::from(value("two-stage").is_some()),
        adaptive: i32::from(value("adaptive").is_some()),
        edge_length: length("edge-length"),
        angle_deg: match value("angle") {
            Some(OptionValue::Number(deg)) => deg,
            _ => -1.0,
        },
        flat: length("flat"),
        iterations: count("iterations"),
        voxel: length("voxel"),
        subdivisions: count("subdivisions"),
        max_normal_deg: guards.max_normal_deg.unwrap_or(0.0),
        min_quality: guards.min_quality.unwrap_or(0.0),
        max_valence: guards.max_valence.unwrap_or(0),
        max_edge: of_length(guards.max_edge),
        sharp_deg: o.sharp_deg.unwrap_or(0.0),
        weight_normal: w.normal,
        weight_uv: w.uv,
        weight_color: w.color,
        weight_morph: w.morph,
        weight_skin: w.skin,
        weight_other: w.other,
        weight_border: w.border,
        weld: of_length(o.weld),
        prune: of_length(o.prune),
        region_classes: std::ptr::null(),
        region_class_count: 0,
        textures: std::ptr::null(),
        texture_count: 0,
        seed: o.seed,
        named: std::ptr::null(),
        effort: number(&Effort::ALL, &o.effort),
    }
}

/// Sets an option by name.
fn set(options: &mut SimplifyOptions, name: &str, value: &OptionValue<'_>) -> Result<(), Fault> {
    by_name::set(options, name, value)
        .map_err(|error| Fault { code: LODSMITH_ERROR_OPTION, text: error.to_string() })
}

fn bad(name: &str, got: i32) -> Fault {
    Fault { code: LODSMITH_ERROR_OPTION, text: format!("{name} has no value {got}") }
}

fn choice<T: Copy>(all: &[T], name: &str, got: i32) -> Result<T, Fault> {
    usize::try_from(got).ok().and_then(|i| all.get(i)).copied().ok_or_else(|| bad(name, got))
}

impl LodsmithLength {
    fn get(self, name: &str) -> Result<Option<Length>, Fault> {
        match self.unit {
            LODSMITH_UNIT_NONE => Ok(None),
            LODSMITH_UNIT_MESH => Ok(Some(Length::Units(self.value))),
            LODSMITH_UNIT_DIAGONAL => Ok(Some(Length::OfDiagonal(self.value))),
            unit => Err(bad(&format!("the unit of {name}"), unit)),
        }
    }
}

/// Returns a number unless it is 0.
fn unless_zero<T: PartialEq + Default>(x: T) -> Option<T> {
    (x != T::default()).then_some(x)
}

impl LodsmithOptions {
    /// Returns the options of the library.
    ///
    /// # Safety
    /// The lists must have their lengths, and the text must end with a zero byte.
    pub(crate) unsafe fn get(&self) -> Result<SimplifyOptions, Fault> {
        let mut o = SimplifyOptions::new(Stop {
            faces: unless_zero(self.target_faces),
            vertices: unless_zero(self.target_vertices),
            ratio: unless_zero(self.target_ratio),
            error: self.target_error.get("target_error")?,
        });
        o.method = choice(&MethodKind::ALL, "method", self.method)?.into();
        self.set_options_of_method(&mut o)?;
        o.fit = choice(&Fit::ALL, "fit", self.fit)?;
        o.effort = choice(&Effort::ALL, "effort", self.effort)?;
        o.placement = choice(&Placement::ALL, "placement", self.placement)?;
        o.border = choice(&BorderPolicy::ALL, "border", self.border)?;
        o.topology = choice(&TopologyPolicy::ALL, "topology", self.topology)?;
        o.bound = choice(&Bound::ALL, "bound", self.bound)?;
        o.measure = choice(&MEASURES, "measure", self.measure)?;
        o.escalate = self.escalate != 0;
        o.shape_normals = self.shape_normals != 0;
        o.guards = Guards {
            max_normal_deg: unless_zero(self.max_normal_deg),
            min_quality: unless_zero(self.min_quality),
            max_valence: unless_zero(self.max_valence),
            max_edge: self.max_edge.get("max_edge")?,
        };
        o.sharp_deg = unless_zero(self.sharp_deg);
        o.weights = AttributeWeights {
            normal: self.weight_normal,
            uv: self.weight_uv,
            color: self.weight_color,
            morph: self.weight_morph,
            skin: self.weight_skin,
            other: self.weight_other,
            border: self.weight_border,
        };
        o.weld = self.weld.get("weld")?;
        o.prune = self.prune.get("prune")?;
        o.seed = self.seed;
        if !self.named.is_null() {
            // SAFETY: promised by the caller.
            let named = unsafe { memory::text("named", self.named) }?;
            for pair in named.split_whitespace() {
                let (name, value) = pair.split_once('=').unwrap_or((pair, "true"));
                set(&mut o, name, &value.into())?;
            }
        }
        Ok(o)
    }

    /// Returns the region classes and textures in the options.
    ///
    /// # Safety
    /// The lists must have their lengths, and each image its pixels.
    pub(crate) unsafe fn data(&self) -> Result<OwnedMeshData, Fault> {
        let mut data = OwnedMeshData::default();
        // SAFETY: promised by the caller.
        unsafe {
            let classes = memory::numbers("region_classes", self.region_classes, self.region_class_count)?;
            data.region_classes = (!classes.is_empty()).then(|| classes.into_iter().map(RegionId).collect());
            data.textures = self.textures()?;
        }
        Ok(data)
    }

    /// Sets the options of the method; options of other methods are an error.
    fn set_options_of_method(&self, o: &mut SimplifyOptions) -> Result<(), Fault> {
        let length = |of: LodsmithLength, name| Ok::<_, Fault>(of.get(name)?.map(OptionValue::Length));
        let count = |n: usize| unless_zero(n).map(|n| OptionValue::Whole(n as u64));
        let flag = |is_on: i32| (is_on != 0).then_some(OptionValue::Flag(true));
        let given = [
            ("pairs", length(self.pairs, "pairs")?),
            ("cell", length(self.cell, "cell")?),
            ("two-stage", flag(self.two_stage)),
            ("edge-length", length(self.edge_length, "edge_length")?),
            // (NaN is reported as out of range.)
            ("angle", if self.angle_deg < 0.0 { None } else { Some(OptionValue::Number(self.angle_deg)) }),
            ("flat", length(self.flat, "flat")?),
            ("iterations", count(self.iterations)),
            ("voxel", length(self.voxel, "voxel")?),
            ("subdivisions", count(self.subdivisions)),
            ("adaptive", flag(self.adaptive)),
        ];
        given
            .into_iter()
            .filter_map(|(name, value)| Some((name, value?)))
            .try_for_each(|(name, value)| set(o, name, &value))
    }

    /// Copies the images.
    ///
    /// # Safety
    /// The list must have its length, and each image its pixels.
    unsafe fn textures(&self) -> Result<Option<Textures>, Fault> {
        if self.texture_count == 0 {
            return Ok(None);
        }
        if self.textures.is_null() {
            return Err(Fault::argument("textures is null"));
        }
        let mut regions = Vec::new();
        for i in 0..self.texture_count {
            // SAFETY: the caller promises `texture_count` structures.
            let LodsmithTexture { pixels, width, height } = unsafe { self.textures.add(i).read_unaligned() };
            if pixels.is_null() {
                regions.push(None);
                continue;
            }
            let count = width.checked_mul(height).and_then(|count| count.checked_mul(4));
            let count = count.ok_or_else(|| Fault::argument("a texture does not fit into memory"))?;
            // SAFETY: the caller promises four bytes for each pixel.
            let bytes = unsafe { memory::numbers("pixels", pixels, count) }?;
            let image = Image::new(width, height, bytes.as_chunks::<4>().0.to_vec());
            regions.push(Some(Texture::new(image)));
        }
        Ok(Some(Textures::of_regions(regions)))
    }
}

/// Initialises options with the defaults and without a target. `size` is `sizeof(lodsmith_options)`.
///
/// # Safety
/// `options` must have room for `size` bytes.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn lodsmith_options_init(options: *mut LodsmithOptions, size: usize) -> i32 {
    // SAFETY: promised by the caller.
    unsafe { lodsmith_options_init_preset(options, size, LODSMITH_PRESET_AUTO) }
}

/// Initialises options with a preset, one of `LODSMITH_PRESET_...`, and without a target. `size` is
/// `sizeof(lodsmith_options)`.
///
/// # Safety
/// `options` must have room for `size` bytes.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn lodsmith_options_init_preset(
    options: *mut LodsmithOptions,
    size: usize,
    preset: i32,
) -> i32 {
    code(&guarded(|| {
        if options.is_null() {
            return Err(Fault::argument("lodsmith_options is null"));
        }
        if size < size_of::<usize>() {
            return Err(Fault::argument("the size of lodsmith_options is too small"));
        }
        let preset = choice(&Preset::ALL, "preset", preset)?;
        let of_preset = of_options(&SimplifyOptions::preset(preset, Stop::default()));
        // SAFETY: the caller promises `size` bytes, of which the size itself is the first field.
        unsafe {
            options.cast::<usize>().write_unaligned(size);
            memory::set_sized(options, &of_preset)
        }
    }))
}

#[cfg(test)]
mod tests {
    use lodsmith::{Method, Remesh, RemeshPattern};

    use super::*;

    #[test]
    fn defaults_and_presets_survive_a_round_trip() {
        for preset in Preset::ALL {
            let of_preset = SimplifyOptions::preset(preset, Stop::default());
            // SAFETY: there are no lists.
            assert_eq!(unsafe { of_options(&of_preset).get() }, Ok(of_preset));
        }
    }

    #[test]
    fn every_field_is_converted() {
        let mut o = SimplifyOptions::new(Stop {
            faces: Some(1),
            vertices: Some(2),
            ratio: Some(0.5),
            error: Some(Length::Units(3.0)),
        });
        (o.fit, o.effort, o.placement) = (Fit::Off, Effort::Best, Placement::Midpoint);
        (o.border, o.topology) = (BorderPolicy::Free, TopologyPolicy::Free);
        (o.bound, o.measure) = (Bound::TwoSided, Measure::Always);
        (o.escalate, o.shape_normals, o.seed) = (true, true, 9);
        o.guards = Guards {
            max_normal_deg: Some(10.0),
            min_quality: Some(0.11),
            max_valence: Some(12),
            max_edge: Some(Length::Units(13.0)),
        };
        o.sharp_deg = Some(14.0);
        o.weights = AttributeWeights {
            normal: 0.15,
            uv: 0.16,
            color: 0.17,
            morph: 0.18,
            skin: 0.19,
            other: 0.2,
            border: 0.21,
        };
        (o.weld, o.prune) = (Some(Length::Units(22.0)), Some(Length::OfDiagonal(0.23)));
        let length = Some(Length::OfDiagonal(0.1));
        let remesh = |edge_length, crease_deg, rounds, pattern| {
            Method::Remesh(Remesh::OnSurface { edge_length, crease_deg, rounds, pattern })
        };
        for method in [
            Method::Memoryless { pairs: length },
            Method::Quadric { pairs: length },
            Method::ShortestEdge { edge_length: length },
            Method::Cluster { cell: length, two_stage: true },
            Method::VertexRemoval { crease_deg: Some(6.0) },
            Method::Planar { angle_deg: Some(6.0), flat: length },
            Method::Unsubdivide { levels: Some(7) },
            remesh(length, Some(6.0), Some(7), RemeshPattern::Adaptive),
            remesh(None, None, None, RemeshPattern::SemiRegular { subdivisions: 8 }),
            Method::Remesh(Remesh::Voxels { size: Length::Units(0.5) }),
        ] {
            o.method = method;
            // SAFETY: there are no lists.
            assert_eq!(unsafe { of_options(&o).get() }, Ok(o.clone()));
        }
    }

    #[test]
    fn an_option_of_another_method_is_an_error() {
        let options = LodsmithOptions { two_stage: 1, ..LodsmithOptions::default() };
        // SAFETY: there are no lists.
        let error = unsafe { options.get() }.unwrap_err();
        assert_eq!(error.text, "two-stage is not an option of method memoryless, but of cluster");
    }

    #[test]
    fn every_option_can_be_set_by_name() {
        let named = |text: &std::ffi::CStr| {
            let options =
                LodsmithOptions { named: text.as_ptr(), target_faces: 9, ..LodsmithOptions::default() };
            // SAFETY: there are no lists, and the text ends with a zero byte.
            unsafe { options.get() }
        };
        let o = named(c"max-edge=2% per_mesh  faces=7 weight=uv=2,skin=3").unwrap();
        assert_eq!((o.stop.faces, o.per_mesh), (Some(7), true));
        assert_eq!((o.guards.max_edge, o.weights.skin), (Some(Length::OfDiagonal(0.02)), 3.0));
        assert!(named(c"rato=2").unwrap_err().text.contains("a similar one is ratio"));
        assert!(named(c"ratio=2").unwrap_err().text.starts_with("ratio: "));
    }

    #[test]
    fn a_smaller_structure_is_from_an_older_header() {
        let mut room = LodsmithOptions { seed: 77, ..LodsmithOptions::default() };
        let size = std::mem::offset_of!(LodsmithOptions, seed);
        // SAFETY: the room is larger than the size.
        assert_eq!(unsafe { lodsmith_options_init(&raw mut room, size) }, 0);
        assert_eq!((room.size, room.seed), (size, 77), "nothing is written beyond its size");
        for size in [0, 4, size_of::<LodsmithOptions>() + 8] {
            // SAFETY: sizes that are too small or too large are refused.
            assert_ne!(unsafe { lodsmith_options_init(&raw mut room, size) }, 0, "{size}");
        }
    }

    #[test]
    fn numbers_of_choices_agree_with_the_constants() {
        let at = |i: i32| i as usize;
        assert_eq!(MethodKind::ALL[at(LODSMITH_METHOD_REMESH)], MethodKind::Remesh);
        assert_eq!(MethodKind::ALL[at(LODSMITH_METHOD_VERTEX_REMOVAL)], MethodKind::VertexRemoval);
        assert_eq!(Fit::ALL[at(LODSMITH_FIT_OFF)], Fit::Off);
        assert_eq!(Effort::ALL[at(LODSMITH_EFFORT_BEST)], Effort::Best);
        assert_eq!(Effort::ALL[at(LODSMITH_EFFORT_AUTO)], Effort::Auto);
        assert_eq!(Placement::ALL[at(LODSMITH_PLACEMENT_ENDPOINT)], Placement::Endpoint);
        assert_eq!(BorderPolicy::ALL[at(LODSMITH_BORDER_LOCK)], BorderPolicy::Lock);
        assert_eq!(TopologyPolicy::ALL[at(LODSMITH_TOPOLOGY_PRESERVE)], TopologyPolicy::Preserve);
        assert_eq!(Bound::ALL[at(LODSMITH_BOUND_ONE_SIDED)], Bound::OneSided);
        assert_eq!(Preset::ALL[at(LODSMITH_PRESET_PRINT)], Preset::Print);
    }
}
