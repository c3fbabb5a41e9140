#include "datasets/hdf5_reader.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <climits>
#include <filesystem>

#include "datasets/file_kind.hpp"
#include "datasets/hdf5_driver.hpp"
#include "datasets/hdf5_lzf.hpp"
#include "datasets/near_miss.hpp"

namespace unhand::datasets::hdf5 {
namespace {

namespace fs = std::filesystem;

constexpr std::size_t longest_text = 1 << 20;       // bytes of one string attribute
constexpr std::size_t longest_attribute = 100'000;  // numbers in one attribute

void misspelt(const std::vector<std::string>& present, std::span<const std::string_view> known, auto&& fail) {
  const auto is_present = [&](std::string_view name) {
    return std::find(present.begin(), present.end(), name) != present.end();
  };
  std::vector<std::string_view> missing;
  for (const std::string_view name : known) {
    if (!is_present(name)) missing.push_back(name);
  }
  for (const std::string& name : present) {
    if (std::find(known.begin(), known.end(), name) != known.end()) continue;
    const std::string_view meant = nearest_name(name, missing);
    if (!meant.empty())
      fail(name, fmt::format("unknown name, and '{}' is missing: did you mean '{}'?", meant, meant));
  }
}

herr_t keep(const char* name, void* out) noexcept {
  try {
    static_cast<std::vector<std::string>*>(out)->emplace_back(name);
    return 0;
  } catch (...) {
    return -1;
  }
}

}  // namespace

Node::Node(std::shared_ptr<Shared> shared, Handle object, std::string path)
    : shared_(std::move(shared)), object_(std::move(object)), path_(std::move(path)) {}

Node Node::open_file(const std::string& file, Place* place) {
  std::error_code error;
  const fs::file_status status = fs::status(file, error);
  if (!fs::exists(status)) throw LogError(file, "", "no such file");
  if (fs::is_directory(status)) throw LogError(file, "", "is a directory, not a file");
  if (!fs::is_regular_file(status)) throw LogError(file, "", "is not a regular file");
  if (fs::file_size(file, error) == 0) throw LogError(file, "", "is empty, not an HDF5 file");
  const htri_t is_hdf5 = H5Fis_hdf5(file.c_str());
  if (is_hdf5 < 0) throw LogError(file, "/", fmt::format("cannot be opened ({})", last_message()));
  if (is_hdf5 == 0) throw LogError(file, "", with_kind("is not an HDF5 file", kind_of_file(file)));
  Handle access = list_handle(H5Pcreate(H5P_FILE_ACCESS));
#if H5_VERSION_GE(1, 10, 7)
  H5Pset_file_locking(access.id(), false, true);  // reading must work on a read-only disk
#endif
  if (read_plainly(access.id()) < 0)
    throw LogError(file, "/", fmt::format("cannot be opened ({})", last_message()));
  read_lzf();
  Handle opened = file_handle(H5Fopen(file.c_str(), H5F_ACC_RDONLY, access.id()));
  if (!opened) throw LogError(file, "/", fmt::format("is truncated or damaged ({})", last_message()));
  Handle root = group_handle(H5Gopen2(opened.id(), "/", H5P_DEFAULT));
  if (!root) throw LogError(file, "/", fmt::format("is truncated or damaged ({})", last_message()));
  auto shared = std::make_shared<Shared>(Shared{file, place, element_budget, std::move(opened)});
  return {std::move(shared), std::move(root), "/"};
}

void Node::fail(std::string_view name, const std::string& reason) const {
  throw LogError(shared_->file, join(path_, name), reason);
}

void Node::fail_attribute(std::string_view name, const std::string& reason) const {
  throw LogError(shared_->file, path_ + "@" + std::string(name), reason);
}

void Node::note(const std::string& path) const {
  if (shared_->place) shared_->place->note(path);
}

std::vector<std::string> Node::children() const {
  note(path_);
  const auto visit = [](hid_t, const char* name, const H5L_info_t*, void* out) -> herr_t {
    return keep(name, out);
  };
  std::vector<std::string> names;
  if (H5Literate(object_.id(), H5_INDEX_NAME, H5_ITER_INC, nullptr, visit, &names) < 0) {
    fail("", fmt::format("its contents cannot be listed ({})", last_message()));
  }
  return names;
}

std::vector<std::string> Node::attributes() const {
  note(path_);
  const auto visit = [](hid_t, const char* name, const H5A_info_t*, void* out) -> herr_t {
    return keep(name, out);
  };
  std::vector<std::string> names;
  if (H5Aiterate2(object_.id(), H5_INDEX_NAME, H5_ITER_INC, nullptr, visit, &names) < 0) {
    fail("", fmt::format("its attributes cannot be listed ({})", last_message()));
  }
  return names;
}

bool Node::has(std::string_view name) const {
  const htri_t there = H5Lexists(object_.id(), std::string(name).c_str(), H5P_DEFAULT);
  if (there < 0) fail(name, fmt::format("cannot be looked up ({})", last_message()));
  return there > 0;
}

bool Node::has_attribute(std::string_view name) const {
  const htri_t there = H5Aexists(object_.id(), std::string(name).c_str());
  if (there < 0) fail_attribute(name, fmt::format("cannot be looked up ({})", last_message()));
  return there > 0;
}

void Node::reject_misspelt(std::span<const std::string_view> known_children,
                           std::span<const std::string_view> known_attributes) const {
  if (!known_children.empty()) {
    misspelt(children(), known_children,
             [&](const std::string& name, const std::string& why) { fail(name, why); });
  }
  if (!known_attributes.empty()) {
    misspelt(attributes(), known_attributes,
             [&](const std::string& name, const std::string& why) { fail_attribute(name, why); });
  }
}

/// A log is one file: what it names must be in it.
void Node::check_link(std::string_view name) const {
  H5L_info_t link;
  const bool known = H5Lget_info(object_.id(), std::string(name).c_str(), &link, H5P_DEFAULT) >= 0;
  if (!known || (link.type != H5L_TYPE_HARD && link.type != H5L_TYPE_SOFT))
    fail(name, "is a link out of the file");
}

Node Node::group(std::string_view name) const {
  note(join(path_, name));
  if (!has(name)) fail(name, "required group is missing");
  Node out = child(name);
  if (H5Iget_type(out.id()) != H5I_GROUP) fail(name, "is not a group");
  return out;
}

Node Node::child(std::string_view name) const {
  check_link(name);
  Handle object = object_handle(H5Oopen(object_.id(), std::string(name).c_str(), H5P_DEFAULT));
  if (!object) fail(name, fmt::format("cannot be opened ({})", last_message()));
  return {shared_, std::move(object), join(path_, name)};
}

Handle Node::open_attribute(std::string_view name, H5T_class_t& kind, std::size_t& count) const {
  note(path_ + "@" + std::string(name));
  if (!has_attribute(name)) fail_attribute(name, "required attribute is missing");
  Handle attribute = attribute_handle(H5Aopen(object_.id(), std::string(name).c_str(), H5P_DEFAULT));
  if (!attribute) fail_attribute(name, fmt::format("cannot be opened ({})", last_message()));
  const Handle type = type_handle(H5Aget_type(attribute.id()));
  const Handle space = space_handle(H5Aget_space(attribute.id()));
  kind = H5Tget_class(type.id());
  const hssize_t n = H5Sget_simple_extent_npoints(space.id());
  const int rank = H5Sget_simple_extent_ndims(space.id());
  if (n < 0 || rank < 0) fail_attribute(name, fmt::format("its shape cannot be read ({})", last_message()));
  if (rank > 1) fail_attribute(name, fmt::format("wrong shape: {} axes, expected a scalar or a list", rank));
  if (static_cast<std::size_t>(n) > longest_attribute)
    fail_attribute(name, fmt::format("absurd size: {} values", n));
  count = static_cast<std::size_t>(n);
  return attribute;
}

namespace {

/// Reads the one string of an attribute, fixed or variable length; the reason when it cannot be had goes to
/// `why`.
std::string read_text(const Handle& attribute, std::size_t count, std::string& why) {
  const Handle type = type_handle(H5Aget_type(attribute.id()));
  if (H5Tget_class(type.id()) != H5T_STRING) {
    why = fmt::format("wrong type: {}, expected text", class_name(H5Tget_class(type.id())));
    return {};
  }
  if (count != 1) {
    why = fmt::format("wrong shape: {} strings, expected one", count);
    return {};
  }
  std::string text;
  bool ok = false;
  if (H5Tis_variable_str(type.id()) > 0) {
    char* content = nullptr;
    const Handle memory = type_handle(H5Tcopy(H5T_C_S1));
    H5Tset_size(memory.id(), H5T_VARIABLE);
    H5Tset_cset(memory.id(), H5Tget_cset(type.id()));
    ok = H5Aread(attribute.id(), memory.id(), static_cast<void*>(&content)) >= 0;
    if (content != nullptr) text = content;
    H5free_memory(content);
  } else if (const std::size_t size = H5Tget_size(type.id()); size <= longest_text) {
    text.resize(size);
    ok = H5Aread(attribute.id(), type.id(), text.data()) >= 0;
    text.resize(std::min(text.find('\0'), text.size()));
    if (H5Tget_strpad(type.id()) == H5T_STR_SPACEPAD) text.resize(text.find_last_not_of(' ') + 1);
  } else {
    why = fmt::format("absurd size: a string of {} bytes", size);
    return {};
  }
  if (!ok)
    why = fmt::format("cannot be read ({})", last_message());
  else if (!is_utf8_text(text))
    why = "is not UTF-8 text";
  return text;
}

/// Reads the numbers of an attribute.
std::vector<double> read_numbers(const Handle& attribute, std::size_t count, std::string& why) {
  const Handle type = type_handle(H5Aget_type(attribute.id()));
  const H5T_class_t kind = H5Tget_class(type.id());
  if (kind != H5T_FLOAT && kind != H5T_INTEGER) {
    why = fmt::format("wrong type: {}, expected numbers", class_name(kind));
    return {};
  }
  std::vector<double> values(count);
  if (count > 0 && H5Aread(attribute.id(), H5T_NATIVE_DOUBLE, values.data()) < 0) {
    why = fmt::format("cannot be read ({})", last_message());
  }
  return values;
}

}  // namespace

std::string Node::text(std::string_view name) const {
  H5T_class_t kind{};
  std::size_t count = 0;
  const Handle attribute = open_attribute(name, kind, count);
  std::string why;
  std::string text = read_text(attribute, count, why);
  if (!why.empty()) fail_attribute(name, why);
  return text;
}

long long Node::integer(std::string_view name) const {
  H5T_class_t kind{};
  std::size_t count = 0;
  const Handle attribute = open_attribute(name, kind, count);
  if (kind != H5T_INTEGER)
    fail_attribute(name, fmt::format("wrong type: {}, expected an integer", class_name(kind)));
  if (count != 1) fail_attribute(name, fmt::format("wrong shape: {} values, expected 1", count));
  long long value = 0;
  if (H5Aread(attribute.id(), H5T_NATIVE_LLONG, &value) < 0) {
    fail_attribute(name, fmt::format("cannot be read ({})", last_message()));
  }
  return value;
}

std::vector<double> Node::reals(std::string_view name, std::size_t n) const {
  H5T_class_t kind{};
  std::size_t count = 0;
  const Handle attribute = open_attribute(name, kind, count);
  std::string why;
  std::vector<double> values = read_numbers(attribute, count, why);
  if (!why.empty()) fail_attribute(name, why);
  if (n != 0 && count != n)
    fail_attribute(name, fmt::format("wrong shape: {} values, expected {}", count, n));
  return values;
}

void AttributeReader::operator()(std::string_view name, int& value, const Range& range) const {
  const long long wide = node.integer(name);
  if (wide < INT_MIN || wide > INT_MAX)
    node.fail_attribute(name, fmt::format("{} is not {}", wide, range.text));
  value = static_cast<int>(wide);
}

void AttributeReader::operator()(std::string_view name, Split& split) const {
  const std::string text = node.text(name);
  if (text != "train" && text != "test")
    node.fail_attribute(name, fmt::format("'{}' is not 'train' or 'test'", text));
  split = text == "train" ? Split::train : Split::test;
}

void AttributeReader::operator()(std::string_view name, std::array<double, 3>& values, const Range&) const {
  const std::vector<double> list = node.reals(name, 3);
  std::copy(list.begin(), list.end(), values.begin());
}

void AttributeReader::operator()(std::string_view name, std::pair<double, double>& interval) const {
  const std::vector<double> list = node.reals(name, 2);
  interval = {list[0], list[1]};
}

void check_schema(const Node& root, std::string_view schema, int version) {
  const std::string_view known[] = {"schema", "schema_version"};
  root.reject_misspelt({}, known);
  const std::string found = root.text("schema");
  if (found != schema) root.fail_attribute("schema", fmt::format("is '{}', expected '{}'", found, schema));
  const long long number = root.integer("schema_version");
  if (number != version) {
    root.fail_attribute("schema_version",
                        fmt::format("version {} is not supported (known: {})", number, version));
  }
}

}  // namespace unhand::datasets::hdf5
