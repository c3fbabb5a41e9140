#include "tests/fuzz/composer.hpp"

#include <algorithm>

#include "tests/fuzz/composer_types.hpp"

namespace unhand::fuzz {
namespace {

using namespace datasets::hdf5;

const std::string kTexts[] = {"",        "Würfe",        "W\xfcrfe", std::string(60'000, 'x'),
                              "a\tb\nc", "\xed\xa0\x80", "None"};
constexpr char kNotText = '\xff';
constexpr bool kIsUtf8[] = {true, true, false, true, true, false, true};

}  // namespace

bool Rule::holds(std::span<const double> values) const {
  for (std::size_t i = 0; i < values.size(); ++i) {
    if (!(values[i] >= low && values[i] <= high)) return false;
    if (increasing && i > 0 && values[i] <= values[i - 1]) return false;
  }
  return true;
}

Composer::Composer(const std::string& file, Choices& choices) : choices_(choices) {
  const unsigned kind = choices_.next();
  const Handle creation = list_handle(H5Pcreate(H5P_FILE_CREATE)),
               access = list_handle(H5Pcreate(H5P_FILE_ACCESS));
  if (kind == 1) H5Pset_libver_bounds(access.id(), H5F_LIBVER_LATEST, H5F_LIBVER_LATEST);
  if (kind == 2) H5Pset_userblock(creation.id(), 512);
  if (kind == 3) H5Pset_link_creation_order(creation.id(), H5P_CRT_ORDER_TRACKED | H5P_CRT_ORDER_INDEXED);
  if (kind == 4) H5Pset_sizes(creation.id(), 4, 4);
  file_ = file_handle(H5Fcreate(file.c_str(), H5F_ACC_TRUNC, creation.id(), access.id()));
  must(bool(file_));
}

Handle Composer::group(hid_t owner, const std::string& name, bool required) {
  const auto make = [&](const std::string& as) {
    if (as.find(kNotText) != std::string::npos) harm();
    Handle made = group_handle(H5Gcreate2(owner, as.c_str(), H5P_DEFAULT, H5P_DEFAULT, H5P_DEFAULT));
    must(bool(made));
    return made;
  };
  switch (choices_.next()) {
    default:
      return make(name);
    case 1:
      if (required) harm();
      return {};
    case 2:
      harm();
      dataset_handle(H5Dcreate2(owner, name.c_str(), H5T_NATIVE_DOUBLE, scalar().id(), H5P_DEFAULT,
                                H5P_DEFAULT, H5P_DEFAULT));
      return {};
    case 3:
      harm();
      make(swapped(name));
      return {};
    case 4:
      harm();
      H5Lcreate_soft("/nowhere", owner, name.c_str(), H5P_DEFAULT, H5P_DEFAULT);
      return {};
    case 5:
      harm();
      H5Lcreate_soft(name.c_str(), owner, name.c_str(), H5P_DEFAULT, H5P_DEFAULT);
      return {};
    case 6:
      harm();
      H5Lcreate_external("elsewhere.h5", "/", owner, name.c_str(), H5P_DEFAULT, H5P_DEFAULT);
      return {};
    case 7: {  // what a link inside the file leads to counts
      Handle aside = make("aside " + name);
      H5Lcreate_soft(("aside " + name).c_str(), owner, name.c_str(), H5P_DEFAULT, H5P_DEFAULT);
      return aside;
    }
  }
}

void Composer::extras(hid_t owner) {
  const unsigned what = choices_.next();
  if (what == 0 || what > 4) return;
  const Handle type = odd_type(choices_.next());
  if (what == 1) attribute(owner, "remark", type.id(), scalar().id(), 0, nullptr);
  if (what == 2) {
    for (int k = 0; k < 40; ++k)
      attribute(owner, ("remark " + std::to_string(k)).c_str(), H5T_NATIVE_INT, scalar().id(), H5T_NATIVE_INT,
                &k);
  }
  if (what == 3)
    dataset_handle(
        H5Dcreate2(owner, "remark", type.id(), block({3, 0, 2}).id(), H5P_DEFAULT, H5P_DEFAULT, H5P_DEFAULT));
  if (what == 4) H5Lcreate_hard(owner, ".", owner, "round again", H5P_DEFAULT, H5P_DEFAULT);
}

std::string Composer::name(const std::string& plain) {
  switch (choices_.next()) {
    default:
      return plain;
    case 1:
      return "Wurf " + plain;
    case 2:
      return std::string(3000, 'n') + plain;
    case 3:
      return "\xf0\x9f\xa4\xbe" + plain;
    case 4:
      return kNotText + plain;
  }
}

void Composer::attribute(hid_t owner, const char* name, hid_t type, hid_t space, hid_t memory,
                         const void* values) {
  const Handle made = attribute_handle(H5Acreate2(owner, name, type, space, H5P_DEFAULT, H5P_DEFAULT));
  must(bool(made));
  if (values != nullptr) must(H5Awrite(made.id(), memory, values) >= 0);
}

void Composer::odd_attribute(hid_t owner, const char* name, unsigned which) {
  harm();
  const Handle type = odd_type(which);
  attribute(owner, name, type.id(), scalar().id(), 0, nullptr);
}

void Composer::text(hid_t owner, const char* name, std::string value, bool required,
                    std::span<const std::string_view> good) {
  const auto write = [&](bool fixed, H5T_str_t pad, std::size_t copies = 1, std::size_t axes = 0) {
    const Handle type = type_handle(H5Tcopy(H5T_C_S1));
    if (copies != 1 || axes > 1) harm();
    const Handle space = axes == 0 ? scalar() : block(std::vector<hsize_t>(axes, copies));
    if (!fixed) {
      must(H5Tset_size(type.id(), H5T_VARIABLE) >= 0);
      const std::vector<const char*> all(std::max<std::size_t>(copies * copies, 1), value.c_str());
      attribute(owner, name, type.id(), space.id(), type.id(), all.data());
      return;
    }
    std::string bytes = value;
    bytes.resize(value.size() + 3, pad == H5T_STR_SPACEPAD ? ' ' : '\0');
    must(H5Tset_size(type.id(), bytes.size()) >= 0 && H5Tset_strpad(type.id(), pad) >= 0);
    std::string all;
    for (std::size_t k = 0; k < std::max<std::size_t>(copies * copies, 1); ++k) all += bytes;
    attribute(owner, name, type.id(), space.id(), type.id(), all.data());
  };
  switch (choices_.next()) {
    default:
      return write(false, H5T_STR_NULLTERM);
    case 1:
      if (required) harm();
      return;
    case 2:
      return odd_attribute(owner, name, choices_.next());
    case 3: {
      harm();
      const double number = 1;
      return attribute(owner, name, H5T_NATIVE_DOUBLE, scalar().id(), H5T_NATIVE_DOUBLE, &number);
    }
    case 4: {
      const unsigned which = choices_.pick(std::size(kTexts));
      value = kTexts[which];
      const bool known = good.empty() || std::find(good.begin(), good.end(), value) != good.end();
      if (!kIsUtf8[which] || !known) harm();
      return write(choices_.pick(2) == 1, H5T_STR_NULLTERM);
    }
    case 5:
      return write(true, H5T_STR_SPACEPAD);
    case 6:
      return write(true, H5T_STR_NULLPAD);
    case 7:
      return write(false, H5T_STR_NULLTERM, choices_.pick(4), 1);
    case 8:
      return write(true, H5T_STR_NULLTERM, 1, 2);
    case 9: {  // no value at all: HDF5 gives the empty text back, which is none of a list
      Handle type = type_handle(H5Tcopy(H5T_C_S1));
      H5Tset_size(type.id(), H5T_VARIABLE);
      if (!good.empty()) harm();
      return attribute(owner, name, type.id(), scalar().id(), 0, nullptr);
    }
    case 10:
      harm();
      return attribute(owner, swapped(name).c_str(), H5T_NATIVE_INT, scalar().id(), 0, nullptr);
  }
}

void Composer::number_attribute(hid_t owner, const char* name, const std::vector<double>& values, bool whole,
                                bool list) {
  const Handle space = list ? block({values.size()}) : scalar();
  attribute(owner, name, stored(choices_.next(), whole), space.id(), H5T_NATIVE_DOUBLE, values.data());
}

void Composer::integer(hid_t owner, const char* name, long long value, long long low, long long high,
                       bool required) {
  constexpr long long kOdd[] = {
      -1, 0, 2, 3, 1'000'001, (1LL << 32) + 2, std::numeric_limits<long long>::min()};
  switch (choices_.next()) {
    default:
      break;
    case 1:
      if (required) harm();
      return;
    case 2:
      return odd_attribute(owner, name, choices_.next());
    case 3:
      value = kOdd[choices_.pick(std::size(kOdd))];
      break;
    case 4: {
      harm();
      const auto real = static_cast<double>(value);
      return attribute(owner, name, H5T_NATIVE_DOUBLE, scalar().id(), H5T_NATIVE_DOUBLE, &real);
    }
    case 5:
      harm();
      return attribute(owner, name, H5T_NATIVE_INT, block({2}).id(), 0, nullptr);
    case 6:
      return number_attribute(owner, name, {static_cast<double>(value)}, true, choices_.pick(2) == 1);
  }
  if (value < low || value > high) harm();
  attribute(owner, name, H5T_STD_I64LE, scalar().id(), H5T_NATIVE_LLONG, &value);
}

void Composer::reals(hid_t owner, const char* name, std::vector<double> values,
                     const std::vector<std::size_t>& lengths, const Rule& rule, bool required) {
  const auto fits = [&](std::size_t n) {
    return lengths.empty() || std::find(lengths.begin(), lengths.end(), n) != lengths.end();
  };
  switch (choices_.next()) {
    default:
      break;
    case 1:
      if (required) harm();
      return;
    case 2:
      return odd_attribute(owner, name, choices_.next());
    case 3: {
      const unsigned at = choices_.next();
      values[at % values.size()] = odd_number(choices_.next());
      break;
    }
    case 4:
      values.resize(choices_.pick(6), 1e9);
      break;
    case 5:
      harm();
      return attribute(owner, name, H5T_NATIVE_DOUBLE, block({values.size(), 1}).id(), 0, nullptr);
    case 6:  // whole numbers are numbers
      for (double& value : values) value = std::ceil(value);
      if (!rule.holds(values)) harm();
      return number_attribute(owner, name, values, true, true);
    case 7:
      harm();
      return attribute(owner, name, H5T_C_S1, scalar().id(), 0, nullptr);
    case 8:
      if (!fits(0)) harm();
      return attribute(owner, name, H5T_NATIVE_DOUBLE, space_handle(H5Screate(H5S_NULL)).id(), 0, nullptr);
    case 9:
      return number_attribute(owner, name, values, false, true);
  }
  if (!fits(values.size()) || !rule.holds(values)) harm();
  const bool list = values.size() != 1;
  attribute(owner, name, H5T_NATIVE_DOUBLE, (list ? block({values.size()}) : scalar()).id(),
            H5T_NATIVE_DOUBLE, values.data());
}

}  // namespace unhand::fuzz
