// Bytes of a fuzzer as a whole HDF5 file: every byte is one decision about one group, dataset or attribute,
// and zero is what the schema says. So the file is always sound for libhdf5, and what is tested is our
// reader.
#pragma once

#include <hdf5.h>

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "datasets/hdf5_handles.hpp"

namespace unhand::fuzz {

using datasets::hdf5::Handle;

/// The bytes, one decision each; zeros when they are spent.
class Choices {
 public:
  Choices(const std::uint8_t* data, std::size_t size) : bytes_(data, size) {}
  unsigned next() { return at_ < bytes_.size() ? bytes_[at_++] : 0u; }
  /// 0 … n − 1
  unsigned pick(unsigned n) { return next() % n; }

 private:
  std::span<const std::uint8_t> bytes_;
  std::size_t at_ = 0;
};

/// What a value may be.
struct Rule {
  double low = -std::numeric_limits<double>::max(), high = std::numeric_limits<double>::max();
  bool increasing = false;
  bool holds(std::span<const double> values) const;
};
inline constexpr Rule kPositive{std::numeric_limits<double>::denorm_min()}, kNonNegative{0};

/// Writes an HDF5 file by decisions, and keeps count of whether the schema allows what it wrote.
class Composer {
 public:
  Composer(const std::string& file, Choices& choices);

  /// False as soon as anything was written that a reader has to refuse.
  bool allowed() const { return allowed_; }
  void harm() { allowed_ = false; }
  Choices& choices() { return choices_; }
  hid_t root() const { return file_.id(); }

  /// Makes the group, or what a decision puts in its place. An invalid handle: there is nothing to fill.
  Handle group(hid_t owner, const std::string& name, bool required);
  /// Something that no schema knows, which a reader ignores.
  void extras(hid_t owner);
  /// A name of a throw, an object or a surface: plain, or strange.
  std::string name(const std::string& plain);

  /// `good`: the values that count, or any text where there are none.
  void text(hid_t owner, const char* name, std::string value, bool required = true,
            std::span<const std::string_view> good = {});
  void integer(hid_t owner, const char* name, long long value, long long low, long long high,
               bool required = true);
  /// `lengths`: how many there may be; none named: any number.
  void reals(hid_t owner, const char* name, std::vector<double> values,
             const std::vector<std::size_t>& lengths, const Rule& rule, bool required = true);

  struct Table {
    std::size_t rows;
    std::string_view units;  ///< SI, by column
    bool time = false;       ///< strictly increasing
    bool required = true;
    std::span<const std::uint8_t> mask = {};  ///< 0: that row may be anything
  };
  void table(hid_t owner, const std::string& name, const Table& table);
  /// Which samples were tracked; may be absent.
  std::vector<std::uint8_t> flags(hid_t owner, const std::string& name, std::size_t rows);

 private:
  struct Extent;
  /// False: something else is there, or nothing.
  bool link(hid_t owner, std::string& name, unsigned how);
  void odd_attribute(hid_t owner, const char* name, unsigned which);
  void attribute(hid_t owner, const char* name, hid_t type, hid_t space, hid_t memory, const void* values);
  void number_attribute(hid_t owner, const char* name, const std::vector<double>& values, bool whole,
                        bool list);
  void units_of(hid_t dataset, std::string_view si);

  Choices& choices_;
  Handle file_;
  bool allowed_ = true;
};

}  // namespace unhand::fuzz
