// Lodsmith: simplification of triangle meshes.
//
// Three families of functions:
// - lodsmith_simplify_indices and two variants replace meshopt_simplify: they turn an index buffer into an index buffer
//   with vertices of the input.
// - lodsmith_simplify makes the closest mesh for the count, with new vertices, all attributes and a report.
// - lodsmith_run_file_job does jobs on whole files, like the command. The library can be built without it; then the
//   installed header defines LODSMITH_NO_FILES.
//
// Ownership: buffers belong to the caller and are read only during the call; results are copied into buffers of the
// caller. A lodsmith_result belongs to the caller until lodsmith_result_free, a lodsmith_text until lodsmith_text_free.
// Strides are in bytes. Buffers need not be aligned. Positions are in any unit.
// Errors: functions that return int32_t return LODSMITH_OK or an error code; other functions return 0 or null. The text
// of the error is in lodsmith_error_message. No error of input or options ends the program.
// Threads: all functions may be called by several threads at the same time, with different outputs.
// Structures with a field `size` may grow in later versions; set it to sizeof the structure.
//
// This file is generated: change bindings/c/src and run bindings/c/header.sh.


#ifndef LODSMITH_H
#define LODSMITH_H

#include <stddef.h>
#include <stdint.h>

// Defined if the library does jobs on files.
#if !defined(LODSMITH_NO_FILES)
#define LODSMITH_FILES 1
#endif

// Continue the run.
#define LODSMITH_CONTINUE 0

// End the run soon, with the best mesh so far.
#define LODSMITH_FINISH 1

// End the run soon, with `LODSMITH_ERROR_CANCELLED`.
#define LODSMITH_CANCEL 2

// Welding, ordering and building the connectivity.
#define LODSMITH_STAGE_PREPARE 0

// Collapsing edges, or the main stage of another method.
#define LODSMITH_STAGE_SIMPLIFY 1

// The final fit.
#define LODSMITH_STAGE_FIT 2

// Measuring the result.
#define LODSMITH_STAGE_MEASURE 3

// Reading the input. This and the following stages occur only in jobs on files.
#define LODSMITH_STAGE_READ 4

// Cleaning the meshes.
#define LODSMITH_STAGE_CLEAN 5

// Inspecting the meshes.
#define LODSMITH_STAGE_INSPECT 6

// Baking maps.
#define LODSMITH_STAGE_BAKE 7

// Writing the output.
#define LODSMITH_STAGE_WRITE 8

// The call succeeded.
#define LODSMITH_OK 0

// An argument is not valid: a null pointer, a stride that is too small, an index that is out of range.
#define LODSMITH_ERROR_ARGUMENT 1

// An option is unknown or out of range, or is incompatible with the method, with another option or with the file.
#define LODSMITH_ERROR_OPTION 2

// The mesh cannot be simplified or baked: no face has an area.
#define LODSMITH_ERROR_MESH 3

// The progress function cancelled the run.
#define LODSMITH_ERROR_CANCELLED 4

// An internal error of the library.
#define LODSMITH_ERROR_INTERNAL 5

// A file cannot be read or written.
#define LODSMITH_ERROR_FILE 6

// A limit on memory, sizes or time forbids the job.
#define LODSMITH_ERROR_LIMIT 7

// The job is done, but with losses or missed targets, which the option `strict` turns into errors.
#define LODSMITH_ERROR_STRICT 8

// Vertices on open borders are not moved or removed.
#define LODSMITH_SIMPLIFY_LOCK_BORDER 1

// Errors are relative to the extent of the used vertices, and the time does not depend on unused vertices.
#define LODSMITH_SIMPLIFY_SPARSE 2

// The error limit and the returned error are in the units of the positions.
#define LODSMITH_SIMPLIFY_ERROR_ABSOLUTE 4

// Whole parts are removed, and necks cut, where that is cheapest.
#define LODSMITH_SIMPLIFY_PRUNE 8

// Faces are more regular, at the cost of some accuracy.
#define LODSMITH_SIMPLIFY_REGULARIZE 16

// Vertices at the same position with different attributes may be merged, unless they are protected.
#define LODSMITH_SIMPLIFY_PERMISSIVE 32

// Faces are slightly more regular, at a small cost of accuracy.
#define LODSMITH_SIMPLIFY_REGULARIZE_LIGHT 64

// Accepted without effect: folds are always preserved.
#define LODSMITH_SIMPLIFY_PRESERVE_FOLDS 128

// Accepted without effect.
#define LODSMITH_SIMPLIFY_ERROR_CLAMPED 256

// The vertex keeps its position and its attributes.
#define LODSMITH_VERTEX_LOCK 1

// The discontinuity of attributes at the vertex is kept even with `LODSMITH_SIMPLIFY_PERMISSIVE`.
#define LODSMITH_VERTEX_PROTECT 2

// The vertex is more likely to be kept.
#define LODSMITH_VERTEX_PRIORITY 4

// Named values that are interpolated.
#define LODSMITH_ATTRIBUTE_CUSTOM 0

// Named whole numbers that are never interpolated; exact up to 16,777,216.
#define LODSMITH_ATTRIBUTE_DISCRETE 1

// Four values: a direction, and the sign of the bitangent.
#define LODSMITH_ATTRIBUTE_TANGENT 2

// Two values: texture coordinates of an additional set, from 1.
#define LODSMITH_ATTRIBUTE_UV 3

// Four values: colours of an additional set, from 1.
#define LODSMITH_ATTRIBUTE_COLOR 4

// Four values: joint indices of a skin.
#define LODSMITH_ATTRIBUTE_JOINTS 5

// Four values: weights of the joints of the same set.
#define LODSMITH_ATTRIBUTE_WEIGHTS 6

// Three values: offsets of positions of morph target `set`.
#define LODSMITH_ATTRIBUTE_MORPH_POSITION 7

// Three values: offsets of normals of morph target `set`.
#define LODSMITH_ATTRIBUTE_MORPH_NORMAL 8

// Three values: offsets of tangents of morph target `set`.
#define LODSMITH_ATTRIBUTE_MORPH_TANGENT 9

// A length that is not set.
#define LODSMITH_UNIT_NONE 0

// A length in the units of the positions.
#define LODSMITH_UNIT_MESH 1

// A length as a fraction of the diagonal of the bounding box.
#define LODSMITH_UNIT_DIAGONAL 2

// Edge collapse by the tensors of the current star, and a final fit: the default.
#define LODSMITH_METHOD_MEMORYLESS 0

// Edge collapse by accumulated quadrics.
#define LODSMITH_METHOD_QUADRIC 1

// Edge collapse that preserves volume and borders.
#define LODSMITH_METHOD_LINDSTROM_TURK 2

// Half-edge collapse by length times curvature.
#define LODSMITH_METHOD_MELAX 3

// Edge collapse in order of edge length.
#define LODSMITH_METHOD_SHORTEST_EDGE 4

// Vertex clustering: one vertex for each cell of a grid.
#define LODSMITH_METHOD_CLUSTER 5

// Removal of vertices; the holes are retriangulated.
#define LODSMITH_METHOD_VERTEX_REMOVAL 6

// Coplanar regions with as few triangles as their outlines need.
#define LODSMITH_METHOD_PLANAR 7

// Reversal of 4:1 subdivision.
#define LODSMITH_METHOD_UNSUBDIVIDE 8

// A new mesh on the same surface.
#define LODSMITH_METHOD_REMESH 9

// The final fit is used where it helps.
#define LODSMITH_FIT_AUTO 0

// The final fit is always used.
#define LODSMITH_FIT_ON 1

// The final fit is never used.
#define LODSMITH_FIT_OFF 2

// One run.
#define LODSMITH_EFFORT_DEFAULT 0

// Several runs to the same count, for a smaller largest distance.
#define LODSMITH_EFFORT_BEST 1

// `LODSMITH_EFFORT_BEST` for small meshes: the effort of the presets for parts and prints.
#define LODSMITH_EFFORT_AUTO 2

// Merged vertices lie at the point of least cost.
#define LODSMITH_PLACEMENT_OPTIMAL 0

// Merged vertices lie at the better end of the edge: the vertices of the result are vertices of the input.
#define LODSMITH_PLACEMENT_ENDPOINT 1

// Merged vertices lie at the midpoint of the edge.
#define LODSMITH_PLACEMENT_MIDPOINT 2

// Borders are held in place by their cost.
#define LODSMITH_BORDER_KEEP 0

// Border vertices move along the border only.
#define LODSMITH_BORDER_SLIDE 1

// Border vertices do not change.
#define LODSMITH_BORDER_LOCK 2

// Borders are not considered.
#define LODSMITH_BORDER_FREE 3

// Handles are cut and parts removed only if the target cannot be met otherwise, or only with a much larger error.
#define LODSMITH_TOPOLOGY_RELAXED 0

// Holes, handles and parts are kept.
#define LODSMITH_TOPOLOGY_PRESERVE 1

// Handles are cut and parts removed wherever that is cheapest.
#define LODSMITH_TOPOLOGY_FREE 2

// With a stop at an error, the bound is guaranteed in both directions; otherwise not at all.
#define LODSMITH_BOUND_AUTO 0

// No bound is guaranteed.
#define LODSMITH_BOUND_ESTIMATE 1

// No point of the result is farther from the input than the bound.
#define LODSMITH_BOUND_ONE_SIDED 2

// No point of either mesh is farther from the other mesh than the bound.
#define LODSMITH_BOUND_TWO_SIDED 3

// The result is measured if there is a stop at an error or a guaranteed bound.
#define LODSMITH_MEASURE_AUTO 0

// The result is always measured.
#define LODSMITH_MEASURE_ALWAYS 1

// All options at their defaults.
#define LODSMITH_PRESET_AUTO 0

// Noisy scans.
#define LODSMITH_PRESET_SCAN 1

// Machine parts.
#define LODSMITH_PRESET_CAD 2

// For display: more weight on normals.
#define LODSMITH_PRESET_VISUAL 3

// For 3D printing.
#define LODSMITH_PRESET_PRINT 4

// The target number of triangles was reached.
#define LODSMITH_STOPPED_BY_FACES 0

// The target number of vertices was reached.
#define LODSMITH_STOPPED_BY_VERTICES 1

// The target fraction of the triangles was reached.
#define LODSMITH_STOPPED_BY_RATIO 2

// The next step would exceed the error limit.
#define LODSMITH_STOPPED_BY_ERROR 3

// Topology and guards permit no further step.
#define LODSMITH_STOPPED_BY_REFUSALS 4

// The method has nothing more to remove.
#define LODSMITH_STOPPED_BY_EXHAUSTED 5

// The progress function ended the run with the best mesh so far.
#define LODSMITH_STOPPED_BY_CALLER 6

// No target was given, or the input met it already.
#define LODSMITH_STOPPED_BY_NOTHING 7

// A simplified mesh and the report of the run. Free it with `lodsmith_result_free`. Several threads may read it at the
// same time.
typedef struct lodsmith_result lodsmith_result;

#if defined(LODSMITH_FILES)
// A text from the library. Free it with `lodsmith_text_free`. Several threads may read it at the same time.
typedef struct lodsmith_text lodsmith_text;
#endif

// An attribute of all vertices.
typedef struct lodsmith_attribute {
  // One of `LODSMITH_ATTRIBUTE_...`.
  int32_t kind;
  // Index of the set or morph target, for kinds that have several.
  uint32_t set;
  // Name, in UTF-8, for custom and discrete attributes; may be null for other kinds.
  const char *name;
  // Number of values for each vertex.
  size_t width;
  // `width` floats every `stride` bytes.
  const float *values;
  // Bytes from one vertex to the next.
  size_t stride;
} lodsmith_attribute;

// A mesh in memory of the caller, which is only read. Fill it with zeros, then set `size` and the fields that the mesh
// has. Strides are in bytes.
typedef struct lodsmith_mesh_view {
  // `sizeof(lodsmith_mesh_view)` of the caller's header.
  size_t size;
  // Number of vertices. Several vertices at the same position are the sides of a seam.
  size_t vertex_count;
  // Three floats for each vertex; null if the positions are doubles.
  const float *positions;
  // Three doubles for each vertex; null if the positions are floats.
  const double *positions_f64;
  // Bytes from one position to the next.
  size_t positions_stride;
  // Three indices for each triangle, counter-clockwise seen from outside.
  const uint32_t *indices;
  // Number of indices.
  size_t index_count;
  // Three floats for each vertex, of unit length; may be null.
  const float *normals;
  // Bytes from one normal to the next.
  size_t normals_stride;
  // Two floats for each vertex, (0, 0) at the lower left; may be null.
  const float *uvs;
  // Bytes from one pair of texture coordinates to the next.
  size_t uvs_stride;
  // Four floats for each vertex: red, green, blue, alpha; may be null.
  const float *colors;
  // Bytes from one colour to the next.
  size_t colors_stride;
  // Additional attributes; may be null.
  const struct lodsmith_attribute *attributes;
  // Number of `attributes`.
  size_t attribute_count;
  // The region (such as a material or group) of each triangle, without gaps; may be null.
  const uint32_t *regions;
  // Not 0 for each vertex that must keep its position and attributes, without gaps; may be null.
  const uint8_t *locked;
  // Importance of each vertex, 1 is neutral, without gaps; may be null.
  const float *importance;
  // Share of the error limit at each vertex, from 0 (keep) to 1, without gaps; may be null.
  const float *error_map;
} lodsmith_mesh_view;

// A length with its unit; `LODSMITH_UNIT_NONE` if it is not set.
typedef struct lodsmith_length {
  // The number.
  double value;
  // One of `LODSMITH_UNIT_...`.
  int32_t unit;
} lodsmith_length;

// A base-colour image. Rows from the top, four bytes for each pixel: red, green, blue, alpha.
typedef struct lodsmith_texture {
  // `width * height` pixels; null for a region without an image.
  const uint8_t *pixels;
  // Pixels in a row.
  size_t width;
  // Number of rows.
  size_t height;
} lodsmith_texture;

// Options of `lodsmith_simplify`. Initialise them with `lodsmith_options_init`, then change fields.
typedef struct lodsmith_options {
  // `sizeof(lodsmith_options)` of the caller's header.
  size_t size;
  // Stop at this number of triangles; 0 if not set. If several stops are set, the first one met ends the run.
  size_t target_faces;
  // Stop at this number of vertices (positions); 0 if not set.
  size_t target_vertices;
  // Stop at this fraction of the triangles, up to 1; 0 if not set.
  double target_ratio;
  // Stop before the measured distance exceeds this, in the sense of `bound`.
  struct lodsmith_length target_error;
  // One of `LODSMITH_METHOD_...`.
  int32_t method;
  // One of `LODSMITH_FIT_...`.
  int32_t fit;
  // One of `LODSMITH_PLACEMENT_...`.
  int32_t placement;
  // One of `LODSMITH_BORDER_...`.
  int32_t border;
  // One of `LODSMITH_TOPOLOGY_...`.
  int32_t topology;
  // One of `LODSMITH_BOUND_...`.
  int32_t bound;
  // One of `LODSMITH_MEASURE_...`.
  int32_t measure;
  // Not 0: try pairs and looser topology policies if the target is not reached.
  int32_t escalate;
  // Not 0: use the normals of the shape in the cost if the mesh has no normals.
  int32_t shape_normals;
  // Methods memoryless, quadric: vertices closer than this that share no edge are contracted too.
  struct lodsmith_length pairs;
  // Method cluster: edge length of a cell.
  struct lodsmith_length cell;
  // Method cluster: not 0 to continue with edge collapses.
  int32_t two_stage;
  // Method remesh: not 0 for shorter edges where the surface is curved.
  int32_t adaptive;
  // Methods shortest edge, remesh: edge length.
  struct lodsmith_length edge_length;
  // Methods planar, vertex removal, remesh: largest angle in degrees; negative if not set.
  double angle_deg;
  // Method planar: largest distance from the plane of a region.
  struct lodsmith_length flat;
  // Method unsubdivide: number of levels; method remesh: number of iterations; 0 if not set.
  size_t iterations;
  // Method remesh: edge length of a voxel.
  struct lodsmith_length voxel;
  // Method remesh: number of subdivisions of a semi-regular mesh; 0 if not set.
  size_t subdivisions;
  // Largest rotation of a face normal in degrees; 0 for no limit.
  double max_normal_deg;
  // Minimum quality of a new face, up to 1; 0 for no limit.
  double min_quality;
  // Largest number of edges at a vertex; 0 for no limit.
  size_t max_valence;
  // Largest length of an edge.
  struct lodsmith_length max_edge;
  // Edges with a larger dihedral angle in degrees are features; 0 for no features.
  double sharp_deg;
  // Weight of normals; 1 is the default, 0 ignores them.
  double weight_normal;
  // Weight of texture coordinates.
  double weight_uv;
  // Weight of colours.
  double weight_color;
  // Weight of morph targets.
  double weight_morph;
  // Weight of skins.
  double weight_skin;
  // Weight of all other attributes.
  double weight_other;
  // Weight of open borders.
  double weight_border;
  // Vertices closer than this are merged first.
  struct lodsmith_length weld;
  // Parts with a smaller bounding box are removed first.
  struct lodsmith_length prune;
  // Class of each region of the mesh, given by the first region of the class; null if each region is its own class.
  const uint32_t *region_classes;
  // Number of `region_classes`.
  size_t region_class_count;
  // Base-colour image of each region; null for none.
  const struct lodsmith_texture *textures;
  // Number of `textures`.
  size_t texture_count;
  // Seed of all random choices.
  uint64_t seed;
  // Options by name, as the command has them, with a field or without: `name=value`, or the name of a flag,
  // separated by blanks, such as `max-edge=2% per-mesh`. They count more than fields. Null for none.
  const char *named;
  // One of `LODSMITH_EFFORT_...`.
  int32_t effort;
} lodsmith_options;

// Receives the progress: the stage, one of `LODSMITH_STAGE_...`, and the fraction of it that is done, from 0 to 1; in
// a job on files, the fraction of the whole job. Returns `LODSMITH_CONTINUE`, `LODSMITH_FINISH` or `LODSMITH_CANCEL`.
// It is called often, on the calling thread, and must not throw an exception or jump out (`longjmp`).
typedef int32_t (*lodsmith_progress)(void *user, int32_t stage, double done);

#if defined(LODSMITH_FILES)
// A job on files. Fill it with zeros, then set `size` and the fields that the job needs. Texts are UTF-8 and end with
// a zero byte.
typedef struct lodsmith_file_job {
  // `sizeof(lodsmith_file_job)` of the caller's header.
  size_t size;
  // The job: `simplify`, `lod`, `clean`, `convert`, `bake` or `info`, like the subcommands of the command.
  const char *verb;
  // Path of the file to read.
  const char *input;
  // For `bake`: path of the high-poly file that maps are baked from; `input` is the low-poly file. Else null.
  const char *detailed;
  // Path of the file to write; its extension determines the format. Null for `info`; with `simplify`, `lod` and
  // `clean`, null writes nothing, and only the report is returned.
  const char *output;
  // For `lod`, instead of `output`: path of a folder, created if missing, for one file per level and the list
  // `lods.json`. Else null.
  const char *out_dir;
  // Options of the subcommand as a JSON object, such as `{"ratio": 0.1, "bake": ["normal"]}`. Names have
  // underscores or dashes; flags are true or false. Null for none.
  const char *options;
} lodsmith_file_job;
#endif

// A distance in both directions, in the units of the positions.
typedef struct lodsmith_distance {
  // From the input to the result.
  double forward;
  // From the result to the input.
  double backward;
  // Both directions together: the larger of two maxima, the mean of two means.
  double symmetric;
} lodsmith_distance;

// The report of a run. Set `size` before the call. Lengths are in the units of the positions.
typedef struct lodsmith_report {
  // `sizeof(lodsmith_report)` of the caller's header.
  size_t size;
  // Triangles of the input.
  size_t input_faces;
  // Vertices of the input.
  size_t input_vertices;
  // Triangles of the result.
  size_t faces;
  // Positions of the result; at seams there are more vertices than positions.
  size_t positions;
  // 1 if a target was met, else 0.
  int32_t reached;
  // One of `LODSMITH_STOPPED_BY_...`.
  int32_t stopped_by;
  // Estimate of the root-mean-square distance.
  double estimate;
  // 1 if the distances below were measured, else 0.
  int32_t is_measured;
  // 1 if the final fit ran, else 0.
  int32_t is_fitted;
  // Measured mean distance.
  struct lodsmith_distance mean;
  // Measured root-mean-square distance.
  struct lodsmith_distance rms;
  // Largest measured distance.
  struct lodsmith_distance max;
  // Proven bound on the distance of any point; negative if none is guaranteed.
  double bound;
  // Diagonal of the bounding box of the input.
  double diagonal;
  // Collapses done.
  uint64_t collapses;
  // Removed parts.
  size_t parts_removed;
  // Necks that were cut.
  size_t necks_cut;
  // Input vertices merged with another at the same position, or within the weld distance.
  size_t welded_vertices;
  // Input faces that were dropped: degenerate, duplicate, or with positions that are not finite.
  size_t dropped_faces;
  // Number of proposals: tested changes of the options that would let a stuck run continue.
  size_t proposals;
  // Time of the run in seconds.
  double seconds;
  // Collapses refused by the stop at an error: with them the result would be farther from the input.
  uint64_t refused_by_error;
  // 1 if there is a largest measured distance above 0, whose place is below, else 0.
  int32_t has_max_point;
  // 1 if that place is on the input, 0 if it is on the result.
  int32_t is_max_on_input;
  // The place where the measured distance is largest.
  double max_point[3];
  // The point of the other surface that is nearest to it.
  double max_nearest[3];
} lodsmith_report;

#ifdef __cplusplus
extern "C" {
#endif // __cplusplus

// Simplifies a mesh with the best quality: the closest mesh for the count, with all attributes.
//
// Returns `LODSMITH_OK` and a new result in `*result`, which the caller frees with `lodsmith_result_free`; or an error
// code, with a text in `lodsmith_error_message` and null in `*result`. The mesh is only read, and not used after the
// call. `progress` may be null; `user` is passed to it. The same mesh, options and seed give the same result.
//
// Conditions:
// The structures must have the sizes that they state, and the buffers that they refer to the stated extents.
int32_t lodsmith_simplify(const struct lodsmith_mesh_view *mesh,
                          const struct lodsmith_options *options,
                          lodsmith_progress progress,
                          void *user,
                          struct lodsmith_result **result);

// Returns the version of the library, such as `0.1.0`: a text that is always valid.
const char *lodsmith_version(void);

// Returns the text of the error of the last call on this thread, in English, as UTF-8; null if that call
// succeeded. The text is valid until the next call on this thread; copy it to keep it. (Functions that only read a
// value, such as `lodsmith_result_vertex_count`, do not change it.)
const char *lodsmith_error_message(void);

#if defined(LODSMITH_FILES)
// Does a job on files like the command: with the same options, the same bytes and the same report.
//
// Returns `LODSMITH_OK` and a new text in `*outcome`, which the caller frees with `lodsmith_text_free`; or an error
// code, with a text in `lodsmith_error_message` and null in `*outcome`. The text is a JSON object: `report` is the
// output of the command with `--json`, `warnings` and `faults` are lists of texts. With the option `strict`, warnings
// about lost data and missed targets are faults; if there are any, the code is `LODSMITH_ERROR_STRICT`, and the files
// are written and the outcome is returned nevertheless.
//
// `progress` may be null; `user` is passed to it. It receives the fraction of the whole job that is done, which never
// decreases. After `LODSMITH_CANCEL`, no further file is written. After `LODSMITH_FINISH`, the best meshes so far are
// written; baking, which has no partial result, is cancelled instead. No file is written in part.
//
// The job uses the shared thread pool of the process, or `threads` new threads if that option is set.
//
// Conditions:
// The structure must have the size that it states, and its texts must be null or end with a zero byte.
int32_t lodsmith_run_file_job(const struct lodsmith_file_job *job,
                              lodsmith_progress progress,
                              void *user,
                              struct lodsmith_text **outcome);
#endif

#if defined(LODSMITH_FILES)
// Returns the characters of a text, in UTF-8 with a zero byte at the end; they are valid until the text is freed. Null
// for null.
//
// Conditions:
// `text` must be null or a text that was not freed.
const char *lodsmith_text_get(const struct lodsmith_text *text);
#endif

#if defined(LODSMITH_FILES)
// Frees a text; null is allowed.
//
// Conditions:
// `text` must come from this library, and is not valid afterwards.
void lodsmith_text_free(struct lodsmith_text *text);
#endif

// Simplifies an index buffer, with the arguments of `meshopt_simplify` in the same order.
//
// Returns the number of indices written to `destination`: three vertices of the input for each triangle. After an
// error, returns 0, with a text in `lodsmith_error_message`, and writes nothing.
//
// - `destination`: room for `index_count` indices; may be `indices`.
// - `indices`: three for each triangle, counter-clockwise seen from outside. Vertices at equal positions with
//   different indices are the sides of a seam; the sides stay together, and seams keep their lines.
// - `vertex_positions`: three floats every `vertex_positions_stride` bytes, for `vertex_count` vertices.
// - `target_index_count`: the run ends at this number of indices, or earlier if topology and seams permit no further
//   collapse. Holes, handles and parts are kept, unless `options` has `LODSMITH_SIMPLIFY_PRUNE`.
// - `target_error`: the run ends before the estimate of the error exceeds this fraction of the largest extent of the
//   positions, or this length with `LODSMITH_SIMPLIFY_ERROR_ABSOLUTE`; `FLT_MAX` for no limit.
// - `options`: flags `LODSMITH_SIMPLIFY_...`, or 0.
// - `result_error`: null, or receives the estimate of the error, in the same unit. (It is computed from the estimated
//   root-mean-square distance, scaled so that an error limit leaves about as many triangles as in meshoptimizer.)
//
// Faces without area or with positions that are not finite are removed, unless the target is met already. The same
// input gives the same output. Uses one thread.
//
// Conditions:
// The buffers must have these extents; only `destination` is written.
size_t lodsmith_simplify_indices(uint32_t *destination,
                                 const uint32_t *indices,
                                 size_t index_count,
                                 const float *vertex_positions,
                                 size_t vertex_count,
                                 size_t vertex_positions_stride,
                                 size_t target_index_count,
                                 float target_error,
                                 uint32_t options,
                                 float *result_error);

// Simplifies an index buffer with attributes in the cost, with the arguments of `meshopt_simplifyWithAttributes` in
// the same order.
//
// Like `lodsmith_simplify_indices`, with these additional arguments:
// - `vertex_attributes`: `attribute_count` floats (up to 32) every `vertex_attributes_stride` bytes.
// - `attribute_weights`: the weight of each attribute: with weight w, a difference of 1 over a length counts like a
//   distance of w times the length. Attributes with weight 0 are not read.
// - `vertex_lock`: null, or flags `LODSMITH_VERTEX_...` for each vertex.
//
// Conditions:
// The buffers must have these extents; only `destination` is written.
size_t lodsmith_simplify_indices_with_attributes(uint32_t *destination,
                                                 const uint32_t *indices,
                                                 size_t index_count,
                                                 const float *vertex_positions,
                                                 size_t vertex_count,
                                                 size_t vertex_positions_stride,
                                                 const float *vertex_attributes,
                                                 size_t vertex_attributes_stride,
                                                 const float *attribute_weights,
                                                 size_t attribute_count,
                                                 const uint8_t *vertex_lock,
                                                 size_t target_index_count,
                                                 float target_error,
                                                 uint32_t options,
                                                 float *result_error);

// Simplifies an index buffer in place and moves vertices to minimise the error, with the arguments of
// `meshopt_simplifyWithUpdate` in the same order.
//
// Like `lodsmith_simplify_indices_with_attributes`, but changes `indices`, the positions and the attributes with a
// weight above 0: vertices that the remaining indices refer to get new values, other vertices keep theirs. A position
// has a seam if a weighted attribute differs between its vertices; otherwise its vertices are merged.
// `LODSMITH_SIMPLIFY_PERMISSIVE` has no effect here.
//
// Conditions:
// The buffers must have these extents, and all but `attribute_weights` and `vertex_lock` must be writable.
size_t lodsmith_simplify_indices_with_update(uint32_t *indices,
                                             size_t index_count,
                                             float *vertex_positions,
                                             size_t vertex_count,
                                             size_t vertex_positions_stride,
                                             float *vertex_attributes,
                                             size_t vertex_attributes_stride,
                                             const float *attribute_weights,
                                             size_t attribute_count,
                                             const uint8_t *vertex_lock,
                                             size_t target_index_count,
                                             float target_error,
                                             uint32_t options,
                                             float *result_error);

// Initialises options with the defaults and without a target. `size` is `sizeof(lodsmith_options)`.
//
// Conditions:
// `options` must have room for `size` bytes.
int32_t lodsmith_options_init(struct lodsmith_options *options, size_t size);

// Initialises options with a preset, one of `LODSMITH_PRESET_...`, and without a target. `size` is
// `sizeof(lodsmith_options)`.
//
// Conditions:
// `options` must have room for `size` bytes.
int32_t lodsmith_options_init_preset(struct lodsmith_options *options, size_t size, int32_t preset);

// Frees a result; null is allowed.
//
// Conditions:
// `result` must come from `lodsmith_simplify`, and is not valid afterwards.
void lodsmith_result_free(struct lodsmith_result *result);

// Returns the number of vertices of a result; several vertices at the same position are the sides of a seam. 0 for
// null.
//
// Conditions:
// `result` must be null or a result.
size_t lodsmith_result_vertex_count(const struct lodsmith_result *result);

// Returns the number of indices of a result, three for each triangle. 0 for null.
//
// Conditions:
// `result` must be null or a result.
size_t lodsmith_result_index_count(const struct lodsmith_result *result);

// Copies the indices, three for each triangle, into a buffer for `capacity` indices.
//
// Conditions:
// `result` must be null or a result, and `indices` must have that capacity.
int32_t lodsmith_result_copy_indices(const struct lodsmith_result *result,
                                     uint32_t *indices,
                                     size_t capacity);

// Copies the positions, three floats every `stride` bytes, into a buffer for `capacity` vertices.
//
// Conditions:
// `result` must be null or a result, and `positions` must have that capacity.
int32_t lodsmith_result_copy_positions(const struct lodsmith_result *result,
                                       float *positions,
                                       size_t stride,
                                       size_t capacity);

// Copies the positions, three doubles every `stride` bytes, into a buffer for `capacity` vertices.
//
// Conditions:
// `result` must be null or a result, and `positions` must have that capacity.
int32_t lodsmith_result_copy_positions_f64(const struct lodsmith_result *result,
                                           double *positions,
                                           size_t stride,
                                           size_t capacity);

// Copies the normals, three floats every `stride` bytes; an error if the input had none.
//
// Conditions:
// `result` must be null or a result, and `normals` must have room for `capacity` vertices.
int32_t lodsmith_result_copy_normals(const struct lodsmith_result *result,
                                     float *normals,
                                     size_t stride,
                                     size_t capacity);

// Copies the texture coordinates, two floats every `stride` bytes; an error if the input had none.
//
// Conditions:
// `result` must be null or a result, and `uvs` must have room for `capacity` vertices.
int32_t lodsmith_result_copy_uvs(const struct lodsmith_result *result,
                                 float *uvs,
                                 size_t stride,
                                 size_t capacity);

// Copies the colours, four floats every `stride` bytes; an error if the input had none.
//
// Conditions:
// `result` must be null or a result, and `colors` must have room for `capacity` vertices.
int32_t lodsmith_result_copy_colors(const struct lodsmith_result *result,
                                    float *colors,
                                    size_t stride,
                                    size_t capacity);

// Copies the values of the attribute with index `attribute` in the view of the input: its `width` floats every
// `stride` bytes. An error if the result does not have the attribute.
//
// Conditions:
// `result` must be null or a result, and `values` must have room for `capacity` vertices.
int32_t lodsmith_result_copy_attribute(const struct lodsmith_result *result,
                                       size_t attribute,
                                       float *values,
                                       size_t stride,
                                       size_t capacity);

// Copies the region of each triangle into a buffer for `capacity` triangles; all are 0 if the input had no regions.
//
// Conditions:
// `result` must be null or a result, and `regions` must have that capacity.
int32_t lodsmith_result_copy_regions(const struct lodsmith_result *result,
                                     uint32_t *regions,
                                     size_t capacity);

// Fills the report of a run. Set its `size` first.
//
// Conditions:
// `result` must be null or a result, and `report` must be null or as large as its size states.
int32_t lodsmith_result_report(const struct lodsmith_result *result, struct lodsmith_report *report);

#ifdef __cplusplus
}  // extern "C"
#endif  // __cplusplus

#endif  /* LODSMITH_H */
