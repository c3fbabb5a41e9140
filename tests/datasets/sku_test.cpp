// Files that describe an object: keys, units, and the inertia of a shape.
#include "datasets/sku.hpp"

#include <stdexcept>

#include "log_samples.hpp"

namespace unhand::datasets::test {
namespace {

const std::string good =
    "name = \"cracker box\"\n"
    "mass_kg = 0.411\n"
    "mass_sigma_kg = 0.005\n"
    "dims_m = [0.060, 0.158, 0.210]\n"
    "shape = \"box\"\n"
    "com_offset_m = 0.08\n"
    "com_offset_sigma_m = 0.002\n"
    "surface = \"printed cardboard\"\n"
    "source = \"kitchen scale\"\n";

Sku read_text(const Scratch& scratch, const std::string& text) {
  put_bytes(scratch / "sku.toml", text);
  return read_sku(scratch / "sku.toml");
}

TEST(Sku, TheExampleIsTheOneOfThePage) {
  const std::string page = bytes_of(UNHAND_SOURCE_DIR "/docs/validate-sku.md"),
                    example = bytes_of(UNHAND_SOURCE_DIR "/examples/bar.toml");
  const Sku sku = read_sku(UNHAND_SOURCE_DIR "/examples/bar.toml");
  EXPECT_TRUE(sku.inertia.has_value());
  EXPECT_NE(page.find(example.substr(example.find("name ="))), std::string::npos);
}

TEST(Sku, ReadsEveryKey) {
  const Scratch scratch;
  const Sku sku = read_text(scratch, good);
  EXPECT_EQ(sku.name, "cracker box");
  EXPECT_EQ(sku.mass, 0.411);
  EXPECT_EQ(sku.mass_sigma, 0.005);
  EXPECT_EQ((*sku.dims)[1], 0.158);
  EXPECT_EQ(sku.com_offset, 0.08);
  EXPECT_EQ(sku.com_offset_sigma, 0.002);
  EXPECT_EQ(sku.surface, "printed cardboard");
  EXPECT_EQ(sku.source, "kitchen scale");
  EXPECT_DOUBLE_EQ(sku.inertia.value(), 0.411 * (0.060 * 0.060 + 0.210 * 0.210) / 12);
  const Object object = to_object(sku);
  EXPECT_EQ(object.mass, sku.mass);
  EXPECT_EQ(object.inertia->at(0), *sku.inertia);
  EXPECT_EQ(object.sku, "cracker box");
}

TEST(Sku, ADeclaredInertiaWinsOverTheShape) {
  const Scratch scratch;
  EXPECT_EQ(read_text(scratch, good + "inertia_kg_m2 = 2e-3\n").inertia, 2e-3);
}

TEST(Sku, NeedsLittle) {
  const Scratch scratch;
  const Sku sku = read_text(scratch, "name='x'\nmass_kg=1\nsurface='steel'\n");
  EXPECT_EQ(sku.mass, 1);  // an integer is a number
  EXPECT_FALSE(sku.inertia || sku.dims || sku.shape);
}

/// ∫ρ(r² − r_a²)dV over a body by midpoints, about the axis a (0, 1, 2: x, y, z), for unit mass; `inside`
/// says what belongs to it.
template <class Inside>
double integrated(const std::array<double, 3>& d, Inside inside, int axis = 1) {
  const int n = 80;
  double mass = 0, sum = 0;
  for (int i = 0; i < n; ++i) {
    for (int j = 0; j < n; ++j) {
      for (int k = 0; k < n; ++k) {
        const double x = d[0] * ((i + 0.5) / n - 0.5), y = d[1] * ((j + 0.5) / n - 0.5),
                     z = d[2] * ((k + 0.5) / n - 0.5);
        if (!inside(x, y, z)) continue;
        mass += 1;
        sum += (axis != 0 ? x * x : 0) + (axis != 1 ? y * y : 0) + (axis != 2 ? z * z : 0);
      }
    }
  }
  return sum / mass;
}

// The formulas against a sum over small cells; 1 % covers 80 cells along a curved side.
TEST(Sku, ShapeInertiaIsTheIntegral) {
  const auto near = [](double a, double b) { EXPECT_NEAR(a / b, 1, 0.01); };
  near(shape_inertia("box", 1, {0.2, 0.1, 0.3}), integrated({0.2, 0.1, 0.3}, [](auto...) { return true; }));
  near(shape_inertia("cylinder", 1, {0.2, 0.1, 0.1}),
       integrated({0.2, 0.1, 0.1}, [](double, double y, double z) { return y * y + z * z < 0.05 * 0.05; }));
  near(shape_inertia("disc", 1, {0.2, 0.05, 0.2}),
       integrated({0.2, 0.05, 0.2}, [](double x, double, double z) { return x * x + z * z < 0.1 * 0.1; }));
  near(shape_inertia("sphere", 1, {0.2, 0.2, 0.2}),
       integrated({0.2, 0.2, 0.2},
                  [](double x, double y, double z) { return x * x + y * y + z * z < 0.1 * 0.1; }));
  near(shape_inertia("rod", 1, {0.2, 1e-3, 1e-3}),
       integrated({0.2, 1e-3, 1e-3}, [](auto...) { return true; }));
  EXPECT_THROW(shape_inertia("cone", 1, {1, 1, 1}), std::invalid_argument);
}

TEST(Sku, SpatialInertiaIsTheIntegralAboutEveryAxis) {
  struct Body {
    const char* shape;
    std::array<double, 3> dims;
    bool (*inside)(double, double, double);
  };
  const Body bodies[] = {
      {"box", {0.2, 0.1, 0.3}, [](double, double, double) { return true; }},
      {"cylinder", {0.2, 0.1, 0.1}, [](double, double y, double z) { return y * y + z * z < 0.05 * 0.05; }},
      {"disc", {0.2, 0.05, 0.2}, [](double x, double, double z) { return x * x + z * z < 0.1 * 0.1; }},
      {"sphere", {0.2, 0.2, 0.2}, [](double x, double y, double z) {
         return x * x + y * y + z * z < 0.1 * 0.1;
       }}};
  for (const Body& body : bodies) {
    Sku sku;
    sku.mass = 0.4;
    sku.shape = body.shape;
    sku.dims = body.dims;
    sku.inertia = shape_inertia(body.shape, sku.mass, body.dims);
    const Object object = to_object(sku, 3);
    ASSERT_TRUE(object.inertia && object.inertia->size() == 3) << body.shape;
    for (int axis = 0; axis < 3; ++axis)
      EXPECT_NEAR((*object.inertia)[axis] / (0.4 * integrated(body.dims, body.inside, axis)), 1, 0.01)
          << body.shape << ' ' << axis;
    sku.inertia = 1.1 * *sku.inertia;  // measured: the other two are then open
    EXPECT_FALSE(to_object(sku, 3).inertia) << body.shape;
  }
}

TEST(Sku, SaysWhereAndWhatIsWrong) {
  const Scratch scratch;
  const std::string file = scratch / "sku.toml";
  const auto expect = [&](const std::string& text, int line, const std::string& key,
                          const std::string& reason) {
    put_bytes(file, text);
    expect_error<TomlError>([&] { read_sku(file); }, file, key, reason);
    try {
      read_sku(file);
    } catch (const TomlError& error) {
      EXPECT_EQ(error.line, line) << error.what();
      const std::string place = line > 0 ? ":" + std::to_string(line) + ":" : ":";
      EXPECT_THAT(error.what(), testing::StartsWith(file + place));
    }
  };
  const std::string head = "name='x'\nsurface='steel'\n";
  expect(head + "mass_kg = -3\n", 3, "mass_kg", "-3 is outside (0, 1000] kg");
  expect(head + "mass_kg = 0\n", 3, "mass_kg", "outside (0, 1000] kg");
  expect(head + "mass_kg = nan\n", 3, "mass_kg", "outside (0, 1000] kg");
  expect(head + "mass_kg = 'heavy'\n", 3, "mass_kg", "is not a number; accepted: (0, 1000] kg");
  expect(head + "\nmas_kg = 1\n", 4, "mas_kg", "unknown key: did you mean 'mass_kg'?");
  expect(head + "mass_kg = 1\ncolour = 'red'\n", 4, "colour", "unknown key (known: name, mass_kg");
  expect(head, 0, "mass_kg", "required key is missing");
  expect(head + "mass_kg = 1\ndims_m = [1, 2]\n", 4, "dims_m", "is not a list of 3 numbers");
  expect(head + "mass_kg = 1\ndims_m = [1, 2, -2]\n", 4, "dims_m", "-2 is outside (0, 10] m");
  expect(head + "mass_kg = 1\nshape = 'box'\n", 4, "shape", "needs dims_m");
  expect(head + "mass_kg = 1\ndims_m = [1, 1, 1]\nshape = 'cone'\n", 5, "shape",
         "'cone' is not one of box, rod");
  expect(head + "mass_kg = 1\ndims_m = [1, 1, 2]\nshape = 'cylinder'\n", 5, "shape", "equal y and z");
  expect(head + "mass_kg = 1\nmass_sigma_kg = -1\n", 4, "mass_sigma_kg", "-1 is outside [0, 1000] kg");
  expect(head + "mass_kg = 1\ninertia_kg_m2 = 0\n", 4, "inertia_kg_m2", "0 is outside (0");
  expect("name = \n", 1, "syntax", "");
  expect("name = 'a'\nname = 'b'\n", 2, "syntax", "");
  std::filesystem::remove(file);
  expect_error<TomlError>([&] { read_sku(file); }, file, "", "no such file");
}

}  // namespace
}  // namespace unhand::datasets::test
