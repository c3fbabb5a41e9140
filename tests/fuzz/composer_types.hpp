// The odd things that a composed file may hold in place of what is wanted. For the composer's sources.
#pragma once

#include <array>
#include <limits>
#include <stdexcept>
#include <string>
#include <vector>

#include "datasets/hdf5_handles.hpp"

namespace unhand::fuzz {

using namespace datasets::hdf5;

inline void must(bool ok) {
  if (!ok) throw std::logic_error("the composer could not write its file");
}

inline Handle scalar() { return space_handle(H5Screate(H5S_SCALAR)); }
inline Handle block(std::vector<hsize_t> sizes) {
  return space_handle(H5Screate_simple(static_cast<int>(sizes.size()), sizes.data(), nullptr));
}

/// Types that no log has.
inline Handle odd_type(unsigned which) {
  const hsize_t two = 2;
  switch (which % 6) {
    case 0:
      return type_handle(H5Tarray_create2(H5T_NATIVE_DOUBLE, 1, &two));
    case 1: {
      Handle pair = type_handle(H5Tcreate(H5T_COMPOUND, 16));
      H5Tinsert(pair.id(), "re", 0, H5T_NATIVE_DOUBLE);
      H5Tinsert(pair.id(), "im", 8, H5T_NATIVE_DOUBLE);
      return pair;
    }
    case 2:
      return type_handle(H5Tvlen_create(H5T_NATIVE_DOUBLE));
    case 3: {
      Handle boolean = type_handle(H5Tenum_create(H5T_NATIVE_INT8));
      const std::int8_t no = 0, yes = 1;
      H5Tenum_insert(boolean.id(), "FALSE", &no);
      H5Tenum_insert(boolean.id(), "TRUE", &yes);
      return boolean;
    }
    case 4:
      return type_handle(H5Tcreate(H5T_OPAQUE, 8));
    default:
      return type_handle(H5Tcopy(H5T_STD_REF_OBJ));
  }
}

/// Of a real number or an integer, as it may lie in a file.
inline hid_t stored(unsigned which, bool whole) {
  const std::array<hid_t, 4> reals{H5T_IEEE_F64LE, H5T_IEEE_F64BE, H5T_IEEE_F32LE, H5T_NATIVE_LDOUBLE};
  const std::array<hid_t, 4> integers{H5T_STD_I64LE, H5T_STD_I64BE, H5T_STD_I32LE, H5T_STD_U32BE};
  return (whole ? integers : reals)[which % 4];
}

inline std::string swapped(std::string name) {
  if (name.size() < 2) return name + "x";
  std::swap(name[0], name[1]);
  return name;
}

inline double odd_number(unsigned which) {
  constexpr double numbers[] = {std::numeric_limits<double>::quiet_NaN(),
                                std::numeric_limits<double>::infinity(),
                                -std::numeric_limits<double>::infinity(),
                                -1,
                                0,
                                2,
                                1e308,
                                5e-324};
  return numbers[which % std::size(numbers)];
}

}  // namespace unhand::fuzz
