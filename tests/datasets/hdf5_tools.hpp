// To spoil a good file in one place: thin wrappers over HDF5's C API, for the tests only.
#pragma once

#include <hdf5.h>

#include <functional>
#include <initializer_list>
#include <stdexcept>
#include <string>
#include <vector>

namespace unhand::datasets::test {

inline void must(bool ok) {
  if (!ok) throw std::runtime_error("the test could not prepare its file");
}

/// A file open for changes.
struct Editor {
  hid_t file;
  explicit Editor(const std::string& name) : file(H5Fopen(name.c_str(), H5F_ACC_RDWR, H5P_DEFAULT)) {
    must(file >= 0);
  }
  ~Editor() { H5Fclose(file); }
  Editor(const Editor&) = delete;
  Editor& operator=(const Editor&) = delete;

  void remove(const std::string& path) const { must(H5Ldelete(file, path.c_str(), H5P_DEFAULT) >= 0); }
  void rename(const std::string& from, const std::string& to) const {
    must(H5Lmove(file, from.c_str(), file, to.c_str(), H5P_DEFAULT, H5P_DEFAULT) >= 0);
  }
  void group(const std::string& path) const { must(H5Gclose(H5Gcreate2(file, path.c_str(), 0, 0, 0)) >= 0); }

  void remove_attribute(const std::string& path, const std::string& name) const {
    must(H5Adelete_by_name(file, path.c_str(), name.c_str(), H5P_DEFAULT) >= 0);
  }
  void rename_attribute(const std::string& path, const std::string& from, const std::string& to) const {
    must(H5Arename_by_name(file, path.c_str(), from.c_str(), to.c_str(), H5P_DEFAULT) >= 0);
  }
  /// Replaces (or makes) an attribute of any type; no sizes: a scalar.
  void attribute(const std::string& path, const std::string& name, hid_t type, const void* values,
                 std::vector<hsize_t> sizes = {}) const {
    if (H5Aexists_by_name(file, path.c_str(), name.c_str(), H5P_DEFAULT) > 0) remove_attribute(path, name);
    const hid_t space =
        sizes.empty() ? H5Screate(H5S_SCALAR) : H5Screate_simple(int(sizes.size()), sizes.data(), nullptr);
    const hid_t made = H5Acreate_by_name(file, path.c_str(), name.c_str(), type, space, 0, 0, 0);
    must(made >= 0 && H5Awrite(made, type, values) >= 0);
    H5Aclose(made);
    H5Sclose(space);
  }
  void real(const std::string& path, const std::string& name, double value) const {
    attribute(path, name, H5T_NATIVE_DOUBLE, &value);
  }
  void reals(const std::string& path, const std::string& name, std::vector<double> values) const {
    attribute(path, name, H5T_NATIVE_DOUBLE, values.data(), {values.size()});
  }
  void integer(const std::string& path, const std::string& name, long long value) const {
    attribute(path, name, H5T_NATIVE_LLONG, &value);
  }
  /// Fixed length, padded as said.
  void fixed_text(const std::string& path, const std::string& name, std::string text, H5T_str_t pad,
                  std::size_t size) const {
    const hid_t type = H5Tcopy(H5T_C_S1);
    H5Tset_size(type, size);
    H5Tset_strpad(type, pad);
    text.resize(size, pad == H5T_STR_SPACEPAD ? ' ' : '\0');
    attribute(path, name, type, text.data());
    H5Tclose(type);
  }
  void text(const std::string& path, const std::string& name, const std::string& value) const {
    fixed_text(path, name, value, H5T_STR_NULLTERM, value.size() + 1);
  }

  /// Replaces a dataset by one of that type and shape, keeping units; `values` may be null (nothing is
  /// written then).
  void dataset(const std::string& path, hid_t type, std::vector<hsize_t> sizes, const void* values,
               const std::string& units, bool chunked = false) const {
    if (H5Lexists(file, path.c_str(), H5P_DEFAULT) > 0) remove(path);
    const hid_t space = H5Screate_simple(int(sizes.size()), sizes.data(), nullptr);
    const hid_t creation = H5Pcreate(H5P_DATASET_CREATE);
    if (chunked) {
      std::vector<hsize_t> chunk(sizes.size(), 1);
      must(H5Pset_chunk(creation, int(sizes.size()), chunk.data()) >= 0);
    }
    const hid_t made = H5Dcreate2(file, path.c_str(), type, space, 0, creation, 0);
    must(made >= 0);
    if (values != nullptr) must(H5Dwrite(made, type, H5S_ALL, H5S_ALL, 0, values) >= 0);
    H5Dclose(made);
    H5Pclose(creation);
    H5Sclose(space);
    if (!units.empty()) text(path, "units", units);
  }
  /// Replaces a dataset by one of a single chunk, whose bytes are as a filter of this number left them.
  void filtered(const std::string& path, std::vector<hsize_t> sizes, H5Z_filter_t filter,
                const std::vector<unsigned>& filter_values, const std::vector<char>& bytes,
                const std::string& units) const {
    if (H5Lexists(file, path.c_str(), H5P_DEFAULT) > 0) remove(path);
    const hid_t space = H5Screate_simple(int(sizes.size()), sizes.data(), nullptr);
    const hid_t creation = H5Pcreate(H5P_DATASET_CREATE);
    must(H5Pset_chunk(creation, int(sizes.size()), sizes.data()) >= 0);
    must(H5Pset_filter(creation, filter, H5Z_FLAG_OPTIONAL, filter_values.size(), filter_values.data()) >= 0);
    const hid_t made = H5Dcreate2(file, path.c_str(), H5T_NATIVE_DOUBLE, space, 0, creation, 0);
    const std::vector<hsize_t> first(sizes.size(), 0);
    must(made >= 0 && H5Dwrite_chunk(made, 0, 0, first.data(), bytes.size(), bytes.data()) >= 0);
    H5Dclose(made);
    H5Pclose(creation);
    H5Sclose(space);
    text(path, "units", units);
  }
  void doubles(const std::string& path, std::vector<hsize_t> sizes, std::vector<double> values,
               const std::string& units) const {
    dataset(path, H5T_NATIVE_DOUBLE, std::move(sizes), values.data(), units);
  }
  /// Overwrites one number of a dataset.
  void poke(const std::string& path, std::size_t index, double value) const {
    const hid_t set = H5Dopen2(file, path.c_str(), 0);
    const hid_t space = H5Dget_space(set);
    std::vector<double> all(std::size_t(H5Sget_simple_extent_npoints(space)));
    must(H5Dread(set, H5T_NATIVE_DOUBLE, H5S_ALL, H5S_ALL, 0, all.data()) >= 0);
    all.at(index) = value;
    must(H5Dwrite(set, H5T_NATIVE_DOUBLE, H5S_ALL, H5S_ALL, 0, all.data()) >= 0);
    H5Sclose(space);
    H5Dclose(set);
  }
};

using Spoil = std::function<void(const Editor&)>;

}  // namespace unhand::datasets::test
