// A referee, built only for the benchmark and not distributed in binary form (CGAL's Mesh_3 is under the GPL; no part of the project
// links to it): cgal_mesher SOLID SIZE raw|optimised [OUT.raw|- [CURVES]]
//
// The solids are those of the programs *.hf, as C++ that the compiler can inline. CGAL finds no edges in a function: those of part and
// blend are written out here, those of the gyroid are read from CURVES (for each curve the number of its points, then the points).
// CGAL wants f < 0 inside.
#include <CGAL/Exact_predicates_inexact_constructions_kernel.h>
#include <CGAL/Labeled_mesh_domain_3.h>
#include <CGAL/Mesh_complex_3_in_triangulation_3.h>
#include <CGAL/Mesh_criteria_3.h>
#include <CGAL/Mesh_domain_with_polyline_features_3.h>
#include <CGAL/Mesh_triangulation_3.h>
#include <CGAL/make_mesh_3.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <fstream>
#include <iostream>
#include <string>
#include <unordered_map>
#include <vector>

using Kernel = CGAL::Exact_predicates_inexact_constructions_kernel;
using Point = Kernel::Point_3;
using Polyline = std::vector<Point>;
using Domain = CGAL::Mesh_domain_with_polyline_features_3<CGAL::Labeled_mesh_domain_3<Kernel>>;
using Triangulation = CGAL::Mesh_triangulation_3<Domain>::type;
using Complex = CGAL::Mesh_complex_3_in_triangulation_3<Triangulation, Domain::Corner_index, Domain::Curve_index>;
using Criteria = CGAL::Mesh_criteria_3<Triangulation>;
namespace parameters = CGAL::parameters;

// ---- the solids

const double PI = std::acos(-1.0);

double slab(double x, double lo, double hi) { return std::min(x - lo, hi - x); }

double part(const Point& p) {
  const double box = std::min({slab(p.x(), -5, 5), slab(p.y(), -4, 1), slab(p.z(), -2, 2)});
  const double c1 = std::hypot(p.x() + 2, p.y() + 1.5) - 1.25, c2 = std::hypot(p.x() - 3, p.y() - 0.5) - 1.5;
  return -std::min({box, c1, c2});
}

double sphere(const Point& p) { return std::sqrt(p.x() * p.x() + p.y() * p.y() + p.z() * p.z()) - 1; }

double blend(const Point& p) {
  const double r = std::hypot(p.x(), p.y()), k = 0.4;
  const double plate = std::min({slab(p.x(), -3, 3), slab(p.y(), -2, 2), slab(p.z(), -0.5, 0.5)});
  const double boss = std::min({1 - r, 2.5 - p.z(), p.z()});
  const double h = std::max(k - std::abs(plate - boss), 0.0) / k;
  return -std::min(std::max(plate, boss) + h * h * k / 4, r - 0.5);
}

double gyroid(const Point& p) {
  const double w = 2 * PI, x = w * p.x(), y = w * p.y(), z = w * p.z();
  const double g = std::sin(x) * std::cos(y) + std::sin(y) * std::cos(z) + std::sin(z) * std::cos(x);
  const double cube = 0.95 - std::max({std::abs(p.x()), std::abs(p.y()), std::abs(p.z())});
  return -std::min(cube, (0.6 - std::abs(g)) / (1.5 * w));
}

// ---- their edges

Polyline arc(double x, double y, double z, double r, double from, double to) {
  Polyline points;
  for (int i = 0; i <= 400; i++) {
    const double t = from + (to - from) * i / 400;
    points.emplace_back(x + r * std::cos(t), y + r * std::sin(t), z);
  }
  return points;
}

Polyline circle(double x, double y, double z, double r) {
  Polyline points = arc(x, y, z, r, 0, 2 * PI);
  points.back() = points.front();
  return points;
}

// All edges of a box but those along x at y = hi[1].
std::vector<Polyline> box_edges(std::array<double, 3> lo, std::array<double, 3> hi) {
  std::vector<Polyline> edges;
  for (double z : {lo[2], hi[2]}) {
    edges.push_back({Point(lo[0], lo[1], z), Point(hi[0], lo[1], z)});
    for (double x : {lo[0], hi[0]}) edges.push_back({Point(x, lo[1], z), Point(x, hi[1], z)});
  }
  for (double x : {lo[0], hi[0]})
    for (double y : {lo[1], hi[1]}) edges.push_back({Point(x, y, lo[2]), Point(x, y, hi[2])});
  return edges;
}

// The second cylinder cuts the side y = 1 from a to b.
std::vector<Polyline> part_edges() {
  std::vector<Polyline> edges = box_edges({-5, -4, -2}, {5, 1, 2});
  const double half = std::sqrt(1.5 * 1.5 - 0.5 * 0.5), t = std::asin(0.5 / 1.5), a = 3 - half, b = 3 + half;
  for (double z : {-2.0, 2.0}) {
    edges.push_back({Point(-5, 1, z), Point(a, 1, z)});
    edges.push_back({Point(b, 1, z), Point(5, 1, z)});
    edges.push_back(circle(-2, -1.5, z, 1.25));
    edges.push_back(arc(3, 0.5, z, 1.5, PI - t, 2 * PI + t));
    edges.back().front() = Point(a, 1, z);
    edges.back().back() = Point(b, 1, z);
  }
  for (double x : {a, b}) edges.push_back({Point(x, 1, -2), Point(x, 1, 2)});
  return edges;
}

std::vector<Polyline> blend_edges() {
  std::vector<Polyline> edges = box_edges({-3, -2, -0.5}, {3, 2, 0.5});
  for (double z : {-0.5, 0.5}) edges.push_back({Point(-3, 2, z), Point(3, 2, z)});
  edges.push_back(circle(0, 0, 2.5, 1));
  edges.push_back(circle(0, 0, 2.5, 0.5));
  edges.push_back(circle(0, 0, -0.5, 0.5));
  return edges;
}

std::vector<Polyline> read_edges(const char* path) {
  std::ifstream in(path);
  std::vector<Polyline> edges;
  for (std::size_t n; in >> n;) {
    edges.emplace_back(n);
    for (Point& p : edges.back()) in >> p;
  }
  return edges;
}

// ---- the mesh

template <class T>
void put(std::ostream& out, T value) { out.write(reinterpret_cast<const char*>(&value), sizeof value); }

// The file that `measure` reads; the tetrahedra of the solid and the triangles of its surface.
void write(const Complex& complex, const char* path) {
  const Triangulation& t = complex.triangulation();
  std::unordered_map<Triangulation::Vertex_handle, std::uint32_t> number;
  std::vector<Triangulation::Vertex_handle> vertices;
  const auto number_of = [&](Triangulation::Vertex_handle v) {
    if (number.emplace(v, vertices.size()).second) vertices.push_back(v);
    return number.at(v);
  };
  std::vector<std::uint32_t> triangles, tets;
  for (auto c = complex.cells_in_complex_begin(); c != complex.cells_in_complex_end(); ++c)
    for (int i = 0; i < 4; i++) tets.push_back(number_of(c->vertex(i)));
  for (auto f = complex.facets_in_complex_begin(); f != complex.facets_in_complex_end(); ++f) {
    const auto facet = complex.is_in_complex(f->first) ? *f : t.mirror_facet(*f);
    for (int i = 0; i < 3; i++) triangles.push_back(number_of(facet.first->vertex(t.vertex_triple_index(facet.second, i))));
  }
  std::ofstream out(path, std::ios::binary);
  put<std::uint64_t>(out, vertices.size());
  put<std::uint64_t>(out, triangles.size() / 3);
  put<std::uint64_t>(out, tets.size() / 4);
  for (auto v : vertices)
    for (int i = 0; i < 3; i++) put<double>(out, t.point(v)[i]);
  for (auto v : triangles) put(out, v);
  for (auto v : tets) put(out, v);
}

int main(int argc, char** argv) {
  if (argc < 4) return std::cerr << "cgal_mesher SOLID SIZE raw|optimised [OUT.raw|- [CURVES]]\n", 2;
  const std::string name = argv[1];
  const double size = std::stod(argv[2]);
  double (*const function)(const Point&) = name == "part" ? part : name == "sphere" ? sphere : name == "blend" ? blend : gyroid;
  const double radius = name == "part" ? 7.5 : name == "sphere" ? 1.2 : name == "blend" ? 5.0 : 2.0;
  Domain domain(Domain::create_implicit_mesh_domain(function, Kernel::Sphere_3(CGAL::ORIGIN, radius * radius),
                                                    parameters::relative_error_bound = 1e-6));
  const std::vector<Polyline> edges = name == "part" ? part_edges() : name == "blend" ? blend_edges()
                                    : argc > 5 ? read_edges(argv[5]) : std::vector<Polyline>();
  domain.add_features(edges.begin(), edges.end());
  const Criteria criteria(parameters::edge_size = size, parameters::facet_angle = 25, parameters::facet_size = size,
                          parameters::facet_distance = 0.1 * size, parameters::cell_radius_edge_ratio = 2,
                          parameters::cell_size = size);
  Complex complex;
  if (argv[3] == std::string("raw"))
    complex = CGAL::make_mesh_3<Complex>(domain, criteria, parameters::no_perturb(), parameters::no_exude());
  else
    complex = CGAL::make_mesh_3<Complex>(domain, criteria, parameters::perturb(parameters::sliver_bound = 12), parameters::exude());
  if (argc > 4 && argv[4] != std::string("-")) write(complex, argv[4]);
}
