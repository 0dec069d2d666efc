// Simplifies a mesh with each family of functions.
//
//   simplify [INPUT.obj [OUTPUT]]
//
// Without a file, simplifies a wavy torus. Reads only positions and faces of an OBJ file; with an output, the whole
// file is also simplified and written.
#include <lodsmith.h>

#include <cfloat>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <fstream>
#include <iostream>
#include <memory>
#include <sstream>
#include <stdexcept>
#include <string>
#include <vector>

namespace {

// A vertex as in a game engine: Lodsmith reads its fields by strides.
struct Vertex {
    float position[3];
    float normal[3];
    float height;
};

struct Mesh {
    std::vector<Vertex> vertices;
    std::vector<uint32_t> indices;
};

struct FreeResult {
    void operator()(lodsmith_result *result) const { lodsmith_result_free(result); }
};
using Result = std::unique_ptr<lodsmith_result, FreeResult>;

#ifdef LODSMITH_FILES
struct FreeText {
    void operator()(lodsmith_text *text) const { lodsmith_text_free(text); }
};
using Text = std::unique_ptr<lodsmith_text, FreeText>;
#endif

void check(int32_t code) {
    if (code != LODSMITH_OK) throw std::runtime_error(lodsmith_error_message());
}

Vertex vertex(double x, double y, double z) {
    return {{float(x), float(y), float(z)}, {0, 0, 0}, float(z)};
}

Mesh torus(uint32_t around, uint32_t across) {
    const double turn = 6.283185307179586;
    Mesh mesh;
    for (uint32_t i = 0; i < around; ++i) {
        for (uint32_t j = 0; j < across; ++j) {
            double u = turn * i / around, v = turn * j / across;
            double tube = 0.4 + 0.05 * std::sin(5 * u) * std::sin(3 * v), ring = 1 + tube * std::cos(v);
            mesh.vertices.push_back(vertex(ring * std::cos(u), ring * std::sin(u), tube * std::sin(v)));
            auto at = [&](uint32_t i, uint32_t j) { return i % around * across + j % across; };
            uint32_t a = at(i, j), b = at(i + 1, j), c = at(i + 1, j + 1), d = at(i, j + 1);
            for (uint32_t k : {a, b, c, a, c, d}) mesh.indices.push_back(k);
        }
    }
    return mesh;
}

Mesh read(const char *path) {
    std::ifstream file(path);
    if (!file) throw std::runtime_error(std::string("cannot read ") + path);
    Mesh mesh;
    for (std::string line, word; std::getline(file, line);) {
        std::istringstream words(line);
        if (!(words >> word)) continue;
        if (word == "v") {
            double x = 0, y = 0, z = 0;
            words >> x >> y >> z;
            mesh.vertices.push_back(vertex(x, y, z));
        } else if (word == "f") {
            std::vector<uint32_t> corners;
            while (words >> word) {
                long i = std::strtol(word.c_str(), nullptr, 10);
                corners.push_back(uint32_t(i > 0 ? i - 1 : long(mesh.vertices.size()) + i));
            }
            for (size_t k = 2; k < corners.size(); ++k)
                mesh.indices.insert(mesh.indices.end(), {corners[0], corners[k - 1], corners[k]});
        }
    }
    return mesh;
}

void set_normals(Mesh &mesh) {
    for (size_t f = 0; f + 2 < mesh.indices.size(); f += 3) {
        Vertex *t[3];
        for (int k = 0; k < 3; ++k) t[k] = &mesh.vertices.at(mesh.indices[f + k]);
        float a[3], b[3];
        for (int k = 0; k < 3; ++k) {
            a[k] = t[1]->position[k] - t[0]->position[k];
            b[k] = t[2]->position[k] - t[0]->position[k];
        }
        for (Vertex *v : t)
            for (int k = 0; k < 3; ++k)
                v->normal[k] += a[(k + 1) % 3] * b[(k + 2) % 3] - a[(k + 2) % 3] * b[(k + 1) % 3];
    }
    for (Vertex &v : mesh.vertices) {
        float length = std::sqrt(v.normal[0] * v.normal[0] + v.normal[1] * v.normal[1] + v.normal[2] * v.normal[2]);
        for (float &x : v.normal) x = length > 0 ? x / length : 0.0f;
    }
}

// As game engines do it: the vertices stay, and the index buffer gets shorter.
void simplify_indices(const Mesh &mesh, size_t target) {
    std::vector<uint32_t> lod(mesh.indices.size());
    float error = 0;
    lod.resize(lodsmith_simplify_indices(lod.data(), mesh.indices.data(), mesh.indices.size(),
                                         mesh.vertices[0].position, mesh.vertices.size(), sizeof(Vertex), target,
                                         FLT_MAX, 0, &error));
    if (const char *message = lodsmith_error_message()) throw std::runtime_error(message);
    std::printf("indices:    %zu -> %zu, error about %g of the extent\n", mesh.indices.size(), lod.size(), error);

    // With normals in the cost, and the first vertex locked.
    const float weights[3] = {0.5f, 0.5f, 0.5f};
    std::vector<unsigned char> locks(mesh.vertices.size());
    locks[0] = LODSMITH_VERTEX_LOCK;
    lod.resize(mesh.indices.size());
    lod.resize(lodsmith_simplify_indices_with_attributes(
        lod.data(), mesh.indices.data(), mesh.indices.size(), mesh.vertices[0].position, mesh.vertices.size(),
        sizeof(Vertex), mesh.vertices[0].normal, sizeof(Vertex), weights, 3, locks.data(), target, FLT_MAX, 0, &error));
    if (const char *message = lodsmith_error_message()) throw std::runtime_error(message);
    std::printf("attributes: %zu -> %zu, error about %g\n", mesh.indices.size(), lod.size(), error);

    // With vertices that move.
    Mesh moved = mesh;
    moved.indices.resize(lodsmith_simplify_indices_with_update(
        moved.indices.data(), moved.indices.size(), moved.vertices[0].position, moved.vertices.size(), sizeof(Vertex),
        moved.vertices[0].normal, sizeof(Vertex), weights, 3, nullptr, target, FLT_MAX, 0, &error));
    if (const char *message = lodsmith_error_message()) throw std::runtime_error(message);
    std::printf("update:     %zu -> %zu, error about %g\n", mesh.indices.size(), moved.indices.size(), error);
}

struct Progress {
    int calls;
};

int32_t on_progress(void *user, int32_t, double) {
    ++static_cast<Progress *>(user)->calls;
    return LODSMITH_CONTINUE;
}

// The closest mesh for the count: new vertices, all attributes, and a report.
Mesh simplify_best(const Mesh &mesh, size_t target_faces) {
    lodsmith_attribute height{};
    height.kind = LODSMITH_ATTRIBUTE_CUSTOM;
    height.name = "height";
    height.width = 1;
    height.values = &mesh.vertices[0].height;
    height.stride = sizeof(Vertex);

    lodsmith_mesh_view view{};
    view.size = sizeof view;
    view.vertex_count = mesh.vertices.size();
    view.positions = mesh.vertices[0].position;
    view.positions_stride = sizeof(Vertex);
    view.normals = mesh.vertices[0].normal;
    view.normals_stride = sizeof(Vertex);
    view.indices = mesh.indices.data();
    view.index_count = mesh.indices.size();
    view.attributes = &height;
    view.attribute_count = 1;

    lodsmith_options options;
    check(lodsmith_options_init(&options, sizeof options));
    options.target_faces = target_faces;
    options.measure = LODSMITH_MEASURE_ALWAYS;

    Progress progress{0};
    lodsmith_result *made = nullptr;
    check(lodsmith_simplify(&view, &options, on_progress, &progress, &made));
    Result result(made);

    lodsmith_report report{};
    report.size = sizeof report;
    check(lodsmith_result_report(result.get(), &report));
    std::printf("best:       %zu -> %zu triangles, RMS %.4g %%, largest %.4g %% of the diagonal, %d progress calls\n",
                report.input_faces, report.faces, 100 * report.rms.symmetric / report.diagonal,
                100 * report.max.symmetric / report.diagonal, progress.calls);

    Mesh lod;
    lod.vertices.resize(lodsmith_result_vertex_count(result.get()));
    lod.indices.resize(lodsmith_result_index_count(result.get()));
    Vertex *to = lod.vertices.data();
    const size_t count = lod.vertices.size();
    check(lodsmith_result_copy_indices(result.get(), lod.indices.data(), lod.indices.size()));
    check(lodsmith_result_copy_positions(result.get(), to->position, sizeof(Vertex), count));
    check(lodsmith_result_copy_normals(result.get(), to->normal, sizeof(Vertex), count));
    check(lodsmith_result_copy_attribute(result.get(), 0, &to->height, sizeof(Vertex), count));
    return lod;
}

// A whole file, as with the command: with its materials, from any format to any other.
void simplify_file(const char *input, const char *output) {
#ifdef LODSMITH_FILES
    lodsmith_file_job job{};
    job.size = sizeof job;
    job.verb = "simplify";
    job.input = input;
    job.output = output;
    job.options = "{\"ratio\": 0.5, \"normals\": \"recompute\"}";

    Progress progress{0};
    lodsmith_text *made = nullptr;
    check(lodsmith_run_file_job(&job, on_progress, &progress, &made));
    Text outcome(made);
    std::printf("file:       %s\n", lodsmith_text_get(outcome.get()));
#else
    throw std::runtime_error(std::string("without files: ") + input + " to " + output);
#endif
}

} // namespace

int main(int argc, char **argv) {
    try {
        std::printf("lodsmith %s\n", lodsmith_version());
        Mesh mesh = argc > 1 ? read(argv[1]) : torus(96, 48);
        if (mesh.indices.empty()) throw std::runtime_error("no triangles");
        set_normals(mesh);
        simplify_indices(mesh, mesh.indices.size() / 30 * 3);
        Mesh lod = simplify_best(mesh, mesh.indices.size() / 30);
        std::printf("            %zu vertices with all attributes\n", lod.vertices.size());
        if (argc > 2) simplify_file(argv[1], argv[2]);
    } catch (const std::exception &error) {
        std::cerr << "error: " << error.what() << '\n';
        return 1;
    }
}
