/* Odd inputs of every function: each call ends with an error or a result, and writes only where it may. */
#include <lodsmith.h>

#include <float.h>
#include <math.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static int failures = 0;

#define CHECK(condition)                                                                    \
    do {                                                                                    \
        if (!(condition)) {                                                                 \
            const char *text = lodsmith_error_message();                                    \
            printf("line %d: %s (%s)\n", __LINE__, #condition, text ? text : "no error"); \
            ++failures;                                                                     \
        }                                                                                   \
    } while (0)

/* A collapse at an inner edge removes two triangles at once. */
#define REACHES(count, target) ((count) <= (target) && (count) + 6 > (target))

enum { SIDE = 17, VERTICES = SIDE * SIDE, INDICES = 6 * (SIDE - 1) * (SIDE - 1) };

static float points[VERTICES][3];
static uint32_t indices[INDICES];
static uint32_t out[INDICES + 1];

static void make_sheet(void) {
    size_t n = 0;
    for (int j = 0; j < SIDE; ++j)
        for (int i = 0; i < SIDE; ++i) {
            float *p = points[j * SIDE + i];
            p[0] = (float)i;
            p[1] = (float)j;
            p[2] = 0.2f * sinf(0.7f * (float)i) * cosf(0.5f * (float)j);
        }
    for (uint32_t j = 0; j + 1 < SIDE; ++j)
        for (uint32_t i = 0; i + 1 < SIDE; ++i) {
            uint32_t a = j * SIDE + i, b = a + 1, c = b + SIDE, d = a + SIDE;
            uint32_t corners[6];
            corners[0] = a, corners[1] = b, corners[2] = c, corners[3] = a, corners[4] = c, corners[5] = d;
            memcpy(indices + n, corners, sizeof corners);
            n += 6;
        }
}

static size_t run(size_t index_count, size_t vertex_count, size_t stride, size_t target, float error, unsigned flags) {
    out[INDICES] = 0xDEADBEEF;
    size_t left = lodsmith_simplify_indices(out, indices, index_count, points[0], vertex_count, stride, target, error,
                                            flags, NULL);
    CHECK(out[INDICES] == 0xDEADBEEF);
    CHECK(left <= index_count);
    for (size_t i = 0; i < left; ++i) CHECK(out[i] < vertex_count);
    return left;
}

static void index_calls(void) {
    const size_t stride = sizeof points[0];
    float error = -1;
    CHECK(REACHES(run(INDICES, VERTICES, stride, INDICES / 4, FLT_MAX, 0), INDICES / 4));
    CHECK(lodsmith_error_message() == NULL);
    /* Targets. */
    CHECK(run(INDICES, VERTICES, stride, INDICES, FLT_MAX, 0) == INDICES && memcmp(out, indices, sizeof indices) == 0);
    CHECK(run(INDICES, VERTICES, stride, (size_t)-1, FLT_MAX, 0) == INDICES);
    CHECK(run(INDICES, VERTICES, stride, 0, FLT_MAX, 0) > 0);
    CHECK(run(INDICES, VERTICES, stride, 0, 0.0f, 0) > INDICES / 4);
    CHECK(run(INDICES, VERTICES, stride, 0, 0.01f, 0) < run(INDICES, VERTICES, stride, 0, 0.001f, 0));
    /* Empty input. */
    CHECK(run(0, VERTICES, stride, 0, FLT_MAX, 0) == 0 && lodsmith_error_message() == NULL);
    CHECK(lodsmith_simplify_indices(NULL, NULL, 0, NULL, 0, 0, 0, 0, 0, &error) == 0 && error == 0);
    CHECK(lodsmith_error_message() == NULL);
    /* Errors. */
    CHECK(run(INDICES - 1, VERTICES, stride, 9, FLT_MAX, 0) == 0 && lodsmith_error_message());
    CHECK(run(INDICES, VERTICES - 1, stride, 9, FLT_MAX, 0) == 0 && lodsmith_error_message());
    CHECK(run(INDICES, 0, stride, 9, FLT_MAX, 0) == 0 && lodsmith_error_message());
    CHECK(run(INDICES, VERTICES, 8, 9, FLT_MAX, 0) == 0 && lodsmith_error_message());
    CHECK(run(INDICES, VERTICES, SIZE_MAX / 2, 9, FLT_MAX, 0) == 0 && lodsmith_error_message());
    CHECK(run(INDICES, VERTICES, stride, 9, -1.0f, 0) == 0 && lodsmith_error_message());
    CHECK(run(INDICES, VERTICES, stride, 9, (float)NAN, 0) == 0 && lodsmith_error_message());
    CHECK(run(INDICES, VERTICES, stride, 9, FLT_MAX, 1u << 20) == 0 && lodsmith_error_message());
    CHECK(lodsmith_simplify_indices(NULL, indices, INDICES, points[0], VERTICES, stride, 9, FLT_MAX, 0, NULL) == 0);
    CHECK(lodsmith_error_message());
    CHECK(lodsmith_simplify_indices(out, NULL, INDICES, points[0], VERTICES, stride, 9, FLT_MAX, 0, NULL) == 0);
    CHECK(lodsmith_error_message());
    CHECK(lodsmith_simplify_indices(out, indices, INDICES, NULL, VERTICES, stride, 9, FLT_MAX, 0, NULL) == 0);
    CHECK(lodsmith_error_message());
    /* Each flag. */
    for (unsigned bit = 0; bit < 9; ++bit) CHECK(run(INDICES, VERTICES, stride, INDICES / 2, FLT_MAX, 1u << bit) > 0);
    /* In place. */
    memcpy(out, indices, sizeof indices);
    CHECK(REACHES(
        lodsmith_simplify_indices(out, out, INDICES, points[0], VERTICES, stride, INDICES / 4, FLT_MAX, 0, &error),
        INDICES / 4));
    CHECK(error > 0 && error < 0.5f);
}

static void broken_positions(void) {
    static float saved[VERTICES][3];
    const size_t stride = sizeof points[0];
    memcpy(saved, points, sizeof saved);
    points[5][1] = (float)NAN;
    points[40][0] = (float)INFINITY;
    points[60][2] = 3e38f;
    run(INDICES, VERTICES, stride, INDICES / 4, FLT_MAX, 0);
    for (size_t i = 0; i < VERTICES; ++i) points[i][0] = points[i][1] = points[i][2] = 1.0f;
    CHECK(run(INDICES, VERTICES, stride, INDICES / 4, FLT_MAX, 0) == 0 && lodsmith_error_message());
    for (size_t i = 0; i < VERTICES; ++i) points[i][0] = (float)NAN;
    CHECK(run(INDICES, VERTICES, stride, INDICES / 4, FLT_MAX, 0) == 0 && lodsmith_error_message());
    memcpy(points, saved, sizeof saved);
}

static void attribute_calls(void) {
    const size_t stride = sizeof points[0];
    static float values[VERTICES][2], moved[VERTICES][3];
    static unsigned char locks[VERTICES];
    static uint32_t own[INDICES];
    float weights[40] = {1.0f, 0.0f};
    size_t left, i;
    int found = 0;
    for (i = 0; i < VERTICES; ++i) values[i][0] = points[i][0] > 8 ? 1.0f : 0.0f, values[i][1] = (float)NAN;
    locks[100] = LODSMITH_VERTEX_LOCK, locks[120] = LODSMITH_VERTEX_PRIORITY, locks[140] = LODSMITH_VERTEX_PROTECT;
#define ATTRIBUTES(values, weights, count)                                                                        \
    lodsmith_simplify_indices_with_attributes(out, indices, INDICES, points[0], VERTICES, stride, values,         \
                                              sizeof(float) * 2, weights, count, locks, INDICES / 8, FLT_MAX, 0, \
                                              NULL)
    left = ATTRIBUTES(values[0], weights, 2);
    CHECK(REACHES(left, INDICES / 8));
    for (i = 0; i < left; ++i) found |= out[i] == 100;
    CHECK(found);
    CHECK(ATTRIBUTES(NULL, weights, 2) == 0 && lodsmith_error_message());
    CHECK(ATTRIBUTES(values[0], NULL, 2) == 0 && lodsmith_error_message());
    CHECK(ATTRIBUTES(values[0], weights, 40) == 0 && lodsmith_error_message());
    left = ATTRIBUTES(NULL, NULL, 0);
    CHECK(REACHES(left, INDICES / 8));
    weights[0] = -1.0f;
    CHECK(ATTRIBUTES(values[0], weights, 2) == 0 && lodsmith_error_message());
    weights[0] = 1.0f;

    memcpy(moved, points, sizeof moved);
    memcpy(own, indices, sizeof own);
    left = lodsmith_simplify_indices_with_update(own, INDICES, moved[0], VERTICES, stride, values[0], sizeof values[0],
                                                 weights, 2, locks, INDICES / 8, FLT_MAX, 0, NULL);
    CHECK(REACHES(left, INDICES / 8));
    CHECK(memcmp(moved[100], points[100], sizeof points[100]) == 0);
    CHECK(memcmp(moved, points, sizeof moved) != 0);
    CHECK(isnan(values[0][1]) && values[0][0] >= 0 && values[0][0] <= 1);
    for (found = 0, i = 0; i < left; ++i) found |= own[i] == 100;
    CHECK(found);
}

static void sparse(void) {
    /* A few triangles of a large buffer, in which only their vertices may be read. */
    const size_t count = 500000;
    float *far_points = calloc(count, 3 * sizeof(float));
    uint32_t few[INDICES], left_over[INDICES];
    CHECK(far_points != NULL);
    if (!far_points) return;
    for (size_t i = 0; i < INDICES; ++i) {
        few[i] = (uint32_t)count - VERTICES + indices[i];
        memcpy(far_points + 3 * (size_t)few[i], points[indices[i]], sizeof points[0]);
    }
    size_t left = lodsmith_simplify_indices(left_over, few, INDICES, far_points, count, 3 * sizeof(float), INDICES / 4,
                                            FLT_MAX, LODSMITH_SIMPLIFY_SPARSE, NULL);
    size_t here = run(INDICES, VERTICES, sizeof points[0], INDICES / 4, FLT_MAX, LODSMITH_SIMPLIFY_SPARSE);
    CHECK(left == here && REACHES(left, INDICES / 4));
    for (size_t i = 0; i < left; ++i) CHECK(left_over[i] == (uint32_t)count - VERTICES + out[i]);
    free(far_points);
}

static int32_t cancel(void *user, int32_t stage, double done) {
    (void)stage, (void)done;
    ++*(int *)user;
    return LODSMITH_CANCEL;
}

static void best_call(void) {
    lodsmith_mesh_view view;
    lodsmith_options options;
    lodsmith_result *result = NULL;
    lodsmith_report report;
    int calls = 0;
    memset(&view, 0, sizeof view);
    view.size = sizeof view;
    view.vertex_count = VERTICES;
    view.positions = points[0];
    view.positions_stride = sizeof points[0];
    view.indices = indices;
    view.index_count = INDICES;
    CHECK(lodsmith_options_init(&options, sizeof options) == LODSMITH_OK);
    options.target_ratio = 0.25;
    CHECK(lodsmith_simplify(&view, &options, NULL, NULL, &result) == LODSMITH_OK && result);
    memset(&report, 0, sizeof report);
    CHECK(lodsmith_result_report(result, &report) == LODSMITH_ERROR_ARGUMENT);
    report.size = sizeof report;
    CHECK(lodsmith_result_report(result, &report) == LODSMITH_OK);
    CHECK(report.reached == 1 && REACHES(3 * report.faces, INDICES / 4) && report.stopped_by == LODSMITH_STOPPED_BY_RATIO);
    CHECK(lodsmith_result_index_count(result) == 3 * report.faces);
    CHECK(lodsmith_result_copy_indices(result, out, 3 * report.faces - 1) == LODSMITH_ERROR_ARGUMENT);
    CHECK(lodsmith_result_copy_indices(result, NULL, INDICES / 4) == LODSMITH_ERROR_ARGUMENT);
    CHECK(lodsmith_result_copy_indices(result, out, INDICES / 4) == LODSMITH_OK);
    CHECK(lodsmith_result_copy_normals(result, points[0], 12, VERTICES) == LODSMITH_ERROR_ARGUMENT);
    CHECK(lodsmith_result_copy_attribute(result, 3, points[0], 12, VERTICES) == LODSMITH_ERROR_ARGUMENT);
    lodsmith_result_free(result);
    lodsmith_result_free(NULL);

    CHECK(lodsmith_simplify(&view, &options, cancel, &calls, &result) == LODSMITH_ERROR_CANCELLED);
    CHECK(result == NULL && calls > 0);
    CHECK(lodsmith_simplify(&view, &options, NULL, NULL, NULL) == LODSMITH_ERROR_ARGUMENT);
    CHECK(lodsmith_simplify(NULL, &options, NULL, NULL, &result) == LODSMITH_ERROR_ARGUMENT);
    CHECK(lodsmith_simplify(&view, NULL, NULL, NULL, &result) == LODSMITH_ERROR_ARGUMENT);
    options.method = 77;
    CHECK(lodsmith_simplify(&view, &options, NULL, NULL, &result) == LODSMITH_ERROR_OPTION);
    options.method = LODSMITH_METHOD_MEMORYLESS;
    options.cell.unit = LODSMITH_UNIT_MESH, options.cell.value = 1;
    CHECK(lodsmith_simplify(&view, &options, NULL, NULL, &result) == LODSMITH_ERROR_OPTION);
    options.cell.unit = LODSMITH_UNIT_NONE;
    options.size = 0;
    CHECK(lodsmith_simplify(&view, &options, NULL, NULL, &result) == LODSMITH_ERROR_ARGUMENT);
    options.size = sizeof options + 1;
    CHECK(lodsmith_simplify(&view, &options, NULL, NULL, &result) == LODSMITH_ERROR_ARGUMENT);
    options.size = sizeof options;
    view.index_count = 0;
    CHECK(lodsmith_simplify(&view, &options, NULL, NULL, &result) == LODSMITH_ERROR_MESH);
    view.index_count = INDICES, view.vertex_count = 4;
    CHECK(lodsmith_simplify(&view, &options, NULL, NULL, &result) == LODSMITH_ERROR_ARGUMENT);
    CHECK(lodsmith_options_init(NULL, sizeof options) == LODSMITH_ERROR_ARGUMENT);
    CHECK(lodsmith_options_init_preset(&options, sizeof options, 99) == LODSMITH_ERROR_OPTION);
    CHECK(lodsmith_result_vertex_count(NULL) == 0 && lodsmith_result_index_count(NULL) == 0);
    CHECK(lodsmith_result_copy_indices(NULL, out, INDICES) == LODSMITH_ERROR_ARGUMENT);
    CHECK(strlen(lodsmith_version()) >= 5);
}

#ifdef LODSMITH_FILES

static char mesh_path[4096], low_path[4096];

static int there(const char *path) {
    FILE *file = fopen(path, "rb");
    if (file) fclose(file);
    return file != NULL;
}

static int32_t job_code(const lodsmith_file_job *job, lodsmith_progress progress, void *user, const char *part) {
    lodsmith_text *outcome = (lodsmith_text *)&failures;
    int32_t code = lodsmith_run_file_job(job, progress, user, &outcome);
    const char *text = code == LODSMITH_OK ? lodsmith_text_get(outcome) : lodsmith_error_message();
    CHECK((code == LODSMITH_OK || code == LODSMITH_ERROR_STRICT) == (outcome != NULL));
    CHECK(text && strstr(text, part));
    lodsmith_text_free(outcome);
    return code;
}

/* The files are in the folder of the program. */
static void file_jobs(const char *program) {
    lodsmith_file_job job;
    int calls = 0;
    FILE *file;
    CHECK(strlen(program) + 16 < sizeof mesh_path);
    sprintf(mesh_path, "%s_sheet.obj", program), sprintf(low_path, "%s_low.glb", program);
    remove(low_path);
    file = fopen(mesh_path, "w");
    CHECK(file != NULL);
    if (!file) return;
    for (size_t i = 0; i < VERTICES; ++i) fprintf(file, "v %g %g %g\n", points[i][0], points[i][1], points[i][2]);
    for (size_t i = 0; i < INDICES; i += 3)
        fprintf(file, "f %u %u %u\n", indices[i] + 1, indices[i + 1] + 1, indices[i + 2] + 1);
    CHECK(fclose(file) == 0);

    memset(&job, 0, sizeof job);
    job.size = sizeof job;
    job.verb = "simplify", job.input = mesh_path, job.output = low_path, job.options = "{\"ratio\": 0.25}";
    CHECK(job_code(&job, cancel, &calls, "cancelled") == LODSMITH_ERROR_CANCELLED && calls == 1 && !there(low_path));
    job.options = "{\"ratio\": 0.25, \"threads\": 2}";
    CHECK(job_code(&job, cancel, &calls, "cancelled") == LODSMITH_ERROR_CANCELLED && calls == 2 && !there(low_path));
    job.options = "{\"rato\": 0.25}";
    CHECK(job_code(&job, NULL, NULL, "a similar one is ratio") == LODSMITH_ERROR_OPTION);
    job.options = "{\"ratio\": 0.25";
    CHECK(job_code(&job, NULL, NULL, "not JSON") == LODSMITH_ERROR_ARGUMENT);
    job.options = "{\"ratio\": 0.25}", job.input = "\xff.obj";
    CHECK(job_code(&job, NULL, NULL, "not UTF-8") == LODSMITH_ERROR_ARGUMENT);
    job.input = low_path;
    CHECK(job_code(&job, NULL, NULL, "low.glb") == LODSMITH_ERROR_FILE && !there(low_path));
    job.input = NULL;
    CHECK(job_code(&job, NULL, NULL, "input is null") == LODSMITH_ERROR_ARGUMENT);
    job.input = mesh_path, job.size = 0;
    CHECK(job_code(&job, NULL, NULL, "sizeof") == LODSMITH_ERROR_ARGUMENT);
    job.size = sizeof job;
    CHECK(job_code(NULL, NULL, NULL, "null") == LODSMITH_ERROR_ARGUMENT);
    CHECK(lodsmith_run_file_job(&job, NULL, NULL, NULL) == LODSMITH_ERROR_ARGUMENT && !there(low_path));
    CHECK(job_code(&job, NULL, NULL, "\"report\":{\"input\":") == LODSMITH_OK && there(low_path));
    job.options = "{\"ratio\": 0.25, \"threads\": 2}";
    CHECK(job_code(&job, NULL, NULL, "\"threads\":2") == LODSMITH_OK);
    job.verb = "info", job.input = low_path, job.output = NULL, job.options = NULL;
    CHECK(job_code(&job, NULL, NULL, "\"format\":\"glb\"") == LODSMITH_OK);
    CHECK(lodsmith_text_get(NULL) == NULL);
    lodsmith_text_free(NULL);
    remove(mesh_path), remove(low_path);
}

#endif

int main(int argc, char **argv) {
    (void)argc;
    make_sheet();
    index_calls();
    broken_positions();
    attribute_calls();
    sparse();
    best_call();
#ifdef LODSMITH_FILES
    file_jobs(argv[0]);
#else
    (void)argv;
#endif
    printf("%d failures\n", failures);
    return failures != 0;
}
