#include "datasets/hdf5_writer.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <filesystem>

#include "datasets/channel_rules.hpp"
#include "datasets/whole_file.hpp"

namespace unhand::datasets::hdf5 {
namespace {

namespace fs = std::filesystem;

constexpr hsize_t chunk_rows = 4096;
constexpr unsigned gzip_level = 4;

/// Objects without timestamps: the same log gives the same bytes.
template <class Class>
Handle timeless(Class kind) {
  Handle list = list_handle(H5Pcreate(kind));
  H5Pset_obj_track_times(list.id(), false);
  return list;
}

/// One value or a list under `name` on an object; false when HDF5 refuses.
bool put_attribute(hid_t object, std::string_view name, hid_t type, const void* values, std::size_t n,
                   bool scalar) {
  const hsize_t size = n;
  const Handle space = space_handle(scalar ? H5Screate(H5S_SCALAR) : H5Screate_simple(1, &size, nullptr));
  const Handle attribute = attribute_handle(
      H5Acreate2(object, std::string(name).c_str(), type, space.id(), H5P_DEFAULT, H5P_DEFAULT));
  return attribute && H5Awrite(attribute.id(), type, values) >= 0;
}

bool put_text(hid_t object, std::string_view name, const std::string& value) {
  const Handle type = type_handle(H5Tcopy(H5T_C_S1));
  H5Tset_size(type.id(), H5T_VARIABLE);
  H5Tset_cset(type.id(), H5T_CSET_UTF8);
  const char* content = value.c_str();
  return put_attribute(object, name, type.id(), static_cast<const void*>(&content), 1, true);
}

}  // namespace

void Output::fail(std::string_view name) const {
  throw LogError(file_, join(path_, name), fmt::format("cannot be written ({})", last_message()));
}

Output Output::group(std::string_view name) const {
  const Handle creation = timeless(H5P_GROUP_CREATE);
  const Handle link = list_handle(H5Pcreate(H5P_LINK_CREATE));
  H5Pset_char_encoding(link.id(), H5T_CSET_UTF8);
  Handle made =
      group_handle(H5Gcreate2(group_.id(), std::string(name).c_str(), link.id(), creation.id(), H5P_DEFAULT));
  if (!made) fail(name);
  return {file_, std::move(made), join(path_, name)};
}

void Output::text(std::string_view name, const std::string& value) const {
  if (!put_text(group_.id(), name, value)) fail(name);
}

void Output::integer(std::string_view name, long long value) const {
  if (!put_attribute(group_.id(), name, H5T_NATIVE_LLONG, &value, 1, true)) fail(name);
}

void Output::reals(std::string_view name, const double* values, std::size_t n, bool scalar) const {
  if (!put_attribute(group_.id(), name, H5T_NATIVE_DOUBLE, values, n, scalar)) fail(name);
}

Handle Output::table(std::string_view name, hid_t type, std::size_t rows, std::size_t cols,
                     const void* values) const {
  const hsize_t sizes[] = {rows, cols};
  const hsize_t chunk[] = {std::min<hsize_t>(rows, chunk_rows), cols};
  const int rank = cols == 1 ? 1 : 2;
  const Handle space = space_handle(H5Screate_simple(rank, sizes, nullptr));
  const Handle creation = timeless(H5P_DATASET_CREATE);
  const bool ready = H5Pset_chunk(creation.id(), rank, chunk) >= 0 && H5Pset_shuffle(creation.id()) >= 0 &&
                     H5Pset_deflate(creation.id(), gzip_level) >= 0 && H5Pset_fletcher32(creation.id()) >= 0;
  Handle dataset;
  if (ready) {
    dataset = dataset_handle(H5Dcreate2(group_.id(), std::string(name).c_str(), type, space.id(), H5P_DEFAULT,
                                        creation.id(), H5P_DEFAULT));
  }
  if (!dataset || H5Dwrite(dataset.id(), type, H5S_ALL, H5S_ALL, H5P_DEFAULT, values) < 0) fail(name);
  return dataset;
}

void Output::sigma(const Handle& dataset, std::string_view name, const std::vector<double>& values) const {
  if (values.empty()) return;
  const bool one = std::all_of(values.begin(), values.end(), [&](double s) { return s == values.front(); });
  if (!put_attribute(dataset.id(), "sigma", H5T_NATIVE_DOUBLE, values.data(), one ? 1 : values.size(), one))
    fail(name);
}

void Output::series(std::string_view name, const Series& series, std::string_view units) const {
  const Handle dataset = table(name, H5T_NATIVE_DOUBLE, series.rows, series.cols, series.data.data());
  if (!put_text(dataset.id(), "units", std::string(units))) fail(name);
  sigma(dataset, name, series.sigma);
}

void Output::flags(std::string_view name, const Flags& flags) const {
  const Handle dataset = table(name, H5T_NATIVE_UINT8, flags.size(), 1, flags.data());
  if (!put_text(dataset.id(), "units", "1")) fail(name);
}

std::string image_of(const std::string& file, const std::function<void(const Output&)>& fill) {
  const auto fail = [&](const char* what) {
    throw LogError(file, "/", fmt::format("cannot be {} ({})", what, last_message()));
  };
  constexpr std::size_t growth = 1 << 20;
  const Handle access = list_handle(H5Pcreate(H5P_FILE_ACCESS));
  const Handle creation = timeless(H5P_FILE_CREATE);
  const bool in_memory = H5Pset_fapl_core(access.id(), growth, false) >= 0;
  Handle made;
  // Of a name that exists the driver would read all of the file first.
  constexpr const char* nowhere = ".unhand-log-in-memory";
  if (in_memory) made = file_handle(H5Fcreate(nowhere, H5F_ACC_TRUNC, creation.id(), access.id()));
  if (!made) fail("created");
  {
    const Output root(file, group_handle(H5Gopen2(made.id(), "/", H5P_DEFAULT)), "/");
    fill(root);
  }
  if (H5Fflush(made.id(), H5F_SCOPE_GLOBAL) < 0) fail("finished");
  const ssize_t size = H5Fget_file_image(made.id(), nullptr, 0);
  std::string image(size > 0 ? static_cast<std::size_t>(size) : 0, '\0');
  if (size <= 0 || H5Fget_file_image(made.id(), image.data(), image.size()) != size || !made.close())
    fail("finished");
  return image;
}

void write_atomically(const std::filesystem::path& file, std::string_view image) {
  std::error_code error;
  if (fs::is_directory(file, error)) throw LogError(file.string(), "/", "is a directory: a log is one file");
  if (const std::string failed = replace_whole(file, image); !failed.empty())
    throw LogError(file.string(), "/", "cannot be written: " + failed);
}

}  // namespace unhand::datasets::hdf5
