#include "datasets/hdf5_extras.hpp"

#include <fmt/format.h>

#include <algorithm>

namespace unhand::datasets::hdf5 {
namespace {

const KnownNames* place_of(const std::string& name, const KnownNames& known) {
  const auto found = std::ranges::find_if(
      known.children, [&](const KnownNames& k) { return k.name.empty() || k.name == name; });
  return found == known.children.end() ? nullptr : &*found;
}

bool is_known_attribute(const std::string& name, const KnownNames& known) {
  return std::ranges::find(known.attributes, name) != known.attributes.end();
}

void add_extra_paths(const Node& at, const std::string& path, const KnownNames& known,
                     std::map<std::string, std::size_t>& out) {
  for (const std::string& name : at.attributes())
    if (!is_known_attribute(name, known)) ++out[path + "@" + name];
  if (H5Iget_type(at.id()) != H5I_GROUP) return;
  for (const std::string& name : at.children()) {
    const KnownNames* place = place_of(name, known);
    if (place)
      add_extra_paths(at.child(name), join(path, place->name.empty() ? "*" : name), *place, out);
    else
      ++out[join(path, name)];
  }
}

/// One walk through both files.
class Extras {
 public:
  explicit Extras(const Node& root) : root_(root) {}

  void take(const Node& old, hid_t made, const KnownNames& known) {
    for (const std::string& name : old.attributes())
      if (!is_known_attribute(name, known)) take_attribute(old, made, name);
    if (H5Iget_type(old.id()) != H5I_GROUP) return;
    for (const std::string& name : old.children()) {
      const KnownNames* place = place_of(name, known);
      if (!place) {
        take_child(old, made, name);
      } else if (H5Lexists(made, name.c_str(), H5P_DEFAULT) > 0) {
        const Handle there = object_handle(H5Oopen(made, name.c_str(), H5P_DEFAULT));
        take(old.child(name), there.id(), *place);
      }
    }
  }

  std::vector<std::string> left_out;

 private:
  [[noreturn]] void fail(const std::string& path) const {
    throw LogError(root_.file(), path, fmt::format("cannot be taken along ({})", last_message()));
  }

  /// Groups and datasets with all that is in them; a link to elsewhere stays one.
  void take_child(const Node& old, hid_t made, const std::string& name) const {
    const std::string path = join(old.path(), name);
    H5L_info_t link;
    if (H5Lget_info(old.id(), name.c_str(), &link, H5P_DEFAULT) < 0) fail(path);
    const Handle utf8 = list_handle(H5Pcreate(H5P_LINK_CREATE));
    H5Pset_char_encoding(utf8.id(), link.cset);
    if (link.type == H5L_TYPE_HARD) {
      if (H5Ocopy(old.id(), name.c_str(), made, name.c_str(), H5P_DEFAULT, utf8.id()) < 0) fail(path);
      return;
    }
    std::vector<char> value(link.u.val_size);
    if (H5Lget_val(old.id(), name.c_str(), value.data(), value.size(), H5P_DEFAULT) < 0) fail(path);
    const herr_t done =
        link.type == H5L_TYPE_SOFT
            ? H5Lcreate_soft(value.data(), made, name.c_str(), utf8.id(), H5P_DEFAULT)
            : H5Lcreate_ud(made, name.c_str(), link.type, value.data(), value.size(), utf8.id(), H5P_DEFAULT);
    if (done < 0) fail(path);
  }

  void take_attribute(const Node& old, hid_t made, const std::string& name) {
    const std::string path = old.path() + "@" + name;
    const Handle from = attribute_handle(H5Aopen(old.id(), name.c_str(), H5P_DEFAULT));
    const Handle stored = type_handle(H5Aget_type(from.id())), type = type_handle(H5Tcopy(stored.id()));
    const Handle space = space_handle(H5Aget_space(from.id()));
    const Handle how = list_handle(H5Aget_create_plist(from.id()));
    if (!type || !space || !how) fail(path);
    if (H5Tdetect_class(type.id(), H5T_REFERENCE) > 0) {
      left_out.push_back(path);
      return;
    }
    const Handle to =
        attribute_handle(H5Acreate2(made, name.c_str(), type.id(), space.id(), how.id(), H5P_DEFAULT));
    if (!to) fail(path);
    const hssize_t count = H5Sget_simple_extent_npoints(space.id());
    if (count == 0) return;
    const Handle native = type_handle(H5Tget_native_type(type.id(), H5T_DIR_DEFAULT));
    if (count < 0 || !native) fail(path);
    std::vector<char> values(static_cast<std::size_t>(count) * H5Tget_size(native.id()));
    const bool done = H5Aread(from.id(), native.id(), values.data()) >= 0 &&
                      H5Awrite(to.id(), native.id(), values.data()) >= 0;
    H5Dvlen_reclaim(native.id(), space.id(), H5P_DEFAULT, values.data());
    if (!done) fail(path);
  }

  const Node& root_;
};

}  // namespace

std::vector<std::string> take_extras(const Node& old, const Output& made, const KnownNames& known) {
  Extras extras(old);
  extras.take(old, made.id(), known);
  return std::move(extras.left_out);
}

std::map<std::string, std::size_t> extra_paths(const Node& root, const KnownNames& known) {
  std::map<std::string, std::size_t> out;
  add_extra_paths(root, "/", known, out);
  return out;
}

}  // namespace unhand::datasets::hdf5
