// CGAL's edge collapse for bench/tolerance.py, which builds and runs it (packages libcgal-dev, libgmp-dev, libmpfr-dev).
//
//     tolerance_cgal MODE IN OUT VALUE
//
// MODE: `count` collapses to VALUE faces; `count-normal` with the filter that bounds the change of normals; `envelope`
// collapses as long as the polyhedral envelope of width VALUE around the input allows.
// IN and OUT: the numbers of vertices and faces as 64-bit integers, positions as doubles, faces as 32-bit indices.
// Ends with status 3 if the input is not a manifold.
#include <CGAL/Exact_predicates_inexact_constructions_kernel.h>
#include <CGAL/Surface_mesh.h>
#include <CGAL/Surface_mesh_simplification/Policies/Edge_collapse/Bounded_normal_change_filter.h>
#include <CGAL/Surface_mesh_simplification/Policies/Edge_collapse/LindstromTurk_cost.h>
#include <CGAL/Surface_mesh_simplification/Policies/Edge_collapse/LindstromTurk_placement.h>
#include <CGAL/Surface_mesh_simplification/Policies/Edge_collapse/Polyhedral_envelope_filter.h>
#include <CGAL/Surface_mesh_simplification/edge_collapse.h>

#include <cstdint>
#include <fstream>
#include <string>
#include <vector>

namespace sms = CGAL::Surface_mesh_simplification;
using Kernel = CGAL::Exact_predicates_inexact_constructions_kernel;
using Mesh = CGAL::Surface_mesh<Kernel::Point_3>;
using NormalFilter = sms::Bounded_normal_change_filter<>;

struct StopAtFaces {
    std::size_t faces;
    template <class Profile>
    bool operator()(double, const Profile& profile, std::size_t, std::size_t) const {
        return profile.surface_mesh().number_of_faces() <= faces;
    }
};

template <class Filter>
void collapse(Mesh& mesh, std::size_t faces, const Filter& filter) {
    sms::edge_collapse(mesh, StopAtFaces{faces},
                       CGAL::parameters::get_cost(sms::LindstromTurk_cost<Mesh>())
                           .get_placement(sms::LindstromTurk_placement<Mesh>())
                           .filter(filter));
}

struct Everything {
    template <class Profile, class Point>
    Point operator()(const Profile&, const Point& place) const { return place; }
};

int main(int argc, char** argv) {
    if (argc != 5) return 2;
    const std::string mode = argv[1];
    std::ifstream in(argv[2], std::ios::binary);
    std::int64_t counts[2];
    in.read(reinterpret_cast<char*>(counts), sizeof counts);
    std::vector<double> positions(3 * counts[0]);
    std::vector<std::int32_t> indices(3 * counts[1]);
    in.read(reinterpret_cast<char*>(positions.data()), positions.size() * sizeof(double));
    in.read(reinterpret_cast<char*>(indices.data()), indices.size() * sizeof(std::int32_t));
    if (!in) return 2;

    Mesh mesh;
    for (std::size_t i = 0; i < positions.size(); i += 3)
        mesh.add_vertex({positions[i], positions[i + 1], positions[i + 2]});
    for (std::size_t i = 0; i < indices.size(); i += 3) {
        const auto corner = [&](int k) { return Mesh::Vertex_index(indices[i + k]); };
        if (mesh.add_face(corner(0), corner(1), corner(2)) == Mesh::null_face()) return 3;
    }
    const double value = std::stod(argv[4]);
    const auto faces = static_cast<std::size_t>(value);
    if (mode == "count") collapse(mesh, faces, Everything());
    else if (mode == "count-normal") collapse(mesh, faces, NormalFilter());
    else if (mode == "envelope") collapse(mesh, 0, sms::Polyhedral_envelope_filter<Kernel>(value));
    else return 2;
    mesh.collect_garbage();

    std::ofstream out(argv[3], std::ios::binary);
    const std::int64_t left[2] = {std::int64_t(mesh.number_of_vertices()), std::int64_t(mesh.number_of_faces())};
    out.write(reinterpret_cast<const char*>(left), sizeof left);
    for (auto v : mesh.vertices())
        for (int k = 0; k < 3; k++) {
            const double x = mesh.point(v)[k];
            out.write(reinterpret_cast<const char*>(&x), sizeof x);
        }
    for (auto f : mesh.faces())
        for (auto v : mesh.vertices_around_face(mesh.halfedge(f))) {
            const std::int32_t index = v;
            out.write(reinterpret_cast<const char*>(&index), sizeof index);
        }
    return out ? 0 : 2;
}
